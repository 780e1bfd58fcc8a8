# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver over time, without jumps of place, and the heading of the robot that carries it."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from typing import Final

from soilmoist_ros.sensing.gnss import Fix, FixStatus, Heard
from soilmoist_ros.sensing.position.place_judge import PlaceFix, PlaceJudge, PlaceLimits, Verdict
from soilmoist_ros.sensing.records import NAN, Position

EDGE_TOLERANCE_S = 0.5  # time for which a single fix is valid before and after its stamp [s]
CLOCK_CORRECTED_S = 60.0  # backward jump between epochs above which the receiver has corrected its clock [s]
Offset = tuple[float, float]
STEP_M = 1.0  # distance from which two fixes give a heading [m]
STEP_SDS = 3.0  # such a distance, in standard deviations of the fixes
LIMITS: Final = PlaceLimits(
    max_speed_mps=60.0, max_sd_m=1e6, first_fixes=1, agree_fixes=5, agree_s=60.0, max_gap_s=1e6,
    max_acceleration_mps2=4.0, jump_sds=5.0, unknown_jump_m=15.0,
)  # fmt: skip
"""Limits of any vehicle that counts neutrons: a steady new place counts as true after a minute."""
METRES_PER_DEG = 111_195.0


class Track:
    """The positions of a receiver in order of time: of a whole file, or growing with each epoch.

    Epochs without a fix or a date are skipped, and of several epochs with one time the first is used.

    :param max_positions: minimum number of latest positions to keep; all if ``None``

    >>> track = Track([Fix(at, Position(52.0 + at / 50, 13.0), FixStatus.FIX) for at in (0.0, 10.0)])
    >>> track.at(5.0, max_gap_s=10.0)
    Position(latitude_deg=52.1, longitude_deg=13.0, altitude_m=nan, horizontal_sd_m=nan)
    """

    def __init__(self, fixes: Iterable[Fix] = (), max_positions: int | None = None) -> None:
        self._max_positions = max_positions
        self._stamps = array("d")
        self._values = array("d")  # four of each position; as objects they need six times the memory
        self.reached_s = -math.inf
        """Time of the last epoch, with or without a fix [s since 1970 UTC]; minus infinity if there is none."""
        self.heard = Heard()
        """Epochs of the receiver, with and without a position."""
        fixes = list(fixes)
        for fix in fixes:
            self.heard.add(fix)
        placed = [fix for fix in fixes if fix.status is not FixStatus.NO_FIX and _is_known(fix.position)]
        for fix in sorted((fix for fix in placed if math.isfinite(fix.stamp_s)), key=lambda fix: fix.stamp_s):
            self.add(fix.stamp_s, fix.position)

    def __len__(self) -> int:
        return len(self._stamps)

    def __repr__(self) -> str:
        return f"Track({len(self)} positions)"

    @property
    def fixed_s(self) -> float:
        """Time of the last position [s since 1970 UTC], minus infinity if there is none."""
        return self._stamps[-1] if self._stamps else -math.inf

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Add an epoch, whose position is ``None`` or NaN without a fix; ignored if it is not later than the last
        epoch.
        """
        if stamp_s < self.reached_s - CLOCK_CORRECTED_S:
            del self._stamps[:], self._values[:]
            self.reached_s = -math.inf
        if not stamp_s > self.reached_s:
            return
        self.reached_s = stamp_s
        if position is None or not _is_known(position):
            return
        self._stamps.append(stamp_s)
        self._values.extend(
            (position.latitude_deg, position.longitude_deg, position.altitude_m, position.horizontal_sd_m)
        )
        limit = self._max_positions
        if limit is not None and len(self._stamps) > 2 * limit:
            del self._stamps[:-limit], self._values[: -4 * limit]

    def at(self, stamp_s: float, max_gap_s: float, edge_tolerance_s: float = EDGE_TOLERANCE_S) -> Position | None:
        """Position at one time [s since 1970-01-01 UTC], or ``None`` if unknown.

        It is interpolated linearly between the two neighbouring fixes, if they are at most ``max_gap_s`` apart.
        Otherwise, and before the first and after the last fix, the nearest fix within ``edge_tolerance_s`` counts.
        The standard deviation is the larger of the two; motion between the fixes is not included.
        """
        if not len(self) or not math.isfinite(stamp_s):
            return None
        after = bisect_left(self._stamps, stamp_s)
        if after < len(self) and self._stamps[after] == stamp_s:
            return self._position(after)
        before = after - 1
        if before >= 0 and after < len(self) and self._stamps[after] - self._stamps[before] <= max_gap_s:
            return self._between(before, stamp_s)
        near = [index for index in (before, after) if 0 <= index < len(self)]
        nearest = min(near, key=lambda index: abs(self._stamps[index] - stamp_s))
        return self._position(nearest) if abs(self._stamps[nearest] - stamp_s) <= edge_tolerance_s else None

    def _position(self, index: int) -> Position:
        return Position(*self._values[4 * index : 4 * index + 4])

    def _between(self, before: int, stamp_s: float) -> Position:
        start, end = self._position(before), self._position(before + 1)
        part = (stamp_s - self._stamps[before]) / (self._stamps[before + 1] - self._stamps[before])
        latitude = start.latitude_deg + part * (end.latitude_deg - start.latitude_deg)
        # the shorter direction, also across 180 degrees
        turn = (end.longitude_deg - start.longitude_deg + 180.0) % 360.0 - 180.0
        longitude = start.longitude_deg + part * turn
        if abs(longitude) > 180.0:
            longitude -= math.copysign(360.0, longitude)
        altitude = start.altitude_m + part * (end.altitude_m - start.altitude_m)
        sds = (start.horizontal_sd_m, end.horizontal_sd_m)
        return Position(latitude, longitude, altitude, NAN if any(map(math.isnan, sds)) else max(sds))


def _is_known(position: Position) -> bool:
    return math.isfinite(position.latitude_deg) and math.isfinite(position.longitude_deg)


# Where the antenna sits on the robot, and the heading that this needs --------------------------------------------


def base_from_antenna(antenna_m: Offset, heading_rad: float) -> Offset:
    """East and north from the antenna to the robot's base [m]; 0 while the heading is unknown (NaN).

    :param antenna_m: place of the antenna in the frame of the base: x forward, y to the left [m]

    >>> base_from_antenna((0.5, 0.0), 0.0)
    (-0.5, -0.0)
    """
    if math.isnan(heading_rad):
        return 0.0, 0.0
    (x_m, y_m), cosine, sine = antenna_m, math.cos(heading_rad), math.sin(heading_rad)
    return sine * y_m - cosine * x_m, -sine * x_m - cosine * y_m


class Course:
    """Heading of a robot from its positions: the direction of its last steps, kept while it stands.

    A robot that turns on the spot or drives backwards has another heading.
    """

    def __init__(self, max_headings: int | None = None) -> None:
        self._max_headings = max_headings
        self._clear()

    def _clear(self) -> None:
        self._stamps, self._headings = array("d"), array("d")
        self._anchor: Position | None = None
        self._reached_s = -math.inf

    def add(self, stamp_s: float, position: Position) -> None:
        """Add a position; ignored if it is not later than the last. A large step back of the clock begins anew."""
        if stamp_s < self._reached_s - CLOCK_CORRECTED_S:
            self._clear()
        if not stamp_s > self._reached_s:
            return
        self._reached_s = stamp_s
        anchor = self._anchor
        if anchor is None:
            self._anchor = position
            return
        east_m, north_m = _metres(anchor, position)
        sd_m = position.horizontal_sd_m
        step_m = max(STEP_M, STEP_SDS * sd_m) if sd_m > 0 else STEP_M
        if math.hypot(east_m, north_m) < step_m:
            return
        self._anchor = position
        self._stamps.append(stamp_s)
        self._headings.append(math.atan2(north_m, east_m))
        limit = self._max_headings
        if limit is not None and len(self._stamps) > 2 * limit:
            del self._stamps[:-limit], self._headings[:-limit]

    def at(self, stamp_s: float) -> float:
        """Heading at a time, counter-clockwise from east [rad]; NaN before the first."""
        before = bisect_right(self._stamps, stamp_s) - 1
        return self._headings[before] if before >= 0 else NAN


# A track without jumps of place, for vehicles of which nothing else is known ------------------------------------


class CheckedTrack(Track):
    """A track without jumps of place; :attr:`jumped` has the positions that were left out."""

    def __init__(self, fixes: Iterable[Fix] = (), max_positions: int | None = None) -> None:
        self.jumped = Track(max_positions=max_positions)
        self._judge, self._origin = PlaceJudge(LIMITS), Position(math.nan, math.nan)
        super().__init__(fixes, max_positions)

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Add an epoch; a jump counts as an epoch without a fix."""
        if stamp_s < self.reached_s - CLOCK_CORRECTED_S:
            self._judge = PlaceJudge(LIMITS)
        elif not stamp_s > self.reached_s:
            return
        if position is None or not math.isfinite(position.latitude_deg + position.longitude_deg):
            super().add(stamp_s, None)
            return
        if self._judge.fix is None:
            self._origin = position
        east_m, north_m = _metres(self._origin, position)
        fix = PlaceFix(stamp_s, east_m, north_m, position.horizontal_sd_m)
        if self._judge.take(fix) is Verdict.PLAUSIBLE:
            super().add(stamp_s, position)
            return
        self.jumped.add(stamp_s, position)
        super().add(stamp_s, None)


def _metres(origin: Position, position: Position) -> tuple[float, float]:
    """East and north on a sphere, good for short distances [m]."""
    north = position.latitude_deg - origin.latitude_deg
    east = (position.longitude_deg - origin.longitude_deg + 180.0) % 360.0 - 180.0
    return METRES_PER_DEG * east * math.cos(math.radians(origin.latitude_deg)), METRES_PER_DEG * north


def distance_m(one: Position, other: Position) -> float:
    """Distance on a sphere, good for short ones [m]."""
    return math.hypot(*_metres(one, other))
