# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Types of the publishers of a topic: a subscription to another type hears nothing, without a word."""

from __future__ import annotations

from rclpy.node import Node


def other_type(node: Node, topic: str, expected: str) -> str:
    """What the publishers of a topic send instead of a type, in words; empty if one sends it, or there is none.

    :param topic: name of the topic, as in the subscription
    :param expected: type as in ``sensor_msgs/msg/NavSatFix``
    """
    sent = {one.topic_type for one in node.get_publishers_info_by_topic(topic)}
    return (
        "" if expected in sent or not sent else f"the topic {topic} has {', '.join(sorted(sent))}, not {expected}"
    )
