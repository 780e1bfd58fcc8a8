# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to a mission, for a live view."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from functools import partial

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import NavSatFix, PointCloud2

from msg_adapters import (
    diagnostics_from_message,
    health_from_status,
    mission_from_message,
    samples_from_message,
    soil_map_from_message,
)
from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import MapWorker
from soilmoist_ros.nodes.runtime.qos import DEFAULT, LATCHED, SENSOR
from soilmoist_ros.reporting import LiveMap, LiveMission, LiveRobot
from soilmoist_ros.sensing import logger_fault
from soilmoist_ros.simulation import CLOCK_PART, WAITS_FOR


class Monitor(Node):
    """Keeps a :class:`LiveMission` up to date; unreadable messages are ignored.

    :param live: the mission, with a map for each property to subscribe to
    :param frame: plane of the field
    :param context: context of the node
    """

    def __init__(self, live: LiveMission, frame: LocalFrame, context: Context) -> None:
        super().__init__("monitor", context=context)
        self._live = live
        self._frame = frame
        for robot in live.robots:
            below = f"{robot.namespace}/" if robot.namespace else ""
            self.create_subscription(
                DiagnosticStatus, f"{below}mission", partial(self._on_mission, robot), LATCHED
            )
            self.create_subscription(NavSatFix, f"{below}fix", partial(self._on_fix, robot), SENSOR)
        for one in live.maps:
            topic = f"{one.name}/soil_map" if one.name else "soil_map"
            self.create_subscription(PointCloud2, topic, partial(self._on_map, one), LATCHED)
        self.create_subscription(PointCloud2, "samples", self._on_samples, LATCHED)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEFAULT)

    def _on_mission(self, robot: LiveRobot, message: DiagnosticStatus) -> None:
        with contextlib.suppress(ValueError):
            mission_from_message(message)
            robot.status = dict(health_from_status(message).values)

    def _on_map(self, live: LiveMap, message: PointCloud2) -> None:
        with contextlib.suppress(ValueError):
            live.cells = soil_map_from_message(message)

    def _on_samples(self, message: PointCloud2) -> None:
        with contextlib.suppress(ValueError):
            self._live.samples_xy = samples_from_message(message).xy

    def _on_fix(self, robot: LiveRobot, message: NavSatFix) -> None:
        if message.status.status >= 0:
            x_m, y_m = self._frame.to_local(message.latitude, message.longitude)[0]
            robot.xy = (float(x_m), float(y_m))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        parts = diagnostics_from_message(message)
        for robot in self._live.robots:
            fault = logger_fault(parts, f"/{robot.namespace}")
            robot.sensor_fault = robot.sensor_fault if fault is None else fault
        for health in parts:
            if health.name.endswith(f": {CLOCK_PART}"):
                self._live.clock_waits_for = health.values.get(WAITS_FOR, "")
            if health.name.endswith(f": {MapWorker.PART}") and MapWorker.RAIN in health.values:
                self._live.rain = health.values[MapWorker.RAIN]


@contextlib.contextmanager
def monitored(live: LiveMission, frame: LocalFrame, domain: int) -> Iterator[None]:
    """Run a :class:`Monitor` in a thread.

    :param live: the mission to keep up to date
    :param frame: plane of the field
    :param domain: number of the ROS domain
    """
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    executor = SingleThreadedExecutor(context=context)
    monitor = Monitor(live, frame, context)
    executor.add_node(monitor)
    ending = threading.Event()

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.2)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join(2.0)
        executor.shutdown()
        monitor.destroy_node()
        context.try_shutdown()
