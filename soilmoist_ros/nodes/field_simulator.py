"""Simulates robot, navigation, neutron logger and GNSS receiver."""

from __future__ import annotations

import math
import time
from pathlib import Path

from geometry_msgs.msg import PoseStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.counts import counts_to_message
from msg_adapters.stamps import to_time
from soilmoist_ros.nodes.navigation.virtual_navigation import NavigationServer
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.field_simulator import PARAMETERS, mission_settings
from soilmoist_ros.nodes.runtime.qos import CLOCK, DEFAULT, LATCHED, RECORDS
from soilmoist_ros.nodes.runtime.run import run
from soilmoist_ros.simulation.fields.field_files import write_field_file, write_site_file, write_truth_file
from soilmoist_ros.simulation.robot.faulty_link import Reachable, Sent
from soilmoist_ros.simulation.robot.line_server import LineServer, write_ports_file
from soilmoist_ros.simulation.robot.scenario import load_scenario
from soilmoist_ros.simulation.robot.simulated_time import SimulatedTime, read_start_time
from soilmoist_ros.simulation.robot.virtual_navigation import GoalEnded, Localised, OnRoute, ServerPresent
from soilmoist_ros.simulation.system import GNSS, LOGGER, Output, PropertyCounted, VirtualSystem

MAP_FRAME = "map"
TICK_S = 0.02
MAX_STEP_S = 0.06
"""Limit of the time that a late tick catches up: three ticks [s]."""
SETTLE_S = 1.0
"""Time from the connection of all devices to the start of simulated time [s]. Receivers of records must discover
the driver before the first record, which comes at once in fast time."""


class FieldSimulator(Node):
    """Publishes simulated time and the topics of the navigation; serves its action and the two devices."""

    def __init__(self) -> None:
        super().__init__("field_simulator")
        given = Parameters(self, PARAMETERS)
        scenario = load_scenario(given.text("scenario"))
        start_s = read_start_time(given.text("start_time"))
        settings = mission_settings(given)
        self._system = VirtualSystem(settings, start_s, given.number("gnss_period_s"), scenario)
        self._time = SimulatedTime(given.number("speed"), MAX_STEP_S)
        self._started = not given.flag("start_when_connected")
        self._connected_s = math.inf
        self._write_files(given)

        self._simulated_clock = self.create_publisher(Clock, "/clock", CLOCK)
        self._closest = self.create_publisher(String, "closest_node", LATCHED)
        self._current = self.create_publisher(String, "current_node", LATCHED)
        self._map = self.create_publisher(String, "/topological_map_2", LATCHED)
        self._map.publish(String(data=self._system.map.to_json()))
        self._properties = {
            wanted.name: self.create_publisher(PointCloud2, f"{wanted.name}/counts", RECORDS)
            for wanted in settings.properties
        }
        for name, publisher in self._properties.items():
            self._log(f"property {name} on {publisher.topic_name}")
        self._published: dict[Publisher, str] = {self._closest: "", self._current: ""}
        group = MutuallyExclusiveCallbackGroup()
        self.create_subscription(PoseStamped, "goal_pose", self._on_goal_pose, DEFAULT, callback_group=group)
        self._navigation = self._navigation_server(group)

        host = given.text("host")
        greeting = "".join(f"{line}\r\n" for line in self._system.logger.header).encode()
        self._servers: dict[str, LineServer] = {}
        self._servers[LOGGER] = LineServer("logger", host, given.whole("logger_port"), greeting)
        self._servers[GNSS] = LineServer("GNSS receiver", host, given.whole("gnss_port"))
        if given.text("ports_file"):
            addresses = {name: server.address for name, server in self._servers.items()}
            write_ports_file(addresses, Path(given.text("ports_file")))
        self._log(f"scenario: {scenario.title}")
        for name, server in self._servers.items():
            self._log("{} on {}:{}".format(name, *server.address))
        self.create_timer(TICK_S, self._tick, group, RosClock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Close the ports."""
        for server in self._servers.values():
            server.close()

    def _write_files(self, given: Parameters) -> None:
        field = self._system.field
        if given.text("field_file"):
            write_field_file(field, Path(given.text("field_file")))
        if given.text("site_file"):
            write_site_file(field, Path(given.text("site_file")))
        if given.text("truth_file"):
            write_truth_file(field, self._system.grid, Path(given.text("truth_file")))

    def _navigation_server(self, group: MutuallyExclusiveCallbackGroup) -> NavigationServer | None:
        try:
            server = NavigationServer(self, self._system, group)
        except ImportError:
            self.get_logger().warning("no navigation action: topological_navigation_msgs is not installed")
            return None
        server.set_present(self._system.navigation.present)
        return server

    def _tick(self) -> None:
        for server in self._servers.values():
            server.poll()
        wall_s = time.monotonic()
        connected = all(server.clients for server in self._servers.values())
        connected &= all(publisher.get_subscription_count() > 0 for publisher in self._properties.values())
        self._connected_s = min(self._connected_s, wall_s) if connected else math.inf
        if not self._started and wall_s - self._connected_s >= SETTLE_S:
            self._started = True
            self._log("all are connected: time begins")
        # The devices are silent before time starts, so that all runs start with the same lines.
        outputs = self._system.advance(self._time.advance(wall_s)) if self._started else []
        # The clock comes first, so that no node receives a message from its future.
        self._simulated_clock.publish(Clock(clock=to_time(self._system.stamp_s)))
        for output in outputs:
            self._carry_out(output)

    def _carry_out(self, output: Output) -> None:
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
            case OnRoute() if self._navigation is not None:
                self._navigation.feed_back(output)
            case GoalEnded() if self._navigation is not None:
                self._log(f"goal {output.goal_id} ended: {output.outcome.name}, success {output.success}")
                self._navigation.end(output)
            case ServerPresent(present) if self._navigation is not None:
                self._log(f"the navigation server is {'back' if present else 'gone'}")
                self._navigation.set_present(present)

    def _publish_node(self, publisher: Publisher, name: str) -> None:
        """Publish the name of a node if it has changed."""
        if self._published[publisher] != name:
            self._published[publisher] = name
            publisher.publish(String(data=name))

    def _on_goal_pose(self, pose: PoseStamped) -> None:
        x_m, y_m = float(pose.pose.position.x), float(pose.pose.position.y)
        if pose.header.frame_id != MAP_FRAME:
            self.get_logger().warning(f"a goal pose in frame {pose.header.frame_id!r}, not {MAP_FRAME!r}: ignored")
        elif self._system.drive_to((x_m, y_m)) is None:
            self.get_logger().warning(f"no path leads to the goal pose at x = {x_m:g} m, y = {y_m:g} m: ignored")
        else:
            self._log(f"on the way to x = {x_m:g} m, y = {y_m:g} m")

    def _log(self, text: str) -> None:
        self.get_logger().info(text)


def main() -> None:
    """Start the node."""
    run(FieldSimulator)


if __name__ == "__main__":
    main()
