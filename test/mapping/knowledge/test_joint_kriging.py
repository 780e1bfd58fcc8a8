# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math

import numpy as np
import pytest

from soilmoist_ros.mapping.knowledge.joint_kriging import JointKriging, Persistence, estimate_persistence
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

VARIOGRAM = Variogram("matern32", 0.02, 12.0, 0.3)
CELLS = np.stack(np.meshgrid(np.arange(5.0, 60, 10), np.arange(5.0, 50, 10)), -1).reshape(-1, 2)


def covariance(xy: np.ndarray) -> np.ndarray:
    lag = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return VARIOGRAM.structured_sill * VARIOGRAM.correlation(lag)


def draw(rng: np.random.Generator, share: float, counts: int = 60, surveys: int = 2, exposure_s: float = 400.0):
    """Samples of surveys, and the true rate of each in the cells."""
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


def test_a_pattern_that_persists_informs_the_other_survey_and_makes_the_change_surer():
    surveys, _ = draw(np.random.default_rng(3), 0.95)
    both = JointKriging(VARIOGRAM, surveys, Persistence(0.95).matrix([0.0, 1e6]))
    separate = JointKriging(VARIOGRAM, surveys, np.eye(2))
    assert (both.predict(CELLS, 1)[1] < separate.predict(CELLS, 1)[1]).all()
    assert both.predict(CELLS, 1, 0)[1].mean() < 0.4 * separate.predict(CELLS, 1, 0)[1].mean()


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


def test_a_mean_is_the_mean_of_the_map():
    surveys, _ = draw(np.random.default_rng(5), 0.8)
    kriging = JointKriging(VARIOGRAM, surveys, Persistence(0.8).matrix([0.0, 0.0]))
    weight = np.full(len(CELLS), 1 / len(CELLS))
    value, variance = kriging.mean(CELLS, {1: weight})
    assert value == pytest.approx(kriging.predict(CELLS, 1)[0].mean())
    one = np.eye(len(CELLS))[0]
    assert kriging.mean(CELLS, {1: one})[1] == pytest.approx(kriging.predict(CELLS, 1)[1][0])
    assert variance < kriging.predict(CELLS, 1)[1].mean()


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_the_persistence_is_found(share):
    found = [
        estimate_persistence(VARIOGRAM, draw(np.random.default_rng(seed), share, 80, 2)[0], [0.0, 1e6])
        for seed in range(6)
    ]
    mean = np.mean([one.share for one in found])
    assert mean == pytest.approx(share, abs=0.15 if share else 0.3)  # it cannot be below 0, so its mean is above


def test_the_persistence_fades_with_the_days():
    matrix = Persistence(0.9, 0.0, 10.0).matrix([0.0, 864_000.0, 1_728_000.0])
    np.testing.assert_allclose(matrix[0], [1.0, 0.9 / math.e, 0.9 / math.e**2])
