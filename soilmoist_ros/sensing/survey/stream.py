# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Live lines of a logger and a GNSS receiver to the records of a survey; why lines of a logger become none."""

from __future__ import annotations

from collections import Counter, deque
from itertools import pairwise
from statistics import median_low

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.formats.notation import matching_formats
from soilmoist_ros.sensing.gnss import Fix
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.sensing.problems import Kind, Problem, Severity
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord
from soilmoist_ros.sensing.survey.survey import Survey

LAST_RECORDS = 20  # number of latest records for the diagnostics
SURE_GAPS = 3  # number of times between records from which they count more than the nominal period
MAX_LINES = 50  # number of lines kept for the search of their format
MAX_EXAMPLE = 80  # number of characters shown of a line
_DAMAGED = frozenset((Kind.UNREADABLE, Kind.TOO_LONG))
_OTHER_FORMAT = frozenset((Kind.NO_HEADER, Kind.BAD_HEADER, Kind.WRONG_FIELDS, Kind.BAD_TIME, Kind.NOT_A_NUMBER))
_BAUD = "compare the baud rate in logger_uri with the logger's, and check the cable"


class ProblemCount:
    """Number of problems of each kind, and the last problem with lost data."""

    def __init__(self) -> None:
        self.lost: Counter[Kind] = Counter()
        """Dropped data by kind of problem; a duplicate record is dropped, too, but is no loss."""
        self.noted: Counter[Kind] = Counter()
        self.last_loss: Problem | None = None
        self.last_quarantined: Problem | None = None

    def add(self, problem: Problem) -> None:
        """Count a problem."""
        (self.lost if problem.lost else self.noted)[problem.kind] += 1
        if problem.severity is Severity.ERROR:
            self.last_loss = problem
        if problem.quarantined:
            self.last_quarantined = problem


class SensorStream:
    """Feeds lines to a survey, and collects statistics for diagnostics.

    :param fix_wait_s: maximum time that a record waits for a fix [s]
    :raises InputError: if the format or the neutron-monitor file is invalid
    """

    def __init__(self, site: Site, frame: LocalFrame, logger: LoggerFormat | str, fix_wait_s: float = 2.0) -> None:
        self.logger_problems, self.gnss_problems = ProblemCount(), ProblemCount()
        form = load_logger_format(logger) if isinstance(logger, str) else logger
        form = form.on_clock(site.logger_clock)
        self.parser = RecordParser(form, site.longitude, self._on_problem)
        self.survey = Survey(site, frame, fix_wait_s=fix_wait_s, on_problem=self._on_problem)
        self.last_record: LoggerRecord | None = None
        self.last_fix: Fix | None = None
        self.records_out = 0
        self.quarantined: Counter[str] = Counter()
        """Number of records of each reason of quarantine."""
        self.recent_bad: deque[bool] = deque(maxlen=LAST_RECORDS)
        """True for each of the last records that is quarantined."""
        self.faulty = FaultyLines()
        """Lines since the last record that could be corrected."""
        self.nmea = NmeaParser(on_problem=self.gnss_problems.add)
        self._stamps: deque[float] = deque(maxlen=LAST_RECORDS)
        self._period_s = 0.0
        self.recent_good: deque[bool] = deque(maxlen=LAST_RECORDS)
        """False for each of the last records that was lost."""
        self._clock_differences_s: deque[float] = deque(maxlen=LAST_RECORDS)

    def take_logger_line(self, line: bytes, now_s: float) -> LoggerRecord | None:
        """Process a line of the logger; returns the raw record, if any, with the logged weather."""
        self.faulty.take_line(line)
        record = self.parser.feed(line)
        if record is None:
            return None
        self.last_record = record
        self._stamps.append(record.stamp_s)
        # The median, because a break or a clock that was set is one gap of many.
        gaps_s = [gap_s for a, b in pairwise(self._stamps) if (gap_s := b - a) > 0]
        if len(gaps_s) >= SURE_GAPS or not self.parser.period_s:
            self._period_s = median_low(gaps_s or [0.0])
        self.survey.take_record(record, now_s, unused_tubes=self.parser.unused_tubes)
        return record

    def take_nmea_line(self, line: bytes, now_s: float = NAN) -> Fix | None:
        """Process a line of the GNSS receiver; returns the fix that it completes, if any."""
        if (fix := self.nmea.feed(line, now_s)) is not None:
            self.take_fix(fix)
        return fix

    def take_fix(self, fix: Fix) -> None:
        """Add an epoch from another source, with or without a fix."""
        self.last_fix = fix
        self.survey.take_fix(fix)

    def take_ready(self, now_s: float) -> list[CountRecord]:
        """Remove and return the records whose wait is over, oldest first."""
        ready = self.survey.take_ready(now_s)
        self.records_out += len(ready)
        self.quarantined.update(record.quarantine for record in ready if record.quarantine)
        self.recent_bad.extend(bool(record.quarantine) for record in ready)
        if ready:
            self.faulty = FaultyLines()
        self.recent_good.extend([True] * len(ready))
        return ready

    def compare_clocks(self, stamp_s: float, now_s: float) -> None:
        """Store the difference of the logger's clock and the computer's clock, for diagnostics only."""
        self._clock_differences_s.append(stamp_s - now_s)

    @property
    def clock_difference_s(self) -> float:
        """Smallest recent logger's clock minus computer's clock [s], as lines may be late; NaN if unknown."""
        return min(self._clock_differences_s, key=abs, default=NAN)

    @property
    def records_per_minute(self) -> float:
        """Recent records per minute of the logger's time, NaN with fewer than two records."""
        spent_s = self._stamps[-1] - self._stamps[0] if self._stamps else 0.0
        return 60 * (len(self._stamps) - 1) / spent_s if spent_s > 0 else NAN

    @property
    def record_period_s(self) -> float:
        """Usual time between records [s], nominal for the first ones; zero if unknown. Called from any thread."""
        return self._period_s or self.parser.period_s or 0.0

    def _on_problem(self, problem: Problem) -> None:
        self.logger_problems.add(problem)
        self.faulty.take_problem(problem)
        if problem.severity is Severity.ERROR:
            self.recent_good.append(False)


# Why bytes of a logger become no record, and what to do about it ------------------------------------------------


class FaultyLines:
    """Lines of a logger since its last record, and what was dropped of them by kind of problem."""

    def __init__(self) -> None:
        self.lines = 0
        self.lost: Counter[Kind] = Counter()
        self._line = b""
        self._first: list[bytes] = []
        self._remedies: dict[Kind, str] = {}
        self._examples: dict[Kind, bytes] = {}

    def take_line(self, line: bytes) -> None:
        """A line has come."""
        self.lines += 1
        self._line = line
        if len(self._first) < MAX_LINES:
            self._first.append(line)

    def take_problem(self, problem: Problem) -> None:
        """Something is wrong with the last line, or with its record."""
        if problem.lost and problem.kind is not Kind.DUPLICATE:
            self.lost[problem.kind] += 1
            self._remedies[problem.kind] = problem.mistake.remedy
            self._examples[problem.kind] = self._line

    @property
    def reasons(self) -> str:
        """Reasons for dropped lines with their numbers, the most frequent first; empty without dropped lines."""
        return ", ".join(f"{kind.text} ({count})" for kind, count in self.lost.most_common(3))

    @property
    def examples(self) -> dict[str, str]:
        """The last line of each kind of problem, as printable text."""
        return {f"last line with: {kind.text}": _printable(line) for kind, line in sorted(self._examples.items())}

    def remedy(self, logger: LoggerFormat) -> str:
        """Remedy for the dropped lines, for the operator."""
        if not self.lines:
            return f"no line has an end: {_BAUD}"
        if sum(line.startswith(b"$G") for line in self._first) > len(self._first) / 2:
            return "these are sentences of a GNSS receiver: exchange logger_uri and gnss_uri"
        fitting = matching_formats(self._first)
        if fitting and logger not in map(load_logger_format, fitting):
            return f"the lines look like {fitting[0]}: set logger_format to it"
        kind = next((kind for kind, _ in self.lost.most_common(1)), None)
        if kind is None:
            return "check that the logger counts: it sends only lines of a header"
        if kind in _DAMAGED or (kind is Kind.CHECKSUM and _is_noise(self._examples[kind])):
            return f"{_BAUD}; binary protocols cannot be read"
        if kind is Kind.CHECKSUM and b"*" not in self._examples[kind]:
            return f"the lines have no checksum, unlike those of {logger.title}: check logger_format"
        if kind in (Kind.BAD_TIME, Kind.NOT_A_NUMBER) and self._remedies[kind]:
            return self._remedies[kind]
        if kind in _OTHER_FORMAT:
            return f"check logger_format (now {logger.title}), or restart the logger, which then sends its header"
        return self._remedies[kind] or "check the logger"


def _is_noise(line: bytes) -> bool:
    """True if more than a tenth of a line is not ASCII text."""
    return 10 * sum(not (32 <= byte < 127 or byte == 9) for byte in line) > len(line)


def _printable(line: bytes) -> str:
    text = "".join(chr(byte) if 32 <= byte < 127 else f"\\x{byte:02x}" for byte in line[:MAX_EXAMPLE])
    return text if len(text) <= MAX_EXAMPLE else f"{text[:MAX_EXAMPLE]}..."
