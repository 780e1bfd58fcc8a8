# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Record against record: the counts of all tubes together, and the dispersion of a log.

At a stop all records see the same soil, so given the total of two counts one of them is binomial. Rain, irrigation
and snow change the rate at one place slowly; while driving it changes with the soil. The tests allow for both.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from soilmoist_ros.sensing.checks.alarms import MAX_PER_RECORD, alarm_probability, least_chance
from soilmoist_ros.sensing.checks.finding import Finding
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import CountRecord

STOP_RADIUS_M = 3.0
"""Places closer than this to the first record of a stop belong to the stop [m]."""
STOP_CHANGE = (2.0, 1.5)
"""Factors by which the rate at one place may fall and rise between records: snow or a flood, and drying."""
DRIVING_CHANGE = (3.0, 3.0)
"""The same on the way: from dry soil to water."""
LAST_RECORDS = 30
"""Number of last good records with which a record is compared."""
MIN_AT_STOP = 3
"""Number of records at a stop from which a record is compared with them alone."""
MAX_AGE_S = 86400.0
"""Age up to which records are compared [s]."""
RECORDS_TO_BELIEVE = 10, 100
"""Number of successive odd records from which their rate counts as true: as many as the good ones before, within
these limits."""
MAX_N0_FACTOR = 2.0
"""Rates above this multiple of N0 are impossible: dry soil reaches 1.08 N0 (Desilets et al. 2010)."""
MIN_PAIRS = 20
"""Number of pairs from which a dispersion is reported."""
HIGH_DISPERSION = 1.5
"""Index of dispersion from which intervals of a map are clearly too narrow: by a fifth."""
SIGNIFICANCE = 1e-4


class _Counted(NamedTuple):
    stamp_s: float
    counts: int
    exposure_s: float


class Dispersion:
    """Index of dispersion of successive records at one place; 1 for pure counting statistics.

    Given the total of two records, the first is binomial with a variance known exactly. The index is the mean of
    the squared standardised differences over disjoint pairs. Its expectation is 1 if neighbours have the same
    rate; slow changes of the soil do not matter.
    """

    def __init__(self) -> None:
        self.pairs = 0
        self._sum = 0.0
        self._last: CountRecord | None = None

    def __repr__(self) -> str:
        return f"Dispersion({self.index:.2f}, {self.pairs} pairs)"

    @property
    def index(self) -> float:
        """Index of dispersion [-], NaN without a pair."""
        return self._sum / self.pairs if self.pairs else math.nan

    @property
    def is_high(self) -> bool:
        """Whether the scatter is higher than counting statistics, clearly and significantly."""
        if self.pairs < MIN_PAIRS or self.index <= HIGH_DISPERSION:
            return False
        from scipy.special import chdtrc  # slow to import, and needed for odd records only

        return bool(chdtrc(self.pairs, self._sum) < SIGNIFICANCE)

    def add(self, record: CountRecord) -> None:
        """Add a record in order of time."""
        last, self._last = self._last, record
        if last is None or not _same_place(last, record) or record.stamp_s - last.stamp_s > MAX_AGE_S:
            return
        total = last.raw_counts + record.raw_counts
        if total > 0:
            share = last.effective_exposure_s / (last.effective_exposure_s + record.effective_exposure_s)
            self._sum += (last.raw_counts - share * total) ** 2 / (total * share * (1 - share))
            self.pairs += 1
            self._last = None  # disjoint pairs are independent


class TotalChecks:
    """Compares the records of one probe with each other, record by record.

    :param n0_cps: count rate over dry soil [counts/s], NaN if unknown
    :param typical_cps: typical corrected rate, known from the whole log [counts/s]; NaN if unknown
    """

    def __init__(self, n0_cps: float = math.nan, typical_cps: float = math.nan) -> None:
        self.recorded, self.used = Dispersion(), Dispersion()
        """Dispersion of the records as they came, and of those in use."""
        self._n0_cps, self.typical_cps = n0_cps, typical_cps
        self._recent: deque[_Counted] = deque(maxlen=LAST_RECORDS)
        self._stop: deque[_Counted] = deque(maxlen=LAST_RECORDS)
        self._anchor: CountRecord | None = None
        self._odd = self._good = 0

    def check(self, record: CountRecord, recorded: CountRecord | None = None) -> list[Finding]:
        """Faults of the next record; a record that is quarantined already only counts for the dispersion.

        :param record: the corrected record, with its place if known
        :param recorded: the same record with the counts of all tubes, bad ones included; ``None`` if none was bad
        """
        self.recorded.add(record if recorded is None else recorded)
        if record.quarantine or not (record.effective_exposure_s > 0 and record.exposure_s > 0):
            return []
        counted = _Counted(record.stamp_s, record.raw_counts, record.effective_exposure_s)
        level = alarm_probability(record.exposure_s) / 2
        if _are_above(counted.counts, MAX_N0_FACTOR * self._n0_cps * counted.exposure_s, level):
            message = f"{record.corrected_rate:.1f} counts/s are impossible with N0 = {self._n0_cps:g} counts/s"
            remedy = "check the detector, and 'n0_cps' in the site file"
            return [Finding(Kind.IMPOSSIBLE_COUNT, message, remedy, bad=True)]
        at_stop = self._anchor is not None and _same_place(self._anchor, record)
        if not at_stop:
            self._stop.clear()
            self._anchor = record
        near = _young(self._stop, record.stamp_s)
        change = STOP_CHANGE
        if len(near) < MIN_AT_STOP:
            near, change = _young(self._recent, record.stamp_s), DRIVING_CHANGE
        expected_cps, chance = self._chance(counted, near, change)
        low, high = RECORDS_TO_BELIEVE
        if chance < level and self._odd < min(max(self._good, low), high):
            self._odd += 1
            message = (
                f"{record.corrected_rate:.2f} counts/s after {expected_cps:.2f} counts/s in {len(near)} records"
            )
            return [Finding(Kind.RATE_JUMP, message, "check the detector and its supply", bad=True)]
        if chance < level:  # enough records agree: those before were wrong
            self._recent.clear()
            self._stop.clear()
            self._good = 0
        self._odd = 0
        self._good += 1
        self._recent.append(counted)
        self._stop.append(counted)
        self.used.add(record)
        return []

    def _chance(self, counted: _Counted, near: list[_Counted], change: tuple[float, float]) -> tuple[float, float]:
        """Expected rate [counts/s], and the probability of a count so far from it if the rate is possible."""
        fall, rise = change
        if not near:
            mean = self.typical_cps * counted.exposure_s
            if math.isnan(mean):
                return math.nan, 1.0
            if mean / fall <= counted.counts <= rise * mean:  # both chances are 1/2 or more
                return self.typical_cps, 0.5
            from scipy.special import pdtr, pdtrc  # see above

            above = pdtrc(counted.counts - 1, rise * mean) if counted.counts else 1.0
            return self.typical_cps, float(min(above, pdtr(counted.counts, mean / fall)))
        counts, exposure_s = sum(one.counts for one in near), math.fsum(one.exposure_s for one in near)
        total, ratio = counts + counted.counts, counted.exposure_s / exposure_s
        largest, smallest = ratio * rise / (ratio * rise + 1), ratio / fall / (ratio / fall + 1)
        least = min(least_chance(counted.counts, total, largest), least_chance(counts, total, 1 - smallest))
        if least > MAX_PER_RECORD:
            return counts / exposure_s, least
        from scipy.special import bdtr, bdtrc  # see above

        above = bdtrc(counted.counts - 1, total, largest) if counted.counts else 1.0
        below = bdtr(counted.counts, total, smallest)
        return counts / exposure_s, float(min(above, below))

    @property
    def findings(self) -> list[Finding]:
        """Faults of the log as a whole so far."""
        if not (self.recorded.is_high or self.used.is_high):
            return []
        remedy = "check the detector for noise; intervals of the map are too narrow if the records in use scatter"
        message = (
            f"the index of dispersion is {self.recorded.index:.4g} as recorded and {self.used.index:.3g} "
            f"without bad tubes and quarantined records; counting statistics have 1"
        )
        return [Finding(Kind.OVERDISPERSED, message, remedy)]


def _young(records: Iterable[_Counted], stamp_s: float) -> list[_Counted]:
    return [one for one in records if abs(stamp_s - one.stamp_s) <= MAX_AGE_S]


def _same_place(one: CountRecord, other: CountRecord) -> bool:
    """Whether two records were counted at one place; unknown places count as different."""
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) <= STOP_RADIUS_M


def _are_above(counts: int, mean: float, level: float) -> bool:
    """Whether so many counts have a probability below a level, which is below 1/2."""
    if not counts > mean:
        return False
    from scipy.special import pdtrc  # see above

    return bool(pdtrc(counts - 1, mean) < level)
