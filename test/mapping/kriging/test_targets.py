# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cells of a raster have the correlations of their points."""

import numpy as np
import pytest

from soilmoist_ros.mapping import Variogram
from soilmoist_ros.mapping.kriging.targets import Points, RasterCells, coincident, sample_correlation

X_M, Y_M = np.linspace(0.0, 60.0, 13), np.linspace(30.0, -20.0, 11)
RNG = np.random.default_rng(8)
PLACES = RNG.uniform(0, 50, (9, 2))
SPREAD = np.where(np.arange(9)[:, None] % 2, [9.0, 2.0, 4.0], 0.0)


@pytest.mark.parametrize("model", ["gaussian", "exponential", "spherical", "matern32", "matern52"])
@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 33.0])
def test_cells_are_points(model, angle_deg):
    variogram, mask = Variogram(model, 0.0, 20.0, 0.4, 2.0, angle_deg), RNG.random((11, 13)) < 0.8
    cells = RasterCells(variogram, PLACES, X_M, Y_M, mask, SPREAD)
    points = Points(variogram, PLACES, cells.xy, SPREAD)
    tile = slice(20, 60)
    np.testing.assert_allclose(cells.correlation(tile), points.correlation(tile), atol=1e-12)


def test_targets_exactly_at_a_place_are_found():
    xy = np.array([[1.0, 2.0], PLACES[4], [3.0, 3.0], PLACES[0], PLACES[4]])
    target, place = coincident(xy, PLACES)
    assert (target.tolist(), place.tolist()) == ([1, 3, 4], [4, 0, 4])


def test_correlations_of_samples_are_those_with_the_points_of_their_supports():
    variogram = Variogram("matern32", 0.0, 20.0, 0.4, 2.0, 33.0)
    found = sample_correlation(variogram, PLACES, SPREAD)
    points = Points(variogram, PLACES, PLACES, SPREAD).correlation(slice(0, 9))
    is_point = ~SPREAD.any(axis=1)
    np.testing.assert_allclose(found, found.T, atol=1e-12)
    np.testing.assert_allclose(found[:, is_point], points[is_point].T, atol=1e-12)
    np.testing.assert_allclose(sample_correlation(variogram, PLACES, SPREAD, 4), found[:, 4:], atol=1e-12)
