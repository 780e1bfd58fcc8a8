# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node that the robot passes, from the feedback of a goal or from a plain topic."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription

from msg_adapters import offered_qos, requested_qos
from soilmoist_ros.foundation import foreign_text
from soilmoist_ros.nodes.runtime.qos import NO_EVENTS
from soilmoist_ros.nodes.runtime.topic_types import interface_class
from soilmoist_ros.recording import request_for

LOOK_EVERY_S = 1.0


class RouteFeedback:
    """Subscribes to the feedback of goals.

    :param node: node of the subscriptions
    :param topic: plain topic of the feedback
    :param kind: class of the action
    :param on_topic: called with each message of the plain topic; passes it to :meth:`heard`
    """

    def __init__(self, node: Node, topic: str, kind: Any, on_topic: Callable[[Any], None]) -> None:
        self.route = ""
        self._on_topic = on_topic
        self._node = node
        self._topic = node.resolve_topic_name(topic)
        self._kind = kind
        self._next_look_s = 0.0
        self._offer: tuple[Any, ...] = ()
        self._subscription: Subscription | None = None

    def heard(self, message: Any) -> None:
        """Process feedback of a goal, or a message of the plain topic."""
        content = getattr(message, "feedback", message)
        for name in ("route", "data"):
            text = getattr(content, name, None)
            if isinstance(text, str):
                self.route = foreign_text(text)

    def look_for_topic(self) -> None:
        """Subscribe to the plain topic once it exists; its type and quality of service depend on the version."""
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
            self._node.get_logger().warning(f"{self._topic} has the unknown type {found[0].topic_type}: ignored")
            return
        profile = requested_qos(request_for([offered_qos(info.qos_profile) for info in found]))
        self._subscription = self._node.create_subscription(
            message_class, self._topic, self._on_topic, profile, event_callbacks=NO_EVENTS
        )

    def _message_class(self, name: str) -> Any:
        _package, folder, kind = name.split("/")
        if folder == "action":
            return self._kind.Feedback if kind == f"{self._kind.__name__}_Feedback" else None
        try:
            return interface_class(name)
        except ImportError:
            return None
