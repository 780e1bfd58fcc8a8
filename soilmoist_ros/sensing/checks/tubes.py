# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tube against tube: all tubes of a sensor see the same neutrons, so each has its share of the counts.

Soil moisture, rain and pressure change the rate of all tubes together. Given the total of a record, the counts of
one tube are binomial, whatever the rate is. Three tests follow, each with a stated rate of false alarms:

* In each record the exact binomial tails of all tubes, with Holm's correction (Holm 1979, Scandinavian Journal of
  Statistics 6:65-70): the probability that a good record loses any tube, and so the false discovery rate, stays
  below :func:`alarm_probability`. Shares may be wrong by their uncertainty (Berger & Boos 1994, Journal of the
  American Statistical Association 89:1012-1016) and by :data:`TOLERANCE`.
* From record to record cumulative sums of likelihood ratios (Page 1954, Biometrika 41:100-115): a tube that counts
  nothing, half or twice its share. They find in many small counts what no single record shows.
* Runs of one number. No Poisson distribution gives a number ``v`` more often than that of mean ``v``, so the
  probability of a run has an upper bound that needs neither rate nor share.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.checks.alarms import alarm_probability, alarm_threshold, least_chance
from soilmoist_ros.sensing.checks.charts import FACTORS, Run, ShareCharts, share_ratios
from soilmoist_ros.sensing.checks.shares import LEARNED_COUNTS, PRIOR_COUNTS, GoodShares
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE = 1.2
"""Factor by which the odds of a tube may change without a fault: temperature, age, small differences in energy."""
MAX_CHANGE = math.log(3.0)
"""Highest change of the rate between neighbouring records, as a logarithm."""
LAST_RATES = 31
"""Number of last good records whose median rate decides which of two tubes is bad."""
LAST_COUNTED = 300
"""Number of last records of a sensor with two tubes that decide which of them has changed."""


@dataclass(frozen=True)
class BadTube:
    """A tube that must not be used in a record.

    :param tube: index of the tube
    :param kind: reason
    :param counts: its counts
    :param expected: counts that the good tubes expect of it, NaN if unknown
    """

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

    :param tubes: number of tubes
    :param shares: shares known from the whole log, shape (tubes,); equal to begin with if ``None``
    :param rate_cps: typical rate of the whole sensor [counts/s], NaN if unknown
    :param spans: bad periods known from the whole log
    """

    def __init__(
        self,
        tubes: int,
        shares: Array | None = None,
        rate_cps: float = math.nan,
        spans: Sequence[BadSpan] = (),
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
        """Bad tubes of the next record; all tubes if nobody can say which are good.

        :param use: tubes that the sensor uses, shape (tubes,)
        """
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
        """The tubes that agree, and the others with the reason.

        :param level: probability of a false alarm
        """
        weights = self.shares * live_s
        tubes = np.flatnonzero(use)
        if len(tubes) < 2 or _clearly_agree(counts[tubes], weights[tubes], level):
            return use, {}
        if _smallest(self._p_values(counts, weights, tubes, level)) > level:
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
        """How credible it is that a group of tubes is the good one: many tubes, and a rate as before."""
        chosen = list(group)
        size = float(weights[chosen].sum() / weights[tubes].sum())
        if not self._rates:
            return size
        ratio = max(counts[chosen].sum(), 0.5) / weights[chosen].sum() / max(self.rate_cps, 1e-9)
        return size - min(abs(math.log(ratio)) / MAX_CHANGE, 1.0)

    def _p_values(self, counts: Array, weights: Array, tubes: NDArray[np.intp], level: float) -> Array:
        """Two-sided binomial p-values of some tubes given their total."""
        from scipy.special import betainc, ndtri  # slow to import, and needed for odd records only

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
        """Continue the cumulative sums; mask tubes that have left their share, and unmask those that are back.

        :returns: the tubes that are still good
        """
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
        """Whether a tube of two, rather than the other one, counts otherwise than before.

        :param begin_s: when one of the two changed [s since 1970 UTC]
        """
        before = [counted for stamp_s, *counted in self._counted if stamp_s < begin_s]
        after = [counted for stamp_s, *counted in self._counted if stamp_s >= begin_s]
        if not before or not after:
            return True
        rates = [np.maximum(sum(c for c, _ in part), 0.5) / sum(w for _, w in part) for part in (before, after)]
        changes = np.abs(np.log(rates[1] / rates[0]))
        return bool(changes[tube] >= changes[good].max())


def _clearly_agree(counts: Array, weights: Array, level: float) -> bool:
    """Whether a lower limit of all p-values is above the level; margins of the shares would only raise it."""
    total, shares = counts.sum(), weights / weights.sum()
    least = min(
        min(least_chance(number, total, share), least_chance(total - number, total, 1 - share))
        for number, share in zip(counts.tolist(), shares.tolist(), strict=True)
    )
    return bool(2 * least * len(counts) > level)


def _smallest(p_values: Array) -> float:
    """Holm's adjusted p-value of the most extreme tube."""
    return float(len(p_values) * p_values.min())


def _kind(counts: float, expected: float) -> Kind:
    return Kind.NOISY_TUBE if counts > expected else Kind.DEAD_TUBE
