# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances from the points of tiles are those of the cells, for all models, ranges, directions and supports."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import Variogram
from soilmoist_ros.mapping.kriging.covariances import PointCovariances
from soilmoist_ros.mapping.kriging.tile_covariances import CELLS, MARGIN, POINTS, TileCovariances, tile_shape
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

MOST = 10**9
ERROR = 1e-12
"""Stated error relative to the structured sill."""


def all_covariances(covariances, count):
    return np.concatenate([part for _, part in covariances.combine(np.eye(count))], axis=1)


def of_tiles(variogram, x_m, y_m, mask, nugget=True):
    tiles = TileCovariances(x_m, y_m, mask, nugget, tile_shape(variogram, x_m, y_m, mask))
    tiles.begin(variogram)
    return tiles


def both(variogram, x_m, y_m, mask, samples, nugget=True):
    """Covariances with the cells, from tiles and in full, each of shape (samples, cells)."""
    tiles = of_tiles(variogram, x_m, y_m, mask, nugget)
    assert tiles.keep(samples, np.arange(len(samples)), MOST)
    found = all_covariances(tiles, len(samples))
    assert found.shape[1] == tiles.size
    x, y = np.meshgrid(x_m, y_m)
    full = PointCovariances(np.column_stack([x[mask], y[mask]]), nugget)
    full.begin(variogram)
    full.keep(samples, np.arange(len(samples)), MOST)
    return found[:, tiles.position[mask]], all_covariances(full, len(samples)), tiles


@st.composite
def cases(draw):
    """Fields with structure enough for tiles, and samples in and around them."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    nx, ny = draw(st.sampled_from([(200, 180), (40_000, 1), (12, 3000), (301, 130)]))
    x_step, y_step = draw(st.floats(0.3, 3)), draw(st.floats(0.3, 3))
    x_m, y_m = 5 + x_step * np.arange(nx), -40 + y_step * np.arange(ny)
    mask = rng.random((ny, nx)) < 0.9
    variogram = Variogram(
        draw(st.sampled_from(sorted(MODELS.keys() - {"gaussian"}))),
        0.05,
        10 ** draw(st.floats(-1, 4)),
        0.45,
        draw(st.sampled_from([1.0, 1.0, 2.0, 5.0])),
        draw(st.floats(0, 180)),
    )
    samples = np.zeros((6, 5))
    samples[:, 0], samples[:, 1] = rng.uniform(-30, 30 + x_m[-1], 6), rng.uniform(-50, 30 + y_m[-1], 6)
    samples[1, :2] = x_m[nx // 3], y_m[ny // 2]  # exactly at a cell
    samples[2:4, 2:] = [30.0, -12.0, 8.0]
    samples[4, 2:] = [25.0, 0.0, 25.0]
    return variogram, x_m, y_m, mask, samples


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(cases())
def test_they_are_those_of_the_cells(case):
    variogram, x_m, y_m, mask, _ = case
    if tile_shape(variogram, x_m, y_m, mask) is not None:
        found, full, _ = both(*case)
        np.testing.assert_allclose(found, full, rtol=0, atol=ERROR * variogram.structured_sill)


@pytest.mark.slow
@pytest.mark.parametrize("model", sorted(MODELS.keys() - {"gaussian"}))
@settings(max_examples=15, deadline=None)
@given(st.floats(-2, 2), st.floats(-1, 1))
@example(np.log10(2.1), 0.0)
def test_the_error_is_as_stated_just_outside_the_margin(model, log_half_sides_per_range, along):
    """Where it is largest: a side of a square tile away from the middle of a side, or nearly so."""
    side = round(CELLS**0.5)
    x_m, y_m = np.arange(5.0 * side), np.arange(5.0 * side)
    half = (side - 1) / 2
    variogram = Variogram(model, 0.0, half / 10**log_half_sides_per_range, 1.0)
    middle = 2.5 * side - 0.5
    samples = np.zeros((2, 5))
    samples[:, 0] = middle + along * half
    samples[:, 1] = middle + (1 + MARGIN * 1.0001) * half, middle - (1 + MARGIN * 1.0001) * half
    found, full, tiles = both(variogram, x_m, y_m, np.ones((len(y_m), len(x_m)), bool), samples)
    assert model == "spherical" or not tiles._is_near[:, 12].any()
    np.testing.assert_allclose(found, full, rtol=0, atol=ERROR)


def test_the_bound_stated_for_the_exponential_is_that_of_its_constants():
    rho = MARGIN + np.sqrt(MARGIN**2 + 1)
    assert 4 * rho ** (1 - POINTS) / (rho - 1) < 1e-10


def test_samples_that_stay_are_not_computed_again():
    variogram = Variogram("matern32", 0.05, 30.0, 0.4)
    x_m, y_m = np.arange(250.0), np.arange(200.0)
    rng = np.random.default_rng(3)
    samples = np.column_stack([rng.uniform(0, 200, (140, 2)), np.zeros((140, 3))])
    samples[:4, :2] = 100.0, 60.0
    mask = np.ones((200, 250), bool)
    again, fresh = (of_tiles(variogram, x_m, y_m, mask) for _ in range(2))
    again.keep(samples, np.arange(len(samples)), MOST)
    others = samples.copy()
    others[130:, 0] += 5.0
    for first, known in ((130, others), (130, others[:135]), (135, others)):
        again.keep(known, np.arange(first, len(known)), MOST)
    fresh.keep(others, np.arange(len(others)), MOST)
    weights = rng.standard_normal((1, 140))
    for count in (140, 133, 3):
        pairs = itertools.zip_longest(again.combine(weights[:, :count]), fresh.combine(weights[:, :count]))
        assert all(one[0] == other[0] and one[1].tobytes() == other[1].tobytes() for one, other in pairs)


def test_less_than_half_is_kept_of_the_usual_field():
    variogram = Variogram("exponential", 0.0, 40.0, 0.3)
    axes = np.linspace(0, 300, 313), np.linspace(0, 300, 224)
    mask = np.ones((224, 313), bool)
    tiles = of_tiles(variogram, *axes, mask)
    rng = np.random.default_rng(0)
    samples = np.column_stack([rng.uniform(0, 300, (50, 2)), np.zeros((50, 3))])
    assert tiles.keep(samples, np.arange(len(samples)), 50 * mask.size * 45 // 100)
    assert not tiles.keep(samples, np.arange(len(samples)), 50 * mask.size // 5)


def test_small_and_ragged_fields_are_left():
    variogram = Variogram("exponential", 0.0, 40.0, 0.3)
    axis = np.arange(1200.0)
    assert tile_shape(variogram, axis[:60], axis[:50], np.ones((50, 60), bool)) is None
    assert tile_shape(variogram, axis[:1], axis[:1], np.ones((1, 1), bool)) is None
    scattered = np.zeros((1200, 1200), bool)
    scattered[::6, ::6] = True  # 40,000 cells in 720 tiles
    assert tile_shape(variogram, axis, axis, scattered) is None
    assert tile_shape(variogram, axis[:200], axis[:200], np.ones((200, 200), bool)) is not None


def test_tiles_are_square_where_the_variogram_is_isotropic():
    axis, mask = np.arange(300.0), np.ones((300, 300), bool)
    height, width = tile_shape(Variogram("matern32", 0.0, 30.0, 0.4), axis, axis, mask)
    assert height == width
    height, width = tile_shape(Variogram("matern32", 0.0, 30.0, 0.4, 4.0, 0.0), axis, axis, mask)
    assert 3 < width / height < 5
    height, width = tile_shape(Variogram("matern32", 0.0, 30.0, 0.4), axis, 2 * axis, mask)
    assert 1.7 < width / height < 2.3
