# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the planner takes from the messages of the mapper and of the navigation."""

import copy
import json
import math
import threading
from datetime import datetime
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
pytest.importorskip("tf2_msgs")
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from test_planner import Planning
from tf2_msgs.msg import TFMessage
from virtual_navigation import FRAME, START_S, VirtualNavigation, World

from msg_adapters import Model, counts_to_message, diagnostics_from_message, model_to_message, to_time
from soilmoist_ros.exploration import Phase, RobotMotion, Stop, TravelGraph, make_topological_map
from soilmoist_ros.exploration.control.field_access import AccessRules, CurrentAccess
from soilmoist_ros.exploration.guard.robot_frames import (
    FIELD,
    MAP,
    FrameSettings,
    RobotFrames,
    datum_text,
    yaw_rotation,
)
from soilmoist_ros.exploration.guard.watch import Doing, Watch
from soilmoist_ros.foundation import Level, LocalFrame, PlaneMove
from soilmoist_ros.mapping import Change, Changing, Drift, Field, TimedSamples, estimate_variogram
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.nodes.planner_inputs import PlannerInputs
from soilmoist_ros.nodes.topics import DEFAULT, RECORDS, TF, TF_STATIC
from soilmoist_ros.sensing.records import CountRecord

SAMPLES = as_samples([(2.0, 2.0), (10.0, 5.0), (18.0, 18.0)], [50, 60, 40], [10.0, 10.0, 10.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=20.0)


@pytest.mark.parametrize("drift", [None, Drift(0.9, False, (0.0, 90.0), (-0.1, 0.0), ((0.02, 0.0),))])
def test_the_drift_of_a_model_reaches_the_control(drift):
    node, control = MagicMock(), MagicMock()
    PlannerInputs(node, control, MagicMock(), map_topic="")
    receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
    times_s = np.array([0.0, 40.0, 80.0])
    changing = None if drift is None else Changing(TimedSamples(SAMPLES, times_s), Change(drift), 90.0)
    receive["model"](model_to_message(Model(FIT, 90.0, 2.0, changing)))
    fit, stamp_s, name, cell_m, found = control.fit.call_args.args
    assert (fit.variogram, stamp_s, name, cell_m) == (FIT.variogram, 90.0, "", 2.0)
    assert (None if found is None else found.change.drift) == drift


def test_messages_that_cannot_be_read_are_named_and_do_no_harm():
    node, control = MagicMock(), MagicMock()
    PlannerInputs(node, control, MagicMock(), map_topic="")
    receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
    for topic, message in (("samples", PointCloud2()), ("model", String(data="{")), ("counts", PointCloud2())):
        receive[topic](message)
        receive[topic](message)
    said = [call.args[0].partition(":")[0] for call in node.get_logger().error.call_args_list]
    assert said == ["samples cannot be used", "model cannot be used", "counts cannot be used"], "once each"
    assert not control.samples.called
    assert not control.fit.called


MEADOW = Field("meadow", LocalFrame(53.0, 0.0), np.array([[0, 0], [60, 0], [60, 40], [0, 40]], float), cell_m=4.0)
ROW = TravelGraph.from_edges([Stop("a", 5, 5), Stop("b", 50, 5)], [("a", "b"), ("b", "a")])


class MapOfTheNavigation:
    """The planner's inputs, of which a test publishes the map of a navigation that chooses the way itself."""

    def __init__(self, datum):
        self._access = CurrentAccess(MEADOW, RobotMotion(), AccessRules(), lambda: "", lambda access: None)
        self.watch, self._now_s = Watch(), 0.0
        robot = RobotFrames(MEADOW, FrameSettings(datum=datum))
        frames = SimpleNamespace(robot=robot, tick=lambda: robot.fault)
        node, control = MagicMock(), MagicMock(watch=self.watch, takes_graph=True)
        control.use_graph.side_effect = self._access.use_graph
        self._inputs = PlannerInputs(node, control, frames, "topological_map_2", by_name=True)
        receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
        self._receive = receive["topological_map_2"]

    def causes(self, document):
        self._receive(SimpleNamespace(data=json.dumps(document)))
        for _ in range(60):
            self._now_s += 1.0
            self._inputs.tick()
            self.watch.check(self._now_s, Doing())
        return {str(cause) for cause in self.watch.on}

    @property
    def xy(self):
        return self._access.access.travel.graph.xy.tolist()


def document(latitude=53.0):
    found = copy.deepcopy(make_topological_map(ROW, "row", datetime(2026, 1, 1)).document)
    found["meta"] |= {"datum_latitude": latitude, "datum_longitude": 0.0}
    return found


def elsewhere():
    """A map of another datum, of which the nodes lie in the field."""
    found = document(53.0009)
    for entry in found["nodes"]:
        entry["node"]["pose"]["position"]["y"] -= 500.0
    return found


def in_another_frame():
    found = document()
    found["transformation"]["parent"] = "odom"
    for entry in found["nodes"]:
        entry["node"].pop("parent_frame")
    return found


def broken():
    found = document()
    found["nodes"][0]["node"]["edges"][0]["node"] = "z"
    return found


@pytest.mark.parametrize(
    ("datum", "wrong", "causes"),
    [
        (FIELD, elsewhere, {"frame_mismatch", "map_changed"}),
        (MAP, elsewhere, {"frame_mismatch", "map_changed"}),
        (FIELD, in_another_frame, {"frame_mismatch"}),
        (FIELD, broken, {"map_changed"}),
    ],
)
def test_a_map_that_cannot_be_used_holds_the_robot_until_the_right_one_is_back(datum, wrong, causes):
    navigation = MapOfTheNavigation(datum)
    assert navigation.causes(document()) == set()
    for _ in range(2):
        assert navigation.causes(wrong()) == causes
        assert navigation.causes(document()) == set()
    longer = document()
    longer["nodes"][1]["node"]["pose"]["position"]["x"] = 55.0
    assert navigation.causes(longer) == set()
    assert navigation.xy == [[5, 5], [55, 5]]


# The planner's frames (planner_frames.py) with real nodes: shifted navigations, other datums, TF that agrees ----

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
            return "TF places the robot 30.0 m from its fix (0.0 m east, 30.0 m north" in answer.message

        ros.wait_for(refusal, message="the refusal of a start")
        frames = ros.wait_for(lambda: (last := part(found, "frames")) and last.level is Level.ERROR and last)
        assert "30.0 m north; limit 2.0 m" in frames.message
        assert "or set navigation_datum: 53.26" in frames.message

        tf.move = PlaneMove()
        ros.wait_for(lambda: planning.call("start").success, message="a start once TF and fix agree")
        ros.wait_for(lambda: part(found, "frames").message.startswith("TF and fix agree"))
        planning.wait_phase(Phase.TRAVELLING)
        tf.move = shifted
        # While the robot drives, its TF and fixes are not of the same moment: 29.9 m will do.
        planning.wait(lambda status: status.phase is Phase.PAUSED and "m from its fix" in status.reason, "a hold")
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
