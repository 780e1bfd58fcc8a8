# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigation over a topological map by the action ``GotoNode``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from rclpy.node import Node

from soilmoist_ros.exploration import Ended, GoalClient, Stop, Track, Way, WayPoint
from soilmoist_ros.nodes.navigation.action_navigator import ActionNavigator
from soilmoist_ros.nodes.navigation.route_feedback import RouteFeedback

NAME: Final = "topological_navigation"
TYPE: Final = "topological_navigation_msgs/action/GotoNode"
GOAL_FIELD: Final = "target"


class GotoNodeNavigator(ActionNavigator):
    """A :class:`Navigator` that is a client of ``GotoNode``. The server finds the route by itself.

    :param node: node of the client
    :param name: name of the action
    :param kind: class of the action
    :param feedback_topic: plain topic on which some versions publish the node that the robot passes
    :param client: decides on goals
    :param track: recent places of the robot
    :param there_m: a robot that stands this close to a stop is there already [m]; some servers abort such a goal
    :param report: called at the end of each goal
    :param yields: whether no goal is sent while another client drives the robot
    """

    def __init__(
        self,
        node: Node,
        name: str,
        kind: Any,
        feedback_topic: str,
        client: GoalClient,
        track: Track,
        there_m: float,
        report: Callable[[Ended], None],
        yields: bool = True,
    ) -> None:
        super().__init__(node, name, kind, client, track, there_m, report, yields)
        self._is_nearest = False
        self._feedback = RouteFeedback(node, feedback_topic, kind, self._on_feedback)

    @property
    def on_the_way(self) -> str:
        """The last node in the navigation's feedback."""
        return self._feedback.route

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`; feedback comes at nodes only, so its age says nothing."""
        return math.nan

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self._feedback.route = ""
        self._is_nearest = 0 < len(way.corners) <= 2
        super().go(goal_id, stop, way)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        self._feedback.look_for_topic()
        super().tick(now_s)

    def goals(self, stop: Stop, way: Way) -> tuple[WayPoint, ...]:
        """The nodes that keep the server's own route inside the fence, and the stop."""
        return tuple(map(WayPoint, way.nodes)) or (WayPoint(stop),)

    def goal_message(self, point: WayPoint) -> Any:
        """Goal with the name of the node."""
        goal = self._kind.Goal()
        goal.target = str(point.stop.name)
        if hasattr(goal, "no_orientation"):
            goal.no_orientation = True  # the sensor has no heading
        return goal

    def heard(self, message: Any) -> None:
        """Process feedback of a goal, or of the plain topic."""
        self._feedback.heard(message)

    def verdict(self, result: Any) -> tuple[bool, str]:
        """The flag of the result; it has no reason, so the last feedback is quoted."""
        why = "is the stop on its map, and the way free?"
        if self._is_nearest:
            why = "the robot is nearest to this node already; some servers need reconfigure_edges: false for that"
        last = f"; its last feedback was {self._feedback.route!r}" if self._feedback.route else ""
        return bool(getattr(result, "success", False)), f"{why}{last}"
