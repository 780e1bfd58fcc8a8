# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rate around each sample, for the Poisson noise: ``rate / exposure`` with the rate at its place.

With the mean rate m* instead, the noise variance is a quarter too small on concrete of 5 counts/s and a half too
large on grass of 2.5 counts/s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples import Samples, noise_rate, spatial_blocks
from soilmoist_ros.mapping.variogram.model import Variogram, scaled

Array = NDArray[np.float64]

MAX_POOLS = 128  # maximum number of pools of neighbouring samples from which the rate is estimated
MIN_SHARE = 0.1  # lower limit of the estimate, as a share of the mean rate: kriging may undershoot
_JITTER = 1e-9


@dataclass(frozen=True, eq=False)
class LocalRate:
    """The rate kriged from pools of samples, whose own noise is that of the mean rate: one step of an iteration.

    :param mean: mean of the rate [counts/s]
    :param least: lower limit of the estimate [counts/s], > 0
    :param coefficients: change of the rate per correlation with each pool, shape (k,) [counts/s]
    """

    variogram: Variogram
    mean: float
    least: float
    pools_xy: Array
    coefficients: Array

    @classmethod
    def of(cls, places: Samples, variogram: Variogram) -> LocalRate:
        """The estimate from samples at distinct places, at least one."""
        from scipy.linalg import cho_factor, cho_solve

        pools, members = _pools(places)
        mean_rate = noise_rate(places)
        covariance = variogram.structured_sill * _correlation(variogram, pools.xy, pools.xy)
        noise = variogram.nugget / members + mean_rate / pools.exposure_s
        covariance[np.diag_indices(len(pools))] += noise + _JITTER * variogram.sill
        factor = cho_factor(covariance, lower=True)
        ones, rate = cho_solve(factor, np.column_stack([np.ones(len(pools)), pools.rate_cps])).T
        mean = float(rate.sum() / ones.sum())
        coefficients = variogram.structured_sill * (rate - mean * ones)
        # Without a count the kriged rate is 0 everywhere, and the mean rate all that is known.
        least = MIN_SHARE * mean_rate if places.counts.any() else mean_rate
        return cls(variogram, mean, least, pools.xy, coefficients)

    def __call__(self, xy: Array) -> Array:
        """Rates at places of shape (n, 2) [m], shape (n,) [counts/s].

        The rate at a place does not depend on the other places, bit for bit: a new sample leaves the noise of the
        others as it was.
        """
        terms = _correlation(self.variogram, xy, self.pools_xy)
        terms *= self.coefficients
        rate: Array = np.maximum(self.mean + terms.sum(axis=1), self.least)
        return rate


def _pools(places: Samples) -> tuple[Samples, Array]:
    """Places joined with their neighbours, and the number of places in each pool."""
    if len(places) <= MAX_POOLS:
        return places, np.ones(len(places))
    pool = np.empty(len(places), int)
    for number, block in enumerate(spatial_blocks(places.xy, 0, 2 * len(places) // MAX_POOLS)):
        pool[block] = number
    counts, exposure_s, east, north = (
        np.bincount(pool, values).astype(float)
        for values in (places.counts, places.exposure_s, *(places.xy.T * places.exposure_s))
    )
    xy = np.column_stack([east, north]) / exposure_s[:, None]
    return Samples(xy, counts, exposure_s), np.bincount(pool).astype(float)


def noise_rates(rate: float | LocalRate, xy: Array) -> float | Array:
    """Rate in the noise of samples at places of shape (n, 2) [m]: one number, or shape (n,) [counts/s]."""
    return rate(xy) if isinstance(rate, LocalRate) else rate


def _correlation(variogram: Variogram, xy: Array, pools_xy: Array) -> Array:
    """Correlation of the smooth rate between places, shape (n, k); no product of matrices."""
    x, y = scaled(variogram, *xy.T)
    pools_x, pools_y = scaled(variogram, *pools_xy.T)
    return variogram.correlation_of_square((x[:, None] - pools_x) ** 2 + (y[:, None] - pools_y) ** 2)
