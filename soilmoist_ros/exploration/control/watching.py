# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State of a mission for its watch: place and activity of the robot, and travel time of its way home."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from soilmoist_ros.exploration.control.field_access import FieldAccess
from soilmoist_ros.exploration.guard.failsafes import Cause
from soilmoist_ros.exploration.guard.watch import NEAR_ROUTE_M, Doing, RobotSurroundings, Watch
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import MissionState
from soilmoist_ros.exploration.mission.types import MissionRules, Phase
from soilmoist_ros.exploration.navigation.navigator import Navigator
from soilmoist_ros.exploration.travel.stop import Stop, Way, way_points
from soilmoist_ros.sensing import CountRecord, Expected

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

WATCHED_S: Final = 60.0
"""Time for which the robot should stand after a mission or a stop [s]; then it belongs to people."""
AHEAD_S: Final = 3.0  # time by which the robot's place is predicted [s]
_MOVED_M: Final = 2.0  # distance from which the way home is computed anew [m]


class Watching:
    """Feeds a watch with the robot's surroundings."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._access: FieldAccess | None = None
        self._route: BaseGeometry | None = None
        self._corners: list[Stop] = []
        self._set_off: tuple[float, float] | None = None
        self._watched_until_s = -math.inf
        self._way_home: tuple[tuple[float, float], float] | None = None  # from where, and how long [s]

    def use(self, access: FieldAccess) -> None:
        """Use another access to the field from now on."""
        self._access, self._way_home = access, None

    def sent(self, way: Way) -> None:
        """A goal is sent with its route."""
        import shapely

        self._corners, self._set_off = [], None
        if len(way.corners):
            (x_m, y_m), (end_x_m, end_y_m) = way.corners[0].tolist(), way.corners[-1].tolist()
            self._set_off = x_m, y_m
            self._corners = [point.stop for point in way_points(way.corners, Stop("end", end_x_m, end_y_m))]
        self._route = shapely.multilinestrings(list(shapely.linestrings(way.lines))) if len(way.lines) else None

    def stopped(self, now_s: float) -> None:
        """People have asked for a stop [s]: whatever drives the robot, it should stand soon."""
        self._watched_until_s = now_s + WATCHED_S

    def moved(self, place: tuple[float, float], sd_m: float) -> None:
        """The robot is here [m], by a fix of this standard deviation [m]."""
        import shapely

        if self._access is None:
            return
        fence = self._access.fence
        outside_m, no_go_m = fence.beyond_border_m(place), fence.in_no_go_m(place)
        around = RobotSurroundings(outside_m=outside_m, no_go_m=no_go_m, sd_m=sd_m, leaving_m=fence.leaving_m)
        if self._route is not None:
            off_m = float(self._route.distance(shapely.Point(place)))
            around = replace(around, off_route_m=off_m)
            if off_m > NEAR_ROUTE_M and (shift := self._watch.motion.shift(AHEAD_S)) is not None:
                factor = AHEAD_S / shift.span_s
                ahead = place[0] + factor * shift.east_m, place[1] + factor * shift.north_m
                around = replace(
                    around, ahead_outside_m=fence.beyond_border_m(ahead), ahead_no_go_m=fence.in_no_go_m(ahead)
                )
        self._watch.moved(around)

    def expect(self, state: MissionState, now_s: float, by_person: bool = False) -> None:
        """Set the expected motion of the robot: without a goal it stands, in a mission and a while after it.

        :param by_person: whether a person carries the sensor, who may do anything
        """
        does = Expected.DRIVING if state.goal is not None else Expected.STANDING
        known = not by_person and (state.under_way or now_s < self._watched_until_s)
        self._watch.places.expect(does if known else Expected.ANYTHING, now_s)

    def stamped(self, records: Sequence[CountRecord], clock_s: float) -> list[CountRecord]:
        """The records whose stamps are possible; the others are reported.

        :param clock_s: time of the clock that stamps records [s]
        """
        usable = []
        for record in records:
            if fault := self._watch.limits.stamps.fault(record.stamp_s, clock_s):
                self._watch.note(Cause.COUNTS_STAMP, fault)
            else:
                usable.append(record)
        return usable

    def records(self, records: Sequence[CountRecord], now_s: float) -> None:
        """Records have come that the mission counts and the map should have, quarantined ones among them."""
        places = [(record.x_m, record.y_m) for record in records]
        inside = [False] * len(places) if self._access is None else self._access.fence.contains(places)
        for record, is_inside in zip(records, inside, strict=True):
            self._watch.record(now_s, record.stamp_s, bool(is_inside), record.quarantine)

    def doing(self, mission: Mission, navigator: Navigator, waiting_for: str) -> Doing:
        """Activity of a mission and its navigation now, with the part of the navigation that is missing."""
        state, now_s = mission.state, mission.state.now_s or 0.0
        place = state.position
        if state.goal is None:
            self._route, self._corners = None, []
        if state.under_way:
            self._watched_until_s = now_s + WATCHED_S
        watched = now_s < self._watched_until_s or Cause.MOVING in self._watch.on
        return Doing(
            under_way=state.under_way,
            driving=state.goal is not None,
            near_corner=self._is_near_corner(mission.rules, place),
            still=(state.goal is None or state.goal.over) and watched,
            going_home=state.ended is not None or state.phase is Phase.RETURNING,
            waiting_for=waiting_for,
            other_client=navigator.other_client,
            feedback_age_s=navigator.feedback_age_s,
            time_left_s=max(0.0, mission.current_rules.budget_s - state.time_used_s),
            way_home_s=0.0 if place is None or not state.under_way else self._way_home_s(mission, place),
        )

    def _is_near_corner(self, rules: MissionRules, place: tuple[float, float] | None) -> bool:
        """True if the robot may stand at a bend or the end of its route; where it set off it has no reason to."""
        if place is None or self._set_off is None:
            return False
        away_m = math.dist(place, self._set_off)
        return away_m > rules.arrival_radius_m and any(rules.is_at(place, each) for each in self._corners)

    def _way_home_s(self, mission: Mission, place: tuple[float, float]) -> float:
        """Time of the way home along the real route [s]; 0 without a home, or at home."""
        home, rules = mission.rules.home, mission.rules
        if home is None or self._access is None or rules.is_at(place, home):
            return 0.0
        if self._way_home is None or math.dist(place, self._way_home[0]) > _MOVED_M:
            time_s = float(self._access.travel.travel_s(place, [home])[0])
            if not math.isfinite(time_s):  # no route: the straight distance is the best guess
                time_s = rules.travel_s(place, (home.x_m, home.y_m))
            self._way_home = place, time_s
        return self._way_home[1]
