# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A robot of one action: ``python goto_node_server.py`` serves topological_navigation until it is ended."""

from __future__ import annotations

import sys
import time
from functools import partial

import rclpy
from rclpy.action import ActionServer
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from topological_navigation_msgs.action import GotoNode


def go(node, goal):
    """Publish the target as feedback; arrive at every node except ``nowhere``.

    Discovery of the client's subscription may follow the goal; earlier feedback would be lost.
    """
    while not node.count_subscribers("topological_navigation/_action/feedback"):
        time.sleep(0.01)
    for _ in range(5):
        goal.publish_feedback(GotoNode.Feedback(route=f"{goal.request.target} {goal.request.no_orientation}"))
        time.sleep(0.1)
    if goal.request.target == "nowhere":
        goal.abort()
        return GotoNode.Result(success=False)
    goal.succeed()
    return GotoNode.Result(success=True)


def main() -> None:
    rclpy.init(args=sys.argv)
    node = Node("robot")
    ActionServer(node, GotoNode, "topological_navigation", partial(go, node))
    rclpy.spin(node, MultiThreadedExecutor(2))  # discovery continues while a goal waits


if __name__ == "__main__":
    main()
