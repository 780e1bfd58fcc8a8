# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A place where the robot may measure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MIN_REACH_M = 0.3
"""A robot this near is at a stop, however near the next one is: navigations are not more precise [m]."""
PLACE_DIGITS = 4
"""Decimals of the coordinates in metres of a node in a topological map."""


@dataclass(frozen=True, slots=True)
class Stop:
    """A place to measure at.

    :param name: name of the node of the travel graph; for free travel any unique name
    :param x_m: east of the field's datum [m]
    :param y_m: north of the field's datum [m]
    :param reach_m: a robot that is farther away than this is not at the stop, whatever the arrival radius allows:
        half the distance to the nearest other node, at least :data:`MIN_REACH_M` [m]; two stops of different reach
        are equal
    """

    name: str
    x_m: float
    y_m: float
    reach_m: float = field(default=math.inf, compare=False)


def stops_xy(stops: Sequence[Stop]) -> Array:
    """Places of stops, shape (k, 2) [m]."""
    # Two lists of numbers convert faster than thousands of pairs.
    return np.ascontiguousarray(np.array([[stop.x_m for stop in stops], [stop.y_m for stop in stops]], float).T)


def inside_any(polygons: Sequence[ArrayLike], xy: ArrayLike) -> NDArray[np.bool_]:
    """Whether each place lies in one of some polygons, shape (k,).

    :param polygons: corners of each, shape (c, 2) [m]
    :param xy: places, shape (k, 2) or (2,) [m]
    """
    places = np.asarray(xy, float).reshape(-1, 2)
    if not len(polygons):
        return np.zeros(len(places), bool)
    import shapely

    area = shapely.union_all([shapely.Polygon(np.asarray(corners, float)) for corners in polygons])
    return np.asarray(shapely.intersects_xy(area, places[:, 0], places[:, 1]), bool)


def is_polygon(corners: ArrayLike) -> bool:
    """Whether corners, shape (c, 2) [m], enclose an area without crossing their own border."""
    import shapely

    polygon = shapely.Polygon(np.asarray(corners, float))
    return bool(polygon.is_valid and polygon.area > 0)
