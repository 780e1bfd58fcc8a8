# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigators: nodes of a topological map (GotoNode), Nav2 (NavigateToPose), plain poses (goal_pose), people.

Nav2's Route Server has a file of its own.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from threading import Lock
from typing import Any, Final

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.task import Future

from msg_adapters import FRAME, pose_stamped
from soilmoist_ros.exploration import (
    CancelAll,
    Cause,
    Ended,
    GoalClient,
    Navigator,
    PersonNavigator,
    PoseClient,
    PoseRequest,
    Response,
    RobotTrack,
    SendPose,
    Stop,
    Way,
    WayPoint,
    drivers,
    failure,
    progress,
    way_points,
)
from soilmoist_ros.foundation import InputError, foreign_text
from soilmoist_ros.nodes.action_navigator import ActionNavigator, action_class
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.planner_parameters import PERSON, failsafe_responses
from soilmoist_ros.nodes.route_navigator import FollowRouteNavigator
from soilmoist_ros.nodes.topics import DEFAULT, ros_now_s

GOTO_NODE: Final = "topological_navigation"
GOTO_NODE_TYPE: Final = "topological_navigation_msgs/action/GotoNode"
NAVIGATE_TO_POSE: Final = "navigate_to_pose"
NAVIGATE_TO_POSE_TYPE: Final = "nav2_msgs/action/NavigateToPose"
FOLLOW_ROUTE: Final = "compute_and_track_route"
FOLLOW_ROUTE_TYPE: Final = "nav2_msgs/action/ComputeAndTrackRoute"
FOLLOW_PATH: Final = "follow_path"
FOLLOW_PATH_TYPE: Final = "nav2_msgs/action/FollowPath"
TOPIC: Final = "goal_pose"
KEPT_POSES: Final = 100  # own poses that are recognised when they come back
POSE_OBSERVERS: Final = (
    "recorder*", "rosbag2*", "_ros2cli*", "rviz*", "rqt*", "foxglove*", "rosbridge*", "plotjuggler*",
)  # fmt: skip
"""Nodes that subscribe to poses but drive no robot, as patterns; all others pass for a navigation."""
SETTLE_S: Final = 5.0
"""Standstill that counts as arrival where the navigation gives no result [s]: five fixes of a usual receiver."""


class GotoNodeNavigator(ActionNavigator):
    """A client of ``GotoNode``. The server finds the route; some abort a goal where the robot stands already."""

    _is_nearest = False

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`; feedback comes at nodes only, so its age says nothing."""
        return math.nan

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self._is_nearest = 0 < len(way.corners) <= 2
        super().go(goal_id, stop, way)

    def goals(self, stop: Stop, way: Way) -> tuple[WayPoint, ...]:
        """The nodes that keep the server's own route inside the fence, and the stop."""
        return tuple(map(WayPoint, way.nodes)) or (WayPoint(stop),)

    def goal_message(self, point: WayPoint) -> Any:
        """Goal with the name of the node."""
        goal = self._kind.Goal()
        goal.target = str(point.stop.name)
        if hasattr(goal, "no_orientation"):
            goal.no_orientation = True  # the sensor has no heading
        return goal

    def heard(self, message: Any) -> str:
        """The node that the robot passes."""
        return foreign_text(str(getattr(message.feedback, "route", "")))

    def verdict(self, result: Any) -> tuple[bool, str]:
        """The flag of the result; it has no reason, so the last feedback is quoted."""
        why = "is the stop on its map, and the way free?"
        if self._is_nearest:
            why = "the robot is nearest to this node already; some servers need reconfigure_edges: false for that"
        last = f"; its last feedback was {self.on_the_way!r}" if self.on_the_way else ""
        return bool(getattr(result, "success", False)), f"{why}{last}"


class NavigateToPoseNavigator(ActionNavigator):
    """A client of ``NavigateToPose``.

    The result has no flag of success: its status says it. Older versions have no error code either.
    """

    def goal_message(self, point: WayPoint) -> Any:
        """Goal with the pose at this time: Nav2 transforms it by its stamp."""
        goal = self._kind.Goal()
        now_s = ros_now_s(self._node)
        goal.pose = pose_stamped(point.stop.x_m, point.stop.y_m, now_s, self._frame, point.heading_rad)
        return goal

    def heard(self, message: Any) -> str:
        """Distance that remains to the next way point, and recoveries."""
        content = message.feedback
        remaining_m = float(getattr(content, "distance_remaining", float("nan")))
        return progress(remaining_m, int(getattr(content, "number_of_recoveries", 0)))

    def verdict(self, result: Any) -> tuple[bool, str]:
        """The error code in words."""
        code, text = int(getattr(result, "error_code", 0)), foreign_text(str(getattr(result, "error_msg", "")))
        return code == 0, failure(code, text)


class GoalPoseNavigator:
    """Publishes ``geometry_msgs/PoseStamped`` on ``goal_pose``, as RViz does and Nav2 accepts.

    :param yields: whether no pose is sent while the robot may drive to that of another client
    """

    def __init__(
        self,
        node: Node,
        action: str,
        client: PoseClient,
        report: Callable[[Ended], None],
        frame: str = FRAME,
        yields: bool = True,
    ) -> None:
        self._node = node
        self._frame = frame
        self._client = client
        self._report = report
        self._lock = Lock()
        self._asked: Future | None = None
        self._yields = yields
        self._sent: deque[PoseStamped] = deque(maxlen=KEPT_POSES)
        self._poses = node.create_publisher(PoseStamped, TOPIC, DEFAULT)
        node.create_subscription(PoseStamped, TOPIC, self._on_pose, DEFAULT)
        self._cancels = node.create_client(CancelGoal, f"{action}/_action/cancel_goal")
        node.get_logger().warning(
            "goal_pose gives no answers. It can only stop the robot by a pose where the robot is, unless the "
            f"navigation has the action {action}. Use navigate_to_pose or goto_node on a real robot"
        )

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        own = self._node.get_name(), self._node.get_namespace()
        infos = self._node.get_subscriptions_info_by_topic(self._poses.topic_name)
        heard_by = [info.node_name for info in infos if (info.node_name, info.node_namespace) != own]
        if drivers(heard_by, POSE_OBSERVERS):
            return ""
        only = f"; {', '.join(sorted(heard_by))} drive no robot" if heard_by else ""
        return f"a navigation that subscribes to {self._poses.topic_name}{only}"

    @property
    def other_client(self) -> str:
        """See :class:`Navigator`."""
        with self._lock:
            other = self._client.other_client
        return f"another client drives the robot by a pose on {self._poses.topic_name}" if other else ""

    @property
    def on_the_way(self) -> str:
        """Ways to stop the robot; there is no feedback."""
        action = self._cancels.service_is_ready()
        return f"no feedback; a stop {'cancels the action' if action else 'is a pose where the robot is'}"

    @property
    def caution(self) -> str:
        """See :class:`Navigator`."""
        with self._lock:
            return self._client.caution

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`; there is no feedback."""
        return float("nan")

    @property
    def stop_unheard(self) -> bool:
        """See :class:`Navigator`; nobody answers a pose."""
        return self._asked is not None and not self._asked.done()

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.go(goal_id, way_points(way.corners, stop))
        self._do(requests)

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.cancel(goal_id)
        if caution := self.caution:
            self._node.get_logger().error(caution, throttle_duration_sec=5.0)
        self._do(requests)

    def moved(self, place: tuple[float, float], now_s: float, sd_m: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.moved(place, now_s, sd_m)
        self._do(requests)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.tick(self._cancels.service_is_ready(), now_s)
        self._do(requests)

    def _on_pose(self, pose: PoseStamped) -> None:
        """A pose that this node has not sent is somebody else's; each of its own comes back as it was."""
        with self._lock:
            requests = () if pose in self._sent else self._client.heard_other(self._yields)
        self._do(requests)

    def _do(self, requests: Iterable[PoseRequest]) -> None:
        for request in requests:
            match request:
                case SendPose():
                    now_s = ros_now_s(self._node)
                    place = (request.x_m, request.y_m)
                    pose = pose_stamped(*place, now_s, self._frame, request.heading_rad)
                    with self._lock:
                        self._sent.append(pose)
                    self._poses.publish(pose)
                case CancelAll():
                    self._asked = self._cancels.call_async(CancelGoal.Request())  # without an id: all goals
                case Ended():
                    self._report(request)


def make_navigator(
    node: Node, values: Parameters, may_count: Callable[[], bool], report: Callable[[Ended], None]
) -> Navigator:
    """The navigator of a planner; ``may_count`` as of :class:`PersonNavigator`."""
    text, number = values.text, values.number
    radius_m, speed_mps = number("arrival_radius_m"), number("speed_mps")
    frame = text("navigation_frame") or text("frame")
    response = failsafe_responses(values)[Cause.OTHER_CLIENT]
    yields = response not in (Response.IGNORE, Response.WARN)
    if text("navigator") == PERSON:
        return PersonNavigator(report, may_count)
    if text("navigator") == "goal_pose":
        poses = PoseClient(radius_m, SETTLE_S, speed_mps)
        return GoalPoseNavigator(node, text("action_name") or NAVIGATE_TO_POSE, poses, report, frame, yields)
    which = text("navigator")
    if which != "navigate_to_pose" and text("graph") == "free":
        raise InputError(f"{which} goes to nodes of a map, but graph is free", "set graph: topic, or a map file")
    default_name, default, field, make = _ACTIONS[which]
    kind = action_class(text("action_type") or default, field)
    name = text("action_name") or default_name
    track, client = RobotTrack(speed_mps, radius_m), GoalClient(radius_m)
    there_m = radius_m if which == "goto_node" else track.still_m
    if which == "follow_route":
        drives, reach_m = f"{name.removesuffix(FOLLOW_ROUTE)}{FOLLOW_PATH}", radius_m
        controller, given = action_class(FOLLOW_PATH_TYPE, "path"), (client, track, there_m, report, frame, yields)
        return FollowRouteNavigator(node, drives, controller, *given, routes=(name, kind), reach_m=reach_m)
    return make(node, name, kind, client, track, there_m, report, frame, yields)


_ACTIONS: Final[dict[str, tuple[str, str, str, type[ActionNavigator]]]] = {
    "goto_node": (GOTO_NODE, GOTO_NODE_TYPE, "target", GotoNodeNavigator),
    "navigate_to_pose": (NAVIGATE_TO_POSE, NAVIGATE_TO_POSE_TYPE, "pose", NavigateToPoseNavigator),
    "follow_route": (FOLLOW_ROUTE, FOLLOW_ROUTE_TYPE, "use_poses", FollowRouteNavigator),
}
"""Name, type and a field of the action of each navigator, and its class."""
