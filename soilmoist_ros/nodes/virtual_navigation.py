# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The action servers of the simulated navigation: nodes of a map (GotoNode), and poses (NavigateToPose)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Final

from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node

from soilmoist_ros.nodes.topics import interface_class
from soilmoist_ros.simulation import NO_VALID_PATH, GoalEnded, GoalOutcome, OnRoute, Remaining, SimulatedRobot

NODE_ACTION: Final = "topological_navigation"
POSE_ACTION: Final = "navigate_to_pose"
MAP_FRAME: Final = "map"


class NavigationServer(ABC):
    """Serves one action for a simulated robot.

    rclpy executes a goal only when the goal ends, so that no thread waits while the robot drives.
    """

    def __init__(self, node: Node, robot: SimulatedRobot, kind: Any, name: str) -> None:
        self._kind, self._node, self._robot, self._name = kind, node, robot, name
        self._server: Any = None
        self._numbers: dict[bytes, int] = {}
        self._handles: dict[int, Any] = {}
        self._endings: dict[bytes, GoalEnded] = {}
        self._accepted: int | None = None
        self.set_present(robot.navigation.present)

    def set_present(self, present: bool) -> None:
        """Start the server, or destroy it with all its goals."""
        if self._server is not None:
            self._server.destroy()
            self._server = None
            self._handles.clear()
            self._numbers.clear()
        if present:
            self._server = ActionServer(
                self._node,
                self._kind,
                self._name,
                execute_callback=self._execute,
                goal_callback=self._on_goal,
                handle_accepted_callback=self._on_accepted,
                cancel_callback=self._on_cancel,
            )

    def feed_back(self, event: OnRoute | Remaining) -> None:
        """Publish feedback of a goal of this action."""
        feedback = self.feedback(event)
        if feedback is not None and event.goal_id in self._handles:
            self._handles[event.goal_id].publish_feedback(feedback)

    def end(self, event: GoalEnded) -> None:
        """Send the result of a goal of this action to its client."""
        handle = self._handles.pop(event.goal_id, None)
        if handle is not None:
            if event.error_code == NO_VALID_PATH:
                self._node.get_logger().warning(f"no path leads to the {self.text(handle.request)}")
            self._endings[bytes(handle.goal_id.uuid)] = event
            handle.execute()

    @abstractmethod
    def accept(self, goal: Any) -> int | None:
        """Number of the goal of a request; ``None`` if it is rejected."""

    @abstractmethod
    def text(self, goal: Any) -> str:
        """Where a goal leads, for the log."""

    @abstractmethod
    def feedback(self, event: OnRoute | Remaining) -> Any:
        """Feedback message of an event; ``None`` if it has none."""

    @abstractmethod
    def result(self, event: GoalEnded) -> Any:
        """Result message of a goal."""

    def _execute(self, handle: Any) -> Any:
        event = self._endings.pop(bytes(handle.goal_id.uuid))
        verbs = {
            GoalOutcome.SUCCEEDED: handle.succeed,
            GoalOutcome.CANCELED: handle.canceled,
            GoalOutcome.ABORTED: handle.abort,
        }
        verbs[event.outcome]()
        return self.result(event)

    def _on_goal(self, goal: Any) -> GoalResponse:
        # The number is needed before the handle exists. The two callbacks run directly one after the other.
        self._accepted = self.accept(goal)
        accepted = self._accepted is not None
        self._node.get_logger().info(f"goal {self.text(goal)}: {'accepted' if accepted else 'rejected'}")
        return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT

    def _on_accepted(self, handle: Any) -> None:
        assert self._accepted is not None
        self._handles[self._accepted] = handle
        self._numbers[bytes(handle.goal_id.uuid)] = self._accepted

    def _on_cancel(self, handle: Any) -> CancelResponse:
        number = self._numbers.get(bytes(handle.goal_id.uuid))
        accepted = number is not None and self._robot.cancel(number)
        return CancelResponse.ACCEPT if accepted else CancelResponse.REJECT


class GotoNodeServer(NavigationServer):
    """Serves GotoNode."""

    def __init__(self, node: Node, robot: SimulatedRobot, below: str) -> None:
        kind = interface_class("topological_navigation_msgs/action/GotoNode")
        super().__init__(node, robot, kind, f"{below}{NODE_ACTION}")

    def accept(self, goal: Any) -> int | None:
        """See :class:`NavigationServer`."""
        return self._robot.go_to(goal.target)

    def text(self, goal: Any) -> str:
        """See :class:`NavigationServer`."""
        return str(goal.target)

    def feedback(self, event: OnRoute | Remaining) -> Any:
        """The node that the robot passes."""
        return self._kind.Feedback(route=event.node) if isinstance(event, OnRoute) else None

    def result(self, event: GoalEnded) -> Any:
        """See :class:`NavigationServer`."""
        return self._kind.Result(success=bool(event.success))


class NavigateToPoseServer(NavigationServer):
    """Serves NavigateToPose. Like Nav2 it sends published poses to itself, so that they can be cancelled."""

    def __init__(self, node: Node, robot: SimulatedRobot, below: str) -> None:
        kind = interface_class("nav2_msgs/action/NavigateToPose")
        super().__init__(node, robot, kind, f"{below}{POSE_ACTION}")
        self._itself = ActionClient(node, kind, self._name)

    def send(self, pose: PoseStamped) -> None:
        """Send a pose to the own server."""
        self._itself.send_goal_async(self._kind.Goal(pose=pose))

    def accept(self, goal: Any) -> int | None:
        """See :class:`NavigationServer`."""
        place = goal.pose.pose.position
        if goal.pose.header.frame_id != MAP_FRAME:
            frame = goal.pose.header.frame_id
            self._node.get_logger().warning(f"a goal pose in frame {frame!r}, not {MAP_FRAME!r}: ignored")
            return None
        return self._robot.go_to_pose((float(place.x), float(place.y)))

    def text(self, goal: Any) -> str:
        """See :class:`NavigationServer`."""
        place = goal.pose.pose.position
        return f"goal pose at x = {place.x:g} m, y = {place.y:g} m"

    def feedback(self, event: OnRoute | Remaining) -> Any:
        """The distance that remains."""
        if isinstance(event, OnRoute):
            return None
        return self._kind.Feedback(distance_remaining=float(event.distance_m))

    def result(self, event: GoalEnded) -> Any:
        """See :class:`NavigationServer`; Nav2 of Humble has no error code."""
        result = self._kind.Result()
        if hasattr(result, "error_code"):
            result.error_code = int(event.error_code)
        return result


def navigation_servers(node: Node, robot: SimulatedRobot, below: str) -> list[NavigationServer]:
    """Servers of the actions whose types are installed.

    :param below: namespace of the robot, with a slash at its end; empty for none
    """
    servers: list[NavigationServer] = []
    makers: dict[str, Callable[[Node, SimulatedRobot, str], NavigationServer]] = {
        "topological_navigation_msgs": GotoNodeServer,
        "nav2_msgs": NavigateToPoseServer,
    }
    for package, make in makers.items():
        try:
            servers.append(make(node, robot, below))
        except ImportError as error:
            node.get_logger().warning(f"a navigation action is missing: {package} is not installed ({error})")
    return servers
