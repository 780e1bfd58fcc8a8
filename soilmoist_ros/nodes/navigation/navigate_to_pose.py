# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigation by Nav2's action ``NavigateToPose``: poses with answers, feedback and cancellation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from rclpy.node import Node

from msg_adapters import FRAME, pose_stamped
from soilmoist_ros.exploration import Ended, GoalClient, Stop, Track, Way, WayPoint, failure, progress
from soilmoist_ros.foundation import foreign_text
from soilmoist_ros.nodes.navigation.action_navigator import ActionNavigator

NAME: Final = "navigate_to_pose"
TYPE: Final = "nav2_msgs/action/NavigateToPose"
GOAL_FIELD: Final = "pose"


class NavigateToPoseNavigator(ActionNavigator):
    """A :class:`Navigator` that is a client of ``NavigateToPose``.

    The result has no flag of success: its status says it. Older versions have no error code either.

    :param node: node of the client
    :param name: name of the action
    :param kind: class of the action
    :param client: decides on goals
    :param track: recent places of the robot
    :param there_m: a robot that stands this close to a stop is there already [m]
    :param report: called at the end of each goal
    :param frame: frame of the navigation
    :param yields: whether no goal is sent while another client drives the robot
    """

    def __init__(
        self,
        node: Node,
        name: str,
        kind: Any,
        client: GoalClient,
        track: Track,
        there_m: float,
        report: Callable[[Ended], None],
        frame: str = FRAME,
        yields: bool = True,
    ) -> None:
        super().__init__(node, name, kind, client, track, there_m, report, yields)
        self._frame = frame
        self._progress = ""

    @property
    def on_the_way(self) -> str:
        """Distance that remains to the next way point, and recoveries."""
        return self._progress

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self._progress = ""
        super().go(goal_id, stop, way)

    def goal_message(self, point: WayPoint) -> Any:
        """Goal with the pose at this time: Nav2 transforms it by its stamp."""
        goal = self._kind.Goal()
        now_s = self._node.get_clock().now().nanoseconds * 1e-9
        goal.pose = pose_stamped(point.stop.x_m, point.stop.y_m, now_s, self._frame, point.heading_rad)
        return goal

    def heard(self, message: Any) -> None:
        """Process feedback."""
        content = message.feedback
        remaining_m = float(getattr(content, "distance_remaining", float("nan")))
        self._progress = progress(remaining_m, int(getattr(content, "number_of_recoveries", 0)))

    def verdict(self, result: Any) -> tuple[bool, str]:
        """The error code in words."""
        code, text = int(getattr(result, "error_code", 0)), foreign_text(str(getattr(result, "error_msg", "")))
        return code == 0, failure(code, text)
