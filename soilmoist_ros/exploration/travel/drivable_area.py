# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the robot may drive: inside the field and not in a no-go area."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TOLERANCE_M = 1e-6
"""A line this far over the border still counts as inside, so that the robot may drive along the border."""
_PREPARED = Lock()
"""Prepared geometries build their indices when they are used: two threads that use one crash the process."""


class DrivableArea:
    """Outlines of the field minus the no-go areas.

    :param polygons: outlines of the field, each of shape (k, 2) [m], at least one
    :param no_go: outlines of areas that must not be entered, likewise
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
