# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil cores of a calibration, from a CSV file."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import NamedTuple

from soilmoist_ros.foundation import InputError, Mistake, listing, read_lines
from soilmoist_ros.sensing.moisture.curve import soil_limits

_LIMITS = {
    "vwc": (0, 1, "volumetric water content is a fraction; name a column in per cent vwc_percent"),
    "gravimetric_water": (0, math.inf, "gravimetric water is in g/g; name one in per cent gravimetric_percent"),
    "bulk_density_gcm3": (0.02, 2.8, "dry bulk density is in g/cm3; name a column in kg/m3 bulk_density_kgm3"),
    "distance_m": (0, 600, "the distance from the probe is in metres, at most 600"),
    "latitude_deg": (-90, 90, "the latitude is in degrees, north positive"),
    "longitude_deg": (-180, 180, "the longitude is in degrees, east positive"),
    **{
        f"{end}_cm": (0, 120, f"depths are in cm, downwards, at most 120; name others {end}_mm or {end}_m")
        for end in ("depth", "top", "bottom")
    },
}
"""Columns of numbers, with their limits and their meaning for messages."""
_OTHER_UNITS = {
    "vwc_percent": ("vwc", 0.01), "gravimetric_percent": ("gravimetric_water", 0.01),
    "bulk_density_kgm3": ("bulk_density_gcm3", 0.001),
    **{f"{end}_mm": (f"{end}_cm", 0.1) for end in ("depth", "top", "bottom")},
    **{f"{end}_m": (f"{end}_cm", 100.0) for end in ("depth", "top", "bottom")},
}  # fmt: skip
"""Columns in another unit: the column that they stand for, and the factor to its unit."""
_SAME = {
    "profile_id": "profile", "distance_to_crns_m": "distance_m", "profile_depth_cm": "depth_cm",
    "soilmoisture_g_g": "gravimetric_water", "drybulkdensity_g_cm3": "bulk_density_gcm3",
}  # fmt: skip
"""Names of other programs (neptoon) for columns in the same unit."""
_NAMES = (*_LIMITS, "profile", "date")
_DATE = re.compile(r"(\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?[-/.]\d\d?[-/.](\d\d){1,2})(?!\d)")
_SITES = ("site", "site_id", "site_name", "station", "station_id", "field", "field_id")
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "--", "---")
_INTERVAL = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:-|–|—|to|bis)\s*(\d+(?:[.,]\d+)?)\s*(?:cm)?", re.IGNORECASE)
_NO_NUMBER = "write a plain number: no unit, thousands separator or date; an interval as top_cm and bottom_cm"
_SAMPLING_ERROR = 0.1  # water above the pore volume that errors of mass and volume of a core may explain [m^3/m^3]
_DRIEST = 0.01  # moisture that some core of a calibration exceeds; even desert sand does [m^3/m^3]


@dataclass(frozen=True)
class SoilCore:
    """A sample of soil from one depth of one profile.

    :param vwc: volumetric water content [m^3/m^3]
    :param bulk_density_gcm3: dry bulk density [g/cm^3], NaN if unknown
    :param profile: name of the profile; cores of one profile have one place
    :param distance_m: distance from the probe [m], NaN if unknown
    :param top_cm: upper end of the core [cm], NaN if unknown
    :param bottom_cm: lower end of the core [cm]; the upper end for a depth without thickness
    :param by_mass: whether the moisture is a gravimetric one times the density
    :param latitude_deg: place of the core, ``longitude_deg`` too [deg], NaN if unknown
    """

    vwc: float
    bulk_density_gcm3: float = math.nan
    profile: str = ""
    distance_m: float = math.nan
    top_cm: float = math.nan
    bottom_cm: float = math.nan
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    by_mass: bool = False


@dataclass(frozen=True)
class CoreTable:
    """Soil cores of one calibration.

    :param days: days of the cores as year-month-day, or as written; empty without a date
    :param notes: choices in the meaning of the file, and what is not used
    """

    cores: tuple[SoilCore, ...]
    days: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class _Row(NamedTuple):
    """Texts by column, with decimal points, and the name that each column has in the file."""

    line: int
    cells: Mapping[str, str]
    names: Mapping[str, str]


class _CellError(Exception):
    """A mistake in a cell: column, message and remedy."""


def read_soil_cores(path: Path, bulk_density_gcm3: float | None = None, days: Sequence[str] = ()) -> CoreTable:
    """Read a CSV of soil cores, one row per core.

    Columns, by name in the first line: ``vwc`` [m^3/m^3], or ``gravimetric_water`` [g/g] together with a bulk
    density. Optional: ``bulk_density_gcm3``, ``profile``, ``distance_m`` from the probe; the place,
    ``latitude_deg`` and ``longitude_deg``; ``depth_cm``
    (also intervals such as 0-5), or ``top_cm`` and ``bottom_cm``; ``date``. Columns in other units have other
    names, such as ``vwc_percent``. Whether numbers have a decimal comma is decided once for the file.

    :param bulk_density_gcm3: density for gravimetric values of cores without a density
    :param days: days whose cores are used, for a file of several days
    :raises InputError: with every mistake in the file, or if the file has several days and none is chosen
    """
    rows, notes = _read_rows(path)
    rows, chosen = _of_days(rows, days, path)
    cores, mistakes = [], []
    for row in rows:
        try:
            cores.append(_core(row, bulk_density_gcm3))
        except _CellError as error:
            column, message, remedy = error.args
            mistakes.append(Mistake(message, remedy, path, row.line, row.names.get(column, column)))
    mistakes += [] if mistakes else _differences(cores, rows, path)
    if mistakes:
        raise InputError(mistakes)
    if not cores:
        raise InputError("has no soil core", "add one row per core below the header", path)
    return CoreTable(tuple(cores), chosen, (*notes, *_doubts(rows, cores, bulk_density_gcm3)))


def profiles_of(cores: Sequence[SoilCore]) -> list[list[SoilCore]]:
    """Cores by profile; each core without a profile is one."""
    groups: dict[str, list[SoilCore]] = {}
    for number, core in enumerate(cores):
        groups.setdefault(core.profile or f"core {number}", []).append(core)
    return list(groups.values())


def _read_rows(path: Path) -> tuple[list[_Row], list[str]]:
    """Rows of the table, and notes about what is not used."""
    numbered = [
        (number, line)
        for number, line in enumerate(read_lines(path, "check the path of the cores"), 1)
        if line.strip() and not line.lstrip().startswith("#") and not re.match(r'"?sep=', line)
    ]
    first = numbered[0][1] if numbered else ""
    delimiter = max(",;\t", key=first.count)
    table = [
        [cell.strip() for cell in cells]
        for cells in csv.reader([line for _, line in numbered], delimiter=delimiter, skipinitialspace=True)
    ]
    header = [_SAME.get(cell.lower(), cell.lower()) for cell in table[0]] if table else []
    names = [_OTHER_UNITS[name][0] if name in _OTHER_UNITS else name for name in header]
    rows = [(line, cells) for (line, _), cells in list(zip(numbered, table, strict=False))[1:] if any(cells)]
    for at, name in enumerate(names):  # the first column of dates, by its name or its cells, is that of the days
        days = [cells[at] for _, cells in rows if len(cells) > at and cells[at]]
        dated = name in ("datum", "day", "sampled") or "date" in name or all(map(_DATE.match, days))
        if "date" not in names and name not in _NAMES and days and dated:
            names[at] = "date"
    mistakes = []
    for name, times in Counter(names).items():
        if times > 1 and name in _NAMES:
            same = " and ".join(raw for raw, of in zip(header, names, strict=True) if of == name)
            mistakes.append(Mistake(f"has {times} columns of {name}: {same}", "keep one of them", path))
    for line, cells in rows:
        if any(cells[len(header) :]):
            remedy = "name every column in the first line; separate columns by semicolons where commas are decimal"
            mistakes.append(Mistake(f"has {len(cells)} values for {len(header)} columns", remedy, path, line))
    if not mistakes and not {"vwc", "gravimetric_water"} & set(names):
        message = (
            f"has no column 'vwc' or 'gravimetric_water', only: {', '.join(filter(None, header)) or 'nothing'}"
        )
        known = f"name the columns in the first line; known are: {', '.join([*_NAMES, *_OTHER_UNITS])}"
        raise InputError(message, known, path)
    ignored = [raw for raw, name in zip(header, names, strict=True) if raw and name not in _NAMES]
    notes = [f"columns that are not used: {', '.join(ignored)}"] if ignored else []
    if bound := [raw for raw in header if re.search("lattice|carbon|organic", raw)]:
        notes.append(f"lattice and organic water come from 'soil' in the site file, not from {', '.join(bound)}")
    for at, name in enumerate(names):
        sites = sorted({cells[at] for _, cells in rows if len(cells) > at} - {""}) if name in _SITES else []
        if len(sites) > 1:
            remedy = "give each site a file of its own: N0 belongs to one probe at one site"
            mistakes.append(Mistake(f"has cores of several sites: {listing(sites)}", remedy, path, column=name))
    numbers = [cell for _, cells in rows for name, cell in zip(names, cells, strict=False) if name in _LIMITS]
    comma, point = (
        next((cell for cell in numbers if re.fullmatch(rf"[+-]?\d+{sign}\d+\s*%?", cell)), "")
        for sign in (",", "[.]")
    )
    if comma and point:
        remedy = "write all numbers with a decimal point, without thousands separators"
        mistakes.append(Mistake(f"has a comma in {comma} and a point in {point}", remedy, path))
    elif comma:
        notes.append(f"numbers have a decimal comma, such as {comma}")
    if mistakes:
        raise InputError(mistakes)
    written = {name: raw if raw in _OTHER_UNITS else name for raw, name in zip(header, names, strict=True)}
    return [_Row(line, dict(zip(names, cells, strict=False)), written) for line, cells in rows], notes


def _of_days(rows: list[_Row], days: Sequence[str], path: Path) -> tuple[list[_Row], tuple[str, ...]]:
    """Rows of the chosen days, and these days."""
    of_row = [_day(row.cells.get("date", "")) for row in rows]
    if not any(of_row):
        return rows, ()
    if "" in of_row:
        line = rows[of_row.index("")].line
        raise InputError([Mistake("the core has no date", "fill in the date, as in the other rows", path, line)])
    found = Counter(of_row)
    wanted = tuple(map(_day, days)) or tuple(found)
    shown = ", ".join(f"{day} ({count} cores)" for day, count in found.items())
    if len(found) > 1 and not days:
        remedy = (
            f"choose the day of the counts with --date, such as --date {of_row[0]}; give it twice for two days"
        )
        raise InputError(f"has cores of {len(found)} days: {shown}", remedy, path)
    if unknown := [day for day in wanted if day not in found]:
        raise InputError(f"has no core of {', '.join(unknown)}", f"its days are: {shown}", path)
    return [row for row, day in zip(rows, of_row, strict=True) if day in wanted], wanted


def _day(text: str) -> str:
    """A date as year-month-day; as written, without the time, if the notation does not say which is the month."""
    day = re.sub(r"[T ]+\d\d?:\d\d.*$", "", text.strip())
    if match := re.fullmatch(r"(\d{4})[-/.](\d\d?)[-/.](\d\d?)", day):
        return f"{match[1]}-{match[2]:0>2}-{match[3]:0>2}"
    match = re.fullmatch(r"(\d\d?)\.(\d\d?)\.(\d{4}|\d\d)", day)
    return f"{('20' + match[3])[-4:]}-{match[2]:0>2}-{match[1]:0>2}" if match else day


def possible_days(day: str) -> list[date]:
    """Days that a text of :attr:`CoreTable.days` may mean; none if it is no date.

    >>> [str(day) for day in possible_days("05/06/2026")]
    ['2026-06-05', '2026-05-06']
    """
    numbers = re.sub(r"^(\d\d?)/(\d\d?)/", r"\1.\2.", day), re.sub(r"^(\d\d?)/(\d\d?)/", r"\2.\1.", day)
    found = []
    for text in dict.fromkeys(map(_day, numbers)):
        with suppress(ValueError):
            found.append(date.fromisoformat(text))
    return found


def _core(row: _Row, default_density: float | None) -> SoilCore:
    density, distance = (_number(row, name) for name in ("bulk_density_gcm3", "distance_m"))
    if by_mass := math.isnan(vwc := _number(row, "vwc")):
        mass, rho = _number(row, "gravimetric_water"), density
        if math.isnan(mass):
            raise _CellError(
                "vwc", "the core has no moisture", "fill in vwc or gravimetric_water, or drop the row"
            )
        if math.isnan(density):
            if default_density is None:
                remedy = "add the column, or 'soil: {bulk_density_gcm3: ...}' to the site file"
                raise _CellError("bulk_density_gcm3", "gravimetric water needs a bulk density", remedy)
            rho = default_density
        vwc = mass * rho
        if vwc > 1:
            message = f"{mass:g} g/g and {rho:g} g/cm3 give {vwc:.2f} m3 of water per m3"
            remedy = "check both values; name a column in per cent gravimetric_percent"
            raise _CellError("gravimetric_water", message, remedy)
    layer = _layer(row)
    return SoilCore(
        vwc, density, row.cells.get("profile", ""), distance, *layer,
        _number(row, "latitude_deg"), _number(row, "longitude_deg"), by_mass,
    )  # fmt: skip


def _layer(row: _Row) -> tuple[float, float]:
    """Upper and lower end of a core [cm], NaN if unknown."""
    if interval := _INTERVAL.fullmatch(row.cells.get("depth_cm", "")):
        ends = {"depth_cm": "", "top_cm": interval[1], "bottom_cm": interval[2]}
        row = row._replace(cells={**row.cells, **ends}, names=dict.fromkeys(ends, row.names["depth_cm"]))
    depth, top, bottom = (_number(row, name) for name in ("depth_cm", "top_cm", "bottom_cm"))
    if math.isnan(top) and math.isnan(bottom):
        return depth, depth
    if math.isnan(top + bottom) or not math.isnan(depth):
        raise _CellError("top_cm", "the core needs one depth", "give top_cm and bottom_cm, or depth_cm")
    if bottom <= top:
        raise _CellError("bottom_cm", f"{bottom:g} is not below the top", "depths count downwards")
    return top, bottom


def _number(row: _Row, column: str) -> float:
    """Value of a cell in the unit of this package, NaN if it is empty."""
    written, (low, high, meaning) = row.names.get(column, column), _LIMITS[column]
    text = row.cells.get(column, "")
    if text.casefold() in _MISSING:
        return math.nan
    said = text.replace(",", ".") if re.fullmatch(r"[+-]?\d+,\d+\s*%?", text) else text
    try:
        value = float(said.rstrip("% ") if written.endswith("_percent") else said)
    except ValueError:
        raise _CellError(column, f"{text!r} is not a number", _NO_NUMBER) from None
    if value <= -99:
        raise _CellError(column, f"{text} looks like a mark of a missing value", "leave the cell empty")
    if written in _OTHER_UNITS:
        value = float(f"{value * _OTHER_UNITS[written][1]:.9g}")
    if not (math.isfinite(value) and low <= value <= high):
        shown = text if written == column else f"{text} is {value:g} in the unit of {column}, which"
        raise _CellError(column, f"{shown} is outside {low:g} to {high:g}", meaning)
    return value


def _differences(cores: Sequence[SoilCore], rows: Sequence[_Row], path: Path) -> Iterator[Mistake]:
    """Cores that cannot be weighed together, and columns whose unit cannot be right."""
    names = rows[0].names if rows else {}
    for name, what in (("distance_m", "a distance"), ("top_cm", "a depth")):
        lacking = [row.line for row, core in zip(rows, cores, strict=True) if math.isnan(getattr(core, name))]
        if 0 < len(lacking) < len(cores):
            remedy = f"fill it in from line {lacking[0]} on; leave out rows that are no cores, such as means"
            yield Mistake(
                f"only {len(cores) - len(lacking)} of {len(cores)} cores have {what}", remedy, path, lacking[0]
            )
    wettest = max((core.vwc for core in cores), default=1.0)
    if wettest < _DRIEST:
        column = names.get("vwc", names.get("gravimetric_water", ""))
        remedy = (
            f"name the column {_OTHER_UNITS[column][0]} if it is a fraction"
            if column in _OTHER_UNITS
            else "check the values"
        )
        yield Mistake(f"no core has more than {wettest:.2g} m3/m3 of water", remedy, path, column=column)
    if len({core.bottom_cm > core.top_cm for core in cores}) > 1:
        yield Mistake(
            "some cores have a thickness and some do not", "give all top_cm and bottom_cm, or all depth_cm", path
        )
    for group in profiles_of(cores):
        if len({core.distance_m for core in group if not math.isnan(core.distance_m)}) > 1:
            remedy = "a profile is one place: give each place a name in the column 'profile'"
            yield Mistake(f"the cores of profile {group[0].profile} have different distances", remedy, path)
    deepest = max((core.bottom_cm for core in cores if not math.isnan(core.bottom_cm)), default=math.inf)
    if 0 < deepest < (4 if {names.get("depth_cm"), names.get("bottom_cm")} & {"depth_mm", "bottom_mm"} else 1.5):
        remedy = "name columns after their unit: depth_cm, depth_mm or depth_m, or so top and bottom"
        yield Mistake(f"no core reaches deeper than {deepest:g} cm: is this the right unit?", remedy, path)


def _doubts(rows: Sequence[_Row], cores: Sequence[SoilCore], density: float | None) -> Iterator[str]:
    """Doubts about cores that can be read."""
    lacking = sum(math.isnan(core.bulk_density_gcm3) for core in cores)
    moist = [[row.cells.get(name, "").casefold() for name in ("vwc", "gravimetric_water")] for row in rows]
    both = sum(not set(texts) & set(_MISSING) for texts in moist)
    by_mass = "gravimetric_water" in rows[0].names and both < len(rows)
    if density is not None and (0 < lacking < len(cores) or (lacking and by_mass)):
        yield f"{lacking} of {len(cores)} cores have no bulk density: {density:g} g/cm3 of the site file counts"
    if both:
        yield f"gravimetric_water is not used for {both} cores: they have vwc"
    soaked = [
        f"line {row.line}: {core.vwc:.2f}"
        for row, core in zip(rows, cores, strict=True)
        if (rho := density if math.isnan(core.bulk_density_gcm3) else core.bulk_density_gcm3) is not None
        and core.vwc > soil_limits(rho).saturation + _SAMPLING_ERROR
    ]
    if soaked:
        yield f"more water than the pores hold, in m3/m3: {listing(soaked)}; check moisture and bulk density"
