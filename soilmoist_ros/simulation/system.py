"""The simulated system of a mission: robot, navigation, logger and GNSS receiver."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import PLACES_PER_RECORD, mission_map, start_stop
from soilmoist_ros.simulation.mission.streams import device_stream, gnss_stream, sensor_stream
from soilmoist_ros.simulation.robot.faulty_link import FaultyLink, Reachable, Sent
from soilmoist_ros.simulation.robot.scenario import Scenario
from soilmoist_ros.simulation.robot.virtual_gnss import VirtualGnss
from soilmoist_ros.simulation.robot.virtual_logger import VirtualLogger
from soilmoist_ros.simulation.robot.virtual_navigation import NavigationEvent, VirtualNavigation
from soilmoist_ros.simulation.robot.virtual_robot import VirtualRobot
from soilmoist_ros.simulation.robot.virtual_sensor import VirtualSensor

LOGGER, GNSS = "logger", "gnss"
_GGA = 1  # damages affect the sentence with the position
_NOTHING_WRONG = Scenario()


@dataclass(frozen=True)
class PropertyCounted:
    """A record from the sensor of an additional property.

    :param name: name of the property
    :param record: corrected record with position, as its driver would publish it
    """

    name: str
    record: CountRecord


Output = Sent | Reachable | PropertyCounted | NavigationEvent


class VirtualSystem:
    """Steps through simulated time. Settings, scenario and requests determine the output.

    Robot, sensors and random streams equal those of :func:`simulate_mission`: equal positions at equal times yield
    equal counts. The sensors of additional properties have no faults.

    :param settings: field, seed, robot, sensor and noise; settings of the mission itself are ignored
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    :param gnss_period_s: time between epochs of the GNSS receiver [s], > 0
    :param scenario: faults to simulate
    :raises InputError: if the field, the graph or the scenario cannot be used
    """

    def __init__(
        self,
        settings: MissionSettings,
        start_s: float,
        gnss_period_s: float = 1.0,
        scenario: Scenario = _NOTHING_WRONG,
    ) -> None:
        self.settings = settings
        self.scenario = scenario
        self.start_s = start_s
        self.now_s = 0.0
        self.field, *further = mission_fields(settings)
        self.grid = self.field.field.grid(settings.cell_m)
        self.map = mission_map(self.field.field, self.grid, settings.graph)
        _require_edges(self.map.graph.edges, self.map.graph.names, scenario)
        seed = settings.seed
        navigation, logger_link, gnss_link, tubes, *places = (
            device_stream(seed, device) for device in range(4 + len(further))
        )
        motion = RobotMotion(settings.speed_mps, settings.stop_overhead_s, settings.turn_s_per_rad)
        start = start_stop(self.field.field, self.map.graph.stops)
        self.robot = VirtualRobot(motion, (start.x_m, start.y_m))
        self.navigation = VirtualNavigation(
            GraphTravel(self.map.graph, motion), self.robot, scenario.navigation, navigation
        )
        self._free_travel = FreeTravel(motion, (self.field.polygon,), self.field.field.no_go)
        first, *others = (
            VirtualSensor(
                field, sensor_stream(seed, number), settings.cadence_s, settings.footprint_m, settings.weather
            )
            for number, field in enumerate((self.field, *further))
        )
        self.logger = VirtualLogger(first, start_s, tubes)
        self._further = [
            (wanted.name, sensor, rng)
            for wanted, sensor, rng in zip(settings.properties, others, places, strict=True)
        ]
        self._counted: list[PropertyCounted] = []
        self._gnss = VirtualGnss(self.field.frame, start_s, settings.position_sd_m, gnss_stream(seed))
        self._gnss_period_s = gnss_period_s
        self._no_fix = scenario.gnss.no_fix
        self._logger_link = FaultyLink(LOGGER, scenario.logger, logger_link)
        self._gnss_link = FaultyLink(GNSS, scenario.gnss, gnss_link)
        self._records = 0
        self._epochs = 0
        self._path: list[tuple[float, float]] = []

    def advance(self, to_s: float) -> list[Output]:
        """Advance to a time since the start [s] and return all output in order.

        The output does not depend on the number of steps.
        """
        out: list[Output] = []
        while (next_s := self._next_s) <= to_s:
            # A request since the last step may be due at once.
            self.now_s = max(next_s, self.now_s)
            self._step()
            out += self.navigation.happened(self.now_s)
            out += self._logger_link.receive(self.now_s)
            out += self._gnss_link.receive(self.now_s)
            out += self._counted
            self._counted.clear()
        self.now_s = max(to_s, self.now_s)
        return out

    def go_to(self, target: str) -> int | None:
        """Send a goal to the navigation; returns its number, ``None`` if it is rejected."""
        return self.navigation.accept(self.now_s, target)

    def cancel(self, goal_id: int) -> bool:
        """Ask the navigation to cancel a goal; returns whether its response confirms it."""
        return self.navigation.cancel(self.now_s, goal_id)

    def drive_to(self, xy: tuple[float, float]) -> float | None:
        """Drive straight to a position [m]; returns the arrival time [s], ``None`` if it cannot be reached."""
        return self.navigation.drive(self.now_s, xy, self._free_travel)

    @property
    def stamp_s(self) -> float:
        """Current simulated time [s since 1970 UTC]."""
        return self.start_s + self.now_s

    @property
    def _next_s(self) -> float:
        links = min(self._logger_link.next_s, self._gnss_link.next_s)
        return min(self._next_place_s, self._record_end_s, self._next_epoch_s, self.navigation.next_s, links)

    @property
    def _record_end_s(self) -> float:
        return (self._records + 1) * self.settings.cadence_s

    @property
    def _next_place_s(self) -> float:
        to_come = PLACES_PER_RECORD - len(self._path)
        if to_come == 0:
            return math.inf
        return self._record_end_s - self.settings.cadence_s * (to_come - 0.5) / PLACES_PER_RECORD

    @property
    def _next_epoch_s(self) -> float:
        return self._epochs * self._gnss_period_s

    def _step(self) -> None:
        """Run the sensors, the receiver and the localisation that are due now."""
        if self._next_place_s <= self.now_s:
            self._path.append(self.robot.at(self.now_s))
        if self._record_end_s <= self.now_s:
            # Latest position first, as in simulate_mission: the mean is then rounded equally.
            path = np.array(self._path[::-1])
            record = self.logger.record(self.now_s, path)
            self._records += 1
            self._path.clear()
            self._logger_link.send(self.now_s, self.logger.lines(record))
            for further in self._further:
                self._count(*further, path)
        if self._next_epoch_s <= self.now_s:
            has_fix = not any(span.covers(self.now_s) for span in self._no_fix)
            sentences = self._gnss.sentences(self.now_s, self.robot.at(self.now_s), has_fix)
            self._epochs += 1
            self._gnss_link.send(self.now_s, sentences, spoilt=_GGA)
            self.navigation.look(self.now_s)

    def _count(
        self, name: str, sensor: VirtualSensor, places: np.random.Generator, path: NDArray[np.float64]
    ) -> None:
        """Count with the sensor of an additional property along the path of a record."""
        noise = places.normal(0.0, self.settings.position_sd_m, 2)
        x_m, y_m = (path[PLACES_PER_RECORD // 2] + noise).tolist()
        record = sensor.record(self.now_s, path, (x_m, y_m))
        self._counted.append(PropertyCounted(name, replace(record, stamp_s=self.stamp_s)))


def _require_edges(edges: NDArray[np.intp], names: tuple[str, ...], scenario: Scenario) -> None:
    known = {(names[start], names[end]) for start, end in edges.tolist()}
    lost = [edge for edge in scenario.navigation.failing_edges if edge not in known]
    if lost:
        raise InputError(
            f"the map has no edge {', '.join(f'{start} -> {end}' for start, end in lost)}",
            "correct 'failing_edges' in the scenario, or give its map as 'graph'",
        )
