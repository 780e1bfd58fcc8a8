# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which measured places the robot can be at: the others never reach the mission or the navigation.

A place is plausible if the robot can have come to it from the plausible places before it. Places that are not, but
agree with each other for a while, replace them: the receiver has recovered, or the robot was carried. The first
place needs such an agreement too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Final

WINDOW_S: Final = 5.0
"""Time over which places are compared and the speed is measured [s]."""
SPACING_S: Final = 0.05
"""Places closer in time than this are not remembered apart, so that a flood of them costs little [s]."""
MIN_SPAN_S: Final = 1.0
"""Minimum time between two places that give a speed [s]."""
TOLERANCE: Final = 2.0
"""A place is plausible up to this multiple of the highest speed; the cause ``speed`` covers what lies between."""
STOPPING_S: Final = 3.0
"""Time until a robot stands whose place is lost [s]."""
SDS: Final = 3.0
"""Errors up to this many standard deviations are noise."""


class Verdict(StrEnum):
    """What a measured place is worth."""

    PLAUSIBLE = "plausible"
    """The robot is there."""
    UNCONFIRMED = "unconfirmed"
    """It may be the first place; others must agree with it."""
    JUMP = "jump"
    """The robot cannot have come there from where it was."""
    UNCERTAIN = "uncertain"
    """Its standard deviation is too large."""
    REPEATED = "repeated"
    """A message of this stamp has come before."""
    NO_PLACE = "no_place"
    """There are no coordinates."""
    PAST = "past"
    """It is where the robot was before its last plausible place: it was held up."""


@dataclass(frozen=True, kw_only=True)
class PlaceLimits:
    """What a place must satisfy.

    :param max_jump_m: noise and sudden moves up to this distance are plausible [m], > 0
    :param max_speed_mps: highest speed of the robot [m/s], > 0
    :param max_sd_m: highest standard deviation of each coordinate [m], > 0; unknown ones are accepted
    :param first_fixes: number of places that must agree before the first one is plausible, >= 1
    :param agree_fixes: number of places that must agree to replace those that they contradict, >= 1
    :param agree_s: time over which the latter must agree [s], >= 0
    :param max_gap_s: time since the last plausible place up to which the robot may have moved on, and age up to
        which a place is a new one [s], >= 0
    :raises ValueError: if a limit is out of its range
    """

    max_jump_m: float = 5.0
    max_speed_mps: float = 3.0
    max_sd_m: float = 10.0
    first_fixes: int = 3
    agree_fixes: int = 10
    agree_s: float = 5.0
    max_gap_s: float = 10.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, low = getattr(self, field.name), 1 if field.name.endswith("_fixes") else 0
            if not (math.isfinite(value) and value >= low):
                raise ValueError(f"{field.name} must be >= {low} and finite, got {value}")


@dataclass(frozen=True, slots=True)
class PlaceFix:
    """A measured place.

    :param now_s: time at which it came [s]
    :param x_m: east of the field's datum [m]
    :param y_m: north of the field's datum [m]
    :param sd_m: standard deviation of each coordinate [m], NaN if unknown
    :param stamp_s: time of the measurement on any clock that runs evenly [s], NaN if unknown
    :param age_s: time from the measurement until it came [s]; inf if unknown
    """

    now_s: float
    x_m: float
    y_m: float
    sd_m: float = math.nan
    stamp_s: float = math.nan
    age_s: float = 0.0

    @property
    def xy(self) -> tuple[float, float]:
        """The place [m]."""
        return self.x_m, self.y_m

    @property
    def measured_s(self) -> float:
        """When it was measured, on the clock by which it came [s]; -inf if unknown."""
        return self.now_s - self.age_s


class PlaceFilter:
    """Decides on measured places in the order in which they come.

    :param limits: what a place must satisfy

    Attributes
    ----------
    fix : PlaceFix | None
        the last plausible place
    rejected : int
        number of places in a row that contradict it
    rejected_since_s : float
        when the first of them came [s]
    relocated_m : float
        distance of the last plausible place from the one before, if the robot cannot have driven there after
        places in between were rejected [m]; otherwise 0
    counts : dict[Verdict, int]
        number of places by verdict
    """

    def __init__(self, limits: PlaceLimits) -> None:
        self.limits = limits
        self.fix: PlaceFix | None = None
        self.rejected = 0
        self.rejected_since_s = math.inf
        self.relocated_m = 0.0
        self.counts = dict.fromkeys(Verdict, 0)
        self._track: deque[PlaceFix] = deque()
        self._candidates: deque[PlaceFix] = deque()
        self._agreeing = 0
        self._agreeing_since_s = math.inf
        self._stamp_s = math.nan

    def take(self, fix: PlaceFix) -> Verdict:
        """Decide on a place; a plausible one becomes :attr:`fix`."""
        verdict = self._judged(fix)
        self.counts[verdict] += 1
        return verdict

    @property
    def speed_mps(self) -> float:
        """Speed between plausible places, less what noise explains [m/s]; 0 while unknown."""
        if self.fix is None:
            return 0.0
        first, last = self._track[0], self.fix
        span_s = self._time_s(first, last)
        if span_s < MIN_SPAN_S:
            return 0.0
        return max(0.0, math.dist(first.xy, last.xy) - _noise_m(first, last)) / span_s

    def jump_m(self, fix: PlaceFix) -> float:
        """Distance of a place from the last plausible one [m]; 0 without one."""
        return 0.0 if self.fix is None else math.dist(self.fix.xy, fix.xy)

    def _judged(self, fix: PlaceFix) -> Verdict:
        if not (math.isfinite(fix.x_m) and math.isfinite(fix.y_m)):
            return Verdict.NO_PLACE
        if fix.stamp_s == self._stamp_s:
            return Verdict.REPEATED
        self._stamp_s = fix.stamp_s
        if fix.sd_m > self.limits.max_sd_m:
            return Verdict.UNCERTAIN
        if self.fix is not None and self._is_old(fix) and fix.measured_s < self.fix.measured_s:
            return Verdict.PAST
        if self._track and self._within_reach(fix, self._track):
            self._accept(fix)
            return Verdict.PLAUSIBLE
        if self._agrees(fix):
            self._track = deque(self._candidates)
            self._accept(fix)
            return Verdict.PLAUSIBLE
        if self.fix is None:
            return Verdict.UNCONFIRMED
        if not self.rejected:
            self.rejected_since_s = fix.now_s
        self.rejected += 1
        return Verdict.JUMP

    def _accept(self, fix: PlaceFix) -> None:
        if not self._track or self._time_s(self._track[-1], fix) >= SPACING_S:
            self._track.append(fix)
        while self._time_s(self._track[0], fix) > WINDOW_S:
            self._track.popleft()
        away_m = self.jump_m(fix) if self.rejected else 0.0
        reach_m = self.limits.max_jump_m + STOPPING_S * self.limits.max_speed_mps
        self.relocated_m = away_m if away_m > reach_m else 0.0
        self.fix = fix
        self.rejected, self.rejected_since_s = 0, math.inf
        self._candidates.clear()

    def _agrees(self, fix: PlaceFix) -> bool:
        """Whether enough places that contradict the track agree with each other, this one included."""
        if not self._candidates or not self._within_reach(fix, self._candidates):
            self._candidates.clear()
            self._agreeing, self._agreeing_since_s = 0, fix.now_s
        self._candidates.append(fix)
        self._agreeing += 1
        while self._time_s(self._candidates[0], fix) > WINDOW_S:
            self._candidates.popleft()
        if self.fix is None:
            return self._agreeing >= self.limits.first_fixes and not self._is_old(fix)
        lasted = fix.now_s - self._agreeing_since_s >= self.limits.agree_s
        return lasted and self._agreeing >= self.limits.agree_fixes

    def _is_old(self, fix: PlaceFix) -> bool:
        """Whether a place is too old when it comes, or of unknown age."""
        return fix.age_s > self.limits.max_gap_s

    def _within_reach(self, fix: PlaceFix, track: Iterable[PlaceFix]) -> bool:
        """Whether the robot can have come from all these places to another one."""
        return all(self._reaches(other, fix) for other in track)

    def _reaches(self, first: PlaceFix, last: PlaceFix) -> bool:
        limits, away_m = self.limits, math.dist(first.xy, last.xy)
        if away_m <= limits.max_jump_m:  # mostly: ten fixes a second are compared with fifty places each
            return True
        drive_m = TOLERANCE * limits.max_speed_mps * min(self._time_s(first, last), limits.max_gap_s)
        return away_m <= limits.max_jump_m + _noise_m(first, last) + drive_m

    def _time_s(self, first: PlaceFix, last: PlaceFix) -> float:
        """Time between two places [s].

        Messages that were held up come at once, so their stamps count too. A wrong stamp must not excuse a jump,
        so they count up to the longest gap.
        """
        came_s = abs(last.now_s - first.now_s)
        stamps_s = abs(last.stamp_s - first.stamp_s)
        return max(came_s, min(stamps_s, self.limits.max_gap_s)) if math.isfinite(stamps_s) else came_s


def _noise_m(first: PlaceFix, last: PlaceFix) -> float:
    """Distance between two places that noise explains [m]."""
    known = [fix.sd_m for fix in (first, last) if math.isfinite(fix.sd_m)]
    return SDS * math.hypot(*known) if known else 0.0
