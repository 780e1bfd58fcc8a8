# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Polygons that a machine can work on: they share their borders, cover the field and are not too small."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, install

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

SHARE_OF_FIELD = 0.05
"""Default of the smallest zone, as a share of the field."""
NODE_M = 1e-3
"""Distance within which corners of zones are one point [m]."""


def workable(
    faces: Sequence[BaseGeometry],
    number: NDArray[np.intp],
    smallest_m2: float,
    tolerance_m: float,
    alike: bool = False,
) -> tuple[list[BaseGeometry], NDArray[np.intp]]:
    """Connected polygons of one class each, none smaller than the smallest where it has a neighbour.

    :param faces: parts of the field with common corners, see :func:`divided`, and the class of each
    :param tolerance_m: distance that common borders may move to get fewer corners; the boundary of the field stays
    :param alike: whether small parts join the neighbour of the nearest class, not that of the longest border
    :raises InputError: for an old shapely
    """
    try:
        from shapely import coverage_simplify
    except ImportError:
        raise InputError("zones need shapely 2.1", install("reports")) from None
    shapes, number = dissolved(*_joined(faces, number, smallest_m2, alike))
    return list(coverage_simplify(shapes, tolerance_m, simplify_boundary=False)), number


def divided(lines: Sequence[BaseGeometry], boundary: BaseGeometry) -> list[BaseGeometry]:
    """Parts into which lines divide the field. Neighbours have the same corners on their border."""
    from shapely import contains, get_parts, point_on_surface, polygonize, prepare, union_all

    parts = get_parts(polygonize(get_parts(union_all([*lines, boundary.boundary], grid_size=NODE_M))))
    prepare(boundary)
    return list(parts[contains(boundary, point_on_surface(parts))])


def _joined(
    faces: Sequence[BaseGeometry], number: NDArray[np.intp], smallest_m2: float, alike: bool
) -> tuple[list[BaseGeometry], NDArray[np.intp]]:
    """Faces of at least the smallest area: smaller ones join the neighbour with the longest common border, or the
    one of the nearest class.
    """
    from shapely import area, coverage_union_all

    areas = np.asarray(area(faces), float)
    borders = _borders(faces)
    members = {i: [i] for i in range(len(faces))}
    for small in np.argsort(areas, kind="stable").tolist():
        while small in members and areas[small] < smallest_m2 and borders[small]:
            apart = {other: abs(int(number[small] - number[other])) * alike for other in borders[small]}
            into = min(apart, key=lambda other: (apart[other], -borders[small][other], other))
            into, small = (into, small) if areas[into] >= areas[small] else (small, into)
            members[into] += members.pop(small)
            areas[into] += areas[small]
            for other, length in borders.pop(small).items():
                borders[other].pop(small)
                if other != into:
                    borders[into][other] = borders[other][into] = borders[into].get(other, 0.0) + length
            small = into
    kept = sorted(members)
    return [coverage_union_all([faces[i] for i in members[one]]) for one in kept], number[kept]


def _borders(faces: Sequence[BaseGeometry]) -> dict[int, dict[int, float]]:
    """Length of the common border of each face with each neighbour [m]."""
    from shapely import STRtree, boundary, intersection, length

    lines = boundary(np.asarray(faces, object))
    one, other = STRtree(lines).query(lines, predicate="intersects")
    once = one < other
    one, other = one[once], other[once]
    shared = length(intersection(lines[one], lines[other]))
    found: dict[int, dict[int, float]] = {i: {} for i in range(len(faces))}
    for i, j, metres in zip(one.tolist(), other.tolist(), shared.tolist(), strict=True):
        if metres > NODE_M:
            found[i][j] = found[j][i] = metres
    return found


def dissolved(
    shapes: Sequence[BaseGeometry], number: NDArray[np.intp]
) -> tuple[list[BaseGeometry], NDArray[np.intp]]:
    """Neighbours of one class, with common corners, become one polygon; each polygon is connected."""
    from shapely import coverage_union_all, get_parts

    found = [
        (part, one)
        for one in np.unique(number)
        for part in get_parts(coverage_union_all([s for s, n in zip(shapes, number, strict=True) if n == one]))
    ]
    return [part for part, _ in found], np.array([one for _, one in found])
