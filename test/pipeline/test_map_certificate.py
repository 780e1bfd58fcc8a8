# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.exploration import sample_from_text
from soilmoist_ros.exploration.planning.sealed_sample import drawn
from soilmoist_ros.pipeline import map_certificate
from soilmoist_ros.pipeline.map_certificate import error_bound, state
from soilmoist_ros.simulation import MissionSettings, simulate_mission, simulated_site, surrogate_field

MASK = np.ones((25, 30), bool)


def field(skewed):
    """A true rate, and a map of it: errors of one size, or large ones in a tenth of the field [counts/s]."""
    rng = np.random.default_rng(3)
    truth = 3.6 + 0.5 * np.sin(np.arange(750) / 90)
    error = rng.normal(0, 0.15, 750)
    return truth, truth + 0.1 + (error * np.where(np.arange(750) % 300 < 30, 3, 0.6) if skewed else error)


@pytest.mark.parametrize("skewed", [False, True])
@pytest.mark.parametrize("moist", [False, True])
def test_intervals_cover_what_they_say_whatever_the_map(skewed, moist):
    truth, p = field(skewed)
    curve = simulated_site(surrogate_field("synthetic-low")).curve if moist else None
    of_truth = truth if curve is None else curve.vwc(truth)
    mse = np.mean((p - truth) ** 2 * (1 if curve is None else curve.slope(p) ** 2))
    rng, exposure_s = np.random.default_rng(4), np.full(12, 80.0)
    covered, below = [], []
    for seed in range(400):
        at = drawn(MASK, 12, seed)
        made = state(p, at, rng.poisson(truth[at] * exposure_s).astype(float), exposure_s, curve)
        covered.append(abs(made.mean - of_truth.mean()) <= made.half_width)
        below.append(made.rmse_below is None or made.rmse_below**2 >= mse)
    assert 0.92 <= np.mean(covered) <= 0.985
    assert np.mean(below) >= 0.93


def test_the_bound_falls_with_exposure_and_rises_with_kurtosis():
    bounds = [error_bound(np.full(12, 0.06 + noise), np.full(12, noise)) for noise in (0.06, 0.03, 0.01)]
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[-1] > 0.06
    square = np.full(12, 0.09)
    assert error_bound(square, np.full(12, 0.03), 3.0) < bounds[1] < error_bound(square, np.full(12, 0.03), 20.0)
    assert error_bound(np.full(8, 5e-3), np.full(8, 4e-3), 4590.0) == np.inf  # of soil so wet that all is possible
    assert error_bound(0 * square, np.full(12, 0.03)) == error_bound(np.full(12, 0.03), np.full(12, 0.03))


def test_the_map_to_compare_with_has_nothing_of_the_sample():
    settings = MissionSettings(field="synthetic-low", hours=0.6, cell_m=5.0, series_every_s=1e9, certify=5)
    result = simulate_mission(settings)
    sample, visits = sample_from_text(result.certificate), sorted(result.visits, key=lambda one: one.arrived_s)
    others = map_certificate._without_sample(result.records, visits, sample, stops_only=False)
    stamps = np.array([record.stamp_s for record in others])
    assert 0.5 < len(others) / len(result.records) < 0.95
    for before, visit in zip([None, *visits], visits, strict=False):
        if visit.name in sample.names:
            since_s = 0.0 if before is None else before.end_stamp_s
            assert not ((stamps > since_s + 1) & (stamps < visit.end_stamp_s + 1)).any()
    only = map_certificate._without_sample(result.records, visits, sample, stops_only=True)
    assert 0 < len(only) < len(others)
