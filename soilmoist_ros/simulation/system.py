# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated system of a mission: a field with robots, each with navigation, logger and GNSS receiver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import FreeTravel, GraphTravel
from soilmoist_ros.sensing import CountRecord
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.mission_ground import fenced_map, mission_map, start_stops
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import PLACES_PER_RECORD
from soilmoist_ros.simulation.mission.streams import device_stream, gnss_stream, sensor_stream
from soilmoist_ros.simulation.robot.scenario import Scenario
from soilmoist_ros.simulation.robot.simulated_links import FaultyLink, Reachable, Sent
from soilmoist_ros.simulation.robot.virtual_devices import VirtualGnss, VirtualLogger, VirtualSensor
from soilmoist_ros.simulation.robot.virtual_navigation import (
    GoalEnded,
    NavigationEvent,
    VirtualNavigation,
    VirtualRobot,
)

_NOTHING_WRONG = Scenario()
LOGGER = "logger"
GNSS = "gnss"
AWAY_M = 3.0  # a robot nearer to its target may be there for the mission [m]
_GGA = 1  # damages affect the sentence with the position


class VirtualSystem:
    """Steps through simulated time. Settings, scenario and requests determine the output.

    Robots, sensors and random streams equal those of :func:`simulate_mission`: equal positions at equal times
    yield equal counts. The scenario applies to each robot.

    :param settings: field, seed, robots, sensor and noise; settings of the mission itself are ignored
    :raises InputError: if the field or the graph cannot be used
    """

    def __init__(
        self,
        settings: MissionSettings,
        start_s: float,
        gnss_period_s: float = 1.0,
        scenario: Scenario = _NOTHING_WRONG,
    ) -> None:
        self.scenario = scenario
        self.start_s = start_s
        self.now_s = 0.0
        fields = mission_fields(settings)
        self.field = fields[0]
        self.grid = self.field.field.grid(settings.cell_m)
        self.map = mission_map(self.field.field, self.grid, settings.graph)
        travel = GraphTravel(self.map.graph, settings.motion)
        starts = start_stops(self.field.field, fenced_map(self.field.field, self.map).stops, settings)
        self.robots = tuple(
            SimulatedRobot(number, settings, fields, travel, start.xy, start_s, gnss_period_s, scenario)
            for number, start in enumerate(starts)
        )

    def advance(self, to_s: float, step_by_step: bool = False) -> list[list[Output]]:
        """Advance to a time since the start [s], and return the output of each robot in order.

        The output does not depend on the number of steps.

        :param step_by_step: whether to stop earlier, when a goal of a robot ends or a record is sent
        """
        out: list[list[Output]] = [[] for _ in self.robots]
        while (next_s := min(robot.next_s for robot in self.robots)) <= to_s:
            # A request since the last step may be due at once.
            self.now_s = max(next_s, self.now_s)
            new = [robot.step(self.now_s) if robot.next_s <= self.now_s else [] for robot in self.robots]
            for outputs, more in zip(out, new, strict=True):
                outputs += more
            # A planner may have to decide something now.
            sent = any(robot.sent_s == self.now_s for robot in self.robots)
            if step_by_step and (sent or any(isinstance(each, GoalEnded) for more in new for each in more)):
                to_s = self.now_s
        self.now_s = max(to_s, self.now_s)
        for robot in self.robots:
            robot.now_s = self.now_s
        return out

    @property
    def stamp_s(self) -> float:
        """Current simulated time [s since 1970 UTC]."""
        return self.start_s + self.now_s


@dataclass(frozen=True)
class PropertyCounted:
    """A record from the sensor of an additional property."""

    name: str  # name of the property
    record: CountRecord  # corrected record with position, as its driver would publish it


Output = Sent | Reachable | PropertyCounted | NavigationEvent


def robot_namespaces(robots: int) -> tuple[str, ...]:
    """Namespaces of the robots of a simulated system; a single robot has none.

    >>> robot_namespaces(2)
    ('robot_1', 'robot_2')
    """
    return tuple(f"robot_{number + 1}" for number in range(robots)) if robots > 1 else ("",)


class SimulatedRobot:
    """Body and devices of one robot. The sensors of additional properties have no faults.

    :param fields: surrogate field of each property; the first is counted by the logger
    """

    def __init__(
        self,
        number: int,
        settings: MissionSettings,
        fields: Sequence[SurrogateField],
        travel: GraphTravel,
        start_xy: tuple[float, float],
        start_s: float,
        gnss_period_s: float,
        scenario: Scenario,
    ) -> None:
        self.number = number
        self.now_s = 0.0
        self.sent_s = -math.inf  # end of the last record that the logger sent whole [s]
        self.fixed_s = -math.inf  # time of the last fix that the receiver sent whole [s]
        self.goal_id: int | None = None  # goal of the navigation that has not ended
        self._cadence_s, self._position_sd_m = settings.cadence_s, settings.position_sd_m
        self._start_s = start_s
        seed, robots = settings.seed, settings.robots
        navigation, logger_link, gnss_link, tubes, *places = (
            device_stream(seed, device, number, robots) for device in range(3 + len(fields))
        )
        self.body = VirtualRobot(travel.motion, start_xy)
        self.navigation = VirtualNavigation(travel, self.body, scenario.navigation, navigation)
        field = fields[0]
        self._free_travel = FreeTravel(travel.motion, (field.polygon,), field.field.no_go)
        first, *others = (
            VirtualSensor(
                one, sensor_stream(seed, kind, number, robots), settings.cadence_s, settings.footprint_m,
                settings.weather, scenario.rain.drift if scenario.rain else settings.rate_drift,
            )
            for kind, one in enumerate(fields)
        )  # fmt: skip
        self.logger = VirtualLogger(first, start_s, tubes, scenario.sensor)
        self._further = [
            (wanted.name, sensor, rng)
            for wanted, sensor, rng in zip(settings.properties, others, places, strict=True)
        ]
        self._counted: list[PropertyCounted] = []
        self._gnss = VirtualGnss(field.frame, start_s, settings.position_sd_m, gnss_stream(seed, number))
        self._gnss_period_s = gnss_period_s
        self._no_fix, self._shifts = scenario.gnss.no_fix, scenario.gnss.shifts
        self._logger_link = FaultyLink(LOGGER, scenario.logger, logger_link)
        self._gnss_link = FaultyLink(GNSS, scenario.gnss, gnss_link)
        self._records = 0
        self._epochs = 0
        self._path: list[tuple[float, float]] = []

    def step(self, now_s: float) -> list[Output]:
        """Run all that is due [s since the start], and return the output in order."""
        self.now_s = now_s
        self._run_devices()
        out: list[Output] = [*self.navigation.happened(now_s)]
        if any(isinstance(event, GoalEnded) and event.goal_id == self.goal_id for event in out):
            self.goal_id = None
        out += [*self._logger_link.receive(now_s), *self._gnss_link.receive(now_s), *self._counted]
        self._counted.clear()
        return out

    def go_to(self, target: str) -> int | None:
        """Send a goal to the navigation; returns its number, ``None`` if it is rejected."""
        goal_id = self.navigation.accept(self.now_s, target)
        self.goal_id = self.goal_id if goal_id is None else goal_id
        return goal_id

    def go_to_pose(self, xy: tuple[float, float]) -> int | None:
        """Send a place [m] to the navigation; returns the number of the goal, ``None`` if it is rejected."""
        goal_id = self.navigation.accept_pose(self.now_s, xy, self._free_travel)
        self.goal_id = self.goal_id if goal_id is None else goal_id
        return goal_id

    def cancel(self, goal_id: int) -> bool:
        """Ask the navigation to cancel a goal; returns whether its response confirms it."""
        return self.navigation.cancel(self.now_s, goal_id)

    def drive_to(self, xy: tuple[float, float]) -> float | None:
        """Drive straight to a position [m]; returns the arrival time [s], ``None`` if it cannot be reached."""
        return self.navigation.drive(self.now_s, xy, self._free_travel)

    def waits_for_goal(self, target_xy: tuple[float, float]) -> bool:
        """True if the robot stands without a goal, away from a target [m], though the navigation is there."""
        idle = self.goal_id is None and self.body.stands(self.now_s) and self.navigation.present
        return idle and math.dist(self.body.at(self.now_s), target_xy) > AWAY_M

    @property
    def next_s(self) -> float:
        """Time of the next output or measurement [s since the start]."""
        links = min(self._logger_link.next_s, self._gnss_link.next_s)
        return min(self._next_place_s, self._record_end_s, self._next_epoch_s, self.navigation.next_s, links)

    @property
    def _record_end_s(self) -> float:
        return (self._records + 1) * self._cadence_s

    @property
    def _next_place_s(self) -> float:
        to_come = PLACES_PER_RECORD - len(self._path)
        if to_come == 0:
            return math.inf
        return self._record_end_s - self._cadence_s * (to_come - 0.5) / PLACES_PER_RECORD

    @property
    def _next_epoch_s(self) -> float:
        return self._epochs * self._gnss_period_s

    def _run_devices(self) -> None:
        """Run the sensors, the receiver and the localisation that are due now."""
        if self._next_place_s <= self.now_s:
            self._path.append(self.body.at(self.now_s))
        if self._record_end_s <= self.now_s:
            # Latest position first, as in simulate_mission: the mean is then rounded equally.
            path = np.array(self._path[::-1])
            record = self.logger.record(self.now_s, path)
            self._records += 1
            self._path.clear()
            if self._logger_link.send(self.now_s, self.logger.lines(record)):
                self.sent_s = self.now_s
            for further in self._further:
                self._count(*further, path)
        if self._next_epoch_s <= self.now_s:
            has_fix = not any(span.covers(self.now_s) for span in self._no_fix)
            sentences = self._gnss.sentences(self.now_s, self._reported_place, has_fix)
            self._epochs += 1
            if self._gnss_link.send(self.now_s, sentences, spoilt=_GGA) and has_fix:
                self.fixed_s = self.now_s
            self.navigation.look(self.now_s)

    @property
    def _reported_place(self) -> tuple[float, float]:
        """Place that the receiver reports, errors included [m]."""
        x_m, y_m = self.body.at(self.now_s)
        wrong = [shift for shift in self._shifts if shift.covers(self.now_s)]
        return x_m + sum(shift.east_m for shift in wrong), y_m + sum(shift.north_m for shift in wrong)

    def _count(
        self, name: str, sensor: VirtualSensor, places: np.random.Generator, path: NDArray[np.float64]
    ) -> None:
        """Count with the sensor of an additional property along the path of a record."""
        noise = places.normal(0.0, self._position_sd_m, 2)
        x_m, y_m = (path[PLACES_PER_RECORD // 2] + noise).tolist()
        record = sensor.record(self.now_s, path, (x_m, y_m))
        self._counted.append(PropertyCounted(name, replace(record, stamp_s=self._start_s + self.now_s)))
