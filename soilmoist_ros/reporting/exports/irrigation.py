# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation plan of a run for other programs: zones of one dose, with the rate in the unit of a machine."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.dose import DosePlan, DoseSettings, saved_zones
from soilmoist_ros.reporting.exports.layers import Layer, origin, texts, write_layers, write_shapefile
from soilmoist_ros.reporting.exports.source import MOISTURE, ExportedProperty, ExportSettings, RunSource
from soilmoist_ros.reporting.page.frame import percent

RATE_UNITS: dict[str, Fraction] = {
    "mm": Fraction(1),
    "l/m2": Fraction(1),
    "m3/ha": Fraction(10),
    "in": Fraction(10, 254),
    "gal/ac": Fraction("4046.8564224") / Fraction("3.785411784"),  # international acre, US gallon
}
"""Units of a rate for one millimetre of water; all are exact."""


def missing_text(figures_mm: tuple[float, float, float]) -> str:
    """Missing water with its interval, without the unit."""
    net, low, high = (f"{figure:.0f}" for figure in figures_mm)
    return f"{net} ({low} to {high})"


@dataclass(frozen=True, eq=False)
class Plan(DosePlan):
    """Zones to irrigate by the map of a property.

    :param date: last day of the survey (UTC), empty for a clock without a date
    """

    one: ExportedProperty
    date: str

    @property
    def facts(self) -> dict[str, str]:
        """Calibration, date, interval and total for readers; name and value have 32 letters at most together."""
        top, left = self.capped
        return {
            "calibration": self.one.calibration, "survey": self.date or "no date",
            "missing [mm]": missing_text(self.missing_mm), "decision sure on": percent(self.sure),
            **({} if math.isnan(self.need_sure) else {"need sure on": f"{percent(self.need_sure)} of it"}),
            "water": f"{self.volume_m3:.0f} m3",
            **({"typical soil": self.settings.texture} if self.settings.texture else {}),
            **({"zones": "hints, wide footprint"} if self.blurred else {}),
            **({} if self.certain else {"best estimate": "not certain"}),
            **({"capped at": f"{top:g} mm, {left:.0f} mm remain"} if left else {}),
        }  # fmt: skip


def irrigation_plan(source: RunSource) -> Plan:
    """The plan of the first property with moisture: that of the report.

    :raises InputError: if the run has no dose, and says what is missing
    """
    one = next((one for one in source.properties if one.quantity is MOISTURE), source.properties[0])
    date = source.survey[1].date().isoformat() if source.survey else ""
    about = source.run.summary
    zones = saved_zones(about, source.run.folder)
    used, sure = DoseSettings(**about["dose"]["settings"]), float(about["dose"]["sure_share"])
    return Plan(used, zones, sure, about["dose"].get("blurred", ""), one, date)


def dose_layer(source: RunSource, plan: Plan, settings: ExportSettings) -> Layer:
    """Zones of one dose as single polygons, with a column that a terminal takes for its rate.

    :raises InputError: if the name of the rate's column cannot be one
    """
    zones, name = plan.zones, settings.rate_column
    columns: dict[str, NDArray[Any]] = {
        "UNIT": texts([settings.rate_unit] * len(zones)), "NET_MM": np.round([zone.net_mm for zone in zones], 1),
        "NET_P05": np.round([zone.p05_mm for zone in zones], 1),
        "NET_P95": np.round([zone.p95_mm for zone in zones], 1),
        "NEED_PCT": np.round([100 * zone.needed for zone in zones], 1),
        "SURE_PCT": np.round([100 * zone.sure for zone in zones], 1),
        "AREA_HA": np.round([zone.area_m2 / 1e4 for zone in zones], 4),
        "VOLUME_M3": np.round([zone.volume_m3 for zone in zones], 1),
        "LEFT_MM": np.round([plan.capped[1] * (zone.gross_mm >= plan.capped[0]) for zone in zones], 1),
        **origin(source, plan.one, len(zones)),
    }  # fmt: skip
    taken = {"ZONE", "DATE", *columns}
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,9}", name) or name.upper() in taken:
        raise InputError(
            f"{name!r} cannot name the column of the rate",
            f"give a letter and at most nine more, digits or underscores; not {', '.join(sorted(taken))}",
        )
    first = {
        "ZONE": np.array([zone.number for zone in zones], np.int32),
        name: np.array([rate(zone.gross_mm, settings.rate_unit) for zone in zones]),
    }
    columns = {**first, **columns}
    return Layer("dose", "Polygon", [zone.shape for zone in zones], columns)


def rate(gross_mm: float, unit: str) -> float:
    """A dose in a unit of :data:`RATE_UNITS`.

    :raises InputError: if the unit is unknown
    """
    if unit not in RATE_UNITS:
        raise InputError(f"there is no unit {unit!r} of a rate", f"use one of: {', '.join(RATE_UNITS)}")
    return float(Fraction(gross_mm) * RATE_UNITS[unit])


def write_dose(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``dose.zip`` and ``dose.geojson``: zones with the rate, WGS-84.

    :raises InputError: if pyogrio is not installed, there is no dose, or the settings are out of range
    """
    from pyproj import CRS

    layer = dose_layer(source, irrigation_plan(source), settings)
    crs = CRS.from_epsg(4326)
    return [
        write_shapefile(folder / "dose.zip", layer, source.frame),
        write_layers(folder / "dose.geojson", [layer], source.frame, crs, "GeoJSON", {}),
    ]
