# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The semivariogram of counts and its soft-L1 fit."""

import json

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import Variogram, default_edges, empirical_semivariogram
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.semivariogram import MAX_NUGGET, OUTLIER, RANGES, fit_soft_l1


def test_empirical_semivariogram_against_reference(reference_data):
    case = json.loads((reference_data / "variogram30.json").read_text())
    lag_m, gamma, weight = empirical_semivariogram(case["points"], case["counts"], case["t"], case["edges"])
    for row, (lag, value, total) in zip(case["bins"], zip(lag_m, gamma, weight, strict=True), strict=True):
        assert value == pytest.approx(float(row["gamma"]), rel=1e-12)
        assert total == pytest.approx(float(row["N_h"]), rel=1e-12)
        assert lag == pytest.approx(float(row["weighted_mean_h"]), rel=1e-12)
    equal = empirical_semivariogram(case["points"], np.ones(30), np.full(30, 2.0), case["edges"])
    np.testing.assert_allclose(equal[2], [row["pairs"] for row in case["bins"]], rtol=1e-12)


def test_classes_are_open_below_and_closed_above_and_may_be_empty():
    xy = [[0, 0], [10, 0], [10, 0]]
    lag_m, gamma, weight = empirical_semivariogram(xy, [20, 30, 10], [10, 10, 10], [0, 5, 10, 20])
    np.testing.assert_array_equal(weight, [0, 10, 0])
    np.testing.assert_array_equal(np.isnan(lag_m), [True, False, True])
    np.testing.assert_array_equal(np.isnan(gamma), [True, False, True])
    assert lag_m[1] == 10
    assert gamma[1] == pytest.approx((5 * (1**2 + 1**2) - 2 * 2) / (2 * 10))  # m* = 2; never (10, 0) with itself


@pytest.mark.parametrize("edges", [[0], [0, 0], [5, 1], [-1, 5], [0, np.nan], [[0, 1]]])
def test_empirical_semivariogram_refuses_edges(edges):
    with pytest.raises(ValueError, match="edges must"):
        empirical_semivariogram([[0, 0], [1, 1]], [1, 1], [1, 1], edges)


def test_empirical_semivariogram_is_unbiased_for_short_exposures():
    rng = np.random.default_rng(20)
    truth = Variogram("matern32", 0.05, 25.0, 0.5)
    xy = rng.uniform(0, 120, (80, 2))
    exposure_s = np.full(80, 20.0)
    factor = np.linalg.cholesky(truth.covariance(cdist(xy, xy)))
    edges = [0, 8, 16, 24, 36, 50]
    simulated = []
    for _ in range(200):
        rate = 4.0 + factor @ rng.standard_normal(80)
        assert rate.min() > 0
        simulated.append(empirical_semivariogram(xy, rng.poisson(rate * exposure_s), exposure_s, edges)[1])
    distance = cdist(xy, xy)[np.triu_indices(80, 1)]
    number = np.digitize(distance, edges) - 1
    expected = [truth.semivariance(distance[number == k]).mean() for k in range(len(edges) - 1)]
    z = (np.mean(simulated, axis=0) - expected) / (np.std(simulated, axis=0, ddof=1) / np.sqrt(200))
    assert np.abs(z).max() < 3
    noise = 4.0 / 20.0  # leaving m* out would be seen: the noise is far larger than the standard errors
    assert noise > 5 * (np.std(simulated, axis=0, ddof=1) / np.sqrt(200)).max()


def test_default_edges_hold_enough_pairs_each():
    rng = np.random.default_rng(5)
    xy = rng.uniform(0, 200, (60, 2))
    edges = default_edges(xy)
    pairs = np.histogram(cdist(xy, xy)[np.triu_indices(60, 1)], edges)[0]
    assert 10 <= len(pairs) <= 15
    assert pairs.min() >= 30
    assert edges[-1] == pytest.approx(cdist(xy, xy).max() / 2)


def test_default_edges_of_few_places_are_six_over_all_distances():
    xy = np.random.default_rng(3).uniform(0, 60, (11, 2))
    edges = default_edges(xy)
    distances = cdist(xy, xy)[np.triu_indices(11, 1)]
    assert len(edges) == 7
    np.testing.assert_allclose(np.diff(edges), distances.max() / 6)
    assert np.histogram(distances, edges)[0].sum() == 55


def cost(parameters, lag, gamma, model):
    nugget, range_, structured = parameters
    residual = nugget + structured * (1 - MODELS[model].correlation((lag / range_) ** 2)) - gamma
    return OUTLIER**2 * np.sum(np.sqrt(1 + (residual / OUTLIER) ** 2) - 1, axis=-1)


def classes(seed, model):
    """Classes as they come: of a model with noise, of a trend, without structure, of chance alone, or falling."""
    rng = np.random.default_rng(seed)
    lag = np.sort(rng.uniform(0.02, 1, rng.integers(1, 16)))
    lag /= lag[-1]
    rising = 1 - MODELS[model].correlation((lag / 10 ** rng.uniform(-1.5, 0.5)) ** 2)
    gamma = [
        rng.uniform(0, 0.5) + rng.uniform(0.2, 2) * rising + rng.normal(0, 10 ** rng.uniform(-3, 0), len(lag)),
        rng.uniform(0.5, 3) * lag + 0.3 * rng.standard_t(2, len(lag)),
        1 + rng.normal(0, 0.05, len(lag)),
        rng.normal(0.5, 1, len(lag)),
        2 - lag + rng.normal(0, 0.05, len(lag)),
    ][seed % 5]
    return lag, gamma / np.abs(gamma).mean()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("seed", range(5))
def test_no_parameters_on_a_grid_are_better(seed, model):
    lag, gamma = classes(seed, model)
    found = fit_soft_l1(lag, gamma, model, 1e-3)
    assert found.cost == pytest.approx(cost(found[:3], lag, gamma, model), rel=1e-9)
    axes = np.linspace(0, 2, 21), np.geomspace(*RANGES, 31), np.linspace(1e-3, 4, 21)
    tried = np.meshgrid(*axes, indexing="ij")
    assert found.cost <= cost([one[..., None] for one in tried], lag, gamma, model).min() * (1 + 1e-9)
    assert 0 <= found.nugget <= MAX_NUGGET
    assert RANGES[0] <= found.range_ <= RANGES[1] * (1 + 1e-9)


def test_one_outlier_pulls_little():
    lag = np.linspace(0.05, 1, 15)
    gamma = 0.1 + 0.9 * (1 - np.exp(-((lag / 0.4) ** 2)))
    gamma[7] += 5
    found = fit_soft_l1(lag, gamma, "gaussian", 1e-3)
    assert found.nugget + found.structured == pytest.approx(1.0, rel=0.05)


def test_what_the_classes_leave_open_stays_near_the_usual():
    """One class holds the semivariance at one lag, and nothing else."""
    found = fit_soft_l1(np.ones(1), np.ones(1), "matern32", 1e-3)
    assert found.cost == pytest.approx(0, abs=1e-9)
    assert 0.2 < found.range_ * MODELS["matern32"].practical < 1.5
    assert found.nugget < 0.3 < found.structured < 1.5
