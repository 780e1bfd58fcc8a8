# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interpolated surfaces are the surfaces, and the shortcut is taken where it is one."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging.chebyshev import raster_by_interpolation
from soilmoist_ros.mapping.kriging.system import KrigingSystem

WIDTH_M, HEIGHT_M = 120.0, 80.0
X_M, Y_M = np.linspace(3.0, WIDTH_M, 100), np.linspace(-HEIGHT_M, 0.0, 70)
CELLS = SimpleNamespace(x_m=X_M, y_m=Y_M)


def counted(seed, n, exposure_s=300.0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, -HEIGHT_M), (WIDTH_M, 0), (n, 2))
    return xy, rng.poisson(4 * exposure_s, n), np.full(n, exposure_s)


def surfaces(length_m, seen):
    """A product of cosines and a Gaussian, and a record of what was asked for."""

    def evaluate(nodes):
        x, y = nodes.x_m, nodes.y_m
        seen.append((len(y), len(x)))
        waves = np.cos(y[:, None] / length_m) * np.sin(x / length_m)
        return np.array([waves, 5 * np.exp(-((x - 40) ** 2 + (y[:, None] + 30) ** 2) / length_m**2)])

    return evaluate


@given(st.floats(15, 500))
def test_smooth_surfaces_are_found_from_few_points(length_m):
    seen = []
    found = raster_by_interpolation(surfaces(length_m, seen), X_M, Y_M, length_m, np.array([1.0, 5.0]), 10**5)
    np.testing.assert_allclose(found, surfaces(length_m, [])(CELLS), rtol=0, atol=1e-10)
    assert max(sum(rows * columns for rows, columns in seen), 1) < 100 * 70


def test_what_would_take_too_many_points_is_left():
    seen = []
    assert raster_by_interpolation(surfaces(2.0, seen), X_M, Y_M, 2.0, np.ones(2), 7000) is None
    assert not seen
    # A surface with an edge never settles: the search ends before it costs more than the cells.
    edge = raster_by_interpolation(
        lambda nodes: np.array([np.abs(nodes.x_m - 50) + 0 * nodes.y_m[:, None]]),
        X_M,
        Y_M,
        100.0,
        np.ones(1),
        7000,
    )
    assert edge is None


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 10**6),
    st.sampled_from([1, 2, 9, 60]),
    st.floats(25, 400),
    st.sampled_from([0.0, 0.05]),
    st.booleans(),
)
def test_a_gaussian_raster_is_that_of_its_points(seed, n, range_m, nugget, keep_nugget):
    kriging = PoissonKriging(Variogram("gaussian", nugget, range_m, 0.3), keep_nugget)
    xy, counts, exposure_s = counted(seed, n)
    xy[0] = X_M[17], Y_M[23]  # a sample in the very centre of a cell
    kriging.fit(xy, counts, exposure_s)
    mask = np.random.default_rng(seed).random((70, 100)) < 0.9
    rate, variance = kriging.predict_grid(X_M, Y_M, mask)
    points = np.array([(x, y) for y in Y_M for x in X_M])[mask.ravel()]
    exact_rate, exact_variance = kriging.predict(points)
    assert np.array_equal(np.isnan(rate), ~mask)
    np.testing.assert_allclose(rate[mask], exact_rate, rtol=0, atol=1e-6 * 0.3**0.5)
    np.testing.assert_allclose(variance[mask], exact_variance, rtol=0, atol=1e-8 * 0.3)


@pytest.mark.parametrize(("range_m", "model"), [(60.0, "gaussian"), (3.0, "gaussian"), (60.0, "matern52")])
def test_the_shortcut_is_taken_where_it_is_one(monkeypatch, range_m, model):
    kriging = PoissonKriging(Variogram(model, 0.0, range_m, 0.3)).fit(*counted(1, 20))
    evaluated = []
    original = KrigingSystem.surfaces

    def count(self, targets, nugget, progress=None):
        evaluated.append(len(targets.xy))
        return original(self, targets, nugget, progress)

    monkeypatch.setattr(KrigingSystem, "surfaces", count)
    kriging.predict_grid(X_M, Y_M)
    assert (sum(evaluated) < 3500) == (range_m == 60.0 and model == "gaussian")
    assert sum(evaluated) <= 7000


@pytest.mark.parametrize("shape", [(1, 100), (70, 1), (1, 1), (70, 0)])
def test_rasters_of_any_shape(shape):
    kriging = PoissonKriging(Variogram("gaussian", 0.01, 60.0, 0.3)).fit(*counted(2, 20))
    x_m, y_m = X_M[: shape[1]], Y_M[: shape[0]]
    rate, variance = kriging.predict_grid(x_m, y_m)
    exact = kriging.predict(np.array([(x, y) for y in y_m for x in x_m]).reshape(-1, 2))
    np.testing.assert_allclose(rate.ravel(), exact[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(variance.ravel(), exact[1], rtol=0, atol=1e-10)


def test_the_progress_is_shown_to_the_end():
    shares = []
    kriging = PoissonKriging(Variogram("gaussian", 0.01, 60.0, 0.3)).fit(*counted(2, 20))
    kriging.predict_grid(X_M, Y_M, progress=shares.append)
    assert shares[-1] == 1.0
