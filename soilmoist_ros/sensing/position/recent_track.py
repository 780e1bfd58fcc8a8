"""The latest positions of a receiver, in bounded memory."""

from __future__ import annotations

import math
from bisect import bisect_left

from soilmoist_ros.sensing.position.track import Track
from soilmoist_ros.sensing.records import Position

MAX_FIXES = 20_000
"""Fixes that are remembered: more than 5 h at 1 Hz, so that a receiver may be far ahead of a logger."""
CLOCK_CORRECTED_S = 60.0
"""A time further back than this means that the receiver has corrected its clock [s]."""


class RecentTrack:
    """Takes fixes in order of time, and knows where the receiver was at any recent moment."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._positions: list[Position] = []
        self.reached_s = -math.inf
        """Time of the last epoch, with or without a fix [s since 1970 UTC]."""

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def fixed_s(self) -> float:
        """Time of the last fix [s since 1970 UTC], minus infinity if there is none."""
        return self._stamps[-1] if self._stamps else -math.inf

    def add(self, stamp_s: float, position: Position | None) -> None:
        """Take an epoch; one that is not later than the last one changes nothing.

        :param stamp_s: its time [s since 1970 UTC]; without one (NaN) it is left out
        :param position: where the receiver is, ``None`` without a fix
        """
        if stamp_s < self.reached_s - CLOCK_CORRECTED_S:
            self._stamps.clear()
            self._positions.clear()
            self.reached_s = -math.inf
        if not stamp_s > self.reached_s:
            return
        self.reached_s = stamp_s
        if position is None:
            return
        self._stamps.append(stamp_s)
        self._positions.append(position)
        if len(self._stamps) > 2 * MAX_FIXES:
            del self._stamps[:-MAX_FIXES], self._positions[:-MAX_FIXES]

    def at(self, stamp_s: float, max_gap_s: float, edge_tolerance_s: float) -> Position | None:
        """Position at one moment; see :meth:`Track.at`."""
        if not math.isfinite(stamp_s):
            return None
        after = bisect_left(self._stamps, stamp_s)
        around = slice(max(after - 1, 0), after + 1)
        neighbours = Track.from_positions(zip(self._stamps[around], self._positions[around], strict=True))
        return neighbours.at(stamp_s, max_gap_s, edge_tolerance_s)
