# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The robot as it truly moves, and navigation servers that drive it where they are sent, with faults.

Nothing here knows the fence, the mission or the fixes: the servers localise the robot by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults

Array = NDArray[np.float64]
Place = tuple[float, float]

REACTION_S = 1.0
"""Time until a goal that needs no motion ends [s]."""


class Driven:
    """A robot that drives along a polyline, and stops at once.

    :param place: where it is [m]
    :param speed_mps: its speed [m/s]
    """

    def __init__(self, place: Place, speed_mps: float) -> None:
        self.place = place
        self.speed_mps = speed_mps
        self.way: list[Place] = []
        self.odometer_m = 0.0

    @property
    def drives(self) -> bool:
        """Whether it is on a way."""
        return bool(self.way)

    def go(self, way: list[Place]) -> None:
        """Drive along these corners, from where it is."""
        self.way = list(way)

    def stop(self) -> None:
        """Stay here."""
        self.way = []

    def advance(self, for_s: float) -> list[Place]:
        """Drive for a time [s]; returns the places passed, the last one included."""
        passed = []
        left_m = self.speed_mps * for_s
        while self.way and left_m > 0:
            away_m = math.dist(self.place, self.way[0])
            if away_m <= left_m:
                self.place, left_m = self.way.pop(0), left_m - away_m
                self.odometer_m += away_m
            else:
                share = left_m / away_m
                x, y = self.place
                self.place = (x + share * (self.way[0][0] - x), y + share * (self.way[0][1] - y))
                self.odometer_m += left_m
                left_m = 0.0
            passed.append(self.place)
        return passed


class Status(IntEnum):
    """Final states of a goal, as action_msgs numbers them."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


@dataclass(frozen=True, slots=True)
class Answered:
    """The server accepts or rejects a goal."""

    goal: int
    accepted: bool


@dataclass(frozen=True, slots=True)
class GoalOver:
    """A goal has ended for the server."""

    goal: int
    status: Status
    success: bool


@dataclass(frozen=True, slots=True)
class CancelAnswered:
    """The server answers a cancellation, with a code as action_msgs numbers it."""

    goal: int
    code: int


Reply = Answered | GoalOver | CancelAnswered
NO_ERROR, REJECTED, UNKNOWN_GOAL = 0, 1, 2


@dataclass
class _Active:
    goal: int
    end: Place
    begun_s: float
    at_once: Status | None = None
    cancelled_s: float = math.inf


class ActionServer:
    """A navigation server of one action; it works on one goal, and a new goal replaces it.

    :param robot: what it drives
    :param route: corners of the way from a place to a target; ``None`` if it knows none
    :param faults: what goes wrong when
    """

    def __init__(
        self, robot: Driven, route: Callable[[Place, str | Place], list[Place] | None], faults: Faults
    ) -> None:
        self._robot = robot
        self._route = route
        self._faults = faults
        self._goals = 0
        self._active: _Active | None = None
        self._replies: list[tuple[float, Reply]] = []
        self._brake_s = math.inf
        self._dead = False
        self._others: set[int] = set()
        self.lives = 1
        """How often it was started."""
        self.replaced = 0
        """Goals that were replaced by another before they had ended."""

    def present(self, now_s: float) -> bool:
        """Whether the server can be seen."""
        return not self._faults.on(Fault.SERVER_DEAD, now_s)

    @property
    def active(self) -> bool:
        """Whether it works on a goal."""
        return self._active is not None

    @property
    def others(self) -> bool:
        """Whether it works on a goal of another client than the planner."""
        return self._active is not None and self._active.goal in self._others

    def lists(self, goal: int) -> bool:
        """Whether its list has a goal as active."""
        return self._active is not None and self._active.goal == goal

    def send(self, target: str | Place, now_s: float, other: bool = False) -> int:
        """Send a goal; returns its number. The answer comes with :meth:`step`.

        :param target: where to
        :param now_s: time [s]
        :param other: whether another client than the planner sends it
        """
        self._goals += 1
        goal = self._goals
        if other:
            self._others.add(goal)
        if not self.present(now_s):
            return goal  # nobody hears it
        way = self._route(self._robot.place, target)
        if self._active is not None:
            self.replaced += 1
            self._over(now_s, Status.ABORTED, success=False)
        self._later(now_s, Answered(goal, accepted=True))
        end = self._robot.place if way is None else way[-1]
        self._active = active = _Active(goal, end, now_s)
        if way is None or self._faults.on(Fault.SERVER_ABORTS, now_s):
            active.at_once = Status.ABORTED
        elif self._faults.on(Fault.SERVER_LIES, now_s):
            active.at_once = Status.SUCCEEDED
        elif not self._faults.on(Fault.SERVER_HANGS, now_s):
            self._robot.go(way)
        return goal

    def cancel(self, goal: int | None, now_s: float, anybodys: bool = False) -> None:
        """Cancel a goal; nothing happens while the server is dead.

        :param goal: the goal; ``None`` for what the planner has sent
        :param now_s: time [s]
        :param anybodys: also what another client has sent
        """
        if not self.present(now_s):
            return
        known = self._active is not None and goal in (None, self._active.goal) and (anybodys or not self.others)
        deaf = known and self._faults.on(Fault.SERVER_DEAF, now_s)
        self._later(now_s, CancelAnswered(goal or 0, REJECTED if deaf else NO_ERROR if known else UNKNOWN_GOAL))
        if known and not deaf and self._active is not None:
            self._active.cancelled_s = min(now_s, self._active.cancelled_s)

    def step(self, now_s: float) -> list[Reply]:
        """Look after the goal; what the client hears until now."""
        if self._faults.on(Fault.SERVER_DEAD, now_s):
            if self._active is not None and not self._faults.on(Fault.RUNAWAY, now_s):
                self._robot.stop()
            self._active, self._replies, self._dead = None, [], True
            return []
        if self._dead:
            self._robot.stop()  # it starts anew
            self._dead = False
            self.lives += 1
        active = self._active
        if active is not None:
            runs_on_s = 8.0 if self._faults.on(Fault.RUNS_ON, now_s) else 0.5
            if now_s >= active.cancelled_s + 0.5:
                self._over(now_s, Status.CANCELED, success=False, stop=runs_on_s < 1)
                self._brake_s = active.cancelled_s + runs_on_s
            elif active.at_once is not None and now_s >= active.begun_s + REACTION_S:
                self._over(now_s, active.at_once, success=active.at_once is Status.SUCCEEDED)
            elif active.at_once is None and not self._robot.drives and self._robot.place == active.end:
                self._over(now_s, Status.SUCCEEDED, success=True)
        elif now_s >= self._brake_s:
            self._robot.stop()
            self._brake_s = math.inf
        heard = [reply for due_s, reply in self._replies if due_s <= now_s]
        self._replies = [(due_s, reply) for due_s, reply in self._replies if due_s > now_s]
        return heard

    def _over(self, now_s: float, status: Status, success: bool, stop: bool = True) -> None:
        assert self._active is not None
        if stop:
            self._robot.stop()
        self._later(now_s, GoalOver(self._active.goal, status, success))
        self._active = None

    def _later(self, now_s: float, reply: Reply) -> None:
        self._replies.append((now_s + 0.4, reply))


class PoseListener:
    """A toy that drives straight to the newest pose it hears; nothing answers.

    :param robot: what it drives
    :param faults: what goes wrong when
    """

    def __init__(self, robot: Driven, faults: Faults) -> None:
        self._robot = robot
        self._faults = faults

    def present(self, now_s: float) -> bool:
        """Whether somebody subscribes to poses."""
        return not self._faults.on(Fault.SERVER_DEAD, now_s)

    def send(self, place: Place, now_s: float) -> None:
        """A new pose."""
        if self.present(now_s) and not self._faults.on(Fault.SERVER_DEAF, now_s):
            self._robot.go([place])

    def step(self, now_s: float) -> None:
        """A dead listener stops the robot, unless it runs away."""
        if not self.present(now_s) and not self._faults.on(Fault.RUNAWAY, now_s):
            self._robot.stop()


def graph_route(graph: TravelGraph) -> Callable[[Place, str | Place], list[Place] | None]:
    """Routes of a topological navigation: it goes to the node nearest to the robot, then along its own edges."""

    def route(place: Place, target: str | Place) -> list[Place] | None:
        if not isinstance(target, str) or target not in graph.names:
            return None
        entry = graph.nearest(place)
        names = graph.path(entry, target)
        if not names or entry == target:
            return None  # the server aborts a goal whose target is the closest node
        corners = [(float(x), float(y)) for x, y in graph.xy[[graph.index(name) for name in names]]]
        # An edge is entered from where the robot stands on it.
        return corners[1:] if _is_between(place, corners[0], corners[1]) else corners

    return route


def straight_route(place: Place, target: str | Place) -> list[Place] | None:
    """Way of a navigation that drives straight to a pose."""
    return None if isinstance(target, str) else [target]


def _is_between(place: Place, start: Place, end: Place) -> bool:
    whole = math.dist(start, end)
    return whole > 0 and math.dist(place, start) + math.dist(place, end) < whole + 0.01
