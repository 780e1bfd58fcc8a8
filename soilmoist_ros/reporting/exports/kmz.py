# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map for phones: KMZ with the map as an overlay, its legend, the samples and the field."""

from __future__ import annotations

import io
import zipfile
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.pipeline import EARLIEST_STAMP_S
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.colours import colour_ramp
from soilmoist_ros.reporting.exports.classes import shown_range
from soilmoist_ros.reporting.exports.source import ExportSettings, PropertyMap, RunSource
from soilmoist_ros.reporting.exports.vectors import to_crs

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

KML = "http://www.opengis.net/kml/2.2"
LONG_SIDE_PX = 1024
COLOURS = 256


def write_kmz(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map.kmz`` for each property, with all pictures inside: it works without network."""
    return [_write(source, one, folder / f"map{one.suffix}.kmz") for one in source.properties]


def _write(source: RunSource, one: PropertyMap, path: Path) -> Path:
    picture, box = _overlay(one)
    document = ET.Element("Document")
    _texts(document, name=_title(source, one), description=_about(source, one))
    _span(document, source.survey)
    style = _into(document, "Style", id="field")
    _texts(_into(style, "LineStyle"), color="ff3c3022", width="2")
    _texts(_into(style, "PolyStyle"), fill="0")
    overlay = _into(document, "GroundOverlay")
    _texts(overlay, name=one.title)
    _texts(_into(overlay, "Icon"), href="map.png")
    _texts(_into(overlay, "LatLonBox"), **{key: f"{value:.8f}" for key, value in box.items()})
    legend = _into(document, "ScreenOverlay")
    _texts(legend, name="Legend")
    _texts(_into(legend, "Icon"), href="legend.png")
    for kind, x, y in (("overlayXY", "0", "0"), ("screenXY", "12", "28")):
        ET.SubElement(legend, kind, x=x, y=y, xunits="pixels", yunits="pixels")
    field = _into(document, "Placemark")
    _texts(field, name=source.title, styleUrl="#field")
    _polygons(field, source)
    _samples(_into(document, "Folder"), one)
    kml = ET.Element("kml", xmlns=KML)
    kml.append(document)
    files = {
        "doc.kml": ET.tostring(kml, encoding="utf-8", xml_declaration=True),
        "map.png": picture,
        "legend.png": _legend(source, one),
        "place.png": _place(),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def _title(source: RunSource, one: PropertyMap) -> str:
    label = f", {one.label}" if one.name else ""
    guessed = f", {ILLUSTRATIVE}" if one.calibration == ILLUSTRATIVE else ""
    return f"{source.title}{label}: {one.quantity.title.lower()}{guessed}"


def _about(source: RunSource, one: PropertyMap) -> str:
    """Date and colours in words: programs on phones show no legend."""
    low, high = shown_range(one.values)
    sentences = ["Simulated counts."] if source.simulated else []
    if one.calibration == ILLUSTRATIVE:
        sentences.append("Illustrative calibration: the pattern is real, the level of the moisture is not.")
    if source.survey is not None:
        begin, end = (f"{time:%Y-%m-%d %H:%M}" for time in source.survey)
        sentences.append(f"Survey {begin} to {end} UTC.")
    sentences.append(f"Colours from {low:.3g} (pale) to {high:.3g} {one.quantity.unit} (dark).")
    return " ".join([*sentences, "Made by soilmoist_ros."])


def _overlay(one: PropertyMap) -> tuple[bytes, dict[str, float]]:
    """The map as a picture on even longitudes and latitudes, and its box [deg]."""
    from rasterio import Affine
    from rasterio.crs import CRS
    from rasterio.warp import Resampling, reproject

    values = one.values
    height, width = values.shape
    edge = np.array([(c, r) for c in (-0.5, width - 0.5) for r in np.linspace(-0.5, height - 0.5, 9)])
    edge = np.vstack([edge, [(c, r) for r in (-0.5, height - 0.5) for c in np.linspace(-0.5, width - 0.5, 9)]])
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
    box = {"north": north, "south": south, "east": centre + east, "west": centre + west}
    return _png(_coloured(one, target)), box


def _shares(one: PropertyMap, values: ArrayLike) -> NDArray[np.float64]:
    """Place of values on the colour scale, 0..1."""
    low, high = shown_range(one.values)
    return np.asarray(np.clip((np.asarray(values, float) - low) / (high - low), 0, 1))


def _coloured(one: PropertyMap, values: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Red, green, blue and opacity, shape (rows, columns, 4)."""
    inside = np.isfinite(values)
    ramp = colour_ramp(one.quantity.colours, COLOURS)
    index = np.round(np.nan_to_num(_shares(one, values)) * (COLOURS - 1)).astype(int)
    return np.dstack([ramp[index], np.where(inside, 255, 0).astype(np.uint8)])


def _legend(source: RunSource, one: PropertyMap) -> bytes:
    """Colour scale with the title and the date."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.9, 0.95), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    ramp = ListedColormap(colour_ramp(one.quantity.colours, COLOURS) / 255)
    scale = ScalarMappable(Normalize(*shown_range(one.values)), ramp)
    bar = figure.colorbar(scale, cax=figure.add_axes((0.06, 0.36, 0.88, 0.2)), orientation="horizontal")
    bar.ax.tick_params(labelsize=10)
    figure.text(0.06, 0.7, f"{one.quantity.title} [{one.quantity.unit}]", fontsize=10, fontweight="bold")
    if one.calibration in (ILLUSTRATIVE, "simulated") or source.simulated:
        word = ILLUSTRATIVE if one.calibration == ILLUSTRATIVE else "simulated"
        figure.text(0.94, 0.02, word, fontsize=8, ha="right")
    if source.survey is not None:
        figure.text(0.06, 0.02, f"{source.survey[1]:%Y-%m-%d}", fontsize=8)
    content = io.BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()


def _place() -> bytes:
    """A white disc, coloured by the style of each sample."""
    y, x = np.mgrid[-1:1:32j, -1:1:32j]
    opacity = np.clip((1 - np.hypot(x, y)) * 16, 0, 1)
    return _png(np.dstack([np.full((32, 32, 3), 255, np.uint8), (255 * opacity).astype(np.uint8)]))


def _png(rgba: NDArray[np.uint8]) -> bytes:
    from matplotlib.image import imsave

    content = io.BytesIO()
    imsave(content, rgba, format="png")
    return content.getvalue()


def _samples(folder: ET.Element, one: PropertyMap) -> None:
    """A placemark for each sample, coloured like the map."""
    _texts(folder, name="Samples", open="0")
    samples, quantity = one.samples, one.quantity
    key = "vwc" if quantity.band == "vwc" else "rate_cps"
    values = samples.get(key, np.empty(0)) * quantity.scale
    ramp = colour_ramp(quantity.colours, COLOURS).tolist()
    for row, share in enumerate(_shares(one, values).tolist()):
        known = bool(np.isfinite(values[row]))
        red, green, blue = ramp[round(share * (COLOURS - 1))] if known else (160, 160, 160)
        mark = _into(folder, "Placemark")
        _texts(mark, name=f"{values[row]:.1f} {one.unit}" if known else "no value")
        _texts(mark, description=_row_text(samples, row))
        end = float(samples.get("last_stamp_s", np.full(len(values), np.nan))[row])
        if end >= EARLIEST_STAMP_S:
            _texts(_into(mark, "TimeStamp"), when=f"{datetime.fromtimestamp(end, UTC):%Y-%m-%dT%H:%M:%SZ}")
        style = _into(mark, "Style")
        icon = _into(style, "IconStyle")
        _texts(icon, color=f"ff{blue:02x}{green:02x}{red:02x}", scale="0.6")
        _texts(_into(icon, "Icon"), href="place.png")
        _texts(_into(style, "LabelStyle"), scale="0")
        place = f"{samples['longitude_deg'][row]:.7f},{samples['latitude_deg'][row]:.7f}"
        _texts(_into(mark, "Point"), coordinates=place)


def _row_text(samples: dict[str, NDArray[Any]], row: int) -> str:
    """What is known of a sample, a line each."""
    words = {
        "raw_counts": ("{:.0f} counts", 1.0), "effective_exposure_s": ("{:.0f} s of exposure", 1.0),
        "rate_cps": ("{:.3f} counts/s", 1.0), "vwc": ("moisture {:.1f} % by volume", 100.0),
        "vwc_p05": ("90 % interval from {:.1f} %", 100.0), "vwc_p95": ("to {:.1f} %", 100.0),
    }  # fmt: skip
    known = {key: float(samples[key][row]) for key in words if key in samples}
    return "\n".join(
        words[key][0].format(words[key][1] * value) for key, value in known.items() if np.isfinite(value)
    )


def _polygons(mark: ET.Element, source: RunSource) -> None:
    from pyproj import CRS

    (shape,) = to_crs([source.boundary], source.frame, CRS.from_epsg(4326))
    several = _into(mark, "MultiGeometry")
    for part in getattr(shape, "geoms", [shape]):
        polygon = _into(several, "Polygon")
        for kind, rings in (("outerBoundaryIs", [part.exterior]), ("innerBoundaryIs", part.interiors)):
            for ring in rings:
                _texts(_into(_into(polygon, kind), "LinearRing"), coordinates=_coordinates(ring))


def _coordinates(ring: BaseGeometry) -> str:
    return " ".join(f"{x:.7f},{y:.7f}" for x, y, *_ in ring.coords)


def _span(element: ET.Element, survey: tuple[datetime, datetime] | None) -> None:
    if survey is not None:
        begin, end = (f"{one:%Y-%m-%dT%H:%M:%SZ}" for one in survey)
        _texts(_into(element, "TimeSpan"), begin=begin, end=end)


def _into(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _texts(element: ET.Element, **texts: str) -> None:
    """Children with text, in order."""
    for tag, text in texts.items():
        ET.SubElement(element, tag).text = text
