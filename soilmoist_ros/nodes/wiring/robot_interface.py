# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topics, action and TCP ports of a simulated robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters import counts_to_message, health_from_status, mission_from_message
from soilmoist_ros.exploration import PLACE_TIME, RECORD_STAMP
from soilmoist_ros.nodes.navigation.virtual_navigation import MAP_FRAME, NavigateToPoseServer, navigation_servers
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.runtime.qos import DEFAULT, LATCHED, RECORDS
from soilmoist_ros.simulation import (
    GNSS,
    LOGGER,
    GoalEnded,
    LineServer,
    Localised,
    OnRoute,
    Output,
    PropertyCounted,
    Reachable,
    Remaining,
    RobotProgress,
    Sent,
    ServerPresent,
    SimulatedRobot,
    end_to_react_to,
)


class RobotInterface:
    """Publishes the output of a simulated robot, and passes requests to it.

    :param node: the node that serves
    :param robot: the robot
    :param below: namespace of the robot below the node's namespace, with a slash at its end; empty for none
    :param properties: names of the additional properties
    :param given: parameters of the node
    :param plain_feedback: whether the navigation publishes feedback on a topic instead of the action
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    :raises InputError: if a port cannot be opened
    """

    def __init__(
        self,
        node: Node,
        robot: SimulatedRobot,
        below: str,
        properties: Iterable[str],
        given: Parameters,
        plain_feedback: bool,
        start_s: float,
    ) -> None:
        self.robot, self.name = robot, below.rstrip("/") or "the robot"
        self._start_s, self._epoch_s = start_s, given.number("gnss_period_s")
        self._log = node.get_logger()
        self._below = below
        self._closest = node.create_publisher(String, f"{below}closest_node", LATCHED)
        self._current = node.create_publisher(String, f"{below}current_node", LATCHED)
        self._published: dict[Publisher, str] = {self._closest: "", self._current: ""}
        self._properties = {
            name: node.create_publisher(PointCloud2, f"{below}{name}/counts", RECORDS) for name in properties
        }
        for name, publisher in self._properties.items():
            self._log.info(f"property {name} on {publisher.topic_name}")
        node.create_subscription(PoseStamped, f"{below}goal_pose", self._on_goal_pose, DEFAULT)
        node.create_subscription(DiagnosticStatus, f"{below}mission", self._on_mission, LATCHED)
        self._node, self._mission, self._progress = node, f"{below}mission", RobotProgress()
        self._target_xy: tuple[float, float] | None = None
        self._by_topic = False
        self._navigation = navigation_servers(node, robot, below, plain_feedback)
        host, greeting = given.text("host"), "".join(f"{line}\r\n" for line in robot.logger.header).encode()
        port = partial(_port, given, robot.number)
        self._servers = {
            LOGGER: LineServer(f"{below}logger", host, port("logger_port"), greeting),
            GNSS: LineServer(f"{below}GNSS receiver", host, port("gnss_port")),
        }
        for server in self._servers.values():
            self._log.info("{} on {}:{}".format(server.name, *server.address))

    @property
    def addresses(self) -> dict[str, tuple[str, int]]:
        """Host and port of each device."""
        return {f"{self._below}{name}": server.address for name, server in self._servers.items()}

    @property
    def connected(self) -> bool:
        """Whether the devices and the records of the properties have receivers."""
        return all(server.clients for server in self._servers.values()) and all(
            publisher.get_subscription_count() > 0 for publisher in self._properties.values()
        )

    @property
    def progress(self) -> RobotProgress:
        """How far robot and planner are."""
        if self._progress.phase is None or not self._node.count_publishers(self._mission):
            return RobotProgress()  # a planner that has died is not waited for
        has_driver = bool(self._servers[LOGGER].clients)
        idle = self._target_xy is not None and self.robot.waits_for_goal(self._target_xy)
        ended_s = self._progress.goal_ended_s if self.robot.goal_id is None else math.nan
        fixed_s = self.robot.fixed_s if self._servers[GNSS].clients else -math.inf
        return replace(
            self._progress,
            sent_s=self.robot.sent_s if has_driver else -math.inf,
            goal_ended_s=end_to_react_to(ended_s, self.robot.now_s, fixed_s, self._epoch_s),
            waits_for_goal=idle,
            fixed_s=fixed_s,
        )

    def poll(self) -> None:
        """Serve the clients of the devices."""
        for server in self._servers.values():
            server.poll()

    def close(self) -> None:
        """Close the ports."""
        for server in self._servers.values():
            server.close()

    def carry_out(self, output: Output) -> None:
        """Publish an output of the robot."""
        match output:
            case Sent(link, data):
                self._servers[link].send(data)
            case Reachable(link, reachable):
                self._servers[link].set_reachable(reachable)
            case PropertyCounted(name, record):
                self._properties[name].publish(counts_to_message([record], MAP_FRAME))
            case Localised(closest, current):
                self._publish_node(self._closest, closest)
                self._publish_node(self._current, current)
            case OnRoute() | Remaining():
                for server in self._navigation:
                    server.feed_back(output)
            case GoalEnded():
                self._log.info(
                    f"{self._below}goal {output.goal_id} ended: {output.outcome.name}, success {output.success}"
                )
                for server in self._navigation:
                    server.end(output)
                if not self._by_topic:  # whoever sends poses gets no results, and watches the place instead
                    self._progress = replace(
                        self._progress, goal_ended_s=self.robot.now_s, goal_untrue=output.untrue
                    )
            case ServerPresent(present):
                self._log.info(f"the {self._below}navigation server is {'back' if present else 'gone'}")
                for server in self._navigation:
                    server.set_present(present)

    def _publish_node(self, publisher: Publisher, name: str) -> None:
        """Publish the name of a node if it has changed."""
        if self._published[publisher] != name:
            self._published[publisher] = name
            publisher.publish(String(data=name))

    def _on_mission(self, message: DiagnosticStatus) -> None:
        try:
            status = mission_from_message(message)
        except ValueError:
            return
        values = health_from_status(message).values
        handled_s, placed_s = (float(values.get(key, "nan")) - self._start_s for key in (RECORD_STAMP, PLACE_TIME))
        target = None if status.target is None else (status.target.x_m, status.target.y_m)
        same = (status.phase, target) == (self._progress.phase, self._target_xy)
        ended_s = self._progress.goal_ended_s if same else math.nan
        untrue = same and self._progress.goal_untrue
        self._progress = RobotProgress(status.phase, -math.inf, handled_s, ended_s, untrue, placed_s=placed_s)
        self._target_xy = target

    def _on_goal_pose(self, pose: PoseStamped) -> None:
        x_m, y_m = float(pose.pose.position.x), float(pose.pose.position.y)
        if pose.header.frame_id != MAP_FRAME:
            self._log.warning(f"a goal pose in frame {pose.header.frame_id!r}, not {MAP_FRAME!r}: ignored")
        elif poses := [server for server in self._navigation if isinstance(server, NavigateToPoseServer)]:
            poses[0].send(pose)
            self._by_topic = True
        elif self.robot.drive_to((x_m, y_m)) is None:
            self._log.warning(f"no path leads to the goal pose at x = {x_m:g} m, y = {y_m:g} m: ignored")
        else:
            self._log.info(f"{self._below}on the way to x = {x_m:g} m, y = {y_m:g} m")


def _port(given: Parameters, number: int, name: str) -> int:
    """Port of a device: that of robot 0 is the parameter, each further one is two higher; 0 for a free one."""
    port = given.whole(name)
    return port + 2 * number if port else 0
