"""Large rasters of many samples, kriged by tiles: the answers are those for single points."""

from unittest import mock

import numpy as np
import pytest

from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging import poisson_kriging, tile_covariances
from soilmoist_ros.mapping.kriging.poisson_kriging import MIN_TILED

X_M, Y_M = 3.0 * np.arange(260), 2.0 * np.arange(200)


def survey(variogram, exposure_s=200.0, keep_nugget=True):
    rng = np.random.default_rng(4)
    xy = rng.uniform(-20, 800, (MIN_TILED, 2)) * [1.0, 0.5]
    xy[0] = X_M[30], Y_M[100]  # exactly a cell's centre
    spread = np.zeros((len(xy), 3))
    spread[::9] = 40.0, 10.0, 20.0
    counts = rng.poisson(4.0 * exposure_s, len(xy))
    return PoissonKriging(variogram, keep_nugget=keep_nugget).fit(xy, counts, np.full(len(xy), exposure_s), spread)


def by_points(kriging, x_m, y_m, mask):
    """Some of the cells, among them the first one with a sample, and what is told of them as points."""
    row, column = np.nonzero(mask)
    some = np.append(np.arange(0, len(row), 37), np.flatnonzero((x_m[column] == X_M[30]) & (y_m[row] == Y_M[100])))
    row, column = row[some], column[some]
    return (row, column), kriging.predict(np.column_stack([x_m[column], y_m[row]]))


@pytest.mark.parametrize("keep_nugget", [True, False])
@pytest.mark.parametrize(
    "variogram",
    [
        Variogram("matern32", 0.02, 60.0, 0.5),
        Variogram("exponential", 0.0, 200.0, 0.5, 2.0, 33.0),
        Variogram("matern52", 0.02, 15.0, 0.5),
    ],
)
def test_they_are_those_of_points(variogram, keep_nugget):
    mask = np.random.default_rng(1).random((len(Y_M), len(X_M))) < 0.95
    mask[100, 30] = True
    mask[:60, :50] = False
    kriging, told = survey(variogram, keep_nugget=keep_nugget), []
    with (
        mock.patch.object(poisson_kriging, "RasterCells", side_effect=AssertionError("not by tiles")),
        mock.patch.object(tile_covariances, "_KEPT_AT_ONCE", 1_500_000),
    ):
        rasters = kriging.predict_grid(X_M, Y_M, mask, told.append)
    cells, expected = by_points(kriging, X_M, Y_M, mask)
    for raster, values, scale in zip(rasters, expected, (np.sqrt(0.5), 0.5), strict=True):
        assert np.isnan(raster[~mask]).all()
        np.testing.assert_allclose(raster[cells], values, rtol=0, atol=1e-11 * scale)
    assert len(told) > 1
    assert told == sorted(told)
    assert told[-1] == 1.0


@pytest.mark.parametrize(
    ("variogram", "exposure_s", "y_m"),
    [
        (Variogram("spherical", 0.02, 60.0, 0.5), 200.0, Y_M),
        (Variogram("matern52", 0.0, 900.0, 0.5), 1e9, Y_M),  # too near to singular for an inverse
        (Variogram("matern32", 0.02, 60.0, 0.5), 200.0, Y_M[::-1]),
    ],
)
def test_others_are_kriged_cell_by_cell(variogram, exposure_s, y_m):
    kriging, mask = survey(variogram, exposure_s), np.ones((len(Y_M), len(X_M)), bool)
    with mock.patch.object(poisson_kriging, "bands", side_effect=AssertionError("by tiles")):
        rate, variance = kriging.predict_grid(X_M, y_m, mask)
    cells, expected = by_points(kriging, X_M, y_m, mask)
    np.testing.assert_allclose(rate[cells], expected[0], rtol=1e-9)
    np.testing.assert_allclose(variance[cells], expected[1], rtol=0, atol=1e-9)
