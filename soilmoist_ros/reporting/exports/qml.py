# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Styles of QGIS (QML) for maps and layers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.colours import UNCERTAIN, colour_ramp
from soilmoist_ros.reporting.exports.classes import shown_range
from soilmoist_ros.reporting.exports.source import MOISTURE, RATE, PropertyMap
from soilmoist_ros.reporting.exports.vectors import Layer

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
