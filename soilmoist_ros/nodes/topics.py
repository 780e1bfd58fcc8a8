# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topics: quality of service with the reason for each profile, types found at run time, nodes without executor."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.type_support import check_for_type_support

from soilmoist_ros.foundation import InputError, listing
from soilmoist_ros.recording import Qos, Request

NO_EVENTS: Final = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For subscriptions whose publishers may offer less: no warning, and none of the callbacks with which the executor
may crash when the subscription is destroyed."""
_KEEP: Final = 100  # depth of a publisher if the recorded depth is unknown


def _profile(depth: int, latched: bool = False, reliable: bool = True) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


RECORDS: Final = _profile(100)
"""Records: none may be lost, even if a receiver is busy for a quarter of an hour."""
SENSOR: Final = _profile(5, reliable=False)
"""Fixes and weather: only the latest matters, and drivers of other makers use this profile."""
LATCHED: Final = _profile(1, latched=True)  # maps, plans and states: a late receiver gets the last one
VISITS: Final = _profile(100, latched=True)  # visits: a late receiver gets the visits of the last hours
DEFAULT: Final = _profile(10)  # /diagnostics and goal poses: other tools expect this profile
TF: Final = _profile(100)  # /tf: the profile of tf2; several nodes publish parts of the tree at high rates
TF_STATIC: Final = _profile(100, latched=True)  # /tf_static: each publisher sends its transforms once
CLOCK: Final = _profile(1, reliable=False)  # simulated time: only the latest matters

HEARTBEAT: Final = "planner/heartbeat"
"""Topic of the planner's heartbeat (std_msgs/Bool); false if the planner itself finds that it is stuck."""


# Types of interfaces: of the publishers of a topic, and those that are imported at run time ---------------------


def interface_class(name: str) -> Any:
    """Class of a message, service or action that may not be installed, ready for use.

    Its C library, which Python's class needs, is loaded here: rclpy would do so later, with another exception.
    """
    package, folder, kind = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.{folder}"), kind)
    except AttributeError:
        raise ImportError(f"{package} has no {folder} {kind!r}") from None
    try:
        check_for_type_support(found)
    except Exception as error:  # rosidl's or rclpy's own, or that of a library of another version
        raise ImportError(f"its type support cannot be loaded: {error}") from None
    return found


def other_type(node: Node, topic: str, expected: str) -> str:
    """Reason for which a subscription hears nothing, another type or name; empty if a publisher sends the type."""
    sent = {one.topic_type for one in node.get_publishers_info_by_topic(topic)}
    if sent:
        return "" if expected in sent else f"the topic {topic} has {', '.join(sorted(sent))}, not {expected}"
    offered = [name for name, kinds in node.get_topic_names_and_types() if expected in kinds]
    elsewhere = sorted(name for name in offered if node.count_publishers(name))
    here = node.resolve_topic_name(topic)
    return f"nobody publishes {here}, but {expected} is on {listing(elsewhere)}" if elsewhere else ""


class Faults:
    """Names what a node cannot use, each fault once: a faulty publisher repeats it."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._said: dict[str, str] = {}

    def ignore(self, what: str, error: Exception) -> None:
        """Log what cannot be used, and why."""
        what = what.strip()
        if self._said.get(what) != str(error):
            self._said[what] = str(error)
            self._node.get_logger().error(f"{what} cannot be used: {error}")

    def guarded(self, what: str, take: Callable[[Any], None]) -> Callable[[Any], None]:
        """A callback that ignores messages with impossible values."""

        def callback(message: Any) -> None:
            try:
                take(message)
            except (ValueError, TypeError, LookupError, InputError) as error:
                self.ignore(what, error)

        return callback


# Quality of service of publishers <-> what a recorder stores and requests ---------------------------------------


def offered_qos(profile: QoSProfile) -> Qos:
    """The offer of a publisher, in the terms of rosbag2."""
    return Qos(
        profile.history.name.lower(), int(profile.depth), profile.reliability.name.lower(),
        profile.durability.name.lower(), profile.deadline.nanoseconds, profile.lifespan.nanoseconds,
        profile.liveliness.name.lower(), profile.liveliness_lease_duration.nanoseconds,
    )  # fmt: skip


def requested_qos(request: Request) -> QoSProfile:
    """Profile of a subscription."""
    return _profile(request.depth, request.latched, request.reliable)


def published_qos(recorded: Sequence[Qos]) -> QoSProfile:
    """Profile of a publisher that serves all subscriptions of the recorded publishers; reliable without any."""
    latched = any(qos.durability == "transient_local" for qos in recorded)
    reliable = latched or not recorded or any(qos.reliability != "best_effort" for qos in recorded)
    # Fast DDS hides the depth of other publishers. A late subscription needs a latched topic's last message.
    depth = max((qos.depth for qos in recorded), default=0) or (1 if latched else _KEEP)
    return _profile(depth, latched, reliable)


# Time, and nodes without an executor ---------------------------------------------------------------------------


def ros_now_s(node: Node) -> float:
    """ROS time [s]."""
    return float(node.get_clock().now().nanoseconds * 1e-9)


def every(node: Node, period_s: float, call: Callable[[], object]) -> None:
    """Have a function called regularly in steady time: simulated time may run fast, or stand still."""
    node.create_timer(period_s, call, clock=Clock(clock_type=ClockType.STEADY_TIME))


def quiet_node(node: Node, suffix: str) -> Node:
    """A node whose messages are taken when it suits, instead of one by one as they come."""
    # Without global arguments, a new name for the other node does not rename this node as well.
    return Node(
        f"{node.get_name()}_{suffix}", context=node.context, namespace=node.get_namespace(),
        use_global_arguments=False, start_parameter_services=False, enable_rosout=False,
    )  # fmt: skip
