"""Drift: the mean rate changes while the survey lasts, by drying or rain, and must not become a pattern in space.

The rate at place x and time t is ``m + z(x) - w(T - t)``: m and z belong to the time T of the map, and w is what
the mean has changed since a count of that age. A trend and a random walk about it give w the covariance::

    cov(w(a), w(b)) = per_hour^2 (a b + WANDER_H min(a, b)),     ages a and b in hours

So the counts share w, and the targets of the map have none of it. The unknown mean of kriging takes up m. Rain
may change the mean at once: then w is one value for all counts before, and none for those after. The likelihood
chooses between no drift, a trend and a jump.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import IllConditionedError
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]
DriftModel = Literal["auto", "off"]

WINDOW_S = 300.0
"""Records of one place become one sample only within this time [s]."""
WANDER_H = 0.05
"""Variance of the random walk per hour, relative to that of the trend in an hour [h]."""
GUESSED_SHARE = 0.03
"""Prior median of the trend, as a share of the mean rate in an hour."""
PRIOR_LOG_SD = 1.5
"""Prior standard deviation of the logarithm of the trend's variance."""
MIN_EVIDENCE = 1.5
"""Least rise of the log posterior density for a drift. At the end of two hours with ``gcb``, 1 of 48 simulated
missions without a drift had one, and 20 of 24 that dried by 10 %. A drift that is not there made the error 1.2
to 2 times as large, one that is missed 1.5 to 5 times."""
MIN_TREND = 1.4
"""Least size of the trend in standard errors for the evidence to be computed at all."""
JUMP_EVERY_S = 300.0
"""Time between the jumps that are compared [s]."""
GUESSED_JUMP = 0.05
"""Prior median of a jump's standard deviation, as a share of the mean rate."""
MIN_JUMP = 3.5
"""Least size of a jump that is reported, in standard errors. In 48 simulated missions of two hours without rain,
the largest fall by chance had 3.3 standard errors."""
RECENT_S = 1800.0
"""A fall of the rate within this time means that rain is likely now [s]."""
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

    def joined(self, samples: Samples, time_s: float) -> TimedSamples:
        """These samples, and others of one time [s]."""
        return TimedSamples(self.samples.joined(samples), np.append(self.time_s, np.full(len(samples), time_s)))


@dataclass(frozen=True)
class Jump:
    """A change of the mean rate at once, as rain causes.

    :param since_s: when [s]
    :param change_cps: the change; negative for a fall [counts/s]
    :param sd_cps: its standard error, the pattern of the field and the noise of the counts included [counts/s]
    :param share: the change as a share of the mean rate
    """

    since_s: float
    change_cps: float
    sd_cps: float
    share: float

    @property
    def is_certain(self) -> bool:
        """Whether chance is no explanation."""
        return abs(self.change_cps) >= MIN_JUMP * self.sd_cps

    @property
    def text(self) -> str:
        """The change, in words."""
        verb, share, sd = "fell" if self.change_cps < 0 else "rose", abs(self.share), abs(self.share_sd)
        return f"the rate {verb} by ({100 * share:.0f} ± {100 * sd:.0f}) % within minutes"

    @property
    def share_sd(self) -> float:
        """Standard error of the share."""
        return self.share * self.sd_cps / self.change_cps

    def rain(self, now_s: float) -> str:
        """Why rain is likely at a time [s], and what to do; empty if it is not."""
        ago_s = now_s - self.since_s
        if not self.is_certain or self.change_cps > 0 or ago_s > RECENT_S:
            return ""
        return (
            f"rain is likely: {self.text}, {ago_s / 60:.0f} min ago; if it rains, wait until it is over, then "
            "measure at some earlier stops again, for the map is of the field as it is now"
        )


@dataclass(frozen=True)
class Drift:
    """A drift of the mean rate.

    :param per_hour: standard deviation of the trend [counts/s per h]; of a jump, its standard deviation [counts/s]
    :param evidence: rise of the log posterior density by the drift
    :param change_cps: change from the first sample to the map [counts/s]
    :param change_sd_cps: its standard deviation [counts/s]
    :param jump_s: when the mean jumped [s]; ``None`` for a trend
    """

    per_hour: float
    evidence: float
    change_cps: float = 0.0
    change_sd_cps: float = 0.0
    jump_s: float | None = None

    def covariance(self, timed: TimedSamples, now_s: float) -> Array:
        """Covariance that a map of now gives the samples in addition, shape (n, n) [(counts/s)^2]."""
        if self.jump_s is None:
            return self.per_hour**2 * _trend(timed, now_s)
        before = (timed.time_s < self.jump_s).astype(float)
        return np.asarray(self.per_hour**2 * np.multiply.outer(before, before))


@dataclass(frozen=True)
class Change:
    """How the mean rate changed during a survey.

    :param drift: what the map allows for; ``None`` if the counts do not ask for a drift
    :param jump: the likeliest jump, certain or not; ``None`` if the survey is too short for one
    """

    drift: Drift | None = None
    jump: Jump | None = None

    def rain(self, now_s: float) -> str:
        """Why rain is likely at a time [s], and what to do; empty if it is not."""
        return "" if self.jump is None else self.jump.rain(now_s)

    @property
    def text(self) -> str:
        """How the mean rate changed, in words; empty if it did not."""
        is_trend = self.drift is not None and self.drift.jump_s is None
        if self.jump is not None and self.jump.is_certain and not is_trend:
            return self.jump.text
        if self.drift is None:
            return ""
        change, sd = self.drift.change_cps, self.drift.change_sd_cps
        verb = "rose" if change > 0 else "fell"
        return f"the rate {verb} by ({abs(change):.2f} ± {sd:.2f}) counts/s during the survey"


NO_CHANGE = Change()
"""Nothing is known of a change."""


@dataclass(frozen=True, eq=False)
class Changing:
    """What a map is made of in addition, if the mean rate may change.

    :param timed: the samples by place and time
    :param change: how their mean changed
    :param now_s: time of the map [s]
    """

    timed: TimedSamples
    change: Change
    now_s: float

    def joined(self, samples: Samples) -> Changing:
        """The same with further samples, of now."""
        return replace(self, timed=self.timed.joined(samples, self.now_s))


def find_change(
    timed: TimedSamples,
    now_s: float,
    variogram: Variogram,
    rate: float | LocalRate | None = None,
    prior: FieldPrior | None = None,
) -> Change:
    """How the mean rate changed, as far as the counts tell.

    The variogram stays as it was fitted without a drift: a common fit lowered the error of simulated maps by less
    than 1 %. The restricted likelihood and log-normal priors of the variances decide.

    :param timed: the samples
    :param now_s: time of the map, not before the samples [s]
    :param variogram: variogram of the rate
    :param rate: rate in the noise of the samples, as :class:`PoissonKriging`
    :param prior: what is known of the field besides
    """
    timed = timed.thinned(MAX_SAMPLES)
    if len(timed.samples) < MIN_SAMPLES or not np.ptp(timed.time_s):
        return NO_CHANGE
    try:
        still = _Still.of(timed, variogram, rate, prior)
    except IllConditionedError:
        return NO_CHANGE
    if len(still.kriging.places) < MIN_SAMPLES:  # counts at exactly one place are one, whenever they came
        return NO_CHANGE
    jump, jumped = _find_jump(still, now_s)
    trend = _find_trend(still, now_s)
    found = [drift for drift in (trend, jumped) if drift is not None and drift.evidence >= MIN_EVIDENCE]
    best = max(found, key=lambda drift: drift.evidence, default=None)
    return Change(None if best is None else still.with_change(best, now_s), jump)


@dataclass(frozen=True, eq=False)
class _Still:
    """The rates of samples in a field without drift: independent, with variance 1, and without the unknown mean.

    :param timed: the samples
    :param kriging: their kriging without a drift
    :param merge: shares of the samples in the places of the kriging, in units of the amplitude
    """

    timed: TimedSamples
    kriging: PoissonKriging
    merge: Array

    @classmethod
    def of(
        cls, timed: TimedSamples, variogram: Variogram, rate: float | LocalRate | None, prior: FieldPrior | None
    ) -> _Still:
        samples = timed.samples
        kriging = PoissonKriging(variogram, mean_rate=rate, prior=prior).fit(
            samples.xy, samples.counts, samples.exposure_s, samples.spread
        )
        merge, unit = kriging.merging, variogram.amplitude_at(kriging.places.xy)
        return cls(timed, kriging, merge if unit is None else merge / unit[:, None])

    @property
    def mean_rate(self) -> float:
        """Mean rate of the samples [counts/s]."""
        return self.kriging.noise_mean_rate

    @property
    def residual(self) -> Array:
        """The rates, shape (places,)."""
        residual: Array = self.kriging.system.residual
        return residual

    def whitened(self, values: Array) -> Array:
        """Values of the samples, shape (n, ...), as the rates are."""
        from scipy.linalg import solve_triangular

        system = self.kriging.system
        solved = solve_triangular(system.factor, self.merge @ values, lower=True, check_finite=False)
        ones = system.ones
        return np.asarray(solved - np.multiply.outer(ones, ones @ solved / (ones @ ones)))

    def with_change(self, drift: Drift, now_s: float) -> Drift:
        """The drift, with the posterior mean and standard deviation of the change that it made."""
        first = int(np.argmin(self.timed.time_s))
        covariance = drift.covariance(self.timed, now_s)
        own = self.whitened(covariance[:, first])
        together = np.eye(len(own)) + self.whitened(self.whitened(covariance).T)
        solved = np.linalg.solve(together, np.column_stack([self.residual, own]))
        change_cps, explained = own @ solved
        sd_cps = np.sqrt(max(covariance[first, first] - explained, 0.0))
        return replace(drift, change_cps=-float(change_cps), change_sd_cps=float(sd_cps))


def _find_trend(still: _Still, now_s: float) -> Drift | None:
    """The likeliest trend; ``None`` if it is smaller than :data:`MIN_TREND` standard errors."""
    timed = still.timed
    trend = still.whitened((now_s - timed.time_s) / 3600)
    if (trend @ still.residual) ** 2 < MIN_TREND**2 * (trend @ trend):
        return None
    # With the mean projected out, the likelihood is that of independent values in the directions of the drift.
    values, vectors = np.linalg.eigh(still.whitened(still.whitened(_trend(timed, now_s)).T))
    values = np.maximum(values, 0.0)
    square = (vectors.T @ still.residual) ** 2
    variance = (GUESSED_SHARE * still.mean_rate) ** 2 * np.exp(PRIOR_LOG_SD * _STEPS)
    scale = 1 + np.multiply.outer(variance, values)
    rise = 0.5 * (square - square / scale - np.log(scale)).sum(axis=1) - 0.5 * _STEPS**2
    best = int(np.argmax(rise))
    return Drift(float(np.sqrt(variance[best])), float(rise[best]))


def _find_jump(still: _Still, now_s: float) -> tuple[Jump | None, Drift | None]:
    """The likeliest jump, and the drift that it is; all times of a jump are equally likely beforehand."""
    time_s = still.timed.time_s
    times_s = np.arange(time_s.min() + JUMP_EVERY_S, now_s, JUMP_EVERY_S)
    before = (time_s[:, None] < times_s).astype(float)
    sides = before.any(axis=0) & ~before.all(axis=0)
    if not sides.any():
        return None, None
    times_s, before = times_s[sides], still.whitened(before[:, sides])
    size = (before**2).sum(axis=0)
    # Of a jump between visits of the same places the counts tell nothing: this is rounding.
    told = size * still.mean_rate**2 > 1e-6
    if not told.any():
        return None, None
    times_s, before, size = times_s[told], before[:, told], size[told]
    product = before.T @ still.residual
    variance = (GUESSED_JUMP * still.mean_rate) ** 2 * np.exp(PRIOR_LOG_SD * _STEPS)
    scale = 1 + np.multiply.outer(variance, size)
    rise = 0.5 * (np.multiply.outer(variance, product**2) / scale - np.log(scale)) - 0.5 * _STEPS[:, None] ** 2
    step, best = np.unravel_index(int(np.argmax(rise)), rise.shape)
    since_s, change_cps = float(times_s[best]), -float(product[best] / size[best])
    jump = Jump(since_s, change_cps, float(size[best] ** -0.5), change_cps / still.mean_rate)
    evidence = float(rise[step, best] - np.log(len(times_s)))
    return jump, Drift(float(np.sqrt(variance[step])), evidence, jump_s=since_s)


def _trend(timed: TimedSamples, now_s: float) -> Array:
    """Covariance of a trend of 1 per hour and its random walk."""
    age_h = (now_s - timed.time_s) / 3600
    return np.multiply.outer(age_h, age_h) + WANDER_H * np.minimum.outer(age_h, age_h)
