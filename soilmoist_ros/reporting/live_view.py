# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live view of a running mission: what its messages say, and how a terminal shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import printable
from soilmoist_ros.reporting.page.numbers import duration, length

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
_TEXTS = ("state", "reason", "target", "forecast", "ended")
_NUMBERS = (
    "target_x_m",
    "target_y_m",
    "planned_dwell_s",
    "elapsed_dwell_s",
    "time_used_s",
    "time_left_s",
    "distance_m",
    "samples",
    "raw_counts",
    "failures",
    "estimated_end_s",
    "stamp_s",
)
_FLAGS = ("needs_operator", "silent", "emergency")
WETTEST = 0.6
"""Upper limit of plausible soil moisture [m^3/m^3]; early maps exceed it where the rate is uncertain."""


@dataclass(frozen=True, eq=False)
class LiveBand:
    """A map to show: name with unit, values (ny, nx), south first, and west, east, south, north [m]."""

    name: str
    values: Array
    extent: tuple[float, float, float, float]
    wet_is_high: bool = True


@dataclass(frozen=True, eq=False)
class LiveView:
    """The content of the view; every part may be missing.

    :param facts: short name -> text, one line each below the title
    :param samples_xy: places of the samples, shape (n, 2) [m]
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
        cells = self.cells
        if cells is None or not (_inside(cells) & np.isfinite(cells["rate"])).any():
            return None
        field, extent = _field(cells)
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
            "name": self.name,
            "quantity": None if band is None else ("vwc" if band.wet_is_high else "rate"),
            "cells": known.size,
            "mean": float(known.mean()) if known.size else None,
            "spread": float(known.std()) if known.size else None,
            "mse": self.mse,
        }


class LiveRobot:
    """The latest messages of a robot.

    :param namespace: its namespace; empty for none
    """

    def __init__(self, namespace: str = "") -> None:
        self.namespace = namespace
        self.status: Mapping[str, str] = {}
        self.xy: tuple[float, float] | None = None
        self.sensor_fault = ""
        """What is wrong with the records of its sensor; empty if nothing is."""

    @property
    def state(self) -> str:
        """State and reason of its mission."""
        status = self.status
        return f"{status['state']}: {status['reason']}" if status else "waiting for the planner"

    @property
    def values(self) -> dict[str, Any]:
        """Status of the mission for programs: texts, numbers and flags; those of a silent planner are ``None``."""
        status = self.status
        x_m, y_m = self.xy or (math.nan, math.nan)
        return {
            "name": self.namespace,
            "x_m": x_m,
            "y_m": y_m,
            **{key: status.get(key) or None for key in _TEXTS},
            **{key: float(status[key]) if key in status else None for key in _NUMBERS},
            **{key: status[key] == "True" if key in status else None for key in _FLAGS},
            "sensor_fault": self.sensor_fault or None,
        }


class LiveMission:
    """The latest messages of a mission. One thread may set them while another reads the view.

    :param title: first line
    :param maps: maps of the properties; the mission's own field is the first
    :param namespaces: namespaces of the robots
    """

    def __init__(self, title: str, maps: Sequence[LiveMap] = (), namespaces: Sequence[str] = ("",)) -> None:
        self._title = title
        self.maps = tuple(maps) or (LiveMap(),)
        self.robots = tuple(map(LiveRobot, namespaces))
        self.samples_xy: Array = np.empty((0, 2))
        self.clock_waits_for = ""
        """What simulated time waits for, if that has lasted long."""
        self.rain = ""
        """Reason why rain is likely, and what to do; empty if it is not."""

    @property
    def values(self) -> dict[str, Any]:
        """The mission now, for programs: robots, maps, samples, and what it waits for."""
        return {
            "field": self._title.strip(),
            "robots": [robot.values for robot in self.robots],
            "maps": [one.values for one in self.maps],
            "samples": len(self.samples_xy),
            "clock_waits_for": self.clock_waits_for or None,
            "rain": self.rain or None,
        }

    def view(self) -> LiveView:
        """The view now."""
        statuses, samples = [robot.status for robot in self.robots], self.samples_xy  # other threads replace them
        return LiveView(
            self._title,
            self._facts(statuses, len(samples)),
            [band for one in self.maps if (band := one.band) is not None],
            samples_xy=samples,
            robots_xy=[robot.xy for robot in self.robots if robot.xy is not None],
            targets_xy=[target for status in statuses if (target := _target(status)) is not None],
        )

    def _facts(self, statuses: Sequence[Mapping[str, str]], n_samples: int) -> dict[str, str]:
        facts = {}
        for robot, status in zip(self.robots, statuses, strict=True):
            several = robot.namespace.replace("_", " ")
            facts[several or "state"] = robot.state
            if status and status["target"] and not several:
                facts["target"] = _counted(status)
            if status and status.get("forecast"):
                facts[f"{several} forecast".lstrip()] = status["forecast"]
            if robot.sensor_fault:
                facts[f"{several} sensor".lstrip()] = robot.sensor_fault
        if self.clock_waits_for:
            facts["clock"] = f"waits for {self.clock_waits_for}"
        if self.rain:
            facts["weather"] = self.rain
        known = [status for status in statuses if status]
        if not known:
            return facts
        used_s, left_s, driven_m = (
            [float(status[key]) for status in known] for key in ("time_used_s", "time_left_s", "distance_m")
        )
        value, unit = length(sum(driven_m))
        facts["mission"] = f"{duration(max(used_s))} used, {duration(max(left_s))} left; {value} {unit} driven"
        stops = sum(int(status["samples"]) for status in known)
        facts["map"] = f"{stops} stops, {n_samples} samples with those on the way"
        errors = [f"{one.name} {mse:.4f}".lstrip() for one in self.maps if math.isfinite(mse := one.mse)]
        if errors:
            facts["map"] += f"; mean squared error {', '.join(errors)} (counts/s)²"
        return facts


def _counted(status: Mapping[str, str]) -> str:
    """Progress of the measurement at the target."""
    planned_s, elapsed_s = (float(status[key]) for key in ("planned_dwell_s", "elapsed_dwell_s"))
    of = f" of about {planned_s:.0f} s" if math.isfinite(planned_s) else ""
    return f"{status['target']}, counted {elapsed_s:.0f} s{of}"


def _target(status: Mapping[str, str]) -> tuple[float, float] | None:
    x_m, y_m = (float(status.get(key, "nan")) for key in ("target_x_m", "target_y_m"))
    return (x_m, y_m) if math.isfinite(x_m) and math.isfinite(y_m) else None


def _inside(cells: NDArray[np.void]) -> NDArray[np.bool_]:
    """Cells in the field: cells outside have no place."""
    return np.asarray(np.isfinite(cells["x"]) & np.isfinite(cells["y"]))


def _field(cells: NDArray[np.void]) -> tuple[NDArray[np.void], tuple[float, float, float, float]]:
    """The part of a map that covers the field, and its edges: west, east, south, north [m]."""
    inside = _inside(cells)
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    part = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    west, east = float(np.nanmin(part["x"])), float(np.nanmax(part["x"]))
    south, north = float(np.nanmin(part["y"])), float(np.nanmax(part["y"]))
    steps = max(part.shape) - 1
    half = (max(east - west, north - south) / steps if steps else 1.0) / 2
    return part, (west - half, east + half, south - half, north + half)
