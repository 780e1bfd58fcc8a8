# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rows that are kept from one map to the next; :mod:`test_raster` has their maps."""

from unittest import mock

import numpy as np

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.covariances import PointCovariances
from soilmoist_ros.mapping.kriging.rows import BLOCK, MIN_TAIL, KrigingRows

VARIOGRAM = Variogram("matern32", 0.02, 20.0, 0.4)
RNG = np.random.default_rng(8)
TARGETS = RNG.uniform(0, 60, (40, 2))
N = BLOCK + MIN_TAIL + 3
SAMPLES = Samples(RNG.uniform(0, 60, (N, 2)), RNG.poisson(400, N), np.full(N, 100.0))


def some(count):
    return Samples(SAMPLES.xy[:count], SAMPLES.counts[:count], SAMPLES.exposure_s[:count])


def kriged(xy):
    kriging = PoissonKriging(VARIOGRAM, keep_nugget=True, mean_rate=4.0)
    rate, variance = kriging.fit(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s).predict(xy)
    return rate, variance - VARIOGRAM.sill


def test_surfaces_are_those_of_kriging():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    for count in (1, 20, N):
        found = rows.update(some(count), VARIOGRAM, 4.0)
    np.testing.assert_allclose(found, kriged(TARGETS), atol=1e-11)


def test_at_samples_the_nugget_is_shared():
    rows = KrigingRows(PointCovariances(TARGETS, False))
    rows.update(SAMPLES, VARIOGRAM, 4.0)
    np.testing.assert_allclose(rows.at_samples(np.array([0, 7])), kriged(SAMPLES.xy[[0, 7]]), atol=1e-11)


def test_an_update_that_fails_leaves_nothing_behind():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    with mock.patch.object(kriging_rows, "MAX_ROWS", N - 1):
        assert rows.update(SAMPLES, VARIOGRAM, 4.0) is None
        found = rows.update(some(20), VARIOGRAM, 4.0)
    fresh = KrigingRows(PointCovariances(TARGETS, True)).update(some(20), VARIOGRAM, 4.0)
    assert found.tobytes() == fresh.tobytes()


def test_a_sample_that_moved_changes_only_its_own_covariances():
    rows = KrigingRows(PointCovariances(TARGETS, True))
    rows.update(SAMPLES, VARIOGRAM, 4.0)
    for number in (N // 2, 3, N - 1):
        xy, exposure_s = SAMPLES.xy.copy(), SAMPLES.exposure_s.copy()
        xy[number] += 0.3
        exposure_s[number] += 10.0
        moved = Samples(xy, SAMPLES.counts, exposure_s, SAMPLES.spread)
        fresh = KrigingRows(PointCovariances(TARGETS, True))
        assert rows.update(moved, VARIOGRAM, 4.0).tobytes() == fresh.update(moved, VARIOGRAM, 4.0).tobytes()
