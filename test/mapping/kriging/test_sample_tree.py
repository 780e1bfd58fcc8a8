# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples merged on all scales: nothing is lost, and what is near stays as it is."""

import numpy as np

from soilmoist_ros.mapping import Samples
from soilmoist_ros.mapping.kriging.sample_tree import SampleTree

RNG = np.random.default_rng(5)
SAMPLES = Samples(RNG.uniform(0, 1000, (500, 2)), RNG.poisson(40, 500), RNG.uniform(5, 20, 500))
LOW, HIGH = np.array([480.0, 480.0]), np.array([520.0, 520.0])


def distance_m(xy):
    gap = np.maximum(np.maximum(LOW - xy, xy - HIGH), 0)
    return np.hypot(gap[:, 0], gap[:, 1])


def test_all_counts_and_exposure_are_in_the_neighbourhood():
    near = SampleTree(SAMPLES).neighbourhood(LOW, HIGH, 60.0, np.inf, 0.35)
    assert len(near.rate) < len(SAMPLES)
    np.testing.assert_allclose((near.rate * near.exposure_s).sum(), SAMPLES.counts.sum())
    np.testing.assert_allclose(near.exposure_s.sum(), SAMPLES.exposure_s.sum())


def test_samples_within_the_margin_are_not_merged():
    near = SampleTree(SAMPLES).neighbourhood(LOW, HIGH, 60.0, np.inf, 0.35)
    inside = SAMPLES.xy[distance_m(SAMPLES.xy) <= 60.0]
    found = {tuple(place) for place in near.xy.tolist()}
    assert len(inside) > 5
    assert found.issuperset(map(tuple, inside.tolist()))


def test_without_opening_nothing_is_merged_and_beyond_the_reach_nothing_is_left():
    near = SampleTree(SAMPLES).neighbourhood(LOW, HIGH, 0.0, 200.0, 0.0)
    expected = SAMPLES.xy[distance_m(SAMPLES.xy) <= 200.0]
    np.testing.assert_array_equal(np.sort(near.xy, axis=0), np.sort(expected, axis=0))


def test_the_margin_holds_the_number_of_samples_at_most():
    tree = SampleTree(SAMPLES)
    margin_m = tree.margin_m(LOW, HIGH, 30)
    assert 0 < np.count_nonzero(distance_m(SAMPLES.xy) < margin_m) <= 30
    assert tree.margin_m(LOW, HIGH, 500) == np.inf
    assert tree.margin_m(np.zeros(2), np.full(2, 1000.0), 3) < 0, "the square alone holds more"
