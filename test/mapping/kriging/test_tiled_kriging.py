# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging of very many samples in tiles."""

import functools

import numpy as np
import pytest
from scipy.linalg import cholesky
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging import tiled_kriging
from soilmoist_ros.mapping.kriging.tiled_kriging import TiledKriging

SIDE_M = 180.0
WINDOW = np.stack(np.meshgrid(np.linspace(50, 110, 17), np.linspace(-5, 55, 17)), -1).reshape(-1, 2)


@functools.cache
def survey(variogram, n=900, spread=None):
    """Counts at random places of a random field with this variogram, one sample per 6 m x 6 m or so."""
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, SIDE_M, (n, 2))
    covariance = variogram.covariance(cdist(xy, xy)) + 1e-9 * np.eye(n)
    rate = np.maximum(4 + cholesky(covariance, lower=True) @ rng.normal(size=n), 0.3)
    return Samples(xy, rng.poisson(rate * 10.0), np.full(n, 10.0), np.array(spread or (0, 0, 0)))


def fitted(kriging, samples):
    return kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)


@pytest.mark.parametrize("keep_nugget", [True, False])
@pytest.mark.parametrize("spread", [None, (9.0, 2.0, 4.0)])
def test_a_tile_that_holds_all_samples_is_exact(keep_nugget, spread):
    model = Variogram("matern32", 0.03, 40.0, 0.3)
    samples = survey(model, 120, spread=spread)
    targets = np.concatenate([WINDOW, samples.xy[:5], [[-500.0, 900.0]]])
    exact = fitted(PoissonKriging(model, keep_nugget), samples)
    tiled = fitted(TiledKriging(model, keep_nugget), samples)
    assert tiled.accuracy is None
    assert tiled._model.mean == pytest.approx(exact.map_mean, rel=1e-12)
    for one, other in zip(tiled.predict(targets), exact.predict(targets), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "range_m", "nugget", "bound"),
    [("matern32", 30.0, 0.03, 0.02), ("exponential", 60.0, 0.0, 0.06), ("gaussian", 30.0, 0.03, 0.2)],
)
def test_the_error_against_exact_kriging_is_a_small_share_of_the_standard_deviation(name, range_m, nugget, bound):
    model = Variogram(name, nugget, range_m, 0.3)
    samples = survey(model)
    rate, variance = fitted(PoissonKriging(model), samples).predict(WINDOW)
    near_rate, near_variance = fitted(TiledKriging(model, nearest=300), samples).predict(WINDOW)
    sd = np.sqrt(variance)
    assert np.abs(near_rate - rate).max() <= bound * np.median(sd)
    np.testing.assert_allclose(np.sqrt(near_variance), sd, rtol=0.01)
    assert np.abs(near_rate - rate).max() > 1e-9


@pytest.mark.slow
def test_tiles_join_without_seams():
    """Along a fine line, steps where the tile changes are no larger than what is lost within tiles."""
    model = Variogram("matern32", 0.0, 30.0, 0.3)
    samples = survey(model)
    kriging = fitted(TiledKriging(model, nearest=300), samples)
    line = np.column_stack([np.linspace(40, 120, 8_001), np.full(8_001, 81.0)])
    rate, variance = kriging.predict(line)
    steps = np.abs(np.diff(rate))
    smooth = np.abs(np.diff(fitted(PoissonKriging(model), samples).predict(line)[0])).max()
    assert steps.max() - smooth < 0.03 * np.sqrt(np.median(variance))
    assert (steps > 3 * smooth).sum() < 40  # at borders of tiles only


@pytest.mark.slow
def test_the_chosen_number_of_neighbours_suits_the_range(monkeypatch):
    monkeypatch.setattr(tiled_kriging, "NEAREST", (100, 200, 400))
    near, far = (fitted(TiledKriging(v), survey(v)).accuracy for v in (SHORT, LONG))
    assert near.nearest < far.nearest
    assert near.rate_error <= 0.01
    assert "nearest samples" in str(near)


SHORT, LONG = Variogram("exponential", 0.1, 8.0, 0.3), Variogram("gaussian", 0.0, 30.0, 0.3)


def test_the_answer_depends_on_the_place_alone():
    model = Variogram("matern32", 0.01, 20.0, 0.3)
    kriging = fitted(TiledKriging(model, nearest=150), survey(model))
    together = np.array(kriging.predict(WINDOW))
    apart = np.concatenate([kriging.predict(WINDOW[k : k + 97]) for k in range(0, len(WINDOW), 97)], axis=1)
    np.testing.assert_allclose(apart, together, rtol=1e-9)


def test_who_computes_the_tiles_does_not_matter():
    model = Variogram("matern32", 0.01, 20.0, 0.3)

    def backwards(function, items):
        return [function(item) for item in list(items)[::-1]][::-1]

    maps = [
        fitted(TiledKriging(model, nearest=150, compute=compute), survey(model)).predict(WINDOW)
        for compute in (map, backwards)
    ]
    np.testing.assert_array_equal(*maps)


@pytest.mark.slow
def test_many_samples_make_a_tiled_map_few_an_exact_one():
    model = Variogram("matern32", 0.01, 10.0, 0.3)
    samples = survey(model)
    grid = FieldGrid.from_polygon([[60, 60], [120, 60], [120, 120]], 3.0)
    done = []
    exact = make_soil_map(samples, grid, model)
    tiled = make_soil_map(samples, grid, model, progress=done.append, max_exact_samples=500)
    assert isinstance(exact.kriging, PoissonKriging)
    assert exact.accuracy is None
    assert isinstance(tiled.kriging, TiledKriging)
    assert done[-1] == 1.0
    inside = grid.mask
    np.testing.assert_array_equal(np.isnan(tiled.rate), ~inside)
    assert np.abs((tiled.rate - exact.rate) / exact.rate_sd)[inside].max() < 0.03
    np.testing.assert_allclose(tiled.evaluate(grid.cells).rate, tiled.rate[inside], rtol=1e-9)


def test_bad_use_is_refused():
    with pytest.raises(ValueError, match="nearest must be at least 1"):
        TiledKriging(SHORT, nearest=0)
    with pytest.raises(ValueError, match="at least one sample"):
        TiledKriging(SHORT).fit(np.empty((0, 2)), [], [])
    with pytest.raises(RuntimeError, match="call fit"):
        TiledKriging(SHORT).predict([[0, 0]])
