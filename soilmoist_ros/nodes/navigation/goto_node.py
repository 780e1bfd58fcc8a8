"""Navigation over a topological map by the action ``GotoNode``, with the rules of the goal client."""

from __future__ import annotations

import importlib
import time
import uuid
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from soilmoist_ros.exploration.navigation.goal_client import CancelSent, GoalClient, Request, SendGoal
from soilmoist_ros.exploration.navigation.navigator import Ended
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.suggestions import did_you_mean
from soilmoist_ros.nodes.navigation.route_feedback import RouteFeedback


class GotoNodeNavigator:
    """A :class:`Navigator` that is a client of ``GotoNode``.

    :param node: node of the client
    :param name: name of the action
    :param kind: class of the action, see :func:`action_class`
    :param feedback_topic: plain topic on which some versions publish the node that the robot passes
    :param client: decides on goals
    :param report: called at the end of each goal
    """

    def __init__(
        self,
        node: Node,
        name: str,
        kind: Any,
        feedback_topic: str,
        client: GoalClient,
        report: Callable[[Ended], None],
    ) -> None:
        self._name = node.resolve_service_name(name)
        self._kind = kind
        self._client = client
        self._report = report
        self._lock = Lock()
        self._ids: dict[int, UUID] = {}
        self._actions = ActionClient(node, kind, name)
        # Some goals are cancelled without a handle of the action client, so cancelling needs a service client.
        self._cancels = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        self._feedback = RouteFeedback(node, feedback_topic, kind)

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        return "" if self._actions.server_is_ready() else f"the navigation {self._name}"

    @property
    def on_the_way(self) -> str:
        """The last node in the navigation's feedback."""
        return self._feedback.route

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self._feedback.route = ""
        self._step(self._client.go, goal_id, stop)

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._step(self._client.cancel, goal_id)

    def moved(self, place: tuple[float, float], now_s: float) -> None:
        """See :class:`Navigator`."""
        self._step(self._client.moved, place)

    def tick(self) -> None:
        """See :class:`Navigator`."""
        self._feedback.look_for_topic()
        self._step(self._client.tick, self._actions.server_is_ready())

    def _step(self, happened: Callable[..., tuple[Request, ...]], *values: Any) -> None:
        # The limits apply to messages, so they use the computer's clock. Requests run without the lock, because a
        # report may call this method from another thread.
        with self._lock:
            requests = happened(*values, time.monotonic())
        for request in requests:
            match request:
                case SendGoal():
                    self._send(request)
                case CancelSent():
                    self._ask_to_cancel(request)
                case Ended():
                    self._report(request)

    def _send(self, request: SendGoal) -> None:
        goal = self._kind.Goal()
        goal.target = str(request.stop.name)
        if hasattr(goal, "no_orientation"):
            goal.no_orientation = True  # the sensor has no heading
        identity = self._ids[request.goal_id] = UUID(uuid=list(uuid.uuid4().bytes))
        future = self._actions.send_goal_async(goal, self._feedback.heard, identity)
        future.add_done_callback(partial(self._answered, request.goal_id))

    def _answered(self, goal_id: int, future: Future) -> None:
        handle = future.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._ended, goal_id))
        self._step(self._client.answered, goal_id, handle is not None and bool(handle.accepted))

    def _ended(self, goal_id: int, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            success = bool(getattr(answer.result, "success", False))
            self._step(self._client.ended, goal_id, int(answer.status), success)

    def _ask_to_cancel(self, request: CancelSent) -> None:
        question = CancelGoal.Request()  # without an id it cancels all goals
        if request.ours:
            question.goal_info.goal_id = self._ids[request.goal_id]
        self._cancels.call_async(question).add_done_callback(partial(self._cancel_answered, request))

    def _cancel_answered(self, request: CancelSent, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            # The answer for all goals has no result for a single goal.
            code = int(answer.return_code) if request.ours else CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
            self._step(self._client.cancel_answered, request.goal_id, code)


def action_class(name: str) -> Any:
    """Class of an action that drives to a named node; imported only here, so that the package installs without it.

    :param name: type of the action, such as ``topological_navigation_msgs/action/GotoNode``
    :raises InputError: if the action is not installed or does not drive to a named node
    """
    remedy = "source the workspace of the navigation, or set navigator: goal_pose"
    package, _, rest = name.partition("/")
    folder, _, kind = rest.partition("/")
    if folder != "action" or not package or not kind:
        raise InputError(f"{name!r} is not the type of an action", "write PACKAGE/action/NAME")
    try:
        module = importlib.import_module(f"{package}.action")
    except ImportError as error:
        raise InputError(f"the action type {name!r} cannot be used: {error}", remedy) from None
    found = getattr(module, kind, None)
    if found is None or not hasattr(found, "Goal"):
        known = [word for word in dir(module) if hasattr(getattr(module, word), "Goal")]
        raise InputError(
            f"{package} has no action {kind!r}", f"it has {', '.join(known)}{did_you_mean(kind, known)}"
        )
    if not hasattr(found.Goal(), "target"):
        raise InputError(f"goals of {name!r} have no field 'target'", "use the navigation's action GotoNode")
    return found
