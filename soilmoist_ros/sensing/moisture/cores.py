# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil cores of a calibration, from a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.foundation.configuration import read_limited
from soilmoist_ros.foundation.errors import InputError, Mistake

_COLUMNS = "vwc, gravimetric_water, bulk_density_gcm3, weight, profile, distance_m, depth_cm, top_cm and bottom_cm"
_DENSEST_SOIL_GCM3 = 2.8


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


def read_soil_cores(path: Path, bulk_density_gcm3: float | None = None) -> tuple[SoilCore, ...]:
    """Read a CSV of soil cores, one row per core.

    Columns, by name in the first line: ``vwc`` [m^3/m^3], or ``gravimetric_water`` [g/g] together with a bulk
    density. Optional: ``bulk_density_gcm3``, ``weight``, ``profile``, ``distance_m`` from the probe; ``depth_cm``,
    or ``top_cm`` and ``bottom_cm``. Other columns are ignored.

    :param bulk_density_gcm3: density for gravimetric values of cores without a density
    :raises InputError: with every mistake in the file
    """
    rows = _read_rows(path)
    cores: list[SoilCore] = []
    mistakes: list[Mistake] = []
    for line, row in rows:
        try:
            cores.append(_core(row, bulk_density_gcm3))
        except _CellError as fault:
            mistakes.append(Mistake(fault.message, fault.remedy, path, line, fault.column))
    mistakes += _differences(cores, path)
    if mistakes:
        raise InputError(mistakes)
    if not cores:
        raise InputError("has no soil core", "add one row per core below the header", path)
    if sum(core.weight for core in cores) <= 0:
        raise InputError("all weights are zero", "give at least one core a positive weight", path)
    return tuple(cores)


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


def _differences(cores: Sequence[SoilCore], path: Path) -> list[Mistake]:
    """Cores that cannot be weighed together."""
    found = []
    for name, what in (("distance_m", "a distance"), ("top_cm", "a depth")):
        known = sum(not math.isnan(getattr(core, name)) for core in cores)
        if 0 < known < len(cores):
            remedy = "fill in the column for every core, or leave it out"
            found.append(Mistake(f"only {known} of {len(cores)} cores have {what}", remedy, path))
    if len({core.bottom_cm > core.top_cm for core in cores}) > 1:
        remedy = "give either top_cm and bottom_cm or depth_cm to every core"
        found.append(Mistake("some cores have a thickness and some do not", remedy, path))
    for group in profiles_of(cores):
        if len({core.distance_m for core in group if not math.isnan(core.distance_m)}) > 1:
            remedy = "a profile is one place: give each place a name in the column 'profile'"
            found.append(
                Mistake(f"the cores of profile {group[0].profile} have different distances", remedy, path)
            )
    return found


def _read_rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        text = read_limited(path, "check the path of the cores").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", "save the table as CSV in UTF-8", path) from None
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    numbers = [n for n, line in enumerate(text.splitlines(), 1) if not line.lstrip().startswith("#")]
    delimiter = ";" if lines and lines[0].count(";") > lines[0].count(",") else ","
    table = list(csv.reader(lines, delimiter=delimiter))
    header = [cell.strip().lower() for cell in table[0]] if table else []
    if "vwc" not in header and "gravimetric_water" not in header:
        raise InputError(
            f"has no column 'vwc' or 'gravimetric_water', only: {', '.join(filter(None, header)) or 'nothing'}",
            f"name the columns in the first line; known are: {_COLUMNS}",
            path,
        )
    return [
        (numbers[i], dict(zip(header, (cell.strip() for cell in row), strict=False)))
        for i, row in enumerate(table)
        if i > 0 and any(cell.strip() for cell in row)
    ]


def _core(row: dict[str, str], default_density: float | None) -> SoilCore:
    density = _number(row, "bulk_density_gcm3", 0.1, _DENSEST_SOIL_GCM3, "dry bulk density is in g/cm^3")
    weight = _number(row, "weight", 0, math.inf, "a weight is zero or positive")
    distance = _number(row, "distance_m", 0, 600, "the distance from the probe is in metres, at most 600")
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
    depth, top, bottom = (
        _number(row, name, 0, 300, "depths are in centimetres, at most 300")
        for name in ("depth_cm", "top_cm", "bottom_cm")
    )
    if top is None and bottom is None:
        at = math.nan if depth is None else depth
        return at, at
    if top is None or bottom is None or depth is not None:
        raise _CellError("top_cm", "the core needs one depth", "give top_cm and bottom_cm, or depth_cm")
    if bottom <= top:
        raise _CellError("bottom_cm", f"{bottom:g} is not below the top", "depths count downwards")
    return top, bottom


def _vwc(row: dict[str, str], density: float | None) -> float:
    vwc = _number(row, "vwc", 0, 1, "volumetric water content is a fraction, not per cent")
    if vwc is not None:
        return vwc
    gravimetric = _number(row, "gravimetric_water", 0, 3, "gravimetric water is in g/g, not per cent")
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
        raise _CellError("gravimetric_water", f"gives {vwc:.2f} m^3 of water per m^3", "check both values")
    return vwc


def _number(row: dict[str, str], column: str, low: float, high: float, remedy: str) -> float | None:
    text = row.get(column, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise _CellError(column, f"{text!r} is not a number", remedy) from None
    if not (math.isfinite(value) and low <= value <= high):
        raise _CellError(column, f"{text} is outside {low:g} to {high:g}", remedy)
    return value
