# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Jumps of place: no vehicle that counts neutrons is so fast, or gathers speed so quickly."""

from __future__ import annotations

import math
from collections.abc import Iterable

from soilmoist_ros.sensing.gnss import Fix
from soilmoist_ros.sensing.position.track import Track
from soilmoist_ros.sensing.records import Position

MAX_SPEED_MPS = 60.0
"""Speed that no vehicle reaches during a survey [m/s]."""
MAX_ACCELERATION_MPS2 = 10.0
"""Acceleration that no vehicle reaches [m/s^2]."""
MARGIN_M = 15.0
"""Distance by which a good receiver may be wrong all at once: reflections, a lost correction signal [m]."""
MARGIN_SDS = 5.0
"""The same in standard deviations that the receiver reports."""
BELIEVED_S = 60.0
"""Time after which a steady new place counts as true [s]."""
BELIEVED_FIXES = 5
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
        self._steady, self._elsewhere = _Motion(), _Motion()
        super().__init__(fixes, max_positions)

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Add an epoch; a jump counts as an epoch without a fix.

        :param stamp_s: time of the epoch [s since 1970 UTC]
        :param position: position of the receiver, ``None`` or NaN without a fix
        """
        known = position is not None and math.isfinite(position.latitude_deg + position.longitude_deg)
        if position is None or not known or not math.isfinite(stamp_s):
            super().add(stamp_s, position)
            return
        # However long a jump lasts, the vehicle has not driven there: the place before the jump must be nearer.
        returned = self._steady.distance_m(position) <= self._elsewhere.distance_m(position)
        if returned and self._steady.takes(stamp_s, position):
            self._elsewhere = _Motion()
            super().add(stamp_s, position)
            return
        if not self._elsewhere.takes(stamp_s, position):
            self._elsewhere = _Motion()
            self._elsewhere.takes(stamp_s, position)
        if self._elsewhere.spent_s >= BELIEVED_S and self._elsewhere.fixes >= BELIEVED_FIXES:
            self._steady, self._elsewhere = self._elsewhere, _Motion()
            super().add(stamp_s, position)
            return
        self.jumped.add(stamp_s, position)
        super().add(stamp_s, None)


class _Motion:
    """Positions that one vehicle can drive through."""

    def __init__(self) -> None:
        self._last: tuple[float, Position] | None = None
        self._speed_mps = MAX_SPEED_MPS
        self._begin_s = math.nan
        self.fixes = 0

    @property
    def spent_s(self) -> float:
        """Time from the first to the last position [s]."""
        return self._last[0] - self._begin_s if self._last else 0.0

    def distance_m(self, position: Position) -> float:
        """Distance from the last position [m], infinite without one."""
        return distance_m(self._last[1], position) if self._last else math.inf

    def takes(self, stamp_s: float, position: Position) -> bool:
        """Add a position if the vehicle can be there; returns whether it can."""
        if self._last is not None and stamp_s > self._last[0]:
            spent_s, driven_m = stamp_s - self._last[0], distance_m(self._last[1], position)
            reach_m = self._speed_mps * spent_s + MAX_ACCELERATION_MPS2 / 2 * spent_s**2
            sd_m = max(self._last[1].horizontal_sd_m, position.horizontal_sd_m)
            margin_m = max(MARGIN_M, MARGIN_SDS * sd_m) if math.isfinite(sd_m) else MARGIN_M
            if driven_m > margin_m + min(reach_m, MAX_SPEED_MPS * spent_s):
                return False
            self._speed_mps = min(driven_m / spent_s, MAX_SPEED_MPS)
        if self._last is None:
            self._begin_s = stamp_s
        self._last = (stamp_s, position)
        self.fixes += 1
        return True


def distance_m(one: Position, other: Position) -> float:
    """Distance on a sphere, good for short ones [m]."""
    north = other.latitude_deg - one.latitude_deg
    east = (other.longitude_deg - one.longitude_deg + 180.0) % 360.0 - 180.0
    return METRES_PER_DEG * math.hypot(north, east * math.cos(math.radians(one.latitude_deg)))
