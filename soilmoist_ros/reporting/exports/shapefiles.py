"""Contour lines and management zones as shapefiles for farm terminals."""

from __future__ import annotations

from pathlib import Path

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.exports.layers import contours_layer, zones_layer
from soilmoist_ros.reporting.exports.settings import ExportSettings
from soilmoist_ros.reporting.exports.source import RunSource
from soilmoist_ros.reporting.exports.vectors import write_shapefile


def write_contours(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``contours.zip`` for each property: lines at round values, WGS-84.

    :raises InputError: if pyogrio is not installed, or no map has a contour line at such a step
    """
    layers = [contours_layer(source, one, settings) for one in source.properties]
    found = [layer for layer in layers if len(layer.shapes)]
    if not found:
        raise InputError("the map has no contour lines at this step", "choose a smaller one with --step")
    return [write_shapefile(folder / f"{layer.name}.zip", layer, source.frame) for layer in found]


def write_zones(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``zones.zip`` for each property: polygons with area, mean and water, WGS-84.

    :raises InputError: if pyogrio is not installed, or the settings are out of range
    """
    layers = [zones_layer(source, one, settings) for one in source.properties]
    return [write_shapefile(folder / f"{layer.name}.zip", layer, source.frame) for layer in layers]
