# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the counts so far show any difference between places of a field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import (
    ModelName,
    RestrictedLikelihood,
    Samples,
    correlation_model,
    spatial_blocks,
)

Array = NDArray[np.float64]

SHOWN = 4.0
"""Evidence from which differences are shown: 19 of 20 uniform fields stay below."""
CERTAIN = 9.0
"""Evidence from which differences are certain."""
MAX_HIDDEN = 0.1
"""Counts that would not show a variation of this share of the mean rate tell nothing about the field."""
MIN_PLACES = 10
"""Fewer places say nothing about a field."""
RANGE_SHARES = (1 / 2, 1 / 3, 1 / 5)
"""Practical ranges that are tried, as shares of the extent."""
_LIMIT_DROP = 1.35  # of the log-likelihood at a one-sided 95 % limit: chi-squared with one degree of freedom
_VARIATIONS = np.array([0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.2, 0.3])
_NOTHING = 1e-9
_MAX_PLACES = 150


class Differences(NamedTuple):
    """What samples say about differences within a field.

    :param evidence: twice the log-likelihood ratio of the best structured field to a uniform one
    :param limit: upper limit (95 %) of the standard deviation about the mean, as a share of the mean rate
    """

    evidence: float
    limit: float

    @property
    def hidden(self) -> float | None:
        """The limit if the samples show no differences and are enough to show some; else ``None``."""
        return self.limit if self.evidence < SHOWN and self.limit <= MAX_HIDDEN else None


def differences(samples: Samples, model: ModelName, extent_m: float) -> Differences:
    """Compare the restricted likelihoods of structured fields with several ranges with that of a uniform one.

    :param samples: merged samples
    :param model: variogram model
    :param extent_m: extent of the field [m]
    """
    places = _few(samples)
    mean = float(places.counts.sum() / places.exposure_s.sum())
    if len(places) < MIN_PLACES or mean <= 0:
        return Differences(0.0, math.inf)
    likelihood, tiny = RestrictedLikelihood(places, model), _NOTHING * mean**2
    practical = correlation_model(model).practical
    evidence, limit = 0.0, 0.0
    for share in RANGE_SHARES:
        sills = (tiny, *((_VARIATIONS * mean) ** 2))
        values = np.array([likelihood.value(np.log([s, share * extent_m / practical, tiny])) for s in sills])
        values -= values[0]
        evidence = max(evidence, 2 * float(values.max()))
        likely = int(np.flatnonzero(values > values.max() - _LIMIT_DROP).max())
        limit = max(limit, float(_VARIATIONS[likely]) if likely < len(_VARIATIONS) else math.inf)
    return Differences(evidence, limit)


def _few(samples: Samples) -> Samples:
    """Samples, pooled with their neighbours if they are many."""
    if len(samples) <= _MAX_PLACES:
        return samples
    pools = spatial_blocks(samples.xy, 0, -(-len(samples) // _MAX_PLACES))
    exposure_s = np.array([samples.exposure_s[pool].sum() for pool in pools])
    xy = np.array([np.average(samples.xy[pool], axis=0, weights=samples.exposure_s[pool]) for pool in pools])
    return Samples(xy, np.array([samples.counts[pool].sum() for pool in pools]), exposure_s)
