# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Terminal view of a running mission: state, numbers, and a small map of each property."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import printable

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

Array = NDArray[np.float64]

DRY_TO_WET = np.array(
    [
        (253, 237, 196),
        (222, 226, 150),
        (152, 203, 129),
        (72, 172, 147),
        (29, 133, 158),
        (26, 88, 147),
        (34, 42, 107),
    ],
    float,
)
"""Colours from dry to wet: light sand over green to deep blue, in even steps of lightness, shape (7, 3)."""
_ROBOT, _TARGET, _SAMPLE = (230, 30, 60), (255, 140, 0), (20, 20, 20)


@dataclass(frozen=True, eq=False)
class LiveBand:
    """A map to show.

    :param name: name of the map with its unit
    :param values: values, shape (ny, nx), south first; NaN outside
    :param extent: west, east, south, north [m]
    :param wet_is_high: whether high values are wet
    """

    name: str
    values: Array
    extent: tuple[float, float, float, float]
    wet_is_high: bool = True


@dataclass(frozen=True, eq=False)
class LiveView:
    """The content of the view; every part may be missing.

    :param title: first line
    :param facts: short name -> text, one line each
    :param bands: a map of each property
    :param samples_xy: places of the samples, shape (n, 2) [m]
    :param robots_xy: place of each robot [m]
    :param targets_xy: place of the current stop of each robot that has one [m]
    """

    title: str
    facts: Mapping[str, str]
    bands: Sequence[LiveBand] = ()
    samples_xy: Array = field(default_factory=lambda: np.empty((0, 2)))
    robots_xy: Sequence[tuple[float, float]] = ()
    targets_xy: Sequence[tuple[float, float]] = ()


def render(view: LiveView, columns: int = 56, rows: int = 20) -> RenderableType:
    """The view for a rich console.

    :param columns: maximum width of all pictures side by side
    :param rows: maximum height of a picture
    """
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="bold", no_wrap=True)
    facts.add_column(overflow="fold")
    for name, value in view.facts.items():
        facts.add_row(Text(printable(name)), Text(printable(value)))  # as Text: rich would read brackets as markup
    parts: list[RenderableType] = [Text(printable(view.title), style="bold reverse"), facts]
    if not view.bands:
        parts.append(Text("no map yet: it begins with the first samples", style="dim"))
        return Group(*parts)
    pictures = Table.grid(padding=(0, 1))
    width = max(1, (columns + 1) // len(view.bands) - 1 if len(view.bands) > 1 else columns)
    pictures.add_row(*(map_picture(view, band, width, max(1, rows)) for band in view.bands))
    return Group(*parts, pictures, *map(scale, view.bands), legend())


def map_picture(view: LiveView, band: LiveBand, columns: int, rows: int) -> Text:
    """A map in half blocks, two cells of the picture per character, north up."""
    from rich.text import Text

    pixels = _pixels(view, band, columns, 2 * rows)
    text = Text(no_wrap=True, overflow="crop")
    for line in range(0, len(pixels), 2):
        if line:
            text.append("\n")
        for upper, lower in zip(pixels[line], pixels[line + 1], strict=True):
            above, below = (None if pixel[0] < 0 else _hex(pixel) for pixel in (upper, lower))
            if above is None and below is None:
                text.append(" ")
            elif above is None:
                text.append("▄", style=str(below))
            else:
                text.append("▀", style=above if below is None else f"{above} on {below}")
    return text


def scale(band: LiveBand) -> Text:
    """Colour scale of a picture."""
    from rich.text import Text

    low, high = _limits(band)
    text = Text(f"{band.name} {low:.3g} ")
    for share in np.linspace(0, 1, 16):
        text.append("█", style=_hex(_colour(np.array([share if band.wet_is_high else 1 - share]))[0]))
    text.append(f" {high:.3g}")
    return text


def legend() -> Text:
    """Legend of the markers."""
    from rich.text import Text

    text = Text()
    for colour, name in ((_ROBOT, "robot"), (_TARGET, "target"), (_SAMPLE, "sample")):
        text.append("■", style=_hex(colour))
        text.append(f" {name}  ")
    return text


def _pixels(view: LiveView, band: LiveBand, columns: int, lines: int) -> Array:
    """Colours of the picture, north first, shape (lines, columns, 3); -1 outside the field."""
    ny, nx = band.values.shape
    factor = max(nx / columns, ny / lines)
    width, height = max(1, round(nx / factor)), max(2, round(ny / factor))
    height += height % 2
    row = np.minimum((np.arange(height) + 0.5) / height * ny, ny - 1).astype(int)[::-1]
    column = np.minimum((np.arange(width) + 0.5) / width * nx, nx - 1).astype(int)
    values = band.values[np.ix_(row, column)]
    low, high = _limits(band)
    share = np.clip((values - low) / (high - low), 0, 1) if high > low else np.where(np.isnan(values), np.nan, 0.5)
    colours = _colour(share if band.wet_is_high else 1 - share)
    west, east, south, north = band.extent

    def mark(places: Sequence[Sequence[float]] | Array, colour: tuple[int, int, int]) -> None:
        for x, y in places:
            if np.isfinite(x) and np.isfinite(y):
                # A marker beyond the map is drawn at its edge, to show the direction.
                i = min(max((north - y) / max(north - south, 1e-9), 0.0), 1.0) * height
                j = min(max((x - west) / max(east - west, 1e-9), 0.0), 1.0) * width
                colours[min(int(i), height - 1), min(int(j), width - 1)] = colour

    mark(view.samples_xy, _SAMPLE)
    mark(view.targets_xy, _TARGET)
    mark(view.robots_xy, _ROBOT)
    return colours


def _limits(band: LiveBand) -> tuple[float, float]:
    """Smallest and largest value of the colours: quantiles, so that a few outliers have no effect."""
    known = band.values[np.isfinite(band.values)]
    return (float(np.quantile(known, 0.02)), float(np.quantile(known, 0.98))) if known.size else (0.0, 0.0)


def _colour(share: Array) -> Array:
    place = np.nan_to_num(share, nan=0.0) * (len(DRY_TO_WET) - 1)
    steps = np.arange(len(DRY_TO_WET))
    found = np.stack([np.interp(place, steps, DRY_TO_WET[:, band]) for band in range(3)], axis=-1)
    found[np.isnan(share)] = -1
    return found


def _hex(colour: Array | tuple[int, int, int]) -> str:
    red, green, blue = (int(part) for part in colour)
    return f"#{red:02x}{green:02x}{blue:02x}"
