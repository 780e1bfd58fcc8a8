# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps as files of rasters: coloured GeoTIFF for farm software, KMZ for phones."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.pipeline import EARLIEST_STAMP_S
from soilmoist_ros.reporting.certainty import NO_LEVEL, guess_text
from soilmoist_ros.reporting.colours import colour_ramp, coloured_png, palette_png
from soilmoist_ros.reporting.exports.layers import to_crs
from soilmoist_ros.reporting.exports.source import MOISTURE, ExportedProperty, ExportSettings, RunSource
from soilmoist_ros.reporting.exports.zones import shown_range
from soilmoist_ros.reporting.page.frame import fill_template, round_step

DATE_TIME = "%Y-%m-%dT%H:%M:%SZ"
NODATA, MAX_VALUE = 255, 254
"""Pixel without a value, and largest value, of a coloured GeoTIFF."""
LONG_SIDE_PX = 1024
COLOURS = 256


def write_styled(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map_styled.tif`` for each property: one band of 8 bits, cloud-optimised, with a colour table.

    A pixel is moisture in whole percent by volume. A rate is ``pixel * scale + offset`` of the band.
    """
    return [_write_styled(one, folder / f"map_styled{one.suffix}.tif") for one in source.properties]


def _write_styled(one: ExportedProperty, path: Path) -> Path:
    import rasterio

    pixels, scale, offset = _pixels(one)
    ramp = colour_ramp(one.quantity.colours, COLOURS)
    places = np.round(255 * _shares(one, np.arange(MAX_VALUE + 1) * scale + offset)).astype(int)
    table = {value: (*ramp[place].tolist(), 255) for value, place in enumerate(places)}
    profile = {
        "driver": "COG", "dtype": "uint8", "count": 1, "width": pixels.shape[1], "height": pixels.shape[0],
        "crs": rasterio.crs.CRS.from_wkt(one.crs.to_wkt()), "transform": one.transform, "nodata": NODATA,
        "compress": "deflate", "blocksize": 256, "overview_resampling": "nearest",
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as file:
        file.write(pixels, 1)
        file.write_colormap(1, {**table, NODATA: (0, 0, 0, 0)})
        file.set_band_description(1, one.quantity.band)
        file.set_band_unit(1, one.quantity.unit)
        file.scales, file.offsets = (scale,), (offset,)
        file.update_tags(1, long_name=one.quantity.title, units=one.unit)
        kept = ("SOILMOIST_", "TIFFTAG_")
        file.update_tags(**{key: text for key, text in one.tags.items() if key.startswith(kept)})
    return path


def _pixels(one: ExportedProperty) -> tuple[NDArray[np.uint8], float, float]:
    """Pixels with the value of one step and of pixel 0."""
    values = one.values
    inside = np.isfinite(values)
    scale, offset = 1.0, 0.0
    if one.quantity is not MOISTURE:
        low, high = float(values[inside].min()), float(values[inside].max())
        scale = round_step(max(high - low, 1e-6) / (MAX_VALUE - 1))
        offset = float(np.floor(low / scale) * scale)
    steps = np.clip(np.round((np.where(inside, values, 0.0) - offset) / scale), 0, MAX_VALUE)
    return np.where(inside, steps, NODATA).astype(np.uint8), scale, offset


def write_kmz(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map.kmz`` for each property: the map as an overlay, its legend, the samples and the field.

    All pictures are inside: it works without network.
    """
    return [_write_kmz(source, one, folder / f"map{one.suffix}.kmz") for one in source.properties]


def _write_kmz(source: RunSource, one: ExportedProperty, path: Path) -> Path:
    from pyproj import CRS

    picture, box = _overlay(one)
    label = f", {one.label}" if one.name else ""
    guessed = guess_text(one.calibration)
    (shape,) = to_crs([source.boundary], source.frame, CRS.from_epsg(4326))
    text = fill_template(
        "map.kml.j2", title=f"{source.title}{label}: {one.quantity.title.lower()}{guessed}",
        about=_in_words(source, one),
        survey=source.survey and [time.strftime(DATE_TIME) for time in source.survey], overlay=one.title, box=box,
        field=source.title,
        parts=[
            [" ".join(f"{x:.7f},{y:.7f}" for x, y, *_ in ring.coords) for ring in (part.exterior, *part.interiors)]
            for part in getattr(shape, "geoms", [shape])
        ],
        samples=list(_sample_marks(one)),
    )  # fmt: skip
    files: dict[str, str | bytes] = {
        "doc.kml": text, "map.png": picture, "legend.png": _legend(source, one),
        "place.png": palette_png(np.hypot(*np.mgrid[-1:1:64j, -1:1:64j]) > 1, np.full((1, 3), 255, np.uint8)),
    }  # fmt: skip
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def _in_words(source: RunSource, one: ExportedProperty) -> str:
    """Date and colours in words: programs on phones show no legend."""
    low, high = shown_range(one.values)
    sentences = ["Simulated counts."] if source.simulated else []
    if one.calibration in NO_LEVEL:
        what = f"{one.calibration.capitalize()} calibration"
        sentences.append(f"{what}: the pattern is real, the level of the moisture is not.")
    if source.survey is not None:
        begin, end = (f"{time:%Y-%m-%d %H:%M}" for time in source.survey)
        sentences.append(f"Survey {begin} to {end} UTC.")
    sentences.append(f"Colours from {low:.3g} (pale) to {high:.3g} {one.quantity.unit} (dark).")
    return " ".join([*sentences, "Made by soilmoist_ros."])


def _overlay(one: ExportedProperty) -> tuple[bytes, dict[str, float]]:
    """The map as a picture on even longitudes and latitudes, and its box [deg]."""
    from rasterio import Affine
    from rasterio.crs import CRS
    from rasterio.warp import Resampling, reproject

    values = one.values
    height, width = values.shape
    column, row = np.meshgrid(np.linspace(-0.5, width - 0.5, 9), np.linspace(-0.5, height - 0.5, 9))
    edge = np.column_stack([column.ravel(), row.ravel()])  # as far as the edge of the raster
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
    picture = coloured_png(_shares(one, target), colour_ramp(one.quantity.colours, COLOURS - 1))
    return picture, {"north": north, "south": south, "east": centre + east, "west": centre + west}


def _shares(one: ExportedProperty, values: ArrayLike) -> NDArray[np.float64]:
    """Place of values on the colour scale, 0..1."""
    low, high = shown_range(one.values)
    return np.asarray(np.clip((np.asarray(values, float) - low) / (high - low), 0, 1))


def _legend(source: RunSource, one: ExportedProperty) -> bytes:
    """Colour scale with the title and the date."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.9, 0.95), dpi=120, facecolor="white")
    ramp = ListedColormap(colour_ramp(one.quantity.colours, COLOURS) / 255)
    scale = ScalarMappable(Normalize(*shown_range(one.values)), ramp)
    bar = figure.colorbar(scale, cax=figure.add_axes((0.06, 0.36, 0.88, 0.2)), orientation="horizontal")
    bar.ax.tick_params(labelsize=10)
    figure.text(0.06, 0.7, f"{one.quantity.title} [{one.quantity.unit}]", fontsize=10, fontweight="bold")
    if one.calibration in (*NO_LEVEL, "simulated") or source.simulated:
        word = one.calibration if one.calibration in NO_LEVEL else "simulated"
        figure.text(0.94, 0.02, word, fontsize=8, ha="right")
    if source.survey is not None:
        figure.text(0.06, 0.02, f"{source.survey[1]:%Y-%m-%d}", fontsize=8)
    content = io.BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()


def _sample_marks(one: ExportedProperty) -> Iterator[tuple[str, str, str, str, str]]:
    """Name, description, time, colour and place of each sample, coloured like the map."""
    samples, quantity = one.samples, one.quantity
    words = {
        "raw_counts": ("{:.0f} counts", 1.0), "effective_exposure_s": ("{:.0f} s of exposure", 1.0),
        "rate_cps": ("{:.3f} counts/s", 1.0), "vwc": ("moisture {:.1f} % by volume", 100.0),
        "vwc_p05": ("90 % interval from {:.1f} %", 100.0), "vwc_p95": ("to {:.1f} %", 100.0),
    }  # fmt: skip
    values = samples.get("vwc" if quantity is MOISTURE else "rate_cps", np.empty(0)) * quantity.scale
    ends = samples.get("last_stamp_s", np.full(len(values), np.nan)).tolist()
    ramp = colour_ramp(quantity.colours, COLOURS).tolist()
    for row, share in enumerate(_shares(one, values).tolist()):
        known, dated = bool(np.isfinite(values[row])), ends[row] >= EARLIEST_STAMP_S
        red, green, blue = ramp[round(share * (COLOURS - 1))] if known else (160, 160, 160)
        about = {key: float(samples[key][row]) for key in words if key in samples}
        yield (
            f"{values[row]:.1f} {one.unit}" if known else "no value",
            "\n".join(words[key][0].format(words[key][1] * at) for key, at in about.items() if np.isfinite(at)),
            datetime.fromtimestamp(ends[row], UTC).strftime(DATE_TIME) if dated else "",
            f"ff{blue:02x}{green:02x}{red:02x}",
            f"{samples['longitude_deg'][row]:.7f},{samples['latitude_deg'][row]:.7f}",
        )
