"""A robot of one action: ``python goto_node_server.py`` serves topological_navigation until it is ended."""

from __future__ import annotations

import sys

import rclpy
from rclpy.action import ActionServer
from rclpy.node import Node
from topological_navigation_msgs.action import GotoNode


def go(goal):
    """Tell where it goes; arrive at every node but ``nowhere``."""
    goal.publish_feedback(GotoNode.Feedback(route=f"{goal.request.target} {goal.request.no_orientation}"))
    if goal.request.target == "nowhere":
        goal.abort()
        return GotoNode.Result(success=False)
    goal.succeed()
    return GotoNode.Result(success=True)


def main() -> None:
    rclpy.init(args=sys.argv)
    node = Node("robot")
    ActionServer(node, GotoNode, "topological_navigation", go)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
