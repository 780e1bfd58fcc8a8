"""Drift: the mean rate changes while the survey lasts, by drying or rain, and must not become a pattern in space.

The rate at place x and time t is ``m + z(x) - w(T - t)``: m and z belong to the time T of the map, and w is what
the mean has changed since a count of that age. A trend and a random walk about it give w the covariance::

    cov(w(a), w(b)) = per_hour^2 (a b + WANDER_H min(a, b)),     ages a and b in hours

So the counts share w, and the targets of the map have none of it. The unknown mean of kriging takes up m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import IllConditionedError
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]

WINDOW_S = 720.0
"""Records of one place become one sample only within this time [s]."""
WANDER_H = 0.2
"""Variance of the random walk per hour, relative to that of the trend in an hour [h]."""
GUESSED_SHARE = 0.03
"""Prior median of the trend, as a share of the mean rate in an hour."""
PRIOR_LOG_SD = 1.5
"""Prior standard deviation of the logarithm of the trend's variance."""
MIN_EVIDENCE = 1.0
"""Least rise of the log posterior density for a drift. Of 48 simulated missions of two hours without one, 8 % had
a false drift after an hour, and none at the end."""
MIN_TREND = 1.4
"""Least size of the trend in standard errors for the evidence to be computed at all."""
MIN_SAMPLES = 10
"""Least number of samples for a drift."""
MAX_SAMPLES = 1000
"""Greatest number of samples to which a drift is fitted; of more, every k-th is used."""
_STEPS = np.linspace(-4.0, 4.0, 81)
"""Logarithms of the trend's variance that are compared, in standard deviations of its prior."""


@dataclass(frozen=True, eq=False)
class TimedSamples:
    """Samples of records of one place and about one time.

    :param samples: the samples
    :param time_s: mean time at which each was counted, shape (n,) [s]
    """

    samples: Samples
    time_s: Array

    def thinned(self, most: int) -> TimedSamples:
        """Every k-th sample, at most ``most`` in all."""
        some = slice(None, None, max(1, -(-len(self.samples) // most)))
        one = self.samples
        few = Samples(one.xy[some], one.counts[some], one.exposure_s[some], one.spread[some])
        return TimedSamples(few, self.time_s[some])


@dataclass(frozen=True)
class Drift:
    """A drift of the mean rate.

    :param per_hour: standard deviation of the trend [counts/s per h]
    :param evidence: rise of the log posterior density by the drift
    """

    per_hour: float
    evidence: float

    def covariance(self, timed: TimedSamples, now_s: float) -> Array:
        """Covariance that a map of now gives the samples in addition, shape (n, n) [(counts/s)^2]."""
        return self.per_hour**2 * _shape(timed, now_s)


def find_drift(
    timed: TimedSamples,
    now_s: float,
    variogram: Variogram,
    rate: float | LocalRate | None = None,
    prior: FieldPrior | None = None,
) -> Drift | None:
    """The drift of a survey; ``None`` if the counts do not ask for one.

    The variogram stays as it was fitted without a drift: a common fit lowered the error of simulated maps by less
    than 1 %. A trend smaller than :data:`MIN_TREND` standard errors is no drift. Otherwise the restricted
    likelihood and a log-normal prior of the variance decide.

    :param timed: the samples
    :param now_s: time of the map, not before the samples [s]
    :param variogram: variogram of the rate
    :param rate: rate in the noise of the samples, as :class:`PoissonKriging`
    :param prior: what is known of the field besides
    """
    from scipy.linalg import solve_triangular

    timed = timed.thinned(MAX_SAMPLES)
    samples = timed.samples
    if len(samples) < MIN_SAMPLES or not np.ptp(timed.time_s):
        return None
    try:
        still = PoissonKriging(variogram, mean_rate=rate, prior=prior).fit(
            samples.xy, samples.counts, samples.exposure_s, samples.spread
        )
    except IllConditionedError:
        return None
    system = still.system
    merge = still.merging
    unit = variogram.amplitude_at(system.places.xy)
    if unit is not None:
        merge = merge / unit[:, None]

    def whitened(values: Array) -> Array:
        solved = solve_triangular(system.factor, merge @ values, lower=True, check_finite=False)
        return np.asarray(
            solved - np.multiply.outer(system.ones, system.ones @ solved / (system.ones @ system.ones))
        )

    trend = whitened((now_s - timed.time_s) / 3600)
    if (trend @ system.residual) ** 2 < MIN_TREND**2 * (trend @ trend):
        return None
    # With the mean projected out, the likelihood is that of independent values in the directions of the drift.
    values, vectors = np.linalg.eigh(whitened(whitened(_shape(timed, now_s)).T))
    values = np.maximum(values, 0.0)
    square = (vectors.T @ system.residual) ** 2
    guess = 2 * np.log(GUESSED_SHARE * still.noise_mean_rate)
    variance = np.exp(guess + PRIOR_LOG_SD * _STEPS)
    scale = 1 + np.multiply.outer(variance, values)
    rise = 0.5 * ((square - square / scale) - np.log(scale)).sum(axis=1) - 0.5 * _STEPS**2
    best = int(np.argmax(rise))
    if rise[best] < MIN_EVIDENCE:
        return None
    return Drift(float(np.sqrt(variance[best])), float(rise[best]))


def _shape(timed: TimedSamples, now_s: float) -> Array:
    """Covariance of a drift of 1 per hour."""
    age_h = (now_s - timed.time_s) / 3600
    return np.multiply.outer(age_h, age_h) + WANDER_H * np.minimum.outer(age_h, age_h)
