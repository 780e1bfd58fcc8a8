# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A person who pushes, pulls or drives the sensor: the mission advises, and measures where the person stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from soilmoist_ros.exploration.guard.failsafes import Cause, WatchLimits
from soilmoist_ros.exploration.guard.motion import Motion
from soilmoist_ros.exploration.guard.watch import Watch
from soilmoist_ros.exploration.mission.types import MissionRules, Response
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop, Way
from soilmoist_ros.sensing import PlaceLimits

NEAR_M: Final = 5.0
"""Within this distance of a stop, or its ``reach_m`` if that is less, a person is there [m]."""
SDS: Final = 2.0  # and within this many standard deviations of the fix
STANDS_S: Final = 4.0  # standstill at a stop that counts as arrival [s]
CHOSEN_S: Final = 20.0
"""Standstill at another place after which it is a stop of the person's own choice [s]."""
PERSON_ENTRY_M: Final = 1e5
"""Distance outside the field at which a person may start: any [m]."""
SLOW_MPS, NOISY_MPS = 0.3, 0.6
"""Speed up to which a person stands, and that up to which a motion may be the noise of the fixes [m/s]."""
PLACES: Final = PlaceLimits(max_speed_mps=40.0, max_acceleration_mps2=5.0, max_jump_m=5.0, max_sd_m=15.0)
"""Limits of plausible fixes: the sensor may be in a car, and the receiver without corrections."""
_SHOWN: Final = frozenset(
    {
        Cause.OUTSIDE, Cause.IN_NO_GO, Cause.JUMP, Cause.FIX_OLD, Cause.RECORDS_OLD, Cause.MAP_OLD,
        Cause.BATTERY_LOW, Cause.BATTERY_EMPTY, Cause.CLOCK_STEP, Cause.COUNTS_FRAME, Cause.COUNTS_STAMP,
        Cause.COUNTS_BAD,
    }
)  # fmt: skip
"""Causes that are shown to a person. Nothing stops one, and the others make no sense for people."""


class PersonNavigator:
    """The :class:`Navigator` of a person: a goal ends where the person stands, and never by itself otherwise.

    :param report: takes the end of each goal
    :param may_count: whether the present place is worth a stop of the person's own choice
    """

    waiting_for = other_client = caution = ""
    feedback_age_s = math.nan
    stop_unheard = False

    def __init__(self, report: Callable[[Ended], None], may_count: Callable[[], bool] = lambda: True) -> None:
        self._report, self._may_count = report, may_count
        self._goal: tuple[int, Stop] | None = None
        self._motion = Motion()
        self._place: tuple[float, float] | None = None
        self._set_off: tuple[float, float] | None = None

    @property
    def on_the_way(self) -> str:
        """Distance to the stop."""
        if self._goal is None or self._place is None:
            return ""
        return f"{math.dist(self._place, self._goal[1].xy):.0f} m to {self._goal[1].name}"

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """Advise to go to a stop; where the person stands now is no stop of their choice."""
        self._goal, self._set_off = (goal_id, stop), self._place

    def cancel(self, goal_id: int) -> None:
        """Advise nothing any more; that is done at once, whatever the person does."""
        self._goal = None
        self._report(Ended(goal_id, Outcome.CANCELED, "another advice follows"))

    def moved(self, place: tuple[float, float], now_s: float, sd_m: float) -> None:
        """Judge whether the person has arrived, or stays at another place."""
        self._motion.take(now_s, place, sd_m)
        self._place = place
        if self._goal is None:
            return
        goal_id, stop = self._goal
        noise_m = SDS * sd_m if math.isfinite(sd_m) else 0.0
        near_m = max(min(NEAR_M, stop.reach_m), noise_m)
        at_stop = math.dist(place, stop.xy) <= near_m
        if not at_stop and self._set_off is not None and math.dist(place, self._set_off) <= near_m:
            return
        self._set_off = None
        if self._stands(STANDS_S if at_stop else CHOSEN_S) and self._may_count():
            self._goal = None
            self._report(Ended(goal_id, Outcome.SUCCEEDED, "the person stands here"))

    def _stands(self, for_s: float) -> bool:
        """True if the person has hardly moved for a time [s], nor in its second half."""
        for span_s in (for_s, for_s / 2):
            shift = self._motion.shift(span_s, whole=True)
            if shift is None:
                return False
            limit_m = max(SLOW_MPS * shift.span_s, min(shift.limit_m, NOISY_MPS * shift.span_s))
            if shift.length_m > limit_m:
                return False
        return True

    def tick(self, now_s: float) -> None:
        """Do nothing: a person has no time limit."""


def person_rules(rules: MissionRules) -> MissionRules:
    """Rules of a mission for a person: no trip takes too long, and a person stands whenever a goal is over."""
    return replace(
        rules,
        by_person=True,
        goal_time_margin_s=1e9,
        standstill_s=0.0,
        arrival_radius_m=max(rules.arrival_radius_m, NEAR_M),
    )


def person_watch(limits: WatchLimits | None = None) -> Watch:
    """A watch that shows what a person should know, and stops nobody."""
    limits = limits or WatchLimits()
    return Watch(
        replace(limits, place=PLACES, fix_frozen_s=0.0),
        {cause: Response.WARN if cause in _SHOWN else Response.IGNORE for cause in Cause},
    )
