# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps of large rasters by tiles are those of every single cell, for all variograms, samples and rasters."""

from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging import raster as raster_module
from soilmoist_ros.mapping.kriging.system import KrigingSystem

SMOOTH = ("exponential", "gaussian", "matern32", "matern52")
OF_SILL = 1e-8
"""Stated error of correlations and variances, relative to the sill."""
OF_SD = 1e-6
"""Error of the rate, relative to the root of the sill."""


@st.composite
def surveys(draw):
    """Variogram, samples in and around a raster of about 18,000 cells, its axes and a mask."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    nx, ny = draw(st.sampled_from([(150, 125), (18_000, 1), (40, 470)]))
    x_m = 5 + draw(st.floats(0.3, 3)) * np.arange(nx)
    y_m = (-40 + draw(st.floats(0.3, 3)) * np.arange(ny))[:: draw(st.sampled_from([1, -1]))]
    variogram = Variogram(
        draw(st.sampled_from(SMOOTH)), draw(st.sampled_from([0.0, 0.05])),
        np.hypot(np.ptp(x_m), np.ptp(y_m)) / 10 ** draw(st.floats(0, 2)), 0.5,
        draw(st.sampled_from([1.0, 1.0, 3.0])), draw(st.sampled_from([0.0, 90.0, 33.0])),
    )  # fmt: skip
    mask = np.add.outer((y_m - y_m.mean()) ** 2, (x_m - x_m.mean()) ** 2) <= draw(st.sampled_from([0.3, 9.0])) * (
        np.ptp(x_m) ** 2 + np.ptp(y_m) ** 2
    )
    n = draw(st.integers(50, 80))
    xy = np.column_stack([rng.uniform(a.min() - 10, a.max() + 10, n) for a in (x_m, y_m)])
    row, column = (choice[:6] for choice in np.nonzero(mask))
    xy[: len(row)] = np.column_stack([x_m[column], y_m[row]])  # exactly at cells, and next to each other
    xy[6] = x_m[nx // 2], y_m[ny // 2]
    spread = np.zeros((n, 3))
    spread[::9] = 4.0, 1.0, 2.0
    return variogram, xy, spread * draw(st.sampled_from([0, 1])), x_m, y_m, mask


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(surveys(), st.booleans(), st.sampled_from([20.0, 300.0, 1e5]))
def test_maps_are_those_of_the_cells(survey, keep_nugget, exposure_s):
    variogram, xy, spread, x_m, y_m, mask = survey
    counts = np.random.default_rng(len(xy)).poisson(4.0 * exposure_s, len(xy))
    kriging = PoissonKriging(variogram, keep_nugget)
    uncertain = 0.1 * np.random.default_rng(1).normal(size=(len(xy), 2)) if exposure_s == 300 else None
    kriging.fit(xy, counts, np.full(len(xy), exposure_s), spread, uncertain)
    rasters = kriging.predict_grid(x_m, y_m, mask)
    row, column = np.nonzero(mask)
    some = np.unique(np.r_[:6, 0 : len(row) : 11, len(row) // 2 : len(row) // 2 + 50])
    row, column = row[some], column[some]
    expected = kriging.predict(np.column_stack([x_m[column], y_m[row]]))
    for raster, values, error in zip(rasters, expected, (OF_SD, OF_SILL), strict=True):
        assert np.isnan(raster[~mask]).all()
        np.testing.assert_allclose(raster[row, column], values, rtol=0, atol=error)


X_M, Y_M = 3.0 * np.arange(260), 2.0 * np.arange(200)


def survey(variogram, exposure_s=200.0):
    rng = np.random.default_rng(4)
    xy = rng.uniform(-20, 800, (256, 2)) * [1.0, 0.5]
    xy[0] = X_M[30], Y_M[100]  # exactly a cell's centre
    spread = np.zeros((len(xy), 3))
    spread[::9] = 40.0, 10.0, 20.0
    counts = rng.poisson(4.0 * exposure_s, len(xy))
    return PoissonKriging(variogram).fit(xy, counts, np.full(len(xy), exposure_s), spread)


def by_points(kriging, x_m, y_m, mask):
    """Some of the cells, among them the first one with a sample, and what they are as points."""
    row, column = np.nonzero(mask)
    some = np.append(np.arange(0, len(row), 37), np.flatnonzero((x_m[column] == X_M[30]) & (y_m[row] == Y_M[100])))
    row, column = row[some], column[some]
    return (row, column), kriging.predict(np.column_stack([x_m[column], y_m[row]]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "variogram",
    [
        Variogram("matern32", 0.02, 60.0, 0.5),
        Variogram("exponential", 0.0, 200.0, 0.5, 2.0, 33.0),
        Variogram("gaussian", 0.02, 200.0, 0.5, 2.0, 33.0),
    ],
)
def test_large_rasters_of_many_samples_by_tiles_are_those_of_points(variogram):
    mask = np.random.default_rng(1).random((len(Y_M), len(X_M))) < 0.95
    mask[100, 30] = True
    mask[:60, :50] = False
    kriging, shares = survey(variogram), []
    with mock.patch.object(KrigingSystem, "surfaces", side_effect=AssertionError("not by tiles")):
        rasters = kriging.predict_grid(X_M, Y_M, mask, shares.append)
    cells, expected = by_points(kriging, X_M, Y_M, mask)
    for raster, values, scale in zip(rasters, expected, (np.sqrt(0.5), 0.5), strict=True):
        assert np.isnan(raster[~mask]).all()
        np.testing.assert_allclose(raster[cells], values, rtol=0, atol=1e-8 * scale)
    assert len(shares) > 1
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variogram", "exposure_s", "y_m"),
    [
        (Variogram("spherical", 0.02, 60.0, 0.5), 200.0, Y_M),
        (Variogram("matern52", 0.0, 900.0, 0.5), 1e9, Y_M),  # too near to singular for an inverse
        (Variogram("matern32", 0.02, 60.0, 0.5), 200.0, Y_M**1.1),
    ],
)
def test_others_are_kriged_cell_by_cell(variogram, exposure_s, y_m):
    kriging, mask = survey(variogram, exposure_s), np.ones((len(Y_M), len(X_M)), bool)
    with mock.patch.object(raster_module, "tile_sums", side_effect=AssertionError("by tiles")):
        rate, variance = kriging.predict_grid(X_M, y_m, mask)
    cells, expected = by_points(kriging, X_M, y_m, mask)
    np.testing.assert_allclose(rate[cells], expected[0], rtol=1e-9)
    np.testing.assert_allclose(variance[cells], expected[1], rtol=0, atol=1e-9)
