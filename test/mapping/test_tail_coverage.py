# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Misses of the quantiles of the moisture on both sides, as ``scripts/tail_coverage.py`` counts them."""

import numpy as np
import pytest

from soilmoist_ros.simulation.fields.catalogue import surrogate_field

SEEDS = 12


@pytest.fixture(scope="module")
def script(load_script):
    return load_script("tail_coverage.py")


@pytest.mark.slow
@pytest.mark.parametrize(("share", "dwell_s"), [(1.0, 60.0), (0.1, 10.0)])
def test_the_quantiles_miss_equally_often_on_both_sides(script, share, dwell_s):
    """The interval vwc +- 1.645 vwc_sd has nearly all its misses above."""
    found = []
    for seed in range(SEEDS):
        rng = np.random.default_rng([seed, 7])
        found.append(script.survey(surrogate_field("rough", rng), 40, dwell_s, share, rng))
    misses = script.Misses(*np.mean(found, axis=0))
    assert 0.015 < misses.below < 0.085
    assert 0.015 < misses.above < 0.085
    assert misses.symmetric_below < 0.015 < 0.04 < misses.symmetric_above
