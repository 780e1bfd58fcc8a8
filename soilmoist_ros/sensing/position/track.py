# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver over time."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left
from collections.abc import Iterable

from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.position.heard import Heard
from soilmoist_ros.sensing.position.lever_arms import Course
from soilmoist_ros.sensing.records import NAN, Position

EDGE_TOLERANCE_S = 0.5
"""Time for which a single fix is valid before and after its stamp [s]."""
CLOCK_CORRECTED_S = 60.0
"""Backward jump between epochs above which the receiver has corrected its clock [s]."""


class Track:
    """The positions of a receiver in order of time: of a whole file, or growing with each epoch.

    :param fixes: epochs in any order; epochs without a fix or a date are skipped, and of several epochs with one
        time the first is used
    :param max_positions: minimum number of latest positions to keep; all if ``None``

    >>> track = Track.from_positions([(0.0, Position(52.0, 13.0)), (10.0, Position(52.2, 13.0))])
    >>> track.at(5.0, max_gap_s=10.0)
    Position(latitude_deg=52.1, longitude_deg=13.0, altitude_m=nan, horizontal_sd_m=nan)
    """

    def __init__(self, fixes: Iterable[Fix] = (), max_positions: int | None = None) -> None:
        self._max_positions = max_positions
        self._stamps = array("d")
        self._values = array("d")  # four of each position; as objects they need six times the memory
        self.course = Course(max_positions)
        """Heading of the robot that carries the receiver."""
        self.reached_s = -math.inf
        """Time of the last epoch, with or without a fix [s since 1970 UTC]; minus infinity if there is none."""
        self.heard = Heard()
        """Epochs of the receiver, with and without a position."""
        fixes = list(fixes)
        for fix in fixes:
            self.heard.add(fix)
        self._set((fix.stamp_s, fix.position) for fix in fixes if fix.status is not FixStatus.NO_FIX)

    @classmethod
    def from_positions(cls, positions: Iterable[tuple[float, Position]]) -> Track:
        """Track from pairs of time [s since 1970 UTC] and position, in any order."""
        track = cls()
        track._set(positions)
        return track

    def _set(self, positions: Iterable[tuple[float, Position]]) -> None:
        valid = [(stamp_s, place) for stamp_s, place in positions if math.isfinite(stamp_s) and _is_known(place)]
        for stamp_s, place in sorted(valid, key=lambda entry: entry[0]):
            self.add(stamp_s, place)

    def __len__(self) -> int:
        return len(self._stamps)

    def __repr__(self) -> str:
        return f"Track({len(self)} positions)"

    @property
    def fixed_s(self) -> float:
        """Time of the last position [s since 1970 UTC], minus infinity if there is none."""
        return self._stamps[-1] if self._stamps else -math.inf

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Add an epoch; ignore it if it is not later than the last epoch.

        :param stamp_s: time of the epoch [s since 1970 UTC]; an epoch with NaN is ignored
        :param position: position of the receiver, ``None`` or NaN without a fix
        """
        if stamp_s < self.reached_s - CLOCK_CORRECTED_S:
            del self._stamps[:], self._values[:]
            self.course.clear()
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
        self.course.add(stamp_s, position)
        limit = self._max_positions
        if limit is not None and len(self._stamps) > 2 * limit:
            del self._stamps[:-limit], self._values[: -4 * limit]

    def at(self, stamp_s: float, max_gap_s: float, edge_tolerance_s: float = EDGE_TOLERANCE_S) -> Position | None:
        """Position at one time, or ``None`` if unknown.

        It is interpolated linearly between the two neighbouring fixes, if they are at most ``max_gap_s`` apart.
        Otherwise, and before the first and after the last fix, the nearest fix within ``edge_tolerance_s`` counts.
        The standard deviation is the larger of the two; motion between the fixes is not included.

        :param stamp_s: the time [s since 1970-01-01 UTC]
        :param max_gap_s: maximum time between two fixes for interpolation [s]
        :param edge_tolerance_s: maximum time between ``stamp_s`` and a single fix [s]
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
