# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drafts a logger format from a file: columns are guessed, each with its reason, and questions are asked."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from statistics import median

from soilmoist_ros.foundation import InputError, listing
from soilmoist_ros.sensing.formats import log_values as units
from soilmoist_ros.sensing.formats.log_layout import build_layout, plain_name, split_text
from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
)
from soilmoist_ros.sensing.formats.logger_format import MISSING, load_logger_format, order_of
from soilmoist_ros.sensing.formats.notation import matching_formats
from soilmoist_ros.sensing.lines import read_lines

MAX_LINES = 2_000
"""Number of lines from which a format is drafted."""
_COUNT_NAME = re.compile(
    r"neutron|count|cts|unmo|(^|_)imp(_|/|$)|(^|_)n\d*(_?c)?$|cps|cph|moderated|(^|_)mod(_|$)|epi|puls|crns"
)
_NO_COUNT = re.compile(
    r"std|err|unc|flag|muon|gamma|light|strike|volt|^rn$|record|rain|prec|sat|drop|number|coeff|sqrt|_se$|_sd$|swc|swe|_z$"
)
_CHANGED = re.compile(r"corr|smooth|mov_?avg|filtered|norm")
_BARE = re.compile(r"bare|(?<!epi)thermal|slow|unmo|_b$")
_LIVE = re.compile(
    r"integration|et_?sec|n\d+et|livetime|live_?s|exposure|duration|counting|inttime|messzeit|_et|period"
)
_PRESSURE = re.compile(r"press|baro|^pa$|^p\d*(_|$|\()|_mb|ptb|luftdruck|druck|^bp|hpa|mbar")
_TEMPERATURE = re.compile(r"temp|^t\d*(_|$|\()|airt|_degc|tair|^ta$|^tem$")
_HUMIDITY = re.compile(r"rh|hum|^ur(\(|%|_|$)|feuchte|hygro")
_NO_WEATHER = re.compile(r"soil|vwc|moist|boden|probe|dew|panel|batt|abs|std|flag|vapo|tilt|wet")
_OUTSIDE = re.compile(r"ext|out|cs215|air|ptb|hmp|2m")
_INSIDE = re.compile(r"int|_in\b|in\(|inside|box|panel|ptemp|logger|n\d")
_CREDIBLE: dict[units.Quantity, tuple[float, float]] = {
    "pressure": (400, 1100),
    "temperature": (-50, 60),
    "humidity": (0, 1.05),
}
"""Medians that a log can have [hPa, degC, fraction]."""
_SIDES = {"N", "S", "E", "W"}


@dataclass(frozen=True)
class Column:
    """A column of the file.

    :param name: its name in the header
    :param texts: its fields in the first lines, without missing ones
    :param unit: its unit in the header, empty if unknown
    """

    name: str
    texts: tuple[str, ...]
    unit: str = ""

    @property
    def low(self) -> str:
        """Name in small letters, with blanks as underscores."""
        return re.sub(r"[\s.-]+", "_", self.name.casefold().strip())


@dataclass(frozen=True)
class Table:
    """The first lines of a file, as columns.

    :param keys: keys of the format that describe the notation
    :param columns: the columns in order
    :param decimal: decimal separator
    """

    keys: dict[str, object]
    columns: tuple[Column, ...]
    decimal: str

    def numbers(self, column: Column) -> list[float]:
        """Values of a column, as far as they are numbers."""
        found = (read_number(text, "comma" if self.decimal == "comma" else "point") for text in column.texts)
        return [value for value in found if value is not None]

    def is_numeric(self, column: Column) -> bool:
        """True if almost all of a column is numbers."""
        return bool(column.texts) and len(self.numbers(column)) > 0.9 * len(column.texts)


def draft_format(path: Path, time: Sequence[str] = (), counts: Sequence[str] = ()) -> str:
    """The YAML text of a logger format for a file; every guess has a reason, and each doubt is a question.

    :param path: a log
    :param time: columns of the stamp, where the guess would be wrong: one, or date and time
    :param counts: columns of the counts, where the guess would be wrong
    :raises InputError: if the file has no table, no time or no counts: says what has to be answered first
    """
    lines, _ = read_lines(path)
    step = max(len(lines) // MAX_LINES, 1)
    table = _table([*lines[:MAX_LINES], *lines[MAX_LINES::step]], path)
    names = [column.name for column in table.columns]
    for given in (*time, *counts):
        if plain_name(given) not in map(plain_name, names):
            raise InputError(f"there is no column {given!r}", f"the columns are {listing(names)}", path)
    header = table.keys["header"]
    unnamed = isinstance(header, dict) and "columns" in header
    if unnamed and counts:
        tubes = {plain_name(name): f"n{number}" for number, name in enumerate(counts, 1)}
        columns = tuple(replace(one, name=tubes.get(plain_name(one.name), one.name)) for one in table.columns)
        header = {"columns": [one.name for one in columns]}
        table, counts = (
            replace(table, columns=columns, keys={**table.keys, "header": header}),
            tuple(tubes.values()),
        )
    draft = [f"# Draft of a logger format from {path.name}. Check each line, and answer each QUESTION."]
    if known := matching_formats(lines):
        shipped = build_layout(load_logger_format(known[0]), names, [column.unit for column in table.columns])
        but = f"; it does not read {listing(shipped.unused)}" if shipped.unused else ": it may be all you need"
        draft.append(f"# The shipped format {known[0]} reads this file as well{but}.")
    draft += [f"title: {_quoted(path.stem)}", f"source: {_quoted(f'drafted from {path.name}')}"]
    draft += [f"{key}: {json.dumps(value)}" for key, value in table.keys.items() if key != "header"]
    draft.append(f"header: {json.dumps(header, ensure_ascii=False)}")
    if unnamed:
        firsts = ", ".join(f"{one.name} {one.texts[0]}" for one in table.columns if one.texts)
        draft.append(f"# QUESTION: the file does not name its columns. What are they? The first values: {firsts}")
    stamps, used = _time(table, draft, time, path)
    used |= _counts(table, draft, counts, used, path)
    used |= _live_time(table, draft, stamps, used)
    weather: tuple[tuple[units.Quantity, re.Pattern[str], Callable[[list[float]], str]], ...] = (
        ("pressure", _PRESSURE, _pressure_unit),
        ("temperature", _TEMPERATURE, _temperature_unit),
        ("humidity", _HUMIDITY, _humidity_unit),
    )
    for quantity, name, check in weather:
        used |= _sensors(table, draft, quantity, name, check, used)
    used |= _position(table, draft, used)
    if unused := [column.name for column in table.columns if column.name and column.name not in used]:
        draft.append(f"# Not used: {', '.join(unused)}.")
    return "\n".join(draft) + "\n"


def _table(lines: Sequence[bytes], path: Path) -> Table:
    """Separator, header and columns of the first lines."""
    texts = [(number, decode_line(line).strip("\r\n\x00\x1a")) for number, line in enumerate(lines, 1)]
    texts = [(number, text) for number, text in texts if text.strip()]
    marked = [text[:2] if text.startswith("//") else text[:1] for _, text in texts if text.lstrip()[:1] in "/#%"]
    comment = Counter(marked).most_common(1)[0][0] if marked else ""
    body = [text for _, text in texts if not (comment and text.startswith(comment))]
    if not body:
        raise InputError("has no line of a table", "give a log with records", path)

    def shape(delimiter: str) -> tuple[float, int]:
        sizes = Counter(len(split_text(text, delimiter)) for text in body[-200:])
        size, count = max(sizes.items(), key=lambda item: (item[1], item[0]))
        return (count / sum(sizes.values()) if size > 1 else 0.0, size)

    # Semicolons and tabs first: commas may be decimal commas there.
    choices = ["semicolon", "tab", "comma", "whitespace"]
    delimiter = max(choices, key=lambda one: (shape(one)[0] > 0.8, shape(one)[0] > 0.8 and -choices.index(one)))
    share, size = shape(delimiter)
    if share < 0.5:
        raise InputError(
            "has no table with equal numbers of columns", "give the file as the logger wrote it", path
        )
    split = [row for text in body if any(row := split_text(text, delimiter))]
    rows = [[*row[:size], *[""] * (size - len(row))] for row in split]
    is_toa5 = rows[0][0].upper() == "TOA5"
    whole = [
        row for row, fields in zip(rows, split, strict=True) if len(fields) >= size and not any(fields[size:])
    ]
    whole = [row for row in whole if not (is_toa5 and row is rows[0])]
    data = [
        row for row in whole if sum(bool(re.search(r"\d", field)) for field in row) > 0.5 * sum(map(bool, row))
    ]
    data = [row for row in data if any(_is_stamp(field) or read_number(field) is not None for field in row)]
    first = rows.index(data[0]) if data else len(rows)
    heads = [row for row in rows[:first] if sum(map(bool, row)) >= 0.5 * size]
    header: dict[str, object] = {"comment": comment} if comment else {}
    names, given = [""] * size, [""] * size
    marks = [
        split_text(text.removeprefix(comment), delimiter)
        for _, text in texts
        if comment and text.startswith(comment)
    ]
    marks = [row if row[-1] else row[:-1] for row in marks]
    joined = [[*one, *other] for one, other in pairwise(marks)]
    candidates = [row for row in (*joined, *marks) if abs(len(row) - size) <= 2]
    if is_toa5:
        header["environment"] = ["TOA5", "station", "model", "serial", "os", "program", "signature", "table"]
        heads = rows[1:first]
    if heads:
        names = heads[0]
        if len(heads) > 1:
            header |= {"lines_after_names": len(heads) - 1}
            if any(map(units.canonical, heads[1])):
                header["units_line"], given = True, heads[1]
    elif candidates:
        names = [*candidates[-1], *[""] * size][:size]
        if candidates[-1] in joined:
            header["continued_by"] = [marks[joined.index(candidates[-1]) + 1][0]]
    else:
        names = [f"column{number}" for number in range(1, size + 1)]
        header["columns"] = names
    missing = {text.casefold() for text in MISSING} | {"", "-99", "-99.0"}
    columns = tuple(
        Column(name, tuple(row[index] for row in data if row[index].casefold() not in missing), given[index])
        for index, name in enumerate(names)
    )
    commas = sum(bool(re.fullmatch(r"[+-]?\d+,\d+", text)) for column in columns for text in column.texts[:200])
    decimal = "comma" if commas and delimiter != "comma" else "point"
    keys: dict[str, object] = {"delimiter": delimiter, **({"decimal": "comma"} if decimal == "comma" else {})}
    return Table({**keys, "header": header}, columns, decimal)


def _is_stamp(text: str) -> bool:
    return bool(re.search(r"\d[-/.:]\d", text)) and bool(likely_time_formats(text))


def _time(table: Table, draft: list[str], given: Sequence[str], path: Path) -> tuple[list[float], set[str]]:
    """Write the section of the time; the stamps, and the names of the columns."""
    columns = [column for column in table.columns if column.texts]
    chosen = [column for name in given for column in columns if plain_name(column.name) == plain_name(name)]
    by_name = sorted(columns, key=lambda one: not re.search(r"time|date|stamp|datum|zeit|utc", one.low))
    tried = [chosen] if chosen else [
        *([column] for column in by_name if ":" in column.texts[0]),
        *([one, other] for one in by_name for other in by_name if one is not other and ":" in other.texts[0]),
        *([column] for column in by_name if re.search(r"time|date|stamp|unix|epoch", column.low)),
        *([column] for column in by_name if re.search(r"[-/.]", column.texts[0])),
    ]  # fmt: skip
    for parts in tried:
        if not parts or any(len(part.texts) < len(parts[0].texts) for part in parts):
            continue
        texts = [" ".join(fields) for fields in zip(*(part.texts for part in parts), strict=False)]
        likely = likely_time_formats(texts[0])
        formats = [name for name in likely if all(read_time(text, [name]) is not None for text in texts)]
        if formats:
            break
    else:
        names = listing(column.name for column in columns)
        remedy = f"say which column has it: --time NAME, or --time DATE --time TIME; the columns are {names}"
        raise InputError("has no column that is read as a time", remedy, path)
    orders = {order_of(name) for name in formats}
    formats = formats if {"day_first", "month_first"} <= orders else formats[:1]
    name = " + ".join(part.name for part in parts)
    draft += ["time:", f"  columns: [{_quoted(name)}]  # {texts[0]!r} is read as a time in all lines"]
    draft.append(f"  formats: {json.dumps(formats)}")
    if len(formats) > 1:
        draft.append("  date_order: auto  # QUESTION: day_first or month_first? Each file decides, or is refused")
    draft.append("  marks: end  # QUESTION: start or end of the counting interval?")
    zoned = read_time(texts[0], formats[:1], 0.0) == read_time(texts[0], formats[:1], 1.0)
    if not zoned and not re.search(r"utc|gmt", name.casefold()):
        draft.append("  utc_offset_hours: 0  # QUESTION: UTC? Else its offset, or instead 'zone: Europe/Berlin'")
    stamps = [stamp for text in texts if (stamp := read_time(text, formats[:1])) is not None]
    return stamps, {part.name for part in parts}


def _counts(table: Table, draft: list[str], given: Sequence[str], used: set[str], path: Path) -> set[str]:
    free = [column for column in table.columns if column.name not in used and table.is_numeric(column)]
    chosen = [column for name in given for column in free if plain_name(column.name) == plain_name(name)]
    by_name = [
        column
        for column in free
        if _COUNT_NAME.search(column.low)
        and not (_NO_COUNT.search(column.low) or _LIVE.search(column.low))
        and min(table.numbers(column)) >= 0
    ]
    changed = [column for column in by_name if _CHANGED.search(column.low)]
    by_name = [column for column in by_name if column not in changed]
    found = chosen or [column for column in by_name if not _BARE.search(column.low)] or by_name
    if not found:
        firsts = listing(f"{column.name} ({column.texts[0]})" for column in free)
        names = listing(column.name for column in changed)
        but = (
            f", only corrected or smoothed ones ({names}), which lost their counting statistics" if changed else ""
        )
        remedy = (
            f"say which column has them: --neutrons NAME, repeatable; columns of numbers, with the first: {firsts}"
        )
        raise InputError(f"has no column that is by its name one of raw counts of neutrons{but}", remedy, path)
    whole = all(value == int(value) for column in found for value in table.numbers(column))
    pattern = _pattern([column.name for column in found], [column.name for column in table.columns])
    bare = [column.name for column in by_name if column not in found]
    first = found[0]
    draft.append("counts:")
    why = "as you said" if chosen else "by their names"
    columns = [pattern] if pattern else [first.name]
    draft.append(f"  columns: [{', '.join(map(_quoted, columns))}]  # {listing(one.name for one in found)}: {why}")
    if not pattern and len(found) > 1:
        others = listing(one.name for one in found[1:])
        draft.append(f"  # QUESTION: only {first.name} is read; is it the moderated detector, and not {others}?")
    unit = units.rate_of(first.unit) or units.rate_of(first.name)
    if whole and not unit:
        draft.append("  unit: counts  # all values are whole numbers")
    elif whole:
        draft.append(
            f"  unit: {unit}  # QUESTION: the header says so. If these are counts of a record, write counts"
        )
    else:
        unit = unit or "counts_per_hour"
        draft.append(
            f"  unit: {unit}  # QUESTION: no whole numbers. Take raw counts if there are any; which unit?"
        )
    if _CHANGED.search(first.low):
        draft.append(
            "  # QUESTION: raw counts? By its name they are corrected or smoothed, and would be corrected twice"
        )
    if pattern and len(found) > 1:
        draft.append("  # QUESTION: is one of the tubes bare (thermal)? Then leave it out, such as: left_out: [2]")
        means = (f"{one.name} {sum(values) / len(values):.4g}" for one in found if (values := table.numbers(one)))
        draft.append(
            f"  # Means of the columns: {listing(means)}; a bare tube counts about half of a moderated one."
        )
    if bare:
        draft.append(f"  # Not added, as bare (thermal): {', '.join(bare)}.")
    return {column.name for column in (found if pattern else found[:1])}


def _pattern(names: Sequence[str], every: Sequence[str]) -> str:
    """Common name of numbered columns with ``{tube}``; empty if there is none, or if others have it as well."""
    if len(names) < 2:
        return ""
    for match in re.finditer(r"\d+", names[0]):
        before, after = names[0][: match.start()], names[0][match.end() :]
        numbered = re.compile(re.escape(before) + r"\d+" + re.escape(after))
        if {name for name in every if numbered.fullmatch(name)} == set(names):
            return f"{before}{{tube}}{after}"
    return ""


def _live_time(table: Table, draft: list[str], stamps: Sequence[float], used: set[str]) -> set[str]:
    steps = [abs(after - before) for before, after in pairwise(stamps[: MAX_LINES // 2]) if after != before]
    step_s = median(steps) if steps else 3600.0
    taken = set()
    for column in table.columns:
        runs = [after - before for before, after in pairwise(table.numbers(column)[: MAX_LINES // 2])]
        if re.search(r"record|^rn$|^no$|^nr$|cycle|index", column.low) and runs.count(1.0) > 0.8 * len(runs) > 0:
            draft.append(
                f"record_number: [{_quoted(column.name)}]  # its numbers count up; gaps show lost records"
            )
            taken = {column.name}
            break
    for column in table.columns:
        if column.name in used or not _LIVE.search(column.low) or not table.is_numeric(column):
            continue
        values = [value for value in table.numbers(column) if value > 0]
        if not values:
            continue
        typical = median(values)
        scales = {"s": 1.0, "min": 60.0, "ms": 0.001, "h": 3600.0}
        unit = min(scales, key=lambda name: abs(typical * scales[name] / step_s - 0.97))
        draft.append("live_time:")
        stem = re.sub(r"\d+", "{tube}", column.name, count=1)
        same = [one.name for one in table.columns if re.sub(r"\d+", "{tube}", one.name, count=1) == stem]
        draft.append(f"  columns: [{_quoted(stem if stem != column.name else column.name)}]  # by its name")
        draft.append(f"  unit: {unit}  # so {typical:g} fits the usual time between records, {step_s:g} s")
        numbers = [int(match[0]) for name in same if (match := re.search(r"\d+", name))]
        if len(numbers) > 1 and (covers := min(after - before for before, after in pairwise(numbers))) > 1:
            draft.append(f"  covers: {covers}  # neighbouring tubes share a column")
        draft.append(f"record_period: {{default_s: {step_s:g}, minimal_live_fraction: 0}}")
        return taken | {column.name, *same}
    if taken and steps and max(steps) > 1.5 * min(steps):
        draft.append(
            "live_time: {from_stamps: true}  # no column has it; QUESTION: does the logger count all the time?"
        )
        draft.append("record_period: {}")
        return taken
    draft.append(
        f"record_period: {{default_s: {step_s:g}}}  # QUESTION: the usual time between records; is it counted?"
    )
    return taken


def _pressure_unit(values: list[float]) -> str:
    limits = {"hPa": (500, 1100), "kPa": (50, 110), "Pa": (50_000, 110_000), "inHg": (15, 32.5)}
    return next((unit for unit, (low, high) in limits.items() if low <= median(values) <= high), "")


def _temperature_unit(values: list[float]) -> str:
    middle = median(values)
    limits = {"degC": (-50, 42), "degF": (42, 120), "K": (220, 330)}
    return next((unit for unit, (low, high) in limits.items() if low < middle <= high), "")


def _humidity_unit(values: list[float]) -> str:
    return "" if min(values) < 0 or median(values) > 105 else "fraction" if max(values) <= 1.5 else "percent"


def _sensors(
    table: Table,
    draft: list[str],
    quantity: units.Quantity,
    name: re.Pattern[str],
    unit_of: Callable[[list[float]], str],
    used: set[str],
) -> set[str]:
    found, odd = [], []
    for column in table.columns:
        values = table.numbers(column)
        if column.name in used or not values or not name.search(column.low) or _NO_WEATHER.search(column.low):
            continue
        middle, named = median(values), column.unit or _unit_in(column.name)
        guess, written = unit_of(values), units.canonical(named)
        reason = f"so its median, {middle:.4g}, is credible"
        if written and units.measures(quantity, written):
            low, high = _CREDIBLE[quantity]
            if low <= units.converter(quantity, written)(middle) <= high:
                guess, reason = written, "unit of the header"
            else:
                reason = f"QUESTION: the header says {named}, which does not fit its median, {middle:.4g}"
        elif column.unit and not written:
            reason = f"QUESTION: the unit {column.unit!r} is unknown; its median is {middle:.4g}"
        elif quantity == "pressure" and 500 <= middle < 800:
            reason = f"QUESTION: or mmHg? Its median is {middle:.4g}"
        elif quantity == "humidity" and middle < 20 and guess == "percent":
            reason = f"QUESTION: relative humidity of the outside air? Its median, {middle:.4g} %, is low"
        if not guess:
            odd.append(f"{column.name} ({middle:.4g})")
        else:
            rank = bool(_INSIDE.search(column.low)) - bool(_OUTSIDE.search(column.low))
            found.append((rank, column.name, guess, reason))
    if not found and odd:
        draft.append(f"# QUESTION: which unit? No unit of the {quantity} fits the median of {listing(odd)}.")
        return set()
    if not found:
        draft.append(
            f"# No column of the {quantity}: its correction needs one, or has to be switched off in the site file."
        )
        return set()
    draft += [f"{quantity}:", "  sensors:"]
    for rank, column_name, unit, reason in sorted(found, key=lambda one: one[0]):
        where = ", perhaps inside the housing" if rank > 0 else ""
        draft.append(f"    - {{column: {_quoted(column_name)}, unit: {unit}}}  # by its name{where}; {reason}")
    if len(found) > 1:
        draft.append("  # QUESTION: is this the right order? In each record the first credible value is used.")
    return {column_name for _, column_name, _, _ in found}


def _unit_in(name: str) -> str:
    match = re.search(r"[(\[]([^)\]]+)[)\]]\s*$|_([A-Za-z%]+)$", name)
    return (match[1] or match[2]) if match else ""


def _position(table: Table, draft: list[str], used: set[str]) -> set[str]:
    def named(pattern: str) -> Column | None:
        return next((one for one in table.columns if one.name not in used and re.search(pattern, one.low)), None)

    latitude, longitude = named(r"^lat|_lat|latitude|breite"), named(r"^lon|_lon|^lng|longitude|l(ä|ae)nge")
    if latitude is None or longitude is None or not latitude.texts:
        return set()
    draft += ["position:", f"  latitude: [{_quoted(latitude.name)}]  # by their names"]
    draft.append(f"  longitude: [{_quoted(longitude.name)}]")
    taken = {latitude.name, longitude.name}
    sides = [one for one in table.columns if one.texts and {text.upper() for text in one.texts} <= _SIDES]
    values = [read_coordinate(text) for text in longitude.texts]
    signed = any(value is not None and (value < 0 or value > 180) for value in values)
    lettered = bool(sides) or longitude.texts[0][-1:].upper() in _SIDES
    if signed or lettered:
        draft.append("  longitude_signed: true")
    else:
        draft.append(
            "  longitude_signed: false  # none is negative. QUESTION: are all places east? Then write true, or"
        )
        draft.append("  # name the side of Greenwich in the site file: 'longitude: east' or 'longitude: west'")
    for key, letters in (("latitude_hemisphere", {"N", "S"}), ("longitude_hemisphere", {"E", "W"})):
        for one in sides:
            if {text.upper() for text in one.texts} <= letters:
                draft.append(f"  {key}: [{_quoted(one.name)}]  # its fields are letters of hemispheres")
                taken.add(one.name)
    for key, pattern in (
        ("altitude", r"^alt|altitude|elev|h(ö|oe)he"),
        ("quality", r"qual|fix"),
        ("hdop", r"hdop"),
    ):
        if (extra := named(pattern)) is not None and extra.name not in taken:
            draft.append(f"  {key}: [{_quoted(extra.name)}]  # by its name")
            taken.add(extra.name)
    draft.append("  required: false")
    return taken


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
