# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Uniform fields are told from those that vary, if the counts suffice."""

import math

import numpy as np
import pytest

from soilmoist_ros.exploration.planning.uniformity import CERTAIN, SHOWN, differences
from soilmoist_ros.mapping.samples import as_samples

LATTICE = np.array([(x, y) for x in np.arange(2.0, 60, 8) for y in np.arange(2.0, 50, 8)])


def of(rate, seed=0, exposure_s=40.0, places=LATTICE):
    exposures = np.full(len(places), exposure_s)
    counts = np.random.default_rng(seed).poisson(np.broadcast_to(rate, len(places)) * exposures)
    return differences(as_samples(places, counts, exposures), "matern32", 78.0)


def test_most_uniform_fields_are_told():
    told = [limit for seed in range(20) if (limit := of(4.0, seed).hidden) is not None]
    assert len(told) >= 18
    assert 0.01 < np.median(told) <= 0.08


@pytest.mark.parametrize("rate", [np.where(LATTICE[:, 0] < 30, 3.5, 4.5), 4 + 0.7 * np.sin(LATTICE[:, 1] / 8)])
def test_fields_that_vary_are_not(rate):
    found = [of(rate, seed) for seed in range(5)]
    assert all(one.hidden is None for one in found)
    assert min(one.evidence for one in found) > CERTAIN
    assert all(one.limit > np.std(rate) / 4 for one in found), "the limit is above the truth"


def test_more_counts_hide_less():
    limits = [
        np.median([of(4.0, seed, exposure_s).limit for seed in range(9)]) for exposure_s in (20.0, 80.0, 320.0)
    ]
    assert limits[0] > limits[1] > limits[2]


@pytest.mark.parametrize("rate", [0.05, 0.0])
def test_few_counts_tell_nothing(rate):
    found = of(rate)
    assert found.hidden is None
    assert found.evidence < SHOWN
    assert of(4.0, places=LATTICE[:2]).limit == math.inf


def test_many_samples_are_pooled():
    many = np.random.default_rng(1).uniform((0, 0), (60, 50), (600, 2))
    assert of(4.0, 1, 10.0, many).hidden <= 0.08
    assert of(np.where(many[:, 0] < 30, 3.6, 4.4), 1, 10.0, many).evidence > CERTAIN
