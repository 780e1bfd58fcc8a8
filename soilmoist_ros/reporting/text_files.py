# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Text files of a run: strict JSON, samples as GeoJSON (RFC 7946), series and visits as CSV."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import LocalFrame, csv_text
from soilmoist_ros.mapping import make_bands
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import calibration_of
from soilmoist_ros.reporting.geometry import field_polygon, right_handed, rings
from soilmoist_ros.simulation import MissionResult

DIGITS = 7
"""Decimal places of degrees; the last is about 1 cm."""


def jsonable(value: Any) -> Any:
    """The value in plain types; NaN and infinity become ``None``."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple | set | frozenset):
        return [jsonable(item) for item in value]
    return str(value)


def dumps(value: Any, indent: int | None = None) -> str:
    """Strict JSON text."""
    return json.dumps(jsonable(value), allow_nan=False, ensure_ascii=False, indent=indent)


def write_json(path: Path, value: Any, indent: int | None = 2) -> Path:
    """Write strict JSON that ends in a line feed."""
    path.write_text(dumps(value, indent) + "\n", encoding="utf-8")
    return path


# The course of a mission as CSV files ---------------------------------------------------------------------------


def write_series(path: Path, mission: MissionResult) -> Path:
    """Write the state over time, one row per entry; return ``path``. Undefined values are empty.

    Each further property adds the columns ``mse_NAME`` and ``coverage95_NAME``.
    """
    columns = mission.columns
    return write_table(path, list(columns), zip(*columns.values(), strict=True))


def write_visits(path: Path, mission: MissionResult) -> Path:
    """Write the visits in order, one column for each field of :class:`Visit`; return ``path``."""
    return write_table(path, [field.name for field in fields(Visit)], map(astuple, mission.visits))


def write_table(path: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    """Write a CSV file; return ``path``. Values that are not finite are empty."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_cell(*pair) for pair in zip(names, row, strict=True)] for row in rows)
    return path


def _cell(name: str, value: object) -> object:
    if not isinstance(value, float):
        return csv_text(value)
    if not math.isfinite(value):
        return ""
    # Unix time needs ten digits before the point.
    return f"{value:.13g}" if name.endswith("_stamp_s") else f"{value:.8g}"


# The samples, the track, the field and its no-go areas as GeoJSON (RFC 7946) ------------------------------------


def write_samples(path: Path, run: MapRun) -> Path:
    """Write field, track and samples as one feature collection; returns ``path``."""
    collection = samples_collection(run)
    features = ",\n".join(dumps(feature) for feature in collection.pop("features"))
    head = dumps(collection)[:-1]
    path.write_text(f'{head}, "features": [\n{features}\n]}}\n', encoding="utf-8")
    return path


def samples_collection(run: MapRun) -> dict[str, Any]:
    """Field, track and samples as a GeoJSON feature collection.

    Each feature has a ``kind``: ``field`` (polygon without the no-go areas), ``no_go`` (polygon), ``track`` (one
    line for each robot that moved) or ``sample`` (point). Undefined values, such as the
    moisture of a rate below the curve, are ``null``. ``calibrated`` says what moisture rests on.
    """
    points = np.vstack([*rings(run.soil_map.grid), *run.tracks_xy, run.soil_map.samples.xy])
    features = [*_shape_features(run), *_sample_features(run)]
    places = _lon_lat(run.frame, points)
    bbox = [*places.min(axis=0).tolist(), *places.max(axis=0).tolist()]
    return dict(jsonable({"type": "FeatureCollection", "bbox": bbox, "features": features}))


def _sample_features(run: MapRun) -> list[dict[str, Any]]:
    samples, curve, calibrated = run.soil_map.samples, run.soil_map.curve, calibration_of(run)
    counts, exposure = np.asarray(samples.counts, float), np.asarray(samples.exposure_s, float)
    rate = counts / exposure
    rate_sd = np.where(counts > 0, np.sqrt(counts) / exposure, np.nan)
    vwc_sd = np.full_like(rate, np.nan) if curve is None else curve.vwc_and_sd(rate, rate_sd)[1]
    interval = make_bands(rate, rate_sd**2, curve)
    # As on the map, no value leaves what the soil can hold; below the curve there is none.
    vwc = interval.vwc if curve is None else np.where(np.isnan(curve.vwc(rate)), np.nan, interval.vwc)
    lon_lat = _lon_lat(run.frame, samples.xy)
    return [
        _feature(
            f"sample-{i + 1}", "sample", {"type": "Point", "coordinates": lon_lat[i].tolist()},
            raw_counts=round(float(counts[i])), effective_exposure_s=round(float(exposure[i]), 3),
            rate_cps=rate[i], rate_sd_cps=rate_sd[i], vwc=vwc[i], vwc_sd=vwc_sd[i],
            vwc_p05=interval.vwc_p05[i], vwc_p95=interval.vwc_p95[i], calibrated=calibrated,
        )
        for i in range(len(rate))
    ]  # fmt: skip


def _shape_features(run: MapRun) -> Iterator[dict[str, Any]]:
    """The field, its no-go areas, and the track of the robots that moved."""
    from shapely.geometry import LineString, MultiLineString, Polygon

    polygon = field_polygon(run.soil_map.grid)
    yield _feature(
        "field", "field", _geometry(run.frame, polygon), name=run.field_name, site=run.site,
        area_m2=round(float(polygon.area), 1), simulated=run.simulated, calibrated=calibration_of(run),
        software=f"soilmoist_ros {run.version}".strip(), created_utc=run.created,
    )  # fmt: skip
    for number, hole in enumerate(map(Polygon, run.soil_map.grid.holes), start=1):
        geometry = _geometry(run.frame, right_handed(hole))
        yield _feature(f"no-go-{number}", "no_go", geometry, area_m2=round(float(hole.area), 1))
    moved = [track for track in run.tracks_xy if len(np.unique(track, axis=0)) > 1]
    if moved:
        stamps = [record.stamp_s for record in run.track]
        geometry = _geometry(run.frame, LineString(moved[0]) if len(moved) == 1 else MultiLineString(moved))
        about = {"n_records": len(run.track), "first_stamp_s": min(stamps), "last_stamp_s": max(stamps)}
        yield _feature("track", "track", geometry, **about)


def _feature(key: str, kind: str, geometry: dict[str, Any], **about: Any) -> dict[str, Any]:
    return {"type": "Feature", "id": key, "geometry": geometry, "properties": {"kind": kind, **about}}


def _lon_lat(frame: LocalFrame, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longitude and latitude (n, 2) [deg]; longitudes are continuous about the datum, and may exceed +-180."""
    lat, lon = frame.to_geographic(xy_m).T
    lon = frame.longitude_deg + (lon - frame.longitude_deg + 180) % 360 - 180
    return np.round(np.column_stack([lon, lat]), DIGITS)


def _geometry(frame: LocalFrame, shape: Any) -> dict[str, Any]:
    """A local shape as GeoJSON geometry: right-hand rule."""
    from shapely import transform
    from shapely.geometry import mapping

    return dict(mapping(right_handed(transform(shape, lambda xy: _lon_lat(frame, xy)))))
