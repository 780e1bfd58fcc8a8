# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""ISOXML: an irrigation task for the terminal of a machine, ISO 11783-10 TASKDATA in version 3 or 4.

The writer is our own: a task has a dozen kinds of elements, and the package ``isoxml`` of PyPI would need
``xsdata`` for them. The tests read with it. Open readers search for ``TASKDATA.XML`` and ``GRD00001.bin`` in this
case of letters.

Rates have the data dictionary identifier 1 of ISO 11783-11, setpoint volume per area, in 0.01 mm^3/m^2: 1 mm is
100,000,000, and the largest 32-bit number is 21.47 mm. Larger doses need several passes.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.dose import DoseZone, zones_by_dose, zones_mean
from soilmoist_ros.reporting.exports.irrigation import RATE_UNITS, Plan, irrigation_plan, rate
from soilmoist_ros.reporting.exports.layers import to_crs
from soilmoist_ros.reporting.exports.source import ExportSettings, RunSource

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

FORMS = ("grid1", "grid2", "polygons")
VERSIONS = (3, 4)
DDI = "0001"
"""Setpoint volume per area."""
UNITS_PER_MM = 10**8
"""Numbers of the DDI in a millimetre: 1 mm is 1e6 mm^3/m^2, and its resolution is 0.01 mm^3/m^2."""
MAX_VALUE = 2**31 - 1
MAX_CODE = 254
TEXT = 32
"""Longest designator [bytes of UTF-8]."""
NO_WATER = 0
"""Code of the zone for places out of the field, without a position, and without a zone: no water."""
DIGITS = 9
"""Decimals of coordinates [deg]."""
SIZE_DIGITS = 12
"""Decimals of the sizes of cells [deg], so that a thousand cells are exact to the digits of a coordinate."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""Time of the files in the archive, so that a run always gives the same bytes."""


@dataclass(frozen=True)
class Grid:
    """Cells in WGS-84, from the south-west corner: rows to the north, columns to the east.

    :param south: minimum north position of the first row, ``west`` minimum east position of the first column [deg]
    :param north_size: size of a cell to the north, and ``east_size`` to the east [deg]
    """

    south: float
    west: float
    north_size: float
    east_size: float
    rows: int
    columns: int

    def centres(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Latitudes and longitudes of the centres [deg], shape (rows * columns,), row by row from the south."""
        row, column = np.mgrid[: self.rows, : self.columns].reshape(2, -1)
        return self.south + (row + 0.5) * self.north_size, self.west + (column + 0.5) * self.east_size


def write_isoxml(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``taskdata.zip`` with the folder ``TASKDATA`` of one planned task.

    :raises InputError: if there is no dose, a rate does not fit, or the task exceeds the limits of the terminal
    """
    plan = irrigation_plan(source)
    xml, grid = task_data(source, plan, settings)
    path = folder / "taskdata.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (("TASKDATA.XML", xml), ("GRD00001.bin", grid)):
            if content is not None:
                about = zipfile.ZipInfo(f"TASKDATA/{name}", _DATE)
                archive.writestr(about, content, zipfile.ZIP_DEFLATED)
    return [path]


def task_data(source: RunSource, plan: Plan, settings: ExportSettings) -> tuple[bytes, bytes | None]:
    """Content of ``TASKDATA.XML``, and of ``GRD00001.bin`` unless the zones are polygons.

    :raises InputError: see :func:`write_isoxml`
    """
    if settings.isoxml_form not in FORMS or settings.isoxml_version not in VERSIONS:
        what = f"ISOXML {settings.isoxml_version!r} with {settings.isoxml_form!r} is not possible"
        raise InputError(what, f"use version 3 or 4, and one of: {', '.join(FORMS)}")
    if settings.passes < 1:
        raise InputError(f"{settings.passes} passes are not possible", "give 1 or more")
    values = {zone.number: pdv_value(zone.gross_mm, settings.passes) for zone in plan.zones}
    zones = _zones(plan, settings)
    root = _header(source, plan, settings)
    task = root.find("TSK")
    assert task is not None
    _zone(task, NO_WATER, "no water", 0)
    shapes = _in_degrees(source, [zone.shape for zone in plan.zones])
    grid = None
    if settings.isoxml_form == "polygons":
        for code, (zone, shape) in enumerate(zip(plan.zones, shapes, strict=True), start=1):
            _polygon(_zone(task, code, _label([zone], settings), values[zone.number]), 2, [shape])
    else:
        table = _grid(source, plan, shapes, settings)
        number = _numbers(source, plan, table)
        typed = "1" if settings.isoxml_form == "grid1" else "2"
        if typed == "1":
            for code, members in zones.items():
                _zone(task, code, _label(members, settings), values[code])
            grid = number.astype(np.uint8).tobytes()
        else:
            _zone(task, 1, "rate of the grid", 0)
            rates = np.array([0, *(values[code] for code in sorted(values))], "<i4")
            grid = rates[np.searchsorted([0, *sorted(values)], number)].tobytes()
        ET.SubElement(task, "GRD", _attributes(
            A=_decimal(table.south, DIGITS), B=_decimal(table.west, DIGITS),
            C=_decimal(table.north_size, SIZE_DIGITS), D=_decimal(table.east_size, SIZE_DIGITS),
            E=table.columns, F=table.rows, G="GRD00001", H=len(grid), I=typed, J="1" if typed == "2" else None,
        ))  # fmt: skip
    ET.indent(root)
    body = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode(), grid


def pdv_value(gross_mm: float, passes: int = 1) -> int:
    """The number of a dose in the task, for each of some passes.

    :raises InputError: if it exceeds 32 bits
    """
    value = round(Fraction(gross_mm) * UNITS_PER_MM / passes)
    if value > MAX_VALUE:
        raise InputError(
            f"a rate of {gross_mm / passes:g} mm does not fit into ISOXML: its largest is "
            f"{MAX_VALUE / UNITS_PER_MM:.2f} mm",
            f"divide it with --isoxml-passes {math.ceil(Fraction(gross_mm) * UNITS_PER_MM / MAX_VALUE)}",
        )
    return value


def _zones(plan: Plan, settings: ExportSettings) -> dict[int, list[DoseZone]]:
    """Zones of each dose by its code; refused if they are too many for the terminal."""
    found = {zones[0].number: zones for zones in zones_by_dose(plan.zones).values()}
    polygons = settings.isoxml_form == "polygons"
    count, limit = len(plan.zones if polygons else found), min(settings.max_zones, MAX_CODE)
    if count > limit and settings.isoxml_form != "grid2":
        form = (
            "choose --isoxml-form grid1, where zones of one dose are one"
            if polygons
            else "use --isoxml-form grid2"
        )
        raise InputError(
            f"the task has {count} zones, and the terminal takes {limit}",
            f"{form}, make the run again with larger steps or zones, or raise --max-zones (at most {MAX_CODE})",
        )
    return found


def _header(source: RunSource, plan: Plan, settings: ExportSettings) -> ET.Element:
    """The task without its zones, and what it refers to. Some terminals list tasks by customer and farm only."""
    from shapely import get_parts

    about, unit = source.run.summary, settings.rate_unit
    root = ET.Element("ISO11783_TaskData", {
        "VersionMajor": str(settings.isoxml_version), "VersionMinor": "3",
        "ManagementSoftwareManufacturer": "soilmoist_ros",
        "ManagementSoftwareVersion": _text(str(about.get("version") or "")) or "0", "DataTransferOrigin": "1",
    })  # fmt: skip
    name = _text(source.title) or "Field"
    ET.SubElement(root, "CPC", A="CPC1", B="Irrigation")
    ET.SubElement(root, "CTR", A="CTR1", B="soilmoist_ros")
    ET.SubElement(root, "FRM", A="FRM1", B=_text(str(about.get("site") or "")) or name, I="CTR1")
    field = ET.SubElement(root, "PFD", _attributes(
        A="PFD1", C=name, D=round(source.boundary.area), E="CTR1", F="FRM1",
    ))  # fmt: skip
    parts = get_parts(_in_degrees(source, [source.boundary])).tolist()
    # Version 3 has one polygon of a field, with all its borders; version 4 has one for each part.
    for group in [parts] if settings.isoxml_version == 3 else [[part] for part in parts]:
        _polygon(field, 1, group)
    ET.SubElement(root, "PDT", A="PDT1", B="Water")
    scale = rate(1.0, unit) / UNITS_PER_MM
    if scale < 1e-9:
        raise InputError(f"ISOXML cannot show {unit}", "choose --rate-unit mm, m3/ha or gal/ac")
    decimals = 1 if RATE_UNITS[unit] == 1 else 0
    ET.SubElement(root, "VPN", _attributes(A="VPN1", B=0, C=_decimal(scale, 15), D=decimals, E=unit))
    title = f"Irrigation {plan.date}" + (f" {settings.passes} passes" if settings.passes > 1 else "")
    task = ET.SubElement(root, "TSK", _attributes(
        A="TSK1", B=_text(title), C="CTR1", D="FRM1", E="PFD1", G=1, H=NO_WATER, I=NO_WATER, J=NO_WATER,
    ))  # fmt: skip
    ET.SubElement(task, "OTP", A="CPC1")
    facts = [f"{fact}: {value}" for fact, value in plan.facts.items()]
    if settings.passes > 1:
        facts.append(f"run this task {settings.passes} times")
        source.notes.append(
            f"isoxml: each of {settings.passes} passes applies 1/{settings.passes} of the dose: run the task "
            f"{settings.passes} times"
        )
    for fact in facts:
        ET.SubElement(task, "CAN", C=_text(fact))
    return root


def _zone(task: ET.Element, code: int, label: str, value: int) -> ET.Element:
    zone = ET.SubElement(task, "TZN", A=str(code), B=_text(label))
    ET.SubElement(zone, "PDV", A=DDI, B=str(value), C="PDT1", E="VPN1")
    return zone


def _label(zones: Sequence[DoseZone], settings: ExportSettings) -> str:
    """Dose of zones, what of it one pass applies, and the probability that it is the right one."""
    sure, gross_mm = zones_mean(zones, "sure"), zones[0].gross_mm
    part = f"{gross_mm / settings.passes:.3g} of " if settings.passes > 1 and gross_mm else ""
    return f"{part}{gross_mm:g} mm, right with {100 * sure:.0f} %"


def _polygon(parent: ET.Element, kind: int, parts: Iterable[BaseGeometry]) -> None:
    """A polygon of a field (kind 1) or of a zone (kind 2); inner borders are lines of type 2, all are closed."""
    polygon = ET.SubElement(parent, "PLN", A=str(kind))
    for part in parts:
        for index, ring in enumerate((part.exterior, *part.interiors)):
            line = ET.SubElement(polygon, "LSG", A="2" if index else "1")
            for east, north in ring.coords:
                ET.SubElement(line, "PNT", A="2", C=_decimal(north, DIGITS), D=_decimal(east, DIGITS))


def _grid(source: RunSource, plan: Plan, shapes: Any, settings: ExportSettings) -> Grid:
    """Cells over the field, of the map's size, or so many times larger that the terminal takes them."""
    from shapely import total_bounds

    if settings.max_cells < 1:
        raise InputError(f"a grid of {settings.max_cells} cells is not possible", "raise --max-cells")
    west, south, east, north = total_bounds(shapes).tolist()
    west, south = (math.floor(value * 10**DIGITS) / 10**DIGITS for value in (west, south))
    degree = source.frame.to_local([south, south + 1e-3, south], [west, west, west + 1e-3])
    cell = 1e-3 / np.hypot(*(degree[1:] - degree[0]).T) * plan.one.cell_m
    extent = north - south, east - west
    times = max(int(math.sqrt(np.prod(extent / cell) / settings.max_cells)), 1)  # fewer times are too many cells
    while True:
        size = np.round(cell * times, SIZE_DIGITS).tolist()
        rows, columns = (math.ceil(length / side) for length, side in zip(extent, size, strict=True))
        if rows * columns <= settings.max_cells:
            break
        times += 1
    if times > 1:
        source.notes.append(
            f"isoxml: cells of {plan.one.cell_m * times:.3g} m instead of {plan.one.cell_m:.3g} m, so that the "
            f"grid has at most {settings.max_cells} cells (--max-cells)"
        )
    return Grid(south, west, size[0], size[1], rows, columns)


def _numbers(source: RunSource, plan: Plan, grid: Grid) -> NDArray[np.int64]:
    """Number of the zone at the centre of each cell, 0 outside the field, shape (rows * columns,)."""
    from shapely import intersects_xy, prepare

    x, y = source.frame.to_local(*grid.centres()).T
    number = np.zeros(len(x), np.int64)
    for zone in plan.zones:
        prepare(zone.shape)
        inside = (number == 0) & intersects_xy(zone.shape, x, y)
        number[inside] = zone.number
        if not inside.any():
            source.notes.append(
                f"isoxml: a zone of {zone.area_m2:.0f} m2 with {zone.gross_mm:g} mm lies between the centres of "
                "cells, and is not in the grid; raise --max-cells, or use --isoxml-form polygons"
            )
    return number


def _in_degrees(source: RunSource, shapes: list[BaseGeometry]) -> NDArray[Any]:
    """Shapes in WGS-84; refused at the antimeridian, where longitudes of one ring cannot be continuous."""
    from pyproj import CRS
    from shapely import total_bounds

    there = to_crs(shapes, source.frame, CRS.from_epsg(4326))
    bounds = total_bounds(there)
    if bounds[0] < -180 or bounds[2] > 180:
        raise InputError("ISOXML has no fields across the antimeridian", "export --to dose instead")
    return there


def _text(value: str) -> str:
    """A designator: printable, and not too long for a terminal that counts bytes."""
    printable = "".join(letter if letter.isprintable() else " " for letter in value)
    return printable.encode()[:TEXT].decode(errors="ignore").strip()


def _decimal(value: float, digits: int) -> str:
    """A number without an exponent, which the schema does not allow."""
    return f"{value:.{digits}f}"


def _attributes(**values: object) -> dict[str, str]:
    return {name: str(value) for name, value in values.items() if value is not None}
