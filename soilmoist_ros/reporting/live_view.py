# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live view of a running mission: what its messages say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from soilmoist_ros.reporting.page.frame import duration, length


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

    :param namespaces: namespaces of the robots
    """

    def __init__(self, title: str, namespaces: Sequence[str] = ("",)) -> None:
        self.title = title
        self.robots = tuple(map(LiveRobot, namespaces))
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
        driven = f"{value} {unit} driven, {sum(stops):.0f} stops"
        facts["mission"] = f"{duration(max(used_s))} used, {duration(max(left_s))} left; {driven}"
        return facts
