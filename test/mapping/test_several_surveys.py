# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging of several surveys together, and the significance of a change."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtri

from soilmoist_ros.mapping import FieldGrid, LocalRate, PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.several_surveys import JointKriging, Persistence, field_change, moisture_slope
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

VARIOGRAM = Variogram("matern32", 0.02, 12.0, 0.3)
CELLS = np.stack(np.meshgrid(np.arange(5.0, 60, 10), np.arange(5.0, 50, 10)), -1).reshape(-1, 2)


def covariance(xy: np.ndarray) -> np.ndarray:
    lag = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return VARIOGRAM.structured_sill * VARIOGRAM.correlation(lag)


def draw(rng: np.random.Generator, share: float, counts: int = 60, surveys: int = 2, exposure_s: float = 400.0):
    xy = rng.uniform(0, (60, 50), (counts * surveys, 2))
    places = np.concatenate([xy, CELLS])
    lower = np.linalg.cholesky(covariance(places) + 1e-9 * np.eye(len(places)))
    correlation = Persistence(share).matrix(np.zeros(surveys))
    parts = np.linalg.cholesky(correlation) @ rng.standard_normal((surveys, len(places))) @ lower.T
    found, truth = [], []
    for number in range(surveys):
        mean = 4.0 + number
        rate = mean + parts[number] + np.sqrt(VARIOGRAM.nugget) * rng.standard_normal(len(places))
        mine = slice(number * counts, (number + 1) * counts)
        found.append(Samples(xy[mine], rng.poisson(rate[mine] * exposure_s), np.full(counts, exposure_s)))
        truth.append(mean + parts[number][len(xy) :])
    return found, np.array(truth)


def test_one_survey_alone_is_its_poisson_kriging():
    (samples,), _ = draw(np.random.default_rng(1), 1.0, surveys=1)
    alone = PoissonKriging(VARIOGRAM, keep_nugget=False, mean_rate=LocalRate.of(samples, VARIOGRAM))
    expected = alone.fit(samples.xy, samples.counts, samples.exposure_s).predict(CELLS)
    np.testing.assert_allclose(
        JointKriging(VARIOGRAM, [samples], np.eye(1)).predict(CELLS, 0), expected, rtol=1e-7
    )


def test_unrelated_surveys_change_nothing():
    surveys, _ = draw(np.random.default_rng(2), 0.0)
    both = JointKriging(VARIOGRAM, surveys, np.eye(2))
    for number in (0, 1):
        alone = JointKriging(VARIOGRAM, [surveys[number]], np.eye(1)).predict(CELLS, 0)
        np.testing.assert_allclose(both.predict(CELLS, number), alone, rtol=1e-9)
    change, variance = both.predict(CELLS, 1, 0)
    np.testing.assert_allclose(change, both.predict(CELLS, 1)[0] - both.predict(CELLS, 0)[0])
    np.testing.assert_allclose(variance, both.predict(CELLS, 1)[1] + both.predict(CELLS, 0)[1])


@pytest.mark.slow
def test_intervals_of_maps_changes_and_mean_changes_cover_the_truth():
    inside = np.zeros(4)
    rng, runs = np.random.default_rng(4), 40
    weight = np.full(len(CELLS), 1 / len(CELLS))
    for _ in range(runs):
        surveys, truth = draw(rng, 0.8)
        kriging = JointKriging(VARIOGRAM, surveys, Persistence(0.8).matrix([0.0, 0.0]))
        answers = [kriging.predict(CELLS, 0), kriging.predict(CELLS, 1), kriging.predict(CELLS, 1, 0)]
        for number, (true, (value, variance)) in enumerate(
            zip([*truth, truth[1] - truth[0]], answers, strict=True)
        ):
            inside[number] += np.mean(np.abs(value - true) < 1.96 * np.sqrt(variance))
        value, variance = kriging.mean(CELLS, {1: weight, 0: -weight})
        inside[3] += abs(value - (truth[1] - truth[0]).mean()) < 1.96 * math.sqrt(variance)
    assert (inside / runs > 0.87).all()
    assert (inside[:3] / runs < 0.985).all()


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_the_persistence_is_found(share):
    found = [
        Persistence.estimate(VARIOGRAM, draw(np.random.default_rng(seed), share, 80, 2)[0], [0.0, 1e6])
        for seed in range(6)
    ]
    mean = np.mean([one.share for one in found])
    assert mean == pytest.approx(share, abs=0.15 if share else 0.3)  # it cannot be below 0, so its mean is above


def test_the_persistence_fades_with_the_days():
    matrix = Persistence(0.9, 0.0, 10.0).matrix([0.0, 864_000.0, 1_728_000.0])
    np.testing.assert_allclose(matrix[0], [1.0, 0.9 / math.e, 0.9 / math.e**2])


GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=5.0)
CHANGED = Variogram("matern32", 0.01, 12.0, 0.3)
CURVE = CalibrationCurve(8.0, 1.4)


def survey(rng: np.random.Generator, rate) -> Samples:
    xy = rng.uniform(0, (60, 50), (100, 2))
    return Samples(xy, rng.poisson(rate(xy) * 1500.0), np.full(100, 1500.0))


def pattern(xy: np.ndarray) -> np.ndarray:
    return 4.5 + 0.5 * np.sin(xy[:, 0] / 12) * np.cos(xy[:, 1] / 9)


def irrigated(xy: np.ndarray) -> np.ndarray:
    return pattern(xy) - 0.8 * (xy[:, 0] < 25)


def change(first, second, seed: int = 1, share: float = 0.8):
    rng = np.random.default_rng(seed)
    surveys = [survey(rng, first), survey(rng, second)]
    kriging = JointKriging(CHANGED, surveys, Persistence(share).matrix([0.0, 0.0]))
    return field_change(kriging, GRID, 1, 0, CURVE)


def test_an_irrigated_part_is_wetter_and_the_rest_as_it_was():
    found = change(pattern, irrigated)
    west, east = GRID.x_m < 20, GRID.x_m > 32
    assert (found.significant[:, west] == -1).mean() > 0.95
    assert (found.significant[:, east] != 0).mean() < 0.1
    assert found.vwc[:, west].mean() > 0.03
    assert abs(found.vwc[:, east].mean()) < 0.015
    low, high = found.mean_rate.interval95
    assert low < -0.8 * 25 / 60 < high
    assert found.mean_vwc is not None
    assert found.mean_vwc.interval95[0] > 0
    drier, wetter = found.shares
    assert drier < 0.1 < wetter


@pytest.mark.slow
def test_where_nothing_changed_little_is_significant():
    shares = [np.mean(change(pattern, pattern, seed).significant != 0) for seed in range(20)]
    assert np.mean(np.array(shares) > 0) <= 0.15  # FDR is the chance of any discovery when there is nothing


def test_the_share_of_false_changes_is_limited_as_in_the_example_of_benjamini_and_hochberg():
    # The 15 p-values of their section 3.2: the first four are rejected at 0.05, though nine are below it.
    p = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719, 0.6528,
         0.7590, 1.0]  # fmt: skip
    kriging = SimpleNamespace(
        predict=lambda cells, survey, other: (ndtri(np.array(p) / 2), np.ones(15)),
        mean=lambda xy, weights: (0.0, 0.0),
    )
    grid = FieldGrid.from_polygon([(0, 0), (5, 0), (5, 3), (0, 3)], cell_m=1.0)
    assert field_change(kriging, grid, 1, 0).significant.ravel().tolist() == [-1.0] * 4 + [0.0] * 11


def test_the_mean_change_is_that_of_all_columns_of_the_field():
    grid = FieldGrid.from_polygon([(0, 0), (100, 0), (100, 1250), (0, 1250)], cell_m=5.0)
    rng = np.random.default_rng(4)
    xy, exposure_s = rng.uniform(0, (100, 1250), (150, 2)), np.full(150, 1500.0)
    rates = np.full(150, 4.0), 4.0 - xy[:, 0] / 100
    surveys = [Samples(xy, rng.poisson(rate * exposure_s), exposure_s) for rate in rates]
    found = field_change(JointKriging(CHANGED, surveys, np.eye(2)), grid, 1, 0)
    assert found.mean_rate.value == pytest.approx(np.nanmean(found.rate))
    low, high = found.mean_rate.interval95
    assert low < -0.5 < high


def test_errors_that_the_samples_share_add_to_the_change():
    rng = np.random.default_rng(2)
    surveys = [survey(rng, pattern), survey(rng, irrigated)]
    kriging = JointKriging(CHANGED, surveys, Persistence(0.8).matrix([0.0, 0.0]))
    plain = field_change(kriging, GRID, 1, 0, CURVE)
    found = field_change(kriging, GRID, 1, 0, CURVE, shared=lambda xy: np.full((len(xy), 2), (0.3, 0.4)))
    np.testing.assert_array_equal(found.rate, plain.rate)
    np.testing.assert_allclose(found.rate_sd**2 - plain.rate_sd**2, 0.5**2)
    slope = moisture_slope(CURVE, GRID.to_raster(kriging.predict(GRID.cells, 1)[0]))
    np.testing.assert_allclose(found.vwc_sd**2 - plain.vwc_sd**2, (0.5 * slope) ** 2)
    assert found.mean_rate.sd**2 - plain.mean_rate.sd**2 == pytest.approx(0.5**2)
    assert found.mean_vwc.sd**2 - plain.mean_vwc.sd**2 == pytest.approx((0.5 * slope.mean()) ** 2)
    assert sum(found.shares) < sum(plain.shares)


def test_the_slope_of_the_curve_is_its_derivative():
    rate = np.array([4.6, 5.5])
    derivative = (CURVE.vwc(rate + 1e-5) - CURVE.vwc(rate - 1e-5)) / 2e-5
    assert moisture_slope(CURVE, rate) == pytest.approx(derivative, rel=1e-4)
