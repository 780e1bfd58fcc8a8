# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals on the way to a stop: where the robot goes straight, and which way it faces there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import Stop

MIN_LEG_M = 0.01
"""Corners closer together, or closer to a straight line than this, are left out [m]."""


@dataclass(frozen=True, slots=True)
class WayPoint:
    """One goal of the navigation.

    :param stop: where
    :param heading_rad: direction in which the robot comes from the corner before, anticlockwise from east [rad]
    """

    stop: Stop
    heading_rad: float = 0.0


def way_points(way: ArrayLike, stop: Stop) -> tuple[WayPoint, ...]:
    """Goals along a route, where it bends; the last one is the stop.

    :param way: corners of the route from the robot's place, shape (p, 2); none if it is not known [m]
    :param stop: end of the route; it may also be the last corner
    """
    end = (stop.x_m, stop.y_m)
    places = _bends(np.asarray(way, float).reshape(-1, 2))
    before, goals = places[0] if places else end, list[WayPoint]()
    heading_rad = 0.0
    for number, place in enumerate(places[1:], 1):
        if math.dist(place, end) < MIN_LEG_M or math.dist(place, before) < MIN_LEG_M:
            continue
        heading_rad = math.atan2(place[1] - before[1], place[0] - before[0])
        goals.append(WayPoint(Stop(f"way point {number} to {stop.name}", *place), heading_rad))
        before = place
    if math.dist(before, end) >= MIN_LEG_M:
        heading_rad = math.atan2(end[1] - before[1], end[0] - before[0])
    return *goals, WayPoint(stop, heading_rad)


def _bends(corners: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Ends and bends of a route: nodes of a travel graph on a straight line are no goals."""
    import shapely

    if len(corners) > 2:
        corners = shapely.get_coordinates(shapely.LineString(corners).simplify(MIN_LEG_M, preserve_topology=False))
    return [(float(x), float(y)) for x, y in corners]
