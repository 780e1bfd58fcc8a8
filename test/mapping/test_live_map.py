import numpy as np
import pytest

from soilmoist_ros.mapping import FieldGrid, Samples, estimate_variogram
from soilmoist_ros.mapping.live_map import LiveMap

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], 5.0)
RNG = np.random.default_rng(6)
SAMPLES = Samples(RNG.uniform(0, 50, (9, 2)), RNG.poisson(400, 9), np.full(9, 100.0))


def test_samples_and_variogram_from_elsewhere_give_the_same_map():
    own, given = LiveMap(GRID), LiveMap(GRID)
    for xy, counts, exposure_s in zip(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, strict=True):
        own.add((xy[0], xy[1]), counts, exposure_s)
    own.update()
    given.take(own.samples, own.fit)
    np.testing.assert_array_equal(given.rate, own.rate)
    np.testing.assert_array_equal(given.variance, own.variance)
    assert given.ready
    assert given.fit is own.fit


def test_the_variogram_is_taken_as_it_is():
    fit = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, "exponential", "soft_l1")
    live_map = LiveMap(GRID)
    live_map.take(SAMPLES, fit)
    assert live_map.kriging.variogram is fit.variogram
    rate, variance = live_map.kriging.predict(GRID.cells)
    np.testing.assert_allclose(live_map.rate, rate)
    np.testing.assert_allclose(live_map.variance, variance)


def test_without_samples_the_map_stays_as_it_was():
    live_map = LiveMap(GRID)
    live_map.take(SAMPLES, estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s))
    before = live_map.rate
    with pytest.raises(ValueError, match="at least one sample"):
        live_map.take(Samples(np.empty((0, 2)), [], []), live_map.fit)
    assert live_map.rate is before
    assert live_map.samples is SAMPLES
