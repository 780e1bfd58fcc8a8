# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps by the forms of tiles are those of every single cell, for all variograms, samples and rasters."""

import dataclasses
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging import raster as raster_module
from soilmoist_ros.mapping.kriging.tile_covariances import MARGIN
from soilmoist_ros.mapping.kriging.tile_forms import find_skeleton, find_tiles
from soilmoist_ros.mapping.variogram.model import Amplitude

SMOOTH = ("exponential", "gaussian", "matern32", "matern52")
OF_SILL = 1e-8
"""Stated error of correlations and variances, relative to the sill."""
OF_SD = 1e-6
"""Error of the rate, relative to the root of the sill."""
TABLE = np.random.default_rng(8).uniform(0.5, 2.0, (4, 5))


@pytest.mark.parametrize("model", SMOOTH)
@pytest.mark.parametrize("shape", [(34, 34), (30, 40), (1, 1200)])
@settings(max_examples=8, deadline=None)
@given(st.floats(-2, 1), st.sampled_from([1.0, 4.0]), st.floats(0, 180), st.integers(0, 10**6))
def test_smooth_functions_follow_from_the_skeleton(model, shape, log_ranges, anisotropy, angle_deg, seed):
    """Covariances with places on and outside of the margin, also far beyond the sources."""
    half_m = (shape[1] - 1) / 2, (shape[0] - 1) / 2
    variogram = Variogram(model, 0.0, 17 / 10**log_ranges, 1.0, anisotropy, angle_deg)
    skeleton = find_skeleton(variogram, half_m, shape)
    rng = np.random.default_rng(seed)
    side = np.maximum(half_m, 1e-6 * sum(half_m))
    long, across = (variogram.scaled(np.diag(side)), variogram.scaled(np.diag(side))[::-1])
    lengths = np.hypot(*long.T)
    out = MARGIN * lengths.max() * np.hypot(*across.T) / abs(np.linalg.det(long))
    edge = np.where(rng.random(200) < 0.3, 1.0, 1 + 40 * rng.random(200) ** 4)
    border = (1 + out[:, None] * edge) * [[1], [1]]
    places = np.array([border[0], rng.uniform(-1, 1, 200) * border[1]])
    places[:, ::2] = np.array([rng.uniform(-1, 1, 200) * border[0], border[1]])[:, ::2]
    places = (places * rng.choice([-1, 1], 200)).T * side
    y, x = (grid.ravel() for grid in np.mgrid[: shape[0], : shape[1]])
    cells = np.column_stack([x - half_m[0], y - half_m[1]])
    points = np.column_stack([skeleton.x * half_m[0], skeleton.y * half_m[1]])

    def correlation(xy):
        way = variogram.scaled(places[:, None] - xy)
        return variogram.correlation_of_square((way**2).sum(axis=-1))

    assert len(points) < 140
    np.testing.assert_allclose(correlation(points) @ skeleton.to_cells, correlation(cells), rtol=0, atol=OF_SILL)


@st.composite
def surveys(draw):
    """Variogram, samples in and around a raster of about 18,000 cells, its axes and a mask."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    nx, ny = draw(st.sampled_from([(150, 125), (18_000, 1), (40, 470)]))
    x_m = 5 + draw(st.floats(0.3, 3)) * np.arange(nx)
    y_m = (-40 + draw(st.floats(0.3, 3)) * np.arange(ny))[:: draw(st.sampled_from([1, -1]))]
    variogram = Variogram(
        draw(st.sampled_from(SMOOTH)),
        draw(st.sampled_from([0.0, 0.05])),
        np.hypot(np.ptp(x_m), np.ptp(y_m)) / 10 ** draw(st.floats(0, 2)),
        0.5,
        draw(st.sampled_from([1.0, 1.0, 3.0])),
        draw(st.sampled_from([0.0, 90.0, 33.0])),
    )
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
@settings(max_examples=40, deadline=None)
@given(surveys(), st.booleans(), st.booleans(), st.sampled_from([20.0, 300.0, 1e5]))
def test_maps_are_those_of_the_cells(survey, keep_nugget, is_modulated, exposure_s):
    variogram, xy, spread, x_m, y_m, mask = survey
    if is_modulated:
        amplitude = Amplitude(xy.min(axis=0), xy.max(axis=0), tuple(map(tuple, np.log(TABLE))))
        variogram = dataclasses.replace(variogram, amplitude=amplitude)
    counts = np.random.default_rng(len(xy)).poisson(4.0 * exposure_s, len(xy))
    kriging = PoissonKriging(variogram, keep_nugget)
    kriging.fit(xy, counts, np.full(len(xy), exposure_s), spread)
    with mock.patch.object(raster_module.RasterKriging, "_solved_by_interpolation", return_value=None):
        rasters = kriging.predict_grid(x_m, y_m, mask)
    row, column = np.nonzero(mask)
    some = np.unique(np.r_[:6, 0 : len(row) : 11, len(row) // 2 : len(row) // 2 + 50])
    row, column = row[some], column[some]
    expected = kriging.predict(np.column_stack([x_m[column], y_m[row]]))
    scale = 4.0 if is_modulated else 1.0
    for raster, values, error in zip(rasters, expected, (OF_SD, OF_SILL), strict=True):
        assert np.isnan(raster[~mask]).all()
        np.testing.assert_allclose(raster[row, column], values, rtol=0, atol=error * scale)


def test_tiles_cover_the_wanted_cells_and_are_equal():
    variogram, mask = Variogram("exponential", 0.0, 40.0, 0.3), np.zeros((143, 187), bool)
    mask[20:90, 100:] = True
    tiles = find_tiles(variogram, np.arange(187.0), 0.5 * np.arange(143), mask)
    covered = np.zeros(mask.shape, bool)
    for top, left in zip(tiles.top, tiles.left, strict=True):
        part = slice(top, top + tiles.shape[0]), slice(left, left + tiles.shape[1])
        assert mask[part].shape == tiles.shape
        assert mask[part].any()
        covered[part] = True
    assert covered[mask].all()
    assert find_tiles(variogram, np.arange(187.0) ** 1.01, 0.5 * np.arange(143), mask) is None
