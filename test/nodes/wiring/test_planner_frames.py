# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The planner's frames (planner_frames.py) with real nodes: shifted navigations, other datums, TF that agrees."""

import json
import math
import threading

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
pytest.importorskip("tf2_msgs")
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from test_planner import Planning
from tf2_msgs.msg import TFMessage
from virtual_navigation import FRAME, START_S, VirtualNavigation, World, make_map

from msg_adapters.counts import counts_to_message
from msg_adapters.diagnostics import diagnostics_from_message
from msg_adapters.stamps import to_time
from soilmoist_ros.exploration.guard.robot_frames import datum_text, yaw_rotation
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.foundation.health import Level
from soilmoist_ros.foundation.plane_move import PlaneMove
from soilmoist_ros.nodes.runtime.qos import DEFAULT, RECORDS, TF, TF_STATIC
from soilmoist_ros.sensing.records import CountRecord

pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class Localisation:
    """Context manager of TF from ``map`` over ``odom`` to ``base_link``, in a frame that is moved."""

    def __init__(self, ros, world, move, frame="map"):
        self.world, self.move, self.frame = world, move, frame
        self.node = Node("localisation", context=ros.context)
        self.tf = self.node.create_publisher(TFMessage, "/tf", TF)
        static = self.node.create_publisher(TFMessage, "/tf_static", TF_STATIC)
        static.publish(TFMessage(transforms=[self.link(frame, "odom", (1.0, 2.0))]))
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *exception):
        self.running = False
        self.thread.join(5)
        self.node.destroy_node()

    def run(self):
        pause = threading.Event()
        while self.running:
            x, y = self.move.place(self.world.place)
            message = TFMessage(transforms=[self.link("odom", "base_link", (x - 1.0, y - 2.0), self.move.yaw_rad)])
            self.tf.publish(message)
            pause.wait(0.05)

    def link(self, parent, child, place, yaw_rad=0.0):
        made = TransformStamped(child_frame_id=child)
        made.header.frame_id, made.header.stamp = parent, to_time(self.world.now_s)
        made.transform.translation.x, made.transform.translation.y = place
        rotation = made.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = yaw_rotation(yaw_rad)
        return made


def part(found, name):
    """The last state of a part of the planner, ``None`` before."""
    all_of_it = [part for message in list(found) for part in diagnostics_from_message(message)]
    return next((each for each in reversed(all_of_it) if each.name == f"/planner: {name}"), None)


def test_a_shifted_navigation_is_refused_and_holds_a_mission_until_it_agrees(ros, tmp_path):
    found = ros.collect(DiagnosticArray, "/diagnostics", DEFAULT)
    counts = ros.node.create_publisher(PointCloud2, "counts", RECORDS)
    shifted = PlaneMove(0.0, (0.0, 30.0))
    with World(ros, rate=5.0) as world, VirtualNavigation(ros, world), Localisation(ros, world, shifted) as tf:
        planning = Planning(ros, tmp_path, hours=2.0, dwell="fmi:600")

        def refusal():
            answer = planning.call("start")
            assert not answer.success
            return "TF places the robot 30.0 m north of its fix" in answer.message

        ros.wait_for(refusal, message="the refusal of a start")
        frames = ros.wait_for(lambda: (last := part(found, "frames")) and last.level is Level.ERROR and last)
        assert (frames.values["TF minus fix, north [m]"], frames.values["limit [m]"]) == ("30.00", "2.00")
        assert "or set navigation_datum: 53.26" in frames.message

        tf.move = PlaneMove()
        ros.wait_for(lambda: planning.call("start").success, message="a start once TF and fix agree")
        ros.wait_for(lambda: part(found, "frames").message.startswith("TF and fix agree"))
        planning.wait_phase(Phase.TRAVELLING)
        tf.move = shifted
        # While the robot drives, its TF and fixes are not of the same moment: 29.9 m will do.
        planning.wait(lambda status: status.phase is Phase.PAUSED and "m north of" in status.reason, "a hold")
        assert world.goal is None
        tf.move = PlaneMove()
        planning.wait_phase(Phase.TRAVELLING)

        counts.publish(counts_to_message([CountRecord(START_S, 5.0, 5.0, 0.0, 9, 10.0, 10.0)], "odom"))
        ros.wait_for(
            lambda: "in frame 'odom' instead of 'map'" in part(found, "guard").values["counts_frame"],
            message="the warning of counts in another frame",
        )


def test_a_robot_with_another_datum_arrives_at_the_right_places(ros, tmp_path):
    """Its navigation has an origin 200 m away, and its x axis points 40 degrees to the north of east."""
    move = PlaneMove(math.radians(-40.0), (150.0, -130.0))
    goals = []

    def take(message):
        x, y = message.pose.position.x, message.pose.position.y
        goals.append((message.header.frame_id, x, y))
        world.goal = move.inverse.place((x, y))

    poses = ros.collect(PoseWithCovarianceStamped, "robot_pose", DEFAULT)
    world = World(ros, rate=20.0)
    world.place = (3.0, 3.0)
    with world:
        ros.node.create_subscription(PoseStamped, "goal_pose", take, 10)
        with Localisation(ros, world, move, "nav_map"):
            planning = Planning(
                ros, tmp_path, navigator="goal_pose", graph="free", autostart=True, exit_when_finished=True,
                hours=0.15, navigation_frame="nav_map", navigation_datum=datum_text(FRAME, move),
            )  # fmt: skip
            planning.wait(lambda status: status.phase is Phase.COUNTING, "the first count")
            assert planning.process.wait() == 0
            assert planning.status.samples >= 2
            assert {frame for frame, _, _ in goals} == {"nav_map"}
            assert all(0 <= x <= 40 and 0 <= y <= 30 for x, y in world.counted if (x, y) != (3.0, 3.0))
            pose = poses[-1]
            assert pose.header.frame_id == "map"
            place = (pose.pose.pose.position.x, pose.pose.pose.position.y)
            assert math.dist(place, world.place) < 2.0 * world.rate * 0.1
            assert abs(pose.pose.pose.orientation.w) == pytest.approx(1.0, abs=1e-3)


def test_a_map_of_the_navigation_with_another_datum_is_named_and_can_be_used(ros, tmp_path):
    """Nodes of the map lie 150 m away, and the map names its datum."""
    latitude, longitude = FRAME.to_geographic([(-150.0, 30.0)])[0].tolist()
    document = dict(make_map(PlaneMove(0.0, (150.0, -30.0))).document)
    document["meta"] = {"datum_latitude": latitude, "datum_longitude": longitude}
    world = World(ros, rate=20.0, navigations_map=json.dumps(document))  # fast ones end on the way
    with world, VirtualNavigation(ros, world) as navigation:
        planning = Planning(ros, tmp_path, autostart=True, exit_when_finished=True, navigation_datum="map")
        assert planning.process.wait() == 0
        assert planning.status.samples >= 2
        assert set(navigation.ends) == {"succeeded"}
