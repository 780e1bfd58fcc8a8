"""Where the robot is on its way, as the navigation says it: with the goal, or on a plain topic only."""

from __future__ import annotations

import importlib
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

LOOK_EVERY_S = 1.0


class RouteFeedback:
    """Listens to the feedback of goals.

    :param node: the node it belongs to
    :param topic: plain topic of the feedback
    :param kind: class of the action
    """

    def __init__(self, node: Node, topic: str, kind: Any) -> None:
        self.route = ""
        self._node = node
        self._topic = node.resolve_topic_name(topic)
        self._kind = kind
        self._next_look_s = 0.0
        self._offer: tuple[Any, ...] = ()
        self._subscription: Subscription | None = None

    def heard(self, message: Any) -> None:
        """Feedback of a goal, or a message of the plain topic."""
        content = getattr(message, "feedback", message)
        for name in ("route", "data"):
            text = getattr(content, name, None)
            if isinstance(text, str):
                self.route = text

    def look_for_topic(self) -> None:
        """Subscribe to the plain topic once it is there, as it is offered: versions differ in that."""
        if time.monotonic() < self._next_look_s:
            return
        self._next_look_s = time.monotonic() + LOOK_EVERY_S
        found = self._node.get_publishers_info_by_topic(self._topic)
        offer = tuple(
            (info.topic_type, info.qos_profile.reliability, info.qos_profile.durability) for info in found
        )
        if not found or offer == self._offer:
            return
        self._offer = offer
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None
        message_class = self._message_class(found[0].topic_type)
        if message_class is None:
            self._node.get_logger().warning(f"{self._topic} is of unknown type {found[0].topic_type}: not shown")
            return
        self._subscription = self._node.create_subscription(message_class, self._topic, self.heard, weakest(found))

    def _message_class(self, name: str) -> Any:
        package, folder, kind = name.split("/")
        if folder == "action":
            return self._kind.Feedback if kind == f"{self._kind.__name__}_Feedback" else None
        try:
            return getattr(importlib.import_module(f"{package}.{folder}"), kind, None)
        except ImportError:
            return None


def weakest(offered: list[TopicEndpointInfo]) -> QoSProfile:
    """A profile that all publishers can meet."""
    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in offered)
    latched = all(info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for info in offered)
    return QoSProfile(
        depth=5,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
