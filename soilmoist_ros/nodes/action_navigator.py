# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A navigation that is a ROS action: goals, answers and cancellations, with the rules of the goal client."""

from __future__ import annotations

import contextlib
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Any, Final

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from msg_adapters import FRAME
from soilmoist_ros.exploration import (
    ACTIVE,
    ANYBODYS,
    ENDED,
    ActionStatus,
    CancelSent,
    Ended,
    GoalClient,
    Listed,
    Request,
    RobotTrack,
    SendGoal,
    Stop,
    Way,
    WayPoint,
    way_points,
)
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.topics import LATCHED, NO_EVENTS, interface_class

LOOK_EVERY_S = 1.0  # time between looks for servers that publish lists of goals [s]
LIST_WAIT_S = 1.5  # time in which the list of a server comes that has had goals [s]
_LIST: Final = "/_action/status"
_UNKNOWN: Final = int(CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID)
KEPT_GOALS = 10  # latest goals that can be cancelled: one follows the other, and an earlier one may still run


class ActionNavigator(ABC):
    """A :class:`Navigator` that is the client of an action; what its messages contain is up to the subclass.

    :param yields: whether no goal is sent while another client drives the robot
    """

    def __init__(
        self,
        node: Node,
        name: str,
        kind: Any,
        client: GoalClient,
        track: RobotTrack,
        there_m: float,
        report: Callable[[Ended], None],
        frame: str = FRAME,
        yields: bool = True,
    ) -> None:
        self._node, self._frame = node, frame
        self._name = node.resolve_service_name(name)
        self._kind, self._client, self._track, self._there_m = kind, client, track, there_m
        self._report, self._yields = report, yields
        self._lock = Lock()
        self._client_name = node.get_fully_qualified_name()
        self._status = ActionStatus(self._client_name)
        self._lists = {self._name: self._status}  # of this action, and of others that drive the robot
        self._subscriptions: dict[str, Subscription] = {}
        self._looked_s, self._there_s = -math.inf, math.inf
        self._ids: dict[int, UUID] = {}
        self._heard: tuple[float, float] | None = None  # of the computer's clock, and of the mission
        self._said = ""
        self._actions = ActionClient(node, kind, name)
        # Some goals are cancelled without a handle of the action client, so cancelling needs a service client.
        self._cancels = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        self._subscribe(self._name)

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        servers = self._servers
        if servers > 1:
            return f"one navigation: {servers} nodes answer as {self._name}"
        if servers and (goal := self._client.unended):
            return f"the end of {goal}: cancel it at the navigation {self._name}, or start that again"
        return "" if servers else f"the navigation {self._name}"

    @property
    def other_client(self) -> str:
        """See :class:`Navigator`."""
        with self._lock:
            if others := self._others:
                return f"another client drives the robot with {others}"
            if self._status.before and not self._client.cancels_before:
                whose = "a goal that this planner may have sent before it was started again"
                return f"another client drives the robot with {self._name}, or {whose}"
        return ""

    @property
    def _servers(self) -> int:
        # Answers of two servers to one goal crash the executor.
        found = self._node.count_services(f"{self._name}/_action/send_goal")
        return max(found, 1) if self._actions.server_is_ready() else 0

    @property
    def on_the_way(self) -> str:
        """Last feedback about the goal, in words."""
        return self._said

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
        self._said = ""
        with self._lock:
            there = self._track.standing_at(stop, self._there_m)
        self._step(self._client.go, goal_id, self.goals(stop, way), then=(there,))

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._step(self._client.cancel, goal_id)

    def moved(self, place: tuple[float, float], now_s: float, sd_m: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            self._track.moved(place, now_s, sd_m)
        self._step(self._client.moved, place)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        with self._lock:
            self._track.tick(now_s)
            if look := time.monotonic() - self._looked_s >= LOOK_EVERY_S:
                self._looked_s = time.monotonic()
        if look:
            self._look()
        self._tick()

    def _tick(self) -> None:
        with self._lock:
            listed = self._listed
        self._step(self._client.tick, self._servers, then=(listed,))

    # What the action's servers list --------------------------------------------------------------------------

    @property
    def _listed(self) -> Listed:
        status, client = self._status, self._client
        states = {goal_id: status.state(bytes(identity.uuid)) for goal_id, identity in self._ids.items()}
        return Listed(
            status.servers,
            frozenset(goal_id for goal_id, state in states.items() if state in ACTIVE),
            frozenset(goal_id for goal_id, state in states.items() if state in ENDED),
            self._yields and bool(self._others or (status.before and not client.cancels_before)),
        )

    @property
    def _others(self) -> str:
        """The action whose server works on a goal of another client; empty if none does."""
        return next((name for name, status in self._lists.items() if status.others), "")

    def _look(self) -> None:
        """Look which servers are there; the list of one that has gone does not count any more."""
        for action in self._drivers():
            found = self._node.get_publishers_info_by_topic(f"{action}{_LIST}")
            with self._lock:
                status = self._lists.setdefault(action, ActionStatus(self._client_name))
                anew = status.serve(frozenset(bytes(info.endpoint_gid) for info in found))
                if status is self._status:
                    self._there_s = min(self._there_s, time.monotonic()) if found else math.inf
            if anew or action not in self._subscriptions:
                try:
                    self._subscribe(action)
                except RuntimeError as error:  # security permits the actions that its policy names
                    text = f"goals of other clients by {action} are not seen: {error}"
                    self._node.get_logger().warning(text, once=True)

    def _drivers(self) -> set[str]:
        """Names of this action and of all other actions of its navigation that drive the robot, too.

        The node that serves it may serve others, below it or in its namespace: policies, ways through poses.
        """
        namespace = self._name.rpartition("/")[0]
        found = {*self._lists}
        for info in self._node.get_publishers_info_by_topic(f"{self._name}{_LIST}"):
            given = info.node_name, info.node_namespace
            with contextlib.suppress(RuntimeError):  # the node has just gone
                for topic, kinds in self._node.get_publisher_names_and_types_by_node(*given):
                    action = topic.removesuffix(_LIST)
                    near = action.rpartition("/")[0] == namespace or action.startswith(f"{self._name}/")
                    if near and action != topic and "action_msgs/msg/GoalStatusArray" in kinds:
                        found.add(action)
        return found

    def _subscribe(self, action: str) -> None:
        """Subscribe to the lists of an action, again if the last ones of its servers are to come once more."""
        if action in self._subscriptions:
            self._node.destroy_subscription(self._subscriptions[action])
        take = partial(self._on_list, self._lists[action])
        self._subscriptions[action] = self._node.create_subscription(
            GoalStatusArray, f"{action}{_LIST}", take, LATCHED, event_callbacks=NO_EVENTS
        )

    def _on_list(self, status: ActionStatus, message: GoalStatusArray) -> None:
        with self._lock:
            status.take({bytes(each.goal_info.goal_id.uuid): each.status for each in message.status_list})
        self._tick()

    # What the action's messages contain ----------------------------------------------------------------------

    def goals(self, stop: Stop, way: Way) -> tuple[WayPoint, ...]:
        """Goals of the action for a route, one after the other."""
        return way_points(way.corners, stop)

    @abstractmethod
    def goal_message(self, point: WayPoint) -> Any:
        """Goal of the action."""

    @abstractmethod
    def heard(self, message: Any) -> str:
        """Feedback of the action, in words."""

    @abstractmethod
    def verdict(self, result: Any) -> tuple[bool, str]:
        """True if a result reports the arrival, and what it says about a failure."""

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
        identity = UUID(uuid=list(self._status.new_identity()))
        self._ids.pop(request.goal_id, None)  # a goal that is sent again becomes the latest
        self._ids[request.goal_id] = identity
        if len(self._ids) > KEPT_GOALS:
            del self._ids[next(iter(self._ids))]
        future = self._actions.send_goal_async(self.goal_message(request.point), self._on_feedback, identity)
        future.add_done_callback(partial(self._answered, request.goal_id))

    def _on_feedback(self, message: Any) -> None:
        self._heard = time.monotonic(), self._track.now_s
        self._said = self.heard(message)

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
        identity = self._ids.get(request.goal_id)
        if identity is not None:
            self._call_cancel(request, identity)
        elif request.goal_id == ANYBODYS:
            self._call_cancel(request, UUID(), _UNKNOWN)
        else:
            self._cancel_before(request)

    def _cancel_before(self, request: CancelSent) -> None:
        """Cancel the goals of before this process, and nobody else's."""
        with self._lock:
            known, before = self._status.known, self._status.before
            waits = not known and time.monotonic() - self._there_s < LIST_WAIT_S
        if waits:
            return  # it is asked again
        if not known:  # no list: the server has had no goal, or hides them
            self._call_cancel(request, UUID(), _UNKNOWN)
        elif not before:
            self._step(self._client.cancel_answered, request.goal_id, _UNKNOWN, then=(request.accepted,))
        for goal in before:
            code = None if len(before) == 1 else CancelGoal.Response.ERROR_NONE  # the list tells when all are over
            self._call_cancel(request, UUID(uuid=list(goal)), code)

    def _call_cancel(self, request: CancelSent, identity: UUID, code: int | None = None) -> None:
        """Cancel a goal, or all without an identity; a code stands for the answer where it is not that of one."""
        question = CancelGoal.Request()
        question.goal_info.goal_id = identity
        self._cancels.call_async(question).add_done_callback(partial(self._cancel_answered, request, code))

    def _cancel_answered(self, request: CancelSent, code: int | None, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            code = int(answer.return_code) if code is None else code
            self._step(self._client.cancel_answered, request.goal_id, code, then=(request.accepted,))


def action_class(name: str, field: str) -> Any:
    """Class of an action; imported only here, so that the package installs without it."""
    remedy = "source the workspace of the navigation, built for this ROS and Python, or set another navigator"
    package, _, rest = name.partition("/")
    if not package or not rest.startswith("action/") or name.count("/") > 2:
        raise InputError(f"{name!r} is not the type of an action", "write PACKAGE/action/NAME")
    try:
        found = interface_class(name)
    except ImportError as error:
        raise InputError(f"the action type {name!r} cannot be used: {error}", remedy) from None
    if not (hasattr(found, "Goal") and hasattr(found.Goal(), field)):
        raise InputError(
            f"goals of {name!r} have no field {field!r}", "set the navigator that goes with this action_type"
        )
    return found
