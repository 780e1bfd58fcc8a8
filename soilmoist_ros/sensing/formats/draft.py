# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drafts a logger format from a file: columns are guessed by their names, and each doubt is a question."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from itertools import chain, pairwise, permutations
from pathlib import Path
from statistics import median
from typing import NamedTuple

from soilmoist_ros.foundation import InputError, listing
from soilmoist_ros.sensing.formats import log_values as units
from soilmoist_ros.sensing.formats.log_layout import plain_name, split_fields
from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
)
from soilmoist_ros.sensing.formats.logger_format import MISSING, order_of
from soilmoist_ros.sensing.formats.notation import matching_formats
from soilmoist_ros.sensing.lines import read_lines

MAX_LINES = 2_000  # number of lines from which a format is drafted
_TIME = re.compile(r"time|date|stamp|datum|zeit|utc|unix|epoch")
_COUNTS = re.compile(
    r"neutron|count|cts|(^|_)imp(_|/|$)|(^|_)n\d*(_?c)?$|cps|cph|moderated|(^|_)mod(_|$)|puls|crns"
)
_NO_COUNTS = re.compile(
    r"std|err|unc|flag|muon|gamma|light|strike|volt|record|rain|prec|sat|drop|number|coeff|sqrt|_se$|_sd$|swc|swe"
    r"|corr|smooth|filtered|norm|bare|unmo|(?<!epi)thermal"
)
_LIVE = re.compile(r"integration|et_?sec|n\d+et|live|exposure|duration|counting|messzeit|period")
_NUMBER = re.compile(r"record|^rn$|^no$|^nr$|cycle|index")
_NO_WEATHER = re.compile(r"soil|vwc|moist|boden|probe|dew|panel|ptemp|batt|abs|std|flag|vapo|wet")
_INSIDE = re.compile(r"int|_in(_|$)|inside|box|logger|n\d")
_OUTSIDE = re.compile(r"ext|out|cs215|air|ptb|hmp|2m")
_WEATHER: dict[units.Quantity, tuple[re.Pattern[str], dict[str, tuple[float, float]]]] = {
    "pressure": (re.compile(r"press|baro|^pa$|^p\d*(_|$)|_mb|luftdruck|^bp|hpa|mbar"),
                 {"hPa": (500, 1100), "kPa": (50, 110), "Pa": (50_000, 110_000), "inHg": (15, 32.5)}),
    "temperature": (re.compile(r"temp|^t\d*(_|$)|airt|_degc|^ta$"),
                    {"degC": (-50, 42), "degF": (42, 120), "K": (220, 330)}),
    "humidity": (re.compile(r"rh|hum|^ur(_|$)|feuchte|hygro"), {"fraction": (0, 1.5), "percent": (1.5, 105)}),
}  # fmt: skip
"""Names of each quantity, and its units with the medians that a log can have in them."""
_PLACE = {
    "latitude": r"^lat|_lat|breite", "longitude": r"^lon|_lon|^lng|l(ä|ae)nge",
    "altitude": r"^alt|elev|h(ö|oe)he", "quality": r"qual|fix", "hdop": r"hdop",
}  # fmt: skip


class _Column(NamedTuple):
    """A column of the file: its name, its fields without missing ones, their numbers, and its unit if written."""

    name: str
    texts: list[str]
    numbers: list[float]
    unit: str = ""

    @property
    def low(self) -> str:
        """Name in small letters, with blanks as underscores."""
        return re.sub(r"[\s.()\[\]-]+", "_", self.name.casefold().strip()).rstrip("_")

    @property
    def is_numeric(self) -> bool:
        return len(self.numbers) > 0.9 * len(self.texts)


def draft_format(path: Path, time: Sequence[str] = (), counts: Sequence[str] = ()) -> str:
    """The YAML text of a logger format for a file; each doubt is a line marked QUESTION.

    :param time: columns of the stamp, where the guess would be wrong: one, or date and time
    :param counts: columns of the counts, where the guess would be wrong
    :raises InputError: if the file has no table, no time or no counts: says what has to be answered first
    """
    lines = read_lines(path)[0][:MAX_LINES]
    keys, columns = _table(lines, path)
    draft = _Draft(path, [one for one in columns if one.texts])
    draft.lines = [f"# Draft of a logger format from {path.name}. Check each line, and answer each QUESTION."]
    if known := matching_formats(lines):
        draft.lines.append(f"# The shipped format {known[0]} reads this file as well.")
    texts = {"title": path.stem, "source": f"drafted from {path.name}", **keys}
    draft.lines += [f"{key}: {_quoted(value)}" for key, value in texts.items()]
    stamps, chosen = draft.named(time), draft.named(counts)
    step_s = draft.take_time(stamps or draft.likely_stamp())
    draft.take_counts(chosen)
    draft.take_live_time(step_s)
    draft.take_weather()
    draft.take_position()
    if draft.free:
        draft.lines.append(f"# Not used: {', '.join(one.name for one in draft.free)}.")
    return "\n".join(draft.lines) + "\n"


def _table(lines: Sequence[bytes], path: Path) -> tuple[dict[str, object], list[_Column]]:
    """Keys of the notation, and the columns."""
    texts = [text for line in lines if (text := decode_line(line).strip("\r\n\x00\x1a")).strip()]
    marks = Counter(text[:2] if text.startswith("//") else text[0] for text in texts if text[0] in "/#%")
    comment = marks.most_common(1)[0][0] if marks else ""
    body = [text for text in texts if not (comment and text.startswith(comment))]
    for delimiter in ("semicolon", "tab", "comma", "whitespace"):  # commas may be decimal commas in the first two
        sizes = Counter(len(split_fields(text, delimiter)) for text in body[-200:])
        size, often = sizes.most_common(1)[0] if sizes else (1, 0)
        if size > 1 and often > 0.8 * sizes.total():
            break
    else:
        remedy = "give the file as the logger wrote it"
        raise InputError("has no table with equal numbers of columns", remedy, path)
    rows = [(split_fields(text, delimiter) + [""] * size)[:size] for text in body]
    header: dict[str, object] = {"comment": comment} if comment else {}
    if rows[0][0].upper() == "TOA5":
        header["environment"] = ["TOA5", "station", "model", "serial", "os", "program", "signature", "table"]
        del rows[0]
    first = next((at for at, row in enumerate(rows) if _is_data(row)), len(rows))
    heads, written = rows[:first], [""] * size
    # Names in comments: a header of rovers goes on in a second line.
    commented = [
        split_fields(text[len(comment) :].rstrip(",; \t"), delimiter)
        for text in texts
        if comment and text[0] == comment[0]
    ]
    joined = [[one, other] for one, other in pairwise(commented)] + [[one] for one in commented]
    fitting = [parts for parts in joined if abs(sum(map(len, parts)) - size) <= 1]
    if heads:
        names = heads[0]
        if len(heads) > 1:
            header["lines_after_names"] = len(heads) - 1
            if any(map(units.canonical, heads[1])):
                header["units_line"], written = True, heads[1]
    elif fitting:
        names = [*chain.from_iterable(fitting[-1]), *[""] * size][:size]
        if len(fitting[-1]) > 1:
            header["continued_by"] = [fitting[-1][1][0]]
    else:
        header["columns"] = names = [f"column{number}" for number in range(1, size + 1)]
    fields = [
        [text for text in column if text.casefold() not in {*MISSING, ""}]
        for column in zip(*rows[first:], strict=True)
    ]
    comma = delimiter != "comma" and any(re.fullmatch(r"[+-]?\d+,\d+", text) for texts in fields for text in texts)
    keys: dict[str, object] = {"delimiter": delimiter, **({"decimal": "comma"} if comma else {}), "header": header}
    columns = []
    for name, texts, unit in zip(names, fields, written, strict=False):
        numbers = [read_number(text, "comma" if comma else "point") for text in texts]
        columns.append(_Column(name, texts, [number for number in numbers if number is not None], unit))
    return keys, columns


def _is_data(row: Sequence[str]) -> bool:
    """True if most fields have digits, and one of them is a number or a time."""
    digits = sum(any(map(str.isdigit, field)) for field in row)
    read = any(read_number(field) is not None or (field and likely_time_formats(field)) for field in row)
    return digits > 0.5 * sum(map(bool, row)) and read


class _Draft:
    """Lines of a draft, and the columns that are not yet used; each method writes a section and uses columns."""

    def __init__(self, path: Path, columns: list[_Column]) -> None:
        self.path, self.free = path, columns
        self.lines: list[str] = []

    def _use(self, columns: Sequence[_Column]) -> None:
        self.free = [one for one in self.free if one not in columns]

    def named(self, names: Sequence[str]) -> list[_Column]:
        """Columns that the user names."""
        known = {plain_name(one.name): one for one in self.free}
        for name in names:
            if plain_name(name) not in known:
                remedy = f"the columns are {listing(one.name for one in self.free)}"
                raise InputError(f"there is no column {name!r} with values", remedy, self.path)
        return [known[plain_name(name)] for name in names]

    def likely_stamp(self) -> list[_Column]:
        """Columns of the stamp: one, or date and time."""
        likely = sorted(self.free, key=lambda one: not _TIME.search(one.low))
        clocked = [one for one in likely if ":" in one.texts[0]]
        dated = [one for one in likely if _TIME.search(one.low) or re.search(r"\d[-/.]\d", one.texts[0])]
        pairs = [[one, other] for one, other in permutations(likely, 2) if other in clocked]
        for parts in [*([one] for one in clocked), *pairs, *([one] for one in dated)]:
            if _stamps(parts)[1]:
                return parts
        columns = listing(one.name for one in self.free)
        remedy = f"say which column has it: --time NAME, or --time DATE --time TIME; the columns are {columns}"
        raise InputError("has no column that is read as a time", remedy, self.path)

    def take_time(self, parts: Sequence[_Column]) -> float:
        """Write the section of the time; returns the usual time between records [s]."""
        texts, formats = _stamps(parts)
        if not formats:
            raise InputError(f"{texts[0]!r} is read as no time", "name another column with --time", self.path)
        both_orders = {"day_first", "month_first"} <= {order_of(one) for one in formats}
        formats = formats if both_orders else formats[:1]
        name = " + ".join(part.name for part in parts)
        self.lines += ["time:", f"  columns: [{_quoted(name)}]  # such as {texts[0]!r}"]
        self.lines.append(f"  formats: {_quoted(formats)}")
        if both_orders:
            question = "QUESTION: day_first or month_first? Each file decides, or is refused"
            self.lines.append(f"  date_order: auto  # {question}")
        self.lines.append("  marks: end  # QUESTION: start or end of the counting interval?")
        if read_time(texts[0], formats[:1], 0.0) != read_time(texts[0], formats[:1], 1.0):
            question = "QUESTION: UTC? Else its offset, or instead 'zone: Europe/Berlin'"
            self.lines.append(f"  utc_offset_hours: 0  # {question}")
        self._use(parts)
        stamps = [stamp_s for text in texts if (stamp_s := read_time(text, formats[:1])) is not None]
        return median([after - before for before, after in pairwise(stamps) if after > before] or [3600.0])

    def take_counts(self, chosen: Sequence[_Column]) -> None:
        """Write the section of the counts: of the columns that the user names, or of likely ones."""
        numeric = [one for one in self.free if one.is_numeric]
        named = [one for one in numeric if _COUNTS.search(one.low) and not _NO_COUNTS.search(one.low)]
        found = list(chosen) or [one for one in named if not _LIVE.search(one.low) and min(one.numbers) >= 0]
        if not found:
            firsts = listing(f"{one.name} ({one.texts[0]})" for one in numeric)
            remedy = (
                f"say which has them: --neutrons NAME, repeatable; columns of numbers, with the first: {firsts}"
            )
            raise InputError("has no column that is by its name one of raw counts of neutrons", remedy, self.path)
        first, pattern = found[0], _pattern(found, self.free)
        read = found if pattern else found[:1]
        names = listing(one.name for one in read)
        self.lines += ["counts:", f"  columns: [{_quoted(pattern or first.name)}]  # {names}"]
        unit = units.rate_of(first.unit) or units.rate_of(first.name)
        if not unit and all(value == int(value) for one in read for value in one.numbers):
            self.lines.append("  unit: counts")
        else:
            question = "QUESTION: the header says so, or it is no whole number; or raw counts?"
            self.lines.append(f"  unit: {unit or 'counts_per_hour'}  # {question}")
        if not pattern and len(found) > 1:
            others = listing(one.name for one in found[1:])
            self.lines.append(f"  # QUESTION: only {first.name} is read, not {others}?")
        means = listing(
            f"{one.name} {sum(one.numbers) / len(one.numbers):.4g}" for one in numeric if one in (*named, *found)
        )
        self.lines += [
            "  # QUESTION: raw counts of moderated detectors? Leave others out, such as: left_out: [2]",
            f"  # Means: {means}; a bare (thermal) tube counts about half of a moderated one.",
        ]
        self._use(read)

    def take_live_time(self, step_s: float) -> None:
        """Write record number, live time and period."""
        numeric = [one for one in self.free if one.is_numeric]
        numbers = [one for one in numeric if _NUMBER.search(one.low) and len(one.numbers) > 1]
        numbers = [one for one in numbers if one.numbers[1] - one.numbers[0] == 1][:1]
        self.lines += [f"record_number: [{_quoted(one.name)}]  # gaps show lost records" for one in numbers]
        self._use(numbers)
        live = [one for one in numeric if one not in numbers and _LIVE.search(one.low) and max(one.numbers) > 0]
        doubt = "" if live else "  # QUESTION: the usual time between records; is it counted?"
        if live:
            stem = re.sub(r"\d+", "{tube}", live[0].name, count=1)
            live = [one for one in live if re.sub(r"\d+", "{tube}", one.name, count=1) == stem]
            typical = median(value for value in live[0].numbers if value > 0)
            unit = min(units.DURATIONS, key=lambda name: abs(typical * units.DURATIONS[name] - 0.97 * step_s))
            self.lines += ["live_time:", f"  columns: [{_quoted(stem if len(live) > 1 else live[0].name)}]"]
            self.lines.append(f"  unit: {unit}  # {typical:g}, and {step_s:g} s from record to record")
            tubes = [int(number[0]) for one in live if (number := re.search(r"\d+", one.name))]
            if len(tubes) > 1 and tubes[1] - tubes[0] > 1:
                self.lines.append(f"  covers: {tubes[1] - tubes[0]}  # neighbouring tubes share a column")
            self._use(live)
        self.lines.append(f"record_period: {{default_s: {step_s:g}, minimal_live_fraction: 0}}{doubt}")

    def take_weather(self) -> None:
        """Write the sensors of each quantity of the air, outdoor ones first."""
        for quantity, (name, credible) in _WEATHER.items():
            likely = [one for one in self.free if one.numbers and name.search(one.low)]
            found = [one for one in likely if not _NO_WEATHER.search(one.low)]
            found.sort(key=lambda one: bool(_INSIDE.search(one.low)) - bool(_OUTSIDE.search(one.low)))
            sensors = []
            for one in found:
                middle, named = median(one.numbers), re.search(r"[(\[]([^)\]]+)[)\]]\s*$|_([A-Za-z%]+)$", one.name)
                said = one.unit or (next(filter(None, named.groups())) if named else "")
                unit, doubt = units.canonical(said), f"the header says so; the median is {middle:.4g}"
                if not units.measures(quantity, unit):
                    unit = next((unit for unit, (low, high) in credible.items() if low <= middle <= high), "")
                    doubt = (
                        f"QUESTION: which unit? The header says {said or 'nothing'}, the median is {middle:.4g}"
                    )
                start = "- " if unit else "# "
                sensors.append(f"    {start}{{column: {_quoted(one.name)}, unit: {unit or '?'}}}  # {doubt}")
            if any("- {" in line for line in sensors):
                self.lines += [f"{quantity}:", "  sensors:"]
            else:
                self.lines.append(f"# QUESTION: no column of the {quantity} is read; its correction needs one.")
            self.lines += sensors
            if len(sensors) > 1:
                question = "QUESTION: outdoor sensors first? In each record the first credible value is used."
                self.lines.append(f"  # {question}")
            self._use(found)

    def take_position(self) -> None:
        """Write the columns of the position."""
        found: dict[str, _Column] = {}
        for key, name in _PLACE.items():
            for one in self.free:
                if one not in found.values() and re.search(name, one.low):
                    found.setdefault(key, one)
        if not {"latitude", "longitude"} <= found.keys():
            return
        for key, letters in (("latitude_hemisphere", {"N", "S"}), ("longitude_hemisphere", {"E", "W"})):
            for one in self.free:
                if {text.upper() for text in one.texts} <= letters:
                    found[key] = one
        self.lines += ["position:", *(f"  {key}: [{_quoted(one.name)}]" for key, one in found.items())]
        signed = "longitude_hemisphere" in found or any(
            re.search("[-EWew]", text) or (read_coordinate(text) or 0.0) > 180 for text in found["longitude"].texts
        )
        ask = "  # QUESTION: none is negative. If all are east write true, else 'longitude: west' in the site file"
        self.lines += ["  required: false", f"  longitude_signed: {'true' if signed else f'false{ask}'}"]
        self._use(list(found.values()))


def _stamps(parts: Sequence[_Column]) -> tuple[list[str], list[str]]:
    """Texts of the stamps, and the formats that read all of them."""
    texts = [" ".join(texts) for texts in zip(*(part.texts for part in parts), strict=False)]
    likely = likely_time_formats(texts[0])
    return texts, [name for name in likely if all(read_time(text, [name]) is not None for text in texts)]


def _pattern(found: Sequence[_Column], every: Sequence[_Column]) -> str:
    """Common name of numbered columns with ``{tube}``; empty if there is none, or if others have it as well."""
    names, first = {one.name for one in found}, found[0].name
    for match in re.finditer(r"\d+", first) if len(names) > 1 else ():
        before, after = first[: match.start()], first[match.end() :]
        numbered = re.compile(re.escape(before) + r"\d+" + re.escape(after))
        if {one.name for one in every if numbered.fullmatch(one.name)} == names:
            return f"{before}{{tube}}{after}"
    return ""


def _quoted(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
