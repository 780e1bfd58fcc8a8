# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Collects the messages of a running mission for :mod:`terminal`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.live.terminal import LiveBand, LiveView
from soilmoist_ros.reporting.page.numbers import duration, length

Array = NDArray[np.float64]

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
        """Why rain is likely, and what to do; empty if it is not."""

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
    """How far the measurement at the target is."""
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
