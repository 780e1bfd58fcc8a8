# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several detector tubes as one sensor, and which of them are bad.

**One sensor.** The sensor counts with the rate ``r`` and tube ``i`` with ``s_i r``; the *shares* ``s_i`` add up to
  1. Raw counts ``sum N_i`` and exposure ``sum s_i t_i`` with the live times ``t_i``, both over the tubes present,
  make ``raw / exposure`` an unbiased estimate of the rate of *all* tubes, and the raw counts remain Poisson.

**Bad tubes.** Given the total of a record, the counts of one tube are binomial, whatever the soil and the air do.
  Three tests follow, each with a stated rate of false alarms:

* In each record the binomial tails of all tubes, with Holm's correction (Holm 1979, Scandinavian Journal of
  Statistics 6:65-70). Shares may be wrong by their uncertainty (Berger & Boos 1994, Journal of the American
  Statistical Association 89:1012-1016) and by :data:`TOLERANCE`.
* Cumulative sums of likelihood ratios (Page 1954, Biometrika 41:100-115): a tube that counts nothing, half or
  twice its share. They find in many small counts what no single record shows.
* Runs of one number. No Poisson distribution gives a number ``v`` more often than that of mean ``v``, so the
  probability of a run has an upper bound that needs neither rate nor share.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ITERATIONS = 100
REMEMBERED_RECORDS = 1000  # maximum number of records for estimating the shares during a survey
EQUAL_COUNTS = 100.0  # weight of the prior of equal shares, as counts of each tube: 10 % before the first record
ALARMS_PER_DAY: Final = 0.1  # highest number of false alarms of one kind of check in a day of good records
MAX_PER_RECORD: Final = 1e-3
"""Highest probability of a false alarm of one kind of check in a record, for records of hours."""
PRIOR_COUNTS = 10.0
"""Weight of equal shares, as counts of each tube: tubes of one sensor may differ by a factor of two."""
LEARNED_COUNTS = 300.0  # weight of shares that are known from the whole log, as counts of each tube
MEMORY_RECORDS = 1000.0
"""Number of records after which earlier counts have lost two thirds of their weight: tubes age."""
FACTORS = (0.0, 0.5, 2.0)  # shares of a bad tube that the cumulative sums look for, as multiples of its good share
MIN_LEARNED_COUNTS = 300.0
"""Counts behind a share from which half and twice the share differ clearly from an unknown share."""
RECOVERY = math.log(1000.0)  # logarithm of the likelihood ratio from which a masked tube counts again
TOLERANCE = 1.2
"""Factor by which the odds of a tube may change without a fault: temperature, age, small differences in energy."""
MAX_CHANGE = math.log(3.0)  # highest change of the rate between neighbouring records, as a logarithm
LAST_RATES = 31  # number of last good records whose median rate decides which of two tubes is bad
LAST_COUNTED = 300  # number of last records of a sensor with two tubes that decide which of them has changed


def tube_shares(records: Sequence[LoggerRecord]) -> NDArray[np.float64]:
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
    return _maximum_likelihood(counts, live)


def _maximum_likelihood(counts: NDArray[np.float64], live: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the rates from the shares and the shares from the rates, alternately."""
    of_records, of_tubes = counts.sum(axis=1), counts.sum(axis=0)
    shares = np.where(of_tubes > 0, 1.0, 0.0) / np.count_nonzero(of_tubes)
    for _ in range(ITERATIONS):
        exposure = live @ shares
        rates = np.divide(of_records, exposure, out=np.zeros_like(exposure), where=exposure > 0)
        seen = rates @ live
        new = np.divide(of_tubes, seen, out=np.zeros_like(seen), where=seen > 0)
        new /= new.sum()
        if np.abs(new - shares).max() < 1e-10:
            return np.asarray(new)
        shares = new
    return np.asarray(shares)


def combine_tubes(record: LoggerRecord, shares: Sequence[float] | NDArray[np.float64]) -> tuple[int, float]:
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


class RunningShares:
    """Shares of the tubes in the rate of the whole sensor, estimated from the records so far [-].

    They matter only for a record with a missing tube: its exposure covers the present tubes.
    """

    def __init__(self) -> None:
        self._records: deque[LoggerRecord] = deque(maxlen=REMEMBERED_RECORDS)
        self._shares: NDArray[np.float64] = np.empty(0)

    def update(self, record: LoggerRecord, unused: Collection[int] = ()) -> NDArray[np.float64]:
        """Add a record, and return the shares for this record, shape (tubes,)."""
        tubes = len(record.tube_counts)
        if tubes != len(self._shares):
            self._records.clear()
            self._shares = self._estimate(tubes, unused)
        self._records.append(record)
        used = [live_s for tube, live_s in enumerate(record.tube_live_s) if tube not in unused]
        if len(set(used)) > 1 or any(math.isnan(live_s) for live_s in used):
            self._shares = self._estimate(tubes, unused)
        return self._shares

    def mask(self, tube: int, since_s: float) -> None:
        """Leave out what a bad tube has counted."""
        for index, record in enumerate(self._records):
            if record.stamp_s >= since_s:
                counts = tuple(NAN if each == tube else count for each, count in enumerate(record.tube_counts))
                self._records[index] = replace(record, tube_counts=counts)

    def _estimate(self, tubes: int, unused: Collection[int]) -> NDArray[np.float64]:
        used = [tube not in unused for tube in range(tubes)]
        alike = LoggerRecord(
            NAN,
            tuple(EQUAL_COUNTS if tube else NAN for tube in used),
            tuple(1.0 if tube else NAN for tube in used),
        )
        return tube_shares([alike, *self._records])


def alarm_probability(period_s: float) -> float:
    """Probability of a false alarm that one kind of check may have in a good record [-]."""
    return min(ALARMS_PER_DAY * period_s / DAY_S, MAX_PER_RECORD)


def alarm_threshold(period_s: float, charts: int) -> float:
    """Threshold of cumulative sums of log-likelihood ratios.

    The mean time between false alarms of a chart is at least ``exp(threshold)`` records (Lorden 1971, Annals of
    Mathematical Statistics 42:1897-1908, theorem 2).
    """
    return math.log(charts / alarm_probability(period_s))


class GoodShares:
    """Shares of the tubes, learned record by record; the start weighs as some counts of each tube."""

    def __init__(self, start: Array, prior_counts: float) -> None:
        self._start, self._prior_counts = start, prior_counts
        self._seen, self._expected = np.zeros(len(start)), np.zeros(len(start))
        self.shares = start

    @property
    def counts(self) -> Array:
        """Counts behind the share of each tube, shape (tubes,)."""
        return self._seen + self._prior_counts

    def learn(self, counts: Array, live_s: Array, good: Mask) -> None:
        """Add the good counts of a record; one step of expectation and maximisation."""
        weights = self.shares * live_s
        rate_cps = counts[good].sum() / weights[good].sum()
        keep = 1 - 1 / MEMORY_RECORDS
        self._seen *= keep
        self._expected *= keep
        self._seen[good] += counts[good]
        self._expected[good] += rate_cps * live_s[good]
        known = self._start > 0
        new = np.zeros(len(self._start))
        before = self._prior_counts / self._start[known]
        new[known] = (self._prior_counts + self._seen[known]) / (before + self._expected[known])
        self.shares = new / new.sum()


class ShareCharts:
    """Cumulative sums for the tubes of one sensor: one for each tube and each share of :data:`FACTORS`."""

    def __init__(self, tubes: int) -> None:
        self.sums = np.zeros((len(FACTORS), tubes))
        self._begin_s = np.zeros((len(FACTORS), tubes))
        self._recovery = np.zeros(tubes)
        self._recovered_s = np.zeros(tubes)

    def add(self, stamp_s: float, ratios: Array, good: Mask) -> None:
        """Continue with a record."""
        self._begin_s[self.sums <= 0] = stamp_s
        self.sums = np.maximum(self.sums + np.where(good, ratios, 0.0), 0.0)

    def worst(self) -> tuple[int, bool, float]:
        """Tube with the highest sum, whether it counts too much, and since when [s since 1970 UTC]."""
        row, tube = (int(index) for index in np.unravel_index(self.sums.argmax(), self.sums.shape))
        return tube, FACTORS[row] > 1, float(self._begin_s[row, tube])

    def recovered_s(self, stamp_s: float, tube: int, ratios: Array, too_many: bool) -> float | None:
        """Time from which a masked tube is good again [s since 1970 UTC], ``None`` if it is not."""
        if self._recovery[tube] <= 0:
            self._recovered_s[tube] = stamp_s
        against = ratios[FACTORS.index(2.0 if too_many else 0.5), tube]
        self._recovery[tube] = max(self._recovery[tube] - against, 0.0)
        return float(self._recovered_s[tube]) if self._recovery[tube] > RECOVERY else None

    def clear(self, tube: int) -> None:
        """Start again after a tube was masked or has recovered: its counts were part of every total."""
        self.sums[:] = 0.0
        self._recovery[tube] = 0.0


def share_ratios(counts: Array, weights: Array, use: Mask, good: Mask, behind: Array) -> Array:
    """Log-likelihood ratios of bad shares against the good share, shape (factors, tubes).

    The counts of a tube are binomial given the total of the good tubes and the tube itself. Only tubes in ``use``
    are compared; ``behind`` are the counts from which each share is known.
    """
    number, weight = np.where(good, 0.0, counts), np.where(good, 0.0, weights)
    total, whole = counts[good].sum() + number, weights[good].sum() + weight
    compared = use & (weights < whole * (1 - 1e-9))  # with another tube
    share = np.where(compared, weights / np.where(compared, whole, 1.0), 0.0)
    learned = compared & ((behind >= MIN_LEARNED_COUNTS) | ~good)  # masked tubes must be able to return
    ratios = np.empty((len(FACTORS), len(counts)))
    for row, factor in enumerate(FACTORS):
        against = total * np.log1p(share * (factor - 1))
        if factor == 0:
            ratios[row] = np.where(counts > 0, -math.inf, np.where(compared, -against, 0.0))
        else:
            ratios[row] = np.where(learned, counts * math.log(factor) - against, 0.0)
    return ratios


@dataclass
class Run:
    """Number of times that a tube has repeated a number."""

    value: float = math.nan
    begin_s: float = math.nan
    surprise: float = 0.0
    step: int = 0

    def add(self, value: float, stamp_s: float) -> None:
        """Continue with the next count; ``surprise`` is minus the logarithm of the run's highest probability."""
        if value == self.value:
            likeliest = value * math.log(value) - value - math.lgamma(value + 1) if value > 0 else 0.0
            self.surprise += max(-likeliest - math.log(max(self.step, 1)), 0.0)
            return
        if not math.isnan(self.value):  # counts of some loggers are multiples of a number
            self.step = math.gcd(self.step, round(abs(value - self.value)))
        self.value, self.begin_s, self.surprise = value, stamp_s, 0.0


@dataclass(frozen=True)
class BadTube:
    """A tube, by its index, that must not be used in a record; its expected counts are NaN if unknown."""

    tube: int
    kind: Kind
    counts: float
    expected: float


@dataclass(frozen=True)
class BadSpan:
    """A period in which a tube is masked, from the first bad record to the last [s since 1970 UTC]."""

    tube: int
    kind: Kind
    begin_s: float
    end_s: float = math.inf


class TubeChecks:
    """Compares the tubes of one probe, record by record.

    :param shares: shares known from the whole log, shape (tubes,); equal to begin with if ``None``
    :param rate_cps: typical rate of the whole sensor [counts/s], NaN if unknown
    :param spans: bad periods known from the whole log
    """

    def __init__(
        self, tubes: int, shares: Array | None = None, rate_cps: float = math.nan, spans: Sequence[BadSpan] = ()
    ) -> None:
        self.tubes = tubes
        self.spans: list[BadSpan] = []
        """Bad periods that the cumulative sums and runs have found."""
        self._known = tuple(spans)
        start = np.full(tubes, 1 / tubes) if shares is None else shares
        self._good = GoodShares(start, PRIOR_COUNTS if shares is None else LEARNED_COUNTS)
        self._charts = ShareCharts(tubes)
        self._masked: dict[int, Kind] = {}
        self._rates: deque[float] = deque([] if math.isnan(rate_cps) else [rate_cps], maxlen=LAST_RATES)
        self._runs = [Run() for _ in range(tubes)]
        self._counted: deque[tuple[float, Array, Array]] = deque(maxlen=LAST_COUNTED)

    @property
    def shares(self) -> Array:
        """Share of each tube in the rate of the whole sensor, shape (tubes,)."""
        return self._good.shares

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
        bad = self._known_bad(record.stamp_s) | self._masked
        bad |= self._repeating(record, counts, use, period_s)
        trusted = use.copy()
        trusted[list(bad)] = False
        good, found = self._consistent(counts, live_s, trusted, alarm_probability(period_s))
        bad |= found
        if good.any():
            good = self._follow(record.stamp_s, counts, live_s, use, good, period_s)
            bad |= self._masked
        if good.any():
            self._good.learn(counts, live_s, good)
            self._rates.append(counts[good].sum() / (self.shares * live_s)[good].sum())
        rate_cps = self._rates[-1] if good.any() else math.nan
        expected = rate_cps * self.shares * live_s
        return [
            BadTube(tube, kind, counts[tube], float(expected[tube]))
            for tube, kind in sorted(bad.items())
            if use[tube]
        ]

    def _known_bad(self, stamp_s: float) -> dict[int, Kind]:
        return {span.tube: span.kind for span in self._known if span.begin_s <= stamp_s <= span.end_s}

    def _repeating(self, record: LoggerRecord, counts: Array, use: Mask, period_s: float) -> dict[int, Kind]:
        limit = alarm_threshold(period_s, int(use.sum()))
        bad = {}
        for tube in np.flatnonzero(use):
            run = self._runs[tube]
            was_stuck = run.surprise > limit
            run.add(float(counts[tube]), record.stamp_s)
            if run.surprise > limit:
                bad[int(tube)] = Kind.STUCK_TUBE
                if not was_stuck:
                    self.spans.append(BadSpan(int(tube), Kind.STUCK_TUBE, run.begin_s))
            elif was_stuck:
                self._close(int(tube), Kind.STUCK_TUBE, record.stamp_s)
        return bad

    def _close(self, tube: int, kind: Kind, stamp_s: float) -> None:
        """End the open period of a tube before a record."""
        self.spans = [
            replace(span, end_s=np.nextafter(stamp_s, -math.inf))
            if (span.tube, span.kind, span.end_s) == (tube, kind, math.inf)
            else span
            for span in self.spans
        ]

    def _consistent(self, counts: Array, live_s: Array, use: Mask, level: float) -> tuple[Mask, dict[int, Kind]]:
        """The tubes that agree, and the others with the reason."""
        weights = self.shares * live_s
        tubes = np.flatnonzero(use)
        if len(tubes) < 2 or _smallest(self._p_values(counts, weights, tubes, level)) > level:
            return use, {}
        groups = {tuple(self._agreeing(counts, weights, tubes, int(anchor), level)) for anchor in tubes}
        scores = sorted(((self._score(counts, weights, tubes, group), group) for group in groups), reverse=True)
        good = np.zeros(self.tubes, bool)
        if len(scores) > 1 and scores[0][0] - scores[1][0] < 1e-3:  # nobody can say which tubes are good
            return good, dict.fromkeys(map(int, tubes), Kind.NOISY_TUBE)
        good[list(scores[0][1])] = True
        rate_cps = counts[good].sum() / weights[good].sum()
        return good, {int(tube): _kind(counts[tube], rate_cps * weights[tube]) for tube in tubes if not good[tube]}

    def _agreeing(
        self, counts: Array, weights: Array, tubes: NDArray[np.intp], anchor: int, level: float
    ) -> list[int]:
        """Tubes that agree with the anchor and, together, with each other."""
        group = [
            int(tube)
            for tube in tubes
            if tube == anchor
            or _smallest(self._p_values(counts, weights, np.array([anchor, tube]), level / len(tubes)))
            > level / len(tubes)
        ]
        while len(group) > 2:
            p_values = self._p_values(counts, weights, np.array(group), level)
            if _smallest(p_values) > level:
                break
            candidates = [p if tube != anchor else 1.0 for p, tube in zip(p_values, group, strict=True)]
            del group[int(np.argmin(candidates))]
        return group

    def _score(self, counts: Array, weights: Array, tubes: NDArray[np.intp], group: Sequence[int]) -> float:
        """Credibility of a group of tubes as the good one: many tubes, and a rate as before."""
        chosen = list(group)
        size = float(weights[chosen].sum() / weights[tubes].sum())
        if not self._rates:
            return size
        ratio = max(counts[chosen].sum(), 0.5) / weights[chosen].sum() / max(self.rate_cps, 1e-9)
        return size - min(abs(math.log(ratio)) / MAX_CHANGE, 1.0)

    def _p_values(self, counts: Array, weights: Array, tubes: NDArray[np.intp], level: float) -> Array:
        """Two-sided binomial p-values of some tubes given their total."""
        from scipy.special import betainc, ndtri  # slow to import, and not needed by all who import this

        total, share = counts[tubes].sum(), weights[tubes] / weights[tubes].sum()
        behind = self._good.counts[tubes]
        sd = np.sqrt(1 / behind + 1 / (behind.sum() - behind))
        unsure = level / (20 * len(tubes))  # probability that a share is outside of its limits
        margin = TOLERANCE * np.exp(-ndtri(unsure) * sd)
        odds = share / (1 - share)
        high, low = odds * margin, odds / margin
        number = counts[tubes]
        above = np.where(number > 0, betainc(np.maximum(number, 1), total - number + 1, high / (1 + high)), 1.0)
        rest = np.maximum(total - number, 1)
        below = np.where(number < total, betainc(rest, number + 1, 1 / (1 + low)), 1.0)
        return np.asarray(np.minimum(2 * np.minimum(above, below) + 2 * unsure, 1.0))

    def _follow(
        self, stamp_s: float, counts: Array, live_s: Array, use: Mask, good: Mask, period_s: float
    ) -> Mask:
        """Continue the cumulative sums; mask tubes that have left their share, and unmask those that are back."""
        good = good.copy()
        weights = self.shares * live_s
        if self.tubes == 2:
            self._counted.append((stamp_s, counts, weights))
        charts, limit = self._charts, alarm_threshold(period_s, len(FACTORS) * self.tubes)
        ratios = share_ratios(counts, weights, use, good, self._good.counts)
        charts.add(stamp_s, ratios, good)
        for tube, kind in [(tube, kind) for tube, kind in self._masked.items() if use[tube]]:
            recovered_s = charts.recovered_s(stamp_s, tube, ratios, kind is Kind.NOISY_TUBE)
            if recovered_s is not None:
                self._close(tube, self._masked.pop(tube), recovered_s)
                charts.clear(tube)
        while good.sum() > 1 and (charts.sums > limit).any():
            tube, too_many, begin_s = charts.worst()
            if good.sum() == 2 and not self._is_guilty(tube, good, begin_s):
                tube, too_many = next(int(each) for each in np.flatnonzero(good) if each != tube), not too_many
            self._mask(tube, Kind.NOISY_TUBE if too_many else Kind.DEAD_TUBE, begin_s)
            good[tube] = False
        return good

    def _mask(self, tube: int, kind: Kind, begin_s: float) -> None:
        self._masked[tube] = kind
        self.spans.append(BadSpan(tube, kind, begin_s))
        self._charts.clear(tube)

    def _is_guilty(self, tube: int, good: Mask, begin_s: float) -> bool:
        """True if a tube of two, rather than the other one, counts otherwise than before."""
        before = [counted for stamp_s, *counted in self._counted if stamp_s < begin_s]
        after = [counted for stamp_s, *counted in self._counted if stamp_s >= begin_s]
        if not before or not after:
            return True
        rates = [np.maximum(sum(c for c, _ in part), 0.5) / sum(w for _, w in part) for part in (before, after)]
        changes = np.abs(np.log(rates[1] / rates[0]))
        return bool(changes[tube] >= changes[good].max())


def _smallest(p_values: Array) -> float:
    """Holm's adjusted p-value of the most extreme tube."""
    return float(len(p_values) * p_values.min())


def _kind(counts: float, expected: float) -> Kind:
    return Kind.NOISY_TUBE if counts > expected else Kind.DEAD_TUBE
