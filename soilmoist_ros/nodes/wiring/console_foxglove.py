# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Live view for Foxglove: passes messages of all topics to the viewers that want them."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from msg_adapters import offered_qos, requested_qos
from soilmoist_ros.console import BACKLOG, FoxgloveServer
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.topics import interface_class, quiet_node
from soilmoist_ros.recording import Request, TopicChoice, find_definition, request_for

STEP_S: Final = 0.05
LOOK_S: Final = 1.0
PER_STEP: Final = BACKLOG // 2
"""Messages that are passed on in a step at most: a viewer that keeps up loses none in the server's queue."""


@dataclass
class _Passed:
    """A topic that is passed on, and the number of publishers when it was subscribed to."""

    subscription: Subscription
    request: Request
    publishers: int


class FoxgloveView:
    """Offers every topic whose message type is installed; subscribes only while a viewer wants the topic.

    A new viewer of a latched topic gets its last messages, because the subscription is made anew. The viewers that
    had them get them again.

    :param node: the node
    :param host: address to listen on
    :param port: TCP port
    :raises InputError: if foxglove-sdk is missing, or the address cannot be listened on
    """

    def __init__(self, node: Node, host: str, port: int) -> None:
        self._node = node
        self._listener = quiet_node(node, "foxglove")
        self._server = FoxgloveServer(node.get_fully_qualified_name(), host, port)
        self._choice = TopicChoice()
        self._kinds: dict[str, str] = {}
        self._passed: dict[str, _Passed] = {}
        self._unknown: set[str] = set()
        self._turn = 0
        node.get_logger().info(f"live view for Foxglove: {self._server.address}")
        self._look()
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(LOOK_S, self._look, clock=steady)
        node.create_timer(STEP_S, self._step, clock=steady)

    def close(self) -> None:
        """End the server."""
        self._server.close()
        self._listener.destroy_node()

    def _look(self) -> None:
        """Offer new topics, and subscribe again where other publishers need a weaker quality of service."""
        for topic, kinds in self._node.get_topic_names_and_types():
            seen = topic in self._kinds or topic in self._unknown or len(kinds) != 1
            if seen or not self._choice.wanted(topic) or not self._node.count_publishers(topic):
                continue
            try:
                interface_class(kinds[0])
                self._server.offer(topic, find_definition(kinds[0]))
            except (InputError, ImportError) as error:
                self._unknown.add(topic)
                self._node.get_logger().warning(f"{topic} is not shown in Foxglove: {error}")
            else:
                self._kinds[topic] = kinds[0]
        for topic, one in list(self._passed.items()):
            if self._node.count_publishers(topic) != one.publishers and self._request(topic) != one.request:
                self._subscribe(topic)

    def _step(self) -> None:
        for topic, new in self._server.wanted().items():
            if not new:
                self._listener.destroy_subscription(self._passed.pop(topic).subscription)
            elif topic not in self._passed or self._passed[topic].request.latched:
                self._subscribe(topic)
        now_ns = self._node.get_clock().now().nanoseconds
        # One message of each topic in turn: a topic with many messages does not delay the others.
        waiting = deque(self._passed.items())
        waiting.rotate(-self._turn)
        self._turn += 1
        left = PER_STEP
        while waiting and left:
            topic, one = waiting.popleft()
            with one.subscription.handle:
                taken = one.subscription.handle.take_message(one.subscription.msg_type, True)
            if taken is not None:
                self._server.send(topic, bytes(taken[0]), now_ns)
                waiting.append((topic, one))
                left -= 1

    def _subscribe(self, topic: str) -> None:
        if topic in self._passed:
            self._listener.destroy_subscription(self._passed[topic].subscription)
        message = interface_class(self._kinds[topic])
        publishers, request = self._node.count_publishers(topic), self._request(topic)
        subscription = self._listener.create_subscription(message, topic, print, requested_qos(request), raw=True)
        self._passed[topic] = _Passed(subscription, request, publishers)

    def _request(self, topic: str) -> Request:
        offered = [offered_qos(info.qos_profile) for info in self._node.get_publishers_info_by_topic(topic)]
        return request_for(offered) if offered else Request(reliable=False, latched=False, depth=1)
