# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pools keep what the samples have together."""

import numpy as np
import pytest

from soilmoist_ros.mapping.knowledge.pooling import pooled
from soilmoist_ros.mapping.samples.samples import Samples

RNG = np.random.default_rng(3)
SAMPLES = Samples(RNG.uniform(0, 200, (700, 2)), RNG.poisson(60.0, 700), RNG.uniform(5, 30, 700))


@pytest.mark.parametrize("most", [1, 7, 100, 699])
def test_pools_have_the_counts_exposure_and_moments_of_their_samples(most):
    pools = pooled(SAMPLES, most)
    assert 0.25 * most <= len(pools) <= most
    assert pools.counts.sum() == SAMPLES.counts.sum()
    assert pools.exposure_s.sum() == pytest.approx(SAMPLES.exposure_s.sum())

    def moments(of):
        weight = of.exposure_s / of.exposure_s.sum()
        centre = weight @ of.xy
        x, y = (of.xy - centre).T
        return [*centre, *(weight @ (of.spread[:, :3] + np.column_stack([x * x, x * y, y * y])))]

    np.testing.assert_allclose(moments(pools), moments(SAMPLES), rtol=0.002)


def test_few_samples_stay_as_they_are():
    assert pooled(SAMPLES, 700) is SAMPLES
