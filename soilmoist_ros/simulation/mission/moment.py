# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated mission at one moment, for those who watch it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from soilmoist_ros.exploration import MissionStatus, Stop, Visit
from soilmoist_ros.mapping import Samples, SoilMap


@dataclass(frozen=True)
class RobotMoment:
    """A robot at one moment.

    :param status: its mission
    :param xy: true place [m]
    :param ahead: its stops ahead, the next one first
    """

    status: MissionStatus
    xy: tuple[float, float]
    ahead: tuple[Stop, ...]


@dataclass(frozen=True)
class Moment:
    """All robots and the map of the mission field at one moment.

    :param time_s: simulated time [s]
    :param robots: the robots
    :param visits: visits so far; the list grows with the mission
    :param samples: samples in the map
    :param soil_map: makes the map of all cells, ``None`` before there is one; takes some milliseconds to seconds
    """

    time_s: float
    robots: tuple[RobotMoment, ...]
    visits: Sequence[Visit]
    samples: Samples
    soil_map: Callable[[], SoilMap | None]


Watch = Callable[[Moment], bool]
"""Receives the moments of a mission; false ends the mission as an operator would."""
