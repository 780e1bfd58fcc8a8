# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A track without jumps of place, for vehicles of which nothing else is known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from soilmoist_ros.sensing.gnss import Fix
from soilmoist_ros.sensing.position.place_judge import PlaceFix, PlaceJudge, PlaceLimits, Verdict
from soilmoist_ros.sensing.position.track import CLOCK_CORRECTED_S, Track
from soilmoist_ros.sensing.records import Position

LIMITS: Final = PlaceLimits(
    max_speed_mps=60.0,
    max_sd_m=1e6,
    first_fixes=1,
    agree_fixes=5,
    agree_s=60.0,
    max_gap_s=1e6,
    max_acceleration_mps2=4.0,
    jump_sds=5.0,
    unknown_jump_m=15.0,
)
"""Limits of any vehicle that counts neutrons: a steady new place counts as true after a minute."""
METRES_PER_DEG = 111_195.0


class CheckedTrack(Track):
    """A track without jumps of place.

    :param fixes: epochs in any order
    :param max_positions: minimum number of latest positions to keep; all if ``None``

    Attributes
    ----------
    jumped : Track
        the positions that were left out
    """

    def __init__(self, fixes: Iterable[Fix] = (), max_positions: int | None = None) -> None:
        self.jumped = Track(max_positions=max_positions)
        self._judge, self._origin = PlaceJudge(LIMITS), Position(math.nan, math.nan)
        super().__init__(fixes, max_positions)

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Add an epoch; a jump counts as an epoch without a fix.

        :param stamp_s: time of the epoch [s since 1970 UTC]
        :param position: position of the receiver, ``None`` or NaN without a fix
        """
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
