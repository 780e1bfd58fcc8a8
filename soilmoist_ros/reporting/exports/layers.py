# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The layers of a run: field, no-go areas, samples, records, track, visits, contours and zones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit
from soilmoist_ros.pipeline import EARLIEST_STAMP_S
from soilmoist_ros.reporting.exports.contours import contour_lines
from soilmoist_ros.reporting.exports.source import MOISTURE, ROOT_DEPTH_MM, ExportSettings, PropertyMap, RunSource
from soilmoist_ros.reporting.exports.vectors import Layer, texts, times
from soilmoist_ros.reporting.exports.zones import Zone, management_zones

KEPT_SHARE = 0.9
"""Share of a zone of the advice that the file of zones has, below which there is a note."""

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
        "calibrated": texts([source.properties[0].calibration]),
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
    columns["calibrated"] = texts([one.calibration] * len(shapes))
    return Layer(f"samples{one.suffix}", "Point", shapes, columns, f"Counts merged by place: {one.title}")


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
        **_origin(source, one, len(lines)),
    }
    return Layer(f"contours{one.suffix}", "LineString", lines, columns, f"Contours: {one.title}")


def zones_layer(source: RunSource, one: PropertyMap, settings: ExportSettings) -> Layer:
    """Management zones as single polygons; zone 1 has the lowest values.

    Limits of the site file come before classes of equal area. A zone of the advice that has lost area, because its
    parts are too small, is named in the notes of the source.

    :raises InputError: if the settings are out of range
    """
    about: Mapping[str, Any] = source.run.summary.get("irrigation") or {}
    moist, usable = one.quantity is MOISTURE and not one.name, about.get("moisture_usable") is not False
    absolute = one.calibration in ("own", "simulated") and usable
    limits = [100 * limit for limit in about.get("zone_limits_vwc") or ()] if moist and absolute else []
    full = about.get("field_capacity_vwc") if moist and absolute else None
    smallest = None if settings.min_zone_ha is None else 1e4 * settings.min_zone_ha
    zones = management_zones(
        one, source.boundary, settings.zones, smallest, limits or None, None if full is None else 100 * full
    )
    known = usable or not moist
    if not known:
        source.notes.append("the moisture is impossible on much of the area, see the report: no zone is certain")
    names = [str(zone["name"]) for zone in about.get("zones") or ()] if limits else []
    source.notes.extend(_lost(one, source.boundary.area, zones, limits, names))
    columns: dict[str, NDArray[Any]] = {
        "ZONE": np.array([zone.number for zone in zones], np.int32),
        one.quantity.column: np.round([zone.mean for zone in zones], 3),
        "SD": np.round([zone.sd for zone in zones], 3),
        "CERTAIN": np.array([zone.certainty.certain and known for zone in zones], np.int32),
        "SURE_PCT": np.round([100 * zone.certainty.sure * known for zone in zones], 1),
        "OTHER_PCT": np.round([100 * zone.other for zone in zones], 1),
        "AREA_HA": np.round([zone.area_ha for zone in zones], 4),
    }
    if moist and absolute:
        depth = root_depth_mm(source, settings)
        columns["WATER_MM"] = np.round([zone.water_mm(depth) for zone in zones], 1)
        if full is not None:
            missing = np.array([zone.missing for zone in zones]).reshape(-1, 3) / 100 * depth
            columns |= dict(zip(("MISS_MM", "MISS_P05", "MISS_P95"), np.round(missing, 1).T, strict=True))
        columns["ROOT_MM"] = np.full(len(zones), depth)
    if names:
        columns["NAME"] = texts([names[zone.number - 1] for zone in zones])
    columns |= _origin(source, one, len(zones))
    return Layer(f"zones{one.suffix}", "Polygon", [zone.shape for zone in zones], columns, f"Zones: {one.title}")


def _lost(
    one: PropertyMap, area_m2: float, zones: Sequence[Zone], limits: Sequence[float], names: Sequence[str]
) -> Iterator[str]:
    """Zones of the advice whose parts are too small for a polygon, in sentences."""
    values = one.values[one.cells[0]]
    number = np.searchsorted(limits, values, side="right") + 1
    for index, name in enumerate(names, 1):
        of_map = float((number == index).mean()) * area_m2 / 1e4
        kept = sum(zone.area_ha for zone in zones if zone.number == index)
        if kept < KEPT_SHARE * of_map:
            yield (
                f"zone {index} ({name}): {of_map:.3g} ha on the map, {kept:.3g} ha in the file of zones. Other "
                "parts are so small that they joined their neighbours, see OTHER_PCT; a smaller --min-zone keeps "
                "them"
            )


def root_depth_mm(source: RunSource, settings: ExportSettings) -> float:
    """Depth of the root zone [mm]."""
    known = (source.run.summary.get("irrigation") or {}).get("root_depth_mm")
    return settings.root_depth_mm or float(known or ROOT_DEPTH_MM)


def _origin(source: RunSource, one: PropertyMap, count: int) -> dict[str, NDArray[Any]]:
    """Columns with what moisture rests on and, if it is known, the last day of the survey (UTC)."""
    columns: dict[str, NDArray[Any]] = {"CALIBRATED": texts([one.calibration] * count)}
    if source.survey:
        columns["DATE"] = np.full(count, source.survey[1].date(), "datetime64[D]")
    return columns


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
