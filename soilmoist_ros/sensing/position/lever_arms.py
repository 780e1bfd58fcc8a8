# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where antenna and sensor sit on the robot, and the heading that this needs."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from soilmoist_ros.sensing.records import NAN, Position

Offset = tuple[float, float]
STEP_M = 1.0
"""Distance from which two fixes give a heading [m]."""
STEP_SDS = 3.0
"""The same, in standard deviations of the fixes."""
METRES_PER_DEGREE = math.tau * 6_371_000.0 / 360.0
ARMS: Final = ("antenna_x_m", "antenna_y_m", "sensor_x_m", "sensor_y_m")
"""Names of the parameters."""


@dataclass(frozen=True, slots=True)
class LeverArms:
    """Places of antenna and sensor in the frame of the robot's base: x forward, y to the left.

    :param antenna_m: place of the GNSS antenna [m]
    :param sensor_m: place of the neutron sensor [m]

    >>> arms = LeverArms(antenna_m=(0.5, 0.0), sensor_m=(-1.0, 0.0))
    >>> arms.sensor_from_antenna(0.0)
    (-1.5, 0.0)
    """

    antenna_m: Offset = (0.0, 0.0)
    sensor_m: Offset = (0.0, 0.0)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> LeverArms:
        """Lever arms of a node's parameters; those that are missing are 0."""
        antenna_x, antenna_y, sensor_x, sensor_y = (float(values.get(name, 0.0)) for name in ARMS)
        return cls((antenna_x, antenna_y), (sensor_x, sensor_y))

    def sensor_from_antenna(self, heading_rad: float) -> Offset | None:
        """East and north from antenna to sensor [m]; ``None`` if it needs a heading that is unknown.

        :param heading_rad: heading of the robot, counter-clockwise from east [rad]; NaN if unknown
        """
        return _turned((self.sensor_m[0] - self.antenna_m[0], self.sensor_m[1] - self.antenna_m[1]), heading_rad)

    def base_from_antenna(self, heading_rad: float) -> Offset | None:
        """East and north from antenna to base [m]; ``None`` if it needs a heading that is unknown."""
        return _turned((-self.antenna_m[0], -self.antenna_m[1]), heading_rad)


NO_ARMS: Final = LeverArms()
"""Antenna and sensor at the base."""


class Course:
    """Heading of a robot from its positions: the direction of its last steps, kept while it stands.

    A robot that turns on the spot or drives backwards has another heading.

    :param max_headings: minimum number of latest headings to keep; all if ``None``
    """

    def __init__(self, max_headings: int | None = None) -> None:
        self._max_headings = max_headings
        self.clear()

    def clear(self) -> None:
        """Forget all positions."""
        self._stamps, self._headings = array("d"), array("d")
        self._anchor: Position | None = None

    def add(self, stamp_s: float, position: Position) -> None:
        """Add a position, in order of time.

        :param stamp_s: time of the position [s]
        :param position: position of the antenna
        """
        anchor = self._anchor
        if anchor is None:
            self._anchor = position
            return
        north_m = (position.latitude_deg - anchor.latitude_deg) * METRES_PER_DEGREE
        turn_deg = (position.longitude_deg - anchor.longitude_deg + 180.0) % 360.0 - 180.0
        east_m = turn_deg * METRES_PER_DEGREE * math.cos(math.radians(position.latitude_deg))
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


def _turned(offset_m: Offset, heading_rad: float) -> Offset | None:
    if offset_m == (0.0, 0.0):
        return offset_m
    if math.isnan(heading_rad):
        return None
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return cosine * offset_m[0] - sine * offset_m[1], sine * offset_m[0] + cosine * offset_m[1]
