# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Notation of a file: separator, decimal sign, coordinates, order of day and month; formats that fit a header."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

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
MIN_MIXED = 2  # number of stamps or steps that speak for each order from which a file has both
HEADER_LINES = 200
_SEPARATED = re.compile(r"[+-]?\d[\d.,' \u00a0\u202f]*[.,]\d[\d.,]*", re.ASCII)
_ORDER_WORDS = {"day_first": "day before month", "month_first": "month before day"}
_OTHER: dict[DateOrder, DateOrder] = {"day_first": "month_first", "month_first": "day_first"}


class Row(NamedTuple):
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
    choices: list[str] = []
    form = separated_as(logger, lines)
    if form.delimiter != logger.delimiter:
        choices.append(f"columns are separated by {form.delimiter}, not by {logger.delimiter}")
    every = range(len(lines))
    step = max(len(lines) // MAX_SAMPLE, 1)
    sample = every if len(lines) <= 2 * MAX_SAMPLE else [*every[:MAX_SAMPLE], *every[MAX_SAMPLE::step]]
    rows = list(_rows(lines, sample, form))
    if form.decimal == "auto":
        form = _with_decimal(form, rows, path, choices)
    form = _with_position(form, rows, choices)
    some = rows[:: max(len(rows) // MAX_DATES, 1)]
    if form.time.date_order == "auto" and any(_readings(form, row) for row in some):
        rows = rows if sample is every else list(_rows(lines, every, form))
        order, why = _date_order(form, rows, path)
        form = form.model_copy(update={"time": form.time.model_copy(update={"date_order": order})})
        choices.append(f"dates have the {_ORDER_WORDS[order]}: {why}")
    return form, tuple(choices)


def _rows(lines: Sequence[bytes], numbers: Sequence[int], logger: LoggerFormat) -> Iterator[Row]:
    header, layout = HeaderReader(logger), None
    for number in numbers:
        text = decode_line(lines[number]).strip("\r\n")
        fields = header.fields_of(text) if text.strip() and len(text) <= MAX_LINE else None
        if fields is None:
            continue
        if header.is_new:
            header.is_new = False
            try:
                layout = build_layout(logger, header.names, header.units)
            except MissingColumnsError:
                layout = None
        if layout is not None and (fitted := layout.fit(fields)) is not None:
            yield Row(number + 1, fitted, layout)


def _with_decimal(logger: LoggerFormat, rows: Sequence[Row], path: Path, choices: list[str]) -> LoggerFormat:
    votes: dict[Decimal, list[tuple[str, int, str]]] = {"point": [], "comma": [], "auto": []}
    for row in rows:
        layout = row.layout
        whole = layout.counts if logger.counts.unit == "counts" else ()
        places = [layout.position[name] for name in ("latitude", "longitude")] if layout.position else []
        for source in (*layout.values, *places):
            text = row.fields[source.index]
            if _SEPARATED.fullmatch(text):
                votes[decimal_of(text, source in whole)].append((text, row.line, source.name))
    if votes["auto"] and not votes["comma"] and not votes["point"]:
        text, line, column = votes["auto"][0]
        message = f"{text!r} can be {text.replace(',', '')} or {text.replace(',', '.')}, and no value decides"
        remedy = "write 'decimal: point' or 'decimal: comma' in the logger format"
        raise InputError([Mistake(message, remedy, path, line, column)])
    decimal: Decimal = "comma" if len(votes["comma"]) > len(votes["point"]) else "point"
    with_comma = [one for one in (*votes[decimal], *votes["auto"]) if "," in one[0]]
    if not with_comma:
        return logger
    text, line, _ = with_comma[0]
    words = "decimal commas" if decimal == "comma" else "commas separate thousands"
    choices.append(f"{words}, as in line {line}: {text!r} is {read_number(text, decimal):.10g}")
    return logger.model_copy(update={"decimal": decimal})


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


def _with_position(logger: LoggerFormat, rows: Sequence[Row], choices: list[str]) -> LoggerFormat:
    place, decimal = logger.position, logger.decimal
    pairs: list[tuple[str, str, int]] = []
    lettered = False
    for row in rows:
        if not (columns := row.layout.position):
            continue
        latitude, longitude = (row.fields[columns[name].index] for name in ("latitude", "longitude"))
        is_lettered = latitude[:1].isdigit() and latitude[-1:].upper() in ("N", "S")
        lettered |= is_lettered and "latitude_hemisphere" not in columns
        if read_coordinate(latitude, decimal=decimal):
            pairs.append((latitude, longitude, row.line))
    if place is None or not pairs:
        return logger
    if lettered:
        choices.append("letters N, S, E or W follow the coordinates and give their sign")
    notation = place.notation
    if notation == "auto":
        packed = [pair for pair in pairs if is_packed(pair[0], decimal)]
        notation = "degrees_minutes" if 2 * len(packed) > len(pairs) else "degrees"
        if notation == "degrees_minutes":
            text, _, line = packed[0]
            words = f"{text!r} is {read_coordinate(text, packed=True, decimal=decimal):.5f} degrees"
            choices.append(f"coordinates are degrees and minutes, as in line {line}: {words}")
    for _, text, line in pairs:
        value = read_coordinate(text, notation == "degrees_minutes", decimal) or 0.0
        if 180 < value <= 360:
            words = f"{text!r} is {value - 360:.5f} degrees"
            choices.append(f"longitudes count from 0 to 360, as in line {line}: {words}")
            break
    return logger.model_copy(update={"position": place.model_copy(update={"notation": notation})})


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
    text, rivals = stamp_text(row.fields, row.layout), logger.time.rivals
    found = {order: read_time(text, [name for name in rivals if order_of(name) == order]) for order in _OTHER}
    return {order: stamp_s for order, stamp_s in found.items() if stamp_s is not None}


def stamp_text(fields: Sequence[str], layout: Layout) -> str:
    """Text of the stamp of a line, of one or more columns."""
    return " ".join(fields[source.index].strip() for source in layout.time)


def _date_order(logger: LoggerFormat, rows: Sequence[Row], path: Path) -> tuple[DateOrder, str]:
    """Order of day and month in a file, and the reason.

    A stamp that one order reads decides, and a step as usual that is one of months in the other order.
    """
    read = [(row, found) for row in rows if (found := _readings(logger, row))]
    both = [(row, found) for row, found in read if len(found) == 2]
    evidence: dict[DateOrder, list[Row]] = {
        order: [row for row, found in read if list(found) == [order]] for order in _OTHER
    }
    n_alone = {order: len(found) for order, found in evidence.items()}
    steps = [{order: b[order] - a[order] for order in _OTHER} for (_, a), (_, b) in pairwise(both)]
    usual_s = median([min(map(abs, step.values())) for step in steps]) if steps else math.nan
    for (row, _), step in zip(both[1:], steps, strict=True):
        for order, other in _OTHER.items():
            if abs(step[other]) > MONTH_S and 0 < step[order] < 3 * DAY_S and step[order] <= 1.2 * usual_s:
                evidence[order].append(row)
    low, high = sorted(_OTHER, key=lambda order: len(evidence[order]))
    if len(evidence[low]) >= MIN_MIXED:
        first = {order: found[0].line for order, found in evidence.items()}
        texts = " and ".join(f"{_ORDER_WORDS[order]} in line {line}" for order, line in first.items())
        remedy = "a spreadsheet may have changed some dates: give the file as the logger wrote it"
        message = f"dates are in both orders: {texts}"
        raise InputError([Mistake(message, remedy, path, max(first.values()))])
    if len(evidence[high]) > len(evidence[low]):
        row = evidence[high][0]
        why = "has no other reading" if n_alone[high] else "would else lie a month or more from the line before"
        return high, f"{stamp_text(row.fields, row.layout)!r} in line {row.line} {why}"
    row, found = both[0] if both else read[0]
    dates = " or ".join(f"{date_text(found[order])} ({_ORDER_WORDS[order]})" for order in _OTHER if order in found)
    remedy = (
        "write 'date_order: day_first' or 'date_order: month_first' below 'time' in a copy of the logger format "
        "(soilmoist logger FILE writes one)"
    )
    message = f"{stamp_text(row.fields, row.layout)!r} is {dates}, and no stamp decides"
    raise UndecidedOrderError([Mistake(message, remedy, path, row.line)])


def date_text(stamp_s: float) -> str:
    """Date in words, such as 1 May 2024."""
    moment = datetime.fromtimestamp(stamp_s, UTC)
    return f"{moment.day} {moment:%B %Y}"


def separated_as(logger: LoggerFormat, lines: Sequence[bytes]) -> LoggerFormat:
    """The format with the separator by which the first lines have its columns; unchanged if none does."""
    for delimiter in dict.fromkeys((logger.delimiter, "semicolon", "comma", "tab")):
        form = logger if delimiter == logger.delimiter else logger.model_copy(update={"delimiter": delimiter})
        if _number_of_sources(form, lines):
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
        names = [name for name in split_fields(text.removeprefix(comment), logger.delimiter) if name]
        if is_header(logger, names):
            found.append(names)
        elif found and names and plain_name(names[0]) in continued:
            found[-1] = found[-1] + names
    return found


def matching_formats(lines: Sequence[bytes]) -> list[str]:
    """Names of the formats whose columns are in the first lines, best match first."""
    matches = {
        name: _number_of_sources(separated_as(_known_format(name), lines), lines) for name in logger_names()
    }
    return sorted((name for name in matches if matches[name]), key=lambda name: (-matches[name], name))


@cache
def _known_format(name: str) -> LoggerFormat:
    return load_logger_format(name)


def _number_of_sources(logger: LoggerFormat, lines: Sequence[bytes]) -> int:
    """Number of columns with a known quantity in the best header, 0 if columns are missing."""
    best = 0
    for names in header_candidates(logger, lines):
        try:
            best = max(best, build_layout(logger, names).number_of_sources)
        except MissingColumnsError:
            continue
    return best
