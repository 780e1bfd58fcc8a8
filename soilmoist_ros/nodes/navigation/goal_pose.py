# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigation by ``geometry_msgs/PoseStamped`` on ``goal_pose``, which RViz publishes and Nav2 accepts."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from threading import Lock
from typing import Final

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.task import Future

from msg_adapters import FRAME, pose_stamped
from soilmoist_ros.exploration import (
    CancelAll,
    Ended,
    PoseClient,
    PoseRequest,
    SendPose,
    Stop,
    Way,
    drivers,
    way_points,
)
from soilmoist_ros.nodes.runtime.qos import DEFAULT

TOPIC: Final = "goal_pose"
KEPT_POSES: Final = 100
"""Own poses that are recognised when they come back."""


class GoalPoseNavigator:
    """A :class:`Navigator` that publishes poses.

    :param node: the node that publishes
    :param action: name of the action by which the same navigation can be stopped, if it has one
    :param observers: nodes that subscribe to poses but drive no robot, patterns of names
    :param client: decides on arrival and stops
    :param report: called at the end of each goal
    :param frame: frame of the navigation
    :param yields: whether no pose is sent while the robot may drive to that of another client
    """

    def __init__(
        self,
        node: Node,
        action: str,
        observers: Sequence[str],
        client: PoseClient,
        report: Callable[[Ended], None],
        frame: str = FRAME,
        yields: bool = True,
    ) -> None:
        self._node = node
        self._frame = frame
        self._observers = tuple(observers)
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
        if drivers(heard_by, self._observers):
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
        """How the robot can be stopped; there is no feedback."""
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
                    now_s = self._node.get_clock().now().nanoseconds * 1e-9
                    place = (request.x_m, request.y_m)
                    pose = pose_stamped(*place, now_s, self._frame, request.heading_rad)
                    with self._lock:
                        self._sent.append(pose)
                    self._poses.publish(pose)
                case CancelAll():
                    self._asked = self._cancels.call_async(
                        CancelGoal.Request()
                    )  # without an id it cancels all goals
                case Ended():
                    self._report(request)
