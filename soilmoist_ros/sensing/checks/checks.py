# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The checks of one probe: records go in one by one, and come out with their faults."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from soilmoist_ros.sensing.checks.finding import Checked, Finding
from soilmoist_ros.sensing.checks.totals import TotalChecks
from soilmoist_ros.sensing.checks.tubes import BadTube, TubeChecks
from soilmoist_ros.sensing.checks.weather import WeatherChecks
from soilmoist_ros.sensing.corrections.tubes import tube_shares
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord

MAX_TUBE_RATE_CPS = 1000.0
"""Rate that no tube for environmental neutrons reaches, by orders of magnitude [counts/s]."""
_REMEDY = "check the tube, its high voltage and its cable"


class RecordChecks:
    """Checks the records of one probe in order of time; only earlier records are known, unless they are learned.

    A bad tube is masked: its counts become NaN, and the exposure covers the other tubes. A record without a good
    tube, or with counts that do not fit the records before, is bad as a whole.

    :param n0_cps: count rate over dry soil [counts/s], NaN if unknown
    :param altitude_of: altitude of the probe at a record [m], NaN if unknown

    >>> checks = RecordChecks()
    >>> checks.check(LoggerRecord(10.0, (1_200_000.0,), (10.0,))).quarantine
    'impossible_count'
    >>> checks.check(LoggerRecord(20.0, (12.0,), (10.0,))).quarantine
    ''
    """

    def __init__(
        self, n0_cps: float = NAN, altitude_of: Callable[[LoggerRecord], float] = lambda record: NAN
    ) -> None:
        self.totals = TotalChecks(n0_cps)
        """Record against record, for corrected and placed records."""
        self.masked: dict[int, Kind] = {}
        """Tubes that were left out of the last record, by index, and why."""
        self._altitude_of = altitude_of
        self._weather = WeatherChecks()
        self._tubes: TubeChecks | None = None

    def learn(self, records: Sequence[LoggerRecord]) -> list[Checked]:
        """Learn the shares of the tubes and their bad periods from a whole log, before its first record.

        :param records: all records in order of time, with one number of tubes
        :returns: the records as a check without this knowledge finds them
        """
        first = RecordChecks(altitude_of=self._altitude_of)
        found = [first.check(record) for record in records]
        good = [checked.record for checked in found if not checked.quarantine]
        if good and first._tubes is not None:
            self._tubes = TubeChecks(
                first._tubes.tubes, tube_shares(good), first._tubes.rate_cps, first._tubes.spans
            )
        return found

    def check(self, record: LoggerRecord, unused_tubes: Collection[int] = ()) -> Checked:
        """Check the next record.

        :param record: the raw record
        :param unused_tubes: indices of the tubes that the format leaves out
        """
        tubes = len(record.tube_counts)
        if self._tubes is None or self._tubes.tubes != tubes:
            self._tubes = TubeChecks(tubes)
        record, findings = self._weather.check(record, self._altitude_of(record))
        counts, live_s = np.array(record.tube_counts, float), np.array(record.tube_live_s, float)
        present = np.isfinite(counts) & (live_s > 0)
        present[list(unused_tubes)] = False
        wild = present & (counts > MAX_TUBE_RATE_CPS * live_s)
        bad = [BadTube(int(tube), Kind.IMPOSSIBLE_COUNT, counts[tube], NAN) for tube in np.flatnonzero(wild)]
        known = len(self._tubes.spans)
        bad += self._tubes.check(record, present & ~wild)
        self.masked = {one.tube: one.kind for one in bad}
        if not bad:
            return Checked(record, tuple(findings))
        none_left = len(bad) == present.sum()
        findings += [_finding(one, float(live_s[one.tube]), none_left) for one in bad]
        since_s = {span.tube: span.begin_s for span in self._tubes.spans[known:]}
        masked = record if none_left else _masked(record, [one.tube for one in bad])
        return Checked(masked, tuple(findings), since_s)


def _masked(record: LoggerRecord, tubes: Collection[int]) -> LoggerRecord:
    counts = tuple(NAN if tube in tubes else count for tube, count in enumerate(record.tube_counts))
    return replace(record, tube_counts=counts)


def _finding(bad: BadTube, live_s: float, none_left: bool) -> Finding:
    message = f"tube {bad.tube + 1} has {bad.counts:.0f} counts in {live_s:g} s"
    if bad.kind is Kind.IMPOSSIBLE_COUNT:
        message += ", which no tube can count"
    elif bad.kind is Kind.STUCK_TUBE:
        message += " again and again"
    elif bad.expected == bad.expected:
        message += f", the other tubes expect {bad.expected:.0f}"
    else:
        message += ", and the tubes do not agree"
    return Finding(bad.kind, message, _REMEDY, none_left)
