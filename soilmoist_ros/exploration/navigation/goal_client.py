# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rules of a client of a navigation that is a ROS action, without the messages.

The answers of such a navigation cannot all be believed:

* Versions differ in how a cancelled goal ends. So any end is the end, and of the answers to a cancellation only
  "no such goal" counts.
* A goal that was replaced, or needs no driving, ends well without a motion. So the robot has arrived only if the
  status is good, the result says so, *and* a later position agrees.
* Goals share their state in the server. So a goal is sent only after the end of the one before is known.
* The server may come late, die, or not answer. So everything has a time limit, and a goal without a known end is
  cancelled again until the server says that it is over or unknown.
* A server may drive before its acceptance is heard. So a goal without an answer is cancelled at once, and again
  when it is accepted.
* Two servers of one name would both drive the robot. So no goal is sent until one is left.
* Other clients come first. While the server works on their goal none is sent, and an end for it is no failure.
* A result may be lost. So a cancelled goal is over, too, when the server lists it as ended, or is a new one.

Way points are goals for the server, one after the other. The robot passes each closely: a turn begun early would
cut the corner of a no-go area.
"""

from __future__ import annotations

import hashlib
import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from types import MappingProxyType
from typing import Final

from soilmoist_ros.exploration.mission.events import ANYBODYS
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop, WayPoint

START_S = 30.0  # time for the server to appear, and for the goal before to end [s]
ANSWER_S = 10.0  # time in which the server accepts or rejects a goal [s]
LOST_S = 5.0  # the server may be away for this time in mid-goal [s]
POSITION_S = 30.0  # time for a position that agrees, after the server reported the arrival [s]
MAX_POSITIONS = 10  # as many positions that do not agree settle it sooner
CANCEL_AGAIN_S = 2.0  # time after which a goal that does not end is cancelled again [s]
UNENDED_S = 10.0  # time after its cancellation from which a goal without an end is reported [s]
NEW_SERVER_S = 2.0  # time in which a server that was started again lists its goals, or is asked about them [s]
SUPERSEDED = "another client drives the robot: its goal has replaced that of the planner"
CANCELLED = "the watchdog or another client has cancelled the goal of the planner"


class GoalStatus(IntEnum):
    """Final states of a goal, as action_msgs numbers them."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class CancelAnswer(IntEnum):
    """Answers to a cancellation that prove that the goal is not running, as action_msgs numbers them."""

    UNKNOWN_GOAL = 2
    ALREADY_ENDED = 3


@dataclass(frozen=True, slots=True)
class SendGoal:
    """Send the robot there; the answers go to :meth:`GoalClient.answered` and :meth:`GoalClient.ended`."""

    goal_id: int
    point: WayPoint


@dataclass(frozen=True, slots=True)
class CancelSent:
    """Ask the server to cancel this goal; tell :meth:`GoalClient.cancel_answered`."""

    goal_id: int
    ours: bool  # whether this client sent it; otherwise it is one of before this process, or anybody's
    accepted: bool = True  # whether the server had accepted it before; otherwise it may not know it yet


Request = SendGoal | CancelSent | Ended  # what a client asks for, and what it reports


@dataclass(frozen=True, slots=True)
class Listed:
    """Goals of this and other clients that the servers of the action list.

    :param servers: their names, which change when they are started again; empty if unknown
    """

    servers: frozenset[bytes] = frozenset()
    active: frozenset[int] = frozenset()  # goals of this client that are listed as active
    ended: frozenset[int] = frozenset()  # goals of this client that are listed as ended
    others: bool = False  # whether the server works on a goal of another client


_NOTHING = Listed()


class _GoalStep(Enum):
    WAITING = auto()  # not sent
    SENT = auto()  # neither accepted nor rejected
    ACTIVE = auto()
    CHECKING = auto()  # over for the server; the position is missing


@dataclass
class _ActionGoal:
    goal_id: int
    ahead: tuple[WayPoint, ...]  # the next one first; empty for goals of another process
    step: _GoalStep
    since_s: float
    cancel: bool = False
    asked_s: float = -math.inf
    cancelled_s: float = math.inf  # time of the first cancellation [s]
    servers: frozenset[bytes] = frozenset()  # servers that were there when it was sent
    renewed_s: float = math.inf  # since when there are others only
    heard: bool = False  # the server knows of the cancellation
    reported: bool = False
    away_m: float = math.nan
    positions: int = 0


class GoalClient:
    """Takes goals one at a time through the server. Each method gives what is to be done now, in order.

    Times are on a clock that runs with the messages, not a simulated one.

    :param radius_m: the robot is at a stop within this distance [m]
    """

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._goals: dict[int, _ActionGoal] = {}  # those that may still run, also when their end has been reported
        self._servers = 0
        self._server_seen_s = self._now_s = -math.inf
        self._listed = _NOTHING
        self._out: list[Request] = []

    def go(
        self, goal_id: int, ahead: tuple[WayPoint, ...], now_s: float, there: bool = False
    ) -> tuple[Request, ...]:
        """A new goal; it is sent when the server is there and the end of all others is known.

        :param there: whether the robot stands at the stop, so that nothing needs to be sent
        """
        for goal in list(self._goals.values()):
            if not goal.reported:
                self._give_up(goal, Outcome.CANCELED, "replaced by another goal", now_s)
        goal = _ActionGoal(goal_id, ahead, _GoalStep.WAITING, now_s)
        if there and not self._goals:
            self._report(goal, Outcome.SUCCEEDED, f"already at {ahead[-1].stop.name}")
        else:
            self._goals[goal_id] = goal
        return self._go_on(now_s)

    def cancel(self, goal_id: int, now_s: float) -> tuple[Request, ...]:
        """Cancel a goal; its end is reported when the server reports it."""
        goal = self._goals.get(goal_id)
        if goal is None:
            goal = self._goals[goal_id] = _ActionGoal(goal_id, (), _GoalStep.ACTIVE, now_s)
        goal.cancel = True
        if goal.step is _GoalStep.WAITING:
            self._over(goal, Outcome.CANCELED, "cancelled before it was sent")
        elif goal.step is _GoalStep.CHECKING:
            self._over(goal, Outcome.CANCELED, "cancelled after the navigation had ended")
        return self._go_on(now_s)

    def answered(self, goal_id: int, accepted: bool, now_s: float) -> tuple[Request, ...]:
        """The server has accepted or rejected a goal."""
        goal = self._goals.get(goal_id)
        if goal is None:  # given up long ago; it must not run on unnoticed
            goal = _ActionGoal(goal_id, (), _GoalStep.SENT, now_s, cancel=True, reported=True)
            self._goals[goal_id] = goal
        if accepted:
            goal.step, goal.since_s, goal.asked_s = _GoalStep.ACTIVE, now_s, -math.inf
        else:
            self._over(goal, Outcome.FAILED, "the navigation rejected the goal")
        return self._go_on(now_s)

    def ended(self, goal_id: int, status: int, success: bool, now_s: float, why: str = "") -> tuple[Request, ...]:
        """The server has reported the end of a goal.

        :param why: what the result says about a failure, for operators
        """
        goal = self._goals.get(goal_id)
        if goal is None:
            return self._go_on(now_s)
        if goal.cancel:
            self._over(goal, Outcome.CANCELED, f"cancelled; the navigation {_said(status, success, '')}")
        elif status == GoalStatus.SUCCEEDED and success:
            goal.step, goal.since_s = _GoalStep.CHECKING, now_s
        elif status == GoalStatus.CANCELED:  # not by this client: somebody wants the robot to stand
            replaced = self._listed.others
            outcome, said = (Outcome.SUPERSEDED, SUPERSEDED) if replaced else (Outcome.STOPPED, CANCELLED)
            self._over(goal, outcome, said)
        else:
            self._fail(goal, f"the navigation {_said(status, success, why)}")
        return self._go_on(now_s)

    def refuse(self, goal_id: int, reason: str, now_s: float) -> tuple[Request, ...]:
        """The goal has failed by what the server announces; it is cancelled until its end is known."""
        goal = self._goals.get(goal_id)
        if goal is not None and not goal.reported:
            self._give_up(goal, Outcome.FAILED, reason, now_s)
        return self._go_on(now_s)

    def cancel_answered(self, goal_id: int, code: int, now_s: float, accepted: bool = True) -> tuple[Request, ...]:
        """The server has answered a cancellation.

        :param code: as action_msgs numbers it
        :param accepted: that of the :class:`CancelSent`
        """
        goal = self._goals.get(goal_id)
        if goal is None:
            return self._go_on(now_s)
        not_running = code in (CancelAnswer.UNKNOWN_GOAL, CancelAnswer.ALREADY_ENDED)
        if accepted or not not_running:
            goal.heard = True
        # an answer to the goal itself may still be on its way, or have overtaken this one
        given_up = goal.step is _GoalStep.SENT and goal.reported
        if not_running and (given_up or (goal.step is _GoalStep.ACTIVE and accepted)):
            self._over(goal, Outcome.CANCELED, "cancelled; the navigation is not working on it any more")
        return self._go_on(now_s)

    def moved(self, place: tuple[float, float], now_s: float) -> tuple[Request, ...]:
        """The robot is here [m]."""
        for goal in list(self._goals.values()):
            if goal.step is _GoalStep.CHECKING and goal.ahead:
                stop = goal.ahead[0].stop
                goal.away_m = math.dist(place, (stop.x_m, stop.y_m))
                goal.positions += 1
                if goal.away_m <= min(self._radius_m, stop.reach_m):
                    self._arrived(goal, stop, now_s)
        return self._go_on(now_s)

    def tick(self, servers: int, now_s: float, listed: Listed = _NOTHING) -> tuple[Request, ...]:
        """Time has passed; number of servers that are there now, and what they list."""
        self._servers, self._listed = servers, listed
        if servers:
            self._server_seen_s = now_s
        return self._go_on(now_s)

    @property
    def stop_unheard(self) -> bool:
        """True if the server may not have heard of a cancellation yet."""
        return self._servers > 0 and any(goal.cancel and not goal.heard for goal in self._goals.values())

    @property
    def unended(self) -> str:
        """Goal that was cancelled long ago and whose end is not known, in words; empty without one."""
        for goal in self._goals.values():
            if self._now_s - goal.cancelled_s >= UNENDED_S:
                return f"the goal to {goal.ahead[0].stop.name}" if goal.ahead else "a goal of before"
        return ""

    @property
    def cancels_before(self) -> bool:
        """True while goals of an earlier process of this client are being cancelled."""
        return any(not goal.ahead and goal.goal_id != ANYBODYS for goal in self._goals.values())

    # What follows --------------------------------------------------------------------------------------------

    def _arrived(self, goal: _ActionGoal, stop: Stop, now_s: float) -> None:
        if len(goal.ahead) == 1:
            self._over(goal, Outcome.SUCCEEDED, f"{goal.away_m:.1f} m from {stop.name}")
        else:
            goal.ahead, goal.step, goal.since_s = goal.ahead[1:], _GoalStep.WAITING, now_s
            goal.away_m, goal.positions = math.nan, 0

    def _go_on(self, now_s: float) -> tuple[Request, ...]:
        self._now_s = now_s
        for goal in list(self._goals.values()):
            self._read_list(goal, now_s)
            self._meet_limits(goal, now_s)
        for goal in self._goals.values():
            on_server = goal.step in (_GoalStep.SENT, _GoalStep.ACTIVE)
            if goal.cancel and on_server and self._servers and now_s - goal.asked_s >= CANCEL_AGAIN_S:
                goal.asked_s, goal.cancelled_s = now_s, min(goal.cancelled_s, now_s)
                self._out.append(CancelSent(goal.goal_id, bool(goal.ahead), goal.step is _GoalStep.ACTIVE))
        if self._servers == 1 and len(self._goals) == 1 and not self._listed.others:
            goal = next(iter(self._goals.values()))
            if goal.step is _GoalStep.WAITING:
                goal.step, goal.since_s = _GoalStep.SENT, now_s
                goal.servers, goal.renewed_s = self._listed.servers, math.inf
                self._out.append(SendGoal(goal.goal_id, goal.ahead[0]))
        out, self._out = tuple(self._out), []
        return out

    def _read_list(self, goal: _ActionGoal, now_s: float) -> None:
        """End a goal that the server lists as ended, or that another server cannot know."""
        listed, known = self._listed, goal.goal_id in self._listed.active
        if goal.step not in (_GoalStep.SENT, _GoalStep.ACTIVE):
            return
        if goal.cancel and goal.goal_id in listed.ended:
            self._over(goal, Outcome.CANCELED, "cancelled; the navigation lists it as ended")
        elif known or not goal.servers or not listed.servers or goal.servers & listed.servers:
            goal.renewed_s = math.inf
        elif goal.renewed_s == math.inf:
            goal.renewed_s = now_s
        elif now_s - goal.renewed_s >= NEW_SERVER_S:
            if goal.cancel:
                self._over(goal, Outcome.CANCELED, "cancelled; the navigation was started again since")
            else:
                self._give_up(goal, Outcome.FAILED, "the navigation was started again", now_s)

    def _meet_limits(self, goal: _ActionGoal, now_s: float) -> None:
        if goal.reported:
            return
        waited_s = now_s - goal.since_s
        on_server = goal.step in (_GoalStep.SENT, _GoalStep.ACTIVE)
        if goal.step is _GoalStep.WAITING and waited_s > START_S:
            why = "is not there"
            if self._servers:
                why = "does not end the goal before: cancel it there, or start the navigation again"
                why = why if self._servers == 1 else f"has {self._servers} servers"
            self._fail(goal, f"the navigation {why} (waited {START_S:.0f} s)")
        elif on_server and now_s - max(self._server_seen_s, goal.since_s) > LOST_S:
            self._give_up(goal, Outcome.FAILED, "the navigation has gone away", now_s)
        elif goal.step is _GoalStep.SENT and waited_s > ANSWER_S:
            reason = f"the navigation neither accepts nor rejects the goal in {ANSWER_S:.0f} s"
            self._give_up(goal, Outcome.FAILED, reason, now_s)
        elif goal.step is _GoalStep.CHECKING and (waited_s > POSITION_S or goal.positions >= MAX_POSITIONS):
            found = f"the robot is {goal.away_m:.1f} m away from it"
            if math.isnan(goal.away_m):
                found = f"no position came in {POSITION_S:.0f} s"
            self._fail(goal, f"reported as reached, but {found}")

    def _fail(self, goal: _ActionGoal, reason: str) -> None:
        """End a goal that did not lead to its stop; no failure if another client's goal has replaced it."""
        replaced = self._listed.others
        self._over(goal, *((Outcome.SUPERSEDED, SUPERSEDED) if replaced else (Outcome.FAILED, reason)))

    def _over(self, goal: _ActionGoal, outcome: Outcome, reason: str) -> None:
        """End a goal on which the server does not work any more, or never did."""
        self._goals.pop(goal.goal_id, None)
        self._report(goal, outcome, reason)

    def _give_up(self, goal: _ActionGoal, outcome: Outcome, reason: str, now_s: float) -> None:
        """End a goal for the mission on which the server may still work."""
        self._report(goal, outcome, reason)
        if goal.step in (_GoalStep.SENT, _GoalStep.ACTIVE):
            goal.cancel, goal.since_s = True, now_s
        else:
            del self._goals[goal.goal_id]

    def _report(self, goal: _ActionGoal, outcome: Outcome, reason: str) -> None:
        if not goal.reported:
            goal.reported = True
            self._out.append(Ended(goal.goal_id, outcome, reason))


def _said(status: int, success: bool, why: str) -> str:
    because = f": {why}" if why else ""
    match status:
        case GoalStatus.SUCCEEDED:
            return "reported the arrival" if success else f"ended the goal without success{because}"
        case GoalStatus.CANCELED:
            return "cancelled the goal"
        case GoalStatus.ABORTED:
            return f"aborted the goal{because}"
        case _:
            return f"ended the goal with the unknown status {status}"


# Goals that the server of an action lists, and whose they are ---------------------------------------------------

ACTIVE: Final = frozenset((1, 2, 3))
"""States of a goal that is accepted, executing or being cancelled, as action_msgs numbers them."""
ENDED: Final = frozenset((4, 5, 6))  # states of a goal that has succeeded, was cancelled or was aborted
_MARK, _PROCESS = 8, 12


def goal_mark(client: str) -> bytes:
    """Bytes with which the identities of a client's goals begin, by the name of the client."""
    return hashlib.sha256(f"soilmoist_ros {client}".encode()).digest()[:_MARK]


class ActionStatus:
    """Goals that the servers of an action list, by client.

    A server publishes its list whenever a goal changes, latched. So a list counts only while the server that sent
    it is there: the last words of one that has died say nothing. One that never had a goal has published none.

    The identities of goals begin with a mark of the client, then one of its process. So a client that was started
    again knows the goals of its earlier life.

    :param client: name of the client, which stays the same when it is started again
    """

    def __init__(self, client: str) -> None:
        self._mark = goal_mark(client)
        self._own = self._mark + uuid.uuid4().bytes[: _PROCESS - _MARK]
        self._sent = 0
        self._goals: dict[bytes, int] = {}
        self.known = False
        """True if a list of a server that is there has come."""
        self.servers: frozenset[bytes] = frozenset()
        """Names of the publishers of lists; a server that is started again has another one."""

    def new_identity(self) -> bytes:
        """The identity of a goal to send: 16 bytes, never the same."""
        self._sent += 1
        return self._own + self._sent.to_bytes(16 - _PROCESS, "big")

    def take(self, goals: Mapping[bytes, int]) -> None:
        """A list has come: states of goals by identity. It is the whole of one server."""
        self._goals = {**(self._goals if len(self.servers) > 1 else {}), **goals}
        self.known = True

    def serve(self, servers: frozenset[bytes]) -> bool:
        """Set the servers that are there now; true if one has gone, so that lists must be fetched again."""
        lost, self.servers = self.servers - servers, servers
        if lost:
            self._goals, self.known = {}, False
        return bool(lost and servers)

    def state(self, identity: bytes) -> int:
        """State of a goal; 0 if it is not listed."""
        return self._goals.get(identity, 0)

    @property
    def before(self) -> tuple[bytes, ...]:
        """Active goals of this client from before it was started again."""
        return tuple(goal for goal in self._active if goal.startswith(self._mark))

    @property
    def others(self) -> tuple[bytes, ...]:
        """Active goals of other clients."""
        return tuple(goal for goal in self._active if not goal.startswith(self._mark))

    @property
    def _active(self) -> list[bytes]:
        """Active goals that this process has not sent."""
        return [goal for goal, state in self._goals.items() if state in ACTIVE and not goal.startswith(self._own)]


# Numbers of Nav2 in words: error codes of its actions, and feedback on the way ----------------------------------

_CAUSES: Final[Mapping[int, str]] = MappingProxyType({
    1: "a server of Nav2 rejected the goal", 2: "a server of Nav2 cannot be reached",
    101: "there is no such controller", 102: "a transform is missing", 103: "the path is invalid",
    104: "no valid command for too long", 105: "the robot made no progress", 106: "no command avoids a collision",
    107: "the controller did not answer in time", 108: "it took too long",
    201: "there is no such planner", 202: "a transform is missing", 203: "the robot is off Nav2's map",
    204: "the stop is off Nav2's map", 205: "the robot is in an obstacle", 206: "the stop is in an obstacle",
    207: "the planner took too long", 208: "no path leads to the stop",
    401: "a transform is missing", 402: "the Route Server has no graph",
    403: "no node of its graph is near the robot or the stop", 404: "it took too long",
    405: "no route of its graph leads to the stop", 406: "an operation on the way failed",
    407: "a scorer of its edges cannot be used",
    9001: "its behaviour tree cannot be loaded", 9002: "a transform is missing", 9003: "it took too long",
})  # fmt: skip
"""Error codes of driving to a pose, of paths and of routes in nav2_msgs 1.3 (Jazzy) to 1.5."""


def failure(code: int, text: str = "") -> str:
    """Failure that the result of a goal reports, in words for operators.

    :param code: error code of the result; 0 if it has none
    """
    if code == 0:
        return text
    return f"{_CAUSES.get(code, 'unknown cause')} (Nav2 error {code}{f': {text}' if text else ''})"


def progress(remaining_m: float, recoveries: int) -> str:
    """Feedback in words; empty if there is nothing to say.

    :param remaining_m: length of the path ahead, nan if it is not known [m]
    :param recoveries: recoveries since the goal began
    """
    ahead = [f"{remaining_m:.1f} m to go"] if math.isfinite(remaining_m) else []
    return ", ".join([*ahead, *([f"recoveries: {recoveries}"] if recoveries else [])])
