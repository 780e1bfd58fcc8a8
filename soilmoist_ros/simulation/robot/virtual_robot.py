# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated robot: its position at each time on its route."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import RobotMotion, polyline_length_m, polyline_turn_rad

Array = NDArray[np.float64]


class VirtualRobot:
    """Drives one polyline at a time.

    Turning time is spread evenly over the route. The robot spends the stop overhead at the end of the route.

    :param motion: speed, turning time and stop overhead
    :param xy: start position [m]
    """

    def __init__(self, motion: RobotMotion, xy: tuple[float, float]) -> None:
        self.motion = motion
        self.track: list[tuple[float, float]] = [xy]
        self._way: Array = np.array([xy])
        self._along_m: Array = np.zeros(1)
        self._start_s = 0.0
        self._drive_s = 0.0
        self._before_m = 0.0

    def go(self, now_s: float, way: Array) -> float:
        """Start a route from the current position; the previous route ends there.

        :param now_s: time [s]
        :param way: corners of the route, shape (p, 2), from the position of the robot [m]
        :returns: time of arrival including the stop overhead [s]
        """
        self.stop(now_s)
        self._way = way
        legs = np.hypot(*np.diff(way, axis=0).T)
        self._along_m = np.concatenate([[0.0], np.cumsum(legs)])
        self._start_s = now_s
        turn_s = polyline_turn_rad(way) * self.motion.turn_s_per_rad
        self._drive_s = polyline_length_m(way) / self.motion.speed_mps + turn_s
        return now_s + self._drive_s + self.motion.stop_overhead_s

    def stop(self, now_s: float) -> None:
        """Stop at the current position."""
        here = self.at(now_s)
        length = self._length_at(now_s)
        passed = [(float(x), float(y)) for x, y in self._way[1:][self._along_m[1:] < length]]
        self.track += [place for place in [*passed, here] if place != self.track[-1]]
        self._before_m += length
        self._way, self._along_m, self._drive_s = np.array([here]), np.zeros(1), 0.0

    def stands(self, now_s: float) -> bool:
        """Whether the robot is at the end of its route."""
        return self._drive_s <= 0 or now_s - self._start_s >= self._drive_s

    def at(self, now_s: float) -> tuple[float, float]:
        """Position at a time of the current route [m]."""
        if self.stands(now_s):
            x, y = self._way[-1]
        else:
            length = self._length_at(now_s)
            x, y = (np.interp(length, self._along_m, axis) for axis in self._way.T)
        return float(x), float(y)

    def places(self, times_s: Array) -> Array:
        """Positions at ascending or descending times of the current route, shape (n, 2) [m].

        A robot that rests throughout returns one position, shape (1, 2).
        """
        if self.stands(float(min(times_s[0], times_s[-1]))):
            return self._way[-1:]
        # Clip before the division: a route of almost no length would otherwise give NaN.
        share = np.minimum(np.maximum(times_s - self._start_s, 0.0), self._drive_s) / self._drive_s
        length = share * self._along_m[-1]
        return np.array([np.interp(length, self._along_m, axis) for axis in self._way.T]).T

    def distance_m(self, now_s: float) -> float:
        """Distance driven since the beginning [m]."""
        return self._before_m + self._length_at(now_s)

    def _length_at(self, now_s: float) -> float:
        if self._drive_s <= 0:
            return 0.0
        share = min(max(now_s - self._start_s, 0.0), self._drive_s) / self._drive_s
        return share * float(self._along_m[-1])
