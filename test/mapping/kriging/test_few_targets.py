# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Few targets, kriged again and again; :mod:`test_raster` has their maps."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging.few_targets import FewTargets
from soilmoist_ros.mapping.kriging.raster import RasterKriging
from soilmoist_ros.mapping.samples.spread import path_spread
from soilmoist_ros.mapping.variogram.amplitude import Amplitude

RNG = np.random.default_rng(8)
TARGETS = RNG.uniform(0, 60, (40, 2))
SAMPLES = Samples(
    RNG.uniform(0, 60, (90, 2)), RNG.poisson(400, 90), np.full(90, 100.0), path_spread(RNG.uniform(-6, 6, (90, 2)))
)
STATIONARY = Variogram("matern32", 0.02, 20.0, 0.4, 2.0, 30.0)
UNEVEN = replace(
    STATIONARY, amplitude=Amplitude((0.0, 0.0), (60.0, 60.0), np.linspace(-0.5, 0.7, 16).reshape(4, 4))
)


def some(count):
    return Samples(SAMPLES.xy[:count], SAMPLES.counts[:count], SAMPLES.exposure_s[:count], SAMPLES.spread[:count])


@pytest.mark.parametrize("variogram", [STATIONARY, UNEVEN])
def test_surfaces_are_those_of_kriging_however_many_samples_came_at_once(variogram):
    grown, targets = FewTargets(TARGETS, True), np.vstack([TARGETS, SAMPLES.xy[:1]])
    for count in (1, 20, 70, 90, 65):
        samples = some(count)
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
    make_soil_map(some(60), grid, STATIONARY, raster=raster)
    kept = make_soil_map(SAMPLES, grid, STATIONARY, raster=raster)
    fresh = make_soil_map(SAMPLES, grid, STATIONARY)
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
        few.update(some(count), STATIONARY, 4.0)
        assert np.isfinite(few.known.of_samples).all()
