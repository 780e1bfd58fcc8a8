"""The checks of one probe: records go in one by one, and come out with their faults."""

from __future__ import annotations

from collections.abc import Collection

from soilmoist_ros.sensing.checks.finding import Checked, Finding
from soilmoist_ros.sensing.checks.weather import check_weather
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord

MAX_TUBE_RATE_CPS = 1000.0
"""Rate that no tube for environmental neutrons reaches, by orders of magnitude [counts/s]."""


class RecordChecks:
    """Checks the records of one probe in order of time; only earlier records are known.

    A file is a loop over it.

    :param altitude_m: altitude of the site [m], NaN if unknown

    >>> checks = RecordChecks()
    >>> checks.check(LoggerRecord(10.0, (1_200_000.0,), (10.0,))).quarantine
    'impossible_count'
    >>> checks.check(LoggerRecord(20.0, (12.0,), (10.0,))).quarantine
    ''
    """

    def __init__(self, altitude_m: float = NAN) -> None:
        self._altitude_m = altitude_m

    def check(self, record: LoggerRecord, unused_tubes: Collection[int] = ()) -> Checked:
        """Check the next record.

        :param record: the raw record
        :param unused_tubes: indices of the tubes that the format leaves out
        """
        record, findings = check_weather(record, self._altitude_m)
        for tube, (counts, live_s) in enumerate(zip(record.tube_counts, record.tube_live_s, strict=True), 1):
            if tube - 1 not in unused_tubes and live_s > 0 and counts > MAX_TUBE_RATE_CPS * live_s:
                message = f"{counts:.0f} counts in {live_s:g} s are impossible (tube {tube})"
                remedy = "check the tube, its high voltage and its cable"
                findings.append(Finding(Kind.IMPOSSIBLE_COUNT, message, remedy, bad=True))
        return Checked(record, tuple(findings))
