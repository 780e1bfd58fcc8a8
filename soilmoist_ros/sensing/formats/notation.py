# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decides once for a file how its dates, numbers and coordinates are written, and states each decision."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.sensing.formats.log_layout import (
    HeaderReader,
    Layout,
    MissingColumnsError,
    build_layout,
    is_header,
    plain_name,
    split_fields,
)
from soilmoist_ros.sensing.formats.log_values import Decimal, decode_line, read_coordinate, read_number, read_time
from soilmoist_ros.sensing.formats.logger_format import (
    DateOrder,
    LoggerFormat,
    load_logger_format,
    logger_names,
    order_of,
)
from soilmoist_ros.sensing.lines import MAX_LINE

MAX_SAMPLE = 2_000  # number of first lines, and of later lines, from which the notation of numbers is decided
MAX_DATES = 200  # number of stamps from which it is known if dates can have two orders
DAY_S = 86_400.0
MONTH_S = 20 * DAY_S  # step between two records that is one of months [s]
MIN_WEAK = 3  # number of steps of about a day, instead of a month, that decide the order of day and month
MIN_MIXED = 2  # number of stamps or steps that speak for each order from which a file has both
_SEPARATED = re.compile(r"[+-]?\d[\d.,' \u00a0\u202f]*[.,]\d[\d.,]*", re.ASCII)
_ORDER_WORDS = {"day_first": "day before month", "month_first": "month before day"}
_OTHER: dict[DateOrder, DateOrder] = {"day_first": "month_first", "month_first": "day_first"}


@dataclass(frozen=True)
class Row:
    """A line of a log that has one field for each column."""

    line: int
    fields: list[str]
    layout: Layout


class UndecidedOrderError(InputError):
    """A file whose dates can be read in two orders, and that does not decide between them."""


def settle(lines: Sequence[bytes], logger: LoggerFormat, path: Path) -> tuple[LoggerFormat, tuple[str, ...]]:
    """A format with all decisions that a file allows, and these decisions in words.

    :raises InputError: if a file can be read in two ways, and nothing decides
    """
    if logger.checksum != "none":
        return logger, ()  # a protocol is not written by spreadsheets
    choices = []
    form = separated_as(logger, lines)
    if form.delimiter != logger.delimiter:
        choices.append(f"columns are separated by {form.delimiter}, not by {logger.delimiter}")
    every = range(len(lines))
    step = max(len(lines) // MAX_SAMPLE, 1)
    sample = every if len(lines) <= 2 * MAX_SAMPLE else [*every[:MAX_SAMPLE], *every[MAX_SAMPLE::step]]
    rows = list(_rows(lines, sample, form))
    form, chosen = _with_decimal(form, rows, path)
    choices += chosen
    form, chosen = _with_position(form, rows)
    choices += chosen
    if form.time.date_order == "auto" and any(
        _readings(form, row) for row in rows[:: max(len(rows) // MAX_DATES, 1)]
    ):
        rows = rows if sample is every else list(_rows(lines, every, form))
        order, why = _date_order(form, rows, path)
        form = form.model_copy(update={"time": form.time.model_copy(update={"date_order": order})})
        choices.append(f"dates have the {_ORDER_WORDS[order]}: {why}")
    return form, tuple(choices)


def _rows(lines: Sequence[bytes], numbers: Sequence[int], logger: LoggerFormat) -> Iterator[Row]:
    header, layout, comment = HeaderReader(logger), None, logger.header.comment
    for number in numbers:
        text = decode_line(lines[number]).strip("\r\n")
        if len(text) > MAX_LINE or not text.strip():
            continue
        if comment and text.lstrip().startswith(comment):
            header.take_comment(text.lstrip()[len(comment) :])
            continue
        fields = split_fields(logger, text)
        if header.takes(fields):
            continue
        if header.is_new:
            header.is_new = False
            try:
                layout = build_layout(logger, header.names, header.units)
            except MissingColumnsError:
                layout = None
        if layout is not None and (fitted := layout.fit(fields)) is not None:
            yield Row(number + 1, fitted, layout)


def _with_decimal(logger: LoggerFormat, rows: Sequence[Row], path: Path) -> tuple[LoggerFormat, list[str]]:
    if logger.decimal != "auto":
        return logger, []
    votes: dict[Decimal, list[tuple[str, int]]] = {"point": [], "comma": []}
    unclear: list[tuple[str, int, str]] = []
    for row in rows:
        layout, whole = row.layout, set(row.layout.counts) if logger.counts.unit == "counts" else set()
        places = [layout.position[name] for name in ("latitude", "longitude")] if layout.position else []
        live = [source for source in layout.live if source is not None]
        sources = [*layout.counts, *live, *layout.pressure, *layout.temperature, *layout.humidity, *places]
        for source in sources:
            text = row.fields[source.index]
            if not _SEPARATED.fullmatch(text):
                continue
            meaning = decimal_of(text, source in whole)
            if meaning == "auto":
                unclear.append((text, row.line, source.name))
            else:
                votes[meaning].append((text, row.line))
    commas = len(votes["comma"])
    if not commas and not (unclear or any("," in text for text, _ in votes["point"])):
        return logger, []
    if not commas and not votes["point"] and unclear:
        text, line, column = unclear[0]
        big, small = text.replace(",", ""), text.replace(",", ".")
        remedy = "write 'decimal: point' or 'decimal: comma' in the logger format"
        raise InputError(
            [Mistake(f"{text!r} can be {big} or {small}, and no value decides", remedy, path, line, column)]
        )
    decimal: Decimal = "comma" if commas > len(votes["point"]) else "point"
    words = "decimal commas" if decimal == "comma" else "commas separate thousands"
    examples = [*votes[decimal], *(one[:2] for one in unclear)]
    text, line = next(one for one in examples if "," in one[0])
    choice = f"{words}, as in line {line}: {text!r} is {read_number(text, decimal):.10g}"
    return logger.model_copy(update={"decimal": decimal}), [choice]


def decimal_of(text: str, whole: bool = False) -> Decimal:
    """Decimal separator of a number that has a point or comma; ``auto`` if a comma may be of both kinds.

    >>> decimal_of("985,3"), decimal_of("1.234,5"), decimal_of("1,649"), decimal_of("1,649", whole=True)
    ('comma', 'comma', 'auto', 'point')
    """
    points, commas = text.count("."), text.count(",")
    if points and commas:
        return "comma" if text.rfind(",") > text.rfind(".") else "point"
    if points:
        return "comma" if points > 1 else "point"
    if commas > 1 or not commas:
        return "point"
    before, after = text.lstrip("+-").split(",")
    grouped = len(after) == 3 and 1 <= len(before) <= 3 and before[0] != "0"
    return "comma" if not grouped else "point" if whole else "auto"


def _with_position(logger: LoggerFormat, rows: Sequence[Row]) -> tuple[LoggerFormat, list[str]]:
    place, choices = logger.position, []
    if place is None:
        return logger, []
    pairs = []
    unnamed = False
    for row in rows:
        layout = row.layout.position
        if layout is None:
            continue
        latitude, longitude = (row.fields[layout[name].index] for name in ("latitude", "longitude"))
        unnamed = unnamed or (
            "latitude_hemisphere" not in layout and latitude[-1:].upper() in ("N", "S") and latitude[:1].isdigit()
        )
        if read_coordinate(latitude, decimal=logger.decimal):
            pairs.append((latitude, longitude, row.line))
    if not pairs:
        return logger, []
    if unnamed:
        choices.append("letters N, S, E or W follow the coordinates and give their sign")
    notation = place.notation
    if notation == "auto":
        packed = [pair for pair in pairs if is_packed(pair[0], logger.decimal)]
        notation = "degrees_minutes" if 2 * len(packed) > len(pairs) else "degrees"
        if notation == "degrees_minutes":
            text = packed[0][0]
            value = read_coordinate(text, packed=True, decimal=logger.decimal)
            choices.append(
                f"coordinates are degrees and minutes, as in line {packed[0][2]}: {text!r} is {value:.5f} degrees"
            )
    wrapped = next(
        (
            pair
            for pair in pairs
            if 180 < (read_coordinate(pair[1], notation == "degrees_minutes", logger.decimal) or 0) <= 360
        ),
        None,
    )
    if wrapped is not None:
        value = read_coordinate(wrapped[1], notation == "degrees_minutes", logger.decimal) or math.nan
        choices.append(
            f"longitudes count from 0 to 360, as in line {wrapped[2]}: {wrapped[1]!r} is {value - 360:.5f} degrees"
        )
    return logger.model_copy(update={"position": place.model_copy(update={"notation": notation})}), choices


def is_packed(text: str, decimal: Decimal = "auto") -> bool:
    """True if a latitude can only be degrees and minutes in one number, as 5121.0 is."""
    digits = re.match(r"\d*", text.strip("NSEWnsew +-"))
    packed = read_coordinate(text, packed=True, decimal=decimal)
    plain = read_coordinate(text, decimal=decimal)
    if packed is None or plain is None or digits is None:
        return False
    return abs(packed) <= 90 and (abs(plain) > 90 or len(digits[0]) >= 4)


def _readings(logger: LoggerFormat, row: Row) -> dict[DateOrder, float]:
    """Time of a row in each order of day and month that reads it [s]."""
    text = stamp_text(row.fields, row.layout)
    found: dict[DateOrder, float] = {}
    for order in _OTHER:
        formats = [name for name in logger.time.rivals if order_of(name) == order]
        stamp_s = read_time(text, formats) if formats else None
        if stamp_s is not None:
            found[order] = stamp_s
    return found


def stamp_text(fields: Sequence[str], layout: Layout) -> str:
    """Text of the stamp of a line, of one or more columns."""
    return " ".join(fields[source.index].strip() for source in layout.time)


def _date_order(logger: LoggerFormat, rows: Sequence[Row], path: Path) -> tuple[DateOrder, str]:
    """Order of day and month in a file, and the reason."""
    read = [(row, found) for row in rows if (found := _readings(logger, row))]
    evidence: dict[DateOrder, list[Row]] = {"day_first": [], "month_first": []}
    weak: dict[DateOrder, list[Row]] = {"day_first": [], "month_first": []}
    for row, found in read:
        if len(found) == 1:
            evidence[next(iter(found))].append(row)
    both = [(row, found) for row, found in read if len(found) == 2]
    steps = [{order: b[order] - a[order] for order in _OTHER} for (_, a), (_, b) in pairwise(both)]
    usual_s = median([min(abs(value) for value in step.values()) for step in steps]) if steps else math.nan
    for (row, _), step in zip(both[1:], steps, strict=True):
        for order, other in _OTHER.items():
            if abs(step[other]) > MONTH_S and 0 < step[order] < 3 * DAY_S:
                weak[order].append(row)
                if step[order] <= 1.2 * usual_s:
                    evidence[order].append(row)
    for order in _OTHER:
        evidence[order] += weak[order] if len(weak[order]) >= MIN_WEAK and not evidence[order] else []
    counts = {order: len(found) for order, found in evidence.items()}
    if min(counts.values()) >= MIN_MIXED:
        first = {order: found[0] for order, found in evidence.items()}
        texts = [f"{_ORDER_WORDS[order]} in line {row.line}" for order, row in first.items()]
        remedy = "a spreadsheet may have changed some dates: give the file as the logger wrote it"
        message = f"dates are in both orders: {' and '.join(texts)}"
        raise InputError([Mistake(message, remedy, path, max(row.line for row in first.values()))])
    if counts["day_first"] != counts["month_first"]:
        winner: DateOrder = max(_OTHER, key=lambda order: counts[order])
        row = evidence[winner][0]
        text = stamp_text(row.fields, row.layout)
        alone = len(_readings(logger, row)) == 1
        why = "has no other reading" if alone else "would else lie a month or more from the line before"
        return winner, f"{text!r} in line {row.line} {why}"
    row, found = both[0] if both else read[0]
    text = stamp_text(row.fields, row.layout)
    texts = [f"{date_text(found[order])} ({_ORDER_WORDS[order]})" for order in _OTHER if order in found]
    remedy = (
        "write 'date_order: day_first' or 'date_order: month_first' below 'time' in a copy of the logger format "
        "(soilmoist logger FILE writes one)"
    )
    message = f"{text!r} is {' or '.join(texts)}, and no stamp decides"
    raise UndecidedOrderError([Mistake(message, remedy, path, row.line)])


def date_text(stamp_s: float) -> str:
    """Date in words, such as 1 May 2024."""
    from datetime import UTC, datetime

    moment = datetime.fromtimestamp(stamp_s, UTC)
    return f"{moment.day} {moment:%B %Y}"


HEADER_LINES = 200


def separated_as(logger: LoggerFormat, lines: Sequence[bytes]) -> LoggerFormat:
    """The format with the separator by which the first lines have its columns; unchanged if none does."""
    for delimiter in (
        logger.delimiter,
        *(one for one in ("semicolon", "comma", "tab") if one != logger.delimiter),
    ):
        form = logger if delimiter == logger.delimiter else logger.model_copy(update={"delimiter": delimiter})
        if any(_number_of_sources(form, names) for names in header_candidates(form, lines)):
            return form
    return logger


def header_candidates(logger: LoggerFormat, lines: Sequence[bytes]) -> list[list[str]]:
    """Lists of column names in the first lines of a file, if it has this format."""
    found: list[list[str]] = []
    comment = logger.header.comment
    continued = {plain_name(name) for name in logger.header.continued_by}
    for line in lines[:HEADER_LINES]:
        text = decode_line(line).strip()
        if logger.checksum == "nmea":
            text = text.partition("*")[0]
        if comment:
            text = text.removeprefix(comment)
        names = [name for name in split_fields(logger, text) if name]
        if is_header(logger, names):
            found.append(names)
        elif found and names and plain_name(names[0]) in continued:
            found[-1] = found[-1] + names
    return found


def matching_formats(lines: Sequence[bytes]) -> list[str]:
    """Names of the formats whose columns are in the first lines, best match first."""
    matches = []
    for name in logger_names():
        logger = separated_as(_known_format(name), lines)
        best = max((_number_of_sources(logger, names) for names in header_candidates(logger, lines)), default=0)
        if best:
            matches.append((-best, name))
    return [name for _, name in sorted(matches)]


@cache
def _known_format(name: str) -> LoggerFormat:
    return load_logger_format(name)


def _number_of_sources(logger: LoggerFormat, names: Sequence[str]) -> int:
    try:
        return build_layout(logger, names).number_of_sources
    except MissingColumnsError:
        return 0
