# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A small world for tests of the planner: a clock, a robot, fixes and counts, a mapper, and the navigation.

The navigation serves the real action, with the quirks of the robot's server.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import Counter
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
from geometry_msgs.msg import Point
from nav2_msgs.action import ComputeAndTrackRoute, FollowPath, NavigateToPose
from nav2_msgs.msg import Route, RouteEdge
from nav_msgs.msg import Path
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix, NavSatStatus, PointCloud2
from std_msgs.msg import String
from topological_navigation_msgs.action import GotoNode

from msg_adapters import Model, counts_to_message, model_to_message, pose_stamped, samples_to_message, to_time
from soilmoist_ros.exploration import Stop, TravelGraph, make_topological_map
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import Variogram, VariogramFit
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.nodes.topics import CLOCK, LATCHED, RECORDS, SENSOR
from soilmoist_ros.sensing.records import CountRecord

FRAME = LocalFrame(53.268, -0.5245)
START_S = datetime(2026, 6, 1, 6, tzinfo=UTC).timestamp()
FIELD = """
name: test field
datum: {latitude_deg: 53.268, longitude_deg: -0.5245}
polygon: [[0, 0], [40, 0], [40, 30], [0, 30]]
cell_m: 2
"""
STOPS = [Stop(f"n{x}{y}", 5.0 + 10 * x, 5.0 + 10 * y) for x in range(4) for y in range(3)]
SHED = Stop("shed", -10.0, 5.0)
CADENCE_S, SPEED_MPS = 10.0, 1.0


def make_map(without=()):
    """A lattice in the field, with an edge to a shed outside.

    :param without: two nodes that no edge connects
    """
    ends = [(a.name, b.name) for a in STOPS for b in STOPS if math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) == 10]
    ends += [("shed", "n00"), ("n00", "shed")]
    ends = [edge for edge in ends if set(edge) != set(without)]
    return make_topological_map(TravelGraph.from_edges([*STOPS, SHED], ends), "test", datetime(2026, 1, 1))


class World:
    """Context manager of time, the robot, and messages of the sensors and the mapper.

    :param ros: the ROS system of the test
    :param rate: simulated time per real time
    """

    def __init__(self, ros, rate=45.0, namespace="", clock=True, mapper=True):
        self.rate, self.mapper = rate, mapper
        self.now_s, self.place, self.goal = START_S, (-10.0, 5.0), None
        self.stamped_ahead_s = 0.0
        self.counted = Counter()
        self.exposed = Counter()
        self.node = Node("world", context=ros.context, namespace=namespace)
        self.clock = self.node.create_publisher(Clock, "/clock", CLOCK) if clock else None
        self.fixes = self.node.create_publisher(NavSatFix, "fix", SENSOR)
        self.counts = self.node.create_publisher(PointCloud2, "counts", RECORDS)
        self.samples = self.node.create_publisher(PointCloud2, "samples", LATCHED)
        self.model = self.node.create_publisher(String, "model", LATCHED)
        self.maps = self.node.create_publisher(String, "/topological_map_2", LATCHED)
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)

    def __enter__(self):
        self.maps.publish(String(data=make_map().to_json()))
        self.thread.start()
        return self

    def __exit__(self, *exception):
        self.running = False
        self.thread.join(5)
        self.node.destroy_node()

    def run(self):
        next_fix_s, next_record_s, last = self.now_s, self.now_s + CADENCE_S, time.monotonic()
        while self.running:
            time.sleep(0.015)
            step_s, last = min(0.05, time.monotonic() - last) * self.rate, time.monotonic()
            self.now_s += step_s
            self.drive(step_s * SPEED_MPS)
            if self.clock is not None:
                self.clock.publish(Clock(clock=to_time(self.now_s)))
            if self.now_s >= next_fix_s:
                next_fix_s = self.now_s + 1.0
                self.publish_fix()
            if self.now_s >= next_record_s:
                next_record_s += CADENCE_S
                self.publish_record()

    def drive(self, step_m):
        goal = self.goal
        if goal is None:
            return
        left_m = math.dist(self.place, goal)
        share = 1.0 if left_m <= step_m else step_m / left_m
        self.place = tuple(a + share * (b - a) for a, b in zip(self.place, goal, strict=True))
        if share == 1.0 and self.goal is goal:
            self.goal = None

    def publish_fix(self):
        fix = NavSatFix()
        fix.status.status = NavSatStatus.STATUS_FIX
        fix.header.stamp = to_time(self.now_s)
        fix.latitude, fix.longitude = (float(value) for value in FRAME.to_geographic([self.place])[0])
        self.fixes.publish(fix)

    def publish_record(self):
        x_m, y_m = self.place
        raw = round(CADENCE_S * (4 + math.sin(x_m / 7)))
        record = CountRecord(
            stamp_s=self.now_s + self.stamped_ahead_s, x_m=x_m, y_m=y_m, z_m=0.0, raw_counts=raw,
            exposure_s=CADENCE_S, effective_exposure_s=CADENCE_S, f_pressure=1.0, f_humidity=1.0, f_intensity=1.0,
        )  # fmt: skip
        self.counts.publish(counts_to_message([record]))
        self.counted[self.place] += raw
        self.exposed[self.place] += CADENCE_S
        if self.mapper:
            self.publish_map()

    def publish_map(self):
        samples = as_samples(list(self.counted), list(self.counted.values()), list(self.exposed.values()))
        nothing = np.empty(0)
        fit = VariogramFit(
            Variogram("matern32", 0.0, 10.0, 0.5), "reml", samples.mean_rate_cps, len(samples), 0.0, None,
            (0.0, 0.0, 0.0), True, nothing, nothing, nothing, nothing,
        )  # fmt: skip
        self.samples.publish(samples_to_message(samples, self.now_s))
        self.model.publish(model_to_message(Model(fit, self.now_s, 2.0)))


class VirtualNavigation:
    """Context manager of the action ``topological_navigation``. Its faults can change at any time:

    * ``cancels``: ``aborts`` (as the robot's does: looks rejected, ends aborted) or ``properly``
    * ``lies``: reports success without moving; ``denies``: moves, but the result says no success
    * ``rejects``: accepts no goal; ``accepts_after_s``: takes its time to accept one
    * ``blocked``: names of stops where it aborts
    """

    kind, name = GotoNode, "topological_navigation"

    def __init__(self, ros, world, name="", namespace=""):
        self.world, name = world, name or self.name
        self.cancels, self.lies, self.denies, self.rejects, self.blocked = "aborts", False, False, False, set()
        self.goals, self.ends, self.most_at_once = [], [], 0
        self.accepts_after_s, self.asked = 0.0, threading.Event()
        self._running, self._stopped, self._alive, self._spinning = 0, set(), True, True
        self.places = {stop.name: (stop.x_m, stop.y_m) for stop in (*STOPS, SHED)}
        self.node = Node("navigation", context=ros.context, namespace=namespace)
        self.feedback = self.node.create_publisher(self.kind.Feedback, f"{name}/feedback", SENSOR)
        self.server = ActionServer(
            self.node, self.kind, name, self.execute, callback_group=ReentrantCallbackGroup(),
            goal_callback=self.on_goal,
            cancel_callback=self.on_cancel,
        )  # fmt: skip
        self.executor = MultiThreadedExecutor(4, context=ros.context)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.spin, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *exception):
        self._alive = False
        deadline = time.monotonic() + 5
        while self._spinning and self._running and time.monotonic() < deadline:
            time.sleep(0.01)
        self.die()

    def die(self):
        spinning, self._spinning = self._spinning, False
        if spinning:
            self.thread.join(5)
        self._alive = False  # from now on nobody answers for a goal that ends by this
        if spinning:
            self.executor.shutdown(timeout_sec=5)
            self.server.destroy()
            self.node.destroy_node()

    def spin(self):
        while self._spinning:
            with contextlib.suppress(Exception):  # the client of an answer may be gone
                self.executor.spin_once(timeout_sec=0.05)

    def on_goal(self, goal):
        self.asked.set()
        time.sleep(self.accepts_after_s)
        return GoalResponse.REJECT if self.rejects else GoalResponse.ACCEPT

    def on_cancel(self, handle):
        self._stopped.add(bytes(handle.goal_id.uuid))
        return CancelResponse.ACCEPT if self.cancels == "properly" else CancelResponse.REJECT

    def execute(self, handle):
        target, identity = self.target(handle), bytes(handle.goal_id.uuid)
        self.goals.append(target)
        self._running += 1
        self.most_at_once = max(self.most_at_once, self._running)
        try:
            end = self.drive(target, identity)
        finally:
            self._running -= 1
        self.ends.append(end)
        if end == "canceled" and self.cancels == "properly":
            handle.canceled()
        elif end == "succeeded":
            handle.succeed()
        elif self._alive:
            handle.abort()
        return self.result(end == "succeeded" and not self.denies)

    def target(self, handle):
        return handle.request.target

    def result(self, success):
        return GotoNode.Result(success=success)

    def feed_back(self, target):
        self.feedback.publish(GotoNode.Feedback(route=target))

    def drive(self, target, identity):
        if target not in self.places or target in self.blocked:
            return "aborted"
        self.feed_back(target)
        if self.lies:
            return "succeeded"
        self.world.goal = goal = self.places[target]
        while self.world.goal is goal and self._alive:
            if identity in self._stopped:
                self.world.goal = None
                return "canceled"
            time.sleep(0.005)
        return "succeeded" if self._alive else "gone"


class Nav2(VirtualNavigation):
    """Context manager of the action ``navigate_to_pose``: goals are places, a blocked one gives an error code."""

    kind, name = NavigateToPose, "navigate_to_pose"

    def __init__(self, ros, world, name="", namespace=""):
        super().__init__(ros, world, name, namespace)
        self.headings, self.error_code, self.handle = [], 208, None

    def target(self, handle):
        pose = handle.request.pose.pose
        self.handle = handle
        place = round(pose.position.x, 6), round(pose.position.y, 6)
        self.places[place] = place
        self.headings.append(2 * math.atan2(pose.orientation.z, pose.orientation.w))
        return place

    def result(self, success):
        return NavigateToPose.Result(error_code=0 if success else self.error_code, error_msg="a test")

    def feed_back(self, target):
        self.handle.publish_feedback(NavigateToPose.Feedback(distance_remaining=7.5, number_of_recoveries=2))


class RouteServer(VirtualNavigation):
    """Context manager of Nav2's controller (``follow_path``) and Route Server (``compute_and_track_route``).

    The Route Server drives nobody: it announces a path through ``via`` (of the stop), with edges between them, and
    once more when ``via`` is replaced. With an ``error_code`` it aborts instead.
    """

    kind, name = FollowPath, "follow_path"

    def __init__(self, ros, world, via=()):
        super().__init__(ros, world)
        self.cancels, self.via, self.error_code, self.frame, self.tracked = "properly", via, 0, "map", []
        self.routes = ActionServer(
            self.node, ComputeAndTrackRoute, "compute_and_track_route", self.track,
            callback_group=ReentrantCallbackGroup(), cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )  # fmt: skip

    def track(self, handle):
        result, goal, told = ComputeAndTrackRoute.Result(error_code=self.error_code), handle.request.goal, None
        assert handle.request.use_poses
        stop = goal.pose.position.x, goal.pose.position.y
        while self._alive and not self.error_code:
            if handle.is_cancel_requested:
                handle.canceled()
                self.tracked.append("canceled")
                return result
            if told is not self.via:
                told = self.via
                via = told(stop) if callable(told) else told
                handle.publish_feedback(self.announcement([*via, stop]))
            if math.dist(self.world.place, stop) < 0.5:
                handle.succeed()
                self.tracked.append("succeeded")
                return result
            time.sleep(0.01)
        if self._alive:
            handle.abort()
        return result

    def announcement(self, nodes):
        edges = [
            RouteEdge(edgeid=number, start=Point(x=a[0], y=a[1]), end=Point(x=b[0], y=b[1]))
            for number, (a, b) in enumerate(pairwise(nodes))
        ]
        path = Path(poses=[pose_stamped(*place, 0.0, self.frame) for place in nodes])
        path.header.frame_id = self.frame
        return ComputeAndTrackRoute.Feedback(next_node_id=7, route=Route(edges=edges), path=path, rerouted=True)

    def target(self, handle):
        self.handle = handle
        return [(pose.pose.position.x, pose.pose.position.y) for pose in handle.request.path.poses]

    def result(self, success):
        return FollowPath.Result()

    def drive(self, target, identity):
        """Drive past the places, until the next path comes; the robot is there within centimetres."""
        number = len(self.goals)
        self.handle.publish_feedback(FollowPath.Feedback(distance_to_goal=12.5))
        for place in [*target[1:-1:20], *target[-3:]]:
            self.world.goal = goal = place
            while self.world.goal is goal and self._alive:
                if identity in self._stopped:
                    self.world.goal = None
                    return "canceled"
                if len(self.goals) > number:
                    break
                time.sleep(0.005)
            if len(self.goals) > number:
                return "aborted"
        return "succeeded" if self._alive else "gone"
