# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The judge of measured places: which can be true by what the robot can have moved, and which are trusted.

A place is *plausible* if the robot can have come to it from the plausible places before it. Places that are not,
but agree with each other for a while, replace them: the receiver has recovered, or the robot was carried. The
first place needs such an agreement too.

A place is *trusted* if what the robot does explains it as well. A robot without a goal stands: its place may
change by the noise of the receiver. Counts of a time in which the place is not trusted belong into no map.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields, replace
from enum import Enum, StrEnum
from statistics import median
from typing import Final

from soilmoist_ros.sensing.position.place_doubt import CLOCKS_S, Doubt, DoubtOutcome

WINDOW_S: Final = 5.0  # time over which places are compared and the speed is measured [s]
SPACING_S: Final = 0.05
"""Places closer in time than this are not remembered apart, so that a flood of them costs little [s]."""
MIN_SPAN_S: Final = 1.0  # minimum time between two places that give a speed [s]
TOLERANCE: Final = 2.0
"""A place is plausible up to this multiple of the highest speed; the cause ``speed`` covers what lies between."""
STOPPING_S: Final = 3.0  # time until a robot stands whose goal has ended, or whose place is lost [s]
SDS: Final = 3.0  # errors up to this many standard deviations are noise of a single place
WANDER_SDS: Final = 7.25
"""Places of a standing robot may lie so many standard deviations apart: two independent errors of 2.5 m each are
farther apart once in 500,000 pairs, which is more than 200 h have."""
WANDER_S: Final = 60.0
"""Time after which errors of a receiver are independent [s]; at shorter times they differ as in a random walk."""
UNKNOWN_SD_M: Final = 2.5  # standard deviation of a receiver that states none, or 0, until its wander is known [m]
ANCHOR_S: Final = 10.0  # time over which the place of a standing robot is averaged [s]
STAYS_S: Final = 60.0  # time after which another place of a standing robot is believed for driving [s]
BACK_S: Final = 2.0  # time for which the place must be explained again until a doubt ends [s]
MIN_LEARNED: Final = 10  # number of changes from which on they serve for receivers that state no error
REPEATED_M: Final = 1e-3  # places this close are the very same one [m]: a receiver that works has more noise
_NOWHERE: Final = (math.nan, math.nan)
COMPARED: Final = 30  # number of seconds with places, of which the least delay passes for none
APART_S: Final = 1.0
"""Places that come within this time count as one delay [s], so that many that come at once are not the rule."""


class Expected(Enum):
    """Activity of the robot, as far as it is known."""

    ANYTHING = "anything"  # nobody knows
    STANDING = "standing"  # it has no goal
    DRIVING = "driving"  # it has a goal


class Verdict(StrEnum):
    """Verdict on a measured place."""

    PLAUSIBLE = "plausible"  # the robot is there
    UNCONFIRMED = "unconfirmed"  # it may be the first place; others must agree with it
    JUMP = "jump"  # the robot cannot have come there from where it was
    UNCERTAIN = "uncertain"  # its standard deviation is too large
    REPEATED = "repeated"  # a message of this stamp has come before
    NO_PLACE = "no_place"  # there are no coordinates
    PAST = "past"  # it is where the robot was before its last plausible place: it was held up


@dataclass(frozen=True, kw_only=True)
class PlaceLimits:
    """Limits that a measured place must satisfy.

    :param max_jump_m: largest distance of a plausible place from where the robot can have driven [m], > 0;
        whatever error the receiver states
    :param max_speed_mps: highest speed of the robot [m/s], > 0
    :param max_sd_m: highest standard deviation of each coordinate [m], > 0; unknown ones are accepted
    :param first_fixes: number of places that must agree before the first one is plausible, >= 1
    :param agree_fixes: number of places that must agree, for ``agree_s`` [s], to replace those that they
        contradict
    :param max_gap_s: time since the last plausible place up to which the robot may have moved on, and age up to
        which a place is a new one [s], >= 0
    :param max_acceleration_mps2: highest acceleration [m/s^2], > 0
    :param jump_sds: where nobody knows the robot: ``max_jump_m`` grows to this multiple of the stated standard
        deviation, or to ``unknown_jump_m`` [m] for a receiver that states none
    :raises ValueError: if a limit is out of its range
    """

    max_jump_m: float = 3.0
    max_speed_mps: float = 3.0
    max_sd_m: float = 10.0
    first_fixes: int = 3
    agree_fixes: int = 10
    agree_s: float = 5.0
    max_gap_s: float = 10.0
    max_acceleration_mps2: float = 2.0
    jump_sds: float = 0.0
    unknown_jump_m: float = 0.0

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
        """Time when it was measured, on the clock by which it came [s]; -inf if unknown."""
        return self.now_s - self.age_s

    @property
    def time_s(self) -> float:
        """Time when it was measured, or came if its age is unknown [s]; its stamp may be on another clock."""
        return self.measured_s if math.isfinite(self.age_s) else self.now_s


class PlaceJudge:
    """Decides on measured places in the order in which they come.

    :attr:`fix` is the last plausible place. ``rejected`` places in a row contradict it since ``rejected_since_s``,
        the last ``agreeing`` of them agree with each other. ``relocated_m`` is the distance of the last plausible
        place from the one before, if the robot cannot have driven there [m]; ``strayed_m`` that of a robot that
        should stand from where it stood, if that is not over soon [m]. ``doubt`` is the doubt that is open,
        ``counts`` the number of places by verdict.
    """

    def __init__(self, limits: PlaceLimits) -> None:
        self.limits = limits
        self.fix: PlaceFix | None = None
        self.rejected = 0
        self.rejected_since_s = math.inf
        self.relocated_m = 0.0
        self.doubt: Doubt | None = None
        self.strayed_m = 0.0
        self.counts = dict.fromkeys(Verdict, 0)
        self._track: deque[PlaceFix] = deque()
        self._candidates: deque[PlaceFix] = deque()
        self.agreeing = 0
        self._agreeing_since_s = math.inf
        self._stamp_s = math.nan
        self._expected = Expected.ANYTHING
        self._expected_since_s = -math.inf
        self._stand: _Stand | None = None
        self._wander = _Wander()
        self._stood: _Stand | None = None  # where the robot stood when the open doubt began
        self._sudden = self._relocated = False
        self._back: PlaceFix | None = None
        self._far = PlaceFix(0.0, 0.0, 0.0)  # the place of the open doubt that is farthest away
        self._doubted_s = math.inf
        self._repeated: tuple[float, float] | None = None  # a place that the receiver repeats in the open doubt
        self._held_s = math.inf  # since when the receiver has repeated its place while the robot drives
        self._before = _NOWHERE  # the last trusted place before the open doubt
        self._news: list[Doubt] = []
        self._offset_s = 0.0

    # What is known -------------------------------------------------------------------------------------------

    def expect(self, expected: Expected, now_s: float) -> None:
        """Set the activity of the robot from now on."""
        if expected is self._expected:
            return
        self._expected, self._expected_since_s = expected, now_s
        if expected is Expected.DRIVING:
            self._held_s = min(self._held_s, now_s)
        self._stand = None
        if expected is not Expected.STANDING:
            self._stood = None
            if self.doubt is not None and not self.rejected:  # somebody has decided to drive from there
                self._end_doubt(DoubtOutcome.LOST)

    def stood(self, xy: tuple[float, float], sd_m: float, now_s: float) -> None:
        """The robot stood here [m] when an earlier process ended; it should not have moved since."""
        self.expect(Expected.STANDING, now_s)
        self._stand = _Stand(PlaceFix(now_s - WANDER_S, *xy, sd_m))
        self._stand.steady = PlaceFix(now_s, *xy, sd_m)

    def set_clock(self, offset_s: float, now_s: float) -> None:
        """Stamps of records are the times of fixes and this [s]; an open doubt is lost so far, and goes on."""
        before_s, self._offset_s = self._offset_s, offset_s
        if self.doubt is not None and abs(offset_s - before_s) > CLOCKS_S:
            so_far = replace(self.doubt, until_s=now_s + before_s, outcome=DoubtOutcome.LOST)
            self.doubt = Doubt(now_s + offset_s)
            self._news += [so_far, self.doubt]

    def confirm(self) -> None:
        """People say that the robot is where its newest places are."""
        if self.doubt is None:
            return
        if self.rejected and self._candidates:
            self._track, newest = deque(self._candidates), self._candidates[-1]
            self._accept(newest)
            self.relocated_m = 0.0
        self._stand = None
        self._end_doubt(DoubtOutcome.CONFIRMED)

    def distrust(self, for_s: float) -> None:
        """The receiver has repeated its newest place for this time, in which the robot has driven [s]."""
        if self.fix is None or self.doubt is not None:
            return
        self._begin_doubt(self.fix, self.fix.time_s - for_s)
        self._repeated, self._before = self.fix.xy, _NOWHERE

    def news(self) -> list[Doubt]:
        """Doubts that have begun or ended since the last call."""
        news, self._news = self._news, []
        return news

    def take(self, fix: PlaceFix) -> Verdict:
        """Decide on a place; a plausible one becomes :attr:`fix`."""
        before, verdict = self.fix, self._judged(fix)
        self.counts[verdict] += 1
        if verdict is Verdict.JUMP:
            if self.doubt is None:
                self._begin_doubt(fix)
            self._sudden = True
            self._stay_away(fix)
        elif verdict is Verdict.PLAUSIBLE:
            self._weigh(fix, before)
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

    def sd_m(self, stated_m: float) -> float:
        """Standard deviation of each coordinate [m]: the stated one, else what standing has taught; NaN if
        unknown.
        """
        return stated_m if stated_m > 0 else self._wander.sd_m if self._wander.known else math.nan

    def jump_m(self, fix: PlaceFix) -> float:
        """Distance of a place from the last plausible one [m]; 0 without one."""
        return 0.0 if self.fix is None else math.dist(self.fix.xy, fix.xy)

    # Plausible places ----------------------------------------------------------------------------------------

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
        self.relocated_m = 0.0
        # A jump may last long, but nobody has driven to a place that is nearer to the rejected ones.
        elsewhere = bool(self._track and self.rejected and self._candidates) and (
            math.dist(self._candidates[-1].xy, fix.xy) < math.dist(self._track[-1].xy, fix.xy)
        )
        if self._track and not elsewhere and self._within_reach(fix, self._track):
            self._accept(fix)
            return Verdict.PLAUSIBLE
        if self._stood is not None and self._is_back(fix):
            self._track.clear()
            self._accept(fix)
            return Verdict.PLAUSIBLE
        if self._agrees(fix):
            before, explained = self.fix, self._is_explained(fix)
            self._track = deque(self._candidates)
            self._accept(fix)
            if before is not None:
                self._relocate(before, fix, explained)
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
        if self.fix is None or math.dist(self.fix.xy, fix.xy) > REPEATED_M:
            self._held_s = fix.time_s if self._expected is Expected.DRIVING else math.inf
        self.fix = fix
        self.rejected, self.rejected_since_s = 0, math.inf
        self._candidates.clear()

    def _relocate(self, before: PlaceFix, fix: PlaceFix, explained: bool) -> None:
        """Places in between were rejected, and others have replaced them."""
        away_m, limits = math.dist(before.xy, fix.xy), self.limits
        stands = self._stand is not None
        reach_m = limits.max_jump_m + (0.0 if stands else STOPPING_S * limits.max_speed_mps)
        self._stand = None
        if explained or away_m <= reach_m:
            self._end_doubt(DoubtOutcome.LOST, fix)
        else:
            self.relocated_m, self._relocated = away_m, True
            if self._expected is Expected.ANYTHING:
                self._end_doubt(DoubtOutcome.LOST, fix)

    def _is_explained(self, fix: PlaceFix) -> bool:
        """True if the stated error of either place explains the distance between them.

        The place of a standing robot does not step unless the receiver changes its kind of solution.
        """
        if self.fix is None or not (self.fix.sd_m > 0 and fix.sd_m > 0):
            return False
        low_m, high_m = sorted((self.fix.sd_m, fix.sd_m))
        changed = self._stand is None or 2 * low_m < high_m
        return changed and math.dist(self.fix.xy, fix.xy) <= WANDER_SDS * high_m

    def _agrees(self, fix: PlaceFix) -> bool:
        """True if enough places that contradict the track agree with each other, this one included."""
        if not self._candidates or not self._within_reach(fix, self._candidates):
            self._candidates.clear()
            self.agreeing, self._agreeing_since_s = 0, fix.now_s
        self._candidates.append(fix)
        self.agreeing += 1
        while self._time_s(self._candidates[0], fix) > WINDOW_S:
            self._candidates.popleft()
        if self.fix is None:
            return self.agreeing >= self.limits.first_fixes and not self._is_old(fix)
        better = 0 < 2 * fix.sd_m < self.fix.sd_m and self._is_explained(fix)
        needed_s = self.limits.agree_s if self._stand is None or better else max(self.limits.agree_s, STAYS_S)
        lasted = fix.now_s - self._agreeing_since_s >= needed_s
        return lasted and self.agreeing >= self.limits.agree_fixes

    def _is_old(self, fix: PlaceFix) -> bool:
        """True if a place is too old when it comes, or of unknown age."""
        return fix.age_s > self.limits.max_gap_s

    def _within_reach(self, fix: PlaceFix, track: deque[PlaceFix]) -> bool:
        """True if the robot can have come to a place from the newest and the oldest of others."""
        speed_mps = self.limits.max_speed_mps
        if len(track) > 1:
            span_s = self._time_s(track[-2], track[-1])
            speed_mps = min(math.dist(track[-2].xy, track[-1].xy) / span_s, speed_mps) if span_s > 0 else speed_mps
        return self._reaches(track[-1], fix, speed_mps) and self._reaches(track[0], fix, speed_mps)

    def _reaches(self, first: PlaceFix, last: PlaceFix, speed_mps: float) -> bool:
        limits, away_m = self.limits, math.dist(first.xy, last.xy)
        if away_m <= limits.max_jump_m:
            return True
        time_s = min(self._time_s(first, last), limits.max_gap_s)
        drive_m = min(
            (speed_mps + limits.max_acceleration_mps2 / 2 * time_s) * time_s,
            TOLERANCE * limits.max_speed_mps * time_s,
        )
        known = [sd_m for sd_m in (first.sd_m, last.sd_m) if sd_m > 0]
        sds = limits.jump_sds if not self._is_held else WANDER_SDS
        slack_m = sds * max(known) if known else limits.unknown_jump_m
        return away_m <= max(limits.max_jump_m, slack_m) + drive_m

    @property
    def _is_held(self) -> bool:
        """True if the receiver repeats a place to which it holds on: its first step then has the error of both."""
        held = len(self._track) > 1 and all(fix.xy == self._track[-1].xy for fix in self._track)
        return held and self._expected is Expected.DRIVING

    def _time_s(self, first: PlaceFix, last: PlaceFix) -> float:
        """Time between two places [s]: messages that were held up come at once, so their stamps count, too.

        A wrong stamp must not excuse a jump, so they count up to the longest gap.
        """
        came_s = abs(last.now_s - first.now_s)
        stamps_s = abs(last.stamp_s - first.stamp_s)
        return max(came_s, min(stamps_s, self.limits.max_gap_s)) if math.isfinite(stamps_s) else came_s

    # Trusted places ------------------------------------------------------------------------------------------

    def _weigh(self, fix: PlaceFix, before: PlaceFix | None) -> None:
        """Compare a plausible place with what the robot does."""
        self.strayed_m = 0.0
        if self._expected is Expected.STANDING and fix.measured_s >= self._expected_since_s + STOPPING_S:
            self._stand = self._stand or _Stand(fix)
        stand = self._stood or self._stand
        steps = stand is not None and before is not None and not self._explains(before, before.xy, fix)
        if self.doubt is None:
            if stand is None:
                return
            if not steps and self._explains(stand.first, stand.xy, fix):
                stand.add(fix, self._allowed_m(stand.first, fix))
                self._wander.add(fix)
                return
            self._begin_doubt(fix)
        self._sudden |= steps
        if not self._is_back(fix):
            self._stay_away(fix)
            waited_s = STAYS_S if self._sudden else BACK_S
            if stand is not None and not self._relocated and fix.now_s - self._doubted_s >= waited_s:
                self.strayed_m = math.dist(stand.xy, fix.xy)
            return
        self._back = self._back or fix
        if fix.now_s - self._back.now_s >= BACK_S:
            self._stand = self._stood or self._stand
            returned = self._sudden and self._stood is not None
            self._end_doubt(DoubtOutcome.RETURNED if returned else DoubtOutcome.LOST, self._back)

    def _is_back(self, fix: PlaceFix) -> bool:
        """True if a plausible place is explained again while a doubt is open; otherwise people must look."""
        stood = self._stood
        if self._repeated is not None and math.dist(self._repeated, fix.xy) < REPEATED_M:
            return False
        if stood is None:
            return not self._relocated
        nearer = math.dist(stood.xy, fix.xy) < math.dist(self._far.xy, fix.xy)
        return nearer and self._explains(stood.first, stood.xy, fix)

    def _stay_away(self, fix: PlaceFix) -> None:
        self._back = None
        if self._stood is None or math.dist(self._stood.xy, fix.xy) > math.dist(self._stood.xy, self._far.xy):
            self._far = fix

    def _allowed_m(self, first: PlaceFix, fix: PlaceFix) -> float:
        """Distance between two places of a standing robot that noise explains [m]."""
        sds = [place.sd_m if place.sd_m > 0 else self._wander.sd_m for place in (first, fix)]
        grown = math.sqrt(min(1.0, self._time_s(first, fix) / WANDER_S))
        return max(self.limits.max_jump_m, WANDER_SDS * max(sds) * grown)

    def _explains(self, first: PlaceFix, xy: tuple[float, float], fix: PlaceFix) -> bool:
        """True if a robot that stands at ``xy`` since the first place may be measured at another."""
        return math.dist(xy, fix.xy) <= self._allowed_m(first, fix)

    def _begin_doubt(self, fix: PlaceFix, since_s: float | None = None) -> None:
        """Doubt the place since a time [s]; since the last trusted place if that is left out."""
        self._stood, self._far, self._doubted_s = self._stand, fix, fix.now_s
        self._before = (
            (self._stand.xy if self._stand is not None else self.fix.xy) if self.fix is not None else _NOWHERE
        )
        self._sudden = self._relocated = False
        if since_s is None:
            trusted = self._stand.steady if self._stand is not None else self.fix
            since_s = (trusted or fix).time_s
            if self._expected is Expected.DRIVING:
                since_s = min(since_s, self._held_s)
        self.doubt = Doubt(since_s + self._offset_s)
        self._news.append(self.doubt)

    def _end_doubt(self, outcome: DoubtOutcome, fix: PlaceFix | None = None) -> None:
        if self.doubt is None:
            return
        until = fix or self.fix
        x_m, y_m = (math.nan, math.nan)
        if outcome is DoubtOutcome.RETURNED and self._stood is not None:
            x_m, y_m = self._stood.xy
        assert until is not None  # there is no doubt before the first place
        ended = replace(self.doubt, until_s=until.time_s + self._offset_s, outcome=outcome, x_m=x_m, y_m=y_m)
        if outcome is DoubtOutcome.CONFIRMED:
            (x_m, y_m), (before_x_m, before_y_m) = until.xy, self._before
            ended = replace(ended, x_m=x_m, y_m=y_m, before_x_m=before_x_m, before_y_m=before_y_m)
        self._news.append(ended)
        self.doubt = self._stood = self._back = self._repeated = None


class _Stand:
    """Place where a robot stands: the mean of its first measured places there."""

    def __init__(self, fix: PlaceFix) -> None:
        self._begin(fix)

    def _begin(self, fix: PlaceFix) -> None:
        self.first = self.steady = fix
        self.xy, self.sd_m, self._fixes = fix.xy, fix.sd_m, 1

    def add(self, fix: PlaceFix, allowed_m: float) -> None:
        """Add a trusted place; one of much smaller stated error replaces the mean."""
        if 0 < 2 * fix.sd_m < self.sd_m:
            self._begin(fix)
        elif fix.now_s - self.first.now_s <= ANCHOR_S:
            self._fixes += 1
            x_m, y_m = self.xy
            self.xy = x_m + (fix.x_m - x_m) / self._fixes, y_m + (fix.y_m - y_m) / self._fixes
        if math.dist(self.xy, fix.xy) <= allowed_m / 3:
            self.steady = fix


class _Wander:
    """Error of a receiver that states none, by how its places of a standing robot change from second to second.

    A drift is no error: changes are compared with those before. The error is that of a random walk which is reined
    in over two :data:`WANDER_S`, as that of receivers without corrections.
    """

    def __init__(self) -> None:
        self._changes: deque[float] = deque(maxlen=60)
        self._last: deque[PlaceFix] = deque(maxlen=3)

    @property
    def known(self) -> bool:
        """True if there were enough changes to learn from."""
        return len(self._changes) >= MIN_LEARNED

    @property
    def sd_m(self) -> float:
        """Standard deviation of each coordinate [m]."""
        if not self.known:
            return UNKNOWN_SD_M
        step_m = median(self._changes) / (1.18 * math.sqrt(2))  # 1.18: median length of a normal vector
        return min(UNKNOWN_SD_M, step_m * math.sqrt(WANDER_S))

    def add(self, fix: PlaceFix) -> None:
        """Add a trusted place of a standing robot."""
        if self._last and fix.now_s - self._last[-1].now_s > WINDOW_S:
            self._last.clear()
        if self._last and fix.now_s - self._last[-1].now_s < MIN_SPAN_S:
            return
        self._last.append(fix)
        if len(self._last) == 3:
            first, middle, last = self._last
            off = math.hypot(first.x_m - 2 * middle.x_m + last.x_m, first.y_m - 2 * middle.y_m + last.y_m)
            if off > REPEATED_M:  # a receiver that holds its place does not show its error
                self._changes.append(off / math.sqrt((last.now_s - first.now_s) / 2))


def _noise_m(first: PlaceFix, last: PlaceFix) -> float:
    """Distance between two places that noise explains [m]."""
    known = [fix.sd_m for fix in (first, last) if math.isfinite(fix.sd_m)]
    return SDS * math.hypot(*known) if known else 0.0


# How old measured places are when they come ---------------------------------------------------------------------


class PlaceAges:
    """Ages of the places of one source, by their stamps on any clock that runs evenly.

    A connection that stalls delivers all at once what it held back. The clock may be wrong, so an age is the delay
    of a place less the least delay of the last seconds.
    """

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque(maxlen=COMPARED)  # begin of a second, least delay in it

    def age_s(self, now_s: float, stamp_s: float) -> float:
        """Age of a place that comes now [s]; inf while there is nothing to compare it with, 0 without a stamp."""
        delay_s = now_s - stamp_s
        if not math.isfinite(delay_s):
            return 0.0
        if self._delays and now_s < self._delays[-1][0]:
            self.clear()
        if self._delays and now_s - self._delays[-1][0] < APART_S:
            since_s, least_s = self._delays[-1]
            self._delays[-1] = since_s, min(least_s, delay_s)
        else:
            self._delays.append((now_s, delay_s))
        return delay_s - min(least_s for _, least_s in self._delays) if len(self._delays) > 1 else math.inf

    def clear(self) -> None:
        """A clock was set: earlier delays say nothing about later ones."""
        self._delays.clear()
