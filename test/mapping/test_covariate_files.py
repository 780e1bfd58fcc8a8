# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Derivatives of surfaces whose slope, curvature and runoff are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping.covariate_files import derivatives, filled_pits, upslope_area

STEP_M = 2.0


def raster(surface, rows=21, columns=25):
    y, x = np.mgrid[:rows, :columns] * STEP_M
    return surface(x, y)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
@pytest.mark.slow
def test_a_plane_has_its_slope_and_aspect_up_to_the_edge(east, north):
    found = derivatives(raster(lambda x, y: 10 + east * x + north * y), STEP_M)
    slope = np.hypot(east, north)
    np.testing.assert_allclose(found["slope"], slope, atol=1e-9)
    np.testing.assert_allclose(found["curvature"], 0, atol=1e-9)
    np.testing.assert_allclose(found["eastness"], -east / np.hypot(1, slope), atol=1e-9)
    np.testing.assert_allclose(found["northness"], -north / np.hypot(1, slope), atol=1e-9)


def test_the_curvature_of_a_bowl_and_of_a_dome():
    bowl = raster(lambda x, y: 0.01 * (x - 24) ** 2 + 0.02 * (y - 20) ** 2)
    inner = slice(1, -1), slice(1, -1)
    np.testing.assert_allclose(derivatives(bowl, STEP_M)["curvature"][inner], -0.06)
    np.testing.assert_allclose(derivatives(-bowl, STEP_M)["curvature"][inner], 0.06)


def test_water_on_a_plane_gathers_with_the_distance_from_its_top():
    area = upslope_area(raster(lambda x, y: 0.1 * y, 9, 201), STEP_M)
    middle = area[:, 100] / STEP_M  # per metre of contour
    np.testing.assert_allclose(middle, STEP_M * np.arange(9, 0, -1), rtol=1e-9)


def test_wetness_of_a_plane_is_that_of_the_formula():
    found = derivatives(raster(lambda x, y: 0.1 * y, 9, 201), STEP_M)["wetness"]
    np.testing.assert_allclose(found[2, 100], np.log(7 * STEP_M / 0.1), rtol=1e-3)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_all_water_leaves_any_surface_at_its_edge(seed):
    rng = np.random.default_rng(seed)
    elevation = rng.normal(0, 1, (12, 15))
    elevation[rng.random((12, 15)) < 0.1] = np.nan
    filled = filled_pits(elevation, STEP_M)
    known = np.isfinite(elevation)
    np.testing.assert_array_equal(np.isfinite(filled), known)
    assert (filled[known] >= elevation[known]).all()
    area = upslope_area(filled, STEP_M)
    padded = np.pad(filled, 1, constant_values=np.nan)
    around = np.array([np.roll(padded, (r, c), (0, 1)) for r in (-1, 0, 1) for c in (-1, 0, 1)])[:, 1:-1, 1:-1]
    lowest = np.nanmin(np.where(np.isnan(around), np.inf, around), axis=0) >= filled
    assert area[known & lowest].sum() == pytest.approx(known.sum() * STEP_M**2)
    assert np.isnan(around[:, known & lowest]).any(axis=0).all()


def test_a_valley_is_wetter_than_its_slopes():
    found = derivatives(raster(lambda x, y: 0.1 * np.abs(x - 24) + 0.02 * y), STEP_M)
    assert found["wetness"][2, 12] > found["wetness"][2, [3, 6, 18, 21]].max() + 1
    assert found["curvature"][5, 12] < 0
