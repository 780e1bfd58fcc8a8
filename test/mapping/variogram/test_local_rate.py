# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings, PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.kriging.raster import RasterKriging
from soilmoist_ros.mapping.kriging.tiled_kriging import TiledKriging
from soilmoist_ros.mapping.samples.samples import noise_rate
from soilmoist_ros.mapping.variogram.local_rate import MAX_POOLS, LocalRate

VARIOGRAM = Variogram("matern32", 0.01, 15.0, 1.0)
TURNED = Variogram("exponential", 0.0, 20.0, 0.8, 4.0, 30.0)


def survey(n, exposure_s=60.0, seed=1):
    """Counts on a field of 60 x 50 m, 2.5 counts/s in the west and 5 in the east."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, (60, 50), (n, 2))
    rate = np.where(xy[:, 0] < 30, 2.5, 5.0)
    return Samples(xy, rng.poisson(rate * exposure_s), np.full(n, exposure_s)), rate


@pytest.mark.parametrize("n", [60, 129, 1000])
def test_the_noise_is_that_of_the_place(n):
    """With the mean rate it is 50 % too large on grass and 25 % too small on concrete."""
    samples, rate = survey(n)
    away = np.abs(samples.xy[:, 0] - 30) > 10
    local = LocalRate.of(samples, VARIOGRAM)
    np.testing.assert_allclose(local(samples.xy)[away], rate[away], rtol=0.2)
    assert (
        np.abs(local(samples.xy) / rate - 1).mean() < 0.08 < 0.3 < np.abs(samples.mean_rate_cps / rate - 1).mean()
    )
    assert len(local.pools_xy) <= MAX_POOLS


def test_pools_are_kriged_like_samples():
    """With as many pools as samples it is Poisson kriging of the smooth rate with the mean rate in the noise."""
    samples, _ = survey(40)
    kriging = PoissonKriging(VARIOGRAM, keep_nugget=False).fit(samples.xy, samples.counts, samples.exposure_s)
    at = np.random.default_rng(3).uniform(0, 60, (30, 2))
    np.testing.assert_allclose(LocalRate.of(samples, VARIOGRAM)(at), kriging.predict(at)[0], rtol=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 300), st.integers(1, 40), st.sampled_from([VARIOGRAM, TURNED]), st.randoms())
def test_the_rate_at_a_place_does_not_depend_on_the_others(n, places, variogram, random):
    local = LocalRate.of(survey(n)[0], variogram)
    xy = np.array([(random.uniform(-10, 70), random.uniform(-10, 60)) for _ in range(places)])
    together = local(xy)
    alone = np.concatenate([local(xy[i : i + 1]) for i in range(places)])
    np.testing.assert_array_equal(together, alone)
    assert (together >= local.least).all()
    assert local.least > 0


def test_nothing_counted_leaves_the_noise_of_half_a_count():
    samples = Samples([(0, 0), (9, 0)], [0, 0], [10.0, 10.0])
    local = LocalRate.of(samples, VARIOGRAM)
    np.testing.assert_array_equal(local(np.array([(0.0, 0.0), (4.0, 4.0)])), noise_rate(samples))


@pytest.mark.parametrize("variogram", [VARIOGRAM, TURNED])
def test_every_way_to_krige_has_the_same_noise(variogram):
    samples, _ = survey(50)
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], 5.0)
    local = LocalRate.of(samples, variogram)
    columns = samples.xy, samples.counts, samples.exposure_s
    covariance = variogram.structured_sill * variogram.correlation_of_square(
        ((variogram.scaled(samples.xy)[:, None] - variogram.scaled(samples.xy)) ** 2).sum(axis=-1)
    )
    covariance += np.diag(variogram.nugget + local(samples.xy) / samples.exposure_s)
    towards = variogram.structured_sill * variogram.correlation_of_square(
        ((variogram.scaled(samples.xy)[:, None] - variogram.scaled(grid.cells)) ** 2).sum(axis=-1)
    )
    inverse = np.linalg.inv(covariance)
    mean = inverse.sum(axis=0) @ samples.rate_cps / inverse.sum()
    expected = mean + towards.T @ inverse @ (samples.rate_cps - mean)
    exact = PoissonKriging(variogram, mean_rate=local).fit(*columns)
    grown = PoissonKriging(variogram, mean_rate=local)
    for xy, counts, exposure_s in zip(*columns, strict=True):
        grown.add(xy, counts, exposure_s)
    tiled = TiledKriging(variogram, mean_rate=local).fit(*columns)
    rows = RasterKriging(grid.x_m, grid.y_m, grid.mask, True).update(samples, variogram, local)[0][grid.mask]
    for rate in (exact.predict(grid.cells)[0], grown.predict(grid.cells)[0], tiled.predict(grid.cells)[0], rows):
        np.testing.assert_allclose(rate, expected, rtol=1e-8)


@pytest.mark.slow
def test_a_map_that_grows_equals_one_made_at_once():
    """Bit for bit, since the noise of old samples is that of the last fit."""
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], 5.0)
    samples, _ = survey(30)
    growing, at_once = FieldMap(grid), FieldMap(grid)
    for xy, counts, exposure_s in zip(samples.xy.tolist(), samples.counts, samples.exposure_s, strict=True):
        growing.add_sample(tuple(xy), counts, exposure_s)
        grown = growing.update()
    at_once.set_samples(growing.samples)
    np.testing.assert_array_equal(grown.rate, at_once.update().rate)
    np.testing.assert_array_equal(grown.noise_variance, grown.fit.local_rate(samples.xy) / samples.exposure_s)
    planner = FieldMap(grid, FieldMapSettings(for_planning=True))  # has the samples and the fit of the mapper
    planner.set_samples(growing.samples, grown.fit)
    np.testing.assert_allclose(planner.update().variance, grown.variance, rtol=1e-9)
    published = FieldMap(grid, FieldMapSettings(noise="mean"))
    published.set_samples(samples)
    np.testing.assert_allclose(published.update().noise_variance, samples.mean_rate_cps / samples.exposure_s)
