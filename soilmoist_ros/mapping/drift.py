# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drift: the mean rate changes while the survey lasts, by drying or rain, and must not become a pattern in space.

The rate at place x and time t is ``r(x) (1 + u(t))`` with r the map, and u = 0 at its time: a wet place and a dry
one change by the same share. The counts are compared with ``r(x) + m u(t)``, m the mean rate: r, kriged from these
very counts, would make each pattern of the field the direction of a drift. Before the counts, u is one of three::

    nothing         u = 0
    a trend         cov(u, u') = s^2 (a b + WANDER_H min(a, b)),     ages a and b in hours
    a jump at t0    u = d before t0, variance s^2;  all t0 are equally likely

The mean of the field and any quadratic surface are projected out: what a single sweep cannot tell from a slope of
the field is no evidence of a drift. The restricted likelihood then is that of independent values in the directions
of u, so the posterior of u has a closed form for each s and t0. What the map uses is the mean over all of them,
weighed by their posterior probabilities (Hoeting et al. 1999, Statistical Science 14:382-417): exposures are
multiplied by ``1 + mean(u)``, and the covariance of u adds to that of the map.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import IllConditionedError
from soilmoist_ros.mapping.kriging.system import KrigingSystem, sample_correlation
from soilmoist_ros.mapping.samples import Samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]
DriftModel = Literal["auto", "off"]

WINDOW_S = 300.0  # records of one place become one sample only within this time [s]
STILL, JUMPS = 0.8, 0.05  # prior probabilities of no drift, and of a jump; of a trend otherwise
MIN_PROBABILITY = 0.6
"""Least posterior probability of a drift for a map to allow for it. Of 324 missions on fields that did not change,
3 ended above 0.5 and one above 0.6; at 0.7, more of the real changes of 10 % are missed."""
GUESSED_TREND, GUESSED_JUMP = 0.05, 0.06
"""Prior medians of the standard deviations: of a trend in an hour, and of a jump, as shares of the rate."""
LOG_SD = 0.3  # prior standard deviation of the logarithm of both
WANDER_H = 0.02  # variance of the random walk per hour, relative to that of the trend in an hour [h]
KNOT_S = 300.0  # time between the knots of u, which is linear between them; jumps last as long, as rain does
MAX_KNOTS = 49  # greatest number of knots; they are farther apart in long surveys
QUANTILE_95_SD = 1.96  # standard deviations from the mean to the ends of a 95 % interval
MIN_JUMP = 3.5
"""Least size of a jump that is reported, in standard errors. In one of 324 simulated missions of two hours without
rain, 264 of them on real surfaces, a change of this size came by chance where the map allowed for a drift."""
RECENT_S = 1800.0  # a fall of the rate within this time means that rain is likely now [s]
MIN_SAMPLES = 10  # least number of places for a drift
MAX_SAMPLES = 1000  # greatest number of samples to which a drift is fitted; of more, every k-th is used
_MIN_FACTOR = 0.1
_STEPS = np.linspace(-3.0, 3.0, 13)
"""Logarithms of the standard deviations that are compared, in standard deviations of their prior."""
_MIN_INFORMATION = 1e-6
_SURFACE_RCOND = 1e-9
"""Least share of the greatest for a dimension of the surfaces to count: samples on a line have fewer."""
_KEPT = 1e-3  # least variance of a component of u that is kept, relative to the greatest


@dataclass(frozen=True, eq=False)
class TimedSamples:
    """Samples of records of one place and about one time.

    :param time_s: mean time at which each was counted, shape (n,) [s]
    """

    samples: Samples
    time_s: Array

    @cached_property
    def without_footprint(self) -> TimedSamples:
        """Copy of these samples, as if the sensor saw its own place only."""
        return TimedSamples(self.samples.without_footprint, self.time_s)

    def thinned(self, most: int) -> TimedSamples:
        """Every k-th sample, at most ``most`` in all."""
        some = slice(None, None, max(1, -(-len(self.samples) // most)))
        return TimedSamples(self.samples.some(some), self.time_s[some])

    def nearest(self, places: Samples) -> NDArray[np.intp]:
        """Number of the place nearest to each sample, shape (n,)."""
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(places.xy).query(self.samples.xy)[1], np.intp)

    def at(self, places: Samples) -> TimedSamples:
        """Copy of these samples, as if counted at the nearest places and over their areas.

        So all records of a stop are of one place, at whatever time, and however their positions jitter.
        """
        near, one = self.nearest(places), self.samples
        return TimedSamples(Samples(places.xy[near], one.counts, one.exposure_s, places.spread[near]), self.time_s)

    def joined(self, samples: Samples, time_s: float) -> TimedSamples:
        """Copy of these samples with further samples of one time [s]."""
        return TimedSamples(self.samples.joined(samples), np.append(self.time_s, np.full(len(samples), time_s)))


@dataclass(frozen=True)
class Jump:
    """A change of the mean rate at once, as rain causes."""

    since_s: float  # time of the jump [s]
    change_cps: float  # the change; negative for a fall [counts/s]
    sd_cps: float  # its standard error, the pattern of the field and the noise of the counts included [counts/s]
    share: float  # the change as a share of the mean rate

    @property
    def is_certain(self) -> bool:
        """True if chance is no explanation."""
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
        """Reason why rain is likely at a time [s], and what to do; empty if it is not."""
        ago_s = now_s - self.since_s
        if not self.is_certain or self.change_cps > 0 or ago_s > RECENT_S:
            return ""
        return (
            f"rain is likely: {self.text}, {ago_s / 60:.0f} min ago; if it rains, wait until it is over, then "
            "measure at some earlier stops again, for the map is of the field as it is now"
        )


@dataclass(frozen=True)
class Drift:
    """Posterior of a drift u of the mean rate: the rate then is the rate now times ``1 + u``.

    :param probability: that the mean rate changed at all
    :param times_s: knots, between which u is linear; later, it is 0 [s]
    :param shares: mean of u at each
    :param components: independent parts of the uncertainty of u, one standard deviation of each, at each time
    """

    probability: float
    is_jump: bool
    times_s: tuple[float, ...]
    shares: tuple[float, ...]
    components: tuple[tuple[float, ...], ...] = ()

    @property
    def change(self) -> float:
        """Change of the rate from the first sample to the map, as a share of the rate then."""
        return 1 / self._factor(np.array(self.shares[:1])).item() - 1

    @property
    def change_sd(self) -> float:
        """Standard deviation of the change."""
        return float(np.linalg.norm([one[0] for one in self.components])) * (1 + self.change) ** 2

    @property
    def is_seen(self) -> bool:
        """True if the 95 % interval of the change excludes zero. The rate may have changed and returned."""
        return abs(self.change) > QUANTILE_95_SD * self.change_sd

    def factor(self, time_s: Array) -> Array:
        """Factor by which the exposures of samples of some times are multiplied, shape (n,)."""
        return self._factor(np.interp(time_s, self.times_s, self.shares))

    def uncertain(self, time_s: Array) -> Array:
        """The components at some times, shape (n, components)."""
        parts = [np.interp(time_s, self.times_s, one) for one in self.components]
        return np.array(parts).reshape(len(parts), len(time_s)).T

    @staticmethod
    def _factor(shares: Array) -> Array:
        return np.maximum(1 + shares, _MIN_FACTOR)


@dataclass(frozen=True)
class Change:
    """Change of the mean rate during a survey."""

    drift: Drift | None = None
    jump: Jump | None = None

    def rain(self, now_s: float) -> str:
        """Reason why rain is likely at a time [s], and what to do; empty if it is not."""
        return "" if self.jump is None else self.jump.rain(now_s)

    @property
    def is_seen(self) -> bool:
        """True if a change from begin to end can be told from chance."""
        return self._is_jump or (self.drift is not None and self.drift.is_seen)

    @property
    def _is_jump(self) -> bool:
        """True if the change was at once: a certain jump, and no trend that explains the counts better."""
        is_trend = self.drift is not None and not self.drift.is_jump
        return self.jump is not None and self.jump.is_certain and not is_trend

    @property
    def text(self) -> str:
        """Change of the mean rate, in words; empty if there is none."""
        if self.jump is not None and self._is_jump:
            return self.jump.text
        if self.drift is None:
            return ""
        change, sd = self.drift.change, self.drift.change_sd
        if not self.is_seen:
            return f"no change of the rate from begin to end can be seen: ({100 * change:+.0f} ± {100 * sd:.0f}) %"
        verb = "rose" if change > 0 else "fell"
        return f"the rate {verb} by ({100 * abs(change):.0f} ± {100 * sd:.0f}) % during the survey"


NO_CHANGE = Change()  # nothing is known of a change


@dataclass(frozen=True, eq=False)
class Changing:
    """Drift model of a map whose mean rate may change: samples by place and time, change, and the time now [s]."""

    timed: TimedSamples
    change: Change
    now_s: float

    def joined(self, samples: Samples) -> Changing:
        """Copy of this drift model with further samples, of now."""
        return replace(self, timed=self.timed.joined(samples, self.now_s))


def find_change(
    timed: TimedSamples,
    now_s: float,
    variogram: Variogram,
    rate: float | LocalRate | None = None,
    prior: FieldPrior | None = None,
    places: Samples | None = None,
) -> Change:
    """Change of the mean rate, as far as the counts show it.

    The variogram stays as it was fitted without a drift: a common fit lowered the error of simulated maps by less
    than 1 %.

    :param places: samples of all times; timed samples nearest to one of them share the variation at this place
        alone. By default, timed samples of exactly one place share it
    """
    timed = timed.thinned(MAX_SAMPLES)
    samples, time_s = timed.samples, timed.time_s
    if len(samples) < MIN_SAMPLES or not np.ptp(time_s):
        return NO_CHANGE
    places, place = merge_exactly(samples) if places is None else (places, timed.nearest(places))
    if len(np.unique(place)) < MIN_SAMPLES:
        return NO_CHANGE
    rate = noise_rate(samples) if rate is None else rate
    try:
        system = _unmerged(samples, variogram, rate, prior, places, place)
    except IllConditionedError:
        return NO_CHANGE
    begin_s = float(time_s.min())
    times_s = np.linspace(begin_s, now_s, int(np.clip(round((now_s - begin_s) / KNOT_S) + 1, 2, MAX_KNOTS)))
    mean_rate = noise_rate(samples)
    shares = np.column_stack([np.interp(time_s, times_s, one) for one in np.eye(len(times_s))])  # linear between
    of_knots = _whitened(system, shares * mean_rate)
    evidence = _Evidence(times_s, of_knots.T @ of_knots, of_knots.T @ system.residual)
    drift = _drift(evidence)
    return NO_CHANGE if drift is None else Change(drift, _jump(evidence, mean_rate))


def _unmerged(
    samples: Samples,
    variogram: Variogram,
    rate: float | LocalRate,
    prior: FieldPrior | None,
    places: Samples,
    place: NDArray[np.intp],
) -> KrigingSystem:
    """The kriging system without a drift; samples of one place stay apart, being of several times."""
    from scipy.linalg.lapack import dpotrf

    xy, n = samples.xy, len(samples)
    matrix = sample_correlation(variogram, xy, samples.spread) * variogram.structured_sill
    same = place[:, None] == place
    matrix += variogram.nugget * same
    noise = noise_rates(rate, xy) / samples.exposure_s
    features = np.empty((0, 0))
    if prior is not None:
        features = prior.at(xy, samples.spread)
        matrix += prior.covariance(features, features)
        matrix += np.broadcast_to(prior.own_variance(places.xy), len(places))[place] * same
    matrix[np.diag_indices(n)] += noise
    factor, info = dpotrf(matrix, lower=1, clean=1)
    if info:
        raise IllConditionedError("the covariance of the samples by place and time is not positive definite")
    return KrigingSystem.of_factor(variogram, samples, factor, prior, features)


def _whitened(system: KrigingSystem, values: Array) -> Array:
    """Values of the samples, shape (n, k), with variance 1, independent, without mean and quadratic surface."""
    from scipy.linalg import orth, solve_triangular

    xy = system.places.xy
    x, y = ((xy - xy.mean(axis=0)) / np.ptp(xy, axis=0).max()).T
    both = np.column_stack([values, np.ones(len(x)), x, y, x * x, x * y, y * y])
    solved, surface = np.split(
        solve_triangular(system.factor, both, lower=True, check_finite=False), [values.shape[1]], axis=1
    )
    surface = orth(surface, rcond=_SURFACE_RCOND)
    return np.asarray(solved - surface @ (surface.T @ solved))


@dataclass(frozen=True, eq=False)
class _Evidence:
    """The log likelihood of u, ``score' u - u' information u / 2``."""

    times_s: Array  # knots, shape (k,) [s]
    information: Array  # shape (k, k)
    score: Array  # shape (k,)

    @property
    def trend(self) -> Array:
        """Independent parts of a trend of 1 per hour, for which the information is diagonal, shape (k, parts)."""
        age_h = (self.times_s[-1] - self.times_s) / 3600
        square = np.multiply.outer(age_h, age_h) + WANDER_H * np.minimum.outer(age_h, age_h)
        values, vectors = np.linalg.eigh(square)
        parts = vectors[:, values > 1e-9 * values[-1]] * np.sqrt(values[values > 1e-9 * values[-1]])
        return np.asarray(parts @ np.linalg.eigh(parts.T @ self.information @ parts)[1])

    @property
    def jumps(self) -> Array:
        """A jump by 1 between each two knots, shape (k, k - 1)."""
        return np.tri(len(self.times_s)).T[:, :-1]

    def of(self, parts: Array) -> tuple[Array, Array]:
        """Information on the amount of each part alone, and its score, shapes (parts,)."""
        return np.maximum(((self.information @ parts) * parts).sum(axis=0), 0.0), parts.T @ self.score


def _drift(evidence: _Evidence) -> Drift | None:
    """The posterior of u over all sizes of trend and all jumps; ``None`` where no drift is more likely."""
    trend, jumps = evidence.trend, evidence.jumps
    sizes = np.exp(2 * LOG_SD * _STEPS)[:, None]
    prior = -0.5 * _STEPS**2 - np.log(np.exp(-0.5 * _STEPS**2).sum())
    rise, amount, variance = _normal(*evidence.of(trend), GUESSED_TREND**2 * sizes)
    of_trend = rise.sum(axis=1) + prior + np.log(1 - STILL - JUMPS)
    rise, jump, jump_variance = _normal(*evidence.of(jumps), GUESSED_JUMP**2 * sizes)
    of_jumps = rise + prior[:, None] + np.log(JUMPS / jumps.shape[1])
    highest = max(of_trend.max(), of_jumps.max(), 0.0)
    of_trend, of_jumps, still = np.exp(of_trend - highest), np.exp(of_jumps - highest), STILL * np.exp(-highest)
    total = of_trend.sum() + of_jumps.sum() + still
    of_trend, of_jumps = of_trend / total, of_jumps / total
    if still / total > 1 - MIN_PROBABILITY:
        return None
    mean = trend @ (of_trend @ amount) + jumps @ (of_jumps * jump).sum(axis=0)
    within = np.diag(of_trend @ variance) + (amount.T * of_trend) @ amount
    square = trend @ within @ trend.T
    square += (jumps * (of_jumps * (jump_variance + jump**2)).sum(axis=0)) @ jumps.T
    components = _components(square - np.multiply.outer(mean, mean))
    return Drift(
        float(1 - still / total),
        bool(of_jumps.sum() > of_trend.sum()),
        tuple(evidence.times_s.tolist()),
        tuple(mean.tolist()),
        tuple(tuple(one) for one in components.tolist()),
    )


def _components(covariance: Array) -> Array:
    """Independent parts of an uncertainty, one standard deviation of each, shape (components, k)."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > _KEPT * values[-1]
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T)


def _normal(information: Array, score: Array, variance: Array) -> tuple[Array, Array, Array]:
    """Rise of the log likelihood, posterior mean and variance of amounts with a normal prior."""
    scale = 1 + variance * information
    return 0.5 * (variance * score**2 / scale - np.log(scale)), variance * score / scale, variance / scale


def _jump(evidence: _Evidence, mean_rate: float) -> Jump | None:
    """The likeliest jump, certain or not; ``None`` if the counts hold no information on any."""
    information, score = evidence.of(evidence.jumps)
    # On a jump between visits of the same places the counts hold no information: this is rounding.
    known = np.flatnonzero(information > _MIN_INFORMATION)
    if not len(known):
        return None
    rise = _normal(information[known], score[known], np.array([[GUESSED_JUMP**2]]))[0][0]
    best = int(known[np.argmax(rise)])
    share, sd = float(-score[best] / information[best]), float(information[best] ** -0.5)
    since_s = float(evidence.times_s[best : best + 2].mean())
    return Jump(since_s, share * mean_rate, sd * mean_rate, share)
