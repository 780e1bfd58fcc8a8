# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A QGIS project: the GeoPackage, the maps with their styles, and a project file that shows all of it."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.exports.qml import VERSION, map_pipe, map_style, style_elements
from soilmoist_ros.reporting.exports.source import ExportSettings, PropertyMap, RunSource, transformed
from soilmoist_ros.reporting.exports.vector_files import FILE, run_layers, write_package
from soilmoist_ros.reporting.exports.vectors import Layer

if TYPE_CHECKING:
    from pyproj import CRS

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
