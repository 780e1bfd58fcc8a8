# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Differences of strategies over shared seeds, against an independent test and against known coverage."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_rel

from soilmoist_ros.lab.paired import (
    QUANTITIES,
    difference_interval,
    paired_differences,
    paired_table,
)


def missions(values, field="smooth"):
    """Missions with values of mse by strategy and seed; the other quantities are ten times that."""
    return pd.DataFrame(
        [
            {
                "field": field, "strategy": strategy, "dwell": "fmi:60", "seed": seed,
                **{name: mse * (1 if name == "mse" else 10) for name in QUANTITIES},
            }
            for strategy, by_seed in values.items()
            for seed, mse in by_seed.items()
        ]
    )  # fmt: skip


def test_the_interval_is_that_of_the_paired_t_test():
    rng = np.random.default_rng(3)
    mine, theirs = rng.normal(5, 2, 12), rng.normal(4, 2, 12)
    expected = ttest_rel(mine, theirs).confidence_interval(0.95)
    mean, low, high = difference_interval(mine, theirs)
    assert mean == pytest.approx(mine.mean() - theirs.mean())
    assert (low, high) == (pytest.approx(expected.low), pytest.approx(expected.high))


def test_intervals_cover_the_true_difference_as_often_as_they_say():
    rng = np.random.default_rng(8)
    seeds = rng.normal(0, 10, (4000, 6))  # what the pairs share is far larger than the difference
    mine, theirs = seeds + rng.normal(0.7, 0.5, seeds.shape), seeds + rng.normal(0, 0.5, seeds.shape)
    covered = [low < 0.7 < high for _, low, high in map(difference_interval, mine, theirs)]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.012)


def test_only_shared_seeds_count_and_what_the_seeds_share_does_not_hide_a_difference():
    gcb = {1: 1.0, 2: 11.0, 3: 21.0, 9: 500.0}
    random = {1: 2.0, 2: 12.1, 3: 21.9, 7: 0.0}
    (one,) = [one for one in paired_differences(missions({"gcb": gcb, "random": random})) if one.quantity == "mse"]
    assert (one.strategy, one.other_strategy, one.pairs) == ("gcb", "random", 3)
    assert (one.mean, one.other_mean, one.difference) == (11.0, pytest.approx(12.0), pytest.approx(-1.0))
    assert one.clear
    assert one.low == pytest.approx(-1.0 - 4.302653 * 0.1 / math.sqrt(3), rel=1e-6)


def test_all_pairs_of_each_case_are_in_the_table_and_missing_values_are_left_out():
    one = missions({"gcb": {1: 1.0, 2: 2.0}, "ivr": {1: 2.0, 2: math.nan}, "random": {5: 1.0}})
    table = paired_table(pd.concat([one, missions({"gcb": {1: 1.0}, "ivr": {1: 1.5}}, "rough")]), ["field"])
    found = table[table["quantity"] == "mse"].set_index("field")
    assert found.loc["smooth", "pairs"] == 1, "gcb and ivr share one seed with both values"
    assert math.isnan(found.loc["smooth", "low"])
    assert found.loc["rough", "difference"] == -0.5
    assert set(table["quantity"]) == set(QUANTITIES)
    assert paired_table(missions({"gcb": {1: 1.0}}), ["field"]).empty
