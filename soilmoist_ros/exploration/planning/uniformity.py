"""Whether the counts so far show any difference between places of a field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples.samples import Samples, as_samples
from soilmoist_ros.mapping.variogram.correlation import ModelName, correlation_model
from soilmoist_ros.mapping.variogram.reml import RestrictedLikelihood, spatial_blocks

Array = NDArray[np.float64]

SHOWN = 4.0
"""Twice the log-likelihood ratio from which differences are shown: 19 of 20 uniform fields stay below."""
LIMIT_DROP = 1.35
"""Fall of the log-likelihood at the upper limit of an interval, 95 % one-sided (chi-squared with one degree)."""
MAX_HIDDEN = 0.1
"""Counts that would not show a variation of this share of the mean rate tell nothing about the field."""
RANGE_SHARES = (1 / 2, 1 / 3, 1 / 5)
"""Practical ranges that are tried, as shares of the extent."""
_VARIATIONS = np.array([0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.2, 0.3])
_NOTHING = 1e-9
_MAX_PLACES = 150


def hidden_variation(samples: Samples, model: ModelName, extent_m: float) -> float | None:
    """Upper limit (95 %) of the variation of a field whose samples show none.

    The restricted likelihood of a structured field is compared with that of a uniform one, for several ranges.

    :param samples: merged samples
    :param model: variogram model
    :param extent_m: extent of the field [m]
    :returns: standard deviation about the mean as a share of the mean rate; ``None`` if the samples show
        differences, or are too few to rule out :data:`MAX_HIDDEN`
    """
    places = _few(samples)
    mean = float(places.counts.sum() / places.exposure_s.sum())
    if len(places) < 3 or mean <= 0:
        return None
    likelihood = RestrictedLikelihood(places, model)
    practical = correlation_model(model).practical
    limit = 0.0
    for share in RANGE_SHARES:
        range_m, tiny = share * extent_m / practical, _NOTHING * mean**2
        values = np.array(
            [likelihood.value(np.log([v, range_m, tiny])) for v in (tiny, *((_VARIATIONS * mean) ** 2))]
        )
        values -= values[0]
        if 2 * values.max() >= SHOWN:
            return None
        likely = np.flatnonzero(values[1:] > values.max() - LIMIT_DROP)
        limit = max(limit, float(_VARIATIONS[min(likely.max() + 1, len(_VARIATIONS) - 1)]) if len(likely) else 0.0)
    return limit if limit <= MAX_HIDDEN else None


def _few(samples: Samples) -> Samples:
    """Samples, pooled with their neighbours if they are many."""
    if len(samples) <= _MAX_PLACES:
        return samples
    pools = spatial_blocks(samples.xy, 0, -(-len(samples) // _MAX_PLACES))
    exposure_s = np.array([samples.exposure_s[pool].sum() for pool in pools])
    xy = np.array([np.average(samples.xy[pool], axis=0, weights=samples.exposure_s[pool]) for pool in pools])
    return as_samples(xy, np.array([samples.counts[pool].sum() for pool in pools]), exposure_s)
