# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live view of a running mission: what its messages say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.page.frame import duration, length

Array = NDArray[np.float64]


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
    def text(self) -> str:
        """Mean and standard deviation of the cells, of the moisture, else of the rate; empty without a map."""
        if self.cells is None:
            return ""
        quantity, scale, unit = "vwc", 100.0, "% by volume"
        if not np.isfinite(self.cells["vwc"]).any():
            quantity, scale, unit = "rate", 1.0, "counts/s"
        known = scale * self.cells[quantity][np.isfinite(self.cells[quantity])].astype(float)
        return f"mean {known.mean():.3g} {unit}, {known.std():.2g} from place to place" if known.size else ""


class LiveRobot:
    """The latest messages of a robot. ``sensor_fault``: what is wrong with its records, empty if nothing is."""

    def __init__(self, namespace: str = "") -> None:
        self.namespace = namespace
        self.status: Mapping[str, str] = {}
        self.sensor_fault = ""

    @property
    def state(self) -> str:
        """State and reason of its mission."""
        return f"{self.status['state']}: {self.status['reason']}" if self.status else "waiting for the planner"

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
        self.title = title
        self.maps = tuple(maps) or (LiveMap(),)
        self.robots = tuple(map(LiveRobot, namespaces))
        self.samples_xy: Array = np.empty((0, 2))
        self.clock_waits_for = ""
        """Event that simulated time has been awaiting for long, in words; empty without one."""
        self.rain = ""
        """Reason why rain is likely, and what to do; empty if it is not."""

    @property
    def facts(self) -> dict[str, str]:
        """Lines of the view by their names."""
        facts: dict[str, str] = {}
        statuses = [robot.status for robot in self.robots]  # other threads replace them
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
        facts["map"] = f"stops: {sum(stops):.0f}, samples with those on the way: {len(self.samples_xy)}"
        errors = [f"{one.name} {mse:.4f}".lstrip() for one in self.maps if math.isfinite(mse := one.mse)]
        if errors:
            facts["map"] += f"; mean squared error {', '.join(errors)} (counts/s)²"
        for one in self.maps:
            if text := one.text:
                facts[f"{one.name} map".lstrip() if one.name else "field"] = text
        return facts
