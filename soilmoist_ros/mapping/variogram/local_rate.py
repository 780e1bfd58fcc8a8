"""A smooth estimate of the rate around each place, for the Poisson noise of the samples there.

The noise variance of a sample is ``rate / exposure`` with the rate at its place. With the mean rate m* instead, it
is a quarter too small on concrete of 5 counts/s and a half too large on grass of 2.5 counts/s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples.samples import Samples, noise_rate
from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.reml import spatial_blocks

Array = NDArray[np.float64]

MAX_POOLS = 128
"""Maximum number of pools of neighbouring samples from which the rate is estimated."""
MIN_SHARE = 0.1
"""Lower limit of the estimate, as a share of the mean rate: kriging may undershoot."""
_JITTER = 1e-9


@dataclass(frozen=True, eq=False)
class LocalRate:
    """The rate kriged from pools of samples, whose own noise is that of the mean rate: one step of an iteration.

    :param variogram: variogram of the rate
    :param mean: mean of the rate [counts/s]
    :param least: lower limit of the estimate [counts/s], > 0
    :param pools_xy: centres of the pools, shape (k, 2) [m]
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

        blocks = spatial_blocks(places.xy, 0, max(1, 2 * len(places) // MAX_POOLS))
        exposure_s, counts = np.array(
            [(places.exposure_s[block].sum(), places.counts[block].sum()) for block in blocks]
        ).T
        pools_xy = np.array([np.average(places.xy[b], 0, places.exposure_s[b]) for b in blocks])
        mean_rate = noise_rate(places)
        covariance = variogram.structured_sill * _correlation(variogram, pools_xy, pools_xy)
        noise = variogram.nugget / np.array([len(block) for block in blocks]) + mean_rate / exposure_s
        covariance[np.diag_indices(len(blocks))] += noise + _JITTER * variogram.sill
        factor = cho_factor(covariance, lower=True)
        ones, rate = cho_solve(factor, np.column_stack([np.ones(len(blocks)), counts / exposure_s])).T
        mean = float(rate.sum() / ones.sum())
        coefficients = variogram.structured_sill * (rate - mean * ones)
        return cls(variogram, mean, MIN_SHARE * mean_rate, pools_xy, coefficients)

    def __call__(self, xy: Array) -> Array:
        """Rates at places of shape (n, 2) [m], shape (n,) [counts/s].

        The rate at a place does not depend on the other places, bit for bit: a new sample leaves the noise of the
        others as it was.
        """
        terms = _correlation(self.variogram, xy, self.pools_xy)
        terms *= self.coefficients
        rate: Array = np.maximum(self.mean + terms.sum(axis=1), self.least)
        return rate


def noise_rates(rate: float | LocalRate, xy: Array) -> float | Array:
    """Rate in the noise of samples at places of shape (n, 2) [m]: one number, or shape (n,) [counts/s]."""
    return rate(xy) if isinstance(rate, LocalRate) else rate


def _correlation(variogram: Variogram, xy: Array, pools_xy: Array) -> Array:
    """Correlation of the smooth rate between places, shape (n, k); no product of matrices."""
    x, y = scaled(variogram, *xy.T)
    pools_x, pools_y = scaled(variogram, *pools_xy.T)
    return variogram.correlation_of_square((x[:, None] - pools_x) ** 2 + (y[:, None] - pools_y) ** 2)
