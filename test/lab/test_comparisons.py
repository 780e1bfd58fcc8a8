# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Comparisons over shared seeds and in hindsight, against independent tests and known coverage: comparisons.py."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_rel

from soilmoist_ros.lab.campaign_file import Campaign, missions
from soilmoist_ros.lab.comparisons import (
    LATTICE_DWELLS,
    LATTICES,
    QUANTITIES,
    difference_interval,
    hindsight_table,
    paired_differences,
    paired_ratio,
    paired_table,
)


def table_of(values, field="smooth"):
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


def test_only_shared_seeds_count_and_what_the_seeds_share_does_not_hide_a_difference():
    gcb = {1: 1.0, 2: 11.0, 3: 21.0, 9: 500.0}
    random = {1: 2.0, 2: 12.1, 3: 21.9, 7: 0.0}
    (one,) = [
        one for one in paired_differences(table_of({"gcb": gcb, "random": random})) if one["quantity"] == "mse"
    ]
    assert (one["strategy"], one["other_strategy"], one["pairs"]) == ("gcb", "random", 3)
    assert (one["mean"], one["other_mean"], one["difference"]) == pytest.approx((11.0, 12.0, -1.0))
    assert one["low"] == pytest.approx(-1.0 - 4.302653 * 0.1 / math.sqrt(3), rel=1e-6)


def test_all_pairs_of_each_case_are_in_the_table_and_missing_values_are_left_out():
    one = table_of({"gcb": {1: 1.0, 2: 2.0}, "two_pass": {1: 2.0, 2: math.nan}, "random": {5: 1.0}})
    table = paired_table(pd.concat([one, table_of({"gcb": {1: 1.0}, "two_pass": {1: 1.5}}, "rough")]), ["field"])
    found = table[table["quantity"] == "mse"].set_index("field")
    assert found.loc["smooth", "pairs"] == 1, "gcb and two_pass share one seed with both values"
    assert math.isnan(found.loc["smooth", "low"])
    assert found.loc["rough", "difference"] == -0.5
    assert set(table["quantity"]) == set(QUANTITIES)
    assert paired_table(table_of({"gcb": {1: 1.0}}), ["field"]).empty


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), factor=st.floats(0.1, 10))
def test_the_ratio_of_equal_shares_is_exact_and_its_error_is_that_of_a_bootstrap(seed, factor):
    rng = np.random.default_rng(seed)
    theirs = rng.uniform(1, 2, 400)
    assert paired_ratio(factor * theirs, theirs) == (pytest.approx(factor), pytest.approx(0.0, abs=1e-12))
    mine = theirs * rng.uniform(0.8, 1.2, 400)
    value, error = paired_ratio(mine, theirs)
    drawn = [paired_ratio(mine[i], theirs[i])[0] for i in rng.integers(400, size=(200, 400))]
    assert value == pytest.approx(mine.sum() / theirs.sum())
    assert error == pytest.approx(np.std(drawn), rel=0.3)
    assert math.isnan(paired_ratio(mine[:1], theirs[:1])[1])


def lattices(seeds=(1, 2, 3)):
    """Lattices whose errors at a quarter rise with the dwell, and fall with it at the end."""
    return {
        name: {seed: (10.0 * seed * (n + 1), 1.0 * seed / (n + 1), 100.0 * (n + 1)) for seed in seeds}
        for n, name in enumerate(LATTICES)
    }


def against(outcomes, case="a"):
    """Table of one case, from error at a quarter and at the end, and distance, by combination and seed."""
    rows = [
        (case, strategy, dwell, seed, *one)
        for (strategy, dwell), some in outcomes.items()
        for seed, one in some.items()
    ]
    columns = ["field", "strategy", "dwell", "seed", "mse_quarter", "mse", "distance_m"]
    return hindsight_table(pd.DataFrame(rows, columns=columns), ["field"])


def test_the_best_lattices_at_a_quarter_and_at_the_end_may_differ():
    gcb = {seed: (5.0 * seed, 0.2 * seed, 600.0) for seed in (1, 2, 3)}
    one = against({**lattices(), ("gcb", "optimal"): gcb}).iloc[-1]
    assert (one.strategy, one.dwell, one.pairs) == ("gcb", "optimal", 3)
    assert (one.quarter_best, one.end_best) == ("fmi:10", "fmi:60")
    assert (one.quarter_ratio, one.end_ratio) == (pytest.approx(0.5), pytest.approx(0.8))
    assert (one.distance_ratio, one.end_best_distance_m) == (pytest.approx(1.5), 400.0)
    assert one.end_ratio_se == pytest.approx(0.0)


def test_only_paired_seeds_count_and_all_lattices_are_needed():
    more = {seed: (5.0, 0.2 if seed < 4 else 99.0, 600.0) for seed in (2, 3, 4, 5)}
    one = against({**lattices(), ("gcb", "optimal"): more}).iloc[-1]
    assert (one.pairs, one.mse) == (2, pytest.approx(0.2))
    few = lattices()
    del few[LATTICES[2]]
    assert against(few).empty
    assert against({}).empty
    apart = {name: {n: (1.0, 1.0, 1.0)} for n, name in enumerate(LATTICES)}
    assert against({**apart, ("gcb", "optimal"): more}).empty
    unmapped = {**lattices(), LATTICES[0]: dict.fromkeys((1, 2, 3), (math.nan, math.nan, 1.0))}
    assert (against(unmapped).quarter_best == "fmi:20").all(), "a lattice without a map is never the best"
    assert against(lattices())["end_ratio"].tolist() == pytest.approx([4, 2, 4 / 3, 1])


def test_an_experiment_with_hindsight_runs_the_lattices_too():
    def planned(hindsight, **choices):
        experiment = {"name": "one", "field": ["rough", "smooth"], "hindsight": hindsight, **choices}
        found = missions(Campaign.model_validate({"title": "t", "runs": 2, "experiments": [experiment]}))
        return [
            (str(m.settings.strategy), str(m.settings.dwell), m.settings.field, m.settings.seed) for m in found
        ]

    alone = planned(False, strategy="gcb", dwell="optimal")
    both = planned(True, strategy="gcb", dwell="optimal")
    assert both[: len(alone)] == alone
    assert set(both[len(alone) :]) == {
        ("lattice", dwell, field, seed)
        for dwell in LATTICE_DWELLS
        for field in ("rough", "smooth")
        for seed in (1, 2)
    }
    assert len(both) == len(alone) + 16
    assert len(planned(True, strategy=["gcb", "lattice"], dwell=["fmi:20"])) == 4 + 16
