# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated field as a real process: time, devices on TCP, action servers."""

from __future__ import annotations

import contextlib
import json
import math
import signal
import socket
import threading
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters import counts_from_message, to_seconds
from soilmoist_ros.exploration.travel.topological_map import parse_topological_map
from soilmoist_ros.nodes.topics import CLOCK, DEFAULT, LATCHED, RECORDS
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

START_S = 1780293600.0  # 2026-06-01T06:00:00Z


class Listener:
    """A client that reads a device in a thread."""

    def __init__(self, host, port, parser):
        self.parser = parser
        self.found = []
        self._socket = socket.create_connection((host, port), timeout=20)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        try:
            for line in self._socket.makefile("rb"):
                if (found := self.parser.feed(line)) is not None:
                    self.found.append(found)
        except OSError:
            pass  # closed by the test

    @property
    def connected(self):
        return self._thread.is_alive()

    def close(self):
        with contextlib.suppress(OSError):  # the other side may have closed it
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join(10)
        self._socket.close()


class Field:
    """A running simulator with a client of each device."""

    def __init__(self, ros, folder: Path, *, listen=True, **params):
        self.ros = ros
        self.files = folder
        ports = folder / "ports.json"
        usual = {"field": "half-wet", "speed": 200.0, "logger_port": 0, "gnss_port": 0, "ports_file": str(ports)}
        self.clock = ros.collect(Clock, "/clock", CLOCK)
        self.maps = ros.collect(String, "/topological_map_2", LATCHED)
        self.current = ros.collect(String, "current_node", LATCHED)
        self.closest = ros.collect(String, "closest_node", LATCHED)
        self.process = ros.start("field_simulator", params={**usual, **params})
        ros.wait_for(lambda: ports.exists() or not self.process.running, message="the ports file")
        self.ports = json.loads(ports.read_text())
        self.listeners = []
        if listen:
            self.listen()
        self.graph = parse_topological_map(ros.wait_for(lambda: self.maps)[0].data).graph

    def listen(self):
        self.logger = self.listen_to("logger", RecordParser(FORMAT_NAME))
        self.gnss = self.listen_to("gnss", NmeaParser())
        self.listeners = [self.logger, self.gnss]

    def listen_to(self, device, parser):
        return Listener(self.ports[device]["host"], self.ports[device]["port"], parser)

    @property
    def now_s(self):
        return to_seconds(self.clock[-1].clock) - START_S

    def place(self):
        """Place of the robot in the receiver's last fix [m]."""
        position = self.gnss.found[-1].position
        return surrogate_field("half-wet").frame.to_local(position.latitude_deg, position.longitude_deg)[0]

    def is_at(self, xy):
        return bool(self.gnss.found) and self.place() == pytest.approx(xy, abs=0.2)

    def close(self):
        for listener in self.listeners:
            listener.close()


@pytest.fixture
def field(ros, tmp_path):
    made = []

    def make(**params):
        made.append(Field(ros, tmp_path, **params))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_time_devices_and_properties_belong_together(ros, field):
    simulated = field(listen=False, properties=["rough"])
    simulated.listen()
    assert not simulated.clock or simulated.now_s <= 0, "the records of the property have no receiver"
    received = ros.collect(PointCloud2, "/rough/counts", RECORDS)
    logger, gnss = simulated.logger.found, simulated.gnss.found
    ros.wait_for(lambda: len(received) > 5 and len(logger) >= 5 and len(gnss) >= 50)
    stamps = [to_seconds(message.clock) for message in simulated.clock]
    assert stamps == sorted(stamps)
    records, fixes = list(logger), list(gnss)
    assert [record.record_number for record in records] == list(range(1, len(records) + 1))
    assert [one.stamp_s for one in records] == [START_S + 10 * number for number in range(1, len(records) + 1)]
    assert [fix.stamp_s for fix in fixes] == [START_S + number for number in range(len(fixes))]
    assert simulated.logger.parser.problems == simulated.gnss.parser.problems == []
    stamps = [record.stamp_s for message in list(received) for record in counts_from_message(message)]
    assert stamps == [START_S + 10.0 * number for number in range(1, len(stamps) + 1)]
    assert {message.header.frame_id for message in received} == {"map"}
    (record,) = counts_from_message(received[0])
    assert (record.x_m, record.y_m) == pytest.approx(simulated.place(), abs=0.2)
    assert 1.0 < record.corrected_rate < 10.0
    assert record.raw_counts != sum(records[0].tube_counts)
    for listener in simulated.listeners:
        listener.close()
    simulated.listen()  # a new client gets the header first, then new lines
    ros.wait_for(lambda: len(simulated.logger.found) >= 3)
    assert simulated.logger.parser.metadata["simulated"] == "yes"
    assert simulated.process.stop(signal.SIGINT) == 0


def test_a_server_dies_while_requests_wait(ros, field, tmp_path):
    dies = ", ".join(f"{{at_s: {begin_s}, for_s: 5}}" for begin_s in range(10, 1000, 10))
    scenario = tmp_path / "dies.yaml"
    scenario.write_text(f"navigation: {{absent: [{dies}]}}")
    simulated = field(speed=50.0, scenario=str(scenario))
    client = ros.node.create_client(CancelGoal, "topological_navigation/_action/cancel_goal")

    def died(times):
        client.remove_pending_request(client.call_async(CancelGoal.Request()))
        return simulated.process.output().count("server is gone") >= times or not simulated.process.running

    ros.wait_for(lambda: died(5), message="the fifth end of the server")
    assert simulated.process.running, simulated.process.output()
    ros.node.destroy_client(client)


def test_without_the_action_it_still_drives_to_goal_poses(ros, field, tmp_path):
    absent = tmp_path / "absent" / "topological_navigation_msgs"
    absent.mkdir(parents=True)
    (absent / "__init__.py").write_text("")  # an installation without actions
    ros.environment["PYTHONPATH"] = str(absent.parent)
    simulated = field(speed=50.0)
    assert "topological_navigation_msgs is not installed" in simulated.process.output()
    publisher = ros.node.create_publisher(PoseStamped, "goal_pose", DEFAULT)
    ros.wait_for(lambda: publisher.get_subscription_count() and simulated.current)
    pose = PoseStamped()
    pose.header.frame_id = "map"
    pose.pose.position.x, pose.pose.position.y = 33.0, 21.0
    publisher.publish(pose)
    ros.wait_for(lambda: simulated.is_at((33.0, 21.0)))
    graph = simulated.graph
    nearest = min(zip(graph.names, graph.xy, strict=True), key=lambda one: math.dist(one[1], (33.0, 21.0)))[0]
    ros.wait_for(lambda: simulated.closest[-1].data == nearest, message="the closest node")
    assert {"none", graph.names[0]} <= {message.data for message in simulated.current}, "between nodes, and at one"
    pose.pose.position.x = 999.0
    publisher.publish(pose)
    ros.wait_for(lambda: "no path leads to the goal pose at x = 999 m" in simulated.process.output())
    pose.header.frame_id = "odom"
    publisher.publish(pose)
    ros.wait_for(lambda: "in frame 'odom'" in simulated.process.output())
    assert simulated.is_at((33.0, 21.0))
