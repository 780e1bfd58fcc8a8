# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Charts of a page: marks in an SVG that stretches with the page, labels as text that does not.

Lines keep their width (``vector-effect``) and dots stay round (lines of length 0 with round caps), so one SVG fits
a phone, a wide screen and paper without a script.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.pipeline import EARLIEST_STAMP_S
from soilmoist_ros.reporting.page.frame import duration, number, percent, round_step
from soilmoist_ros.reporting.page.statistics import LeaveOneOut
from soilmoist_ros.sensing import CountRecord

Array = NDArray[np.float64]
ChartColour = Literal["ink", "soft", "line", "orange", "purple", "green"]
Limits = tuple[float, float]

BOX = 1000
"""Width and height of the SVG in its own units."""
MAX_BINS = 240
MAX_POINTS = 1500
MAX_STEPS = 10
"""Longest step of a line, in usual ones; longer ones are gaps."""
TIME_STEPS_S = (10, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400)


class Line(NamedTuple):
    """A line; NaN interrupts it."""

    x: ArrayLike
    y: ArrayLike
    colour: ChartColour = "line"
    name: str = ""
    dashed: bool = False


class Dots(NamedTuple):
    """Dots of one size; ``error`` draws bars of that half length."""

    x: ArrayLike
    y: ArrayLike
    colour: ChartColour = "line"
    name: str = ""
    size_px: float = 6.0
    error: ArrayLike | None = None


class Area(NamedTuple):
    """A band between two lines; NaN interrupts it."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    colour: ChartColour = "line"
    name: str = ""


Mark = Line | Dots | Area


class Path(NamedTuple):
    """One SVG path: its data, its class and its width in pixels."""

    d: str
    css: str
    width_px: float = 0.0


class AxisTick(NamedTuple):
    """A label of an axis at a position along it [%]; a minor one is hidden on narrow screens."""

    percent: float
    text: str
    minor: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart with its texts.

    :param key: anchor in the page
    :param alt: description in words, for readers who cannot see it
    :param x: limits of the horizontal axis, ``y`` of the vertical one
    :param x_ticks: labels of the horizontal axis as (value, text), by default made from the limits; ``y_ticks`` of
        the vertical one
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
    x_ticks: Sequence[tuple[float, str]] | None = None
    y_ticks: Sequence[tuple[float, str]] | None = None

    @property
    def paths(self) -> list[Path]:
        """The marks as SVG paths."""
        return [path for mark in self.marks for path in self._paths(mark)]

    @property
    def names(self) -> list[tuple[str, str]]:
        """(class, name) of each mark with a name, for the legend."""
        return [(_key_class(mark), mark.name) for mark in self.marks if mark.name]

    @property
    def across(self) -> list[AxisTick]:
        """Labels of the horizontal axis; every second one is minor where there are more than five."""
        ticks = _ticks(round_ticks(*self.x, 6) if self.x_ticks is None else self.x_ticks, self.x)
        return [tick._replace(minor=len(ticks) > 5 and number % 2 > 0) for number, tick in enumerate(ticks)]

    @property
    def up(self) -> list[AxisTick]:
        """Labels of the vertical axis."""
        return _ticks(round_ticks(*self.y, 5) if self.y_ticks is None else self.y_ticks, self.y)

    def _paths(self, mark: Mark) -> Iterator[Path]:
        if isinstance(mark, Line):
            dash = " dash" if mark.dashed else ""
            d = "".join(map(_joined, _pieces(self._points(mark.x, mark.y))))
            yield Path(d, f"s-{mark.colour}{dash}", 2.0)
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
        d = "".join(f"M{_xy(point)}h0" for point in points[np.isfinite(points).all(axis=1)])
        yield Path(d, f"s-{mark.colour} dot", mark.size_px)

    def _points(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Points in the SVG's units, shape (n, 2); far outside they are cut, which changes nothing visible."""
        across = (np.asarray(x, float) - self.x[0]) / (self.x[1] - self.x[0])
        up = (np.asarray(y, float) - self.y[0]) / (self.y[1] - self.y[0])
        return np.clip(BOX * np.column_stack([across, 1 - up]), -9 * BOX, 10 * BOX)


def _ticks(given: Sequence[tuple[float, str]], limits: Limits) -> list[AxisTick]:
    """Labels within the limits."""
    low, high = limits
    return [AxisTick(round(100 * (at - low) / (high - low), 2), text) for at, text in given if low <= at <= high]


def _key_class(mark: Mark) -> str:
    if isinstance(mark, Line):
        return f"k-line b-{mark.colour}{' dash' if mark.dashed else ''}"
    if isinstance(mark, Area):
        return f"k-area b-{mark.colour}"
    return f"k-dot b-{mark.colour}"


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


def limits_of(*values: ArrayLike, margin: float = 0.06, zero: bool = False) -> Limits:
    """Limits around all finite values, with a margin; ``zero`` includes 0."""
    finite = np.concatenate([np.ravel(np.asarray(value, float)) for value in values])
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    flat = high - low <= 1e-6 * max(abs(low), abs(high))
    gap = 0.05 * max(abs(high), 1e-3) if flat else margin * (high - low)
    return (low if zero and low == 0 else low - gap), high + gap


# Charts of a survey: rate and factors over time, cross-validation -----------------------------------------------


def rate_chart(track: Sequence[CountRecord]) -> Chart:
    """Corrected rate over time; the band is one standard deviation of the counting noise."""
    time, counts, exposure, width_s = binned(track)
    rate, sd = counts / exposure, np.sqrt(np.maximum(counts, 1)) / exposure
    time, rate, sd = _without_gaps(time, rate, sd)
    name = "each record" if not width_s else f"records added up over {duration(width_s)}"
    x, ticks, label = time_axis(time)
    return Chart(
        "rate-series", "Rate over time", "Corrected count rate over time",
        [Area(time, rate - sd, rate + sd, "line", "± 1 sd of counting"), Line(time, rate, "line", name)],
        x, limits_of(rate - sd, rate + sd), label, "Corrected rate [counts/s]",
        "Changes beyond the band are real: other soil below the sensor, or a fault.", x_ticks=ticks,
    )  # fmt: skip


def _without_gaps(time_s: Array, *values: Array) -> tuple[Array, ...]:
    """Times and values, with NaN in each gap: no line is drawn where nothing was counted."""
    steps_s = np.diff(time_s)
    usual_s = steps_s[steps_s > 0]  # records of several robots have equal stamps
    gaps = np.flatnonzero(steps_s > (MAX_STEPS * np.median(usual_s) if len(usual_s) else 0.0)) + 1
    middle = (time_s[gaps - 1] + time_s[gaps]) / 2
    return np.insert(time_s, gaps, middle), *(np.insert(each, gaps, np.nan) for each in values)


def factor_chart(track: Sequence[CountRecord]) -> Chart:
    """The correction factors over time."""
    shown = track[:: max(1, -(-len(track) // MAX_POINTS))]
    names = ("stamp_s", "f_pressure", "f_humidity", "f_intensity")
    columns = (np.array([getattr(record, name) for record in shown]) for name in names)
    time, pressure, humidity, intensity = _without_gaps(*columns)
    product = pressure * humidity * intensity
    low, high = limits_of(pressure, humidity, intensity, product)
    away = max(0.005 - (high - low) / 2, 0.0)
    x, ticks, label = time_axis(time)
    return Chart(
        "factors", "Correction factors over time", "Correction factors over time",
        [
            Line(time, product, "ink", "product"), Line(time, pressure, "line", "pressure"),
            Line(time, humidity, "green", "humidity"),
            Line(time, intensity, "purple", "incoming neutrons", dashed=True),
        ],
        x, (low - away, high + away), label, "Correction factor [-]",
        "The factors that the raw counts are multiplied with.", x_ticks=ticks,
    )  # fmt: skip


def cross_validation_chart(loo: LeaveOneOut) -> Chart:
    """Observed rates against leave-one-out predictions, with one standard deviation of the difference."""
    ends = limits_of(loo.observed - loo.sd, loo.observed + loo.sd, loo.predicted, margin=0.03)
    few = len(loo.observed) <= 120
    return Chart(
        "validation", "Cross-validation", "Observed against predicted rate of each sample",
        [
            Line(ends, ends, "soft", "prediction = observation"),
            Dots(loo.predicted, loo.observed, "line", "samples" + (", ± 1 sd" if few else ""),
                 6 if few else 4, error=loo.sd if few else None),
        ],
        ends, ends, "Predicted without the sample [counts/s]", "Observed [counts/s]",
        f"Each sample predicted from all others. {percent(loo.coverage95)} of the {len(loo.observed)} samples lie "
        f"in their 95 % interval; errors are {loo.standardised_sd:.2f} times as large as stated (1 is right); "
        f"root mean square error {number(loo.rmse)} counts/s, counting noise included.",
    )  # fmt: skip


def binned(track: Sequence[CountRecord]) -> tuple[Array, Array, Array, float]:
    """Time [s], counts and effective exposure [s] of the records, and the bin width [s].

    Few records are returned one by one (width 0). Many are summed in bins of equal length, which is exact for
    counts. A bin without records is NaN and interrupts the line.
    """
    time = np.array([r.stamp_s for r in track])
    counts = np.array([r.raw_counts for r in track], float)
    exposure = np.array([r.effective_exposure_s for r in track])
    if len(track) <= MAX_BINS:
        return time, counts, exposure, 0.0
    span = float(np.ptp(time)) / MAX_BINS
    width = float(next((step for step in TIME_STEPS_S if step >= span), 86400 * math.ceil(span / 86400)))
    index = ((time - time.min()) // width).astype(int)
    total = np.bincount(index, exposure).astype(float)
    total[total == 0] = np.nan
    middle = np.asarray(time.min() + width * (np.arange(len(total)) + 0.5), float)
    return middle, np.bincount(index, counts).astype(float), total, width


def time_axis(time_s: ArrayLike) -> tuple[Limits, list[tuple[float, str]], str]:
    """Limits, labels and name of an axis of stamps: clock times, or minutes where the clock has no date."""
    time = np.asarray(time_s, float)
    low, high = float(time.min()), float(time.max())
    span = high - low or 1.0
    step = next((s for s in TIME_STEPS_S if span / s <= 6), 86400 * math.ceil(span / 6 / 86400))
    values = [step * i for i in range(math.ceil(low / step), math.floor(high / step) + 1)]
    if low < EARLIEST_STAMP_S:
        return (low, low + span), [(v, f"{v / 60:g}") for v in values], "Time [min]"
    days = step >= 86400
    first, last = (datetime.fromtimestamp(v, UTC) for v in (low, high))
    form = "%H:%M" if not days else "%d %b" if first.year == last.year else "%Y-%m-%d"
    ticks = [(float(v), f"{datetime.fromtimestamp(v, UTC):{form}}") for v in values]
    name = f"Time (UTC), from {first.day} {first:%B %Y}"
    if days:
        name = f"Day of {first:%Y}" if first.year == last.year else "Day"
    return (low, low + span), ticks, name
