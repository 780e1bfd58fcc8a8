# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Vector layers of a run, and the files with them: GDAL formats by pyogrio, zipped shapefiles."""

from __future__ import annotations

import math
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import InputError, LocalFrame, optional_module
from soilmoist_ros.pipeline import EARLIEST_STAMP_S, NoteCode
from soilmoist_ros.reporting.certainty import NO_LEVEL, Certainty
from soilmoist_ros.reporting.exports.source import (
    MOISTURE,
    ROOT_DEPTH_MM,
    ExportedProperty,
    ExportSettings,
    RunSource,
)
from soilmoist_ros.reporting.exports.zones import Zone, management_zones, thirds

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely.geometry.base import BaseGeometry

_UTC = 100
"""GDAL's flag of a time in UTC."""
KEPT_SHARE = 0.9
"""Share of a zone of the advice that the file of zones has, below which there is a note."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Shapes of one kind with their columns.

    :param kind: ``Point``, ``LineString``, ``Polygon`` or ``MultiPolygon``
    :param shapes: shapes in the plane of the field [m], one for each row
    :param columns: name -> one value for each row; times are ``datetime64[ms]`` in UTC, dates ``datetime64[D]``
    """

    name: str
    kind: str
    shapes: Sequence[BaseGeometry] | NDArray[Any]
    columns: Mapping[str, NDArray[Any]]


def times(stamps_s: ArrayLike) -> NDArray[np.datetime64]:
    """Stamps [s since 1970-01-01 UTC] as times; no time for NaN."""
    stamps = np.asarray(stamps_s, float)
    whole = np.where(np.isfinite(stamps), np.round(np.nan_to_num(stamps) * 1000), 0).astype("int64")
    return np.where(np.isfinite(stamps), whole.astype("datetime64[ms]"), np.datetime64("NaT", "ms"))


def texts(values: Sequence[str]) -> NDArray[Any]:
    """A column of text."""
    return np.array(list(values), dtype=object)


def to_crs(shapes: Sequence[BaseGeometry] | NDArray[Any], frame: LocalFrame, crs: CRS) -> NDArray[Any]:
    """Shapes of the plane of a field in another reference system; exteriors counter-clockwise.

    Longitudes are continuous about the datum, and may exceed +-180 where a field lies on the antimeridian.
    """
    from pyproj import Transformer
    from shapely import transform

    from soilmoist_ros.reporting.geometry import right_handed

    there = Transformer.from_crs(frame.crs, crs, always_xy=True)

    def moved(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = there.transform(xy[:, 0], xy[:, 1])
        if crs.is_geographic:
            x = frame.longitude_deg + (np.asarray(x) - frame.longitude_deg + 180) % 360 - 180
        return np.column_stack([x, y])

    several = np.empty(len(shapes), object)  # numpy would take multipolygons for sequences
    several[:] = [right_handed(transform(shape, moved)) for shape in shapes]
    return several


def write_layers(
    path: Path, layers: Sequence[Layer], frame: LocalFrame, crs: CRS, driver: str, options: Mapping[str, str]
) -> Path:
    """Write layers into one file.

    :raises InputError: if pyogrio is not installed; states how to install it
    """
    from shapely import to_wkb

    raw = optional_module("pyogrio.raw")
    path.unlink(missing_ok=True)
    # One sync of the whole file follows; a sync for each step takes seconds on a busy disk.
    optional_module("pyogrio").set_gdal_config_options({"OGR_SQLITE_SYNCHRONOUS": "OFF"})
    for number, layer in enumerate(layers):
        stamped = [name for name, column in layer.columns.items() if column.dtype == np.dtype("datetime64[ms]")]
        raw.write(
            path, to_wkb(to_crs(layer.shapes, frame, crs)), list(layer.columns.values()), list(layer.columns),
            layer=layer.name, driver=driver, geometry_type=layer.kind, crs=crs.to_wkt(), append=number > 0,
            dataset_options=dict(options) or None,
            gdal_tz_offsets={name: np.full(len(layer.columns[name]), _UTC) for name in stamped},
        )  # fmt: skip
    return path


def write_shapefile(path: Path, layer: Layer, frame: LocalFrame) -> Path:
    """Write a layer as a zipped shapefile in WGS-84, the form that farm terminals read.

    Names of columns have at most ten ASCII characters.

    :raises InputError: if pyogrio is not installed
    """
    from pyproj import CRS

    workshop = Path(tempfile.mkdtemp(prefix=".writing-", dir=path.parent))
    try:
        write_layers(workshop / f"{path.stem}.shp", [layer], frame, CRS.from_epsg(4326), "ESRI Shapefile", {})
        with zipfile.ZipFile(workshop / "whole", "w", zipfile.ZIP_DEFLATED) as archive:
            for part in sorted(workshop.glob(f"{path.stem}.*")):
                archive.write(part, part.name)
        (workshop / "whole").replace(path)
    finally:
        shutil.rmtree(workshop, ignore_errors=True)
    return path


# The layers of a run: field, no-go areas, samples, records, track, visits and zones -----------------------------


def shape_layers(source: RunSource) -> list[Layer]:
    """The field without its no-go areas, these areas, which were not mapped or entered, and the driven lines."""
    from shapely.geometry import MultiPolygon

    whole = MultiPolygon(list(getattr(source.boundary, "geoms", [source.boundary])))
    about, survey = source.run.summary, source.survey
    begin, end = (one.timestamp() for one in survey) if survey else (math.nan, math.nan)
    of_field = {
        "name": texts([source.title]), "site": texts([str(about.get("site") or "")]),
        "area_ha": np.array([source.boundary.area / 1e4]), "start_utc": times([begin]), "end_utc": times([end]),
        "simulated": np.array([int(source.simulated)], np.int32),
        "calibrated": texts([source.properties[0].calibration]),
        "software": texts([f"soilmoist_ros {about.get('version', '')}".strip()]),
    }  # fmt: skip
    areas_ha = np.array([shape.area / 1e4 for shape in source.no_go], float)
    lengths_m = np.array([line.length for line in source.tracks], float)
    return [
        Layer("field", "MultiPolygon", [whole], of_field),
        Layer("no_go", "Polygon", source.no_go, {"area_ha": areas_ha}),
        Layer("track", "LineString", source.tracks, {"length_m": lengths_m}),
    ]


def visits_layer(source: RunSource) -> Layer:
    """Places where a robot stopped to count, with the reason."""
    columns: dict[str, NDArray[Any]] = {}
    for one in fields(Visit):
        values = [getattr(visit, one.name) for visit in source.run.visits]
        numbers = {"int": np.int32, "float": np.float64}.get(str(one.type))
        columns[one.name] = np.array(values, numbers) if numbers else texts(list(map(str, values)))
    columns["arrival_utc"] = times(_dated(columns["arrival_stamp_s"]))
    columns["end_utc"] = times(_dated(columns["end_stamp_s"]))
    return Layer("visits", "Point", _points(columns["x_m"], columns["y_m"]), columns)


def samples_layer(source: RunSource, one: ExportedProperty) -> Layer:
    """Merged samples with counts, exposure, moisture and its interval."""
    columns = dict(one.samples)
    longitude, latitude = columns.pop("longitude_deg"), columns.pop("latitude_deg")
    columns["raw_counts"] = columns["raw_counts"].astype(np.int32)
    shapes = _points(*source.frame.to_local(latitude, longitude).T)
    columns["calibrated"] = texts([one.calibration] * len(shapes))
    return Layer(f"samples{one.suffix}", "Point", shapes, columns)


def records_layers(one: ExportedProperty) -> list[Layer]:
    """Records in use, and those in quarantine with the reason; empty in folders without a table of records.

    Records without a place have an empty point.
    """
    if not one.records:
        return []
    columns = dict(one.records)
    reason = texts(columns.pop("quarantine").tolist())
    shapes = _points(columns.pop("x_m"), columns.pop("y_m"))
    columns = {
        "time_utc": times(_dated(columns["stamp_s"])), **columns,
        "raw_counts": columns["raw_counts"].astype(np.int32),
        "rate_cps": columns["raw_counts"] / columns["effective_exposure_s"],
    }  # fmt: skip
    layers, good = [], reason == ""
    for name, own, more in (("records", good, {}), ("quarantined", ~good, {"reason": reason})):
        if own.any():
            chosen = {key: column[own] for key, column in {**columns, **more}.items()}
            layers.append(Layer(f"{name}{one.suffix}", "Point", shapes[own], chosen))
    return layers


def zones_layer(source: RunSource, one: ExportedProperty, settings: ExportSettings) -> Layer:
    """Management zones as single polygons; zone 1 has the lowest values.

    They are those of the report: by the limits of the site file, else thirds of the area. A class is as certain
    as there, small parts of others included, and lacks as much water. A zone of the advice that has lost area,
    because its parts are too small, is named in the notes of the source.

    :raises InputError: if the settings are out of range
    """
    about: Mapping[str, Any] = source.run.summary.get("irrigation") or {}
    moist, usable = one.quantity is MOISTURE and not one.name, about.get("moisture_usable") is not False
    absolute = moist and usable and one.calibration not in ("none", *NO_LEVEL)
    limits = np.array(about.get("zone_limits_vwc") or () if absolute else (), float)
    ground = source.root_zone if absolute else None
    shift = 0.0 if ground is None else ground.shift
    by_plant = ground is not None and len(limits) and np.allclose(limits, ground.limits[0])
    shown = 100 * (limits - shift if by_plant else limits) if len(limits) else thirds(one.values)
    smallest = None if settings.min_zone_ha is None else 1e4 * settings.min_zone_ha
    direction_deg = None if ground is None else ground.direction_deg
    zones = management_zones(one, source.boundary, shown, smallest, direction_deg)
    known = usable or not moist
    if not known:
        source.notes.append("the moisture is impossible on much of the area, see the report: no zone is certain")
    as_reported = moist and usable and (len(limits) > 0 or about.get("zone_limits_vwc") is None)
    of_report = list(about.get("zones") or ()) if as_reported else []
    sure = _certainties(zones, of_report)
    source.notes.extend(_lost(zones, of_report if len(limits) else []))
    columns: dict[str, NDArray[Any]] = {
        "ZONE": np.array([zone.number for zone in zones], np.int32),
        one.quantity.column: np.round([zone.mean for zone in zones], 3),
        "SD": np.round([zone.sd for zone in zones], 3),
        "CERTAIN": np.array([one.certain and known for one in sure], np.int32),
        "SURE_PCT": np.round([100 * one.sure * known for one in sure], 1),
        "OTHER_PCT": np.round([100 * zone.other for zone in zones], 1),
        "AREA_HA": np.round([zone.area_ha for zone in zones], 4),
    }
    if absolute:
        depth = float(about.get("root_depth_mm") or ROOT_DEPTH_MM)
        columns["WATER_MM"] = np.round([(zone.mean / 100 + shift) * depth for zone in zones], 1)
        columns["ROOT_MM"] = np.full(len(zones), depth)
    if len(limits) and of_report:
        reported = [of_report[zone.number - 1] for zone in zones]
        if ground is not None:
            for name, end in (("MISS_MM", ""), ("MISS_P05", "_p05"), ("MISS_P95", "_p95")):
                columns[name] = np.round(np.array([one.get(f"missing_mm{end}") for one in reported], float), 1)
        columns["NAME"] = texts([str(one["name"]) for one in reported])
    columns |= origin(source, one, len(zones))
    return Layer(f"zones{one.suffix}", "Polygon", [zone.shape for zone in zones], columns)


def of_one_place(source: RunSource) -> bool:
    """True for a run whose records all lie at one place: its map says nothing of the field around."""
    return NoteCode.ONE_PLACE in (source.run.summary.get("warning_codes") or ())


def _certainties(zones: Sequence[Zone], of_report: Sequence[Mapping[str, Any]]) -> list[Certainty]:
    """Certainty of each zone: that of its class in the report, or its own without one."""
    found = []
    for zone in zones:
        reported: Mapping[str, Any] = of_report[zone.number - 1] if of_report else {}
        expected, sure = reported.get("expected_share"), reported.get("certain_share")
        found.append(zone.certainty if expected is None or sure is None else Certainty(expected, sure))
    return found


def _lost(zones: Sequence[Zone], of_advice: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Zones of the advice whose parts are too small for a polygon, in sentences."""
    for index, advised in enumerate(of_advice, 1):
        name, of_map = advised["name"], advised["area_m2"] / 1e4
        kept = sum(zone.area_ha for zone in zones if zone.number == index)
        if kept < KEPT_SHARE * of_map:
            yield (
                f"zone {index} ({name}): {of_map:.3g} ha on the map, {kept:.3g} ha in the file of zones. Other "
                "parts are so small that they joined their neighbours, see OTHER_PCT; a smaller --min-zone keeps "
                "them"
            )


def origin(source: RunSource, one: ExportedProperty, count: int) -> dict[str, NDArray[Any]]:
    """Columns with what moisture rests on and, if it is known, the last day of the survey (UTC)."""
    columns: dict[str, NDArray[Any]] = {"CALIBRATED": texts([one.calibration] * count)}
    if source.survey:
        columns["DATE"] = np.full(count, source.survey[1].date(), "datetime64[D]")
    return columns


def _dated(stamps_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stamps of a clock that has a date, NaN otherwise."""
    return np.where(stamps_s >= EARLIEST_STAMP_S, stamps_s, np.nan)


def _points(x_m: NDArray[np.float64], y_m: NDArray[np.float64]) -> NDArray[Any]:
    """Points; without a place an empty one."""
    from shapely import Point, points

    known = np.isfinite(x_m) & np.isfinite(y_m)
    shapes = np.full(len(x_m), Point(), dtype=object)
    shapes[known] = points(x_m[known], y_m[known])
    return shapes


def write_zones(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``zones.zip`` for each property: polygons with area, mean and water, WGS-84.

    :raises InputError: if pyogrio is not installed, all records are of one place, or the settings are out of range
    """
    if of_one_place(source):
        what = "there are no zones: all records are of one place, which says nothing of the field around it"
        raise InputError(what, "drive the sensor over the field", source.run.folder)
    layers = [zones_layer(source, one, settings) for one in source.properties]
    return [write_shapefile(folder / f"{layer.name}.zip", layer, source.frame) for layer in layers]
