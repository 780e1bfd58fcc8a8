# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""QGIS: styles (QML), the GeoPackage of all layers with their styles, and project files."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.colours import UNCERTAIN, colour_ramp
from soilmoist_ros.reporting.exports.layers import (
    Layer,
    contours_layer,
    field_layer,
    no_go_layer,
    records_layers,
    samples_layer,
    texts,
    track_layer,
    visits_layer,
    write_layers,
    zones_layer,
)
from soilmoist_ros.reporting.exports.source import (
    MOISTURE,
    RATE,
    ExportSettings,
    PropertyMap,
    RunSource,
    transformed,
)
from soilmoist_ros.reporting.exports.zones import shown_range

if TYPE_CHECKING:
    from pyproj import CRS

VERSION = "3.22.0"
RAMP_ITEMS = 9
_INK = (34, 48, 60)
_Colour = tuple[int, int, int]


def map_style(one: PropertyMap) -> str:
    """Style of ``map.tif``: its first band in colours, with a legend in the unit of the band."""
    return _document(map_pipe(one))


def layer_style(layer: Layer) -> str:
    """Style of a layer by its name and columns; empty for layers without one."""
    elements = style_elements(layer)
    return _document(*elements) if elements else ""


def style_elements(layer: Layer) -> list[ET.Element]:
    """Renderer and labels of a layer; empty for layers without a style."""
    kind = layer.name.split("_")[0] if not layer.name.startswith("no_go") else "no_go"
    plain = {
        "field": _symbol("fill", "SimpleFill", color="0,0,0,0", outline_color=_rgba(_INK), outline_width="0.5"),
        "no_go": _symbol(
            "fill", "SimpleFill", color="213,94,0,255", style="b_diagonal", outline_color="213,94,0,255"
        ),
        "track": _symbol("line", "SimpleLine", line_color="93,107,120,160", line_width="0.3"),
        "records": _symbol("marker", "SimpleMarker", name="circle", color="93,107,120,160", size="0.8",
                           outline_style="no"),
        "quarantined": _symbol("marker", "SimpleMarker", name="cross2", color="213,94,0,255", size="2.4",
                               outline_color="213,94,0,255", outline_width="0.5"),
        # White with a dark edge, as in the report: coloured ones cannot be told from the map below them.
        "samples": _symbol("marker", "SimpleMarker", name="circle", color="255,255,255,255", size="2",
                           outline_color=_rgba(_INK), outline_width="0.3"),
        "visits": _symbol("marker", "SimpleMarker", name="triangle", color="255,255,255,255", size="2.6",
                          outline_color=_rgba(_INK)),
    }  # fmt: skip
    if kind in plain:
        return [_single(plain[kind])]
    if kind == "contours":
        line = _symbol("line", "SimpleLine", line_color=_rgba(_INK), line_width="0.35")
        return [_single(line), _labels("LABEL")]
    return [_zones(layer)] if kind == "zones" else []


def map_pipe(one: PropertyMap, sd: bool = False) -> ET.Element:
    """Colours of the first band or its standard deviation between the quantiles 0.02 and 0.98, interpolated."""
    quantity, values = one.quantity, one.sd if sd else one.values
    low, high = (edge / quantity.scale for edge in shown_range(values))
    pipe, band = ET.Element("pipe"), 1 + list(one.bands).index(f"{quantity.band}_sd" if sd else quantity.band)
    renderer = ET.SubElement(
        pipe, "rasterrenderer", type="singlebandpseudocolor", band=str(band),
        opacity="1", alphaBand="-1", nodataColor="", classificationMin=repr(low), classificationMax=repr(high),
    )  # fmt: skip
    shader = ET.SubElement(
        ET.SubElement(renderer, "rastershader"), "colorrampshader", colorRampType="INTERPOLATED",
        classificationMode="2", clip="0", minimumValue=repr(low), maximumValue=repr(high), labelPrecision="3",
    )  # fmt: skip
    colours = colour_ramp(UNCERTAIN if sd else quantity.colours, RAMP_ITEMS).tolist()
    for value, colour in zip(np.linspace(low, high, RAMP_ITEMS).tolist(), colours, strict=True):
        label = f"{value * quantity.scale:.3g} {one.unit}"
        ET.SubElement(shader, "item", value=repr(value), color=_hex(colour), alpha="255", label=label)
    ET.SubElement(pipe, "rasterresampler", maxOversampling="2")
    return pipe


def _zones(layer: Layer) -> ET.Element:
    """A colour for each class of zones."""
    quantity = MOISTURE if MOISTURE.column in layer.columns else RATE
    guessed = f", {ILLUSTRATIVE}" if ILLUSTRATIVE in layer.columns["CALIBRATED"] else ""
    numbers = np.unique(layer.columns["ZONE"]).tolist()
    ramp = colour_ramp(quantity.colours, len(numbers)).tolist()
    symbols = [
        _symbol(
            "fill", "SimpleFill", color=_rgba(colour, 200), outline_color="255,255,255,255", outline_width="0.3"
        )
        for colour in ramp
    ]
    renderer = ET.Element(
        "renderer-v2", type="categorizedSymbol", attr="ZONE", symbollevels="0", enableorderby="0"
    )
    categories = ET.SubElement(renderer, "categories")
    for place, number in enumerate(numbers):
        means = layer.columns[quantity.column][layer.columns["ZONE"] == number]
        areas = layer.columns["AREA_HA"][layer.columns["ZONE"] == number]
        mean = np.average(means, weights=np.maximum(areas, 1e-9))
        name = layer.columns["NAME"][layer.columns["ZONE"] == number][0] if "NAME" in layer.columns else "zone"
        label = f"{name} {number}: {mean:.1f} {quantity.unit}{guessed}, {areas.sum():.2f} ha"
        ET.SubElement(
            categories, "category", value=str(number), symbol=str(place), label=label, render="true", type="long"
        )
    _symbols(renderer, symbols)
    return renderer


def _single(symbol: ET.Element) -> ET.Element:
    renderer = ET.Element("renderer-v2", type="singleSymbol", symbollevels="0", enableorderby="0")
    _symbols(renderer, [symbol])
    return renderer


def _symbols(renderer: ET.Element, symbols: Sequence[ET.Element]) -> None:
    several = ET.SubElement(renderer, "symbols")
    for number, symbol in enumerate(symbols):
        symbol.set("name", str(number))
        several.append(symbol)


def _symbol(kind: str, layer_class: str, **options: str) -> ET.Element:
    symbol = ET.Element("symbol", type=kind, alpha="1", clip_to_extent="1", force_rhr="0")
    layer = ET.SubElement(symbol, "layer", {"class": layer_class, "pass": "0", "enabled": "1", "locked": "0"})
    units = dict.fromkeys(("outline_width_unit", "size_unit", "line_width_unit"), "MM")
    _options(layer, {**units, **options})
    return symbol


def _options(parent: ET.Element, options: Mapping[str, str]) -> None:
    several = ET.SubElement(parent, "Option", type="Map")
    for key, value in options.items():
        ET.SubElement(several, "Option", name=key, type="QString", value=value)


def _labels(column: str) -> ET.Element:
    labeling = ET.Element("labeling", type="simple")
    settings = ET.SubElement(labeling, "settings", calloutType="simple")
    style = ET.SubElement(
        settings, "text-style", fieldName=column, isExpression="0", fontSize="8", fontSizeUnit="Point",
        textColor=_rgba(_INK), fontFamily="Open Sans", namedStyle="Regular",
    )  # fmt: skip
    ET.SubElement(
        style, "text-buffer", bufferDraw="1", bufferSize="0.7", bufferSizeUnits="MM", bufferColor="255,255,255,255"
    )
    ET.SubElement(settings, "placement", placement="2", placementFlags="9", dist="0")
    ET.SubElement(settings, "rendering", drawLabels="1", scaleVisibility="0", obstacle="1")
    return labeling


def _document(*elements: ET.Element) -> str:
    document = ET.Element("qgis", version=VERSION, styleCategories="Symbology|Labeling", labelsEnabled="1")
    document.extend(elements)
    text = ET.tostring(document, encoding="unicode")
    return f"<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n{text}\n"


def _hex(colour: Iterable[int]) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)


def _rgba(colour: _Colour, opacity: int = 255) -> str:
    return ",".join(str(part) for part in (*colour, opacity))


# Vector files: all layers of a run in one GeoPackage with styles for QGIS; zones and contours as shapefiles -----

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


# A QGIS project: the GeoPackage, the maps with their styles, and a project file that shows all of it ------------

PROJECT = "soilmoist"
HIDDEN = ("records", "contours", "zones", "visits")
"""Kinds of layers that are in the project but hidden at first, as samples of further properties are."""
RUN_LAYERS = (("field", "Polygon"), ("no_go", "Polygon"), ("track", "LineString"))
"""Layers of ``samples.geojson`` other than the samples, those to draw below first, and their geometry."""
_OF_MOISTURE = ("samples", "zones", "contours")
GEOMETRY = {"Point": "Point", "LineString": "Line", "Polygon": "Polygon", "MultiPolygon": "Polygon"}


def write_qgis(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``soilmoist.qgz`` with all that it shows: the maps, a style for each, and ``soilmoist.gpkg``.

    QGIS also applies ``map.qml`` when ``map.tif`` alone is opened.

    :raises InputError: if pyogrio is not installed, or the settings are out of range
    """
    layers = run_layers(source, settings)
    written = [write_package(source, folder, layers)]
    for one in source.properties:
        name = f"map{one.suffix}"
        copy = folder / f"{name}.tif"
        shutil.copyfile(source.run.folder / copy.name, copy)
        style = folder / f"{name}.qml"
        style.write_text(map_style(one), encoding="utf-8")
        written += [copy, style]
    crs = source.properties[0].crs
    shown = [_Shown(layer, f"./{FILE}|layername={layer.name}", crs) for layer in layers]
    path = folder / f"{PROJECT}.qgz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{PROJECT}.qgs", _project(source.title, source.properties, shown))
    return [*written, path]


def write_run_project(path: Path, title: str, maps: Sequence[PropertyMap]) -> Path:
    """Write a project that shows the files of a run in its folder: GeoTIFFs, and layers of ``samples.geojson``.

    :param path: file to write
    :param title: title of the project
    :param maps: maps of all properties; samples and records are not needed
    :returns: ``path``
    """
    import pyproj

    geographic = pyproj.CRS.from_epsg(4326)
    layers = [Layer(*parts, [], {}) for parts in RUN_LAYERS]
    layers += [Layer(f"samples{one.suffix}", "Point", [], {}) for one in maps]
    shown = []
    for layer in layers:
        file, kind = (layer.name, "sample") if layer.name.startswith("samples") else ("samples", layer.name)
        source = f"./{file}.geojson|layername={file}|geometrytype={layer.kind}|subset=kind = '{kind}'"
        shown.append(_Shown(layer, source, geographic))
    path.write_text(_project(title, maps, shown), encoding="utf-8")
    return path


@dataclass(frozen=True, eq=False)
class _Shown:
    """A layer of points, lines or areas, and where QGIS finds it."""

    layer: Layer
    source: str
    crs: CRS


def _project(title: str, properties: Sequence[PropertyMap], layers: Sequence[_Shown]) -> str:
    """The project; its layers, the first at the bottom, lie above the maps."""
    crs = properties[0].crs
    root = ET.Element("qgis", projectname=title, version=VERSION)
    ET.SubElement(root, "title").text = title
    ET.SubElement(root, "projectCrs").append(_srs(crs))
    tree = ET.SubElement(root, "layer-tree-group")
    maps = ET.SubElement(root, "projectlayers")
    for one in reversed(layers):
        name = one.layer.name
        shown = name.split("_")[0] not in HIDDEN and not name.startswith("samples_")
        guessed = name.startswith(_OF_MOISTURE) and properties[0].calibration == ILLUSTRATIVE
        title = f"{name} ({ILLUSTRATIVE})" if guessed else name
        _entry(tree, name, shown, "ogr", one.source, title)
        element = _layer(maps, name, title, one.source, "ogr", one.crs)
        element.set("type", "vector")
        element.set("geometry", GEOMETRY[one.layer.kind])
        element.set("labelsEnabled", "1")
        element.extend(style_elements(one.layer))
    for number, each in enumerate(properties):
        file = f"map{each.suffix}"
        for key, name, sd in ((file, each.title, False), (f"{file}_sd", f"{each.title}, SD", True)):
            _entry(tree, key, number == 0 and not sd, "gdal", f"./{file}.tif", name)
            element = _layer(maps, key, name, f"./{file}.tif", "gdal", each.crs)
            element.set("type", "raster")
            element.append(map_pipe(each, sd))
    settings = ET.SubElement(root, "properties")
    reference = ET.SubElement(settings, "SpatialRefSys")
    ET.SubElement(reference, "ProjectionsEnabled", type="int").text = "1"
    ET.SubElement(ET.SubElement(settings, "Paths"), "Absolute", type="bool").text = "false"
    view = ET.SubElement(ET.SubElement(root, "ProjectViewSettings", UseProjectScales="0"),
                         "DefaultViewExtent", _extent(properties[0]))  # fmt: skip
    view.append(_srs(crs))
    return f"<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n{ET.tostring(root, encoding='unicode')}\n"


def _entry(tree: ET.Element, key: str, shown: bool, provider: str, source: str, name: str = "") -> None:
    ET.SubElement(
        tree, "layer-tree-layer", id=f"{PROJECT}_{key}", name=name or key,
        checked="Qt::Checked" if shown else "Qt::Unchecked", expanded="1" if shown else "0",
        providerKey=provider, source=source,
    )  # fmt: skip


def _layer(parent: ET.Element, key: str, name: str, source: str, provider: str, crs: CRS) -> ET.Element:
    element = ET.SubElement(parent, "maplayer", hasScaleBasedVisibilityFlag="0", autoRefreshEnabled="0")
    texts = {"id": f"{PROJECT}_{key}", "datasource": source, "layername": name, "provider": provider}
    for tag, text in texts.items():
        ET.SubElement(element, tag).text = text
    ET.SubElement(element, "srs").append(_srs(crs))
    return element


def _srs(crs: CRS) -> ET.Element:
    element = ET.Element("spatialrefsys", nativeFormat="Wkt")
    ET.SubElement(element, "wkt").text = crs.to_wkt()
    if crs.to_epsg() is not None:
        ET.SubElement(element, "authid").text = f"EPSG:{crs.to_epsg()}"
    ET.SubElement(element, "description").text = crs.name
    return element


def _extent(one: PropertyMap) -> dict[str, str]:
    """Box of the map, a tenth wider."""
    height, width = one.values.shape
    x, y = transformed(one.transform, (-0.05 * width, 1.05 * width), (1.05 * height, -0.05 * height))
    (x0, x1), (y0, y1) = x.tolist(), y.tolist()
    return {"xmin": repr(x0), "ymin": repr(y0), "xmax": repr(x1), "ymax": repr(y1)}
