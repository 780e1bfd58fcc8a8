# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The navigator ``GotoNode`` against the topological navigation of LCAS, where it is installed.

Nav2, its controller and the localisation are stand-ins. test_navigators.py has the same with a stand-in server.
"""

import contextlib
import importlib.util
import json
import math
import sys
import threading
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
if importlib.util.find_spec("topological_navigation") is None:
    pytest.skip("the topological navigation of LCAS is not installed", allow_module_level=True)
from nav2_msgs.action import NavigateThroughPoses
from rclpy.node import Node
from std_msgs.msg import String
from test_navigators import Driver
from test_planner import Planning
from topological_navigation_msgs.action import GotoNode
from topological_navigation_msgs.msg import ClosestEdges
from virtual_navigation import SPEED_MPS, STOPS, Nav2, World, make_map

from soilmoist_ros.exploration import GoalClient, RobotTrack, Way
from soilmoist_ros.exploration.navigation.navigator import Outcome
from soilmoist_ros.nodes.navigators import GotoNodeNavigator
from soilmoist_ros.nodes.topics import LATCHED

# rclpy warns when a server of the test disappears during an answer.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]

FAR, OTHER = STOPS[-1], STOPS[0]
NO_CORNERS = np.empty((0, 2))


class Localisation:
    """Publishes the node next to the robot."""

    def __init__(self, ros, world):
        self.world, self.running = world, True
        self.node = Node("localisation", context=ros.context)
        self.closest = self.node.create_publisher(String, "closest_node", LATCHED)
        self.current = self.node.create_publisher(String, "current_node", LATCHED)
        edges = self.node.create_publisher(ClosestEdges, "closest_edges", LATCHED)
        ids = [edge["edge_id"] for edge in json.loads(make_map().to_json())["nodes"][0]["node"]["edges"]]
        # far from any edge: routes begin at the closest node
        edges.publish(ClosestEdges(edge_ids=[ids[0], ids[-1]], distances=[5.0, 5.0]))
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        shown = None
        while self.running:
            place = self.world.place
            near = min(STOPS, key=lambda stop: math.dist(place, (stop.x_m, stop.y_m)))
            at = near.name if math.dist(place, (near.x_m, near.y_m)) < 0.7 else "none"
            if (near.name, at) != shown:
                shown = near.name, at
                self.closest.publish(String(data=near.name))
                self.current.publish(String(data=at))
            time.sleep(0.05)

    def close(self):
        self.running = False
        self.thread.join(5)
        self.node.destroy_node()


class ThroughPoses(Nav2):
    """The action ``navigate_through_poses``, by which releases drive routes; some can no other."""

    kind, name = NavigateThroughPoses, "navigate_through_poses"

    def target(self, handle):
        self.handle = handle
        places = [one.pose.position for one in handle.request.poses]
        return tuple((round(place.x, 6), round(place.y, 6)) for place in places)

    def result(self, success):
        return NavigateThroughPoses.Result()

    def feed_back(self, target):
        self.handle.publish_feedback(NavigateThroughPoses.Feedback(distance_remaining=7.5))

    def drive(self, target, identity):
        for place in target:
            self.places[place] = place
            if (end := super().drive(place, identity)) != "succeeded":
                return end
        return "succeeded"


@contextlib.contextmanager
def navigation(ros, folder, place, **world):
    """The server as a process, with its surroundings; yields the world and Nav2."""
    script = folder / "navigation"
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m topological_navigation.scripts.navigation2 "$@"\n')
    script.chmod(0o755)
    controller = Node("controller_server", context=ros.context)  # has the services of parameters
    ros._executor.add_node(controller)
    with World(ros, **world) as world, ThroughPoses(ros, world) as nav2:
        world.place, nav2.cancels = place, "properly"
        localisation = Localisation(ros, world)
        ros.start(str(script), params={"use_nav2_follow_route": True})
        yield world, nav2
        localisation.close()
    controller.destroy_node()


@pytest.fixture
def driver(ros, tmp_path):
    """A navigator of such a server."""

    def make(node, report):
        client, track = GoalClient(2.0), RobotTrack(SPEED_MPS, 2.0)
        return GotoNodeNavigator(node, "topological_navigation", GotoNode, client, track, 2.0, report)

    with navigation(ros, tmp_path, OTHER.xy, rate=10.0, clock=False, mapper=False) as (world, nav2):
        made = Driver(ros, world, make)
        made.nav2 = nav2
        ros.wait_for(lambda: not made.navigator.waiting_for, message="the topological navigation")
        yield made
        made.close()


def test_a_mission_of_some_stops_is_driven_to_its_end(ros, tmp_path):
    with navigation(ros, tmp_path, OTHER.xy, rate=10.0) as (world, nav2):
        planning = Planning(ros, tmp_path, autostart=True, exit_when_finished=True, home=OTHER.name)
        planning.wait_end()
        assert planning.status.samples >= 3
        assert "home" in planning.status.reason
        assert world.place == pytest.approx(OTHER.xy, abs=0.1)
        assert nav2.most_at_once == 1


def test_it_arrives_and_a_robot_at_its_node_gets_no_goal(ros, driver):
    world = driver.world
    corner = next(stop for stop in STOPS if (stop.x_m, stop.y_m) == (OTHER.x_m, FAR.y_m))
    driver.go(1, FAR, Way(NO_CORNERS, (corner, FAR)))
    assert driver.end_of(1).outcome is Outcome.SUCCEEDED, driver.end_of(1).reason
    assert world.place == pytest.approx((FAR.x_m, FAR.y_m), abs=0.1)
    assert corner.xy in [place for goal in driver.nav2.goals for place in goal]
    track = driver.navigator._track
    ros.wait_for(lambda: track.standing_at(FAR, 2.0), message="standstill")
    driver.go(2, FAR, Way(NO_CORNERS))
    assert driver.end_of(2).reason == f"already at {FAR.name}"


def test_a_cancelled_goal_stops_the_robot(ros, driver):
    driver.world.rate = 3.0
    driver.go(1, FAR, Way(NO_CORNERS))
    ros.wait_for(lambda: driver.world.goal is not None, message="motion")
    driver.cancel(1)
    assert driver.end_of(1).outcome is Outcome.CANCELED
    ros.wait_for(lambda: driver.world.goal is None, message="a robot without a goal")


def test_why_the_server_aborts_a_goal_at_the_nearest_node(ros, driver):
    driver.world.place = near = (FAR.x_m - 4.0, FAR.y_m)
    closest = ros.collect(String, "closest_node", LATCHED)
    ros.wait_for(lambda: closest and closest[-1].data == FAR.name, message="the localisation")
    driver.go(1, FAR, Way(np.array([near, (FAR.x_m, FAR.y_m)]), (FAR,)))
    end = driver.end_of(1)
    assert end.outcome is Outcome.SUCCEEDED or "nearest to this node already" in end.reason
