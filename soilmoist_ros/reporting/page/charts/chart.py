# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A chart: marks in an SVG that stretches with the page, labels as text that does not.

Lines keep their width (``vector-effect``) and dots stay round (lines of length 0 with round caps), so one SVG fits
a phone, a wide screen and paper without a script.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Colour = Literal["ink", "soft", "line", "orange", "purple", "green"]
Limits = tuple[float, float]

BOX = 1000
"""Width and height of the SVG in its own units."""


@dataclass(frozen=True, eq=False)
class Line:
    """A line; NaN interrupts it."""

    x: ArrayLike
    y: ArrayLike
    colour: Colour = "line"
    name: str = ""
    dashed: bool = False
    width_px: float = 2.0


@dataclass(frozen=True, eq=False)
class Dots:
    """Dots of one size or of a size each; ``error`` draws bars of that half length."""

    x: ArrayLike
    y: ArrayLike
    colour: Colour = "line"
    name: str = ""
    size_px: ArrayLike = 6.0
    hollow: bool = False
    error: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class Area:
    """A band between two lines; NaN interrupts it. Bars of a histogram are an area above 0 with steps."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    colour: Colour = "line"
    name: str = ""


Mark = Line | Dots | Area


@dataclass(frozen=True)
class Path:
    """One SVG path: its data, its class and its width in pixels."""

    d: str
    css: str
    width_px: float = 0.0


@dataclass(frozen=True)
class Tick:
    """A label of an axis.

    :param percent: position along the axis [%]
    :param text: label
    :param minor: hidden on narrow screens
    """

    percent: float
    text: str
    minor: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart with its texts.

    :param key: anchor in the page
    :param title: heading
    :param alt: description in words, for readers who cannot see it
    :param marks: what is drawn, in order
    :param x: limits of the horizontal axis
    :param y: limits of the vertical axis
    :param x_label: quantity and unit
    :param y_label: quantity and unit
    :param caption: what to see in it
    :param height_px: height of the plot
    :param x_ticks: labels of the horizontal axis as (value, text); made from the limits by default
    :param y_ticks: labels of the vertical axis, likewise
    :param top_ticks: labels above the plot as (value of x, text)
    """

    key: str
    title: str
    alt: str
    marks: Sequence[Mark]
    x: Limits
    y: Limits
    x_label: str
    y_label: str
    caption: str = ""
    height_px: int = 260
    x_ticks: Sequence[tuple[float, str]] | None = None
    y_ticks: Sequence[tuple[float, str]] | None = None
    top_ticks: Sequence[tuple[float, str]] = ()

    @property
    def paths(self) -> list[Path]:
        """The marks as SVG paths."""
        return [path for mark in self.marks for path in self._paths(mark)]

    @property
    def names(self) -> list[tuple[str, str]]:
        """(class, name) of each mark with a name, for the legend."""
        return [(_key_class(mark), mark.name) for mark in self.marks if mark.name]

    @property
    def across(self) -> list[Tick]:
        """Labels of the horizontal axis; every second one is minor where there are many."""
        ticks = self._ticks(self.x_ticks, self.x, 6)
        return [Tick(t.percent, t.text, len(ticks) > 5 and i % 2 == 1) for i, t in enumerate(ticks)]

    @property
    def up(self) -> list[Tick]:
        """Labels of the vertical axis."""
        return self._ticks(self.y_ticks, self.y, 5)

    @property
    def top(self) -> list[Tick]:
        """Labels above the plot; two of three are minor where there are many."""
        ticks = self._ticks(self.top_ticks, self.x, 0)
        return [Tick(t.percent, t.text, len(ticks) > 6 and i % 3 > 0) for i, t in enumerate(ticks)]

    def _ticks(self, given: Sequence[tuple[float, str]] | None, limits: Limits, count: int) -> list[Tick]:
        low, high = limits
        return [
            Tick(round(100 * (value - low) / (high - low), 2), text)
            for value, text in (round_ticks(low, high, count) if given is None else given)
            if low <= value <= high
        ]

    def _paths(self, mark: Mark) -> Iterator[Path]:
        if isinstance(mark, Line):
            dash = " dash" if mark.dashed else ""
            yield Path(self._line(mark.x, mark.y), f"s-{mark.colour}{dash}", mark.width_px)
        elif isinstance(mark, Area):
            edges = np.hstack([self._points(mark.x, mark.high), self._points(mark.x, mark.low)])
            pieces = (np.vstack([piece[:, :2], piece[::-1, 2:]]) for piece in _pieces(edges))
            if d := "".join(f"{_joined(piece)}Z" for piece in pieces):
                yield Path(d, f"f-{mark.colour}")
        else:
            yield from self._dots(mark)

    def _dots(self, mark: Dots) -> Iterator[Path]:
        points = self._points(mark.x, mark.y)
        if mark.error is not None:
            y, error = np.asarray(mark.y, float), np.asarray(mark.error, float)
            low, high = self._points(mark.x, y - error), self._points(mark.x, y + error)
            bars = (f"M{_xy(a)}L{_xy(b)}" for a, b in zip(low, high, strict=True))
            yield Path("".join(bars), "s-faint", 1.0)
        sizes = np.broadcast_to(np.asarray(mark.size_px, float), len(points))
        for size in np.unique(np.round(sizes, 1)):
            chosen = (np.round(sizes, 1) == size) & np.isfinite(points).all(axis=1)
            d = "".join(f"M{_xy(p)}h0" for p in points[chosen])
            yield Path(d, f"s-{mark.colour} dot", float(size))
            if mark.hollow:
                yield Path(d, "s-mark dot", float(size) - 3)

    def _points(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Points in the SVG's units, shape (n, 2); far outside they are cut, which changes nothing visible."""
        across = (np.asarray(x, float) - self.x[0]) / (self.x[1] - self.x[0])
        up = (np.asarray(y, float) - self.y[0]) / (self.y[1] - self.y[0])
        return np.clip(BOX * np.column_stack([across, 1 - up]), -9 * BOX, 10 * BOX)

    def _line(self, x: ArrayLike, y: ArrayLike) -> str:
        return "".join(_joined(piece) for piece in _pieces(self._points(x, y)))


def _key_class(mark: Mark) -> str:
    if isinstance(mark, Line):
        return f"k-line b-{mark.colour}{' dash' if mark.dashed else ''}"
    if isinstance(mark, Area):
        return f"k-area b-{mark.colour}"
    return f"k-dot b-{mark.colour}{' hollow' if mark.hollow else ''}"


def _pieces(points: Array) -> Iterator[Array]:
    """Runs of points between NaN."""
    good = np.isfinite(points).all(axis=1)
    for piece in np.split(points, np.flatnonzero(~good)):
        if len(found := piece[np.isfinite(piece).all(axis=1)]):
            yield found


def _joined(points: Array) -> str:
    return "M" + "L".join(_xy(point) for point in points)


def _xy(point: Array) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"


def round_ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """About ``count`` round values between the limits, as (value, text)."""
    step = round_step((high - low) / max(count, 1))
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first = math.ceil(low / step - 1e-9)
    values = [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]
    return [(value, f"{value:.{digits}f}".replace("-", "\u2212")) for value in values]


def round_step(least: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below ``least`` (> 0)."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= least * (1 - 1e-9))


def limits_of(*values: ArrayLike, margin: float = 0.06, zero: bool = False) -> Limits:
    """Limits around all finite values, with a margin; ``zero`` includes 0."""
    parts = [np.asarray(value, float).ravel() for value in values]
    finite = np.concatenate([part[np.isfinite(part)] for part in parts]) if parts else np.empty(0)
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    flat = high - low <= 1e-6 * max(abs(low), abs(high))
    gap = 0.05 * max(abs(high), 1e-3) if flat else margin * (high - low)
    return (low if zero and low == 0 else low - gap), high + gap
