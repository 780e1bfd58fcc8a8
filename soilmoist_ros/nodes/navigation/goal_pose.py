"""Navigation by ``geometry_msgs/PoseStamped`` on ``goal_pose``, which RViz publishes and Nav2 accepts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from threading import Lock

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from msg_adapters.plan import pose_stamped
from soilmoist_ros.exploration.navigation.navigator import Ended
from soilmoist_ros.exploration.navigation.pose_client import PoseClient, SendPose
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.nodes.runtime.qos import DEFAULT

TOPIC = "goal_pose"


class GoalPoseNavigator:
    """A :class:`Navigator` that publishes poses.

    :param node: the node that publishes
    :param client: decides on arrival
    :param report: called at the end of each goal
    """

    def __init__(self, node: Node, client: PoseClient, report: Callable[[Ended], None]) -> None:
        self._node = node
        self._client = client
        self._report = report
        self._lock = Lock()
        self._poses = node.create_publisher(PoseStamped, TOPIC, DEFAULT)

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        return (
            ""
            if self._poses.get_subscription_count()
            else f"a navigation that subscribes to {self._poses.topic_name}"
        )

    @property
    def on_the_way(self) -> str:
        """Always empty: there is no feedback."""
        return ""

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.go(goal_id, stop)
        self._do(requests)

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.cancel(goal_id)
        self._do(requests)

    def moved(self, place: tuple[float, float], now_s: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            requests = self._client.moved(place, now_s)
        self._do(requests)

    def tick(self) -> None:
        """Does nothing."""

    def _do(self, requests: Iterable[SendPose | Ended]) -> None:
        for request in requests:
            if isinstance(request, SendPose):
                now_s = self._node.get_clock().now().nanoseconds * 1e-9
                self._poses.publish(pose_stamped(request.x_m, request.y_m, now_s))
            else:
                self._report(request)
