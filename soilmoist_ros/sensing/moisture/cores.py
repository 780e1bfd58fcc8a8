# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil cores of a calibration, from a CSV file."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import NamedTuple

from soilmoist_ros.foundation import InputError, Mistake, listing, read_lines
from soilmoist_ros.sensing.moisture.curve import soil_limits


class _Quantity(NamedTuple):
    """A column of numbers: its limits, its meaning for messages, and texts for its unit below the header."""

    low: float
    high: float
    meaning: str
    units: tuple[str, ...] = ()


_COLUMNS = {
    "vwc": _Quantity(0, 1, "volumetric water content is a fraction; name a column in per cent vwc_percent",
                     ("m3/m3", "m³/m³", "cm3/cm3", "cm³/cm³", "m^3/m^3", "cm^3/cm^3")),
    "gravimetric_water": _Quantity(0, math.inf, "gravimetric water is in g/g; name a column in per cent "
                                   "gravimetric_percent", ("g/g", "kg/kg")),
    "bulk_density_gcm3": _Quantity(0.02, 2.8, "dry bulk density is in g/cm3; name a column in kg/m3 "
                                   "bulk_density_kgm3", ("g/cm3", "g/cm³", "g/cm^3", "mg/m3", "kg/l")),
    "weight": _Quantity(0, math.inf, "a weight is zero or positive"),
    "distance_m": _Quantity(0, 600, "the distance from the probe is in metres, at most 600", ("m",)),
    **{
        f"{end}_cm": _Quantity(0, 120, "depths are in centimetres, positive downwards, at most 120; name a column "
                               f"in millimetres {end}_mm, in metres {end}_m", ("cm",))
        for end in ("depth", "top", "bottom")
    },
}  # fmt: skip
_OTHER_UNITS = {
    "vwc_percent": ("vwc", 0.01, ("%", "vol%", "vol.%", "vol-%")),
    "gravimetric_percent": ("gravimetric_water", 0.01, ("%",)),
    "bulk_density_kgm3": ("bulk_density_gcm3", 0.001, ("kg/m3", "kg/m³", "kg/m^3")),
    **{f"{end}_mm": (f"{end}_cm", 0.1, ("mm",)) for end in ("depth", "top", "bottom")},
    **{f"{end}_m": (f"{end}_cm", 100.0, ("m",)) for end in ("depth", "top", "bottom")},
}
"""Columns in another unit: the column that they stand for, the factor to its unit, texts for the unit."""
_NAMES = (*_COLUMNS, "profile", "date")
_SITES = ("site", "site_id", "site_name", "station", "station_id", "field", "field_id")
_SEPARATOR_LINE = re.compile(r"\"?sep=.\"?[,;\t]*", re.IGNORECASE)
"""Line that tells a spreadsheet how columns are separated."""
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "--", "---")
_INTERVAL = re.compile(r"(\d+(?:\.\d+)?)\s*(?:-|–|—|to|bis)\s*(\d+(?:\.\d+)?)\s*(?:cm)?", re.IGNORECASE)
_DAY = re.compile(r"(\d{4})([-/.])(\d\d?)\2(\d\d?)(?!\d)|(\d\d?)([-/.])(\d\d?)\6(\d{4}|\d\d)(?!\d)")
_DAY_NUMBER = re.compile(r"([2-5]\d{4})(?:\.\d+)?")  # days since 1899-12-30, as spreadsheets count them
_TIME = re.compile(r"[T ]+\d\d?:\d\d.*$")
_SAMPLING_ERROR = 0.1  # water above the pore volume that errors of mass and volume of a core may explain [m^3/m^3]
_DISAGREEMENT = 0.05  # difference between two statements of the moisture of one core that is named [m^3/m^3]
_DRIEST = 0.01  # moisture that some core of a calibration exceeds; even desert sand does [m^3/m^3]
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_DECIMAL_POINT = re.compile(r"[+-]?\d+\.\d+")


@dataclass(frozen=True)
class SoilCore:
    """A sample of soil from one depth of one profile.

    :param vwc: volumetric water content [m^3/m^3]
    :param bulk_density_gcm3: dry bulk density [g/cm^3], NaN if unknown
    :param weight: weight that the user gives [-]
    :param profile: name of the profile; cores of one profile have one place
    :param distance_m: distance from the probe [m], NaN if unknown
    :param top_cm: upper end of the core [cm], NaN if unknown
    :param bottom_cm: lower end of the core [cm]; the upper end for a depth without thickness
    """

    vwc: float
    bulk_density_gcm3: float = math.nan
    weight: float = 1.0
    profile: str = ""
    distance_m: float = math.nan
    top_cm: float = math.nan
    bottom_cm: float = math.nan


@dataclass(frozen=True)
class CoreTable:
    """Soil cores of one calibration, and what their file means.

    :param cores: the cores
    :param days: days of the cores as year-month-day, or as written if the file does not say which number is the
        month; empty without a date
    :param notes: choices in the meaning of the file, and what is not used
    """

    cores: tuple[SoilCore, ...]
    days: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class _Row(NamedTuple):
    """Cells of the known columns in their units, and as written: name of the column, and text."""

    line: int
    cells: dict[str, str]
    written: dict[str, tuple[str, str]]


def read_soil_cores(path: Path, bulk_density_gcm3: float | None = None, days: Sequence[str] = ()) -> CoreTable:
    """Read a CSV of soil cores, one row per core.

    Columns, by name in the first line: ``vwc`` [m^3/m^3], or ``gravimetric_water`` [g/g] together with a bulk
    density. Optional: ``bulk_density_gcm3``, ``weight``, ``profile``, ``distance_m`` from the probe; ``depth_cm``
    (also intervals such as 0-5), or ``top_cm`` and ``bottom_cm``; ``date``. Columns in other units have other
    names, such as ``vwc_percent``. Whether numbers have a decimal comma is decided once for the file.

    :param bulk_density_gcm3: density for gravimetric values of cores without a density
    :param days: days whose cores are used, for a file of several days
    :raises InputError: with every mistake in the file, or if the file has several days and none is chosen
    """
    notes: list[str] = []
    rows = _read_rows(path, notes)
    rows, chosen = _of_days(rows, days, path)
    cores: list[SoilCore] = []
    lines: list[int] = []
    mistakes: list[Mistake] = []
    for row in rows:
        try:
            cores.append(_core(row.cells, bulk_density_gcm3))
            lines.append(row.line)
        except _CellError as fault:
            mistakes.append(_as_written(fault, row, path))
    names = {name for row in rows for name, _ in row.written.values()}
    mistakes += _differences(cores, lines, names, path)
    if mistakes:
        raise InputError(mistakes)
    if not cores:
        raise InputError("has no soil core", "add one row per core below the header", path)
    if sum(core.weight for core in cores) <= 0:
        raise InputError("all weights are zero", "give at least one core a positive weight", path)
    return CoreTable(tuple(cores), chosen, (*notes, *_doubts(rows, cores, bulk_density_gcm3)))


def profiles_of(cores: Sequence[SoilCore]) -> list[list[SoilCore]]:
    """Cores by profile; each core without a profile is one."""
    groups: dict[str, list[SoilCore]] = {}
    for number, core in enumerate(cores):
        groups.setdefault(core.profile or f"core {number}", []).append(core)
    return list(groups.values())


class _CellError(Exception):
    def __init__(self, column: str, message: str, remedy: str) -> None:
        super().__init__(message)
        self.column, self.message, self.remedy = column, message, remedy


def _as_written(fault: _CellError, row: _Row, path: Path) -> Mistake:
    """The mistake with the name and the value that the file has, in whatever unit."""
    name, text = row.written.get(fault.column, (fault.column, ""))
    message, remedy = fault.message, fault.remedy
    if name != fault.column and "outside" in message:
        message = f"{text} is {message.replace(' is ', f' in the unit of {fault.column}, ', 1)}"
        remedy = f"check the value; if it has that unit, name the column {fault.column}"
    elif name != fault.column:
        message = message.replace(repr(row.cells[fault.column]), repr(text))
    return Mistake(message, remedy, path, row.line, name)


def _differences(cores: Sequence[SoilCore], lines: Sequence[int], names: set[str], path: Path) -> list[Mistake]:
    """Cores that cannot be weighed together, and columns whose unit cannot be right."""
    found = []
    for name, what in (("distance_m", "a distance"), ("top_cm", "a depth")):
        lacking = [line for line, core in zip(lines, cores, strict=True) if math.isnan(getattr(core, name))]
        if 0 < len(lacking) < len(cores):
            message = f"only {len(cores) - len(lacking)} of {len(cores)} cores have {what}"
            remedy = f"fill it in from line {lacking[0]} on; leave out rows that are no cores, such as means"
            found.append(Mistake(message, remedy, path, lacking[0]))
    most = max((core.vwc for core in cores), default=1.0)
    if most < _DRIEST:
        column = next((name for name in ("vwc_percent", "gravimetric_percent") if name in names), "")
        remedy = f"name the column {_canonical(column)} if it is a fraction" if column else "check the values"
        message = f"no core has more than {most:.2g} m3/m3 of water"
        found.append(Mistake(message, remedy, path, column=column))
    if len({core.bottom_cm > core.top_cm for core in cores}) > 1:
        remedy = "give either top_cm and bottom_cm or depth_cm to every core"
        found.append(Mistake("some cores have a thickness and some do not", remedy, path))
    for group in profiles_of(cores):
        if len({core.distance_m for core in group if not math.isnan(core.distance_m)}) > 1:
            remedy = "a profile is one place: give each place a name in the column 'profile'"
            found.append(
                Mistake(f"the cores of profile {group[0].profile} have different distances", remedy, path)
            )
    bottoms = [core.bottom_cm for core in cores if not math.isnan(core.bottom_cm)]
    if bottoms and 0 < max(bottoms) < 1.5:
        remedy = "name columns in metres depth_m, or top_m and bottom_m"
        found.append(Mistake(f"no core reaches deeper than {max(bottoms):g} cm: are these metres?", remedy, path))
    elif bottoms and 0 < max(bottoms) < 4 and names & {"depth_mm", "bottom_mm"}:
        remedy = "name columns in centimetres depth_cm, or top_cm and bottom_cm"
        message = f"no core reaches deeper than {max(bottoms):g} cm: are these centimetres?"
        found.append(Mistake(message, remedy, path))
    return found


def _doubts(rows: Sequence[_Row], cores: Sequence[SoilCore], density: float | None) -> list[str]:
    """Doubts about cores that can be read."""
    found = []
    lacking = sum(math.isnan(core.bulk_density_gcm3) for core in cores)
    by_mass = any(not row.cells.get("vwc") and row.cells.get("gravimetric_water") for row in rows)
    if density is not None and (0 < lacking < len(cores) or (lacking and by_mass)):
        found.append(
            f"{lacking} of {len(cores)} cores have no bulk density: {density:g} g/cm3 of the site file counts"
        )
    both = sum(row.cells.get("vwc", "") != "" and row.cells.get("gravimetric_water", "") != "" for row in rows)
    if both:
        found.append(f"gravimetric_water is not used for {both} cores: they have vwc")
    apart = [
        f"line {row.line}: {core.vwc:.2f} and {mass * core.bulk_density_gcm3:.2f} m3/m3"
        for row, core in zip(rows, cores, strict=True)
        if row.cells.get("vwc")
        and (mass := _float(row.cells.get("gravimetric_water", ""))) is not None
        and abs(core.vwc - mass * core.bulk_density_gcm3) > _DISAGREEMENT
    ]
    if apart:
        found.append(f"vwc and gravimetric_water with the bulk density disagree, {listing(apart)}; check them")
    weights = [core.weight for core in cores]
    if any(row.cells.get("weight") for row in rows):
        found.append(f"each core also counts by its own weight, {min(weights):g} to {max(weights):g}")
    known = [density if math.isnan(core.bulk_density_gcm3) else core.bulk_density_gcm3 for core in cores]
    soaked = [
        f"line {row.line}: {core.vwc:.2f}"
        for row, core, rho in zip(rows, cores, known, strict=True)
        if rho is not None and core.vwc > soil_limits(rho).saturation + _SAMPLING_ERROR
    ]
    if soaked:
        found.append(
            f"more water than the pores hold, in m3/m3: {listing(soaked)}; check moisture and bulk density"
        )
    if any(not math.isnan(core.top_cm) for core in cores) and len(profiles_of(cores)) == len(cores) > 1:
        found.append(
            "depths do not weigh: each core is a profile of its own; name the places in a column 'profile'"
        )
    return found


def _read_rows(path: Path, notes: list[str]) -> list[_Row]:
    """Rows with the cells of the known columns in their units; ``notes`` gets what is not used, and choices."""
    lines = [
        (number, line)
        for number, line in enumerate(read_lines(path, "check the path of the cores"), 1)
        if line.strip() and not line.lstrip().startswith("#") and not _SEPARATOR_LINE.fullmatch(line.strip())
    ]
    first = lines[0][1] if lines else ""
    delimiter = max(",;\t", key=first.count)
    table = list(csv.reader([line for _, line in lines], delimiter=delimiter, skipinitialspace=True))
    header = [cell.strip().lower() for cell in table[0]] if table else []
    rows, mistakes = [], []
    for (line, _), cells in list(zip(lines, table, strict=False))[1:]:
        cells = [cell.strip() for cell in cells]
        for number, name in enumerate(header[: len(cells)]):
            if name.endswith("_percent"):
                cells[number] = re.sub(r"(?<=\d)\s*%$", "", cells[number])
        if any(cells[len(header) :]):
            message = f"has {len(cells)} values for {len(header)} columns"
            remedy = "name every column in the first line; separate columns by semicolons where commas are decimal"
            mistakes.append(Mistake(message, remedy, path, line))
        if any(cells):
            rows.append((line, cells))
    names = [_canonical(name) for name in header]
    for name, times in Counter(names).items():
        if times > 1 and name in _NAMES:
            same = " and ".join(raw for raw in header if _canonical(raw) == name)
            mistakes.append(Mistake(f"has {times} columns of {name}: {same}", "keep one of them", path))
    if "vwc" not in names and "gravimetric_water" not in names and not mistakes:
        message = (
            f"has no column 'vwc' or 'gravimetric_water', only: {', '.join(filter(None, header)) or 'nothing'}"
        )
        known = f"name the columns in the first line; known are: {', '.join([*_NAMES, *_OTHER_UNITS])}"
        raise InputError(message, known, path)
    rows = _without_units(rows, header, names, path, mistakes, notes)
    names = _with_date(names, rows)
    _one_site(names, rows, path, mistakes)
    if ignored := [raw for raw, name in zip(header, names, strict=True) if raw and name not in _NAMES]:
        notes.append(f"columns that are not used: {', '.join(ignored)}")
    if bound := [raw for raw in header if "lattice" in raw or "carbon" in raw or "organic" in raw]:
        notes.append(f"lattice and organic water come from 'soil' in the site file, not from {', '.join(bound)}")
    comma = _has_decimal_comma(rows, names, path, mistakes)
    if comma:
        notes.append(f"numbers have a decimal comma, such as {comma}")
    if mistakes:
        raise InputError(mistakes)
    return [
        _Row(
            line,
            _cells(cells, header, names, bool(comma)),
            {name: (raw if raw in _OTHER_UNITS else name, cell)
             for raw, name, cell in zip(header, names, cells, strict=False) if name in _NAMES},
        )
        for line, cells in rows
    ]  # fmt: skip


def _canonical(name: str) -> str:
    return _OTHER_UNITS[name][0] if name in _OTHER_UNITS else name


def _cells(cells: Sequence[str], header: Sequence[str], names: Sequence[str], comma: bool) -> dict[str, str]:
    """Cells by known column, with a decimal point and in the unit of the column."""
    found: dict[str, str] = {}
    for raw, name, cell in zip(header, names, cells, strict=False):
        if name in _COLUMNS and comma:
            cell = re.sub(r"(?<=\d),(?=\d)", ".", cell)
        if raw in _OTHER_UNITS:
            cell = _scaled(cell, _OTHER_UNITS[raw][1])
        if name in _NAMES:
            found[name] = cell
    return found


def _scaled(cell: str, factor: float) -> str:
    """A cell with its numbers in another unit."""
    return re.sub(r"\d+(?:\.\d+)?", lambda number: f"{float(number[0]) * factor:.9g}", cell)


def _without_units(
    rows: list[tuple[int, list[str]]],
    header: Sequence[str],
    names: Sequence[str],
    path: Path,
    mistakes: list[Mistake],
    notes: list[str],
) -> list[tuple[int, list[str]]]:
    """Rows without a row of units below the header; units other than those of the columns are mistakes."""
    if not rows:
        return rows
    line, cells = rows[0]
    units = [
        (raw, cell)
        for raw, name, cell in zip(header, names, cells, strict=False)
        if name in _COLUMNS and cell.lower() not in _MISSING
    ]
    if not units or any(re.search(r"^[+-]?[.,]?\d", cell) for _, cell in units):
        return rows
    for raw, cell in units:
        allowed = _OTHER_UNITS[raw][2] if raw in _OTHER_UNITS else _COLUMNS[raw].units
        if cell.lower().strip("[]() ").replace(" ", "") not in (*allowed, "-", ""):
            remedy = _COLUMNS[_canonical(raw)].meaning
            mistakes.append(Mistake(f"the unit {cell!r} is not that of the column", remedy, path, line, raw))
    notes.append(f"line {line} is read as the units of the columns")
    return rows[1:]


def _with_date(names: Sequence[str], rows: Sequence[tuple[int, list[str]]]) -> list[str]:
    """Names of the columns; the first column of dates is called ``date``."""
    for number, name in enumerate(names):
        cells = [cells[number] for _, cells in rows if len(cells) > number and cells[number]]
        if "date" not in names and name not in _NAMES and cells and all(_DAY.match(cell) for cell in cells):
            return [*names[:number], "date", *names[number + 1 :]]
    return list(names)


def _one_site(
    names: Sequence[str], rows: Sequence[tuple[int, list[str]]], path: Path, mistakes: list[Mistake]
) -> None:
    """Add a mistake if the cores are of several sites."""
    for number, name in enumerate(names):
        if name in _SITES:
            sites = sorted({cells[number] for _, cells in rows if len(cells) > number and cells[number]})
            if len(sites) > 1:
                remedy = "give each site a file of its own: N0 belongs to one probe at one site"
                mistakes.append(
                    Mistake(f"has cores of several sites: {listing(sites)}", remedy, path, column=name)
                )


def _has_decimal_comma(
    rows: Sequence[tuple[int, list[str]]], names: Sequence[str], path: Path, mistakes: list[Mistake]
) -> str:
    """The first number with a decimal comma; empty if the numbers of the file have decimal points."""
    commas, points = [], []
    for line, cells in rows:
        for name, cell in zip(names, cells, strict=False):
            if name in _COLUMNS:
                commas += [(line, cell)] if _DECIMAL_COMMA.fullmatch(cell) else []
                points += [(line, cell)] if _DECIMAL_POINT.fullmatch(cell) else []
    if commas and points:
        message = f"has a comma in {commas[0][1]} and a point in {points[0][1]} (line {points[0][0]})"
        remedy = "write all numbers with a decimal point, without thousands separators"
        mistakes.append(Mistake(message, remedy, path, commas[0][0]))
    return commas[0][1] if commas and not points else ""


def _of_days(rows: list[_Row], days: Sequence[str], path: Path) -> tuple[list[_Row], tuple[str, ...]]:
    """Rows of the chosen days, and these days."""
    written = [row.cells["date"] for row in rows if row.cells.get("date")]
    if not written:
        return rows, ()
    if len(written) < len(rows):
        line = next(row.line for row in rows if not row.cells.get("date"))
        raise InputError([Mistake("the core has no date", "fill in the date, as in the other rows", path, line)])
    order = _month_first(written)
    of_row = [_day(text, order) for text in written]
    found = Counter(of_row)
    wanted = tuple(_day(day, _month_first([day]) if order is None else order) for day in days) or tuple(found)
    shown = ", ".join(f"{day} ({count} cores)" for day, count in found.items())
    if len(found) > 1 and not days:
        example = next(iter(found))
        remedy = f"choose the day of the counts with --date, such as --date {example}; give it twice for two days"
        raise InputError(f"has cores of {len(found)} days: {shown}", remedy, path)
    if unknown := [day for day in wanted if day not in found]:
        raise InputError(f"has no core of {', '.join(unknown)}", f"its days are: {shown}", path)
    return [row for row, day in zip(rows, of_row, strict=True) if day in wanted], wanted


def _month_first(texts: Sequence[str]) -> bool | None:
    """True if dates such as 5/8/2013 begin with the month; ``None`` if the file does not say so."""
    matches = [match for text in texts if (match := _DAY.match(text)) and match[5]]
    if any(match[6] == "." or int(match[5]) > 12 for match in matches):
        return False
    if any(int(match[7]) > 12 for match in matches):
        return True
    return False if all(int(match[5]) == int(match[7]) for match in matches) else None


def _day(text: str, month_first: bool | None) -> str:
    """A date as year-month-day; as written, without the time, if it is not clear which number is the month."""
    if number := _DAY_NUMBER.fullmatch(text.strip()):
        return f"{date(1899, 12, 30) + timedelta(days=int(number[1]))}"
    match = _DAY.match(text.strip())
    if match and match[1]:
        return f"{match[1]}-{match[3]:0>2}-{match[4]:0>2}"
    if match is None or month_first is None:
        return _TIME.sub("", text.strip())
    day, month = (match[7], match[5]) if month_first else (match[5], match[7])
    return f"{match[8] if len(match[8]) == 4 else '20' + match[8]}-{month:0>2}-{day:0>2}"


def possible_days(day: str) -> list[date]:
    """Days that a text of :attr:`CoreTable.days` may mean; none if it is no date.

    >>> [str(day) for day in possible_days("05/06/2026")]
    ['2026-05-06', '2026-06-05']
    """
    found = []
    for month_first in (True, False):
        with suppress(ValueError):
            found.append(date.fromisoformat(_day(day, month_first)))
    return found[:1] if len(set(found)) < 2 else found


def _core(row: dict[str, str], default_density: float | None) -> SoilCore:
    density = _number(row, "bulk_density_gcm3")
    weight = _number(row, "weight")
    distance = _number(row, "distance_m")
    top, bottom = _layer(row)
    return SoilCore(
        _vwc(row, density if density is not None else default_density),
        math.nan if density is None else density,
        1.0 if weight is None else weight,
        row.get("profile", ""),
        math.nan if distance is None else distance,
        top,
        bottom,
    )


def _layer(row: dict[str, str]) -> tuple[float, float]:
    """Upper and lower end of a core [cm], NaN if unknown."""
    if interval := _INTERVAL.fullmatch(row.get("depth_cm", "")):
        row = {**row, "depth_cm": "", "top_cm": interval[1], "bottom_cm": interval[2]}
    depth, top, bottom = (_number(row, name) for name in ("depth_cm", "top_cm", "bottom_cm"))
    if top is None and bottom is None:
        at = math.nan if depth is None else depth
        return at, at
    if top is None or bottom is None or depth is not None:
        raise _CellError("top_cm", "the core needs one depth", "give top_cm and bottom_cm, or depth_cm")
    if bottom <= top:
        raise _CellError("bottom_cm", f"{bottom:g} is not below the top", "depths count downwards")
    return top, bottom


def _vwc(row: dict[str, str], density: float | None) -> float:
    vwc = _number(row, "vwc")
    if vwc is not None:
        return vwc
    gravimetric = _number(row, "gravimetric_water")
    if gravimetric is None:
        raise _CellError("vwc", "the core has no moisture", "fill in vwc or gravimetric_water, or drop the row")
    if density is None:
        raise _CellError(
            "bulk_density_gcm3",
            "gravimetric water needs a bulk density",
            "add the column, or 'soil: {bulk_density_gcm3: ...}' to the site file",
        )
    vwc = gravimetric * density
    if vwc > 1:
        message = f"{gravimetric:g} g/g and {density:g} g/cm3 give {vwc:.2f} m3 of water per m3"
        remedy = "check both values; name a column in per cent gravimetric_percent"
        raise _CellError("gravimetric_water", message, remedy)
    return vwc


def _number(row: dict[str, str], column: str) -> float | None:
    text, quantity = row.get(column, ""), _COLUMNS[column]
    if text.lower() in _MISSING:
        return None
    value = _float(text)
    if value is None:
        raise _CellError(column, f"{text!r} is not a number", _notation(text) or quantity.meaning)
    if not (math.isfinite(value) and quantity.low <= value <= quantity.high):
        if value <= -99:
            raise _CellError(column, f"{text} looks like a mark of a missing value", "leave the cell empty")
        raise _CellError(column, f"{text} is outside {quantity.low:g} to {quantity.high:g}", quantity.meaning)
    return value


def _float(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _notation(text: str) -> str:
    """What to do with a text that may be a number in another notation; empty if it is none."""
    if re.fullmatch(r"\d\d?-[A-Za-z]{3}|[A-Za-z]{3}-\d\d?", text):
        return "a spreadsheet has made a date of an interval: write top_cm and bottom_cm"
    if re.fullmatch(r"[+-]?\d{1,3}(?:[ ',.]\d{3})+(?:[.,]\d+)?", text):
        return "write the number with a decimal point, without thousands separators"
    if re.fullmatch(r"[+-]?[.,\d]+\s*[^\d\s]+.*", text):
        return "write the number without its unit"
    return ""
