# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parses the lines of loggers into records, live or from files; no line makes the parser raise."""

from __future__ import annotations

import contextlib
import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median_low
from typing import Any

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.sensing.formats.log_layout import (
    HeaderReader,
    Layout,
    LogHeader,
    MissingColumnsError,
    build_layout,
    split_fields,
)
from soilmoist_ros.sensing.formats.log_record import FieldReader, Longitude
from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    read_number,
    read_time,
    strip_checksum,
    to_seconds,
)
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format, logger_names
from soilmoist_ros.sensing.formats.notation import (
    HEADER_LINES,
    header_candidates,
    matching_formats,
    separated_as,
    settle,
    stamp_text,
)
from soilmoist_ros.sensing.lines import MAX_LINE, read_lines
from soilmoist_ros.sensing.problems import Finding, Kind, LostRecordError, Problem, Severity
from soilmoist_ros.sensing.records import NAN, LoggerRecord

MAX_PERIOD_S = 90_000.0
REMEMBERED_RECORDS = 10_000
"""Latest records of a live link by which a repeated one is known: more than a day of records of 10 s."""
MAX_CLOCK_CHANGE_S = 5.0  # offset of the logger's clock, or change of it, that is reported [s]
CLOCK_COMPARISONS = 5  # a clock that was set is known after most of them; single wrong ones do not matter
_LEADING_NUMBER = re.compile(r"[0-9.]{1,20}", re.ASCII)
_GNSS_SENTENCE = re.compile(rb"\s*\$G[A-Z](GGA|RMC|GST|GLL|GSA|GSV|VTG|ZDA),")


@dataclass(frozen=True, repr=False)
class LogFile:
    """The content of a log.

    :param problems: all faults, in the order of the file
    :param metadata: all ``key = value`` lines of the header
    :param period_s: nominal duration of a record [s], NaN if unknown
    :param logger: format with all that was decided from the file
    :param choices: these decisions in words
    :param unused: names of the columns that the format does not read
    :param tubes: name of the column of each tube, by number
    :param left_out_counts: counts of the tubes that the format leaves out, by number
    :param count_rate: unit of a count rate in the header of the counts, empty without one
    """

    path: Path
    logger: LoggerFormat
    records: tuple[LoggerRecord, ...]
    problems: tuple[Problem, ...]
    serial: str
    metadata: Mapping[str, str]
    period_s: float
    n_lines: int
    choices: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    tubes: Mapping[int, str] = field(default_factory=dict)
    left_out_counts: Mapping[int, float] = field(default_factory=dict)
    count_rate: str = ""

    def __repr__(self) -> str:
        return f"LogFile({self.path.name!r}, {len(self.records)} records, {self.records_lost} lost)"

    @property
    def simulated(self) -> bool:
        """True if the header marks the counts as simulated."""
        return self.metadata.get("simulated") == "yes"

    @property
    def records_lost(self) -> int:
        """Number of records dropped because of a fault, without duplicates."""
        return sum(problem.severity is Severity.ERROR for problem in self.problems)


class RecordParser:
    """Parses lines into records, one at a time; no line makes it raise.

    :param longitude: ``east`` or ``west`` of Greenwich, for formats that write longitudes without a sign;
        other formats ignore it
    :param on_problem: called with each problem; by default problems are collected in :attr:`problems`
    :param path: source of the lines, for messages
    :param remembered: number of latest records by which a repeated one is known; all if ``None``
    :raises InputError: if the format is unknown, or ``longitude`` is ``signed`` and the format has no signs
    """

    def __init__(
        self,
        logger: LoggerFormat | str,
        longitude: Longitude = "signed",
        on_problem: Callable[[Problem], None] | None = None,
        path: Path | None = None,
        remembered: int | None = REMEMBERED_RECORDS,
    ) -> None:
        self.format = load_logger_format(logger) if isinstance(logger, str) else logger
        self.problems: list[Problem] = []
        self.line_number = 0
        self.earlier_header: LogHeader | None = None
        """The header of :meth:`use_header`, while lines are read by it."""
        self.left_out_counts: dict[int, float] = {}
        """Counts of the tubes that the format leaves out, by number."""
        self.clock_known_from = 0
        """Number of records before the first one whose time is compared with the receiver's."""
        if longitude not in ("signed", "east", "west"):
            raise InputError(f"longitude {longitude!r} is unknown", "use signed, east or west", path)
        place = self.format.position
        if longitude == "signed" and place is not None and not place.longitude_signed:
            remedy = (
                "say on which side of Greenwich it is: 'longitude: west' or 'longitude: east' in the site file"
            )
            raise InputError(f"{self.format.title}: longitudes are written without a sign", remedy, path)
        self._side: Longitude = longitude
        self._on_problem = on_problem or self.problems.append
        self._path = path
        self._remembered = remembered
        self._header = HeaderReader(self.format)
        self._reader: FieldReader | None = None
        self.missing_columns: tuple[str, ...] = ()
        """Columns that the header lacks."""
        self._seen: dict[int, None] = {}
        self._stamps: dict[float, None] = {}
        self._previous: LoggerRecord | None = None
        self._recent_offsets_s: deque[float] = deque(maxlen=CLOCK_COMPARISONS)
        self._clock_ahead_s = 0.0

    @property
    def metadata(self) -> dict[str, str]:
        """All values in the header, by their keys."""
        return self._header.metadata

    @property
    def period_s(self) -> float | None:
        """Nominal duration of a record [s] from the header, else from the format; ``None`` if unknown."""
        period = self.format.record_period
        match = _LEADING_NUMBER.match(self._header.value_of(period.header_key))
        number = read_number(match[0]) if match else None
        period_s = to_seconds(period.unit)(number) if number else 0.0
        return period_s if 0 < period_s <= MAX_PERIOD_S else period.default_s

    @property
    def serial(self) -> str:
        """Serial number of the logger, empty until it is in a header."""
        return self._header.value_of(self.format.serial_key)

    @property
    def layout(self) -> Layout | None:
        """Columns of the log; ``None`` before a header, or if the header lacks columns."""
        self._use_new_header()
        return self._reader.layout if self._reader else None

    @property
    def unused_tubes(self) -> frozenset[int]:
        """Indices, within the counts of a record, of the tubes that the format leaves out."""
        left_out = self.format.counts.left_out
        if not left_out or self.layout is None:
            return frozenset()
        return frozenset(index for index, tube in enumerate(self.layout.tubes) if tube in left_out)

    @property
    def header(self) -> LogHeader | None:
        """The header by which lines are read, if the logger has sent it; ``None`` before."""
        used = self._reader is not None and not self._header.is_new and not self.format.header.columns
        return self._header.content if used and self._header.names else None

    def use_header(self, header: LogHeader) -> None:
        """Use an earlier header of this logger until it sends one: some send it only when they are switched on."""
        if self.layout is not None:
            return
        with contextlib.suppress(MissingColumnsError):
            layout = build_layout(self.format, header.names, header.units)
            self._reader = FieldReader(self.format, layout, self._side)
            self._header.take_values(header)
            self.earlier_header = header

    def feed(self, line: bytes, complete: bool = True) -> LoggerRecord | None:
        """Parse one line; ``None`` if it is part of the header, empty or faulty.

        :param complete: whether the line had an end; the last line of a file may be cut off
        """
        self.line_number += 1
        try:
            if len(line) > MAX_LINE:
                raise LostRecordError(Kind.TOO_LONG, f"the line has {len(line)} bytes")
            line = line.strip(b"\r\n")
            if b"\x00" in line:
                line, complete = self._without_zeros(line, complete)
            if not line.strip(b" \t\x03\x04\x1a"):  # includes end marks of text, transmission and DOS file
                return None
            body = self._checked(line, complete) if self.format.checksum == "nmea" else line
            if not body:
                return None
            return self._read(decode_line(body), complete)
        except LostRecordError as error:
            self._report(error.finding, lost=True)
            return None

    def _without_zeros(self, line: bytes, complete: bool) -> tuple[bytes, bool]:
        """A line without zero bytes, and if it is complete: the power failed while a line was written."""
        line = line.strip(b"\x00") if self.format.checksum == "nmea" else line.lstrip(b"\x00")
        before, _, after = line.rpartition(b"\x00")
        if before and not after.strip():
            return before, False
        if before and self._has_record(after):
            message = "zero bytes end the line, and another one begins"
            self._report(Finding(Kind.TRUNCATED, message), lost=True)
            return after, complete
        return line, complete

    def _checked(self, line: bytes, complete: bool) -> bytes:
        """A line without its checksum; of the remark of a person, which has none, nothing."""
        body, mark = strip_checksum(line), self.format.header.comment.encode()
        if body is not None:
            return body
        if mark and line.lstrip().startswith(mark) and b"*" not in line:
            return b""
        # Devices on the way insert text: the checksum proves the record or header at the end of the line.
        for start in range(1, len(line)):
            if not (line[start : start + 1].isdigit() or (mark and line.startswith(mark, start))):
                continue
            body = strip_checksum(line[start:])
            if body is None or not ((mark and body.startswith(mark)) or self._has_record(body)):
                continue
            message = f"the text {line[:start].decode('ascii', 'backslashreplace')[:60]!r} stands before it"
            remedy = "switch off the heartbeat or banner of the serial server"
            self._report(Finding(Kind.FOREIGN_TEXT, message, remedy))
            return body
        kind = Kind.CHECKSUM if complete else Kind.TRUNCATED
        raise LostRecordError(kind, "the checksum is absent or wrong", "", "check the connection to the logger")

    def _has_record(self, body: bytes) -> bool:
        """True if a text has the fields of a record and begins with its time."""
        layout = self.layout
        fields = None if layout is None else layout.fit(split_fields(decode_line(body), self.format.delimiter))
        if layout is None or fields is None:
            return False
        return read_time(stamp_text(fields, layout), self.format.time.used_formats) is not None

    def _use_new_header(self) -> None:
        if not self._header.is_new:
            return
        self._header.is_new = False
        self.earlier_header = None
        try:
            layout = build_layout(self.format, self._header.names, self._header.units)
        except MissingColumnsError as error:
            self._reader, self.missing_columns = None, error.columns
            remedy = "is this the right logger format?"
            self._report(Finding(Kind.BAD_HEADER, f"the header has {error}", remedy))
            return
        self._reader, self.missing_columns = FieldReader(self.format, layout, self._side), ()
        for quantity, settings in self.format.air.items():
            if settings and not layout.air[quantity]:
                self._report(Finding(Kind.MISSING_COLUMN, f"no column of the {quantity}"))
        for column, remark in layout.remarks:
            remedy = "check the unit in the logger format"
            self._report(Finding(Kind.OTHER_UNIT, remark, remedy, column=column))

    def _read(self, text: str, complete: bool) -> LoggerRecord | None:
        """The record of a line; ``None`` if it is part of the header."""
        comment = self.format.header.comment
        is_comment = comment and text.lstrip().startswith(comment)
        if not is_comment and not text.replace("\t", " ").strip("\ufeff").isprintable():
            raise LostRecordError(Kind.UNREADABLE, "the line has bytes that are not text")
        fields = self._header.fields_of(text)
        if fields is None:
            return None
        self._use_new_header()
        reader = self._reader
        if reader is None:
            remedy = "is this the right logger format?"
            raise LostRecordError(Kind.NO_HEADER, "no usable header before this line", "", remedy)
        n_names, n_fields, fitted = len(reader.layout.names), len(fields), reader.layout.fit(fields)
        if fitted is None:
            kind = Kind.WRONG_FIELDS if complete else Kind.TRUNCATED
            remedy = "if it has decimal commas, export the table with semicolons between the columns"
            remedy = remedy if self.format.delimiter == "comma" and n_fields > n_names + 2 else ""
            message = f"the line has {n_fields} fields, the header {n_names}"
            raise LostRecordError(kind, message, "", remedy)
        if not complete and self.format.checksum == "none" and reader.layout.last_needed == n_names - 1:
            raise LostRecordError(Kind.TRUNCATED, "the last line has no end: its last number may have been cut")
        try:
            record = reader.read(fitted, self.period_s, self.line_number)
        except LostRecordError as error:
            if complete:
                raise
            raise LostRecordError(Kind.TRUNCATED, error.finding.message) from None
        return self._accept(record, fitted, reader)

    def _accept(self, record: LoggerRecord, fields: Sequence[str], reader: FieldReader) -> LoggerRecord:
        """Check a record against the earlier ones; drop a duplicate."""
        notes, stamp_s, before = reader.notes, record.stamp_s, self._previous
        # As the line has them: counts of a rate depend on the time since the line before, as may the stamp.
        texts = [fields[source.index] for source in reader.layout.counts]
        key = hash((record.record_number, reader.stamp_s, *texts))  # the texts need five times the memory
        if key in self._seen:
            message = f"record {record.record_number} is repeated, and dropped"
            raise LostRecordError(Kind.DUPLICATE, message)
        if stamp_s in self._stamps:
            notes.append(Finding(Kind.SAME_TIME, "another record has the same time and other counts"))
        elif before and stamp_s < before.stamp_s:
            message = f"the clock went back by {before.stamp_s - stamp_s:g} s"
            notes.append(Finding(Kind.CLOCK_BACKWARDS, message))
        if before and 0 <= before.record_number < record.record_number - 1:
            gap = record.record_number - before.record_number - 1
            notes.append(Finding(Kind.GAP, f"{gap} record(s) missing before this one"))
        self._seen[key] = self._stamps[stamp_s] = None
        memories: tuple[dict[Any, None], ...] = (self._seen, self._stamps)
        for memory in memories:
            if self._remembered is not None and len(memory) > self._remembered:
                del memory[next(iter(memory))]
        for tube, counts in reader.left_out(fields).items():
            self.left_out_counts[tube] = self.left_out_counts.get(tube, 0.0) + counts
        self._compare_clocks(reader.clock_ahead_s(fields, record), notes)
        for note in notes:
            self._report(note)
        self._previous = replace(record, clock_ahead_s=self._clock_ahead_s) if self._clock_ahead_s else record
        return self._previous

    def _compare_clocks(self, offset_s: float, notes: list[Finding]) -> None:
        """Offset of the logger's clock from one more comparison with the receiver's."""
        if math.isnan(offset_s):
            return
        before_s, recent = self._clock_ahead_s, self._recent_offsets_s
        if not recent:
            self.clock_known_from = len(self._seen) - 1
        recent.append(offset_s)
        self._clock_ahead_s = median_low(recent)
        if len(recent) == 1 and abs(offset_s) > MAX_CLOCK_CHANGE_S:
            message = f"the logger's clock is {offset_s:+.0f} s off GNSS time"
            remedy = "set it, or consider it when you join the records with other positions"
            notes.append(Finding(Kind.CLOCK_OFFSET, message, remedy))
        elif len(recent) == CLOCK_COMPARISONS and abs(self._clock_ahead_s - before_s) > MAX_CLOCK_CHANGE_S:
            now = f"{before_s:+.0f} s off GNSS time, now {self._clock_ahead_s:+.0f} s"
            remedy = "set it before each survey: the two records before may be misplaced"
            notes.append(Finding(Kind.CLOCK_OFFSET, f"the logger's clock was set: {now}", remedy))

    def _report(self, finding: Finding, lost: bool = False) -> None:
        self._on_problem(finding.at(self._path, self.line_number, lost))


def read_log(
    path: Path | str,
    logger: LoggerFormat | str | None = None,
    longitude: Longitude = "signed",
    utc_offset_hours: float | str | None = None,
) -> LogFile:
    """Read a logger's file.

    :param logger: format: a model, its name, or the path of a YAML file; detected from the header if ``None``
    :param longitude: ``signed``, ``east`` or ``west``; see :class:`RecordParser`
    :param utc_offset_hours: logger's clock minus UTC [h] or its time zone, ``logger_clock`` of the site; that of
        the format if ``None``
    :raises InputError: if the file cannot be read, or has another format; the message names the formats that fit
    """
    path = Path(path)
    lines, last_is_complete = read_lines(path)
    form = logger or format_of_lines(lines, path)
    form = load_logger_format(form) if isinstance(form, str) else form
    return parse_log(lines, form.on_clock(utc_offset_hours), longitude, path, last_is_complete)


def parse_log(
    lines: Sequence[bytes],
    logger: LoggerFormat | str,
    longitude: Longitude,
    path: Path,
    last_is_complete: bool = True,
) -> LogFile:
    """Parse the lines of a logger, without line ends; see :func:`read_log`."""
    form = load_logger_format(logger) if isinstance(logger, str) else logger
    form, choices = settle(lines, form, path)
    parser = RecordParser(form, longitude, path=path, remembered=None)
    last = len(lines) - 1
    fed = [parser.feed(line, complete=number < last or last_is_complete) for number, line in enumerate(lines)]
    records = [record for record in fed if record is not None]
    early = parser.clock_known_from
    for at, record in enumerate(records[:early]):
        records[at] = replace(record, clock_ahead_s=records[early].clock_ahead_s)
    layout, lost = parser.layout, [problem.mistake for problem in parser.problems if problem.lost]
    if layout is None:
        raise InputError([_unreadable_header(path, lines, form, parser.missing_columns)])
    if lost and not records:
        raise InputError([_nothing_usable(path, lines, form, lost)])
    return LogFile(
        path=path, logger=form, records=tuple(records),
        problems=tuple(parser.problems), serial=parser.serial, metadata=parser.metadata,
        period_s=parser.period_s or NAN, n_lines=len(lines), choices=choices, columns=layout.names,
        unused=layout.unused, tubes=dict(zip(layout.tubes, (one.name for one in layout.counts), strict=True)),
        left_out_counts=parser.left_out_counts, count_rate=layout.count_rate,
    )  # fmt: skip


def detect_format(path: Path | str) -> LoggerFormat:
    """Logger format of a file, by :func:`format_of_lines`."""
    path = Path(path)
    return format_of_lines(read_lines(path)[0], path)


def format_of_lines(lines: Sequence[bytes], path: Path) -> LoggerFormat:
    """Detect a logger format from the names of columns, or by reading the first lines if they have none.

    :raises InputError: if no known format fits
    """

    def reads(logger: LoggerFormat) -> bool:
        parser = RecordParser(logger, "east")
        return any(parser.feed(line) is not None for line in lines[:HEADER_LINES])

    fitting = [load_logger_format(name) for name in matching_formats(lines)]
    for logger in fitting:
        if reads(separated_as(logger, lines)):
            return logger
    if fitting:
        return fitting[0]
    for logger in map(load_logger_format, logger_names()):
        if logger.header.columns and reads(logger):
            return logger
    raise InputError("has no known logger format", _other_format(lines), path)


# Explanations of unreadable files --------------------------------------------------------------------------------


def _unreadable_header(
    path: Path, lines: Sequence[bytes], logger: LoggerFormat, missing: Sequence[str]
) -> Mistake:
    """Reason why a file does not have a format, and the format that may fit."""
    remedy = _other_format(lines)
    if not missing:
        wanted = " or ".join(repr(name) for name in logger.time.columns)
        return Mistake(f"{logger.title}: no header line, which would name a column {wanted}", remedy, path)
    found = ((number, header_candidates(logger, [line])) for number, line in enumerate(lines[:HEADER_LINES], 1))
    number, names = next(((number, names[0]) for number, names in found if names), (0, []))
    have = f"; it has {', '.join(name.lstrip('/# ') for name in names[:40])}" if names else ""
    lacks = "; no column ".join(missing)
    return Mistake(f"{logger.title}: the header has no column {lacks}{have}", remedy, path, number)


def _nothing_usable(
    path: Path, lines: Sequence[bytes], logger: LoggerFormat, mistakes: Sequence[Mistake]
) -> Mistake:
    """Reason why no record of a file is usable; its columns were found."""
    first = mistakes[0]
    best = [load_logger_format(name) for name in matching_formats(lines)[:1]]
    other = any(one.title != logger.title and not one.header.columns for one in best)
    remedy = first.remedy or (_other_format(lines) if other else "correct the logger format or the file")
    message = f"{logger.title}: none of the {len(mistakes)} records is usable; the first: {first.message}"
    return Mistake(message, remedy, path, first.line, first.column)


def _other_format(lines: Sequence[bytes]) -> str:
    """Advice on the format that a file may have."""
    if fitting := matching_formats(lines):
        return f"this looks like {fitting[0]}: pass --logger {fitting[0]}"
    if any(_GNSS_SENTENCE.match(line) for line in lines[:HEADER_LINES]):
        return "this looks like the log of a GNSS receiver: pass it with --nmea, together with the neutron log"
    return (
        f"the known formats are {', '.join(logger_names())}; for another logger, soilmoist logger FILE drafts a "
        "format from the file: pass its path with --logger"
    )
