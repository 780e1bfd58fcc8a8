"""Positions over time: where a receiver was at any moment."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.records import NAN, Position

EDGE_TOLERANCE_S = 0.5
"""A single fix stands for its neighbourhood of this half width [s]."""


class Track:
    """The valid fixes of a receiver in order of time, to be asked for any moment.

    :param fixes: fixes in any order; those without a fix or a date are left out, and of several with the same
        time the first is taken
    """

    def __init__(self, fixes: Iterable[Fix]) -> None:
        valid = [
            (fix.stamp_s, fix.position)
            for fix in fixes
            if fix.status is not FixStatus.NO_FIX and math.isfinite(fix.stamp_s)
        ]
        self._set(valid)

    @classmethod
    def from_positions(cls, positions: Iterable[tuple[float, Position]]) -> Track:
        """The track of positions with their times [s since 1970 UTC], in any order."""
        track = cls([])
        track._set([(stamp_s, position) for stamp_s, position in positions if math.isfinite(stamp_s)])
        return track

    def _set(self, positions: Sequence[tuple[float, Position]]) -> None:
        table = np.array(
            [
                (stamp_s, place.latitude_deg, place.longitude_deg, place.altitude_m, place.horizontal_sd_m)
                for stamp_s, place in positions
            ],
            dtype=float,
        ).reshape(-1, 5)
        table = table[np.isfinite(table[:, :3]).all(axis=1)]
        _, first = np.unique(table[:, 0], return_index=True)
        self._table: NDArray[np.float64] = table[first]
        self._stamps: NDArray[np.float64] = np.ascontiguousarray(self._table[:, 0])

    def __len__(self) -> int:
        return len(self._stamps)

    def at(self, stamp_s: float, max_gap_s: float, edge_tolerance_s: float = EDGE_TOLERANCE_S) -> Position | None:
        """Position at one moment, or ``None`` if it is not known.

        Linear in time between the two fixes around the moment, if they are not further apart than ``max_gap_s``.
        Else, and before the first and after the last fix, the nearest one if it is within ``edge_tolerance_s``.
        The standard deviation is the larger of the two; what happened between the fixes is not in it.

        :param stamp_s: the moment [s since 1970-01-01 UTC]
        :param max_gap_s: longest time between two fixes to interpolate over [s]
        :param edge_tolerance_s: how far in time a single fix is good for [s]
        """
        if not len(self) or not math.isfinite(stamp_s):
            return None
        after = int(np.searchsorted(self._stamps, stamp_s))
        if after < len(self) and self._stamps[after] == stamp_s:
            return self._position(after)
        before = after - 1
        if before >= 0 and after < len(self) and self._stamps[after] - self._stamps[before] <= max_gap_s:
            return self._between(before, stamp_s)
        near = [index for index in (before, after) if 0 <= index < len(self)]
        nearest = min(near, key=lambda index: abs(self._stamps[index] - stamp_s))
        return self._position(nearest) if abs(self._stamps[nearest] - stamp_s) <= edge_tolerance_s else None

    def _position(self, index: int) -> Position:
        return Position(*self._table[index, 1:].tolist())

    def _between(self, before: int, stamp_s: float) -> Position:
        start, end = self._table[before].tolist(), self._table[before + 1].tolist()
        part = (stamp_s - start[0]) / (end[0] - start[0])
        latitude = start[1] + part * (end[1] - start[1])
        turn = (end[2] - start[2] + 180.0) % 360.0 - 180.0  # the short way round, also across 180 degrees
        longitude = start[2] + part * turn
        if abs(longitude) > 180.0:
            longitude -= math.copysign(360.0, longitude)
        sd = NAN if math.isnan(start[4]) or math.isnan(end[4]) else max(start[4], end[4])
        return Position(latitude, longitude, start[3] + part * (end[3] - start[3]), sd)


def interpolate_position(fixes: Track | Sequence[Fix], stamp_s: float, max_gap_s: float) -> Position | None:
    """Position at one moment; see :meth:`Track.at`. For many moments make the :class:`Track` once.

    :param fixes: fixes or a track made of them
    :param stamp_s: the moment [s since 1970-01-01 UTC]
    :param max_gap_s: longest time between two fixes to interpolate over [s]
    """
    track = fixes if isinstance(fixes, Track) else Track(fixes)
    return track.at(stamp_s, max_gap_s)
