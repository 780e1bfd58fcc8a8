# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map as a coloured GeoTIFF of one band: 8 bits and a colour table, for programs without styles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.colours import colour_ramp
from soilmoist_ros.reporting.exports.source import MOISTURE, ExportSettings, PropertyMap, RunSource
from soilmoist_ros.reporting.exports.zones import round_step, shown_range

NODATA = 255
MAX_VALUE = 254


def write_styled(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map_styled.tif`` for each property: cloud-optimised, with overviews.

    A pixel is moisture in whole percent by volume. A rate is ``pixel * scale + offset`` of the band.
    """
    return [_write(source, one, folder / f"map_styled{one.suffix}.tif") for one in source.properties]


def _write(source: RunSource, one: PropertyMap, path: Path) -> Path:
    import rasterio

    pixels, scale, offset = _pixels(one)
    low, high = ((edge - offset) / scale for edge in shown_range(one.values))
    ramp = colour_ramp(one.quantity.colours, 256)
    place = np.clip((np.arange(MAX_VALUE + 1) - low) / (high - low), 0, 1)
    table = {value: (*ramp[round(255 * share)].tolist(), 255) for value, share in enumerate(place.tolist())}
    profile = {
        "driver": "COG", "dtype": "uint8", "count": 1, "width": pixels.shape[1], "height": pixels.shape[0],
        "crs": rasterio.crs.CRS.from_wkt(one.crs.to_wkt()), "transform": one.transform, "nodata": NODATA,
        "compress": "deflate", "blocksize": 256, "overview_resampling": "nearest",
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(pixels, 1)
        raster.write_colormap(1, {**table, NODATA: (0, 0, 0, 0)})
        raster.set_band_description(1, one.quantity.band)
        raster.set_band_unit(1, one.quantity.unit)
        raster.scales, raster.offsets = (scale,), (offset,)
        raster.update_tags(1, long_name=one.quantity.title, units=one.unit)
        raster.update_tags(**map_tags(source, one))
    return path


def _pixels(one: PropertyMap) -> tuple[NDArray[np.uint8], float, float]:
    """Pixels with the value of one step and of pixel 0."""
    values = one.values
    inside = np.isfinite(values)
    scale, offset = 1.0, 0.0
    if one.quantity is not MOISTURE:
        low, high = float(values[inside].min()), float(values[inside].max())
        scale = round_step(max(high - low, 1e-6), MAX_VALUE - 1)
        offset = float(np.floor(low / scale) * scale)
    steps = np.clip(np.round((np.where(inside, values, 0.0) - offset) / scale), 0, MAX_VALUE)
    return np.where(inside, steps, NODATA).astype(np.uint8), scale, offset


def map_tags(source: RunSource, one: PropertyMap) -> dict[str, str]:
    """Tags of ``map.tif`` that hold for files made from it."""
    return {key: text for key, text in one.tags.items() if key.startswith(("SOILMOIST_", "TIFFTAG_"))}
