# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several detector tubes as one sensor, and which of them are bad.

**One sensor.** The sensor counts with the rate ``r`` and tube ``i`` with ``s_i r``; the *shares* ``s_i`` add up to
  1. Raw counts ``sum N_i`` and exposure ``sum s_i t_i`` with the live times ``t_i``, both over the tubes present,
  make ``raw / exposure`` an unbiased estimate of the rate of *all* tubes, and the raw counts remain Poisson.

**Bad tubes.** Given the total of a record, the counts of one tube are binomial, whatever the soil and the air do.
  Two tests follow, each with a stated rate of false alarms:

* In each record the binomial tails of all tubes, with Holm's correction (Holm 1979, Scandinavian Journal of
  Statistics 6:65-70). Shares may be wrong by their uncertainty (Berger & Boos 1994, Journal of the American
  Statistical Association 89:1012-1016) and by :data:`TOLERANCE`.
* Cumulative sums of likelihood ratios (Page 1954, Biometrika 41:100-115): a tube that counts nothing, half or
  twice its share. They find in many small counts what no single record shows.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.sensing.checks.tails import binomial_tails
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Tubes = NDArray[np.intp]

ITERATIONS = 100
ALARMS_PER_DAY: Final = 0.1  # highest number of false alarms of one kind of check in a day of good records
MAX_PER_RECORD: Final = 1e-3
"""Highest probability of a false alarm of one kind of check in a record, for records of hours."""
PRIOR_COUNTS = 10.0
"""Weight of equal shares, as counts of each tube: tubes of one sensor may differ by a factor of two."""
LEARNED_COUNTS = 300.0  # weight of shares that are known from the whole log, as counts of each tube
MEMORY_RECORDS = 1000.0
"""Number of records after which earlier counts have lost two thirds of their weight: tubes age."""
_KEEP = 1 - 1 / MEMORY_RECORDS
FACTORS = (0.0, 0.5, 2.0)  # shares of a bad tube that the cumulative sums look for, as multiples of its good share
MIN_LEARNED_COUNTS = 300.0
"""Counts behind a share from which half and twice the share differ clearly from an unknown share."""
RECOVERY = math.log(1000.0)  # logarithm of the likelihood ratio from which a masked tube counts again
TOLERANCE = 1.2
"""Factor by which the odds of a tube may change without a fault: temperature, age, small differences in energy."""
LAST_RATES = 31  # number of last good records whose median rate decides which of two tubes is bad
LAST_COUNTED = 300  # number of last records that show since when a tube is bad, and which of two


def tube_shares(records: Sequence[LoggerRecord]) -> Array:
    """Share of each tube in the rate of the whole sensor, estimated from records of the sensor [-].

    The maximum-likelihood estimate has one rate per record: neither changing soil nor tubes missing in some
    records bias the shares. A tube that never counts has the share 0.

    :raises ValueError: if there are no records, their numbers of tubes differ, or nothing was counted
    """
    if not records:
        raise ValueError("there are no records to estimate the tubes' shares from")
    if len({len(record.tube_counts) for record in records}) != 1:
        raise ValueError("the records have different numbers of tubes")
    counts = np.array([record.tube_counts for record in records], float)
    live = np.array([record.tube_live_s for record in records], float)
    present = np.isfinite(counts) & np.isfinite(live) & (live > 0)
    counts, live = np.where(present, counts, 0.0), np.where(present, live, 0.0)
    if not counts.sum() > 0:
        raise ValueError("nothing was counted")
    of_records, of_tubes = counts.sum(axis=1), counts.sum(axis=0)
    shares = np.where(of_tubes > 0, 1.0, 0.0) / np.count_nonzero(of_tubes)
    for _ in range(ITERATIONS):  # the rates from the shares and the shares from the rates, alternately
        exposure = live @ shares
        rates = np.divide(of_records, exposure, out=np.zeros_like(exposure), where=exposure > 0)
        seen = rates @ live
        new = np.divide(of_tubes, seen, out=np.zeros_like(seen), where=seen > 0)
        before, shares = shares, np.asarray(new / new.sum())
        if np.abs(shares - before).max() < 1e-10:
            break
    return shares


def combine_tubes(record: LoggerRecord, shares: Sequence[float] | Array) -> tuple[int, float]:
    """Raw counts and exposure [s] of a record; its counts and live times are NaN where a tube is missing.

    :param shares: share of each tube in the whole rate [-], adding up to 1
    :raises ValueError: if there is not one share per tube, or no tube with a share counted
    """
    if len(shares) != len(record.tube_counts):
        raise ValueError(f"there are {len(shares)} shares for {len(record.tube_counts)} tubes")
    used = [
        (count, live_s, float(share))
        for count, live_s, share in zip(record.tube_counts, record.tube_live_s, shares, strict=True)
        if share > 0 and math.isfinite(count) and math.isfinite(live_s) and live_s > 0
    ]
    if not used:
        raise ValueError("no tube of the record is usable")
    raw_counts = int(sum(count for count, _, _ in used))
    live_times = {live_s for _, live_s, _ in used}
    if len(live_times) == 1 and len(used) == sum(share > 0 for share in shares):
        return raw_counts, live_times.pop()  # exact, where the sum of the shares would round
    return raw_counts, math.fsum(share * live_s for _, live_s, share in used)


def alarm_probability(period_s: float) -> float:
    """Probability of a false alarm that one kind of check may have in a good record [-]."""
    return min(ALARMS_PER_DAY * period_s / DAY_S, MAX_PER_RECORD)


def alarm_threshold(period_s: float, charts: int) -> float:
    """Threshold of cumulative sums of log-likelihood ratios.

    The mean time between false alarms of a chart is at least ``exp(threshold)`` records (Lorden 1971, Annals of
    Mathematical Statistics 42:1897-1908, theorem 2).
    """
    return math.log(charts / alarm_probability(period_s))


class BadTube(NamedTuple):
    """A tube, by its index, that must not be used in a record; its expected counts are NaN if unknown."""

    tube: int
    kind: Kind
    counts: float
    expected: float


@dataclass
class BadSpan:
    """A period in which a tube is masked, from the first bad record to the last [s since 1970 UTC]."""

    tube: int
    kind: Kind
    begin_s: float
    end_s: float = math.inf


class TubeChecks:
    """Compares the tubes of one probe, record by record, and learns their shares from good counts.

    :param learned: shares known from the whole log, shape (tubes,); equal ones to begin with if ``None``
    :param unused: indices of the tubes that the format leaves out
    :param rate_cps: typical rate of the whole sensor [counts/s], NaN if unknown
    :param spans: bad periods known from the whole log
    """

    def __init__(
        self,
        tubes: int,
        learned: Array | None = None,
        unused: Collection[int] = (),
        rate_cps: float = math.nan,
        spans: Sequence[BadSpan] = (),
    ) -> None:
        self.tubes = tubes
        self.spans: list[BadSpan] = []
        """Bad periods that the cumulative sums have found."""
        self._known = tuple(spans)
        self._masked: dict[int, Kind] = {}
        self._rates: deque[float] = deque([] if math.isnan(rate_cps) else [rate_cps], maxlen=LAST_RATES)
        self._counted: deque[tuple[float, Array, Array]] = deque(maxlen=LAST_COUNTED)
        counting = np.array([tube not in unused for tube in range(tubes)], float)
        self.shares = counting / max(counting.sum(), 1.0) if learned is None else learned
        """Share of each tube in the rate of the whole sensor, shape (tubes,)."""
        self._prior_counts = PRIOR_COUNTS if learned is None else LEARNED_COUNTS
        self._start, self._seen, self._expected = self.shares, np.zeros(tubes), np.zeros(tubes)
        self._sums, self._begin_s = np.zeros((len(FACTORS), tubes)), np.zeros((len(FACTORS), tubes))
        self._recovery, self._recovered_s = np.zeros(tubes), np.zeros(tubes)

    @property
    def rate_cps(self) -> float:
        """Median rate of the last good records [counts/s], NaN before the first."""
        return float(np.median(self._rates)) if self._rates else math.nan

    def check(self, record: LoggerRecord, use: Mask) -> list[BadTube]:
        """Bad tubes of the next record; all tubes if nobody can say which are good."""
        counts, live_s = np.array(record.tube_counts, float), np.array(record.tube_live_s, float)
        use = use & np.isfinite(counts) & (live_s > 0) & (self.shares > 0)
        if not use.any():
            return []
        period_s = float(live_s[use].max())
        counts, live_s = np.where(use, counts, 0.0), np.where(use, live_s, 0.0)
        bad = {span.tube: span.kind for span in self._known if span.begin_s <= record.stamp_s <= span.end_s}
        bad |= self._masked
        good = use.copy()
        good[list(bad)] = False
        found = self._inconsistent(counts, live_s, good, alarm_probability(period_s))
        bad |= found
        good[list(found)] = False
        if good.any():
            good = self._follow(record.stamp_s, counts, live_s, use, good, period_s)
            bad |= self._masked
        rate_cps = math.nan
        if good.any():
            if good.sum() > 1:  # shares are known from tubes compared with each other
                self._learn(np.where(good, counts, 0.0), np.where(good, live_s, 0.0))
            rate_cps = counts[good].sum() / (self.shares * live_s)[good].sum()
            self._rates.append(rate_cps)
        expected = rate_cps * self.shares * live_s
        return [
            BadTube(tube, kind, counts[tube], float(expected[tube]))
            for tube, kind in sorted(bad.items())
            if use[tube]
        ]

    def _learn(self, counts: Array, live_s: Array) -> None:
        """Add the good counts of a record to the shares; one step of expectation and maximisation."""
        expected = counts.sum() / (self.shares * live_s).sum() * live_s
        self._seen = _KEEP * self._seen + counts
        self._expected = _KEEP * self._expected + expected
        known = self._start > 0
        new = np.zeros(self.tubes)
        before = self._prior_counts / self._start[known]
        new[known] = (self._prior_counts + self._seen[known]) / (before + self._expected[known])
        self.shares = new / new.sum()

    # Tube against tube in one record -------------------------------------------------------------------------

    def _inconsistent(self, counts: Array, live_s: Array, use: Mask, level: float) -> dict[int, Kind]:
        """Tubes that do not agree with the others; all if nobody can say which are good.

        The tube farthest from the median rate is left out until the rest agree; of two, the one farther from the
        rate of the records before.
        """
        weights = self.shares * live_s
        tubes, found = np.flatnonzero(use), dict[int, Kind]()
        while len(tubes) > 1 and len(tubes) * self._p_values(counts, weights, tubes, level).min() <= level:
            usual = float(np.median(counts[tubes] / weights[tubes])) if len(tubes) > 2 else self.rate_cps
            if math.isnan(usual):
                return dict.fromkeys(np.flatnonzero(use).tolist(), Kind.NOISY_TUBE)
            mean = usual * weights[tubes]
            away = (counts[tubes] - mean) / np.sqrt(np.maximum(mean, 1.0))
            worst = int(np.abs(away).argmax())
            found[int(tubes[worst])] = Kind.NOISY_TUBE if away[worst] > 0 else Kind.DEAD_TUBE
            tubes = np.delete(tubes, worst)
        return found

    def _p_values(self, counts: Array, weights: Array, tubes: Tubes, level: float) -> Array:
        """Two-sided binomial p-values of some tubes given their total."""
        total, share = counts[tubes].sum(), weights[tubes] / weights[tubes].sum()
        behind = self._seen[tubes] + self._prior_counts
        sd = np.sqrt(1 / behind + 1 / (behind.sum() - behind))
        unsure = level / (20 * len(tubes))  # probability that a share is outside of its limits
        margin = TOLERANCE * np.exp(-NormalDist().inv_cdf(unsure) * sd)
        odds = share / (1 - share)
        high, low = odds * margin, odds / margin
        numbers = [int(one) for one in counts[tubes]]
        above = [binomial_tails(one, int(total), p)[1] for one, p in zip(numbers, high / (1 + high), strict=True)]
        below = [binomial_tails(one, int(total), p)[0] for one, p in zip(numbers, low / (1 + low), strict=True)]
        return np.asarray(np.minimum(2 * np.minimum(above, below) + 2 * unsure, 1.0))

    # Cumulative sums -----------------------------------------------------------------------------------------

    def _follow(
        self, stamp_s: float, counts: Array, live_s: Array, use: Mask, good: Mask, period_s: float
    ) -> Mask:
        """Continue the cumulative sums; mask tubes that have left their share, and unmask those that are back."""
        good = good.copy()
        weights = self.shares * live_s
        if self.tubes == 2:
            self._counted.append((stamp_s, counts, weights))
        limit = alarm_threshold(period_s, len(FACTORS) * self.tubes)
        ratios = self._ratios(counts, weights, use, good)
        self._begin_s[self._sums <= 0] = stamp_s
        self._sums = np.maximum(self._sums + np.where(good, ratios, 0.0), 0.0)
        for tube, kind in [(tube, kind) for tube, kind in self._masked.items() if use[tube]]:
            if self._recovery[tube] <= 0:
                self._recovered_s[tube] = stamp_s
            against = ratios[FACTORS.index(2.0 if kind is Kind.NOISY_TUBE else 0.5), tube]
            self._recovery[tube] = max(self._recovery[tube] - against, 0.0)
            if self._recovery[tube] > RECOVERY:
                del self._masked[tube]
                last = next(span for span in reversed(self.spans) if span.tube == tube)
                last.end_s = float(np.nextafter(self._recovered_s[tube], -math.inf))  # before that record
                self._restart(tube)
        while good.sum() > 1 and (self._sums > limit).any():
            row, tube = (int(index) for index in np.unravel_index(self._sums.argmax(), self._sums.shape))
            too_many, begin_s = FACTORS[row] > 1, float(self._begin_s[row, tube])
            if good.sum() == 2 and not self._is_guilty(tube, good, begin_s):
                tube, too_many = next(each for each in np.flatnonzero(good).tolist() if each != tube), not too_many
            kind = Kind.NOISY_TUBE if too_many else Kind.DEAD_TUBE
            self._masked[tube] = kind
            self.spans.append(BadSpan(tube, kind, begin_s))
            self._restart(tube)
            good[tube] = False
        return good

    def _ratios(self, counts: Array, weights: Array, use: Mask, good: Mask) -> Array:
        """Log-likelihood ratios of bad shares against the good share, shape (factors, tubes).

        The counts of a tube are binomial given the total of the good tubes and the tube itself.
        """
        number, weight = np.where(good, 0.0, counts), np.where(good, 0.0, weights)
        total, whole = counts[good].sum() + number, weights[good].sum() + weight
        compared = use & (weights < whole * (1 - 1e-9))  # with another tube
        share = np.where(compared, weights / np.where(compared, whole, 1.0), 0.0)
        behind = self._seen + self._prior_counts
        learned = compared & ((behind >= MIN_LEARNED_COUNTS) | ~good)  # masked tubes must be able to return
        ratios = np.empty((len(FACTORS), len(counts)))
        for row, factor in enumerate(FACTORS):
            against = total * np.log1p(share * (factor - 1))
            if factor == 0:
                ratios[row] = np.where(counts > 0, -math.inf, np.where(compared, -against, 0.0))
            else:
                ratios[row] = np.where(learned, counts * math.log(factor) - against, 0.0)
        return ratios

    def _restart(self, tube: int) -> None:
        """Begin the sums again after a tube was masked or has recovered: its counts were part of every total."""
        self._sums[:] = 0.0
        self._recovery[tube] = 0.0

    def _is_guilty(self, tube: int, good: Mask, begin_s: float) -> bool:
        """True if a tube of two, rather than the other one, counts otherwise than before."""
        before = [counted for stamp_s, *counted in self._counted if stamp_s < begin_s]
        after = [counted for stamp_s, *counted in self._counted if stamp_s >= begin_s]
        if not before or not after:
            return True
        rates = [np.maximum(sum(c for c, _ in part), 0.5) / sum(w for _, w in part) for part in (before, after)]
        changes = np.abs(np.log(rates[1] / rates[0]))
        return bool(changes[tube] >= changes[good].max())
