# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An aerial picture of a surrogate field, drawn: what a drone would see of its soil, crop rows, trees and pond."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField

Array = NDArray[np.float64]

PIXELS: Final = 1200
"""Longer side of the picture."""
MARGIN: Final = 0.32
"""Width of the surroundings as a share of the field's longer side."""
HEDGE_M: Final = 3.0
ROW_M, TRACK_M, TRACK_WIDTH_M = 1.5, 18.0, 0.8
"""Distance of crop rows and of the tracks of the tractor, and width of these [m]."""
_DRY, _WET = np.array([176.0, 168.0, 104.0]), np.array([66.0, 112.0, 52.0])
_SOIL, _WOOD, _WATER, _AROUND = (
    np.array(colour, float) for colour in ((150, 130, 96), (44, 76, 38), (66, 92, 104), (168, 152, 112))
)


def write_aerial_picture(field: SurrogateField, path: Path, seed: int = 1) -> Path:
    """Draw the field and write it as a GeoTIFF with three bands: red, green, blue.

    Crop is greener where the soil is moister. Needs rasterio.

    :param field: the field
    :param path: file to write; its folder is made
    :param seed: seed of the grain
    """
    import rasterio
    from rasterio import Affine

    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    margin_m = MARGIN * float((high - low).max())
    west, south = low - margin_m
    east, north = high + margin_m
    step_m = float(max(east - west, north - south)) / PIXELS
    x = np.arange(west + step_m / 2, east, step_m)
    y = np.arange(north - step_m / 2, south, -step_m)
    rgb = _drawn(field, x, y, np.random.default_rng(seed))
    path.parent.mkdir(parents=True, exist_ok=True)
    with rasterio.open(
        path, "w", driver="GTiff", width=len(x), height=len(y), count=3, dtype="uint8", compress="deflate",
        photometric="RGB", crs=field.frame.crs.to_wkt(), transform=Affine(step_m, 0.0, west, 0.0, -step_m, north),
    ) as raster:  # fmt: skip
        raster.write(np.moveaxis(np.clip(np.rint(rgb), 0, 255).astype(np.uint8), -1, 0))
    return path


def _drawn(field: SurrogateField, x: Array, y: Array, rng: np.random.Generator) -> Array:
    """Colours at the places of a raster, shape (rows, columns, 3)."""
    import shapely

    places = np.stack(np.meshgrid(x, y), axis=-1)
    flat = places.reshape(-1, 2)
    outline = shapely.Polygon(field.polygon)
    inside = shapely.contains_xy(outline, flat[:, 0], flat[:, 1]).reshape(places.shape[:2])
    edge_m = shapely.distance(outline.exterior, shapely.points(flat)).reshape(inside.shape)
    rgb = np.empty((*inside.shape, 3))
    rgb[...] = _AROUND
    rate = field.rate_at(places[inside])
    low, high = np.quantile(rate, [0.02, 0.98])
    moist = np.clip((high - rate) / max(high - low, 1e-9), 0, 1)[:, None]  # more counts: drier
    rgb[inside] = _DRY + (_WET - _DRY) * moist
    across = places @ _across(field.polygon)
    rgb[inside] *= (1 + 0.05 * np.sin(2 * np.pi * across / ROW_M))[inside][:, None]
    track = inside & (np.abs(across % TRACK_M - TRACK_M / 2) % (TRACK_M / 2) < TRACK_WIDTH_M)
    rgb[track] = 0.5 * rgb[track] + 0.5 * _SOIL
    rgb[~inside & (edge_m < HEDGE_M)] = _WOOD
    for ring in field.field.no_go:
        pond = shapely.Polygon(ring)
        for shape, colour in ((pond, _WOOD), (pond.buffer(-2.5), _WATER)):
            rgb[shapely.contains_xy(shape, flat[:, 0], flat[:, 1]).reshape(inside.shape)] = colour
    return np.asarray(rgb + rng.normal(0, 7, (*inside.shape, 1)) + rng.normal(0, 3, rgb.shape))


def _across(polygon: Array) -> Array:
    """Direction across the longest side of the field, along which a farmer drives, shape (2,)."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    along = sides[np.argmax(np.hypot(*sides.T))]
    return np.asarray(np.array([-along[1], along[0]]) / np.hypot(*along))
