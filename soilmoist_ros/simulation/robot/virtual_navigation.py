# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated navigation, and a person: goals by node name or pose, localisation, faults, and advice."""

from __future__ import annotations

import bisect
import enum
import math
from collections import deque
from collections.abc import Sequence
from copy import copy
from dataclasses import astuple, dataclass
from operator import itemgetter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import (
    Ended,
    GraphTravel,
    PersonNavigator,
    RobotMotion,
    Stop,
    TravelModel,
    Way,
    polyline_length_m,
    stops_xy,
    zone_radius_m,
)
from soilmoist_ros.foundation import InputError
from soilmoist_ros.simulation.robot.scenario import GoalFault, NavigationFaults

Array = NDArray[np.float64]

NOWHERE = "none"  # value of ``current_node`` between nodes
REACTION_S = 1.0  # time until the end of a goal that needs no motion [s]
NO_VALID_PATH = 208
"""Error code of Nav2 for a pose to which no path leads."""


class GoalOutcome(enum.Enum):
    """Final status of a goal, numbered as in action_msgs/GoalStatus."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


@dataclass(frozen=True, slots=True)
class GoalEnded:
    """End of a goal."""

    goal_id: int
    outcome: GoalOutcome  # status in the result for the client
    success: bool  # success flag in the result; it may contradict the status
    error_code: int = 0  # error code of Nav2, for poses
    untrue: bool = False  # whether an arrival is reported without motion


@dataclass(frozen=True, slots=True)
class OnRoute:
    """The robot passes a node on the way to its goal."""

    goal_id: int
    node: str


@dataclass(frozen=True, slots=True)
class Remaining:
    """Straight distance to the pose of a goal [m]."""

    goal_id: int
    distance_m: float


@dataclass(frozen=True, slots=True)
class Localised:
    """Position of the robot as the navigation reports it."""

    closest: str  # nearest node
    current: str  # node whose zone contains the robot, or :data:`NOWHERE`


@dataclass(frozen=True, slots=True)
class ServerPresent:
    """The navigation server has appeared or disappeared."""

    present: bool


NavigationEvent = GoalEnded | OnRoute | Remaining | Localised | ServerPresent


class VirtualNavigation:
    """Accepts goals and drives the robot. Times count from the start of the simulation.

    :meth:`happened` returns the events that time or requests have caused. ``present`` states whether the
    navigation server exists now.
    """

    def __init__(
        self, travel: GraphTravel, robot: VirtualRobot, faults: NavigationFaults, rng: np.random.Generator
    ) -> None:
        self._travel = travel
        self._graph = travel.graph
        self._robot = robot
        self._faults = faults
        self._rng = rng
        self._zone_m = zone_radius_m(travel.graph)
        self._goals = 0
        self._fault: GoalFault | None = None  # of the active goal
        self._goal_id: int | None = None
        self._pose: tuple[float, float] | None = None
        self._cancelled_s = math.inf
        self._stops_s = math.inf
        self._ahead: list[tuple[float, NavigationEvent]] = []
        self._sightings: deque[tuple[float, Localised]] = deque()
        self._last_seen: Localised | None = None
        self._turns = deque(sorted({end for span in faults.absent for end in span.ends}))
        self.present = self._present_at(0.0)

    @property
    def next_s(self) -> float:
        """Time of the next event [s]; inf if none is scheduled."""
        queues = (self._ahead[:1], list(self._sightings)[:1])
        turn_s = self._turns[0] if self._turns else math.inf
        return min([*(queue[0][0] for queue in queues if queue), turn_s, self._stops_s])

    def accept(self, now_s: float, target: str) -> int | None:
        """Accept a goal at a node; returns its number, ``None`` if it is rejected. An active goal is replaced."""
        known = target in self._graph.names
        if (not known and self._faults.unknown_target == "rejected") or not self._begin(now_s):
            return None
        here = self._robot.at(now_s)
        nodes = self._graph.path(self._graph.nearest(here), target) if known else ()
        if nodes:
            goal = Stop(target, *self._graph.xy[self._graph.index(target)].tolist())
            self._set_out(now_s, self._travel.route(here, goal), nodes)
        else:
            self._end_at(now_s + REACTION_S, GoalOutcome.ABORTED)
        return self._goal_id

    def accept_pose(self, now_s: float, xy: tuple[float, float], travel: TravelModel) -> int | None:
        """Accept a goal off the graph, in place of an active one; returns its number, ``None`` if rejected."""
        if not self._begin(now_s):
            return None
        try:
            way = travel.route(self._robot.at(now_s), Stop("goal pose", *xy))
        except ValueError:
            self._end_at(now_s + REACTION_S, GoalOutcome.ABORTED, NO_VALID_PATH)
        else:
            self._set_out(now_s, way, pose=xy)
        return self._goal_id

    def cancel(self, now_s: float, goal_id: int) -> bool:
        """Cancel a goal; returns whether the response confirms it, which a fault may hide."""
        if goal_id != self._goal_id:
            return False
        self._cancelled_s = min(self._cancelled_s, now_s)
        if now_s - self._cancelled_s < self._faults.cancel_ignored_s:
            return False
        self._stops_s = now_s + self._faults.coast_s
        if self._stops_s <= now_s:
            self._robot.stop(now_s)
        accepted = self._faults.cancel == "accepted"
        self._end_now(now_s, GoalOutcome.CANCELED if accepted else GoalOutcome.ABORTED, success=False)
        return accepted

    def drive(self, now_s: float, xy: tuple[float, float], travel: TravelModel) -> float | None:
        """Drive off the graph, without a goal; returns the arrival [s], ``None`` if it cannot be reached."""
        try:
            way = travel.route(self._robot.at(now_s), Stop("goal pose", *xy))
        except ValueError:
            return None
        self._supersede(now_s)
        return self._robot.go(now_s, way)

    def look(self, now_s: float) -> None:
        """Localise the robot; the result is reported after the localisation delay."""
        here = np.array(self._robot.at(now_s))
        if self._goal_id is not None and self._pose is not None:
            self._plan(now_s, Remaining(self._goal_id, math.dist(here, self._pose)))
        closest = self._graph.nearest(here)
        distance = float(np.hypot(*(self._graph.xy[self._graph.index(closest)] - here)))
        sighting = Localised(closest, closest if distance <= self._zone_m else NOWHERE)
        if sighting == self._last_seen:
            return
        self._last_seen = sighting
        due_s = now_s + float(self._rng.uniform(*self._faults.localisation_delay_s))
        if self._sightings:
            due_s = max(due_s, self._sightings[-1][0])
        self._sightings.append((due_s, sighting))

    def happened(self, now_s: float) -> list[NavigationEvent]:
        """Events up to now, in order."""
        events: list[NavigationEvent] = []
        if self._stops_s <= now_s:
            self._robot.stop(now_s)
            self._stops_s = math.inf
        while self._turns and self._turns[0] <= now_s:
            present = self._present_at(self._turns.popleft())
            if present != self.present:
                self.present = present
                events.append(ServerPresent(present))
            if not present and self._goal_id is not None:
                self._robot.stop(now_s)
                self._goal_id = None
                self._ahead.clear()
        while self._ahead and self._ahead[0][0] <= now_s:
            event = self._ahead.pop(0)[1]
            if isinstance(event, GoalEnded) and event.goal_id == self._goal_id:
                self._goal_id = None
                if event.outcome is GoalOutcome.ABORTED:
                    self._robot.stop(now_s)
            events.append(event)
        while self._sightings and self._sightings[0][0] <= now_s:
            events.append(self._sightings.popleft()[1])
        return events

    def _present_at(self, now_s: float) -> bool:
        return not any(span.covers(now_s) for span in self._faults.absent)

    def _begin(self, now_s: float) -> bool:
        """Begin a goal, in favour of which an active one ends; false if it is rejected."""
        if not self.present:
            return False
        self._fault = next((fault for fault in self._faults.goals if fault.hits(self._goals + 1)), None)
        self._goals += 1  # a goal that is rejected is counted too
        if self._fault is not None and self._fault.kind == "rejects":
            return False
        self._supersede(now_s)
        self._goal_id, self._pose, self._cancelled_s = self._goals, None, math.inf
        return True

    def _set_out(
        self, now_s: float, way: Array, nodes: tuple[str, ...] = (), pose: tuple[float, float] | None = None
    ) -> None:
        """Drive to a goal, or up to the first fault."""
        fault = self._fault
        if fault is not None and fault.kind == "no_motion":
            self._end_at(now_s + REACTION_S, GoalOutcome.SUCCEEDED, untrue=True)
        if fault is not None and fault.kind != "fails":
            return
        assert self._goal_id is not None
        slower_m = self._travel.slower_m(way, self._robot.motion.speed_mps)
        self._pose, arrival_s = pose, self._robot.go(now_s, way, slower_m)
        drive_s = arrival_s - self._travel.motion.stop_overhead_s - now_s
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        shares = along / along[-1] if along[-1] > 0 else np.ones_like(along)
        passing = dict(zip(nodes, (now_s + drive_s * shares[len(way) - len(nodes) :]).tolist(), strict=True))
        fails_s = math.inf if fault is None else now_s + fault.share_of_way * drive_s
        for node, passed_s in passing.items():
            if passed_s <= fails_s:
                self._plan(passed_s, OnRoute(self._goal_id, node))
        if fault is not None:
            self._end_at(fails_s, GoalOutcome.ABORTED, fault.error_code if pose is not None else 0)
        else:
            self._end_at(arrival_s, GoalOutcome.SUCCEEDED)

    def _supersede(self, now_s: float) -> None:
        """Stop the robot and end the active goal in favour of a newer request."""
        self._robot.stop(now_s)
        self._stops_s = math.inf
        if self._goal_id is not None:
            success = self._faults.superseded == "success"
            self._end_now(now_s, GoalOutcome.SUCCEEDED if success else GoalOutcome.ABORTED, success)

    def _end_now(self, now_s: float, outcome: GoalOutcome, success: bool) -> None:
        assert self._goal_id is not None
        goal_id, self._goal_id = self._goal_id, None
        # Drop the events of this goal only: ends of earlier goals stay scheduled.
        self._ahead = [(due_s, event) for due_s, event in self._ahead if getattr(event, "goal_id", 0) != goal_id]
        self._plan(now_s, GoalEnded(goal_id, outcome, success))

    def _end_at(self, end_s: float, outcome: GoalOutcome, error_code: int = 0, untrue: bool = False) -> None:
        assert self._goal_id is not None
        success = outcome is GoalOutcome.SUCCEEDED
        self._plan(end_s, GoalEnded(self._goal_id, outcome, success, error_code, untrue))

    def _plan(self, due_s: float, event: NavigationEvent) -> None:
        bisect.insort_right(self._ahead, (due_s, event), key=itemgetter(0))


class VirtualRobot:
    """Drives one polyline at a time, from a start position [m].

    The robot spends the stop overhead at the end of the route.
    """

    def __init__(self, motion: RobotMotion, xy: tuple[float, float]) -> None:
        self.motion = motion
        self.track: list[tuple[float, float]] = [xy]
        self._way: Array = np.array([xy])
        self._along_m: Array = np.zeros(1)
        self._start_s = 0.0
        self._drive_s = 0.0
        self._before_m = 0.0

    def go(self, now_s: float, way: Array, slower_m: float = 0.0) -> float:
        """Start a route of corners, shape (p, 2) [m]; returns the time of arrival, stop overhead included [s].

        :param slower_m: what limits of the speed add to its length, as :meth:`TravelModel.slower_m`
        """
        self.stop(now_s)
        self._way = way
        legs = np.hypot(*np.diff(way, axis=0).T)
        self._along_m = np.concatenate([[0.0], np.cumsum(legs)])
        self._start_s = now_s
        self._drive_s = (polyline_length_m(way) + slower_m) / self.motion.speed_mps
        return now_s + self._drive_s + self.motion.stop_overhead_s

    def stop(self, now_s: float) -> None:
        """Stop at the current position."""
        *passed, here = self.passed(now_s)
        self.track += [place for place in [*passed, here] if place != self.track[-1]]
        self._before_m += self._length_at(now_s)
        self._way, self._along_m, self._drive_s = np.array([here]), np.zeros(1), 0.0

    def passed(self, now_s: float) -> list[tuple[float, float]]:
        """Corners of the current route that were passed, and the current position [m]."""
        corners = self._way[1:][self._along_m[1:] < self._length_at(now_s)]
        return [*((float(x), float(y)) for x, y in corners), self.at(now_s)]

    def stands(self, now_s: float) -> bool:
        """True if the robot is at the end of its route."""
        return self._drive_s <= 0 or now_s - self._start_s >= self._drive_s

    def at(self, now_s: float) -> tuple[float, float]:
        """Position at a time of the current route [m]."""
        if self.stands(now_s):
            x, y = self._way[-1]
        else:
            length = self._length_at(now_s)
            x, y = (np.interp(length, self._along_m, axis) for axis in self._way.T)
        return float(x), float(y)

    def places(self, times_s: Array) -> Array:
        """Positions at ascending or descending times of the current route, shape (n, 2) [m].

        A robot that rests throughout returns one position, shape (1, 2).
        """
        if self.stands(float(min(times_s[0], times_s[-1]))):
            return self._way[-1:]
        # Clip before the division: a route of almost no length would otherwise give NaN.
        share = np.minimum(np.maximum(times_s - self._start_s, 0.0), self._drive_s) / self._drive_s
        length = share * self._along_m[-1]
        return np.array([np.interp(length, self._along_m, axis) for axis in self._way.T]).T

    def distance_m(self, now_s: float) -> float:
        """Distance driven since the beginning [m]."""
        return self._before_m + self._length_at(now_s)

    def _length_at(self, now_s: float) -> float:
        if self._drive_s <= 0:
            return 0.0
        share = min(max(now_s - self._start_s, 0.0), self._drive_s) / self._drive_s
        return share * float(self._along_m[-1])


# A person with the sensor, who takes advice, or does not: pauses, wrong turns, stops of their own ----------------

PAUSE_S: Final = 60.0  # mean of the pauses [s]
WRONG_M: Final = (5.0, 30.0)  # length of a wrong turn before it is noticed [m]
PACE_SD: Final = 0.1  # standard deviation of the speed of a trip, as a share
OTHER_M: Final = 10.0  # least distance of a stop of their own from where they set off [m]
FIX_S: Final = 1.0  # time between two fixes of the receiver [s]
MAX_STAND_S: Final = 120.0  # a person who stands for this long is taken to be there, whatever the noise says [s]


@dataclass(frozen=True)
class Habits:
    """Probabilities on each trip: of a pause, a wrong turn, and of standing at another stop than the advised."""

    pauses: float
    wrong_turns: float
    ignores: float

    @classmethod
    def parse(cls, text: str) -> Habits:
        """Read the name of a kind of :data:`PEOPLE`, or three probabilities.

        >>> Habits.parse("0.1,0,0.5")
        Habits(pauses=0.1, wrong_turns=0.0, ignores=0.5)

        :raises InputError: if it is neither
        """
        if text in PEOPLE:
            return PEOPLE[text]
        try:
            pauses, wrong_turns, ignores = map(float, text.split(","))
            if not all(0 <= share <= 1 for share in (pauses, wrong_turns, ignores)):
                raise ValueError
        except ValueError:
            remedy = f"write {', '.join(PEOPLE)}, or three probabilities such as 0.1,0.1,0.2"
            raise InputError(f"{text!r} is no kind of person", remedy) from None
        return cls(pauses, wrong_turns, ignores)

    def __str__(self) -> str:
        return next((name for name, one in PEOPLE.items() if one == self), "{:g},{:g},{:g}".format(*astuple(self)))


PEOPLE: Final = {"obedient": Habits(0.0, 0.0, 0.0), "usual": Habits(0.1, 0.1, 0.1)}


class VirtualPerson(VirtualRobot):
    """Walks or drives to advised stops; the real :class:`PersonNavigator` judges the arrival by noisy fixes.

    :param stops: places among which the person chooses another one
    :param sd_m: noise of each coordinate of the fixes [m]
    """

    def __init__(
        self,
        motion: RobotMotion,
        xy: tuple[float, float],
        habits: Habits,
        stops: Sequence[Stop],
        sd_m: float,
        rng: np.random.Generator,
    ) -> None:
        super().__init__(motion, xy)
        self._habits, self._stops, self._sd_m, self._rng = habits, stops, sd_m, rng
        self._stops_xy = stops_xy(stops)
        self._when_s = self._where_m = np.zeros(2)

    def walk(self, now_s: float, travel: TravelModel, stop: Stop) -> float:
        """Set off for a stop; returns when the person is seen to stand, there or elsewhere [s]."""
        rng, here = self._rng, self.at(now_s)
        pauses, turns, ignores, share, pace = rng.random(5).tolist()
        end = self._other(here, stop) if ignores < self._habits.ignores else stop
        way = travel.route(here, end)
        if turns < self._habits.wrong_turns and (wrong := self._wrong(travel, here, end)) is not None:
            way = wrong
        self.go(now_s, way)
        length_m = polyline_length_m(way)
        speed = self.motion.speed_mps * math.exp(PACE_SD * (2 * pace - 1) * math.sqrt(3))
        pause_s = rng.exponential(PAUSE_S) if pauses < self._habits.pauses else 0.0
        self._drive_s = length_m / speed + pause_s
        self._where_m = np.array([0.0, share, share, 1.0]) * length_m
        self._when_s = self._where_m / speed + np.array([0.0, 0.0, pause_s, pause_s])
        return self._seen(now_s, here, stop)

    def _other(self, here: tuple[float, float], stop: Stop) -> Stop:
        """One of the nearest stops away from here and from where the person is to go, which is the last choice."""
        away_m = np.hypot(*(self._stops_xy - here).T)
        possible = np.flatnonzero((away_m > OTHER_M) & (np.hypot(*(self._stops_xy - stop.xy).T) > OTHER_M))
        if not len(possible):
            return stop
        nearest = possible[np.argsort(away_m[possible], kind="stable")][: max(len(possible) // 10, 1)]
        return self._stops[int(self._rng.choice(nearest))]

    def _wrong(self, travel: TravelModel, here: tuple[float, float], end: Stop) -> Array | None:
        """A way to a stop that begins towards another one; ``None`` if no way leads on from there."""
        begun, at_m = list[tuple[float, float]](), self._rng.uniform(*WRONG_M)
        try:
            for corner in travel.route(here, self._other(here, end)):
                place = (float(corner[0]), float(corner[1]))
                if begun and (step_m := math.dist(begun[-1], place)) >= at_m:
                    x, y = begun[-1]
                    begun.append((x + at_m / step_m * (place[0] - x), y + at_m / step_m * (place[1] - y)))
                    break
                at_m -= math.dist(begun[-1], place) if begun else 0.0
                begun.append(place)
            turned = copy(travel)
            for place in begun:
                turned.moved(place)
            return np.vstack([begun, turned.route(begun[-1], end)])
        except ValueError:
            return None

    def _seen(self, now_s: float, here: tuple[float, float], stop: Stop) -> float:
        ended = list[Ended]()
        navigator = PersonNavigator(ended.append)
        navigator.moved(here, now_s, self._sd_m)
        navigator.go(0, stop, Way(np.array([here, stop.xy])))
        last_s = now_s + self._drive_s + MAX_STAND_S
        while not ended and now_s < last_s:
            now_s += FIX_S
            x, y = self._rng.normal(self.at(now_s), self._sd_m).tolist()
            navigator.moved((x, y), now_s, self._sd_m)
        return now_s

    def places(self, times_s: Array) -> Array:
        """See :class:`VirtualRobot`."""
        if self.stands(float(min(times_s[0], times_s[-1]))):
            return self._way[-1:]
        length = np.interp(times_s - self._start_s, self._when_s, self._where_m)
        return np.array([np.interp(length, self._along_m, axis) for axis in self._way.T]).T

    def _length_at(self, now_s: float) -> float:
        if self._drive_s <= 0:
            return 0.0
        return float(np.interp(now_s - self._start_s, self._when_s, self._where_m))
