"""The action server of the simulated navigation."""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher

from soilmoist_ros.nodes.runtime.qos import DEFAULT
from soilmoist_ros.simulation.robot.virtual_navigation import GoalEnded, OnRoute, Outcome
from soilmoist_ros.simulation.simulated_robot import SimulatedRobot

ACTION = "topological_navigation"


class NavigationServer:
    """Serves GotoNode for a simulated robot.

    rclpy executes a goal only when the goal ends, so that no thread waits while the robot drives.

    :param node: node of the server
    :param robot: the robot that handles goals
    :param group: mutually exclusive callback group, shared with the callbacks that advance the system
    :param action: name of the action
    :param plain_feedback: whether feedback is published on a topic instead of the action
    :raises ImportError: if topological_navigation_msgs is not installed
    """

    def __init__(
        self,
        node: Node,
        robot: SimulatedRobot,
        group: CallbackGroup,
        action: str = ACTION,
        plain_feedback: bool = False,
    ) -> None:
        from topological_navigation_msgs.action import GotoNode

        self._type = GotoNode
        self._node = node
        self._robot = robot
        self._group = group
        self._action = action
        self._server: Any = None
        self._plain_feedback: Publisher | None = None
        if plain_feedback:
            self._plain_feedback = node.create_publisher(GotoNode.Feedback, f"{action}/feedback", DEFAULT)
        self._numbers: dict[bytes, int] = {}
        self._handles: dict[int, Any] = {}
        self._endings: dict[bytes, GoalEnded] = {}
        self._accepted: int | None = None

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
                self._type,
                self._action,
                execute_callback=self._execute,
                goal_callback=self._on_goal,
                handle_accepted_callback=self._on_accepted,
                cancel_callback=self._on_cancel,
                callback_group=self._group,
            )

    def feed_back(self, event: OnRoute) -> None:
        """Publish the node that the robot passes as feedback of its goal."""
        feedback = self._type.Feedback(route=event.node)
        if self._plain_feedback is not None:
            self._plain_feedback.publish(feedback)
        elif event.goal_id in self._handles:
            self._handles[event.goal_id].publish_feedback(feedback)

    def end(self, event: GoalEnded) -> None:
        """Send the result of a goal to its client."""
        handle = self._handles.pop(event.goal_id, None)
        if handle is not None:
            self._endings[bytes(handle.goal_id.uuid)] = event
            handle.execute()

    def _execute(self, handle: Any) -> Any:
        event = self._endings.pop(bytes(handle.goal_id.uuid))
        verbs = {
            Outcome.SUCCEEDED: handle.succeed,
            Outcome.CANCELED: handle.canceled,
            Outcome.ABORTED: handle.abort,
        }
        verbs[event.outcome]()
        return self._type.Result(success=bool(event.success))

    def _on_goal(self, goal: Any) -> GoalResponse:
        # The number is needed before the handle exists. The two callbacks run directly one after the other.
        self._accepted = self._robot.go_to(goal.target)
        self._node.get_logger().info(f"goal {goal.target}: {'rejected' if self._accepted is None else 'accepted'}")
        return GoalResponse.REJECT if self._accepted is None else GoalResponse.ACCEPT

    def _on_accepted(self, handle: Any) -> None:
        assert self._accepted is not None
        self._handles[self._accepted] = handle
        self._numbers[bytes(handle.goal_id.uuid)] = self._accepted

    def _on_cancel(self, handle: Any) -> CancelResponse:
        number = self._numbers.get(bytes(handle.goal_id.uuid))
        accepted = number is not None and self._robot.cancel(number)
        return CancelResponse.ACCEPT if accepted else CancelResponse.REJECT
