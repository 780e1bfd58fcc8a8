# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals that are only poses: nothing answers, so arrival and standstill are judged by the robot's positions.

Poses cannot stop a robot, and a wrong place drives it away. So a stop cancels the action of the navigation where
there is one. Elsewhere the pose is a place that several recent positions agree on; without one nothing is sent.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from soilmoist_ros.exploration.guard.motion import Motion
from soilmoist_ros.exploration.mission.events import ANYBODYS
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop, WayPoint

PASS_M = 0.3
"""A way point is passed within this distance [m]: an earlier turn would cut the corner of a no-go area."""
STOP_AGAIN_S = 2.0  # time after which a robot that does not stand is stopped again [s]


@dataclass(frozen=True, slots=True)
class SendPose:
    """Send the robot to this place [m], heading anticlockwise from east [rad]."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class CancelAll:
    """Cancel all goals of the navigation's action."""


PoseRequest = SendPose | CancelAll | Ended  # what a client asks for, and what it reports


def drivers(nodes: Iterable[str], observers: Sequence[str]) -> list[str]:
    """The nodes that may drive a robot to a pose that they receive.

    :param nodes: names of the nodes that subscribe to poses
    :param observers: patterns of names of nodes that only record or show poses
    """
    # discovery shows a subscription before the name of its node
    known = [name for name in nodes if name and "UNKNOWN" not in name]
    return [name for name in known if not any(fnmatchcase(name, pattern) for pattern in observers)]


@dataclass
class _Goal:
    goal_id: int
    ahead: tuple[WayPoint, ...]  # empty: it is being cancelled
    since_s: float  # standstill counts from here


class PoseClient:
    """Takes goals one at a time. Each method returns what is to be done now, in order.

    How long a goal or a cancellation may take is for the mission to say: it cancels, or goes on without.

    :param radius_m: the robot is at a stop within this distance; positions may be this far off [m]
    :param settle_s: it has arrived or stopped when it has stood still for this time [s]
    """

    def __init__(self, radius_m: float, settle_s: float, speed_mps: float) -> None:
        self._radius_m = radius_m
        self._settle_s = settle_s
        self._track = RobotTrack(speed_mps, radius_m)
        self._goal: _Goal | None = None
        self._cancels = False
        self._asked_s = -math.inf
        self._kept: Place | None = None  # the place that was published to stop the robot
        self._kept_s = self._begun_s = -math.inf
        self._other_s: float | None = None  # when somebody else sent a pose, while the robot may drive there
        self._yields = True

    @property
    def caution(self) -> str:
        """Reason why the robot cannot be stopped now; empty if it can, or if there is nothing to stop."""
        if self._goal is None or self._cancels or self._place_to_stop is not None:
            return ""
        what = "is not asked to stop" if self._cancelling else "could not be stopped"
        return f"the robot {what}: its recent positions do not agree on a place"

    @property
    def other_client(self) -> bool:
        """True while the robot may be on the way to somebody else's pose: until it stands."""
        return self._other_s is not None

    def heard_other(self, yields: bool = True) -> tuple[PoseRequest, ...]:
        """Somebody else has sent a pose.

        :param yields: whether that ends the goal of the planner: it has been replaced
        """
        self._other_s, self._yields = self._track.now_s, yields
        if not yields:
            return ()
        self._kept = None
        reason = "another client drives the robot: its pose has replaced that of the planner"
        return self._end(Outcome.SUPERSEDED, reason)

    def go(self, goal_id: int, ahead: tuple[WayPoint, ...]) -> tuple[PoseRequest, ...]:
        """A new goal; its first pose replaces the one before at once."""
        if self._gives_way:
            return (Ended(goal_id, Outcome.SUPERSEDED, "another client drives the robot"),)
        replaced = self._end(Outcome.CANCELED, "replaced by another goal")
        self._kept = None
        if not replaced and self._track.standing_at(ahead[-1].stop, self._track.still_m):
            return (Ended(goal_id, Outcome.SUCCEEDED, f"already at {ahead[-1].stop.name}"),)
        self._goal = _Goal(goal_id, ahead, self._track.now_s)
        self._begun_s = self._track.now_s
        return *replaced, self._pose(ahead[0])

    def cancel(self, goal_id: int) -> tuple[PoseRequest, ...]:
        """Stop the robot; it is repeated until the robot stands.

        What somebody else has sent is only cancelled: a pose would make a robot that people drive turn back.
        """
        if goal_id == ANYBODYS:
            return (CancelAll(),) if self._cancels else ()
        if self._gives_way:
            return (Ended(goal_id, Outcome.CANCELED, "cancelled; another client drives the robot"),)
        goal, replaced = self._goal, tuple[Ended, ...]()
        if goal is None or goal.goal_id != goal_id:
            replaced = self._end(Outcome.CANCELED, "cancelled")
            goal = _Goal(goal_id, (), self._track.now_s)
        if goal.ahead or goal is not self._goal:
            goal.ahead, goal.since_s = (), math.inf
            self._asked_s, self._kept = -math.inf, None
            self._begun_s = self._begun_s if goal is self._goal else -math.inf
        self._goal = goal
        return *replaced, *self._stop()

    def moved(self, place: Place, now_s: float, sd_m: float = math.nan) -> tuple[PoseRequest, ...]:
        """The robot is at a place [m], of this standard deviation [m], at a time [s]."""
        plausible = self._track.moved(place, now_s, sd_m)
        if self._other_s is not None and self._stands_since(self._other_s):
            self._other_s = None
        goal = self._goal
        if goal is None or not plausible:
            return ()
        if not goal.ahead:
            stopped = self._stands_since(goal.since_s)
            return self._end(Outcome.CANCELED, "cancelled; the robot stands") if stopped else self._stop()
        here, stop = self._track.place, goal.ahead[0].stop
        if here is None:
            return ()
        away_m = math.dist(here, (stop.x_m, stop.y_m))
        standing = away_m <= min(self._radius_m, stop.reach_m) and self._stands_since(goal.since_s)
        if len(goal.ahead) > 1 and (standing or away_m <= PASS_M):
            goal.ahead, goal.since_s = goal.ahead[1:], now_s
            return (self._pose(goal.ahead[0]),)
        return self._end(Outcome.SUCCEEDED, f"standing {away_m:.1f} m from {stop.name}") if standing else ()

    def tick(self, cancels: bool, now_s: float) -> tuple[PoseRequest, ...]:
        """Time has passed.

        :param cancels: whether the navigation has an action whose goals can be cancelled
        """
        self._cancels = cancels
        self._track.tick(now_s)
        return self._stop() if self._cancelling else ()

    # What follows --------------------------------------------------------------------------------------------

    @property
    def _gives_way(self) -> bool:
        return self._other_s is not None and self._yields

    @property
    def _cancelling(self) -> bool:
        return self._goal is not None and not self._goal.ahead

    @property
    def _place_to_stop(self) -> Place | None:
        """Place of the robot [m]; ``None`` after an apparent leap, since a pose there would make it drive there.

        After a pose that lets it stay, any other place after a gap of positions is a leap.
        """
        track = self._track
        leaped = track.leaped and track.resumed_s >= self._begun_s
        if leaped or (self._kept is not None and track.resumed_s > self._kept_s):
            return None
        return track.place

    def _stop(self) -> tuple[PoseRequest, ...]:
        """Stop the robot if it may still be driving."""
        goal, now_s, here = self._goal, self._track.now_s, self._place_to_stop
        assert goal is not None
        stays = here is not None and self._kept is not None and math.dist(here, self._kept) <= self._radius_m
        if now_s - self._asked_s < STOP_AGAIN_S or (not self._cancels and (here is None or stays)):
            return ()
        self._asked_s, goal.since_s = now_s, min(goal.since_s, now_s)
        if self._cancels or here is None:
            return (CancelAll(),)
        self._kept, self._kept_s = here, now_s
        return (SendPose(*here, self._track.heading_rad or 0.0),)

    def _pose(self, point: WayPoint) -> SendPose:
        return SendPose(point.stop.x_m, point.stop.y_m, point.heading_rad)

    def _stands_since(self, since_s: float) -> bool:
        return self._track.stands(self._settle_s, since_s)

    def _end(self, outcome: Outcome, reason: str) -> tuple[Ended, ...]:
        if self._goal is None:
            return ()
        goal_id, self._goal = self._goal.goal_id, None
        return (Ended(goal_id, outcome, reason),)


# Where the robot plausibly is: recent positions that agree with each other and with how fast it can move --------

MIN_AGREEING, AMONG = 3, 5
"""Number of agreeing positions that makes a place plausible, and number of newest positions that are compared."""
MAX_AGE_S = 3.0  # highest age of the newest of them [s]
MAX_SPAN_S = 45.0
"""Highest age of the oldest of them [s]; without fixes there are only the places of records, one in 10 s."""
SPEED_FACTOR = 3.0  # the robot may be this many times as fast as its expected speed
USUAL_FACTOR = 1.2  # the robot is seldom faster than this multiple of its expected speed
KEPT_S = 60.0  # time for which places are kept [s]
SPACING_S = 0.5  # places that come faster are thinned to this spacing, except for the newest [s]
STILL_S = 2.0  # shortest standstill of a robot that is at a stop [s]
STILL_SHARE = 1 / 3  # a robot that stands within this share of the arrival radius from a stop needs no goal to it

Place = tuple[float, float]


class RobotTrack:
    """Plausible places of the robot. Positions that it cannot have reached are left out.

    :param noise_m: positions may be this far off [m]
    """

    def __init__(self, speed_mps: float, noise_m: float) -> None:
        self._speed_mps = speed_mps
        self._max_speed_mps = SPEED_FACTOR * speed_mps
        self._noise_m = noise_m
        self._newest: deque[tuple[float, Place]] = deque(maxlen=MIN_AGREEING)
        self._verdicts: deque[bool] = deque(maxlen=AMONG)
        self._places: deque[tuple[float, Place]] = deque()
        self._motion = Motion()
        self.now_s = -math.inf
        self.resumed_s = -math.inf
        """Time of the first place after the last gap of more than :data:`MAX_AGE_S` [s]."""
        self.leaped = False
        """True if the robot would have had to be faster than expected in that gap."""

    def tick(self, now_s: float) -> None:
        """Time has passed [s]; a clock that goes back far starts a new track."""
        if now_s < self.now_s - KEPT_S:
            for kept in (self._newest, self._verdicts, self._places):
                kept.clear()
            self.now_s, self._motion = now_s, Motion()
        self.now_s = max(now_s, self.now_s)  # threads may call in another order than they read the clock

    def moved(self, place: Place, now_s: float, sd_m: float = math.nan) -> bool:
        """Process a position [m] and its standard deviation [m]; returns whether it is plausible."""
        self.tick(now_s)
        now_s = self.now_s
        self._newest.append((now_s, place))
        if self._places:
            plausible = all(self._agree(at, self._newest[-1]) for at in self._places)
            last_s, last = self._places[-1]
            if plausible and now_s - last_s > MAX_AGE_S:
                reach_m = USUAL_FACTOR * self._speed_mps * (now_s - last_s) + self._noise_m
                self.resumed_s, self.leaped = now_s, math.dist(last, place) > reach_m
            if plausible:
                self._motion.take(now_s, place, sd_m)
                self._keep(self._newest[-1])
            self._verdicts.append(plausible)
        elif len(self._newest) == MIN_AGREEING and all(self._agree(at, self._newest[-1]) for at in self._newest):
            self._places.extend(self._newest)
            for at_s, agreeing in self._newest:
                self._motion.take(at_s, agreeing, sd_m)
            self._verdicts.extend([True] * MIN_AGREEING)
        while len(self._places) > MIN_AGREEING and self._places[0][0] < now_s - KEPT_S:
            self._places.popleft()
        return bool(self._verdicts) and self._verdicts[-1]

    @property
    def still_m(self) -> float:
        """Distance from a stop at which a robot that stands needs no goal to it [m]."""
        return self._noise_m * STILL_SHARE

    @property
    def place(self) -> Place | None:
        """Place of the robot [m]; ``None`` unless several recent positions agree."""
        newest = list(self._places)[-MIN_AGREEING:]
        if sum(self._verdicts) < MIN_AGREEING or self.now_s - newest[-1][0] > MAX_AGE_S:
            return None
        return newest[-1][1] if self.now_s - newest[0][0] <= MAX_SPAN_S else None

    @property
    def heading_rad(self) -> float | None:
        """Direction of the last motion beyond the noise, anticlockwise from east [rad]."""
        for _, before in reversed(self._places):
            here = self._places[-1][1]
            if math.dist(before, here) > self._noise_m:
                return math.atan2(here[1] - before[1], here[0] - before[0])
        return None

    def stands(self, for_s: float, since_s: float = -math.inf) -> bool:
        """True if the robot stands still, as :meth:`.Motion.standing`.

        :param for_s: for how long at least [s]
        :param since_s: only places after this time count [s]
        """
        return self.place is not None and self._motion.standing(for_s, since_s).for_s > 0

    def standing_at(self, stop: Stop, within_m: float) -> bool:
        """True if the robot stands at a stop, and within this distance of it [m]."""
        here = self.place
        near = here is not None and math.dist(here, (stop.x_m, stop.y_m)) <= min(within_m, stop.reach_m)
        return near and self.stands(STILL_S)

    def _keep(self, at: tuple[float, Place]) -> None:
        places = self._places
        if len(places) > MIN_AGREEING and places[-1][0] - places[-2][0] < SPACING_S:
            places.pop()
        places.append(at)

    def _agree(self, one: tuple[float, Place], other: tuple[float, Place]) -> bool:
        reach_m = self._max_speed_mps * abs(other[0] - one[0]) + self._noise_m
        return math.dist(one[1], other[1]) <= reach_m
