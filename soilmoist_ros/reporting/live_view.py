# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live view of a running mission: what its messages say, and how a terminal shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import printable
from soilmoist_ros.reporting.colours import between
from soilmoist_ros.reporting.page.frame import duration, length

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

Array = NDArray[np.float64]

DRY_TO_WET = np.array(
    [list(bytes.fromhex(text)) for text in ("fdedc4", "dee296", "98cb81", "48ac93", "1d859e", "1a5893", "222a6b")],
    float,
)
"""Colours from dry to wet: light sand over green to deep blue, in even steps of lightness, shape (7, 3)."""
_ROBOT, _TARGET, _SAMPLE = "#e61e3c", "#ff8c00", "#141414"
_TEXTS = ("state", "reason", "target", "forecast", "ended")
_NUMBERS = (
    "target_x_m", "target_y_m", "planned_dwell_s", "elapsed_dwell_s", "time_used_s", "time_left_s", "distance_m",
    "samples", "raw_counts", "failures", "estimated_end_s", "stamp_s",
)  # fmt: skip
_FLAGS = ("needs_operator", "silent", "emergency")


class LiveBand(NamedTuple):
    """A map to show: name with unit, values (ny, nx), south first, and west, east, south, north [m]."""

    name: str
    values: Array
    extent: tuple[float, float, float, float]
    wet_is_high: bool = True

    @property
    def limits(self) -> tuple[float, float]:
        """Values of the first and last colour: quantiles, so that a few outliers have no effect."""
        known = self.values[np.isfinite(self.values)]
        return (float(np.quantile(known, 0.02)), float(np.quantile(known, 0.98))) if known.size else (0.0, 0.0)

    def colours(self, shares: Array) -> list[str]:
        """Colours of places on the scale from 0 to 1."""
        shares = np.nan_to_num(shares if self.wet_is_high else 1 - shares)
        return ["#" + bytes(colour).hex() for colour in between(DRY_TO_WET, shares)]


class LiveView(NamedTuple):
    """The content of the view. ``facts`` have a line each below the title."""

    title: str
    facts: Mapping[str, str]
    bands: Sequence[LiveBand] = ()
    samples_xy: ArrayLike = ()
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
        return Group(*parts, Text("no map yet: it begins with the first samples", style="dim"))
    width = max(1, (columns + 1) // len(view.bands) - 1)
    pictures = Table.grid(padding=(0, 1))
    pictures.add_row(*(map_picture(view, band, width, max(1, rows)) for band in view.bands))
    names = ((_ROBOT, "robot"), (_TARGET, "target"), (_SAMPLE, "sample"))
    legend = Text.assemble(*(part for colour, name in names for part in (("■", colour), f" {name}  ")))
    return Group(*parts, pictures, *map(scale, view.bands), legend)


def map_picture(view: LiveView, band: LiveBand, columns: int, rows: int) -> Text:
    """A map in half blocks, two cells of the picture per character, north up."""
    from rich.text import Text

    pixels = _pixels(view, band, columns, 2 * rows)
    text = Text(no_wrap=True, overflow="crop")
    for line in range(0, len(pixels), 2):
        if line:
            text.append("\n")
        for above, below in zip(pixels[line], pixels[line + 1], strict=True):
            if above:
                text.append("▀", style=f"{above} on {below}" if below else above)
            else:
                text.append("▄" if below else " ", style=below)
    return text


def scale(band: LiveBand) -> Text:
    """Colour scale of a picture."""
    from rich.text import Text

    low, high = band.limits
    blocks = [("█", colour) for colour in band.colours(np.linspace(0, 1, 16))]
    return Text.assemble(f"{band.name} {low:.3g} ", *blocks, f" {high:.3g}")


def _pixels(view: LiveView, band: LiveBand, columns: int, lines: int) -> list[list[str]]:
    """Colours of the picture, north first; empty outside the field."""
    ny, nx = band.values.shape
    factor = max(nx / columns, ny / lines)
    width, height = max(1, round(nx / factor)), max(2, round(ny / factor))
    height += height % 2
    row = np.minimum((np.arange(height) + 0.5) / height * ny, ny - 1).astype(int)[::-1]
    column = np.minimum((np.arange(width) + 0.5) / width * nx, nx - 1).astype(int)
    values = band.values[np.ix_(row, column)]
    low, high = band.limits
    shares = np.clip((values - low) / (high - low), 0, 1) if high > low else np.full(values.shape, 0.5)
    colours = np.array(band.colours(shares.ravel()), object).reshape(shares.shape)
    colours[np.isnan(values)] = ""
    west, east, south, north = band.extent
    marks = ((view.samples_xy, _SAMPLE), (view.targets_xy, _TARGET), (view.robots_xy, _ROBOT))
    for x, y, colour in ((x, y, colour) for places, colour in marks for x, y in np.reshape(places, (-1, 2))):
        if np.isfinite(x) and np.isfinite(y):
            # A marker beyond the map is drawn at its edge, to show the direction.
            i = min(max((north - y) / max(north - south, 1e-9), 0.0), 1.0) * height
            j = min(max((x - west) / max(east - west, 1e-9), 0.0), 1.0) * width
            colours[min(int(i), height - 1), min(int(j), width - 1)] = colour
    return list(colours.tolist())


# Collects the messages of a running mission -----------------------------------------------------------------


class LiveMap:
    """The latest map of a property.

    :param name: name of the property and namespace of its mapper; empty for the mission's own field
    :param true_rate: true rate on the map's raster, shape (ny, nx) [counts/s], if known
    """

    def __init__(self, name: str = "", true_rate: Array | None = None) -> None:
        self.name = name
        self._true_rate = true_rate
        self.cells: NDArray[np.void] | None = None
        """Cells with fields x, y, rate, rate_sd, vwc, vwc_sd, shape (ny, nx)."""

    @property
    def mse(self) -> float:
        """Mean squared error of the rate map [(counts/s)^2]; NaN without a map or a truth."""
        cells = self.cells
        if cells is None or self._true_rate is None or cells.shape != self._true_rate.shape:
            return math.nan
        error = cells["rate"] - self._true_rate
        return float(np.mean(error[np.isfinite(error)] ** 2)) if np.isfinite(error).any() else math.nan

    @property
    def band(self) -> LiveBand | None:
        """Map of the moisture, else of the rate; ``None`` without a map."""
        found = None if self.cells is None else _field(self.cells)
        if found is None:
            return None
        field, extent = found
        moist = bool(np.isfinite(field["vwc"]).any())
        what = "moisture [m³/m³]" if moist else "rate [counts/s]"
        values = np.asarray(field["vwc" if moist else "rate"], float)
        return LiveBand(f"{self.name} {what}".lstrip(), values, extent, wet_is_high=moist)

    @property
    def values(self) -> dict[str, Any]:
        """Numbers of the map for programs; ``spread`` is the standard deviation between its cells."""
        band = self.band
        known = np.empty(0) if band is None else band.values[np.isfinite(band.values)]
        return {
            "name": self.name, "quantity": None if band is None else ("vwc" if band.wet_is_high else "rate"),
            "cells": known.size, "mean": float(known.mean()) if known.size else None,
            "spread": float(known.std()) if known.size else None, "mse": self.mse,
        }  # fmt: skip


class LiveRobot:
    """The latest messages of a robot. ``sensor_fault``: what is wrong with its records, empty if nothing is."""

    def __init__(self, namespace: str = "") -> None:
        self.namespace = namespace
        self.status: Mapping[str, str] = {}
        self.xy: tuple[float, float] | None = None
        self.sensor_fault = ""

    @property
    def state(self) -> str:
        """State and reason of its mission."""
        return f"{self.status['state']}: {self.status['reason']}" if self.status else "waiting for the planner"

    @property
    def values(self) -> dict[str, Any]:
        """Status of the mission for programs: texts, numbers and flags; ``None`` where the planner is silent."""
        status = self.status
        x_m, y_m = self.xy or (math.nan, math.nan)
        return {
            "name": self.namespace, "x_m": x_m, "y_m": y_m, **{key: status.get(key) or None for key in _TEXTS},
            **{key: float(status[key]) if key in status else None for key in _NUMBERS},
            **{key: status[key] == "True" if key in status else None for key in _FLAGS},
            "sensor_fault": self.sensor_fault or None,
        }  # fmt: skip

    def facts(self, status: Mapping[str, str]) -> dict[str, str]:
        """Lines of the view: state, target of a single robot, forecast, fault of the sensor."""
        name = self.namespace.replace("_", " ")
        found = {name or "state": self.state}
        if status and status["target"] and not name:
            planned_s, elapsed_s = (float(status[key]) for key in ("planned_dwell_s", "elapsed_dwell_s"))
            of = f" of about {planned_s:.0f} s" if math.isfinite(planned_s) else ""
            found["target"] = f"{status['target']}, counted {elapsed_s:.0f} s{of}"
        more = {"forecast": status.get("forecast"), "sensor": self.sensor_fault}
        return found | {f"{name} {key}".lstrip(): text for key, text in more.items() if text}


class LiveMission:
    """The latest messages of a mission. One thread may set them while another reads the view.

    :param maps: maps of the properties; the mission's own field is the first
    :param namespaces: namespaces of the robots
    """

    def __init__(self, title: str, maps: Sequence[LiveMap] = (), namespaces: Sequence[str] = ("",)) -> None:
        self._title = title
        self.maps = tuple(maps) or (LiveMap(),)
        self.robots = tuple(map(LiveRobot, namespaces))
        self.samples_xy: Array = np.empty((0, 2))
        self.clock_waits_for = ""
        """Event that simulated time has been awaiting for long, in words; empty without one."""
        self.rain = ""
        """Reason why rain is likely, and what to do; empty if it is not."""

    @property
    def values(self) -> dict[str, Any]:
        """The mission now, for programs: robots, maps, samples, and what it waits for."""
        return {
            "field": self._title.strip(), "robots": [robot.values for robot in self.robots],
            "maps": [one.values for one in self.maps], "samples": len(self.samples_xy),
            "clock_waits_for": self.clock_waits_for or None, "rain": self.rain or None,
        }  # fmt: skip

    def view(self) -> LiveView:
        """The view now."""
        statuses, samples = [robot.status for robot in self.robots], self.samples_xy  # other threads replace them
        bands = [band for one in self.maps if (band := one.band) is not None]
        targets = [(float(one.get("target_x_m", "nan")), float(one.get("target_y_m", "nan"))) for one in statuses]
        return LiveView(
            self._title, self._facts(statuses, len(samples)), bands, samples,
            [robot.xy for robot in self.robots if robot.xy is not None],
            [place for place in targets if all(map(math.isfinite, place))],
        )  # fmt: skip

    def _facts(self, statuses: Sequence[Mapping[str, str]], n_samples: int) -> dict[str, str]:
        facts: dict[str, str] = {}
        for robot, status in zip(self.robots, statuses, strict=True):
            facts |= robot.facts(status)
        if self.clock_waits_for:
            facts["clock"] = f"waits for {self.clock_waits_for}"
        if self.rain:
            facts["weather"] = self.rain
        if not (known := [status for status in statuses if status]):
            return facts
        used_s, left_s, driven_m, stops = (
            [float(status[key]) for status in known]
            for key in ("time_used_s", "time_left_s", "distance_m", "samples")
        )
        value, unit = length(sum(driven_m))
        facts["mission"] = f"{duration(max(used_s))} used, {duration(max(left_s))} left; {value} {unit} driven"
        facts["map"] = f"stops: {sum(stops):.0f}, samples with those on the way: {n_samples}"
        errors = [f"{one.name} {mse:.4f}".lstrip() for one in self.maps if math.isfinite(mse := one.mse)]
        if errors:
            facts["map"] += f"; mean squared error {', '.join(errors)} (counts/s)²"
        return facts


def _field(cells: NDArray[np.void]) -> tuple[NDArray[np.void], tuple[float, float, float, float]] | None:
    """The part of a map that covers the field, and its edges: west, east, south, north [m]."""
    inside = np.isfinite(cells["x"]) & np.isfinite(cells["y"])  # cells outside have no place
    if not (inside & np.isfinite(cells["rate"])).any():
        return None
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    part = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    west, east = float(np.nanmin(part["x"])), float(np.nanmax(part["x"]))
    south, north = float(np.nanmin(part["y"])), float(np.nanmax(part["y"]))
    steps = max(part.shape) - 1
    half = (max(east - west, north - south) / steps if steps else 1.0) / 2
    return part, (west - half, east + half, south - half, north + half)
