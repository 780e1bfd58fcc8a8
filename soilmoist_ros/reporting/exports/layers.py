# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The layers of a run: field, no-go areas, samples, records, track, visits, contours and zones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.reporting.exports.classes import shown_range
from soilmoist_ros.reporting.exports.contours import contour_lines
from soilmoist_ros.reporting.exports.source import MOISTURE, ROOT_DEPTH_MM, ExportSettings, PropertyMap, RunSource
from soilmoist_ros.reporting.exports.vectors import Layer, texts, times
from soilmoist_ros.reporting.exports.zones import Zone, management_zones
from soilmoist_ros.reporting.survey_times import EARLIEST_STAMP_S

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


def field_layer(source: RunSource) -> Layer:
    """The field without its no-go areas."""
    from shapely.geometry import MultiPolygon

    parts = list(getattr(source.boundary, "geoms", [source.boundary]))
    about, survey = source.run.summary, source.survey
    begin, end = (one.timestamp() for one in survey) if survey else (math.nan, math.nan)
    columns = {
        "name": texts([source.title]),
        "site": texts([str(about.get("site") or "")]),
        "area_ha": np.array([source.boundary.area / 1e4]),
        "start_utc": times([begin]),
        "end_utc": times([end]),
        "simulated": np.array([int(source.simulated)], np.int32),
        "software": texts([f"soilmoist_ros {about.get('version', '')}".strip()]),
    }
    return Layer("field", "MultiPolygon", [MultiPolygon(parts)], columns, "Field without its no-go areas")


def no_go_layer(source: RunSource) -> Layer:
    """Areas that were not mapped or entered."""
    columns = {"area_ha": np.array([shape.area / 1e4 for shape in source.no_go], float)}
    return Layer("no_go", "Polygon", source.no_go, columns, "Areas that were not mapped or entered")


def track_layer(source: RunSource) -> Layer:
    """Driven lines, one for each robot."""
    columns = {
        "robot": np.arange(1, len(source.tracks) + 1, dtype=np.int32),
        "length_m": np.array([line.length for line in source.tracks], float),
    }
    return Layer("track", "LineString", source.tracks, columns, "Driven lines")


def visits_layer(source: RunSource) -> Layer:
    """Places where a robot stopped to count, with the reason."""
    visits = source.run.visits
    columns: dict[str, NDArray[Any]] = {}
    for one in fields(Visit):
        values = [getattr(visit, one.name) for visit in visits]
        numbers = {"int": np.int32, "float": np.float64}.get(str(one.type))
        columns[one.name] = (
            texts([str(value) for value in values]) if numbers is None else np.array(values, numbers)
        )
    columns["arrival_utc"] = times(_dated(columns["arrival_stamp_s"]))
    columns["end_utc"] = times(_dated(columns["end_stamp_s"]))
    return Layer("visits", "Point", _points(columns["x_m"], columns["y_m"]), columns, "Stops of the robot")


def samples_layer(source: RunSource, one: PropertyMap) -> Layer:
    """Merged samples with counts, exposure, moisture and its interval; with times where the clock has a date."""
    columns = dict(one.samples)
    longitude, latitude = columns.pop("longitude_deg"), columns.pop("latitude_deg")
    for stamp, name in (("first_stamp_s", "start_utc"), ("last_stamp_s", "end_utc")):
        if stamp in columns:
            columns[name] = times(_dated(columns[stamp]))
    for name in ("raw_counts", "n_records"):
        if name in columns:
            columns[name] = columns[name].astype(np.int32)
    shapes = _points(*source.frame.to_local(latitude, longitude).T)
    shown = shown_range(one.values)
    return Layer(f"samples{one.suffix}", "Point", shapes, columns, "Counts merged by place", shown=shown)


def records_layers(one: PropertyMap) -> list[Layer]:
    """Records in use, and those in quarantine with the reason; empty in folders without a table of records.

    Records without a place have an empty point.
    """
    if not one.records:
        return []
    columns = dict(one.records)
    reason = texts(columns.pop("quarantine").tolist())
    shapes = _points(columns.pop("x_m"), columns.pop("y_m"))
    columns = {
        "time_utc": times(_dated(columns["stamp_s"])),
        **columns,
        "raw_counts": columns["raw_counts"].astype(np.int32),
        "rate_cps": columns["raw_counts"] / columns["effective_exposure_s"],
    }
    layers = []
    good = reason == ""
    for name, own, about in (
        ("records", good, "Corrected records in order of time"),
        ("quarantined", ~good, "Records that no map uses, with the reason"),
    ):
        if own.any():
            chosen = {key: column[own] for key, column in columns.items()}
            if name == "quarantined":
                chosen["reason"] = reason[own]
            kept = [shape for shape, keep in zip(shapes, own, strict=True) if keep]
            layers.append(Layer(f"{name}{one.suffix}", "Point", kept, chosen, about))
    return layers


def contours_layer(source: RunSource, one: PropertyMap, settings: ExportSettings) -> Layer:
    """Contour lines at round values.

    :raises InputError: if the step is far too small
    """
    lines, values = contour_lines(one, source.boundary, settings.step)
    unit = "%" if one.quantity is MOISTURE else one.quantity.unit
    columns = {
        one.quantity.column: values,
        "LABEL": texts([f"{value:g} {unit}" for value in values]),
        **_date(source, len(lines)),
    }
    return Layer(f"contours{one.suffix}", "LineString", lines, columns, f"Contours: {_about(one)}")


def zones_of(source: RunSource, one: PropertyMap, settings: ExportSettings) -> list[Zone]:
    """Management zones of a property. Limits of the site file come before classes of equal area.

    :raises InputError: if the settings are out of range
    """
    smallest = None if settings.min_zone_ha is None else 1e4 * settings.min_zone_ha
    given = (source.run.summary.get("irrigation") or {}).get("zone_limits_vwc")
    limits = [100 * limit for limit in given] if given and not one.name and one.quantity is MOISTURE else None
    return management_zones(one, source.boundary, settings.zones, smallest, limits)


def zones_layer(source: RunSource, one: PropertyMap, settings: ExportSettings) -> Layer:
    """Management zones as single polygons; zone 1 has the lowest values.

    :raises InputError: if the settings are out of range
    """
    zones = zones_of(source, one, settings)
    columns: dict[str, NDArray[Any]] = {
        "ZONE": np.array([zone.number for zone in zones], np.int32),
        one.quantity.column: np.round([zone.mean for zone in zones], 3),
        "SD": np.round([zone.sd for zone in zones], 3),
        "SURE_PCT": np.round([100 * zone.sure for zone in zones], 1),
        "AREA_HA": np.round([zone.area_ha for zone in zones], 4),
    }
    if one.quantity is MOISTURE:
        depth = root_depth_mm(source, settings)
        columns["WATER_MM"] = np.round([zone.water_mm(depth) for zone in zones], 1)
        columns["ROOT_MM"] = np.full(len(zones), depth)
    columns |= _date(source, len(zones))
    return Layer(f"zones{one.suffix}", "Polygon", [zone.shape for zone in zones], columns, f"Zones: {_about(one)}")


def root_depth_mm(source: RunSource, settings: ExportSettings) -> float:
    """Depth of the root zone [mm]."""
    known = (source.run.summary.get("irrigation") or {}).get("root_depth_mm")
    return settings.root_depth_mm or float(known or ROOT_DEPTH_MM)


def _about(one: PropertyMap) -> str:
    label = f"{one.label}, " if one.name else ""
    return f"{label}{one.quantity.title.lower()} [{one.quantity.unit}]"


def _date(source: RunSource, count: int) -> dict[str, NDArray[Any]]:
    """Column with the last day of the survey (UTC), if it is known."""
    survey = source.survey
    return {"DATE": np.full(count, survey[1].date(), "datetime64[D]")} if survey else {}


def _dated(stamps_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stamps of a clock that has a date, NaN otherwise."""
    return np.where(stamps_s >= EARLIEST_STAMP_S, stamps_s, np.nan)


def _points(x_m: NDArray[np.float64], y_m: NDArray[np.float64]) -> Sequence[BaseGeometry]:
    from shapely import points
    from shapely.geometry import Point

    known = np.isfinite(x_m) & np.isfinite(y_m)
    shapes = np.full(len(x_m), Point(), dtype=object)
    shapes[known] = points(x_m[known], y_m[known])
    return list(shapes)
