# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compares counts with what the map expects: one record that does not fit is held back until another confirms it.

A fault of the sensor and a wet hollow can look alike in one record. The next record at the same place decides:
a hollow is there again, a fault is not. Rain lowers the records of all places, so some low records in a row
confirm each other. Where two single records of a drive had 2.7 times their counts, the squared error of simulated
maps was that without faults, and 2 to 10 times as large without this test (4 kinds of surveys, 5 seeds each).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.sensing import CountRecord

Array = NDArray[np.float64]
Where = tuple[int, Array]
"""Index of a record in the track, and spread of its counts: what the map needs to use it later."""


MAX_PROBABILITY: Final = 1e-5
"""Probability of a count, or of one farther out on its side, below which it is unexpected. Both sides together are
a false alarm in six days of records of 10 s."""
MIN_SAMPLES: Final = 10  # number of samples from which the map is trusted
NEAR: Final = 16  # number of nearest samples from which the rate is predicted
CLEARLY: Final = 1.5
"""Difference of the square roots of counts (standard deviation 0.5) by which a record must lie outside all near
samples before its rate is predicted: it saves the kriging of nearly all good records."""
SAME_PLACE: Final = 0.5
"""Correlation of the rates from which two records are at the same place, and from which a sample knows a place."""
CONFIRMED: Final = 0.5
"""Share of the deviation, of the square root of the rate, from which the next record confirms the first."""
RAIN_ROW: Final = 3
"""Number of records in a row that are too low, wherever they are, from which the field has changed: it rains."""
MIN_RAIN: Final = 0.6
"""Least rate that rain leaves, relative to what the map expects. No rain of an hour lowers it further."""
MAX_HELD: Final = 200  # number of records that can be held back; the oldest are no longer waited for


@dataclass(frozen=True)
class Expectation:
    """Rate that the map expects at a place, with its variance."""

    rate_cps: float  # corrected count rate [counts/s]
    variance: float  # variance of the rate, micro-scale variation included [(counts/s)^2]

    def tails(self, raw_counts: int, exposure_s: float) -> tuple[float, float]:
        """Probabilities of counts this low or lower, and of counts this high or higher: P(N <= n) and P(N >= n).

        The rate is gamma-distributed, so the counts have a negative binomial distribution (Gelman et al. 2013,
        Bayesian Data Analysis, section 2.6), and the probabilities are exact.
        """
        from scipy.special import betainc, gammainc, gammaincc

        expected = self.rate_cps * exposure_s
        if self.variance * exposure_s < 1e-9 * self.rate_cps:  # Poisson
            high = float(gammainc(raw_counts, expected)) if raw_counts else 1.0
            return float(gammaincc(raw_counts + 1, expected)), high
        shape = self.rate_cps**2 / self.variance
        share = shape / (shape + expected)
        high = float(betainc(raw_counts, shape, 1 - share)) if raw_counts else 1.0
        return float(betainc(shape, raw_counts + 1, share)), high

    def deviation(self, record: CountRecord) -> float:
        """Square root of a record's rate minus that of the expectation [sqrt(counts/s)]."""
        return math.sqrt(record.corrected_rate) - math.sqrt(self.rate_cps)

    def is_far(self, record: CountRecord) -> bool:
        """True if a record's counts are hardly possible."""
        return min(self.tails(record.raw_counts, record.effective_exposure_s)) < MAX_PROBABILITY

    def text(self, record: CountRecord) -> str:
        """Counts of a record and counts that the map expects, in words."""
        exposure_s = record.effective_exposure_s
        expected = self.rate_cps * exposure_s
        sd = math.sqrt(expected + self.variance * exposure_s**2)
        return f"{record.raw_counts} counts where the map expects {expected:.0f} ± {sd:.0f}"


def stands_out(record: CountRecord, samples: Samples) -> bool:
    """True if a record's counts are clearly outside the rates of the samples around it; quick."""
    near = nearest(samples, record.x_m, record.y_m)
    exposure_s = samples.exposure_s[near]
    roots = np.sqrt(samples.counts[near] / exposure_s)
    noise = 0.5 / np.sqrt(exposure_s)  # the extremes of noisy rates are too far out
    low, high = np.array([(roots + noise).min(), (roots - noise).max()]) * math.sqrt(record.effective_exposure_s)
    counted = math.sqrt(record.raw_counts)
    return bool(counted < low - CLEARLY or counted > high + CLEARLY)


def expectation(samples: Samples, variogram: Variogram, x_m: float, y_m: float) -> Expectation | None:
    """Rate expected at a place from the samples around it; ``None`` if it is not positive."""
    near = nearest(samples, x_m, y_m)
    kriging = PoissonKriging(variogram).fit(
        samples.xy[near], samples.counts[near], samples.exposure_s[near], samples.spread[near]
    )
    rate, variance = kriging.predict([(x_m, y_m)])
    return Expectation(float(rate[0]), float(variance[0])) if rate[0] > 0 else None


def nearest(samples: Samples, x_m: float, y_m: float) -> NDArray[np.intp]:
    """Indices of the nearest samples, in their order."""
    if len(samples) <= NEAR:
        return np.arange(len(samples))
    distance = (samples.xy[:, 0] - x_m) ** 2 + (samples.xy[:, 1] - y_m) ** 2
    return np.sort(np.argpartition(distance, NEAR)[:NEAR])


@dataclass(frozen=True)
class Held:
    """A record that is held back."""

    record: CountRecord  # the record
    deviation: float  # as :meth:`Expectation.deviation`
    where: Where

    @property
    def xy(self) -> Array:
        """Place of the record, shape (2,) [m]."""
        return np.array([self.record.x_m, self.record.y_m])


@dataclass(frozen=True)
class CountVerdict:
    """Verdict on a record, and on the records held back before it."""

    unexpected: str = ""  # what is wrong with the record, empty if it can be used
    confirmed: tuple[Held, ...] = ()  # earlier records that this one confirms: they can be used


class ExpectedCounts:
    """Judges records one by one. The verdicts depend on nothing but the records."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._held: list[Held] = []
        self._row: list[Held] = []  # records in a row that rain may have lowered

    def judge(
        self, record: CountRecord, where: Where, samples: Samples, fit: Callable[[], Variogram | None]
    ) -> CountVerdict:
        """Judge a record before it becomes part of the map; ``fit`` is called only if it is uncommon."""
        row, self._row = self._row, []
        if len(samples) < MIN_SAMPLES or not (self._held or stands_out(record, samples)):
            return CountVerdict()
        variogram = fit()
        if variogram is None:
            return CountVerdict()
        place = np.array([record.x_m, record.y_m])
        here = [bool(self._same_place(held.xy - place, variogram)) for held in self._held]
        waiting = [held for held, is_here in zip(self._held, here, strict=True) if is_here]
        known = self._same_place(samples.xy - place, variogram).any()
        if not known or not (waiting or stands_out(record, samples)):
            return CountVerdict()
        expected = expectation(samples, variogram, record.x_m, record.y_m)
        if expected is None:
            return CountVerdict()
        deviation = expected.deviation(record)
        confirmed = tuple(held for held in waiting if deviation / held.deviation > CONFIRMED)
        self._held = [held for held in self._held if held not in waiting]
        if confirmed or not expected.is_far(record):
            return CountVerdict(confirmed=confirmed)
        held_back = Held(record, deviation, where)
        if MIN_RAIN <= record.corrected_rate / expected.rate_cps < 1:
            self._row = [*row, held_back]
            if len(self._row) >= RAIN_ROW:
                confirmed = tuple(held for held in row if any(held is other for other in self._held))
                self._held = [held for held in self._held if not any(held is other for other in row)]
                return CountVerdict(confirmed=confirmed)
        self._held = [*self._held, held_back][-MAX_HELD:]
        return CountVerdict(expected.text(record))

    def _same_place(self, offset_m: Array, variogram: Variogram) -> NDArray[np.bool_]:
        """True if places with these offsets from each other, shape (..., 2) [m], are the same."""
        alike = variogram.correlation_of_square((variogram.scaled(offset_m) ** 2).sum(axis=-1)) >= SAME_PLACE
        return np.asarray(alike | (np.hypot(offset_m[..., 0], offset_m[..., 1]) <= self._radius_m))
