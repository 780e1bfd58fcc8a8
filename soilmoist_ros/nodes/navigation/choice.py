# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The navigator that the parameters of the planner ask for."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from soilmoist_ros.exploration import Cause, Ended, GoalClient, GoalLimits, Navigator, PoseClient, Response, Track
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.navigation import goto_node, navigate_to_pose
from soilmoist_ros.nodes.navigation.action_navigator import action_class
from soilmoist_ros.nodes.navigation.goal_pose import GoalPoseNavigator
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.guard import failsafe_name


def make_navigator(node: Node, values: Parameters, report: Callable[[Ended], None]) -> Navigator:
    """The navigator of a planner.

    :param node: the planner
    :param values: its parameters
    :param report: called at the end of each goal
    :raises InputError: if the navigator does not go with the travel graph, or its action is not installed
    """
    text, number = values.text, values.number
    radius_m, speed_mps = number("arrival_radius_m"), number("speed_mps")
    frame = text("navigation_frame") or text("frame")
    response = Response(text(failsafe_name(Cause.OTHER_CLIENT)))
    yields = response not in (Response.IGNORE, Response.WARN)
    if text("navigator") == "goal_pose":
        poses = PoseClient(radius_m, number("settle_s"), speed_mps)
        action = text("action_name") or navigate_to_pose.NAME
        return GoalPoseNavigator(node, action, values.texts("pose_observers"), poses, report, frame, yields)
    client = GoalClient(radius_m, GoalLimits(start_s=number("navigation_wait_s")))
    track = Track(speed_mps, radius_m)
    if text("navigator") == "navigate_to_pose":
        kind = action_class(text("action_type") or navigate_to_pose.TYPE, navigate_to_pose.GOAL_FIELD)
        name = text("action_name") or navigate_to_pose.NAME
        return navigate_to_pose.NavigateToPoseNavigator(
            node, name, kind, client, track, track.still_m, report, frame, yields
        )
    if text("graph") == "free":
        raise InputError("goto_node goes to nodes of a map, but graph is free", "set graph: topic, or a map file")
    kind = action_class(text("action_type") or goto_node.TYPE, goto_node.GOAL_FIELD)
    name = text("action_name") or goto_node.NAME
    feedback = text("feedback_topic")
    return goto_node.GotoNodeNavigator(node, name, kind, feedback, client, track, radius_m, report, yields)
