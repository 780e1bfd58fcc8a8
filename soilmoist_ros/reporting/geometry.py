# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Geometry of the outputs in local metres: the field's polygon."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import direction

if TYPE_CHECKING:
    from soilmoist_ros.mapping import FieldGrid


def field_polygon(grid: FieldGrid) -> Any:
    """The field without its holes, as a shapely (multi)polygon in local metres; exteriors counter-clockwise.

    Holes may overlap each other and the boundary, so they are subtracted, not used as rings.
    """
    from shapely import unary_union
    from shapely.geometry import Polygon

    return right_handed(Polygon(grid.polygon).difference(unary_union([Polygon(ring) for ring in grid.holes])))


def right_handed(shape: Any) -> Any:
    """The shape with exteriors counter-clockwise and holes clockwise; lines and points are unchanged."""
    from shapely.geometry import MultiPolygon
    from shapely.geometry.polygon import orient

    if shape.geom_type == "Polygon":
        return orient(shape, 1.0)
    if shape.geom_type == "MultiPolygon":
        return MultiPolygon([orient(part, 1.0) for part in shape.geoms])
    return shape


def rings(grid: FieldGrid) -> list[NDArray[np.float64]]:
    """All boundary lines of the field, each closed, shape (k, 2) [m]."""
    shape = field_polygon(grid)
    parts = list(getattr(shape, "geoms", [shape]))
    lines = [line for part in parts for line in (part.exterior, *part.interiors)]
    return [np.asarray(line.coords, float) for line in lines if not line.is_empty]


def distances_m(grid: FieldGrid, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of each point (n, 2) from the boundary of the field [m], shape (n,); 0 inside."""
    from shapely import Polygon, distance, points

    return np.asarray(distance(Polygon(grid.polygon), points(xy_m)), float)


def compass_part(grid: FieldGrid, xy_m: NDArray[np.float64]) -> str:
    """Part of the field where points (n, 2) lie, such as "south-west"; empty if they are all over the field."""
    every = grid.cells
    if not len(xy_m):
        return ""
    east, north = (xy_m.mean(axis=0) - every.mean(axis=0)) / np.maximum(np.ptp(every, axis=0), 1e-9)
    if math.hypot(east, north) < 0.12:
        return ""
    return direction(math.degrees(math.atan2(east, north)))
