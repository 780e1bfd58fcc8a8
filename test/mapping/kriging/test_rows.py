# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rows that are kept from one map to the next; :mod:`test_raster` has their maps."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.covariances import AxesCovariances, PointCovariances, Rows, add_rows
from soilmoist_ros.mapping.kriging.few_targets import FewTargets
from soilmoist_ros.mapping.kriging.raster import RasterKriging
from soilmoist_ros.mapping.kriging.rows import BLOCK, MIN_TAIL, KrigingRows
from soilmoist_ros.mapping.samples import path_spread
from soilmoist_ros.mapping.variogram.model import Amplitude

VARIOGRAM = Variogram("matern32", 0.02, 20.0, 0.4)
RNG = np.random.default_rng(8)
TARGETS = RNG.uniform(0, 60, (40, 2))
N = BLOCK + MIN_TAIL + 3
SAMPLES = Samples(RNG.uniform(0, 60, (N, 2)), RNG.poisson(400, N), np.full(N, 100.0))


def some(count):
    return Samples(SAMPLES.xy[:count], SAMPLES.counts[:count], SAMPLES.exposure_s[:count])


def kriged(xy):
    kriging = PoissonKriging(VARIOGRAM, keep_nugget=True, mean_rate=4.0)
    rate, variance = kriging.fit(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s).predict(xy)
    return rate, variance - VARIOGRAM.sill


def test_surfaces_are_those_of_kriging():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    for count in (1, 20, N):
        found = rows.update(some(count), VARIOGRAM, 4.0)
    np.testing.assert_allclose(found, kriged(TARGETS), atol=1e-11)


def test_at_samples_the_nugget_is_shared():
    rows = KrigingRows(PointCovariances(TARGETS, False))
    rows.update(SAMPLES, VARIOGRAM, 4.0)
    np.testing.assert_allclose(rows.at_samples(np.array([0, 7])), kriged(SAMPLES.xy[[0, 7]]), atol=1e-11)


def test_an_update_that_fails_leaves_nothing_behind():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    with mock.patch.object(kriging_rows, "MAX_ROWS", N - 1):
        assert rows.update(SAMPLES, VARIOGRAM, 4.0) is None
        found = rows.update(some(20), VARIOGRAM, 4.0)
    fresh = KrigingRows(PointCovariances(TARGETS, True)).update(some(20), VARIOGRAM, 4.0)
    assert found.tobytes() == fresh.tobytes()


def test_a_sample_that_moved_changes_only_its_own_covariances():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    rows.update(SAMPLES, VARIOGRAM, 4.0)
    for number in (N // 2, 3, N - 1):
        xy, exposure_s = SAMPLES.xy.copy(), SAMPLES.exposure_s.copy()
        xy[number] += 0.3
        exposure_s[number] += 10.0
        moved = Samples(xy, SAMPLES.counts, exposure_s, SAMPLES.spread)
        fresh = KrigingRows(PointCovariances(TARGETS, True))
        assert rows.update(moved, VARIOGRAM, 4.0).tobytes() == fresh.update(moved, VARIOGRAM, 4.0).tobytes()


RNG = np.random.default_rng(8)
TARGETS = RNG.uniform(0, 60, (40, 2))
FEW = Samples(
    RNG.uniform(0, 60, (90, 2)), RNG.poisson(400, 90), np.full(90, 100.0), path_spread(RNG.uniform(-6, 6, (90, 2)))
)
STATIONARY = Variogram("matern32", 0.02, 20.0, 0.4, 2.0, 30.0)
UNEVEN = replace(
    STATIONARY, amplitude=Amplitude((0.0, 0.0), (60.0, 60.0), np.linspace(-0.5, 0.7, 16).reshape(4, 4))
)


def first(count):
    return Samples(FEW.xy[:count], FEW.counts[:count], FEW.exposure_s[:count], FEW.spread[:count])


@pytest.mark.parametrize("variogram", [STATIONARY, UNEVEN])
def test_surfaces_are_those_of_kriging_however_many_samples_came_at_once(variogram):
    grown, targets = FewTargets(TARGETS, True), np.vstack([TARGETS, FEW.xy[:1]])
    for count in (1, 20, 70, 90, 65):
        samples = first(count)
        grown = FewTargets(targets, True) if count == 1 else grown
        found = grown.update(samples, variogram, 4.0)
        kriging = PoissonKriging(variogram, True, 4.0)
        kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
        rate, variance = kriging.predict(targets)
        amplitude = variogram.amplitude_at(targets)
        prior = variogram.sill * (1.0 if amplitude is None else amplitude**2)
        np.testing.assert_allclose(found, [rate, variance - prior], atol=1e-10)
        assert found.tobytes() == FewTargets(targets, True).update(samples, variogram, 4.0).tobytes()


def test_the_kriging_of_a_map_takes_the_covariance_over():
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 60), (0, 60)], 4.0)
    raster = RasterKriging(grid.x_m, grid.y_m, grid.mask, True)
    make_soil_map(first(60), grid, STATIONARY, raster=raster)
    kept = make_soil_map(FEW, grid, STATIONARY, raster=raster)
    fresh = make_soil_map(FEW, grid, STATIONARY)
    assert kept.known is not None
    assert fresh.known is None
    for one, other in zip(kept.kriging.predict(TARGETS), fresh.kriging.predict(TARGETS), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10)
    places = np.vstack([grid.cells, TARGETS])
    found = kept.kriging.rate_and_covariance(places, kept.known.with_targets)
    for one, other in zip(found, fresh.kriging.rate_and_covariance(places), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_all_covariances_that_are_taken_over_are_numbers(monkeypatch):
    """Above the diagonal nothing is computed; what a freed array left there may overflow in sums."""
    empty = np.empty
    monkeypatch.setattr(np, "empty", lambda *shape: np.full_like(empty(*shape), np.nan))
    few = FewTargets(TARGETS, True)
    monkeypatch.undo()
    for count in (20, 40):
        few.update(first(count), STATIONARY, 4.0)
        assert np.isfinite(few.known.of_samples).all()


X_M, Y_M = np.linspace(0.0, 60.0, 13), np.linspace(-20.0, 30.0, 11)
GRID = np.stack(np.meshgrid(X_M, Y_M), axis=-1).reshape(-1, 2)
RNG = np.random.default_rng(8)
TABLE = np.column_stack([RNG.uniform(0, 50, (9, 2)), np.zeros((9, 3))])
WEIGHTS = RNG.normal(size=(4, 9))


def sums(covariances, variogram, samples=TABLE, weights=WEIGHTS):
    covariances.begin(variogram)
    assert covariances.keep(samples, np.arange(len(samples)), 10**6)
    total = np.empty((len(weights), covariances.size))
    for some, part in covariances.combine(weights):
        total[:, some] = part
    return total


@pytest.mark.parametrize("model", ["gaussian", "exponential", "spherical", "matern32", "matern52"])
def test_sums_are_those_of_the_covariance_function(model):
    variogram = Variogram(model, 0.0, 20.0, 0.4)
    expected = WEIGHTS @ variogram.covariance(cdist(TABLE[:, :2], GRID))
    np.testing.assert_allclose(sums(PointCovariances(GRID, True), variogram), expected, atol=1e-12)


def test_a_target_at_a_sample_shares_its_nugget_if_asked():
    variogram, samples = Variogram("matern32", 0.1, 20.0, 0.4), TABLE.copy()
    samples[3, :2] = GRID[57]
    shared, smooth = (sums(PointCovariances(GRID, keep), variogram, samples) for keep in (True, False))
    difference = shared - smooth
    np.testing.assert_allclose(difference[:, 57], 0.1 * WEIGHTS[:, 3])
    assert not np.delete(difference, 57, axis=1).any()


@pytest.mark.parametrize("angle_deg", [0.0, 90.0])
def test_gaussian_covariances_along_axes_are_products(angle_deg):
    variogram = Variogram("gaussian", 0.0, 20.0, 0.4, 2.0, angle_deg)
    samples = TABLE.copy()
    samples[::2, 2:] = 9.0, 2.0, 4.0
    found = sums(AxesCovariances(X_M, Y_M), variogram, samples)
    np.testing.assert_allclose(found, sums(PointCovariances(GRID, False), variogram, samples), atol=1e-12)


def test_too_much_is_not_kept():
    covariances = PointCovariances(GRID, False)
    covariances.begin(Variogram("matern32", 0.0, 20.0, 0.4))
    assert not covariances.keep(TABLE, np.arange(len(TABLE)), 9 * len(GRID) - 1)


def test_rows_are_added_with_their_factors_and_squares():
    covariances, variogram = PointCovariances(GRID, False), Variogram("matern32", 0.0, 20.0, 0.4)
    rows = sums(covariances, variogram)
    of_data, squares, data = np.ones((2, len(GRID))), np.zeros(len(GRID)), RNG.normal(size=(2, 4))
    add_rows(covariances, WEIGHTS, data, of_data, squares)
    np.testing.assert_allclose(of_data, 1 + data @ rows)
    np.testing.assert_allclose(squares, (rows**2).sum(axis=0))


def test_a_table_grows_over_its_chunks():
    table, values = Rows(3), RNG.normal(size=(300, 3))
    for start, rows in table.writable(0, 300):
        rows[:] = values[start : start + len(rows)]
    weights = RNG.normal(size=(2, 290))
    np.testing.assert_allclose(table.combine(weights), weights @ values[:290])
