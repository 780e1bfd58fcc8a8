# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Types of interfaces: of the publishers of a topic, and those that are imported at run time."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.node import Node

from soilmoist_ros.foundation import listing


def interface_class(name: str) -> Any:
    """Class of a message, service or action that may not be installed, ready for use.

    Its C library, which Python's class needs, is loaded here: rclpy would do so later, with another exception.

    :param name: type as in ``nav2_msgs/action/NavigateToPose``
    :raises ImportError: if it cannot be used, with the reason
    """
    package, folder, kind = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.{folder}"), kind)
    except AttributeError:
        raise ImportError(f"{package} has no {folder} {kind!r}") from None
    meta = type(found)
    try:
        if meta._TYPE_SUPPORT is None:
            meta.__import_type_support__()
        if meta._TYPE_SUPPORT is None:
            raise ImportError("Python's class is there, the C library is not")
    except Exception as error:  # rosidl's own, or that of a library of another version
        raise ImportError(f"its type support cannot be loaded: {error}") from None
    return found


def other_type(node: Node, topic: str, expected: str) -> str:
    """Reason for which a subscription hears nothing, another type or name; empty if a publisher sends the type.

    :param topic: name of the topic, as in the subscription
    :param expected: type as in ``sensor_msgs/msg/NavSatFix``
    """
    sent = {one.topic_type for one in node.get_publishers_info_by_topic(topic)}
    if sent:
        return "" if expected in sent else f"the topic {topic} has {', '.join(sorted(sent))}, not {expected}"
    offered = [name for name, kinds in node.get_topic_names_and_types() if expected in kinds]
    elsewhere = sorted(name for name in offered if node.count_publishers(name))
    here = node.resolve_topic_name(topic)
    return f"nobody publishes {here}, but {expected} is on {listing(elsewhere)}" if elsewhere else ""
