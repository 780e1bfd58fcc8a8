# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several robots on one field: pending measurements of the others count as done, and the robots keep apart.

The kriging variance does not depend on the data, only on where was counted and for how long. So samples that are
still to come can be put into the kriging as they are expected, and their worth is taken off every place around.

Robots that come too near both stop. The one whose name comes first then drives past the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.control.field_access import PAST_M, FieldAccess
from soilmoist_ros.exploration.mission.events import RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, MissionStatus, Phase
from soilmoist_ros.exploration.planning.properties import MIN_RATE_CPS
from soilmoist_ros.exploration.travel.stop import Stop, Way
from soilmoist_ros.foundation import Health, InputError, Level
from soilmoist_ros.mapping import Changing, FieldMap, Samples

Array = NDArray[np.float64]

MIN_EXPOSURE_S = 1e-3  # what is counted in less changes no map; the variance of its rate need not be a number [s]
SAME_CELLS = 0.5  # stops nearer than this to that of another robot count as the same stop [cells]
NEARER_M: Final = 0.5
"""A robot that sets off next to another one may come this much nearer, by the noise of both fixes [m]."""
AHEAD_S: Final = 3.0
"""Time that a robot needs to stop, with a second for the other robot's status and one for its velocity [s]."""
WAITS_M: Final = 8.0
"""Distance, in addition to that which robots keep, from which one that waits lets the other pass [m]."""
PATIENCE_S: Final = 30.0
"""Time for which one that stands may go first [s]; then it is shut in, and the other drives away from it."""
SHUT_IN_S: Final = 300.0
"""Time after which one that is shut in asks for an operator, and goes on waiting [s]."""
SOON_S: Final = 0.2  # time after which two places give a velocity [s]

SHUT_IN: Final = "other robots stand in the way to the stops that are left"
_LOOK_S: Final = 5.0  # time between two looks whether one of them is out of the way [s]

_DRIVES: Final = frozenset({Phase.TRAVELLING, Phase.CANCELLING, Phase.RETURNING})
_WANTS_TO_DRIVE: Final = _DRIVES | {Phase.PLANNING, Phase.WAITING}

Place = tuple[float, float]


def keep_apart_m(robot_radius_m: float) -> float:
    """Distance that the centres of two robots keep [m].

    Two robots touch when their centres are two radii apart. The places of both are known to some 0.3 m with
    corrections, so 1 m is three standard deviations of their distance, rounded up. 2 m is for robots whose radius
    is not given.
    """
    return max(2.0, 2 * robot_radius_m + 1.0)


@dataclass(frozen=True, slots=True)
class PendingMeasurement:
    """A measurement that another robot is about to make or is making."""

    x_m: float  # east [m]
    y_m: float  # north [m]
    exposure_s: float  # exposure still expected there [s]; 0: none, but the stop is not free
    apart_m: float = 0.0  # distance that other robots keep from it [m]


def pending_measurement(
    status: MissionStatus, mapped_at_once: bool = True, apart_m: float = 0.0
) -> PendingMeasurement | None:
    """The pending measurement of a robot, ``None`` if it has none.

    :param mapped_at_once: whether what it has counted at the stop is in the map already
    """
    stop = status.target
    if stop is None:
        return None
    left_s = status.planned_dwell_s - (status.dwell_s if mapped_at_once else 0.0)
    return PendingMeasurement(stop.x_m, stop.y_m, max(left_s, 0.0), apart_m)


def foreseen(
    field_map: FieldMap, pending_measurements: Sequence[PendingMeasurement], factor: float = 1.0
) -> FieldMap:
    """The map as it will be: with a sample of each pending measurement, at the rate that the map expects there.

    :param field_map: the map so far, which is returned if nothing is pending; without a fit only places join it
    :param factor: product of the correction factors now, ``effective exposure = exposure / factor`` [-]
    :raises IllConditionedError: if the matrix cannot be factored
    """
    pending = [each for each in pending_measurements if each.exposure_s >= MIN_EXPOSURE_S]
    if not pending:
        return field_map
    rate = np.zeros(len(pending)) if field_map.kriging is None else field_map.kriging.predict(places(pending))[0]
    exposure_s = [each.exposure_s / factor for each in pending]
    counts = [round(max(r, MIN_RATE_CPS) * t) for r, t in zip(rate.tolist(), exposure_s, strict=True)]
    pending_samples = Samples(places(pending), np.array(counts, float), np.array(exposure_s))
    expected, changing = field_map.samples.joined(pending_samples), field_map.changing
    return with_samples(field_map, expected, None if changing is None else changing.joined(pending_samples))


def with_samples(field_map: FieldMap, samples: Samples, changing: Changing | None) -> FieldMap:
    """The map for planning that other samples would make with the fit so far; without a fit only the samples."""
    other = FieldMap(field_map.grid, field_map.settings)
    if field_map.soil_map is None:
        other.set_samples(samples)
        return other
    other.set_samples(samples, field_map.soil_map.fit, changing)
    other.update()
    return other


def taken(stops_xy: Array, pending_measurements: Sequence[PendingMeasurement], cell_m: float) -> NDArray[np.bool_]:
    """True for each stop that another robot has taken, shape (k,)."""
    if not len(pending_measurements):
        return np.zeros(len(stops_xy), bool)
    away_m = np.linalg.norm(stops_xy[:, None, :] - places(pending_measurements)[None, :, :], axis=2)
    apart_m = np.maximum([each.apart_m for each in pending_measurements], SAME_CELLS * cell_m)
    return np.asarray((away_m < apart_m).any(axis=1))


def places(pending_measurements: Sequence[PendingMeasurement]) -> Array:
    """Places of the pending measurements, shape (n, 2) [m]."""
    return np.array([(each.x_m, each.y_m) for each in pending_measurements], float).reshape(-1, 2)


@dataclass
class OtherRobot:
    """Another robot of the team, by the statuses of its mission."""

    goes_first: bool = False  # whether it drives first where two robots meet
    status: MissionStatus | None = None  # the last status of its mission; ``None`` before the first
    heard_s: float = -math.inf  # time of arrival of its last status, on the mission clock [s]
    silent_s: float = 0.0  # steady time since its last status [s]
    drove_s: float = math.inf  # when it drove last, or was heard first, on the mission clock [s]
    stranger: str = ""  # why its statuses are not used; empty if they are
    velocity: Place = (0.0, 0.0)  # east and north [m/s]

    def hear(self, status: MissionStatus, now_s: float, goes_first: bool) -> None:
        """A status has come; the first one may be an old one that was latched."""
        known = None if self.status is None else self.status.place
        if status.phase not in _DRIVES:
            self.velocity = (0.0, 0.0)
        elif now_s - self.heard_s >= SOON_S:  # an event is shown at once, and the next second after that
            self.velocity = _velocity(known, self.heard_s, status.place, now_s)
        if status.phase in _DRIVES or self.status is None:
            self.drove_s = now_s
        self.goes_first, self.status, self.heard_s = goes_first, status, now_s
        self.silent_s, self.stranger = 0.0, ""

    @property
    def wants_to_drive(self) -> bool:
        """True if the other robot drives, or will drive without anybody's help."""
        return self.status is not None and (self.status.phase in _WANTS_TO_DRIVE or self.status.yields)


class Team:
    """Other robots of a field: their places, the lost ones, and the ways that keep a distance from them.

    A robot that is silent for ``lost_s`` is lost. What it was about to count is released once it would have
    counted it. Its last place and its last stop stay taken until it is heard or an operator releases them: a dead
    robot does not move by itself, and one whose radio is dead has driven on to its stop.

    :param apart_m: distance between the centres of two robots [m]; 0: they do not keep apart
    :param lost_s: silence after which a robot is lost [s]
    """

    def __init__(self, apart_m: float = 0.0, lost_s: float = 30.0) -> None:
        self.apart_m, self.lost_s = apart_m, lost_s
        self.robots: dict[str, OtherRobot] = {}
        self._farthest_m: dict[tuple[str, int], float] = {}
        self._was: tuple[Place, float] | None = None
        self._velocity: Place = (0.0, 0.0)
        self._cut_off = False  # whether a robot stood in the way to stops when the last one was chosen
        self._planned_for: RequestPlan | None = None
        self._shut_in: RequestPlan | None = None  # waits until a robot is out of the way
        self._looked_s = -math.inf
        self._since_s = math.inf  # since when it is shut in

    def robot(self, name: str) -> OtherRobot:
        """The robot of this name."""
        return self.robots.setdefault(name, OtherRobot())

    def is_lost(self, robot: OtherRobot) -> bool:
        """True if a robot was heard before, and has been silent for ``lost_s``."""
        return robot.status is not None and robot.silent_s > self.lost_s

    def pass_time(self, seconds: float) -> list[str]:
        """Steady time has passed; names of robots without a pending measurement, or whose one is over [s]."""
        over = []
        for name, robot in self.robots.items():
            robot.silent_s += seconds
            status = robot.status
            left_s = 0.0 if status is None else max(status.planned_dwell_s - status.dwell_s, 0.0)
            if status is None or robot.silent_s > self.lost_s + left_s:
                over.append(name)
        return over

    def release_lost(self) -> list[str]:
        """Forget lost robots, as an operator says that they are no longer where they were; their names."""
        lost = [name for name, robot in self.robots.items() if self.is_lost(robot)]
        for name in lost:
            self.robots[name] = OtherRobot()
        return lost

    @property
    def waiting_for(self) -> str:
        """Robots to keep apart from whose places are unknown; empty once all are heard or silent for long."""
        return self._unheard(self.lost_s) if self.apart_m else ""

    def _unheard(self, limit_s: float) -> str:
        unheard = (name for name, robot in self.robots.items() if robot.status is None and not robot.stranger)
        return ", ".join(name for name in unheard if self.robots[name].silent_s <= limit_s)

    def standing(self) -> Iterator[tuple[str, Place]]:
        """Places to keep away from: where a robot stands, or will stand, or a lost one may be.

        A way that ended next to the stop to which another robot drives would keep both from their stops.
        """
        for name, robot in self.robots.items():
            status, lost = robot.status, self.is_lost(robot)
            if status is None:
                continue
            if status.place is not None and (lost or status.phase not in _DRIVES):
                yield name, status.place
            if status.target is not None and (lost or status.phase in _DRIVES):
                yield name, status.target.xy

    def near(self, place: Place) -> str:
        """Robot that stands, or will stand, too near to a place, in words; empty without one."""
        for name, there in self.standing():
            if math.dist(place, there) < self.apart_m:
                status = self.robots[name].status
                stops = status is not None and status.phase in _DRIVES and not self.is_lost(self.robots[name])
                is_there = "will stop" if stops else "is"
                return f"{name} {is_there} {math.dist(place, there):.1f} m from it, nearer than {self.apart_m:g} m"
        return ""

    def set_off(self) -> None:
        """The robot sets off: from now on it comes no nearer to those that are close by."""
        self._farthest_m.clear()

    def fault(self, place: Place | None, driving: bool, waiting: bool, now_s: float) -> str:
        """Robot that is too near, or will be before the robot can stop, in words; empty without one.

        :param waiting: whether it has stopped for another robot
        """
        found = ""
        if self._was is None or now_s - self._was[1] >= 1.0:
            self._velocity = (0.0, 0.0) if self._was is None else _velocity(*self._was, place, now_s)
            self._was = None if place is None else (place, now_s)
        for name, robot in self.robots.items():
            status, lost = robot.status, self.is_lost(robot)
            if place is None or status is None:
                continue
            drives = status.phase in _DRIVES and not lost
            for number, there in enumerate((status.place, status.target.xy if status.target else None)):
                if there is None:
                    continue
                moves, age_s = drives and number == 0, now_s - robot.heard_s
                velocity = np.array(robot.velocity if moves else (0.0, 0.0))
                away = np.subtract(there, place)
                if age_s > AHEAD_S:  # it may have stopped anywhere, or still drive
                    until_s = -(away @ velocity) / max(float(velocity @ velocity), 1e-9)
                    away = away + velocity * np.clip(until_s, 0.0, age_s + AHEAD_S)
                    velocity = np.zeros(2)
                away = away + velocity * age_s
                away_m, closing = float(np.hypot(*away)), velocity - self._velocity
                farthest_m = max(self._farthest_m.get((name, number), 0.0), away_m)
                self._farthest_m[name, number] = farthest_m
                if number and not lost:
                    continue
                if driving:
                    after_s = np.clip(-(away @ closing) / max(float(closing @ closing), 1e-9), 0.0, AHEAD_S)
                    near_m = float(np.hypot(*(away + after_s * closing)))
                    wrong = near_m < min(self.apart_m, farthest_m - NEARER_M)
                else:
                    idle = now_s - robot.drove_s > PATIENCE_S
                    first = robot.goes_first and robot.wants_to_drive and not (idle or lost)
                    wrong = waiting and (drives or first) and away_m < self.apart_m + WAITS_M
                if wrong and not found:
                    found = f"{name} is {away_m:.1f} m away, and robots keep {self.apart_m:g} m apart"
        return found

    def health(self, under_way: bool) -> Health | None:
        """Faults of the other robots; ``None`` without a fault."""
        faults = []
        if unheard := self._unheard(math.inf):
            faults.append(f"no status of {unheard} yet")
        level = Level.WARN
        for name, robot in self.robots.items():
            status = robot.status
            if robot.stranger:
                level = Level.ERROR if under_way else level  # nobody keeps apart from it
                faults.append(f"{name} is not heard: {robot.stranger}")
            if status is not None and self.is_lost(robot):
                level = Level.ERROR if under_way else level
                there = "" if status.place is None else " at ({:.1f}, {:.1f})".format(*status.place)
                faults.append(
                    f"{name} is lost: last heard {robot.silent_s:.0f} s ago{there}; no way leads within "
                    f"{self.apart_m:g} m of its place and its stop until it is heard, or somebody who knows where "
                    "it is calls planner/release_lost"
                )
        return Health("others", level, "; ".join(faults)) if faults else None

    # Ways past robots that stand ------------------------------------------------------------------------------

    def way(self, access: FieldAccess, place: Place, stop: Stop) -> Way:
        """Way to a stop, past the robots that stand.

        :raises InputError: if there is none
        """
        if near := self.near(stop.xy):
            raise InputError(f"{stop.name} is not free: {near}", "choose another stop")
        way, apart_m = access.way(place, stop), self.apart_m
        close = {name: at for name, at in self.standing() if way.passes_m(at) < apart_m + PAST_M}
        if not (apart_m and close):
            return way
        try:
            return access.around(place, [at for _, at in self.standing()], apart_m).way(place, stop)
        except InputError as refusal:
            names, remedy = " and ".join(close), "choose another stop"
            if (away_m := min(math.dist(place, at) for at in close.values())) < apart_m + PAST_M:
                names = f"{names}, {away_m:.1f} m away,"
                remedy = f"drive one of them to another stop, {apart_m + PAST_M:g} m from the other at least"
                self._shut_in, self._looked_s = self._planned_for, -math.inf
            message = f"{names} stands in the way: {refusal.mistakes[0].message}"
            raise InputError(message, remedy) from None

    def plan(self, access: FieldAccess, place: Place, rules: MissionRules, request: RequestPlan) -> set[str]:
        """Start the choice of a stop; names of the stops that another robot is too near to, or in the way to."""
        self._planned_for, self._shut_in = request, None
        return self._not_free(access, place, rules, request)

    def waits(self, now_s: float) -> bool:
        """No stop was found; whether the survey is not over, as robots in the way drive on some day."""
        if self._cut_off:
            self._shut_in, self._looked_s = self._planned_for, now_s
        return self._cut_off

    def is_shut_in(
        self, access: FieldAccess | None, place: Place | None, rules: MissionRules, under_way: bool, now_s: float
    ) -> bool:
        """True while other robots stand in the way to all stops that are left."""
        request = self._shut_in
        if request is None or access is None or place is None or not under_way:
            self._shut_in = None
        elif now_s - self._looked_s >= _LOOK_S:
            self._looked_s, self._since_s = now_s, min(self._since_s, now_s)
            free = {stop.name for stop in access.stops} - self._not_free(access, place, rules, request)
            if not self._cut_off or _any_fits(access, place, rules, request, free):
                self._shut_in = None
        if self._shut_in is None:
            self._since_s = math.inf
        return self._shut_in is not None

    def call(self, now_s: float) -> str:
        """Request to an operator for a robot that is shut in for long; empty otherwise."""
        if now_s - self._since_s < SHUT_IN_S:
            return ""
        return f"{SHUT_IN}: drive one of them to another stop, {self.apart_m + PAST_M:g} m from the others"

    def _not_free(self, access: FieldAccess, place: Place, rules: MissionRules, request: RequestPlan) -> set[str]:
        apart_m, standing = self.apart_m, [at for _, at in self.standing()]
        if not (apart_m and standing):
            self._cut_off = False
            return set()
        near = {stop.name for stop in access.stops if self.near(stop.xy)}
        cut_off: set[str] = set()
        if access.on_graph:
            try:
                around = access.around(place, standing, apart_m)
                around.check_origins(place)
                times = around.travel.travel_s(place, around.stops)
                reached = {
                    stop.name for stop, time in zip(around.stops, times, strict=True) if math.isfinite(time)
                }
            except InputError:
                reached = set()
            cut_off = {stop.name for stop in access.stops} - reached - near
        self._cut_off = _any_fits(access, place, rules, request, cut_off)
        return (near | cut_off) - {request.staying}


def _velocity(before: Place | None, before_s: float, place: Place | None, now_s: float) -> Place:
    """Velocity between two places [m/s]; 0 if one is missing, or they are too far apart in time."""
    if before is None or place is None or not SOON_S <= now_s - before_s <= 5.0:
        return 0.0, 0.0
    return (place[0] - before[0]) / (now_s - before_s), (place[1] - before[1]) / (now_s - before_s)


def _any_fits(
    access: FieldAccess, place: Place, rules: MissionRules, request: RequestPlan, names: set[str]
) -> bool:
    """True if a named stop fits into the budget and is not ruled out."""
    names = names - set(request.blacklisted)
    return any(
        stop.name in names
        and rules.travel_s(place, stop.xy) + rules.needed_dwell_s
        <= request.budget_left_s - rules.way_home_s(stop.xy)
        for stop in access.stops
    )
