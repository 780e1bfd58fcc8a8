# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The world of a rehearsal: time, the robot, its navigation, receiver and sensor, with the faults of a case."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import shapely

from rehearsal.cases import RECEIVERS, Case, Fault, Noise, Place, Span
from rehearsal.servers import (
    STOOD_S,
    ActionServer,
    Driven,
    Misled,
    PoseListener,
    Reply,
    Status,
    graph_route,
    straight_route,
)
from soilmoist_ros.sensing import CountRecord, Doubts

Fixed = tuple[Place, float]  # A place [m] and its time [s since 1970 UTC]
T = TypeVar("T")

START_S = 1_780_000_000.0  # ROS time at the start [s since 1970 UTC]
SPEED_MPS = 1.0
CADENCE_S = 10.0
RATE_CPS = 5.0
LED_S = 5.0  # the robot settles within this time after something else has moved it [s]
ENDS = (Status.ABORTED, Status.CANCELED, Status.SUCCEEDED)
"""Ends of a goal that somebody else's goal replaces; servers differ."""


class World:
    """What is true, whatever the package believes."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.faults = case.faults
        self.time_s = 0.0  # steady time since the start [s]
        self.robot = Driven(case.ground.start, SPEED_MPS)
        self.by_name = case.navigator == "goto_node"
        graph = case.ground.graph
        route = graph_route(graph) if self.by_name and graph is not None else straight_route
        settled_s = 3 * STOOD_S if case.navigator == "goal_pose" else STOOD_S  # its standstill is judged by fixes
        self._misled = Misled(case.ground, self.faults, settled_s)
        self.server = ActionServer(self.robot, route, self.faults, self._misled)
        self.listener = PoseListener(self.robot, self.faults, self._misled)
        self.fixed: Place | None = None
        self.published: list[CountRecord] = []  # all records that the driver has published
        self.has_driver = True
        self._held_fixes: list[Fixed] = []
        self._held_records: list[CountRecord] = []
        self.doubts = Doubts()  # doubts about the place, as they are latched
        self.truth: dict[tuple[float, int], Place] = {}
        noise = RECEIVERS[case.receiver]
        self._receiver = Receiver(noise, 1 / case.fixes_hz, np.random.default_rng([case.seed, 2]))
        self._same_receiver = noise.sd_m > 0.1  # a navigation by another, better one would not arrive by this one
        self._stood_s, self._led_s = 0.0, -math.inf
        self._rng = np.random.default_rng(case.seed)
        self._rng_of_links = np.random.default_rng([case.seed, 1])
        self._clock_step_s = 0.0
        self._fixed_s = -math.inf
        self._fixed_at: Place = (math.nan, math.nan)  # where the robot truly was then

    @property
    def now_s(self) -> float:
        """ROS time, with its steps [s]."""
        return START_S + self.time_s + self._clock_step_s

    def second(self) -> Iterator[tuple[list[Place], list[Fixed]]]:
        """Let a second pass: the places passed in each part of it [m], and the fixes that come, with stamps."""
        parts = max(1, round(self.case.fixes_hz))
        for part in range(parts):
            self.time_s = round(self.time_s + 1 / parts, 6)
            if part == parts - 1:
                self.time_s = round(self.time_s)
            yield self._move(1 / parts), self._fixes()

    def events(self) -> tuple[list[Span], list[Reply]]:
        """Faults that have begun in the last second, and what the navigation says now."""
        begun = self.faults.begin(self.time_s - 1.0, self.time_s)
        for span in begun:
            if span.fault is Fault.CLOCK_BACK:
                self._clock_step_s -= 3600.0
            elif span.fault is Fault.CLOCK_FORWARD:
                self._clock_step_s += 6 * 3600.0
            elif span.fault in (Fault.DETOUR, Fault.STRAY) and self.robot.drives and not self.robot.by_hand:
                self.robot.turn(self._misled.way(self.robot.way, self.robot.place, self.time_s))
            elif span.fault is Fault.OTHER_CLIENT:
                self._somebody_drives(span)
        self.listener.step(self.time_s)
        return begun, self.server.step(self.time_s)

    def bring_back(self) -> None:
        """People drive the robot back to where it began, unless they do so already."""
        if not self.robot.by_hand:
            self.robot.go([self.case.ground.start], by_hand=True)

    @property
    def led(self) -> bool:
        """Whether something else than the mission has moved the robot just now."""
        return self.time_s - self._led_s <= LED_S

    @property
    def with_people(self) -> bool:
        """Whether somebody else drives the robot."""
        return self.robot.by_hand or self.server.others or self.listener.others

    @property
    def in_the_field(self) -> bool:
        """Whether the robot is where it may be, so that a mission can go on."""
        field, place = self.case.ground.field, shapely.Point(self.robot.place)
        outside_m = shapely.Polygon(field.polygon).distance(place)
        return bool(outside_m < 0.2 and all(shapely.Polygon(ring).distance(place) > 0.5 for ring in field.no_go))

    def _move(self, for_s: float) -> list[Place]:
        robot = self.robot
        self._stood_s = 0.0 if robot.drives else self._stood_s + for_s
        passed = robot.advance(for_s)
        if not robot.drives:
            pushed = robot.push(self._misled.push(self._stood_s, self.time_s, for_s))
            if pushed:
                self._led_s = self.time_s
            passed += pushed
        if robot.astray or self.with_people:
            self._led_s = self.time_s
        return passed

    def _somebody_drives(self, span: Span) -> None:
        """Somebody else sends the robot to a node, or to a place in the middle of the field."""
        ground = self.case.ground
        if self.case.navigator == "goal_pose":
            self.listener.send(self._elsewhere(span), self.time_s, foreign=True)
            return
        target: str | Place = self._elsewhere(span)
        if self.by_name and ground.graph is not None:
            target = ground.graph.names[int(span.size * len(ground.graph.names))]
        self.server.send(target, self.time_s, foreign=ENDS[int(97 * span.size) % 3])

    def _elsewhere(self, span: Span) -> Place:
        low, high = self.case.ground.field.polygon.min(axis=0), self.case.ground.field.polygon.max(axis=0)
        x, y = (low + (high - low) * ((7 * span.size) % 1, (31 * span.size) % 1)).tolist()
        return x, y

    def _fixes(self) -> list[Fixed]:
        """Fixes that come now, with their stamps: none, one, or all that were held back."""
        if self.case.fixes_hz < 1 and self.time_s % round(1 / self.case.fixes_hz):
            return []
        return self._arrived(self._fix(), self._held_fixes)

    def records(self) -> list[CountRecord]:
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
        x, y = self._receiver.measure(self.robot.place)  # always drawn: a fault must not change later noise
        if self._same_receiver:
            self.robot.error = self._receiver.wander
        if self.faults.on(Fault.FIX_SILENT, self.time_s):
            return None
        off = self._misled.fix_error(self._stood_s, self.time_s)
        place = (x + off[0], y + off[1])
        if (span := self.faults.span(Fault.FIX_JUMP, self.time_s)) is not None:
            far_m, angle = 15.0 * 200.0**span.size, 100 * span.size
            place = (place[0] + far_m * math.cos(angle), place[1] + far_m * math.sin(angle))
        elif (span := self.faults.span(Fault.FIX_RUNS, self.time_s)) is not None:
            place = (place[0] + (20.0 + 180.0 * span.size) * (self.time_s - span.at_s), place[1])
        elif self.faults.on(Fault.FIX_FROZEN, self.time_s) and self.fixed is not None:
            place = self.fixed
        self.fixed, self._fixed_s, self._fixed_at = place, self.time_s, self.robot.place
        return place, self.now_s

    def _record(self) -> CountRecord | None:
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
        self.truth[round(self.now_s, 3), counts] = self._fixed_at  # it may have driven since
        record = CountRecord(self.now_s, x_m, y_m, 0.0, counts, CADENCE_S, CADENCE_S)
        return placed if (placed := self.doubts.placed(record)).quarantine else record  # as the driver does

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
        faults = (Fault.SERVER_DEAF, Fault.RUNS_ON, Fault.SERVER_DEAD, Fault.NO_RESULT)
        return not any(self.faults.on(fault, self.time_s - ago_s) for fault in faults for ago_s in range(15))

    @property
    def wrong_m(self) -> float:
        """Distance from the last fix to the robot [m]."""
        return 0.0 if self.fixed is None else math.dist(self.fixed, self.robot.place)


# Errors of real receivers: white noise, an error that wanders slowly, and places held while the robot stands ----

HOLD_MPS = 0.3  # A receiver that holds its place does so below this speed [m/s]
HOLD_M = 1.0  # ... until the measured place is this far from the held one [m]


class Receiver:
    """A receiver whose errors follow from its random numbers."""

    def __init__(self, noise: Noise, interval_s: float, rng: np.random.Generator) -> None:
        self._noise, self._interval_s, self._rng = noise, interval_s, rng
        self._kept = math.exp(-interval_s / noise.wander_s)
        x, y = (noise.wander_sd_m * rng.normal(size=2)).tolist()
        self.wander: Place = (x, y)  # part of the error that wanders [m]
        self._last: Place | None = None
        self._held: Place | None = None

    def measure(self, place: Place) -> Place:
        """The fix of a robot that is truly here [m]; to be called once in each interval."""
        noise = self._noise
        draws = self._rng.normal(size=4).tolist()
        fresh = math.sqrt(1 - self._kept**2) * noise.wander_sd_m
        self.wander = (
            self._kept * self.wander[0] + fresh * draws[2],
            self._kept * self.wander[1] + fresh * draws[3],
        )
        measured = (
            place[0] + self.wander[0] + noise.white_sd_m * draws[0],
            place[1] + self.wander[1] + noise.white_sd_m * draws[1],
        )
        if not noise.holds:
            return measured
        slow = self._last is not None and math.dist(self._last, place) < HOLD_MPS * self._interval_s
        self._last = place
        if self._held is None or not slow or math.dist(self._held, measured) > HOLD_M:
            self._held = measured if slow else None
        return self._held or measured
