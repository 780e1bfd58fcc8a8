# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates robots, navigation, neutron loggers and GNSS receivers."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters import (
    counts_to_message,
    diagnostics_to_message,
    health_from_status,
    mission_from_message,
    to_time,
)
from soilmoist_ros.exploration import PLACE_TIME, RECORD_STAMP
from soilmoist_ros.foundation import Level
from soilmoist_ros.nodes.node_process import run
from soilmoist_ros.nodes.parameter_tables import FIELD_SIMULATOR as PARAMETERS
from soilmoist_ros.nodes.parameter_tables import mission_settings
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import CLOCK, DEFAULT, LATCHED, RECORDS, every, interface_class
from soilmoist_ros.simulation import (
    GNSS,
    LOGGER,
    NO_VALID_PATH,
    GoalEnded,
    GoalOutcome,
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
    SimulatedTime,
    VirtualSystem,
    WaitingClock,
    end_to_react_to,
    load_scenario,
    read_start_time,
    robot_namespaces,
    write_ports_file,
)
from soilmoist_ros.simulation import MAX_STEP_S as MAX_PLANNED_STEP_S

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

        self._simulated_clock = self.create_publisher(Clock, "/clock", CLOCK)
        self._map = self.create_publisher(String, "/topological_map_2", LATCHED)
        self._map.publish(String(data=self._system.map.to_json()))
        self.get_logger().info(f"scenario: {scenario.title}")
        properties = [wanted.name for wanted in settings.properties]
        self._robots = [
            RobotInterface(self, robot, f"{namespace}/" if namespace else "", properties, given, start_s)
            for robot, namespace in zip(self._system.robots, robot_namespaces(settings.robots), strict=True)
        ]
        if given.text("ports_file"):
            addresses = {name: address for robot in self._robots for name, address in robot.addresses.items()}
            write_ports_file(addresses, Path(given.text("ports_file")))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        every(self, TICK_S, self._tick)
        every(self, REPORT_S, self._report)

    def close(self) -> None:
        """Close the ports."""
        self.get_logger().info(f"simulated time waited {self._waiting.waited_s:.0f} s for planners")
        for robot in self._robots:
            robot.close()

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


# Topics, action and TCP ports of a simulated robot --------------------------------------------------------------


class RobotInterface:
    """Publishes the output of a simulated robot and takes requests; ``below`` is its namespace with a slash."""

    def __init__(
        self,
        node: Node,
        robot: SimulatedRobot,
        below: str,
        properties: Iterable[str],
        given: Parameters,
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
        self._navigation = navigation_servers(node, robot, below)
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
        """True if the devices and the records of the properties have receivers."""
        return all(server.clients for server in self._servers.values()) and all(
            publisher.get_subscription_count() > 0 for publisher in self._properties.values()
        )

    @property
    def progress(self) -> RobotProgress:
        """Progress of robot and planner."""
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


# The action servers of the simulated navigation: nodes of a map (GotoNode), and poses (NavigateToPose) ----------

NODE_ACTION: Final = "topological_navigation"
POSE_ACTION: Final = "navigate_to_pose"
MAP_FRAME: Final = "map"


class NavigationServer(ABC):
    """Serves one action for a simulated robot; a goal is executed when it ends, so that no thread waits."""

    def __init__(self, node: Node, robot: SimulatedRobot, kind: Any, name: str) -> None:
        self._kind, self._node, self._robot, self._name = kind, node, robot, name
        self._server: Any = None
        self._numbers: dict[bytes, int] = {}
        self._handles: dict[int, Any] = {}
        self._endings: dict[bytes, GoalEnded] = {}
        self._accepted: int | None = None
        self.set_present(robot.navigation.present)

    def set_present(self, present: bool) -> None:
        """Start the server, or destroy it with all its goals."""
        if self._server is not None:
            self._server.destroy()
            self._server = None
            self._handles.clear()
            self._numbers.clear()
        if present:
            self._server = ActionServer(
                self._node, self._kind, self._name, execute_callback=self._execute, goal_callback=self._on_goal,
                handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel,
            )  # fmt: skip

    def feed_back(self, event: OnRoute | Remaining) -> None:
        """Publish feedback of a goal of this action."""
        feedback = self.feedback(event)
        if feedback is not None and event.goal_id in self._handles:
            self._handles[event.goal_id].publish_feedback(feedback)

    def end(self, event: GoalEnded) -> None:
        """Send the result of a goal of this action to its client."""
        handle = self._handles.pop(event.goal_id, None)
        if handle is not None:
            if event.error_code == NO_VALID_PATH:
                self._node.get_logger().warning(f"no path leads to the {self.text(handle.request)}")
            self._endings[bytes(handle.goal_id.uuid)] = event
            handle.execute()

    @abstractmethod
    def accept(self, goal: Any) -> int | None:
        """Number of the goal of a request; ``None`` if it is rejected."""

    @abstractmethod
    def text(self, goal: Any) -> str:
        """Destination of a goal, in words for the log."""

    @abstractmethod
    def feedback(self, event: OnRoute | Remaining) -> Any:
        """Feedback message of an event; ``None`` if it has none."""

    @abstractmethod
    def result(self, event: GoalEnded) -> Any:
        """Result message of a goal."""

    def _execute(self, handle: Any) -> Any:
        event = self._endings.pop(bytes(handle.goal_id.uuid))
        verbs = {
            GoalOutcome.SUCCEEDED: handle.succeed,
            GoalOutcome.CANCELED: handle.canceled,
            GoalOutcome.ABORTED: handle.abort,
        }
        verbs[event.outcome]()
        return self.result(event)

    def _on_goal(self, goal: Any) -> GoalResponse:
        # The number is needed before the handle exists. The two callbacks run directly one after the other.
        self._accepted = self.accept(goal)
        accepted = self._accepted is not None
        self._node.get_logger().info(f"goal {self.text(goal)}: {'accepted' if accepted else 'rejected'}")
        return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT

    def _on_accepted(self, handle: Any) -> None:
        assert self._accepted is not None
        self._handles[self._accepted] = handle
        self._numbers[bytes(handle.goal_id.uuid)] = self._accepted

    def _on_cancel(self, handle: Any) -> CancelResponse:
        number = self._numbers.get(bytes(handle.goal_id.uuid))
        accepted = number is not None and self._robot.cancel(number)
        return CancelResponse.ACCEPT if accepted else CancelResponse.REJECT


class GotoNodeServer(NavigationServer):
    """Serves GotoNode."""

    def __init__(self, node: Node, robot: SimulatedRobot, below: str) -> None:
        kind = interface_class("topological_navigation_msgs/action/GotoNode")
        super().__init__(node, robot, kind, f"{below}{NODE_ACTION}")

    def accept(self, goal: Any) -> int | None:
        """See :class:`NavigationServer`."""
        return self._robot.go_to(goal.target)

    def text(self, goal: Any) -> str:
        """See :class:`NavigationServer`."""
        return str(goal.target)

    def feedback(self, event: OnRoute | Remaining) -> Any:
        """The node that the robot passes."""
        return self._kind.Feedback(route=event.node) if isinstance(event, OnRoute) else None

    def result(self, event: GoalEnded) -> Any:
        """See :class:`NavigationServer`."""
        return self._kind.Result(success=bool(event.success))


class NavigateToPoseServer(NavigationServer):
    """Serves NavigateToPose. Like Nav2 it sends published poses to itself, so that they can be cancelled."""

    def __init__(self, node: Node, robot: SimulatedRobot, below: str) -> None:
        kind = interface_class("nav2_msgs/action/NavigateToPose")
        super().__init__(node, robot, kind, f"{below}{POSE_ACTION}")
        self._itself = ActionClient(node, kind, self._name)

    def send(self, pose: PoseStamped) -> None:
        """Send a pose to the own server."""
        self._itself.send_goal_async(self._kind.Goal(pose=pose))

    def accept(self, goal: Any) -> int | None:
        """See :class:`NavigationServer`."""
        place = goal.pose.pose.position
        if goal.pose.header.frame_id != MAP_FRAME:
            frame = goal.pose.header.frame_id
            self._node.get_logger().warning(f"a goal pose in frame {frame!r}, not {MAP_FRAME!r}: ignored")
            return None
        return self._robot.go_to_pose((float(place.x), float(place.y)))

    def text(self, goal: Any) -> str:
        """See :class:`NavigationServer`."""
        place = goal.pose.pose.position
        return f"goal pose at x = {place.x:g} m, y = {place.y:g} m"

    def feedback(self, event: OnRoute | Remaining) -> Any:
        """The distance that remains."""
        if isinstance(event, OnRoute):
            return None
        return self._kind.Feedback(distance_remaining=float(event.distance_m))

    def result(self, event: GoalEnded) -> Any:
        """See :class:`NavigationServer`; Nav2 of Humble has no error code."""
        result = self._kind.Result()
        if hasattr(result, "error_code"):
            result.error_code = int(event.error_code)
        return result


def navigation_servers(node: Node, robot: SimulatedRobot, below: str) -> list[NavigationServer]:
    """Servers of the actions whose types are installed; ``below`` is the namespace of the robot and a slash."""
    servers: list[NavigationServer] = []
    makers: dict[str, Callable[[Node, SimulatedRobot, str], NavigationServer]] = {
        "topological_navigation_msgs": GotoNodeServer,
        "nav2_msgs": NavigateToPoseServer,
    }
    for package, make in makers.items():
        try:
            servers.append(make(node, robot, below))
        except ImportError as error:
            node.get_logger().warning(f"a navigation action is missing: {package} is not installed ({error})")
    return servers


def main() -> None:
    """Start the node. Its action servers disappear and return, which crashes the executor of the other nodes."""
    run(FieldSimulator, SingleThreadedExecutor)


if __name__ == "__main__":
    main()
