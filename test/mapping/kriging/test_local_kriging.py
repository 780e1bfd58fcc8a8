# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging with an amplitude: every way to a map against the full covariance, solved densely."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.kriging.raster import RasterKriging
from soilmoist_ros.mapping.kriging.tiled_kriging import TiledKriging
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.amplitude import Amplitude
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

RNG = np.random.default_rng(5)
TABLE = tuple(map(tuple, RNG.normal(0, 0.6, (5, 6))))
STATIONARY = Variogram("matern32", 0.03, 9.0, 0.4, 2.0, 30.0)
LOCAL = replace(STATIONARY, amplitude=Amplitude((0, 0), (40, 30), TABLE))
XY = np.concatenate([RNG.uniform(0, (40, 30), (38, 2)), [[5.5, 7.5], [20.5, 12.5]]])
EXPOSURE_S = RNG.uniform(20, 120, len(XY))
COUNTS = RNG.poisson(4 * EXPOSURE_S).astype(float)
AXES = np.arange(0.5, 40, 1.0), np.arange(0.5, 30, 1.0)
CELLS = np.stack(np.meshgrid(*AXES), -1).reshape(-1, 2)
MODELS = {"matern32": LOCAL, "gaussian": replace(LOCAL, model="gaussian", range_m=7.0)}


def dense(variogram, targets, keep_nugget, noise):
    """Rate and variance from the ordinary kriging system with its Lagrange multiplier."""

    def covariance(a, b):
        smooth = variogram.structured_sill * variogram.correlation_of_square(
            cdist(variogram.scaled(a), variogram.scaled(b), "sqeuclidean")
        )
        nugget = variogram.nugget * (cdist(a, b) == 0)
        return smooth, nugget

    a, at = variogram.amplitude(XY), variogram.amplitude(targets)
    n = len(XY)
    system = np.ones((n + 1, n + 1))
    system[-1, -1] = 0
    system[:n, :n] = np.outer(a, a) * sum(covariance(XY, XY)) + np.diag(noise)
    smooth, nugget = covariance(XY, targets)
    right = np.ones((n + 1, len(targets)))
    right[:n] = np.outer(a, at) * (smooth + nugget * keep_nugget)
    weights = np.linalg.solve(system, right)
    own = at**2 * (variogram.sill if keep_nugget else variogram.structured_sill)
    rate = weights[:n].T @ (COUNTS / EXPOSURE_S)
    return rate, own - np.einsum("ij,ij->j", weights, right), weights


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("keep_nugget", [True, False])
def test_every_way_to_a_map_equals_the_dense_solution(model, keep_nugget):
    variogram = MODELS[model]
    kriging = PoissonKriging(variogram, keep_nugget, 4.0).fit(XY, COUNTS, EXPOSURE_S)
    rate, variance, weights = dense(variogram, CELLS, keep_nugget, 4.0 / EXPOSURE_S)
    shape = len(AXES[1]), len(AXES[0])
    raster = RasterKriging(*AXES, np.ones(shape, bool), keep_nugget)
    updated = raster.update(Samples(XY, COUNTS, EXPOSURE_S), variogram, 4.0)
    for found in (kriging.predict(CELLS), kriging.predict_grid(*AXES), updated):
        np.testing.assert_allclose(np.ravel(found[0]), rate, atol=1e-8)
        np.testing.assert_allclose(np.ravel(found[1]), variance, atol=1e-8)
    of_places, lagrange = kriging.weights(CELLS)
    np.testing.assert_allclose(of_places, weights[:-1], atol=1e-7)
    np.testing.assert_allclose(lagrange, weights[-1], atol=1e-7)
    np.testing.assert_allclose(of_places.sum(axis=0), 1.0)


def test_planning_covariances_are_those_of_the_smooth_rate():
    kriging = PoissonKriging(LOCAL, False, 4.0).fit(XY, COUNTS, EXPOSURE_S)
    covariance = kriging.covariance(CELLS[::37])
    np.testing.assert_allclose(covariance, covariance.T)
    np.testing.assert_allclose(np.diag(covariance), kriging.predict(CELLS[::37])[1], atol=1e-10)
    assert np.linalg.eigvalsh(covariance).min() > -1e-10


def test_a_constant_amplitude_is_another_sill():
    table = ((np.log(2.0),) * 4,) * 4
    doubled = replace(STATIONARY, amplitude=Amplitude((0, 0), (40, 30), table))
    larger = replace(STATIONARY, nugget=4 * STATIONARY.nugget, sill=4 * STATIONARY.sill)
    one, other = (PoissonKriging(v, mean_rate=4.0).fit(XY, COUNTS, EXPOSURE_S) for v in (doubled, larger))
    for found, expected in zip(one.predict(CELLS), other.predict(CELLS), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    np.testing.assert_allclose(one.covariance(CELLS[::50]), other.covariance(CELLS[::50]), atol=1e-10)


def test_an_amplitude_of_one_changes_nothing():
    flat = replace(STATIONARY, amplitude=Amplitude((0, 0), (40, 30), ((0.0,) * 4,) * 4))
    one, other = (PoissonKriging(v).fit(XY, COUNTS, EXPOSURE_S).predict(CELLS) for v in (flat, STATIONARY))
    np.testing.assert_array_equal(one, other)


def test_samples_added_one_by_one_give_the_same_map():
    spread = np.zeros((len(XY), 3))
    spread[::3, 0] = 4.0
    at_once = PoissonKriging(LOCAL, mean_rate=4.0).fit(XY, COUNTS, EXPOSURE_S, spread)
    grown = PoissonKriging(LOCAL, mean_rate=4.0)
    for place, count, time, area in zip(XY, COUNTS, EXPOSURE_S, spread, strict=True):
        grown.add(place[None], [count], [time], area[None])
    np.testing.assert_allclose(grown.predict(CELLS), at_once.predict(CELLS), atol=1e-9)


def test_a_growing_raster_is_the_same_as_a_fresh_one_bit_for_bit():
    samples = Samples(XY, COUNTS, EXPOSURE_S)
    rate = LocalRate.of(samples, STATIONARY)
    mask = np.ones((len(AXES[1]), len(AXES[0])), bool)
    growing = RasterKriging(*AXES, mask, True)
    for n in range(10, len(XY) + 1):
        part = Samples(XY[:n], COUNTS[:n], EXPOSURE_S[:n])
        found = growing.update(part, LOCAL, rate)
    np.testing.assert_array_equal(found, RasterKriging(*AXES, mask, True).update(samples, LOCAL, rate))


@pytest.mark.slow
def test_many_samples_on_a_large_raster_come_from_tiles():
    rng = np.random.default_rng(8)
    xy = rng.uniform(0, (40, 30), (300, 2))
    x, y = np.arange(0.1, 40, 0.2), np.arange(0.1, 30, 0.2)
    samples = Samples(xy, rng.poisson(240, 300).astype(float), np.full(300, 60.0))
    kriging = PoissonKriging(LOCAL, mean_rate=4.0).fit(xy, samples.counts, samples.exposure_s)
    rows, columns = np.array([3, 77, 149]), np.array([5, 101, 199])
    expected = kriging.predict(np.column_stack([x[columns], y[rows]]))
    updated = RasterKriging(x, y, np.ones((len(y), len(x)), bool), True).update(samples, LOCAL, 4.0)
    for rate, variance in (kriging.predict_grid(x, y), updated):
        np.testing.assert_allclose([rate[rows, columns], variance[rows, columns]], expected, atol=1e-8)


def test_neighbours_krige_with_the_stationary_part():
    assert TiledKriging(LOCAL).variogram == STATIONARY
