# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An independent judge of what the robot truly did. It shares no code with the guard of the package."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rehearsal.cases import Ground, Place
from soilmoist_ros.exploration import Finish, MissionEnd, MissionStatus, Phase, Stop, Visit, VisitEnd
from soilmoist_ros.mapping import Samples
from soilmoist_ros.sensing import CountRecord

Records = Iterable[CountRecord]

STEP_M = 0.1  # step along the true way at which it is measured [m]


class Kind(StrEnum):
    """Kinds of violations."""

    NO_GO = "drove into a no-go area"
    OUTSIDE = "drove out of the field"
    MOVED_STANDING = "moved while it was said to stand"
    MOVED_STOPPED = "moved after a stop without a resume"
    GOAL_STOPPED = "goal sent without a resume"
    WRONG_PLACE = "went on with a wrong place"
    WRONG_VISIT = "counted at a wrong place"
    STOP_AWAY = "stop that drives the robot away"
    TWO_GOALS = "two goals at once"
    GOAL_OUTSIDE = "goal outside the fence"
    NOT_HOME = "not home after low battery"
    EARLY = "ended early for want of time"
    OVER_BUDGET = "measured beyond the budget"
    MAP_DIFFERS = "map differs from what was published"
    LOST = "acknowledged record lost"
    INVENTED = "record that nobody published"
    NO_REASON = "stopped without a reason"
    UNENDED = "neither ended nor says why it waits"
    DEAD = "no progress and nobody is asked"
    IN_NO_GO = "led into a no-go area and not stopped"
    AWAY = "led out of the field and not stopped"
    OFF_ROUTE = "led off its route and not stopped"
    CONFIRMED = "said to stand while it moved"
    UNNOTICED = "moved unnoticed where it should stand"
    NOT_REACHED = "counted at a stop that was not reached"
    OVERRIDDEN = "goal of somebody else overridden"
    MISPLACED = "record mapped at a wrong place"
    CRASH = "exception"


@dataclass(frozen=True)
class Violation:
    """Something that must not happen."""

    kind: Kind  # what
    at_s: float  # when, since the start [s]
    what: str  # details

    def __str__(self) -> str:
        return f"{self.kind} at {self.at_s:.0f} s: {self.what}"


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What is tolerated."""

    beyond_m: float = 3.0  # nodes of a travel graph may lie this far outside the field [m]
    border_m: float = 0.2  # the robot's centre may be this far beyond a border [m]
    goal_m: float = 0.2  # likewise for a goal [m]
    still_m: float = 0.5  # a robot that moves less stands [m]
    stopping_s: float = 6.0  # time for a robot that obeys to stand after a command to stop [s]
    stop_m: float = 6.0  # a pose that is to stop the robot may be this far from it [m]
    wrong_m: float = 8.0  # error of the place that must be noticed ... [m]
    wrong_s: float = 15.0  # ... within this time [s]
    visit_m: float = 4.0  # a visit may be this far from its stop [m]
    stuck_s: float = 900.0  # time without a visit or a goal after which somebody must be asked [s]
    same_m: float = 0.0  # places of samples may differ by this, where messages round them [m]
    late_s: float = 60.0  # the mission may measure this long beyond its budget [s]
    early: float = 0.6  # share of the budget before which time cannot be up
    deep_m: float = 1.0  # a robot that is led astray is stopped when it is this deep in a no-go area ... [m]
    away_m: float = 3.0  # ... or this far out of the field ... [m]
    off_m: float = 11.0  # ... or this far from its route ... [m]
    notice_s: float = 3.0  # ... within this time [s]
    slow_m: float = 0.05  # a robot that moves this far in each of three seconds does not stand [m]
    moved_m: float = 1.0  # a robot that moves this far where it should stand is noticed [m]
    reach_m: float = 0.5  # a robot that counts may be this much farther from its stop than the stop demands [m]
    misplaced_m: float = 3.0  # a mapped record may be this far from its true place [m]
    noise_m: float = 0.0  # errors of fixes up to this distance are noise, and add to the distances above [m]


MOVING = (Phase.TRAVELLING, Phase.RETURNING)
STANDING = (Phase.PAUSED, Phase.IDLE, Phase.FINISHED)
EXPLAINED = (Phase.PAUSED, Phase.CANCELLING, Phase.WAITING, Phase.FINISHED)
"""Phases in which the mission must say why."""


class Judge:
    """Watches the true motion, and what is sent and said.

    :param ground: the field, of which it makes its own geometry
    :param budget_s: budget of the mission [s]
    :param limits: what is tolerated
    :param radius_m: a robot is at a stop within this distance [m]
    """

    def __init__(
        self, ground: Ground, budget_s: float, limits: Limits | None = None, radius_m: float = 3.0
    ) -> None:
        limits = limits or Limits()
        self._radius_m = radius_m
        self.violations: list[Violation] = []
        self._limits = limits
        self._budget_s = budget_s
        self._no_go = [shapely.Polygon(ring) for ring in ground.field.no_go]
        beyond_m = limits.beyond_m if ground.graph is not None else 0.0
        self._field = shapely.Polygon(ground.field.polygon).buffer(beyond_m)
        self._counts: Counter[Kind] = Counter()
        self._stopped: tuple[float, str] | None = None  # by people, and not resumed
        self._stopped_at: Place | None = None
        self._stood: tuple[Phase, Place] | None = None
        self._wrong_since_s: float | None = None
        self._since_s: dict[Kind, float] = {}  # since when something lasts that must be stopped or noticed
        self._led_m = 0.0
        self._places: deque[Place] = deque(maxlen=4)
        self._phase = Phase.IDLE
        self._kept: Place | None = None
        self._ground = ground
        self._progress_s = self._started_s = 0.0
        self._counted: list[Place] = []
        self._target: Stop | None = None  # where they were counted
        self._sent = 0
        self._begun = False

    def blame(self, kind: Kind, now_s: float, what: str) -> None:
        self._counts[kind] += 1
        if self._counts[kind] == 1:
            self.violations.append(Violation(kind, now_s, what))

    # What the robot does -------------------------------------------------------------------------------------

    def drove(
        self,
        now_s: float,
        before: Place,
        passed: list[Place],
        status: MissionStatus,
        obeys: bool = True,
        led: bool = False,
        people: bool = False,
        right: Sequence[Place] = (),
        way: Sequence[Place] = (),
    ) -> None:
        """The robot has driven in the last second.
        :param before: where it was [m]
        :param passed: places that it has passed, the last one included [m]
        :param status: what the mission said before
        :param obeys: whether the navigation does what it is asked; no stop can be demanded of one that does not
        :param led: whether something else than the mission has moved it: then it must be stopped, or be noticed
        :param people: whether people drive it, who may drive anywhere
        :param right: the way that it was asked for; empty if it was not asked for one [m]
        :param way: all of the route of which that is a part [m]
        """
        place = passed[-1] if passed else before
        self._look_at_led(now_s, place, status, *((right, way) if led and not people else ((), ())))
        if passed and not led:
            self._look_at_way(now_s, shapely.LineString([before, *passed]))
        if led or (passed and self._led_m):
            self._led_m = max(self._depths(place))  # it has to come back from there
        if people:
            self._since_s.clear()
        elif passed:
            self._look_at_depth(now_s, place, status)
        self._look_at_standstill(now_s, place, status, led)
        if led:
            self._stopped_at = None
        else:
            self._look_at_stop(now_s, place, status, obeys)
        if status.phase is Phase.COUNTING:
            if status.target != self._target:  # a planner that was killed may not have published its last visit
                self._target = status.target
                self._counted.clear()
            self._counted.append(place)
        elif status.phase in MOVING:
            self._counted.clear()

    def _look_at_stop(self, now_s: float, place: Place, status: MissionStatus, obeys: bool) -> None:
        if self._stopped is None:
            return
        since_s, what = self._stopped
        if self._stopped_at is None and (
            status.phase in STANDING or (obeys and now_s > since_s + self._limits.stopping_s)
        ):
            self._stopped_at = place
        moved_m = math.dist(self._stopped_at, place) if self._stopped_at is not None else 0.0
        if moved_m > self._limits.still_m:
            self.blame(Kind.MOVED_STOPPED, now_s, f"by {moved_m:.1f} m after {what} at {since_s:.0f} s")

    def _look_at_depth(self, now_s: float, place: Place, status: MissionStatus) -> None:
        """A robot that is where it must not be is stopped in time, whoever has led it there."""
        limits, (deep_m, away_m) = self._limits, self._depths(place)
        safe = _alarmed(status) or status.phase in (*STANDING, Phase.CANCELLING)
        self._lasts(Kind.IN_NO_GO, now_s, not safe and deep_m > limits.deep_m, f"{deep_m:.1f} m deep")
        self._lasts(Kind.AWAY, now_s, not safe and away_m > limits.away_m, f"{away_m:.1f} m outside")

    def _depths(self, place: Place) -> tuple[float, float]:
        """How deep a place is in a no-go area, and how far outside the field [m]."""
        point = shapely.Point(place)
        deep_m = max((float(a.exterior.distance(point)) for a in self._no_go if a.contains(point)), default=0.0)
        return deep_m, float(self._field.distance(point))

    def _look_at_led(
        self, now_s: float, place: Place, status: MissionStatus, right: Sequence[Place], way: Sequence[Place]
    ) -> None:
        lines = [shapely.LineString(each) for each in (right, way) if len(each) > 1] if len(right) > 1 else []
        off_m = min((float(line.distance(shapely.Point(place))) for line in lines), default=0.0)
        off = status.phase in MOVING and not _alarmed(status) and off_m > self._limits.off_m
        self._lasts(Kind.OFF_ROUTE, now_s, off, f"{off_m:.1f} m off")
        self._places.append(place)
        before, self._phase = self._phase, status.phase
        confirmed = before is Phase.CANCELLING and status.phase in STANDING and not _alarmed(status)
        steps_m = [math.dist(one, other) for one, other in pairwise(self._places)]
        if confirmed and len(steps_m) == 3 and min(steps_m) > self._limits.slow_m:
            self.blame(Kind.CONFIRMED, now_s, f"{status.phase} at {steps_m[-1]:.2f} m/s: {status.reason}")
        reach_m = None if status.target is None else self.reach_m(status.target)
        if status.phase is Phase.COUNTING and before is not Phase.COUNTING and reach_m is not None:
            assert status.target is not None
            away_m = math.dist(place, (status.target.x_m, status.target.y_m))
            if away_m > reach_m + self._limits.reach_m + self._limits.noise_m:
                self.blame(Kind.NOT_REACHED, now_s, f"{status.target.name}: {away_m:.1f} m, not {reach_m:.1f} m")

    def reach_m(self, stop: Stop) -> float:
        """Distance within which a robot is at a stop, and not at another node [m]."""
        graph, here = self._ground.graph, (stop.x_m, stop.y_m)
        if graph is None:
            return self._radius_m
        apart_m = np.hypot(*(graph.xy - here).T)
        return min(self._radius_m, float(apart_m[apart_m > 0.01].min(initial=math.inf)) / 2)

    def _lasts(self, kind: Kind, now_s: float, wrong: bool, what: str) -> None:
        """Blame what is wrong for longer than it takes to notice it and to stop."""
        if not wrong:
            self._since_s.pop(kind, None)
            return
        since_s = self._since_s.setdefault(kind, now_s)
        if now_s - since_s > self._limits.notice_s:
            self.blame(kind, now_s, f"{what} after {now_s - since_s:.0f} s")

    def _look_at_way(self, now_s: float, way: shapely.LineString) -> None:
        for number, area in enumerate(self._no_go, 1):
            self._measure(now_s, Kind.NO_GO, way.intersection(area), area.exterior, f"no-go area {number}")
        self._measure(now_s, Kind.OUTSIDE, way.difference(self._field), self._field, "the field")

    def _measure(self, now_s: float, kind: Kind, part: BaseGeometry, border: BaseGeometry, name: str) -> None:
        """Blame a part of the way that is too far from the border that it should not have crossed."""
        if part.is_empty:
            return
        places = shapely.points(shapely.get_coordinates(shapely.segmentize(part, STEP_M)))
        far_m = shapely.distance(border, places)
        if far_m.max() > self._limits.border_m + self._led_m:
            worst = places[int(far_m.argmax())]
            self.blame(
                kind, now_s, f"{name}, {far_m.max():.1f} m beyond its border at ({worst.x:.1f}, {worst.y:.1f})"
            )

    def _look_at_standstill(self, now_s: float, place: Place, status: MissionStatus, led: bool) -> None:
        stands = status.phase in (*STANDING, Phase.COUNTING) and self._begun
        if not stands or _alarmed(status, warned=True) or self._kept is None:
            self._kept = place
        moved_m = math.dist(self._kept, place)
        far = stands and moved_m > self._limits.moved_m + self._limits.noise_m
        self._lasts(Kind.UNNOTICED, now_s, far, f"{moved_m:.1f} m while {status.phase}: {status.reason}")
        if status.phase not in STANDING or not self._begun or led:
            self._stood = None
            return
        if self._stood is None or self._stood[0] is not status.phase:
            self._stood = status.phase, place
        moved_m = math.dist(self._stood[1], place)
        if moved_m > self._limits.still_m:
            self.blame(Kind.MOVED_STANDING, now_s, f"by {moved_m:.1f} m while {status.phase}: {status.reason}")

    # What is sent and said -----------------------------------------------------------------------------------

    def sent(self, now_s: float, place: Place, what: str, allowed: Place | None = None) -> None:
        """A goal has reached the navigation; one at ``allowed`` is always right."""
        self._progress_s = now_s
        self._sent += 1
        if self._stopped is not None:
            self.blame(Kind.GOAL_STOPPED, now_s, f"{what}, after {self._stopped[1]} at {self._stopped[0]:.0f} s")
        limit_m = self._limits.goal_m
        inside_m, outside_m = self._depths(place)
        if max(outside_m, inside_m) > limit_m and (allowed is None or math.dist(place, allowed) > 0.1):
            text = f"{outside_m:.1f} m outside" if outside_m else f"{inside_m:.1f} m inside a no-go area"
            self.blame(Kind.GOAL_OUTSIDE, now_s, f"{what}: {text}")

    def stop_sent(self, now_s: float, place: Place, robot: Place) -> None:
        """A pose that is to stop the robot; it must be near its true place [m]."""
        away_m = math.dist(place, robot)
        if away_m > self._limits.stop_m:
            self.blame(Kind.STOP_AWAY, now_s, f"to ({place[0]:.1f}, {place[1]:.1f}), {away_m:.1f} m away")

    def replaced(self, now_s: float, what: str) -> None:
        """A goal was sent while the navigation worked on another."""
        self.blame(Kind.TWO_GOALS, now_s, what)

    def overridden(self, now_s: float, what: str) -> None:
        """The mission has acted against a goal of somebody else."""
        self.blame(Kind.OVERRIDDEN, now_s, what)

    def stopped(self, now_s: float, what: str) -> None:
        """Somebody has paused or aborted the mission, or pressed an emergency stop."""
        if self._stopped is None:
            self._stopped, self._stopped_at = (now_s, what), None

    def resumes(self, now_s: float, resume: Callable[[], bool]) -> bool:
        """An operator resumes or starts a mission.
        :param resume: does it; whether it is accepted. Goals may be sent meanwhile, but not if it is refused
        """
        held, sent = (self._stopped, self._stopped_at), self._sent
        self._stopped = None
        accepted = resume()
        if not accepted:
            self._stopped, self._stopped_at = held
            if self._sent > sent:
                self.blame(Kind.GOAL_STOPPED, now_s, "although the resume was refused")
            return False
        if not self._begun:
            self._begun, self._started_s = True, now_s
        self._progress_s = now_s
        return True

    def said(self, now_s: float, status: MissionStatus, error_m: float) -> None:
        """The mission says this; the place that the package has is wrong by so much [m]."""
        alarmed = _alarmed(status)
        at_work = status.phase in (*MOVING, Phase.COUNTING) and not alarmed
        if at_work and error_m > self._limits.wrong_m:
            since_s = self._wrong_since_s = now_s if self._wrong_since_s is None else self._wrong_since_s
            if now_s - since_s > self._limits.wrong_s:
                self.blame(Kind.WRONG_PLACE, now_s, f"by {error_m:.0f} m for {now_s - since_s:.0f} s")
        else:
            self._wrong_since_s = None
        if status.phase in EXPLAINED and not status.reason.strip():
            self.blame(Kind.NO_REASON, now_s, f"{status.phase}")
        measures = status.phase in (Phase.PLANNING, Phase.TRAVELLING, Phase.COUNTING)
        if measures and status.time_used_s > self._budget_s + self._limits.late_s:
            self.blame(Kind.OVER_BUDGET, now_s, f"{status.phase} after {status.time_used_s:.0f} s")
        if status.phase in STANDING or alarmed:
            self._progress_s = now_s
        elif self._begun and now_s - self._progress_s > self._limits.stuck_s:
            self.blame(Kind.DEAD, now_s, f"{status.phase}: {status.reason}")

    def visited(self, now_s: float, visit: Visit) -> None:
        self._progress_s = now_s
        if visit.ended is VisitEnd.UNKNOWN or not visit.outcome:
            self.blame(Kind.NO_REASON, now_s, f"{visit.name}: nobody says why counting ended")
        counted = self._counted[: -round(self._limits.wrong_s)] if visit.ended is VisitEnd.MOVED else self._counted
        away_m = max((math.dist(at, (visit.stop_x_m, visit.stop_y_m)) for at in counted), default=0.0)
        if away_m > self._limits.visit_m:
            self.blame(Kind.WRONG_VISIT, now_s, f"{visit.name}: the robot was {away_m:.1f} m away")
        self._counted.clear()

    def finished(self, now_s: float, finish: Finish) -> None:
        used_s = now_s - self._started_s
        if finish.code is MissionEnd.TIME_UP and used_s < self._limits.early * self._budget_s:
            self.blame(Kind.EARLY, now_s, f"time is said to be up after {used_s:.0f} s: {finish.reason}")

    def home_by(self, now_s: float, place: Place, home: Stop | None) -> None:
        """The battery has been low for a while: the robot must be home now."""
        away_m = 0.0 if home is None else math.dist(place, (home.x_m, home.y_m))
        if away_m > self._limits.visit_m:
            self.blame(Kind.NOT_HOME, now_s, f"{away_m:.1f} m away")

    def mapped(self, now_s: float, samples: Samples | None, whole: Samples) -> None:
        """The samples of the map at the end, ``None`` for no map, and those of all that was published."""
        if samples is None:
            if len(whole):
                self.blame(Kind.MAP_DIFFERS, now_s, f"there is none, but {len(whole)} samples were published")
            return
        same = len(samples) == len(whole) and np.array_equal(samples.counts, whole.counts)
        if not (same and np.allclose(samples.xy, whole.xy, rtol=0.0, atol=self._limits.same_m)):
            text = f"{len(samples)} samples of {samples.counts.sum():.0f} counts"
            self.blame(Kind.MAP_DIFFERS, now_s, f"{text}, not {len(whole)} of {whole.counts.sum():.0f}")

    def placed(self, now_s: float, mapped: Records, truth: Mapping[tuple[float, int], Place]) -> None:
        """Records that the map has, with the true places of all records by stamp and counts [m]."""
        wrong = []
        for record in mapped:
            place = truth.get((round(record.stamp_s, 3), record.raw_counts))
            if place is not None and not record.quarantine and math.isfinite(record.x_m):
                wrong.append((math.dist(place, (record.x_m, record.y_m)), record.stamp_s))
        far = [one for one in wrong if one[0] > self._limits.misplaced_m + self._limits.noise_m]
        if far:
            self.blame(
                Kind.MISPLACED, now_s, f"{len(far)} of {len(wrong)} records, the worst {max(far)[0]:.1f} m off"
            )

    def kept(self, now_s: float, acknowledged: Records, stored: Records, where: str) -> None:
        """What was acknowledged must be stored.
        :param acknowledged: records that must be there
        :param stored: records that are there
        :param where: what holds them
        """
        if lost := _identities(acknowledged) - _identities(stored):
            self.blame(Kind.LOST, now_s, f"{lost.total()} not in {where}, the first of {min(lost)[0]:.1f} s")

    def known(self, now_s: float, stored: Records, acknowledged: Records, where: str) -> None:
        """What is stored must have been acknowledged, each record once; parameters as those of :meth:`kept`."""
        if more := _identities(stored) - _identities(acknowledged):
            self.blame(Kind.INVENTED, now_s, f"{more.total()} in {where}, the first of {min(more)[0]:.1f} s")

    def ended(self, now_s: float, status: MissionStatus | None) -> None:
        """The last that the mission says: it has ended, or waits for people or for the end of an alarm."""
        if status is None:
            self.blame(Kind.UNENDED, now_s, "it says nothing")
        elif status.phase not in STANDING and not (status.needs_operator and status.reason):
            self.blame(Kind.UNENDED, now_s, f"{status.phase}: {status.reason}")


def _alarmed(status: MissionStatus, warned: bool = False) -> bool:
    """Whether people are asked or an alarm stops the robot; or whether an alarm is on that only warns."""
    return status.needs_operator or any(alarm.response.stops or warned for alarm in status.alarms)


def _identities(records: Records) -> Counter[tuple[float, int, float]]:
    """Records by what they are known by, whatever has become of their places on the way."""
    return Counter((round(record.stamp_s, 3), record.raw_counts, record.exposure_s) for record in records)
