# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The world of a rehearsal: time, the robot, its navigation, receiver and sensor, with the faults of a case."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, Span
from soilmoist_ros.simulation.rehearsal.ground import Ground
from soilmoist_ros.simulation.rehearsal.servers import (
    ActionServer,
    Driven,
    PoseListener,
    Reply,
    graph_route,
    straight_route,
)

Place = tuple[float, float]
Fixed = tuple[Place, float]
"""A place [m] and its time [s since 1970 UTC]."""
T = TypeVar("T")

NAVIGATORS = ("goto_node", "navigate_to_pose", "goal_pose")
START_S = 1_780_000_000.0
"""ROS time at the start [s since 1970 UTC]."""
SPEED_MPS = 1.0
CADENCE_S = 10.0
RATE_CPS = 5.0
FIX_SD_M = 0.02


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """What is rehearsed.

    :param ground: field, graph and start
    :param navigator: one of :data:`NAVIGATORS`
    :param strategy: how stops are chosen
    :param faults: what goes wrong
    :param seed: seed of noise and counts
    :param budget_s: budget of the mission [s]
    :param home: whether the robot must return to its start
    """

    ground: Ground
    navigator: str
    strategy: str
    faults: Faults
    seed: int
    budget_s: float = 1200.0
    home: bool = True

    def __str__(self) -> str:
        on = "free" if self.ground.graph is None else "graph"
        home = "home" if self.home else "no home"
        return f"{self.navigator}, {self.strategy}, {self.ground.outline}, {on}, {home}; faults: {self.faults}"


class World:
    """What is true, whatever the package believes.

    :param case: what is rehearsed

    Attributes
    ----------
    time_s : float
        steady time since the start [s]
    fixed : tuple[float, float] | None
        last fix, as the receiver reports it [m]
    published : list[CountRecord]
        all records that the driver has published
    has_driver : bool
        whether the driver runs
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.faults = case.faults
        self.time_s = 0.0
        self.robot = Driven(case.ground.start, SPEED_MPS)
        self.by_name = case.navigator == "goto_node"
        graph = case.ground.graph
        route = graph_route(graph) if self.by_name and graph is not None else straight_route
        self.server = ActionServer(self.robot, route, self.faults)
        self.listener = PoseListener(self.robot, self.faults)
        self.fixed: Place | None = None
        self.published: list[CountRecord] = []
        self.has_driver = True
        self._held_fixes: list[Fixed] = []
        self._held_records: list[CountRecord] = []
        self._rng = np.random.default_rng(case.seed)
        self._rng_of_links = np.random.default_rng([case.seed, 1])
        self._clock_step_s = 0.0
        self._fixed_s = -math.inf

    @property
    def now_s(self) -> float:
        """ROS time, with its steps [s]."""
        return START_S + self.time_s + self._clock_step_s

    def second(self) -> tuple[list[Place], list[Span], list[Reply]]:
        """Let a second pass: places passed [m], faults that begin, and what the navigation says."""
        passed = self.robot.advance(1.0)
        begun = self.faults.begin(self.time_s, self.time_s + 1.0)
        self.time_s += 1.0
        for span in begun:
            if span.fault is Fault.CLOCK_BACK:
                self._clock_step_s -= 3600.0
            elif span.fault is Fault.CLOCK_FORWARD:
                self._clock_step_s += 6 * 3600.0
        self.listener.step(self.time_s)
        return passed, begun, self.server.step(self.time_s)

    def fixes(self) -> list[Fixed]:
        """Fixes that come now, with their stamps: none, one, or all that were held back."""
        return self._arrived(self._fix(), self._held_fixes)

    def records(self) -> list[CountRecord]:
        """Records that the driver publishes now."""
        records = self._arrived(self._record(), self._held_records)
        self.published += records
        return records

    def _arrived(self, sent: T | None, held: list[T]) -> list[T]:
        """What comes over a connection of what was sent now and before."""
        faults, now_s = self.faults, self.time_s
        damaged = faults.on(Fault.LINK_GARBAGE, now_s) and self._rng_of_links.uniform() < 0.5
        if not self.has_driver or faults.on(Fault.LINK_CUT, now_s):
            held.clear()
            return []
        if sent is not None and not damaged:
            held.append(sent)
        if faults.on(Fault.LINK_STALL, now_s):
            return []
        come, held[:] = list(held), []
        return come

    def _fix(self) -> Fixed | None:
        """A fix that the receiver sends, with its stamp; ``None`` if it has none."""
        noise = self._rng.normal(0.0, FIX_SD_M, 2)  # always drawn: a fault must not change later noise
        if self.faults.on(Fault.FIX_SILENT, self.time_s):
            return None
        x, y = self.robot.place
        place = (x + float(noise[0]), y + float(noise[1]))
        if (span := self.faults.span(Fault.FIX_JUMP, self.time_s)) is not None:
            far_m, angle = 15.0 * 200.0**span.size, 100 * span.size
            place = (place[0] + far_m * math.cos(angle), place[1] + far_m * math.sin(angle))
        elif (span := self.faults.span(Fault.FIX_RUNS, self.time_s)) is not None:
            place = (place[0] + (20.0 + 180.0 * span.size) * (self.time_s - span.at_s), place[1])
        elif self.faults.on(Fault.FIX_FROZEN, self.time_s) and self.fixed is not None:
            place = self.fixed
        self.fixed, self._fixed_s = place, self.time_s
        return place, self.now_s

    def _record(self) -> CountRecord | None:
        """A record that the logger sends, if one is due."""
        if self.time_s % CADENCE_S or self.fixed is None:
            return None
        x, y = self.robot.place
        rate_cps = RATE_CPS * (1 + 0.3 * math.sin(x / 20) * math.cos(y / 25))
        counts = int(self._rng.poisson(rate_cps * CADENCE_S))
        if self.faults.on(Fault.SENSOR_SILENT, self.time_s):
            return None
        if self.faults.on(Fault.SENSOR_ZERO, self.time_s):
            counts = 0
        place = self.fixed if self.time_s - self._fixed_s <= CADENCE_S / 2 else (math.nan, math.nan)
        x_m, y_m = np.array(place, np.float32).tolist()  # as messages have it
        return CountRecord(self.now_s, x_m, y_m, 0.0, counts, CADENCE_S, CADENCE_S)

    @property
    def charge(self) -> float | None:
        """Charge of the battery [0..1], ``None`` while nobody says; it is low from the fault on, and falls."""
        if self.faults.on(Fault.BATTERY_STALE, self.time_s):
            return None
        low = [span.at_s for span in self.faults.spans if span.fault is Fault.LOW_BATTERY]
        since_s = self.time_s - min(low, default=math.inf)
        return 0.6 if since_s < 0 else max(0.0, 0.24 - since_s / 2000)

    @property
    def obeys(self) -> bool:
        """Whether the navigation has done what it was asked for some seconds."""
        faults = (Fault.SERVER_DEAF, Fault.RUNS_ON, Fault.SERVER_DEAD)
        return not any(self.faults.on(fault, self.time_s - ago_s) for fault in faults for ago_s in range(15))

    @property
    def wrong_m(self) -> float:
        """Distance from the last fix to the robot [m]."""
        return 0.0 if self.fixed is None else math.dist(self.fixed, self.robot.place)
