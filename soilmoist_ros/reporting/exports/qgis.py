# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A QGIS project: the GeoPackage, the maps with their styles, and a project file that shows all of it."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from soilmoist_ros.reporting.exports.qml import VERSION, map_pipe, map_style, style_elements
from soilmoist_ros.reporting.exports.source import ExportSettings, PropertyMap, RunSource, transformed
from soilmoist_ros.reporting.exports.vector_files import FILE, run_layers, write_package
from soilmoist_ros.reporting.exports.vectors import Layer

if TYPE_CHECKING:
    from pyproj import CRS

PROJECT = "soilmoist"
HIDDEN = ("records", "contours", "zones", "visits")
"""Kinds of layers that are in the project but not shown at first."""
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
    project = ET.tostring(_project(source, layers), encoding="unicode")
    path = folder / f"{PROJECT}.qgz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            f"{PROJECT}.qgs", f"<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n{project}\n"
        )
    return [*written, path]


def _project(source: RunSource, layers: Sequence[Layer]) -> ET.Element:
    """The project; layers of the GeoPackage lie above the maps."""
    crs = source.properties[0].crs
    root = ET.Element("qgis", projectname=source.title, version=VERSION)
    ET.SubElement(root, "title").text = source.title
    ET.SubElement(root, "projectCrs").append(_srs(crs))
    tree = ET.SubElement(root, "layer-tree-group")
    maps = ET.SubElement(root, "projectlayers")
    for layer in reversed(layers):
        shown = layer.name.split("_")[0] not in HIDDEN
        _entry(tree, layer.name, shown, "ogr", f"./{FILE}|layername={layer.name}")
        element = _layer(maps, layer.name, layer.name, f"./{FILE}|layername={layer.name}", "ogr", crs)
        element.set("type", "vector")
        element.set("geometry", GEOMETRY[layer.kind])
        element.set("labelsEnabled", "1")
        element.extend(style_elements(layer))
    for number, one in enumerate(source.properties):
        key, name = f"map{one.suffix}", _map_name(one)
        _entry(tree, key, number == 0, "gdal", f"./map{one.suffix}.tif", name)
        element = _layer(maps, key, name, f"./map{one.suffix}.tif", "gdal", one.crs)
        element.set("type", "raster")
        element.append(map_pipe(one))
    properties = ET.SubElement(root, "properties")
    reference = ET.SubElement(properties, "SpatialRefSys")
    ET.SubElement(reference, "ProjectionsEnabled", type="int").text = "1"
    ET.SubElement(ET.SubElement(properties, "Paths"), "Absolute", type="bool").text = "false"
    settings = ET.SubElement(root, "ProjectViewSettings", UseProjectScales="0")
    view = ET.SubElement(settings, "DefaultViewExtent", _extent(source.properties[0]))
    view.append(_srs(crs))
    return root


def _map_name(one: PropertyMap) -> str:
    label = f"{one.label}: " if one.name else ""
    return f"{label}{one.quantity.title} [{one.quantity.unit}]"


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
