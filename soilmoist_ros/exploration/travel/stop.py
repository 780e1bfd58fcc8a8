# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places where the robot may measure, ways to them as they go to a navigator, and where it may drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

MIN_REACH_M = 0.3
"""A robot this near is at a stop, however near the next one is: navigations are not more precise [m]."""
PLACE_DIGITS = 4  # decimals of the coordinates in metres of a node in a topological map


@dataclass(frozen=True, slots=True)
class Stop:
    """A place to measure at.

    :param reach_m: a robot that is farther away than this is not at the stop, whatever the arrival radius allows:
        half the distance to the nearest other node, at least :data:`MIN_REACH_M` [m]; two stops of different reach
        are equal
    """

    name: str  # name of the node of the travel graph; for free travel any unique name
    x_m: float  # east of the field's datum [m]
    y_m: float  # north of the field's datum [m]
    reach_m: float = field(default=math.inf, compare=False)

    @property
    def xy(self) -> tuple[float, float]:
        """Place of the stop, east and north of the field's datum [m]."""
        return self.x_m, self.y_m


def stops_xy(stops: Sequence[Stop]) -> Array:
    """Places of stops, shape (k, 2) [m]."""
    # Two lists of numbers convert faster than thousands of pairs.
    return np.ascontiguousarray(np.array([[stop.x_m for stop in stops], [stop.y_m for stop in stops]], float).T)


def inside_any(polygons: Sequence[ArrayLike], xy: ArrayLike) -> NDArray[np.bool_]:
    """True for each place that lies in one of some polygons, shape (k,)."""
    places = np.asarray(xy, float).reshape(-1, 2)
    if not len(polygons):
        return np.zeros(len(places), bool)
    import shapely

    area = shapely.union_all([shapely.Polygon(np.asarray(corners, float)) for corners in polygons])
    return np.asarray(shapely.intersects_xy(area, places[:, 0], places[:, 1]), bool)


# The route of a goal, as it goes to a navigator -----------------------------------------------------------------


BEND_M = 3.0  # a route that stays this near to a straight line has no bend for a person [m]
PASSED_M = 8.0  # a person this near to a bend looks for the one after it [m]


@dataclass(frozen=True, eq=False, slots=True)
class Way:
    """A route that the fence allows.

    :param corners: corners from the robot's place to the stop, both included, shape (p, 2) [m]; way points for a
        navigation that takes poses
    :param nodes: nodes to send one after the other to a navigation that takes names, the stop last. There is more
        than one where the navigation's own route to the stop would leave the fence; empty without a travel graph
    :param choices: straight lines of which a navigation that plans its own route may take any, shape (k, 2, 2)
        [m]; ``None`` where it takes the corners
    :param judge: takes a route that the navigation announces, its path and its nodes, each of shape (k, 2) [m],
        and returns why it is not allowed, empty if it is
    """

    corners: Array
    nodes: tuple[Stop, ...] = ()
    choices: Array | None = None
    judge: Callable[[Array, Array], str] = lambda path, nodes: ""

    @property
    def leads(self) -> tuple[float, float, float]:
        """Place of the next bend for the arrow of a person, or of the stop; and the length of the route [m]."""
        import shapely

        route = shapely.LineString(self.corners if len(self.corners) > 1 else np.repeat(self.corners, 2, axis=0))
        *bends, end = shapely.get_coordinates(route.simplify(BEND_M))[1:].tolist()
        ahead = (bend for bend in bends if math.dist(bend, self.corners[0]) > PASSED_M)
        x_m, y_m = next(ahead, end)
        return x_m, y_m, float(route.length)

    @property
    def lines(self) -> Array:
        """Straight lines that the robot may follow, shape (k, 2, 2) [m]."""
        return np.stack([self.corners[:-1], self.corners[1:]], axis=1) if self.choices is None else self.choices

    def passes_m(self, place: tuple[float, float]) -> float:
        """Shortest distance of the route from a place [m]."""
        import shapely

        corners = self.corners if len(self.corners) > 1 else np.repeat(self.corners, 2, axis=0)
        return float(shapely.LineString(corners).distance(shapely.Point(place)))


# Goals on the way to a stop: where the robot goes straight, and which way it faces there ------------------------

MIN_LEG_M = 0.01  # corners closer together, or closer to a straight line than this, are left out [m]


@dataclass(frozen=True, slots=True)
class WayPoint:
    """One goal of the navigation.

    :param heading_rad: direction in which the robot comes from the corner before, anticlockwise from east [rad]
    """

    stop: Stop  # where
    heading_rad: float = 0.0


def way_points(way: ArrayLike, stop: Stop) -> tuple[WayPoint, ...]:
    """Goals along a route, where it bends; the last one is the stop."""
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


# Where the robot may drive: inside the field and not in a no-go area --------------------------------------------

Flags = NDArray[np.bool_]

TOLERANCE_M = 1e-6
"""A line this far over the border still counts as inside, so that the robot may drive along the border."""
_PREPARED = Lock()
"""Prepared geometries build their indices when they are used: two threads that use one crash the process."""


class DrivableArea:
    """Outlines of the field minus the no-go areas.

    :param polygons: outlines of the field, each of shape (k, 2) [m], at least one
    :param no_go: outlines of areas that must not be entered, each of shape (k, 2) [m]
    :param margin_m: distance to keep from the border and the no-go areas [m], >= 0
    :param beyond_m: if positive, the border lies this far outside the outlines and keeps no margin [m]
    """

    def __init__(
        self,
        polygons: Sequence[ArrayLike],
        no_go: Sequence[ArrayLike] = (),
        margin_m: float = 0.0,
        beyond_m: float = 0.0,
    ) -> None:
        import shapely

        if not len(polygons):
            raise ValueError("a drivable area needs the outline of a field")
        if not (np.isfinite(margin_m) and margin_m >= 0):
            raise ValueError(f"margin_m must be >= 0 and finite, got {margin_m}")
        if not (np.isfinite(beyond_m) and beyond_m >= 0):
            raise ValueError(f"beyond_m must be >= 0 and finite, got {beyond_m}")
        area = shapely.union_all([shapely.Polygon(np.asarray(ring, float)) for ring in polygons])
        cut = shapely.union_all([shapely.Polygon(np.asarray(ring, float)) for ring in no_go])
        if beyond_m > 0:
            area = area.buffer(beyond_m + margin_m)
        area = area.difference(cut)
        area = area.buffer(-margin_m, join_style="mitre") if margin_m > TOLERANCE_M else area
        self._use(area)

    def _use(self, shape: BaseGeometry) -> None:
        import shapely

        self.shape: BaseGeometry = shape
        self._tolerant = shape.buffer(TOLERANCE_M, join_style="mitre")
        shapely.prepare(self._tolerant)

    def joined(self, more: BaseGeometry) -> DrivableArea:
        """The area together with another shape."""
        area = object.__new__(DrivableArea)
        area._use(self.shape.union(more))
        return area

    @cached_property
    def _parts(self) -> list[Any]:
        import shapely

        return [part for part in shapely.get_parts(self.shape) if part.geom_type == "Polygon"]

    @cached_property
    def is_convex(self) -> bool:
        """True if every straight line between two places inside stays inside."""
        return len(self._parts) == 1 and not len(self.turning_corners)

    @cached_property
    def turning_corners(self) -> Array:
        """Corners around which a shortest way may bend (those that stick into the area), shape (c, 2) [m]."""
        import shapely
        from shapely.geometry.polygon import orient

        found = [np.empty((0, 2))]
        for part in self._parts:
            area = orient(part)
            for ring in (area.exterior, *area.interiors):
                corners = shapely.get_coordinates(ring)[:-1]
                before = corners - np.roll(corners, 1, axis=0)
                after = np.roll(corners, -1, axis=0) - corners
                found.append(corners[before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0])
        return np.unique(np.concatenate(found), axis=0)

    def contains(self, xy: ArrayLike) -> Flags:
        """True for each place that is inside or on the border, shape (k,)."""
        import shapely

        x, y = np.asarray(xy, float).reshape(-1, 2).T
        with _PREPARED:
            return np.asarray(shapely.intersects_xy(self._tolerant, x, y), bool)

    def allows(self, start_xy: ArrayLike, end_xy: ArrayLike) -> Flags:
        """True for each straight line from a start to its end that stays inside, shape (k,)."""
        import shapely

        start, end = np.broadcast_arrays(
            np.atleast_2d(start_xy).astype(float), np.atleast_2d(end_xy).astype(float)
        )
        lines = shapely.linestrings(np.stack([start, end], axis=1))
        with _PREPARED:
            inside = np.asarray(shapely.covers(self._tolerant, lines), bool)
        point = np.all(start == end, axis=1)
        if point.any():
            inside[point] = self.contains(start[point])
        return inside

    def nearest(self, xy: ArrayLike) -> Array:
        """The place itself if it is inside, else the nearest place of the area, shape (2,) [m]."""
        import shapely

        place = np.asarray(xy, float)
        if self.contains(place)[0]:
            return place
        line = shapely.shortest_line(self.shape, shapely.Point(place))
        return np.asarray(shapely.get_coordinates(line)[0], float)
