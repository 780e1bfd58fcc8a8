# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""QGIS: the GeoPackage of all layers, and project files with the styles of maps and layers."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from soilmoist_ros.reporting.certainty import NO_LEVEL, guess_text
from soilmoist_ros.reporting.colours import UNCERTAIN, colour_ramp, hex_ramp, robust_range
from soilmoist_ros.reporting.exports.layers import (
    Layer,
    of_one_place,
    records_layers,
    samples_layer,
    shape_layers,
    visits_layer,
    write_layers,
    zones_layer,
)
from soilmoist_ros.reporting.exports.source import (
    MOISTURE,
    RATE,
    ExportedProperty,
    ExportSettings,
    RunSource,
    transformed,
)
from soilmoist_ros.reporting.page.frame import render_page

FILE, PROJECT = "soilmoist.gpkg", "soilmoist"
RAMP_ITEMS = 9
HIDDEN = ("records", "zones", "visits")
"""Kinds of layers that are in the project but hidden at first, as samples of further properties are."""
RUN_LAYERS = (("field", "Polygon"), ("no_go", "Polygon"), ("track", "LineString"))
"""Layers of ``samples.geojson`` other than the samples, those to draw below first, and their geometry."""
_OF_MOISTURE = ("samples", "zones")
_GEOMETRY = {"LineString": "Line", "MultiPolygon": "Polygon"}
_INK, _WARNING, _WHITE, _GREY = "34,48,60,255", "213,94,0,255", "255,255,255,255", "93,107,120,160"
_UNITS = dict.fromkeys(("outline_width_unit", "size_unit", "line_width_unit"), "MM")
_CLASSES = {"fill": "SimpleFill", "line": "SimpleLine", "marker": "SimpleMarker"}
_SYMBOLS: Final[dict[str, tuple[str, dict[str, str]]]] = {
    "field": ("fill", {"color": "0,0,0,0", "outline_color": _INK, "outline_width": "0.5"}),
    "no_go": ("fill", {"color": _WARNING, "style": "b_diagonal", "outline_color": _WARNING}),
    "track": ("line", {"line_color": _GREY, "line_width": "0.3"}),
    "records": ("marker", {"name": "circle", "color": _GREY, "size": "0.8", "outline_style": "no"}),
    "quarantined": ("marker", {"name": "cross2", "color": _WARNING, "size": "2.4", "outline_color": _WARNING,
                               "outline_width": "0.5"}),
    # White with a dark edge, as in the report: coloured ones cannot be told from the map below them.
    "samples": ("marker", {"name": "circle", "color": _WHITE, "size": "2", "outline_color": _INK,
                           "outline_width": "0.3"}),
    "visits": ("marker", {"name": "triangle", "color": _WHITE, "size": "2.6", "outline_color": _INK}),
    "zones": ("fill", {"color": "", "outline_color": _WHITE, "outline_width": "0.3"}),
}  # fmt: skip
"""Kind of the symbol of each kind of layer, and its options."""


def map_look(one: ExportedProperty, sd: bool = False) -> dict[str, Any]:
    """Colours of the first band or its standard deviation between its robust limits, interpolated."""
    quantity = one.quantity
    low, high = (edge / quantity.scale for edge in robust_range(one.sd if sd else one.values))
    values = np.linspace(low, high, RAMP_ITEMS).tolist()
    colours = hex_ramp(UNCERTAIN if sd else quantity.colours, RAMP_ITEMS)
    return {
        "band": 1 + list(one.bands).index(f"{quantity.band}_sd" if sd else quantity.band), "low": repr(low),
        "high": repr(high),
        "items": [
            (repr(value), colour, f"{value * quantity.scale:.3g} {one.unit}")
            for value, colour in zip(values, colours, strict=True)
        ],
    }  # fmt: skip


def layer_look(layer: Layer) -> dict[str, Any]:
    """Symbol and categories of a layer, by its name and columns."""
    name = "no_go" if layer.name.startswith("no_go") else layer.name.split("_")[0]
    kind, options = _SYMBOLS[name]
    return {
        "kind": kind, "class": _CLASSES[kind], "options": {**_UNITS, **options},
        "categories": list(_zone_categories(layer)) if name == "zones" else [],
    }  # fmt: skip


def _zone_categories(layer: Layer) -> Iterable[tuple[int, str, str]]:
    """Number, label and colour of each class of zones."""
    columns = layer.columns
    quantity = MOISTURE if MOISTURE.column in columns else RATE
    guessed = guess_text(str(columns["CALIBRATED"][0]))
    numbers = np.unique(columns["ZONE"]).tolist()
    for number, colour in zip(numbers, colour_ramp(quantity.colours, len(numbers)).tolist(), strict=True):
        own = columns["ZONE"] == number
        areas = columns["AREA_HA"][own]
        mean = np.average(columns[quantity.column][own], weights=np.maximum(areas, 1e-9))
        name = columns["NAME"][own][0] if "NAME" in columns else "zone"
        label = f"{name} {number}: {mean:.1f} {quantity.unit}{guessed}, {areas.sum():.2f} ha"
        yield number, label, ",".join(map(str, (*colour, 200)))


def run_layers(source: RunSource, settings: ExportSettings) -> list[Layer]:
    """All layers that the run has, the ones to draw below first.

    :raises InputError: if the settings are out of range
    """
    field, *others = shape_layers(source)
    zones = [] if of_one_place(source) else [zones_layer(source, one, settings) for one in source.properties]
    points = [layer for one in source.properties for layer in (*records_layers(one), samples_layer(source, one))]
    return [layer for layer in (field, *zones, *others, *points, visits_layer(source)) if len(layer.shapes)]


def write_geopackage(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``soilmoist.gpkg`` in the reference system of the map.

    :raises InputError: if pyogrio is not installed, or the settings are out of range
    """
    return [_write_package(source, folder, run_layers(source, settings))]


def _write_package(source: RunSource, folder: Path, layers: Sequence[Layer]) -> Path:
    # Version 1.3 is read by older programs too.
    options = {"VERSION": "1.3"}
    return write_layers(folder / FILE, layers, source.frame, source.properties[0].crs, "GPKG", options)


def write_qgis(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``soilmoist.qgz`` with all that it shows: the maps and ``soilmoist.gpkg``.

    :raises InputError: if pyogrio is not installed, or the settings are out of range
    """
    layers = run_layers(source, settings)
    written = [_write_package(source, folder, layers)]
    for one in source.properties:
        written.append(folder / f"map{one.suffix}.tif")
        shutil.copyfile(source.run.folder / written[-1].name, written[-1])
    crs = source.properties[0].crs
    shown = [(layer, f"./{FILE}|layername={layer.name}") for layer in layers]
    path = folder / f"{PROJECT}.qgz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{PROJECT}.qgs", _project(source.title, source.properties, shown, crs))
    return [*written, path]


def write_run_project(path: Path, title: str, maps: Sequence[ExportedProperty]) -> Path:
    """Write a project that shows the files of a run in its folder: GeoTIFFs, and layers of ``samples.geojson``.

    :param maps: maps of all properties; samples and records are not needed
    """
    import pyproj

    layers = [*RUN_LAYERS, *((f"samples{one.suffix}", "Point") for one in maps)]
    shown = []
    for name, geometry in layers:
        file, kind = (name, "sample") if name.startswith("samples") else ("samples", name)
        source = f"./{file}.geojson|layername={file}|geometrytype={geometry}|subset=kind = '{kind}'"
        shown.append((Layer(name, geometry, [], {}), source))
    path.write_text(_project(title, maps, shown, pyproj.CRS.from_epsg(4326)), encoding="utf-8")
    return path


def _project(title: str, maps: Sequence[ExportedProperty], layers: Sequence[tuple[Layer, str]], crs: Any) -> str:
    """The project; its layers, the first at the bottom, lie above the maps."""
    first, shown = maps[0], []
    for layer, source in reversed(layers):
        key = layer.name
        guessed = key.startswith(_OF_MOISTURE) and first.calibration in NO_LEVEL
        shown.append({
            "key": key, "name": f"{key} ({first.calibration})" if guessed else key, "source": source, "crs": crs,
            "visible": key.split("_")[0] not in HIDDEN and not key.startswith("samples_"),
            "geometry": _GEOMETRY.get(layer.kind, layer.kind), "look": layer_look(layer),
        })  # fmt: skip
    for number, one in enumerate(maps):
        for end, sd in (("", False), ("_sd", True)):
            shown.append({
                "key": f"map{one.suffix}{end}", "name": one.title + (", SD" if sd else ""),
                "source": f"./map{one.suffix}.tif", "crs": one.crs, "visible": number == 0 and not sd,
                "geometry": "", "look": map_look(one, sd),
            })  # fmt: skip
    height, width = first.values.shape
    x, y = transformed(first.transform, (-0.05 * width, 1.05 * width), (1.05 * height, -0.05 * height))
    extent = [repr(float(edge)) for edge in (x[0], y[0], x[1], y[1])]  # a tenth wider than the map
    return render_page("qgis.xml.j2", title=title, crs=first.crs, shown=shown, extent=extent)
