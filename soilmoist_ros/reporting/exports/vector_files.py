# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Vector files: all layers of a run in one GeoPackage with styles for QGIS; zones and contours as shapefiles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.exports.layers import (
    contours_layer,
    field_layer,
    no_go_layer,
    records_layers,
    samples_layer,
    track_layer,
    visits_layer,
    zones_layer,
)
from soilmoist_ros.reporting.exports.qml import layer_style
from soilmoist_ros.reporting.exports.source import ExportSettings, RunSource
from soilmoist_ros.reporting.exports.vectors import Layer, texts, write_layers, write_shapefile

FILE = "soilmoist.gpkg"


def run_layers(source: RunSource, settings: ExportSettings) -> list[Layer]:
    """All layers that the run has, the ones to draw below first, each with its style.

    :raises InputError: if the settings are out of range
    """
    layers = [field_layer(source)]
    for one in source.properties:
        layers += [zones_layer(source, one, settings), contours_layer(source, one, settings)]
    layers += [no_go_layer(source), track_layer(source)]
    for one in source.properties:
        layers += [*records_layers(one), samples_layer(source, one)]
    layers.append(visits_layer(source))
    return [replace(layer, style=layer_style(layer)) for layer in layers if len(layer.shapes)]


def write_geopackage(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``soilmoist.gpkg`` in the reference system of the map.

    :raises InputError: if pyogrio is not installed, or the settings are out of range
    """
    return [write_package(source, folder, run_layers(source, settings))]


def write_package(source: RunSource, folder: Path, layers: list[Layer]) -> Path:
    """Write layers with their styles into ``soilmoist.gpkg``.

    :raises InputError: if pyogrio is not installed
    """
    crs = source.properties[0].crs
    # Version 1.3 is read by older programs too.
    return write_layers(folder / FILE, [*layers, _styles(layers)], source.frame, crs, "GPKG", {"VERSION": "1.3"})


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


def _styles(layers: list[Layer]) -> Layer:
    """The table from which QGIS takes the style of a layer when it is opened."""
    styled = [layer for layer in layers if layer.style]
    blank = texts([""] * len(styled))
    columns = {
        "f_table_catalog": blank,
        "f_table_schema": blank,
        "f_table_name": texts([layer.name for layer in styled]),
        "f_geometry_column": texts(["geom"] * len(styled)),
        "styleName": texts([layer.name for layer in styled]),
        "styleQML": texts([layer.style for layer in styled]),
        "styleSLD": blank,
        "useAsDefault": np.ones(len(styled), bool),
        "description": texts([layer.description for layer in styled]),
        "owner": blank,
        "ui": blank,
        "update_time": np.full(len(styled), np.datetime64("now", "ms")),
    }
    return Layer("layer_styles", "", (), columns)
