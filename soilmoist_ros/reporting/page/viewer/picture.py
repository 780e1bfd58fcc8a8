# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the map for paper and for browsers without scripts, in true proportions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, calibration_of
from soilmoist_ros.reporting.colours import RATE, UNCERTAIN, WATER, colour_ramp, coloured_png, hex_ramp
from soilmoist_ros.reporting.geometry import rings
from soilmoist_ros.reporting.page.charts.chart import round_step, round_ticks
from soilmoist_ros.reporting.page.style import FAINT, INK, SOFT, Picture, data_uri
from soilmoist_ros.reporting.page.viewer.layers import colour_limits, interval_width, moisture_limits, view
from soilmoist_ros.reporting.page.viewer.packing import thinning

Array = NDArray[np.float64]

WIDTH, SIDE, TOP, BOTTOM = 302.0, 7.0, 25.0, 54.0
"""Width of a picture, and its margins around the map [pt]."""
TALLEST = 1.3
"""Longest height of a map, as a share of its largest width."""
TEXT_PT = 10.5
"""Size of the text: 12 px where the picture is as wide as a phone."""
FEW_SAMPLES, MANY_SAMPLES = 60, 400
COLOURS: Final = 255
TICKS: Final = 6
_STYLE: Final = (
    f"text{{font:{TEXT_PT}px system-ui,sans-serif;fill:{INK}}}.m{{text-anchor:middle}}.e{{text-anchor:end}}"
    "path{fill:none;stroke-linejoin:round;stroke-linecap:round}"
)


def pictures(run: MapRun) -> Iterator[Picture]:
    """The map and its uncertainty of each property."""
    for one in run.properties:
        name = f" of {one.label or one.name}" if run.others else ""
        soil_map = one.soil_map
        if one.calibrated:
            vwc = 100 * soil_map.vwc
            guessed = f", {ILLUSTRATIVE}" if calibration_of(one) == ILLUSTRATIVE else ""
            label = f"Soil moisture [% by volume{guessed}]"
            yield _picture(one, vwc, WATER, moisture_limits(one), label, name, soil_map.beyond_limits)
            width = interval_width(one)
            limits = (0.0, colour_limits(width)[1])
            yield _picture(one, width, UNCERTAIN, limits, "Width of the 90 % interval [% by volume]", name)
        else:
            limits = colour_limits(soil_map.rate, soil_map.rate_sd)
            yield _picture(one, soil_map.rate, RATE, limits, "Neutron count rate [counts/s]", name)
            limits = (0.0, colour_limits(soil_map.rate_sd)[1])
            yield _picture(one, soil_map.rate_sd, UNCERTAIN, limits, "Standard deviation [counts/s]", name)


def _picture(
    run: MapRun, values: Array, colours: str, limits: tuple[float, float], label: str, of: str,
    hatch: NDArray[np.bool_] | None = None,
) -> Picture:  # fmt: skip
    hatched = hatch is not None and bool((hatch & run.soil_map.grid.mask).any())
    alt = f"Map{of}: {label[0].lower()}{label[1:]} in {run.field_name or 'the field'}, with the samples"
    if hatched:
        alt += "; hatched where the interval reaches dry or saturated soil"
    return Picture(data_uri("image/svg+xml", draw(run, values, colours, limits, label, hatch).encode()), alt)


@dataclass(frozen=True)
class _Sheet:
    """Where the map lies in the picture.

    :param west: western edge of what is shown [m]
    :param south: its southern edge [m]
    :param left: left edge of the map [pt]
    :param bottom: its bottom, from the top of the picture [pt]
    :param scale: [pt/m]
    """

    west: float
    south: float
    left: float
    bottom: float
    scale: float

    def path(self, xy: Array) -> str:
        """Data of an SVG path through places in the field, shape (n, 2) [m]."""
        return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in self.points(xy).tolist())

    def points(self, xy: Array) -> Array:
        """Places in the picture [pt] of places in the field [m], shape (n, 2)."""
        return np.asarray((self.left, self.bottom) + self.scale * (xy - (self.west, self.south)) * (1, -1))


def draw(
    run: MapRun, values: Array, colours: str, limits: tuple[float, float], label: str,
    hatch: NDArray[np.bool_] | None = None,
) -> str:  # fmt: skip
    """One raster with the field's boundary, the samples, a scale bar, a north arrow and a colour bar, as SVG.

    :param values: shape (ny, nx), in the unit of the label
    :param limits: values of the first and the last colour
    :param hatch: cells to hatch, shape (ny, nx)
    """
    mask = run.soil_map.grid.mask
    west, east, south, north = view(run)
    room = WIDTH - 2 * SIDE
    scale = min(room / (east - west), TALLEST * room / (north - south))
    bottom = TOP + scale * (north - south)
    sheet = _Sheet(west, south, (WIDTH - scale * (east - west)) / 2, bottom, scale)
    shown = np.where(mask, values, np.nan)
    height = bottom + BOTTOM
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:.1f}" '
        f'width="{WIDTH * 4 / 3:.0f}" height="{height * 4 / 3:.0f}"><style>{_STYLE}</style>'
        '<rect width="100%" height="100%" fill="#fff"/>',
        _raster(run, sheet, (shown - limits[0]) / (limits[1] - limits[0]), colours),
        "" if hatch is None else _hatching(run, sheet, hatch & mask),
        *(f'<path stroke="{INK}" stroke-width="1.1" d="{sheet.path(ring)}"/>' for ring in rings(run.soil_map)),
        _samples(sheet.points(np.asarray(run.soil_map.samples.xy, float))),
        _scale_bar(sheet, east - west),
        _colour_bar(bottom + 6, colours, limits, shown, label),
        "</svg>",
    ]
    return "".join(parts)


def _raster(run: MapRun, sheet: _Sheet, shares: Array, colours: str) -> str:
    """The cells as a picture in the picture; of a large raster only some rows and columns."""
    step = thinning(shares.shape)
    shares = shares[::step, ::step]
    uri = data_uri("image/png", coloured_png(shares[::-1], colour_ramp(colours, COLOURS)))
    cell = run.soil_map.grid.cell_m * step
    (left, top), (right, bottom) = _box(run, sheet, cell, (0, shares.shape[0]), (shares.shape[1], 0))
    return (
        f'<image x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" height="{bottom - top:.2f}" '
        f'preserveAspectRatio="none" style="image-rendering:pixelated" href="{uri}"/>'
    )


def _box(run: MapRun, sheet: _Sheet, cell_m: float, *corners: tuple[int, int]) -> list[list[float]]:
    """Places in the picture [pt] of corners of cells, as (column, row) from the south-west."""
    grid = run.soil_map.grid
    first = np.array([grid.x_m[0], grid.y_m[0]]) - cell_m / 2
    places: list[list[float]] = sheet.points(first + cell_m * np.array(corners, float)).tolist()
    return places


def _hatching(run: MapRun, sheet: _Sheet, hatch: NDArray[np.bool_]) -> str:
    """Stripes over the cells that are set, a box for each run of them in a row."""
    step = thinning(hatch.shape)
    hatch = hatch[::step, ::step]
    edges = np.diff(np.pad(hatch, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    boxes = []
    for (row, begin), end in zip(
        np.argwhere(edges == 1).tolist(), np.nonzero(edges == -1)[1].tolist(), strict=True
    ):
        corners = (begin, row), (end, row + 1)
        (left, bottom), (right, top) = _box(run, sheet, run.soil_map.grid.cell_m * step, *corners)
        boxes.append(f"M{left:.1f} {bottom:.1f}H{right:.1f}V{top:.1f}H{left:.1f}z")
    if not boxes:
        return ""
    return (
        '<pattern id="h" width="5" height="5" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        f'<path stroke="{INK}" d="M0 0V5"/></pattern><path style="fill:url(#h)" d="{"".join(boxes)}"/>'
    )


def _samples(places: Array) -> str:
    """White dots with a dark edge, smaller the more there are."""
    size = 4.0 if len(places) <= FEW_SAMPLES else 2.4 if len(places) <= MANY_SAMPLES else 1.4
    dots = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in places.tolist())
    return "".join(
        f'<path stroke="{colour}" stroke-width="{width:g}" d="{dots}"/>'
        for colour, width in ((INK, size + 0.4), ("#fff", size - 0.4))
    )


def _scale_bar(sheet: _Sheet, width_m: float) -> str:
    """A scale bar and a north arrow above the map."""
    length_m = round_step(width_m / 8)
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    left, right = sheet.left, sheet.left + sheet.scale * width_m
    end = left + sheet.scale * length_m
    return (
        f'<path stroke="{INK}" stroke-width="2.5" style="stroke-linecap:butt" d="M{left:.1f} 16H{end:.1f}"/>'
        f'<text x="{end + 6:.1f}" y="19.5">{text}</text><text class="e" x="{right:.1f}" y="19.5">N ▲</text>'
    )


def _colour_bar(top: float, colours: str, limits: tuple[float, float], shown: Array, label: str) -> str:
    """The colours with their values and what they mean; an arrow at an end that values lie beyond.

    :param shown: values of the map; NaN without one
    """
    left, right, low, high = 2 * SIDE, WIDTH - 2 * SIDE, top, top + 10
    middle = (low + high) / 2
    stops = hex_ramp(colours, 9)
    below, above = (
        np.nanmin(shown, initial=limits[0]) < limits[0],
        np.nanmax(shown, initial=limits[1]) > limits[1],
    )
    arrows = [
        f'<path style="fill:{colour}" stroke="{FAINT}" d="M{end:g} {low:g}L{tip:g} {middle:g}L{end:g} {high:g}z"/>'
        for colour, end, tip, drawn in ((stops[0], left, left - 8, below), (stops[-1], right, right + 8, above))
        if drawn
    ]
    ticks = []
    for value, text in round_ticks(*limits, TICKS):
        x = left + (value - limits[0]) / (limits[1] - limits[0]) * (right - left)
        ticks.append(
            f'<path stroke="{SOFT}" d="M{x:.1f} {high:g}v3"/><text class="m" x="{x:.1f}" y="{high + 14:g}">'
        )
        ticks.append(f"{text}</text>")
    return "".join(
        [
            '<linearGradient id="c">',
            *(f'<stop offset="{i / 8}" stop-color="{colour}"/>' for i, colour in enumerate(stops)),
            f'</linearGradient><rect x="{left:g}" y="{low:g}" width="{right - left:g}" height="10" '
            f'fill="url(#c)" stroke="{FAINT}"/>',
            *arrows,
            *ticks,
            f'<text class="m" x="{WIDTH / 2:g}" y="{high + 29:g}">{escape(label)}</text>',
        ]
    )
