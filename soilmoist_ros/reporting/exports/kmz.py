# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""KMZ: the map as a picture for Google Earth, on a phone too."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from soilmoist_ros.reporting.certainty import NO_LEVEL, guess_text
from soilmoist_ros.reporting.colours import colour_ramp, coloured_png, robust_range
from soilmoist_ros.reporting.exports.layers import to_crs
from soilmoist_ros.reporting.exports.source import ExportedProperty, ExportSettings, RunSource
from soilmoist_ros.reporting.page.frame import render_page

LONG_SIDE_PX = 1024
COLOURS = 255


def write_kmz(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map.kmz`` for each property: the map as an overlay, and the field.

    The picture is inside: it works without network.
    """
    return [_write_kmz(source, one, folder / f"map{one.suffix}.kmz") for one in source.properties]


def _write_kmz(source: RunSource, one: ExportedProperty, path: Path) -> Path:
    from pyproj import CRS

    picture, box = _overlay(one)
    label = f", {one.label}" if one.name else ""
    guessed = guess_text(one.calibration)
    (shape,) = to_crs([source.boundary], source.frame, CRS.from_epsg(4326))
    text = render_page(
        "map.kml.j2", title=f"{source.title}{label}: {one.quantity.title.lower()}{guessed}",
        about=_in_words(source, one),
        survey=source.survey and [f"{time:%Y-%m-%dT%H:%M:%SZ}" for time in source.survey],
        overlay=one.title, box=box, field=source.title,
        parts=[
            [" ".join(f"{x:.7f},{y:.7f}" for x, y, *_ in ring.coords) for ring in (part.exterior, *part.interiors)]
            for part in getattr(shape, "geoms", [shape])
        ],
    )  # fmt: skip
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", text)
        archive.writestr("map.png", picture)
    return path


def _in_words(source: RunSource, one: ExportedProperty) -> str:
    """Date and colours in words: a phone shows them, and no legend."""
    low, high = robust_range(one.values)
    sentences = ["Simulated counts."] if source.simulated else []
    if one.calibration in NO_LEVEL:
        what = f"{one.calibration.capitalize()} calibration"
        sentences.append(f"{what}: the pattern is real, the level of the moisture is not.")
    if source.survey is not None:
        begin, end = (f"{time:%Y-%m-%d %H:%M}" for time in source.survey)
        sentences.append(f"Survey {begin} to {end} UTC.")
    sentences.append(f"Colours from {low:.3g} (pale) to {high:.3g} {one.quantity.unit} (dark).")
    return " ".join([*sentences, "Made by soilmoist_ros."])


def _overlay(one: ExportedProperty) -> tuple[bytes, dict[str, float]]:
    """The map as a picture on even longitudes and latitudes, and its box [deg]."""
    from rasterio import Affine
    from rasterio.crs import CRS
    from rasterio.warp import Resampling, reproject

    values = one.values
    height, width = values.shape
    column, row = np.meshgrid(np.linspace(-0.5, width - 0.5, 9), np.linspace(-0.5, height - 0.5, 9))
    edge = np.column_stack([column.ravel(), row.ravel()])  # as far as the edge of the raster
    lat, lon = one.frame.to_geographic(one.to_local(edge)).T
    centre = one.frame.longitude_deg
    # Longitudes count from the datum, so that a field on the antimeridian is one piece.
    lon = (lon - centre + 180) % 360 - 180
    west, south, east, north = lon.min(), lat.min(), lon.max(), lat.max()
    aspect = (east - west) * np.cos(np.radians(one.frame.latitude_deg)) / (north - south)
    columns, rows = (max(round(LONG_SIDE_PX * min(share, 1.0)), 1) for share in (aspect, 1 / aspect))
    target = np.full((rows, columns), np.nan, np.float32)
    reproject(
        values.astype(np.float32), target, src_transform=one.transform,
        src_crs=CRS.from_wkt(one.crs.to_wkt()), src_nodata=np.nan, dst_nodata=np.nan,
        dst_transform=Affine((east - west) / columns, 0, west, 0, (south - north) / rows, north),
        dst_crs=CRS.from_string(f"+proj=longlat +ellps=WGS84 +pm={centre} +no_defs"),
        resampling=Resampling.nearest,
    )  # fmt: skip
    low, high = robust_range(values)
    picture = coloured_png((target - low) / (high - low), colour_ramp(one.quantity.colours, COLOURS))
    return picture, {"north": north, "south": south, "east": centre + east, "west": centre + west}
