# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parses the lines of loggers into records, live or from files; no line makes the parser raise."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.sensing.clock_drift import ClockDrift
from soilmoist_ros.sensing.formats import log_values as units
from soilmoist_ros.sensing.formats.log_layout import (
    HeaderReader,
    Layout,
    LogHeader,
    MissingColumnsError,
    build_layout,
    split_fields,
)
from soilmoist_ros.sensing.formats.log_record import FieldReader, Longitude, LostRecordError, Reading, Remark
from soilmoist_ros.sensing.formats.log_values import decode_line, read_number, read_time, strip_checksum
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format, logger_names
from soilmoist_ros.sensing.formats.notation import (
    HEADER_LINES,
    _known_format,
    header_candidates,
    matching_formats,
    separated_as,
    settle,
    stamp_text,
)
from soilmoist_ros.sensing.lines import MAX_LINE, read_lines
from soilmoist_ros.sensing.problems import Kind, Problem, Severity
from soilmoist_ros.sensing.records import NAN, LoggerRecord

MAX_PERIOD_S = 90_000.0
REMEMBERED_RECORDS = 10_000
"""Latest records of a live link by which a repeated one is known: more than a day of records of 10 s."""
CLOCK_TOLERANCE_S = 5.0
_LEADING_NUMBER = re.compile(r"[0-9.]{1,20}", re.ASCII)
_GNSS_SENTENCE = re.compile(rb"\s*\$G[A-Z](GGA|RMC|GST|GLL|GSA|GSV|VTG|ZDA),")


@dataclass(frozen=True, repr=False)
class LogFile:
    """The content of a log.

    :param problems: all faults, in the order of the file
    :param metadata: all ``key = value`` lines of the header
    :param period_s: nominal duration of a record [s], NaN if unknown
    :param clock_offset_s: logger's clock minus GNSS time [s], median since it was last set, NaN if unknown.
        Subtract it from the stamps before joining them with positions of another receiver
    :param unsigned_longitude: whether the site file gave the longitudes their sign
    :param clock: logger's clock against GNSS time
    :param utc_offset_hours: logger's clock minus UTC, as it was read [h]; 0 with a time zone
    :param logger: format with all that was decided from the file
    :param choices: these decisions in words
    :param unused: names of the columns that the format does not read
    :param tubes: name of the column of each tube, by number
    :param left_out_counts: counts of the tubes that the format leaves out, by number
    :param count_rate: unit of a count rate in the header of the counts, empty without one
    """

    path: Path
    format_title: str
    records: tuple[LoggerRecord, ...]
    problems: tuple[Problem, ...]
    serial: str
    metadata: Mapping[str, str]
    period_s: float
    clock_offset_s: float
    n_lines: int
    unsigned_longitude: bool = False
    clock: ClockDrift = field(default_factory=ClockDrift, compare=False)
    utc_offset_hours: float = 0.0
    logger: LoggerFormat | None = field(default=None, compare=False)
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
        self.clock = ClockDrift()
        """Logger's clock against the GNSS time in the lines."""
        self.earlier_header: LogHeader | None = None
        """The header of :meth:`use_header`, while lines are read by it."""
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
        self._bad_header: MissingColumnsError | None = None
        self._seen: dict[float, None] = {}
        self._stamps: dict[float, None] = {}
        self._previous: LoggerRecord | None = None
        self.left_out_counts: dict[int, float] = {}
        """Counts of the tubes that the format leaves out, by number."""

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
        period_s = units.to_seconds(period.unit)(number) if number else 0.0
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
    def missing_columns(self) -> tuple[str, ...]:
        """Columns that the header lacks."""
        return self._bad_header.columns if self._bad_header else ()

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
        if len(line) > MAX_LINE:
            self._lose(Remark(Kind.TOO_LONG, f"the line has {len(line)} bytes"))
            return None
        line = line.strip(b"\r\n")
        if not line.strip(b" \t\x03\x04\x1a"):  # includes end marks of text, transmission and DOS file
            return None
        if b"\x00" in line:  # the power failed while a line was written
            line = line.strip(b"\x00") if self.format.checksum == "nmea" else line.lstrip(b"\x00")
            before, _, after = line.rpartition(b"\x00")
            if before and not after.strip():
                line, complete = before, False
            elif before and self._has_record(after):
                self._lose(Remark(Kind.TRUNCATED, "zero bytes end the line, and another one begins"))
                line = after
            if not line.strip():
                return None
        if self.format.checksum == "nmea":
            body, mark = strip_checksum(line), self.format.header.comment.encode()
            if body is None and mark and line.lstrip().startswith(mark) and b"*" not in line:
                return None  # a remark added by a person
            if body is None:
                body = self._after_foreign_text(line)
            if body is None:
                kind = Kind.CHECKSUM if complete else Kind.TRUNCATED
                self._lose(
                    Remark(kind, "the checksum is absent or wrong", "", "check the connection to the logger")
                )
                return None
            line = body
        text = decode_line(line)
        comment = self.format.header.comment
        if comment and text.lstrip().startswith(comment):
            self._header.take_comment(text.lstrip()[len(comment) :])
            return None
        return self._take_record(text, complete)

    def _after_foreign_text(self, line: bytes) -> bytes | None:
        """The record or header at the end of a line, if its checksum proves it: devices on the way insert text."""
        comment = self.format.header.comment.encode()
        for start in range(1, len(line)):
            if not (line[start : start + 1].isdigit() or (comment and line.startswith(comment, start))):
                continue
            body = strip_checksum(line[start:])
            if body is None or not (body.startswith(comment or b"\x00") or self._has_record(body)):
                continue
            text = line[:start].decode("ascii", "backslashreplace")
            remedy = "switch off the heartbeat or banner of the serial server"
            self._report(
                Remark(Kind.FOREIGN_TEXT, f"the text {text[:60]!r} stands before it", "", remedy), lost=False
            )
            return body
        return None

    def _has_record(self, body: bytes) -> bool:
        """True if a text has the fields of a record and begins with its time."""
        layout = self.layout
        fields = None if layout is None else layout.fit(split_fields(self.format, decode_line(body)))
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
            self._reader = None
            self._bad_header = error
            note = Remark(Kind.BAD_HEADER, f"the header has {error}", "", "is this the right logger format?")
            self._report(note, lost=False)
            return
        self._reader = FieldReader(self.format, layout, self._side)
        self._bad_header = None
        for quantity, settings in self.format.air.items():
            if settings and not layout.air[quantity]:
                self._report(Remark(Kind.MISSING_COLUMN, f"no column of the {quantity}"), lost=False)
        for column, remark in layout.remarks:
            self._report(
                Remark(Kind.OTHER_UNIT, remark, column, "check the unit in the logger format"), lost=False
            )

    def _take_record(self, text: str, complete: bool) -> LoggerRecord | None:
        if not text.replace("\t", " ").strip("\ufeff").isprintable():
            self._lose(Remark(Kind.UNREADABLE, "the line has bytes that are not text"))
            return None
        fields = split_fields(self.format, text)
        if self._header.takes(fields):
            return None
        self._use_new_header()
        if self._reader is None:
            remedy = "is this the right logger format?"
            self._report(Remark(Kind.NO_HEADER, "no usable header before this line", "", remedy), lost=True)
            return None
        names = self._reader.layout.names
        fitted = self._reader.layout.fit(fields)
        if fitted is None:
            kind = Kind.WRONG_FIELDS if complete else Kind.TRUNCATED
            commas = self.format.delimiter == "comma" and len(fields) > len(names) + 2
            remedy = (
                "if it has decimal commas, export the table with semicolons between the columns" if commas else ""
            )
            self._lose(Remark(kind, f"the line has {len(fields)} fields, the header {len(names)}", "", remedy))
            return None
        fields = fitted
        if not complete and self.format.checksum == "none" and self._reader.layout.last_needed == len(names) - 1:
            self._lose(Remark(Kind.TRUNCATED, "the last line has no end: its last number may have been cut"))
            return None
        try:
            reading = self._reader.read(fields, self.period_s, self.line_number)
        except LostRecordError as error:
            self._lose(error.note if complete else Remark(Kind.TRUNCATED, error.note.message))
            return None
        return self._accept(reading)

    def _accept(self, reading: Reading) -> LoggerRecord | None:
        """Check a record against the earlier ones; drop a duplicate."""
        record, notes, key = reading.record, reading.notes, reading.key
        if key in self._seen:
            self._lose(Remark(Kind.DUPLICATE, f"record {record.record_number} is repeated, and dropped"))
            return None
        if record.stamp_s in self._stamps:
            notes.append(Remark(Kind.SAME_TIME, "another record has the same time and other counts"))
        elif self._previous and record.stamp_s < self._previous.stamp_s:
            back_s = self._previous.stamp_s - record.stamp_s
            notes.append(Remark(Kind.CLOCK_BACKWARDS, f"the clock went back by {back_s:g} s"))
        if self._previous and 0 <= self._previous.record_number < record.record_number - 1:
            gap = record.record_number - self._previous.record_number - 1
            notes.append(Remark(Kind.GAP, f"{gap} record(s) missing before this one"))
        self._seen[key] = self._stamps[record.stamp_s] = None
        for memory in (self._seen, self._stamps):
            if self._remembered is not None and len(memory) > self._remembered:
                del memory[next(iter(memory))]
        self._previous = record
        for tube, counts in reading.left_out.items():
            self.left_out_counts[tube] = self.left_out_counts.get(tube, 0.0) + counts
        offset_s = reading.gnss_offset_s
        if abs(offset_s) > CLOCK_TOLERANCE_S and not len(self.clock):
            message = f"the logger's clock is {offset_s:+.0f} s off GNSS time"
            remedy = "set it, or consider it when you join the records with other positions"
            notes.append(Remark(Kind.CLOCK_OFFSET, message, "", remedy))
        self.clock.add(record.stamp_s, offset_s)
        for note in notes:
            self._report(note, lost=False)
        return record

    def _lose(self, note: Remark) -> None:
        self._report(note, lost=True)

    def _report(self, note: Remark, lost: bool) -> None:
        mistake = Mistake(note.message, note.remedy, self._path, self.line_number, note.column)
        self._on_problem(Problem(note.kind, mistake, lost))


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
    records = tuple(record for record in fed if record is not None)
    if parser.layout is None:
        raise InputError([unreadable_header(path, lines, parser.format, parser.missing_columns)])
    lost = [problem for problem in parser.problems if problem.lost]
    if lost and not records:
        raise InputError([nothing_usable(path, lines, parser.format, [problem.mistake for problem in lost])])
    return LogFile(
        path=path,
        format_title=parser.format.title,
        records=records,
        problems=tuple(parser.problems),
        serial=parser.serial,
        metadata=MappingProxyType(dict(parser.metadata)),
        period_s=parser.period_s or NAN,
        clock_offset_s=parser.clock.median_s,
        n_lines=len(lines),
        unsigned_longitude=parser.format.position is not None and not parser.format.position.longitude_signed,
        clock=parser.clock,
        utc_offset_hours=parser.format.time.utc_offset_hours,
        logger=form,
        choices=choices,
        columns=parser.layout.names,
        unused=parser.layout.unused,
        tubes=dict(zip(parser.layout.tubes, (one.name for one in parser.layout.counts), strict=True)),
        left_out_counts=parser.left_out_counts,
        count_rate=parser.layout.count_rate,
    )


def detect_format(path: Path | str) -> LoggerFormat:
    """Logger format of a file, by :func:`format_of_lines`."""
    path = Path(path)
    return format_of_lines(read_lines(path)[0], path)


def format_of_lines(lines: Sequence[bytes], path: Path) -> LoggerFormat:
    """Detect a logger format from the names of columns, or by reading the first lines if they have none.

    :raises InputError: if no known format fits
    """
    fitting = [load_logger_format(name) for name in matching_formats(lines)]
    for logger in fitting:
        parser = RecordParser(separated_as(logger, lines), "east")
        if any(parser.feed(line) is not None for line in lines[:HEADER_LINES]):
            return logger
    for logger in fitting:
        return logger
    for name in logger_names():
        logger = load_logger_format(name)
        if logger.header.columns:
            parser = RecordParser(logger, "east")
            if any(parser.feed(line) is not None for line in lines[:HEADER_LINES]):
                return logger
    raise InputError("has no known logger format", other_format(lines), path)


# Finds and reads logger files, and explains unreadable files ----------------------------------------------------


def unreadable_header(path: Path, lines: Sequence[bytes], logger: LoggerFormat, missing: Sequence[str]) -> Mistake:
    """Reason why a file does not have a format, and the format that may fit."""
    remedy = other_format(lines)
    if not missing:
        wanted = " or ".join(repr(name) for name in logger.time.columns)
        return Mistake(f"{logger.title}: no header line, which would name a column {wanted}", remedy, path)
    found = ((number, header_candidates(logger, [line])) for number, line in enumerate(lines[:HEADER_LINES], 1))
    number, names = next(((number, names[0]) for number, names in found if names), (0, []))
    have = f"; it has {', '.join(name.lstrip('/# ') for name in names[:40])}" if names else ""
    lacks = "; no column ".join(missing)
    return Mistake(f"{logger.title}: the header has no column {lacks}{have}", remedy, path, number)


def nothing_usable(
    path: Path, lines: Sequence[bytes], logger: LoggerFormat, mistakes: Sequence[Mistake]
) -> Mistake:
    """Reason why no record of a file is usable; its columns were found."""
    first = mistakes[0]
    fitting = [_known_format(name) for name in matching_formats(lines)[:1]]
    other = [one for one in fitting if one.title != logger.title and one.header.columns == ()]
    remedy = first.remedy or (other_format(lines) if other else "correct the logger format or the file")
    message = f"{logger.title}: none of the {len(mistakes)} records is usable; the first: {first.message}"
    return Mistake(message, remedy, path, first.line, first.column)


def other_format(lines: Sequence[bytes]) -> str:
    """Advice on the format that a file may have."""
    fitting = matching_formats(lines)
    if fitting:
        return f"this looks like {fitting[0]}: pass --logger {fitting[0]}"
    if any(_GNSS_SENTENCE.match(line) for line in lines[:HEADER_LINES]):
        return "this looks like the log of a GNSS receiver: pass it with --nmea, together with the neutron log"
    return (
        f"the known formats are {', '.join(logger_names())}; for another logger, soilmoist logger FILE drafts a "
        "format from the file: pass its path with --logger"
    )
