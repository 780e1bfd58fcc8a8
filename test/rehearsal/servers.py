# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The robot as it truly moves, and navigation servers that drive it where they are sent, with faults.

Nothing here knows the fence, the mission or the fixes: the servers localise the robot by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from rehearsal.cases import Fault, Faults, Ground, Place, Span
from soilmoist_ros.exploration import TravelGraph
from soilmoist_ros.exploration.navigation.goal_client import GoalStatus as Status

Array = NDArray[np.float64]

REACTION_S = 1.0  # time until a goal that needs no motion ends [s]


class Driven:
    """A robot that drives along a polyline, and stops at once."""

    def __init__(self, place: Place, speed_mps: float) -> None:
        self.place = place
        self.speed_mps = speed_mps
        self.way: list[Place] = []  # corners ahead [m]
        self.right: list[Place] = []  # the way that it was asked for, from where it set off [m]; empty without one
        self.astray = False  # its way is another one than that
        self.by_hand = self.arrived = False  # people drive it; it is there
        self.error: Place = (0.0, 0.0)  # error of the place by which it navigates [m]
        self.odometer_m = 0.0

    @property
    def drives(self) -> bool:
        return bool(self.way)

    @property
    def believed(self) -> Place:
        """Where it believes to be [m]."""
        return self.place[0] + self.error[0], self.place[1] + self.error[1]

    def go(self, way: list[Place], instead_of: list[Place] | None = None, by_hand: bool = False) -> None:
        """Drive along these corners from where it is, instead of those that were asked for."""
        right = way if instead_of is None else instead_of
        self.astray, self.right = way != right, [self.believed, *right]
        self.way, self.arrived, self.by_hand = list(way), False, by_hand

    def turn(self, way: list[Place]) -> None:
        """Drive along other corners from now on than those that are ahead."""
        self.astray |= way != self.way
        self.way = list(way)

    def stop(self) -> None:
        self.way, self.right, self.astray, self.by_hand, self.arrived = [], [], False, False, False

    def advance(self, for_s: float) -> list[Place]:
        """Drive for a time [s]; returns the places passed, the last one included."""
        passed = []
        left_m = self.speed_mps * for_s
        while self.way and left_m > 0:
            corner = self.way[0][0] - self.error[0], self.way[0][1] - self.error[1]
            away_m = math.dist(self.place, corner)
            if away_m <= left_m:
                self.place, left_m = corner, left_m - away_m
                self.odometer_m += away_m
                self.way.pop(0)
                if not self.way:
                    self.right, self.astray, self.by_hand, self.arrived = [], False, False, True
            else:
                share = left_m / away_m
                x, y = self.place
                self.place = (x + share * (corner[0] - x), y + share * (corner[1] - y))
                self.odometer_m += left_m
                left_m = 0.0
            passed.append(self.place)
        return passed

    def push(self, by: Place) -> list[Place]:
        """Be moved without driving [m]; returns the place as :meth:`advance` does."""
        if by == (0.0, 0.0):
            return []
        self.place = self.place[0] + by[0], self.place[1] + by[1]
        return [self.place]


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
    begun_s: float
    foreign: bool = False
    at_once: Status | None = None
    cancelled_s: float = math.inf


class ActionServer:
    """A navigation server of one action; it works on one goal, and a new goal replaces it."""

    def __init__(
        self,
        robot: Driven,
        route: Callable[[Place, str | Place], list[Place] | None],
        faults: Faults,
        misled: Misled | None = None,
    ) -> None:
        self._robot = robot
        self._misled = misled
        self._route = route
        self._faults = faults
        self._goals = 0
        self._active: _Active | None = None
        self._replies: list[tuple[float, Reply]] = []
        self._brake_s = math.inf
        self._dead = False
        self.lives = 1
        """How often it was started."""
        self.overridden: str = ""
        """What the mission did against the goal of somebody else; empty if nothing."""

    def present(self, now_s: float) -> bool:
        return not self._faults.on(Fault.SERVER_DEAD, now_s)

    @property
    def active(self) -> bool:
        return self._active is not None

    def is_known(self, now_s: float) -> bool:
        """Whether it works on a goal of which the mission can know: not of somebody else's in the same second."""
        return self._active is not None and not (self._active.foreign and self._active.begun_s == now_s)

    @property
    def others(self) -> bool:
        """Whether it works on a goal of somebody else."""
        return self._active is not None and self._active.foreign

    def lists(self, goal: int) -> bool:
        return self._active is not None and self._active.goal == goal

    def send(self, target: str | Place, now_s: float, foreign: Status | None = None) -> int:
        """Send a goal; returns its number. The answer comes with :meth:`step`.

        :param target: name of a node, or a place [m]
        :param foreign: for a goal of somebody else the status with which a goal of the mission ends
        """
        self._goals += 1
        goal = self._goals
        if not self.present(now_s):
            return goal  # nobody hears it
        way = self._route(self._robot.believed, target)
        if self._active is not None:
            theirs = self._active.foreign and foreign is None
            if theirs and self.is_known(now_s):
                self.overridden = "goal sent"
            ended = foreign or Status.ABORTED
            self._over(now_s, ended, success=ended is Status.SUCCEEDED)
        self._later(now_s, Answered(goal, accepted=True))
        self._active = active = _Active(goal, now_s, foreign is not None)
        if foreign is not None:
            self._robot.go(way or [self._robot.believed], by_hand=True)
            return goal
        if way is None or self._faults.on(Fault.SERVER_ABORTS, now_s):
            active.at_once = Status.ABORTED
        elif self._faults.on(Fault.SERVER_LIES, now_s):
            active.at_once = Status.SUCCEEDED
        elif not self._faults.on(Fault.SERVER_HANGS, now_s):
            led = way if self._misled is None else self._misled.way(way, self._robot.place, now_s, begins=True)
            self._robot.go(led, instead_of=way)
        return goal

    def cancel(self, goal: int | None, now_s: float, anybodys: bool = False) -> None:
        """Cancel a goal; nothing happens while the server is dead.

        :param goal: the goal; ``None`` for what the mission has sent
        :param anybodys: also what somebody else has sent: people stop whatever drives the robot
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
            no_result = self._faults.on(Fault.NO_RESULT, now_s) and not active.foreign
            if now_s >= active.cancelled_s + 0.5 and not no_result:
                self._over(now_s, Status.CANCELED, success=False, stop=runs_on_s < 1)
                self._brake_s = active.cancelled_s + runs_on_s
            elif active.at_once is not None and now_s >= active.begun_s + REACTION_S:
                self._over(now_s, active.at_once, success=active.at_once is Status.SUCCEEDED)
            elif active.at_once is None and self._robot.arrived and not no_result:
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
    """A toy that drives straight to the newest pose it hears; nothing answers."""

    def __init__(self, robot: Driven, faults: Faults, misled: Misled | None = None) -> None:
        self._robot = robot
        self._faults = faults
        self._misled = misled
        self.overridden = ""
        self._foreign, self._begun_s = False, -math.inf

    @property
    def others(self) -> bool:
        """Whether it drives to the pose of somebody else."""
        return self._foreign and self._robot.drives

    def present(self, now_s: float) -> bool:
        return not self._faults.on(Fault.SERVER_DEAD, now_s)

    def send(self, place: Place, now_s: float, foreign: bool = False) -> None:
        """A new pose, of the mission or of somebody else."""
        if not self.present(now_s) or self._faults.on(Fault.SERVER_DEAF, now_s):
            return
        if self.others and not foreign and self._begun_s < now_s:  # nobody knows of it in the same second
            self.overridden = "pose sent"
        self._foreign, self._begun_s = foreign, now_s
        led = [place]
        if self._misled is not None and not foreign:
            led = self._misled.way(led, self._robot.place, now_s, begins=True)
        self._robot.go(led, instead_of=[place], by_hand=foreign)

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
    return None if isinstance(target, str) else [target]


def _is_between(place: Place, start: Place, end: Place) -> bool:
    whole = math.dist(start, end)
    return whole > 0 and math.dist(place, start) + math.dist(place, end) < whole + 0.01


# Faults of motion: a navigation that drives elsewhere than it was asked to, and robots that creep or slip -------

Way = list[Place]

STAYS_S = 30  # time that a detour stays in a no-go area [s], at 1 m/s
SHORT_M = 2.5  # without nodes an arrival is reported this far before the goal [m]
SLIDE_MPS = 0.7
STOOD_S = 12.0  # a robot that has stood for this time counts or waits [s]


class Misled:
    """Leads the robot, or its fixes, astray."""

    def __init__(self, ground: Ground, faults: Faults, stood_s: float = STOOD_S) -> None:
        self._faults, self._stood_s = faults, stood_s
        areas = [shapely.Polygon(ring).representative_point() for ring in ground.field.no_go]
        self._no_go: Way = [(point.x, point.y) for point in areas]
        x, y = ground.field.polygon.mean(axis=0).tolist()
        self._centre: Place = (x, y)
        self._slid_m: dict[Span, float] = {}
        self._left_s: dict[Span, float] = {}  # when fixes have begun to leave the robot

    def way(self, way: Way, here: Place, now_s: float, begins: bool = False) -> Way:
        """The way that the navigation drives instead of the right one; the right one without a fault.

        :param way: corners that are still ahead [m]
        :param here: where the robot is [m]
        :param begins: whether the goal has just been sent; otherwise a fault has begun in mid-way
        """
        faults = self._faults
        if begins and (span := faults.span(Fault.OTHER_MAP, now_s)) is not None:
            way = [self._on_other_map(corner, span.size) for corner in way]
        if begins and faults.on(Fault.NEIGHBOUR, now_s):
            way = _cut_short(way, here)
        far = bool(way) and math.dist(here, way[0]) > 2  # a pose that stops the robot is obeyed
        if far and faults.on(Fault.DETOUR, now_s) and self._no_go:
            x, y = min(self._no_go, key=lambda area: math.dist(area, here))
            way = [*([(x - 0.8, y), (x + 0.8, y)] * round(STAYS_S / 3.2)), *way]
        if far and (span := faults.span(Fault.STRAY, now_s)) is not None:
            (x, y), whole, off_m = (
                way[0], math.dist(here, way[0]), math.copysign(3.0 + 34.0 * abs(span.size - 0.5), span.size - 0.5),
            )  # fmt: skip
            along, across = (x - here[0]) / whole, (y - here[1]) / whole
            middle = ((x + here[0]) / 2 - off_m * across, (y + here[1]) / 2 + off_m * along)
            way = [middle, *way]
        return way

    def push(self, stood_s: float, now_s: float, for_s: float) -> Place:
        """By how much a robot that is not driven moves nevertheless in a short time [m].

        :param stood_s: for how long it has stood [s]
        :param for_s: the short time [s]
        """
        if (span := self._faults.span(Fault.CREEP, now_s)) is not None:
            return _towards(span, (0.06 + 0.24 * span.size) * for_s)
        span = self._faults.span(Fault.SLIDE, now_s)
        if span is not None and (span in self._slid_m or stood_s >= self._stood_s):
            slid_m = self._slid_m.get(span, 0.0)
            step_m = min(SLIDE_MPS * for_s, max(0.0, 1.0 + 7.0 * span.size - slid_m))
            self._slid_m[span] = slid_m + step_m
            return _towards(span, step_m)
        return 0.0, 0.0

    def fix_error(self, stood_s: float, now_s: float) -> Place:
        """Error of a fix beyond the receiver's noise [m]; arguments as those of :meth:`push`."""
        for fault in (Fault.FIX_STEP, Fault.FIX_DRIFT):
            span = self._faults.span(fault, now_s)
            if span is None or (span not in self._left_s and stood_s < self._stood_s):
                continue
            since_s = now_s - self._left_s.setdefault(span, now_s)
            drift = fault is Fault.FIX_DRIFT
            return _towards(span, (0.1 + 1.9 * span.size) * since_s if drift else 3.5 + 11.5 * span.size)
        return 0.0, 0.0

    def _on_other_map(self, place: Place, size: float) -> Place:
        """Shifted for the one half of all sizes, turned about the middle of the field for the other."""
        if size < 0.5:
            far_m, angle = 4.0 + 112.0 * size, 100.0 * size
            return place[0] + far_m * math.cos(angle), place[1] + far_m * math.sin(angle)
        angle = np.deg2rad(10 + 340 * (size - 0.5))
        x, y = place[0] - self._centre[0], place[1] - self._centre[1]
        c, s = math.cos(angle), math.sin(angle)
        return self._centre[0] + c * x - s * y, self._centre[1] + s * x + c * y


def _towards(span: Span, far_m: float) -> Place:
    angle = 2 * math.pi * (7.3 * span.size % 1)
    return far_m * math.cos(angle), far_m * math.sin(angle)


def _cut_short(way: Way, here: Place) -> Way:
    if len(way) > 1:
        return way[:-1]
    x, y = way[0]
    away_m = math.dist(here, way[0])
    share = max(0.0, 1 - SHORT_M / away_m) if away_m > 0 else 1.0
    return [(here[0] + share * (x - here[0]), here[1] + share * (y - here[1]))]
