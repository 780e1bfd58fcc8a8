# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated system of a mission: a field with robots, each with navigation, logger and GNSS receiver."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import GraphTravel
from soilmoist_ros.foundation import InputError
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.mission_ground import fenced_map, mission_map, start_stop
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.robot.scenario import Scenario
from soilmoist_ros.simulation.robot.virtual_navigation import GoalEnded
from soilmoist_ros.simulation.simulated_robot import Output, SimulatedRobot

_NOTHING_WRONG = Scenario()


class VirtualSystem:
    """Steps through simulated time. Settings, scenario and requests determine the output.

    Robots, sensors and random streams equal those of :func:`simulate_mission`: equal positions at equal times
    yield equal counts. The scenario applies to each robot.

    :param settings: field, seed, robots, sensor and noise; settings of the mission itself are ignored
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    :param gnss_period_s: time between epochs of the GNSS receivers [s], > 0
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
        self.scenario = scenario
        self.start_s = start_s
        self.now_s = 0.0
        fields = mission_fields(settings)
        self.field = fields[0]
        self.grid = self.field.field.grid(settings.cell_m)
        self.map = mission_map(self.field.field, self.grid, settings.graph)
        _require_edges(self.map.graph.edges, self.map.graph.names, scenario)
        travel = GraphTravel(self.map.graph, settings.real_motion)
        start = start_stop(self.field.field, fenced_map(self.field.field, self.map).stops)
        self.robots = tuple(
            SimulatedRobot(
                number, settings, fields, travel, (start.x_m, start.y_m), start_s, gnss_period_s, scenario
            )
            for number in range(settings.robots)
        )

    def advance(self, to_s: float, step_by_step: bool = False) -> list[list[Output]]:
        """Advance to a time since the start [s], and return the output of each robot in order.

        The output does not depend on the number of steps.

        :param to_s: time to advance to [s]
        :param step_by_step: whether to stop earlier, when a goal of a robot ends or a record is sent
        """
        out: list[list[Output]] = [[] for _ in self.robots]
        while (next_s := min(robot.next_s for robot in self.robots)) <= to_s:
            # A request since the last step may be due at once.
            self.now_s = max(next_s, self.now_s)
            new = [robot.step(self.now_s) if robot.next_s <= self.now_s else [] for robot in self.robots]
            for outputs, more in zip(out, new, strict=True):
                outputs += more
            if step_by_step and any(
                self._is_step(robot, more) for robot, more in zip(self.robots, new, strict=True)
            ):
                to_s = self.now_s
        self.now_s = max(to_s, self.now_s)
        for robot in self.robots:
            robot.now_s = self.now_s
        return out

    def _is_step(self, robot: SimulatedRobot, outputs: Sequence[Output]) -> bool:
        """Whether a planner may have to decide something now."""
        return robot.sent_s == self.now_s or any(isinstance(output, GoalEnded) for output in outputs)

    @property
    def stamp_s(self) -> float:
        """Current simulated time [s since 1970 UTC]."""
        return self.start_s + self.now_s


def _require_edges(edges: NDArray[np.intp], names: tuple[str, ...], scenario: Scenario) -> None:
    known = {(names[start], names[end]) for start, end in edges.tolist()}
    lost = [edge for edge in scenario.navigation.failing_edges if edge not in known]
    if lost:
        raise InputError(
            f"the map has no edge {', '.join(f'{start} -> {end}' for start, end in lost)}",
            "correct 'failing_edges' in the scenario, or give its map as 'graph'",
        )
