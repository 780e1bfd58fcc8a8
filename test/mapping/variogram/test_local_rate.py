# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rate around each sample, for the Poisson noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping.samples import Samples, noise_rate
from soilmoist_ros.mapping.variogram.local_rate import MAX_POOLS, LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

VARIOGRAM = Variogram("matern32", 0.01, 15.0, 1.0)
TURNED = Variogram("exponential", 0.0, 20.0, 0.8, 4.0, 30.0)


def survey(n):
    """Counts on a field of 60 x 50 m, 2.5 counts/s in the west and 5 in the east."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, (60, 50), (n, 2))
    rate = np.where(xy[:, 0] < 30, 2.5, 5.0)
    return Samples(xy, rng.poisson(rate * 60.0), np.full(n, 60.0)), rate


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


@pytest.mark.slow
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
