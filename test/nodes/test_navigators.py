# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The navigators (action_navigator.py, navigators.py) and a faulty robot."""

import math
import queue
import threading

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
pytest.importorskip("nav2_msgs")
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import ComputeAndTrackRoute, FollowPath, NavigateToPose
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from topological_navigation_msgs.action import GotoNode
from virtual_navigation import SPEED_MPS, STOPS, Nav2, RouteServer, VirtualNavigation, World

from soilmoist_ros.exploration import GoalClient, PoseClient, RobotTrack, Stop, Way
from soilmoist_ros.exploration.navigation.navigator import Outcome
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.action_navigator import action_class
from soilmoist_ros.nodes.navigators import GoalPoseNavigator, GotoNodeNavigator, NavigateToPoseNavigator
from soilmoist_ros.nodes.route_navigator import FollowRouteNavigator

# rclpy warns when a server of the test disappears during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

FAR, OTHER = STOPS[-1], STOPS[0]
START = (-10.0, 5.0)
WAY = Way(np.empty((0, 2)))


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A busy computer answers late."""
    for name, limit_s in (("START_S", 20.0), ("ANSWER_S", 60.0), ("LOST_S", 20.0), ("POSITION_S", 20.0)):
        monkeypatch.setattr(f"soilmoist_ros.exploration.navigation.goal_client.{name}", limit_s)


class Driver:
    """Calls a navigator as the planner does, from the thread that has its answers, and keeps the reports."""

    def __init__(self, ros, world, make):
        self.ros, self.world, self.ends = ros, world, {}
        self.node = Node("driver", context=ros.context)
        self.navigator = make(self.node, self.report)
        self.todo = queue.SimpleQueue()
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def report(self, ended):
        assert ended.goal_id not in self.ends, "an end is reported once"
        self.ends[ended.goal_id] = ended

    def run(self):
        executor = SingleThreadedExecutor(context=self.ros.context)
        executor.add_node(self.node)
        while self.running:
            executor.spin_once(timeout_sec=0.02)
            while not self.todo.empty():
                what, done = self.todo.get()
                what()
                done.set()
            now_s, place = self.world.now_s, self.world.place
            self.navigator.tick(now_s)
            self.navigator.moved(place, now_s, 0.02)
        executor.shutdown(timeout_sec=2)

    def do(self, what):
        done = threading.Event()
        self.todo.put((what, done))
        self.ros.wait_for(done.is_set, message="the thread of the navigator")

    def go(self, *given):
        self.do(lambda: self.navigator.go(*given))

    def cancel(self, goal_id):
        self.do(lambda: self.navigator.cancel(goal_id))

    def stop(self):
        self.running = False
        self.thread.join(5)

    def close(self):
        self.stop()
        for client in [one for one in self.node.waitables if isinstance(one, ActionClient)]:
            client.destroy()
        self.node.destroy_node()

    def end_of(self, goal_id):
        return self.ros.wait_for(lambda: self.ends.get(goal_id), message=f"the end of goal {goal_id}")


@pytest.fixture
def world(ros):
    with World(ros, rate=30.0, clock=False, mapper=False) as world:
        yield world


@pytest.fixture
def drive(ros, world):
    """Starts navigators of a class, by default one of nodes."""
    drivers = []

    def start(navigator=GotoNodeNavigator, name="topological_navigation", kind=GotoNode, there_m=2.0):
        def make(node, report):
            return navigator(node, name, kind, GoalClient(2.0), RobotTrack(SPEED_MPS, 2.0), there_m, report)

        drivers.append(Driver(ros, world, make))
        return drivers[-1]

    yield start
    for driver in drivers:
        driver.close()


@pytest.fixture
def navigation(ros, world):
    with VirtualNavigation(ros, world) as navigation:
        yield navigation


def test_arrival_along_nodes(ros, world, navigation, drive):
    driver = drive()
    ros.wait_for(lambda: not driver.navigator.waiting_for)
    driver.go(1, FAR, Way(np.empty((0, 2)), (OTHER, FAR)))
    assert driver.end_of(1).outcome is Outcome.SUCCEEDED
    assert navigation.goals == [OTHER.name, FAR.name]
    assert world.place == (FAR.x_m, FAR.y_m)


QUIRKS = (
    ("lies", True, "reported as reached, but the robot is"), ("denies", True, "without success"),
    ("rejects", True, "rejected"), ("blocked", {FAR.name}, "aborted"),
)  # fmt: skip


def test_what_is_not_an_arrival(navigation, drive):
    driver = drive()
    for goal_id, (quirk, value, reason) in enumerate(QUIRKS, 1):
        setattr(navigation, quirk, value)
        driver.go(goal_id, FAR, WAY)
        assert driver.end_of(goal_id).outcome is Outcome.FAILED
        assert reason in driver.end_of(goal_id).reason
        setattr(navigation, quirk, type(value)())
        driver.go(10 + goal_id, OTHER, WAY)
        assert driver.end_of(10 + goal_id).outcome is Outcome.SUCCEEDED
    driver.go(20, Stop("nowhere", 0.0, 0.0), WAY)
    assert driver.end_of(20).outcome is Outcome.FAILED
    assert "is the stop on its map" in driver.end_of(20).reason


def test_cancelling_stops_the_robot_whatever_is_answered_and_a_second_goal_waits(ros, world, navigation, drive):
    world.rate = 5.0
    driver = drive()
    for number, cancels in enumerate(("aborts", "properly"), 1):
        navigation.cancels = cancels
        driver.go(number, FAR, WAY)
        ros.wait_for(lambda number=number: len(navigation.goals) == number and world.goal is not None)
        driver.cancel(number)
        assert driver.end_of(number).outcome is Outcome.CANCELED
        assert world.goal is None
    driver.go(3, FAR, WAY)
    ros.wait_for(lambda: world.goal is not None)
    driver.go(4, OTHER, WAY)
    assert driver.end_of(3).outcome is Outcome.CANCELED
    assert driver.end_of(4).outcome is Outcome.SUCCEEDED
    assert navigation.most_at_once == 1
    assert navigation.ends == ["canceled", "canceled", "canceled", "succeeded"]


def test_the_server_may_come_late_die_in_mid_goal_and_come_back(ros, world, drive):
    world.rate = 5.0
    driver = drive()
    driver.go(1, FAR, WAY)
    assert "topological_navigation" in driver.navigator.waiting_for
    with VirtualNavigation(ros, world) as first:
        ros.wait_for(lambda: world.goal is not None)
        first.die()
    assert driver.end_of(1).outcome is Outcome.FAILED
    world.rate = 30.0
    with VirtualNavigation(ros, world) as second:
        driver.go(2, OTHER, WAY)
        assert driver.end_of(2).outcome is Outcome.SUCCEEDED
        assert second.ends == ["succeeded"]


def test_no_goal_goes_to_two_navigations_of_one_name(ros, world, navigation, drive):
    driver = drive()
    with VirtualNavigation(ros, world) as second:
        ros.wait_for(lambda: "one navigation: 2 nodes" in driver.navigator.waiting_for)
        driver.do(lambda: driver.navigator.tick(world.now_s))
        driver.go(1, OTHER, WAY)
        asked_s = world.now_s
        ros.wait_for(lambda: world.now_s > asked_s + 10.0)
        assert not navigation.goals
        assert not second.goals
    assert driver.end_of(1).outcome is Outcome.SUCCEEDED
    assert len(navigation.goals) == 1


def test_another_action_of_the_same_navigation_drives_the_robot_too(ros, world, navigation, drive):
    handles = []

    def work(handle):
        handles.append(handle)
        ros.wait_for(lambda: len(handles) > 1)
        handle.succeed()
        return GotoNode.Result()

    policy = ActionServer(navigation.node, GotoNode, "topological_navigation/policy", work)
    client = ActionClient(ros.node, GotoNode, "topological_navigation/policy")
    driver = drive()
    ros.wait_for(client.server_is_ready)
    client.send_goal_async(GotoNode.Goal(target=FAR.name))
    ros.wait_for(lambda: "topological_navigation/policy" in driver.navigator.other_client)
    handles.append(None)
    ros.wait_for(lambda: not driver.navigator.other_client)
    client.destroy()
    policy.destroy()


def test_the_action_type_must_exist():
    assert action_class("topological_navigation_msgs/action/GotoNode", "target") is GotoNode
    for name, said in [
        ("topological_navigation_msgs/action/GotoNod", "has no action 'GotoNod'"),
        ("no_such_package/action/GotoNode", "another navigator"),
        ("GotoNode", "PACKAGE/action/NAME"),
        ("topological_navigation_msgs/action/GotoNode/1", "PACKAGE/action/NAME"),
    ]:
        with pytest.raises(InputError, match=said):
            action_class(name, "target")
    with pytest.raises(InputError, match="have no field 'pose'"):
        action_class("topological_navigation_msgs/action/GotoNode", "pose")


@pytest.fixture
def nav2(ros, world):
    with Nav2(ros, world) as navigation:
        yield navigation


def test_nav2_arrives_by_way_points_facing_along_the_way(ros, world, nav2, drive):
    driver = drive(NavigateToPoseNavigator, "navigate_to_pose", NavigateToPose, 0.5)
    ros.wait_for(lambda: not driver.navigator.waiting_for)
    assert math.isnan(driver.navigator.feedback_age_s)
    corner = (FAR.x_m, 5.0)
    driver.go(1, FAR, Way(np.array([world.place, corner, (FAR.x_m, FAR.y_m)])))
    assert driver.end_of(1).outcome is Outcome.SUCCEEDED
    assert world.place == (FAR.x_m, FAR.y_m)
    assert nav2.goals == [corner, (FAR.x_m, FAR.y_m)]
    assert nav2.headings == [0.0, pytest.approx(math.pi / 2)]
    assert nav2.most_at_once == 1

    nav2.blocked = {(OTHER.x_m, OTHER.y_m)}
    driver.go(2, OTHER, WAY)
    assert driver.end_of(2).outcome is Outcome.FAILED
    assert "no path leads to the stop (Nav2 error 208: a test)" in driver.end_of(2).reason

    world.rate, nav2.blocked, nav2.cancels, nav2.handle = 0.1, set(), "properly", None
    driver.go(3, OTHER, WAY)

    def heard():
        if nav2.handle is not None:  # feedback may be lost before its subscription is discovered
            nav2.feed_back(None)
        return driver.navigator.on_the_way

    ros.wait_for(heard, message="feedback")
    assert driver.navigator.on_the_way == "7.5 m to go, recoveries: 2"
    assert driver.navigator.feedback_age_s >= 0.0
    driver.cancel(3)
    assert driver.end_of(3).outcome is Outcome.CANCELED
    assert nav2.ends[-1] == "canceled"


@pytest.fixture
def routes(ros, world):
    with RouteServer(ros, world) as server:
        yield server


@pytest.fixture
def following(ros, world, routes):
    def make(node, report):
        track, named = RobotTrack(SPEED_MPS, 2.0), ("compute_and_track_route", ComputeAndTrackRoute)
        given = node, "follow_path", FollowPath, GoalClient(2.0), track, 0.5, report
        return FollowRouteNavigator(*given, routes=named, reach_m=2.0)

    driver = Driver(ros, world, make)
    ros.wait_for(lambda: not driver.navigator.waiting_for, message="both servers")
    driver.judged = []
    yield driver
    driver.close()


POND = (25.0, 15.0)


def test_an_announced_route_is_followed_only_while_it_is_allowed(ros, world, routes, following):
    def judge(path, nodes):
        following.judged.append((path.tolist(), nodes.tolist()))
        return "it enters no-go area 1" if POND in map(tuple, path.tolist()) else ""

    def go(goal_id, stop=FAR):
        way = Way(np.array([world.place, stop.xy]), judge=judge)
        routes.goals.clear()
        following.go(goal_id, stop, way)

    routes.via = ((5.0, 5.0), (35.0, 5.0))
    go(1)
    ros.wait_for(lambda: "edge 0 to node 7, 12.5 m to go" in following.navigator.on_the_way)
    assert following.end_of(1).outcome is Outcome.SUCCEEDED
    assert following.judged == [([[5.0, 5.0], [35.0, 5.0], [35.0, 25.0]], [[5, 5], [35, 5], [35, 5], [35, 25]])]
    assert routes.goals[0][0] == START, "the path begins where the robot is"
    assert world.place == FAR.xy

    routes.via = (FAR.xy, POND)
    go(2, OTHER)
    assert following.end_of(2).outcome is Outcome.FAILED
    assert "the route of the navigation is not allowed: it enters no-go area 1" in following.end_of(2).reason
    routes.via, routes.frame = (FAR.xy,), "odom"
    go(3, OTHER)
    assert "in the frame 'odom'" in following.end_of(3).reason
    routes.frame = "map"
    following.go(4, OTHER, Way(np.array([world.place, OTHER.xy]), judge=lambda path, nodes: "it has no places"))
    assert "it has no places" in following.end_of(4).reason
    routes.error_code = 405
    go(5, OTHER)
    assert "no route of its graph leads to the stop (Nav2 error 405)" in following.end_of(5).reason
    assert routes.goals == [], "the robot was given no path"
    assert world.place == FAR.xy


def test_a_new_route_replaces_the_path_and_stops_the_robot_if_it_is_not_allowed(ros, world, routes, following):
    world.rate, routes.via = 5.0, (START,)
    way = Way(
        np.array([world.place, FAR.xy]),
        judge=lambda path, nodes: "it enters no-go area 1" if POND in map(tuple, path.tolist()) else "",
    )
    following.go(1, FAR, way)
    ros.wait_for(lambda: world.goal is not None)
    routes.via = ((5.0, 5.0), (5.0, 25.0))
    ros.wait_for(lambda: len(routes.goals) == 2, message="the path of the new route")
    assert not following.ends, "the path before has ended, the goal has not"
    routes.via = ((5.0, 5.0), POND)
    assert following.end_of(1).outcome is Outcome.FAILED
    ros.wait_for(lambda: routes.ends == ["aborted", "canceled"] and routes.tracked == ["canceled"])
    assert world.goal is None
    routes.via = (START,)
    following.go(2, FAR, way)
    ros.wait_for(lambda: world.goal is not None, message="the next goal, as all before are over")
    following.cancel(2)
    assert following.end_of(2).outcome is Outcome.CANCELED
    assert routes.tracked == ["canceled", "canceled"]


@pytest.fixture
def posing(ros, world):
    poses = []

    def take(message):
        turn = message.pose.orientation
        poses.append((message.pose.position.x, message.pose.position.y, 2 * math.atan2(turn.z, turn.w)))
        world.goal = poses[-1][:2]

    ros.node.create_subscription(PoseStamped, "goal_pose", take, 10)
    client = PoseClient(2.0, 5.0, SPEED_MPS)
    driver = Driver(ros, world, lambda node, report: GoalPoseNavigator(node, "nav", client, report))
    ros.wait_for(lambda: not driver.navigator.waiting_for)
    driver.poses = poses
    yield driver
    driver.close()


def test_poses_arrive_when_the_robot_stands_there_and_are_cancelled_by_staying(ros, world, posing):
    corner = (FAR.x_m, 5.0)
    posing.go(1, FAR, Way(np.array([world.place, corner, (FAR.x_m, FAR.y_m)])))
    assert posing.end_of(1).outcome is Outcome.SUCCEEDED
    assert world.place == (FAR.x_m, FAR.y_m)
    assert posing.poses == [(*corner, 0.0), (FAR.x_m, FAR.y_m, pytest.approx(math.pi / 2))]
    world.rate = 10.0
    posing.go(2, OTHER, WAY)
    ros.wait_for(lambda: world.goal is not None and world.place != (FAR.x_m, FAR.y_m))
    posing.cancel(2)
    assert posing.end_of(2).outcome is Outcome.CANCELED
    assert posing.poses[-1][:2] != (OTHER.x_m, OTHER.y_m)
    assert world.goal is None


def test_an_action_of_the_navigation_stops_the_robot_instead_of_a_pose(ros, world, posing):
    asked = []

    def answer(request, response):
        asked.append(request)
        world.goal = None
        return response

    ros.node.create_service(CancelGoal, "nav/_action/cancel_goal", answer)
    ros.wait_for(lambda: "cancels the action" in posing.navigator.on_the_way)
    posing.do(lambda: posing.navigator.tick(world.now_s))  # which sees that action, too
    posing.go(1, FAR, WAY)
    ros.wait_for(lambda: world.goal is not None)
    posing.cancel(1)
    assert posing.end_of(1).outcome is Outcome.CANCELED
    assert len(posing.poses) == 1
    assert asked
    assert not any(asked[0].goal_info.goal_id.uuid)


def test_a_pose_of_somebody_else_is_left_alone(ros, world, posing):
    world.rate = 3.0
    posing.go(1, FAR, WAY)
    ros.wait_for(lambda: posing.poses)
    assert not posing.navigator.other_client, "its own pose comes back to it"
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.position.y = OTHER.x_m, OTHER.y_m
    ros.node.create_publisher(PoseStamped, "goal_pose", 10).publish(pose)
    assert posing.end_of(1).outcome is Outcome.SUPERSEDED
    posing.cancel(2)
    assert posing.end_of(2).outcome is Outcome.CANCELED
    assert len(posing.poses) == 2
    world.rate = 30.0
    ros.wait_for(lambda: not posing.navigator.other_client, message="the robot stands")
    assert world.place == (OTHER.x_m, OTHER.y_m)


def test_a_recorder_is_no_navigation(ros, world):
    recorder = Node("recorder_2", context=ros.context)
    recorder.create_subscription(PoseStamped, "goal_pose", lambda _: None, 10)
    client = PoseClient(2.0, 5.0, SPEED_MPS)
    navigator = GoalPoseNavigator(ros.node, "nav", client, lambda _: None)
    ros.wait_for(lambda: "recorder_2 drive no robot" in navigator.waiting_for, message="the recorder")
    navigation = Node("toy", context=ros.context)
    navigation.create_subscription(PoseStamped, "goal_pose", lambda _: None, 10)
    ros.wait_for(lambda: not navigator.waiting_for, message="the navigation")
    recorder.destroy_node()
    navigation.destroy_node()
