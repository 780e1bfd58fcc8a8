# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A navigation that is a ROS action: goals, answers and cancellations, with the rules of the goal client."""

from __future__ import annotations

import importlib
import math
import time
import uuid
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
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
from soilmoist_ros.exploration.navigation.track import Track
from soilmoist_ros.exploration.navigation.way_points import WayPoint, way_points
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.suggestions import did_you_mean

KEPT_GOALS = 10
"""Latest goals that can be cancelled: one follows the other, and an earlier one may still run."""


class ActionNavigator(ABC):
    """A :class:`Navigator` that is the client of an action; what its messages contain is up to the subclass.

    :param node: node of the client
    :param name: name of the action
    :param kind: class of the action, see :func:`action_class`
    :param client: decides on goals
    :param track: recent places of the robot
    :param there_m: a robot that stands this close to a stop is there already [m]
    :param report: called at the end of each goal
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
    ) -> None:
        self._node = node
        self._name = node.resolve_service_name(name)
        self._kind = kind
        self._client = client
        self._track = track
        self._there_m = there_m
        self._report = report
        self._lock = Lock()
        self._ids: dict[int, UUID] = {}
        self._heard: tuple[float, float] | None = None  # of the computer's clock, and of the mission
        self._actions = ActionClient(node, kind, name)
        # Some goals are cancelled without a handle of the action client, so cancelling needs a service client.
        self._cancels = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        servers = self._servers
        if servers > 1:
            return f"one navigation: {servers} nodes answer as {self._name}"
        return "" if servers else f"the navigation {self._name}"

    @property
    def _servers(self) -> int:
        # Answers of two servers to one goal crash the executor.
        found = self._node.count_services(f"{self._name}/_action/send_goal")
        return max(found, 1) if self._actions.server_is_ready() else 0

    @property
    @abstractmethod
    def on_the_way(self) -> str:
        """See :class:`Navigator`."""

    @property
    def caution(self) -> str:
        """See :class:`Navigator`; the limits of an action are in its answers."""
        return ""

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`."""
        heard = self._heard
        # Simulated time may run faster or slower than the computer's: neither is silence of the navigation.
        return math.nan if heard is None else min(time.monotonic() - heard[0], self._track.now_s - heard[1])

    @property
    def stop_unheard(self) -> bool:
        """See :class:`Navigator`."""
        with self._lock:
            return self._client.stop_unheard

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            there = self._track.standing_at(stop, self._there_m)
        self._step(self._client.go, goal_id, self.goals(stop, way), then=(there,))

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._step(self._client.cancel, goal_id)

    def moved(self, place: tuple[float, float], now_s: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            self._track.moved(place, now_s)
        self._step(self._client.moved, place)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            self._track.tick(now_s)
        self._step(self._client.tick, self._servers)

    # What the action's messages contain ----------------------------------------------------------------------

    def goals(self, stop: Stop, way: Way) -> tuple[WayPoint, ...]:
        """Goals of the action for a route, one after the other."""
        return way_points(way.corners, stop)

    @abstractmethod
    def goal_message(self, point: WayPoint) -> Any:
        """Goal of the action."""

    @abstractmethod
    def heard(self, message: Any) -> None:
        """Process feedback of the action."""

    @abstractmethod
    def verdict(self, result: Any) -> tuple[bool, str]:
        """Whether a result reports the arrival, and what it says about a failure."""

    # What the client asks for --------------------------------------------------------------------------------

    def _step(self, happened: Callable[..., tuple[Request, ...]], *values: Any, then: Sequence[Any] = ()) -> None:
        # The limits apply to messages, so they use the computer's clock. Requests run without the lock, because a
        # report may call this method from another thread.
        with self._lock:
            requests = happened(*values, time.monotonic(), *then)
        for request in requests:
            match request:
                case SendGoal():
                    self._send(request)
                case CancelSent():
                    self._ask_to_cancel(request)
                case Ended():
                    self._heard = None
                    self._report(request)

    def _send(self, request: SendGoal) -> None:
        self._heard = None
        identity = UUID(uuid=list(uuid.uuid4().bytes))
        self._ids.pop(request.goal_id, None)  # a goal that is sent again becomes the latest
        self._ids[request.goal_id] = identity
        if len(self._ids) > KEPT_GOALS:
            del self._ids[next(iter(self._ids))]
        future = self._actions.send_goal_async(self.goal_message(request.point), self._on_feedback, identity)
        future.add_done_callback(partial(self._answered, request.goal_id))

    def _on_feedback(self, message: Any) -> None:
        self._heard = time.monotonic(), self._track.now_s
        self.heard(message)

    def _answered(self, goal_id: int, future: Future) -> None:
        handle = future.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._ended, goal_id))
        self._step(self._client.answered, goal_id, handle is not None and bool(handle.accepted))

    def _ended(self, goal_id: int, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            success, why = self.verdict(answer.result)
            self._step(self._client.ended, goal_id, int(answer.status), success, then=(why,))

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
            self._step(self._client.cancel_answered, request.goal_id, code, then=(request.accepted,))


def action_class(name: str, field: str) -> Any:
    """Class of an action; imported only here, so that the package installs without it.

    :param name: type of the action, such as ``topological_navigation_msgs/action/GotoNode``
    :param field: a field that its goals must have
    :raises InputError: if the action is not installed or is another one
    """
    remedy = "source the workspace of the navigation, or set another navigator"
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
    if not hasattr(found.Goal(), field):
        raise InputError(
            f"goals of {name!r} have no field {field!r}", "set the navigator that goes with this action_type"
        )
    return found
