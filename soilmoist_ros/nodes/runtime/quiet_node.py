# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes without an executor."""

from __future__ import annotations

from rclpy.node import Node


def quiet_node(node: Node, suffix: str) -> Node:
    """A node whose messages are taken when it suits, instead of one by one as they come.

    :param node: node of the same context and namespace
    :param suffix: end of its name, after that of the other node
    """
    # Without global arguments, a new name for the other node does not rename this node as well.
    return Node(
        f"{node.get_name()}_{suffix}",
        context=node.context,
        namespace=node.get_namespace(),
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
