# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Zones that a machine can work on: they share their borders, cover the field and are not too small."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, install

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

SHARE_OF_FIELD = 0.05
"""Default of the smallest zone, as a share of the field."""
MAX_BLOCKS = 4000
"""Number of blocks of a field; larger fields have blocks of several swaths."""
TOLERANCE_M = 0.01
"""Distance that common borders of zones may move to get fewer corners [m]."""
NODE_M = 1e-3
"""Distance within which corners of zones are one point [m]."""


def zones_of_blocks(
    figures: Sequence[Array],
    classes_of: Callable[..., NDArray[np.intp]],
    xy: Array,
    cell_m: float,
    boundary: BaseGeometry,
    of_machine: tuple[Array, Array, float],
    smallest_m2: float,
) -> tuple[list[BaseGeometry], NDArray[np.intp]]:
    """Connected zones and the class of each. They do not overlap, and together they are the field.

    Blocks of whole swaths get the class of the means of their places. Blocks of one class become one zone, those
    that are too small join the neighbour of the nearest class, and what has joined counts in the class of a zone.

    :param figures: figures of the places ``xy``, shape (n,) each; ``classes_of`` makes classes of their means
    :param of_machine: see :func:`swaths`
    :raises InputError: for an old shapely
    """
    from scipy.ndimage import distance_transform_edt
    from shapely import get_coordinates, point_on_surface

    try:
        from shapely import coverage_simplify
    except ImportError:
        raise InputError("zones need shapely 2.1", install("reports")) from None
    blocks = _Blocks.over(xy, *of_machine, cell_m)
    block, every = blocks.index(xy), int(blocks.count.prod())
    count = np.bincount(block, minlength=every)
    means = (np.bincount(block, figure, every) / np.maximum(count, 1) for figure in figures)
    # A block without a place is that of the nearest one that has some.
    empty = (count == 0).reshape(blocks.count)
    row, column = distance_transform_edt(empty, return_distances=False, return_indices=True)
    of_block = classes_of(*means)[(row * blocks.count[1] + column).ravel()]
    faces = divided(blocks.borders(of_block, boundary), boundary)
    number = of_block[blocks.index(get_coordinates(point_on_surface(faces)))]
    joined = dissolved(*_joined(*dissolved(faces, number), smallest_m2))[0]
    shapes = list(coverage_simplify(joined, TOLERANCE_M, simplify_boundary=False))
    places = [places_in(shape, xy) for shape in shapes]
    of_shapes = (np.array([figure[own].mean() for own in places]) for figure in figures)
    return dissolved(shapes, classes_of(*of_shapes))


def inside(shape: BaseGeometry, xy: Array) -> NDArray[np.intp]:
    """Numbers of the places in a zone."""
    from shapely import contains_xy, prepare

    prepare(shape)
    west, south, east, north = shape.bounds
    x, y = xy.T
    near = np.flatnonzero((x >= west) & (x <= east) & (y >= south) & (y <= north))
    return np.asarray(near[contains_xy(shape, x[near], y[near])])


def places_in(shape: BaseGeometry, xy: Array) -> NDArray[np.intp]:
    """Numbers of the places in a zone; of the nearest one if there is none."""
    from shapely import get_coordinates, point_on_surface

    own = inside(shape, xy)
    if own.size:
        return own
    return np.atleast_1d(np.hypot(*(xy - get_coordinates(point_on_surface(shape))).T).argmin())


def swaths(
    boundary: BaseGeometry, smallest_m2: float, cell_m: float, width_m: float | None, direction_deg: float | None
) -> tuple[Array, Array, float]:
    """Unit vectors along and across the driving direction of a machine, and the side of a block [m].

    :param smallest_m2: area of the smallest zone; without a width a block is a quarter of it
    :param direction_deg: driving direction from north; by default along the field
    :raises InputError: if the machine is wider than the field
    """
    from shapely import get_coordinates

    if direction_deg is None:
        sides = np.diff(get_coordinates(boundary.minimum_rotated_rectangle)[:3], axis=0)
        along = sides[np.argmax(np.hypot(*sides.T))]
    else:
        angle = math.radians(direction_deg)
        along = np.array([math.sin(angle), math.cos(angle)])
    along = along / np.hypot(*along)
    across = np.array([along[1], -along[0]])
    wide = float(np.ptp(get_coordinates(boundary) @ across))
    if width_m is None:
        return along, across, min(max(math.sqrt(smallest_m2) / 2, 2 * cell_m), wide)
    if width_m > wide:
        raise InputError(
            f"the machine of {width_m:g} m is wider than the field of {wide:.0f} m",
            "give the width that it irrigates, in metres, or another driving direction",
        )
    finest = max(cell_m, math.sqrt(boundary.area / MAX_BLOCKS))
    return along, across, min(width_m * math.ceil(finest / width_m - 1e-6), wide)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks over a field, rows along the driving direction of the machine and columns across it.

    The last block along and across takes the remainder, so that no block is narrower than the machine.
    """

    axes: Array
    start: Array
    count: NDArray[np.intp]
    size_m: float

    @classmethod
    def over(cls, xy: Array, along: Array, across: Array, size_m: float, cell_m: float) -> _Blocks:
        """Blocks over places."""
        axes = np.column_stack([along, across])
        places = xy @ axes
        start = places.min(axis=0) - cell_m / 2
        count = ((places.max(axis=0) + cell_m / 2 - start) / size_m + 1e-6).astype(int)
        return cls(axes, start, np.maximum(count, 1), size_m)

    def index(self, xy: Array) -> NDArray[np.intp]:
        """Number of the block of each place, shape (n,)."""
        at = np.clip(((xy @ self.axes - self.start) / self.size_m).astype(int), 0, self.count - 1)
        return np.asarray(at @ [self.count[1], 1], np.intp)

    def borders(self, of_block: NDArray[np.intp], boundary: BaseGeometry) -> list[BaseGeometry]:
        """Lines between blocks of different classes; those at the edge reach over the field."""
        from shapely import get_coordinates, linestrings

        corners, classes = get_coordinates(boundary) @ self.axes, of_block.reshape(self.count)
        found = []
        for axis in (0, 1):
            edges = self.start[1 - axis] + self.size_m * np.arange(self.count[1 - axis] + 1.0)
            edges[[0, -1]] = corners[:, 1 - axis].min() - 1, corners[:, 1 - axis].max() + 1
            before, along = np.nonzero(np.diff(classes if axis == 0 else classes.T, axis=0))
            at = (self.start[axis] + self.size_m * (before + 1.0))[:, None, None] * self.axes[:, axis]
            ends = np.stack([edges[along], edges[along + 1]], axis=1)[:, :, None] * self.axes[:, 1 - axis]
            found += list(linestrings(at + ends))
        return found


def divided(lines: Sequence[BaseGeometry], boundary: BaseGeometry) -> list[BaseGeometry]:
    """Parts into which lines divide the field. Neighbours have the same corners on their border."""
    from shapely import contains, get_parts, point_on_surface, polygonize, prepare, union_all

    parts = get_parts(polygonize(get_parts(union_all([*lines, boundary.boundary], grid_size=NODE_M))))
    prepare(boundary)
    return list(parts[contains(boundary, point_on_surface(parts))])


def _joined(
    faces: Sequence[BaseGeometry], number: NDArray[np.intp], smallest_m2: float
) -> tuple[list[BaseGeometry], NDArray[np.intp]]:
    """Faces of at least the smallest area: smaller ones join the neighbour of the nearest class, of several that
    with the longest common border.
    """
    from shapely import area, coverage_union_all

    areas = np.asarray(area(faces), float)
    borders = _borders(faces)
    members = {i: [i] for i in range(len(faces))}
    for small in np.argsort(areas, kind="stable").tolist():
        while small in members and areas[small] < smallest_m2 and borders[small]:
            apart = {other: abs(int(number[small] - number[other])) for other in borders[small]}
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
