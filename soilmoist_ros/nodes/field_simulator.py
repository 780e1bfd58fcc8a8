# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates robots, navigation, neutron loggers and GNSS receivers."""

from __future__ import annotations

import math
import time
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from msg_adapters import diagnostics_to_message, to_time
from soilmoist_ros.foundation import Level
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.field_simulator import PARAMETERS, mission_settings
from soilmoist_ros.nodes.runtime.qos import CLOCK, DEFAULT, LATCHED
from soilmoist_ros.nodes.runtime.run import run
from soilmoist_ros.nodes.wiring.robot_interface import RobotInterface
from soilmoist_ros.simulation import MAX_STEP_S as MAX_PLANNED_STEP_S
from soilmoist_ros.simulation import (
    Output,
    SimulatedTime,
    VirtualSystem,
    WaitingClock,
    load_scenario,
    read_start_time,
    robot_namespaces,
    write_field_file,
    write_ports_file,
    write_site_file,
    write_truth_file,
)

TICK_S = 0.02
REPORT_S = 1.0
MAX_STEP_S = 0.06
"""Limit of the time that a late tick catches up: three ticks [s]."""
SETTLE_S = 1.0
"""Time from the connection of all devices to the start of simulated time [s]. Receivers of records must discover
the driver before the first record, which comes at once in fast time."""


class FieldSimulator(Node):
    """Publishes simulated time and the topics of the navigation; serves its action and the devices."""

    def __init__(self) -> None:
        super().__init__("field_simulator")
        given = Parameters(self, PARAMETERS)
        scenario = load_scenario(given.text("scenario"))
        settings = mission_settings(given)
        start_s = read_start_time(given.text("start_time"))
        self._system = VirtualSystem(settings, start_s, given.number("gnss_period_s"), scenario)
        self._time = SimulatedTime(given.number("speed"), MAX_STEP_S)
        self._waiting = WaitingClock(given.number("gnss_period_s"), given.number("wait_limit_s"))
        self._noted = ""
        self._started = not given.flag("start_when_connected")
        self._connected_s = math.inf
        self._write_files(given)

        self._simulated_clock = self.create_publisher(Clock, "/clock", CLOCK)
        self._map = self.create_publisher(String, "/topological_map_2", LATCHED)
        self._map.publish(String(data=self._system.map.to_json()))
        self.get_logger().info(f"scenario: {scenario.title}")
        properties = [wanted.name for wanted in settings.properties]
        plain_feedback = scenario.navigation.feedback == "topic"
        self._robots = [
            RobotInterface(
                self,
                robot,
                f"{namespace}/" if namespace else "",
                properties,
                given,
                plain_feedback,
                start_s,
            )
            for robot, namespace in zip(self._system.robots, robot_namespaces(settings.robots), strict=True)
        ]
        if given.text("ports_file"):
            addresses = {name: address for robot in self._robots for name, address in robot.addresses.items()}
            write_ports_file(addresses, Path(given.text("ports_file")))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        steady = RosClock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK_S, self._tick, clock=steady)
        self.create_timer(REPORT_S, self._report, clock=steady)

    def close(self) -> None:
        """Close the ports."""
        self.get_logger().info(f"simulated time waited {self._waiting.waited_s:.0f} s for planners")
        for robot in self._robots:
            robot.close()

    def _write_files(self, given: Parameters) -> None:
        field = self._system.field
        if given.text("field_file"):
            write_field_file(field, Path(given.text("field_file")))
        if given.text("site_file"):
            write_site_file(field, Path(given.text("site_file")), given.number("footprint_m"))
        if given.text("truth_file"):
            write_truth_file(field, self._system.grid, Path(given.text("truth_file")))

    def _tick(self) -> None:
        for robot in self._robots:
            robot.poll()
        wall_s = time.monotonic()
        connected = all(robot.connected for robot in self._robots)
        self._connected_s = min(self._connected_s, wall_s) if connected else math.inf
        if not self._started and wall_s - self._connected_s >= SETTLE_S:
            self._started = True
            self.get_logger().info("all are connected: time begins")
        step_s = self._time.step_s(wall_s)
        # The devices are silent before time starts, so that all runs start with the same lines.
        outputs = self._advance(wall_s, step_s) if self._started else [[]] * len(self._robots)
        # The clock comes first, so that no node receives a message from its future.
        self._simulated_clock.publish(Clock(clock=to_time(self._system.stamp_s)))
        for robot, its in zip(self._robots, outputs, strict=True):
            for output in its:
                robot.carry_out(output)

    def _advance(self, wall_s: float, step_s: float) -> list[list[Output]]:
        """Output of the robots until the time after a step, or until time has to wait for a planner."""
        system = self._system
        progress = {robot.name: robot.progress for robot in self._robots}
        end_s = max(self._waiting.may_run_to(wall_s, progress), system.now_s)
        has_planner = any(its.phase is not None for its in progress.values())
        step_s = min(step_s, MAX_PLANNED_STEP_S) if has_planner else step_s
        return system.advance(min(system.now_s + step_s, end_s), step_by_step=has_planner)

    def _report(self) -> None:
        health = self._waiting.health
        if health.level is not Level.OK and health.message != self._noted:
            self.get_logger().warning(health.message)
        self._noted = health.message
        now_s, name = self._system.stamp_s, self.get_fully_qualified_name()
        self._diagnostics.publish(diagnostics_to_message([health], now_s, name))


def main() -> None:
    """Start the node. Its action servers disappear and return, which crashes the executor of the other nodes."""
    run(FieldSimulator, SingleThreadedExecutor)


if __name__ == "__main__":
    main()
