# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of a field: square cells, and which of them lie inside the field's polygon."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

MAX_CELLS = 4_000_000  # cells of the bounding box beyond which a grid counts as a mistake
USUAL_CELLS = 70_000  # cells that default_cell_m does not exceed
USUAL_CELLS_ACROSS = 50  # cells that default_cell_m puts across the longer side


@dataclass(frozen=True, eq=False, repr=False)
class FieldGrid:
    """Square cells over a field. Rows run south to north, columns west to east.

    Made by :meth:`from_polygon` or :meth:`from_track`.

    :param polygon: outline of the field, shape (k, 2), not closed [m]
    :param holes: outlines of the no-go areas cut out of the field, each of shape (k, 2), not closed [m]

    >>> grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40)], cell_m=5.0)
    >>> grid
    FieldGrid(8 x 12 cells of 5 m, 48 inside)
    """

    x_m: Array
    y_m: Array
    cell_m: float
    mask: NDArray[np.bool_]
    polygon: Array
    holes: tuple[Array, ...] = ()

    @classmethod
    def from_polygon(cls, vertices: ArrayLike, cell_m: float, holes: Sequence[ArrayLike] = ()) -> FieldGrid:
        """Grid of a field given by its outline.

        Cell edges lie on multiples of the cell size, so grids of one field and one size fit each other.

        :param vertices: corners in order, shape (k, 2), closed or not [m]
        :param holes: outlines of no-go areas, each of shape (k, 2) [m]
        :raises ValueError: if an outline has fewer than three corners, crosses itself or has no area, or if
            the cell size gives no or far too many cells
        """
        polygon, cut = _corners(vertices, "polygon"), tuple(_corners(ring, "hole") for ring in holes)
        _check_cell(polygon, cell_m)
        area = _area([polygon], "polygon").difference(_area(cut, "hole"))
        x_m, y_m = (_axis(polygon[:, axis], cell_m) for axis in (0, 1))
        mask = _inside(area, x_m, y_m)
        if not mask.any():
            raise ValueError(
                f"no cell centre lies inside the field at a cell size of {cell_m:g} m; use smaller cells, "
                "and check that the holes do not cover the field"
            )
        return cls(x_m, y_m, float(cell_m), mask, polygon, cut)

    @classmethod
    def from_track(cls, xy: ArrayLike, margin_m: float, cell_m: float | None = None) -> FieldGrid:
        """Grid of what a track has seen: the convex hull of its points, widened by a margin.

        One point gives a disc, points on a line a strip with round ends.

        :param margin_m: width of the margin, for example the footprint's radius [m], > 0
        :param cell_m: side of a cell [m]; by default chosen from the extent, with the margin as footprint
        """
        import shapely

        points = floats(xy).reshape(-1, 2)
        if not len(points) or not np.isfinite(points).all():
            raise ValueError("a track needs at least one point, all finite")
        if not (np.isfinite(margin_m) and margin_m > 0):
            raise ValueError(f"margin_m must be > 0 and finite, got {margin_m}")
        outline = shapely.MultiPoint(points).convex_hull.buffer(margin_m)
        width, height = np.ptp(points, axis=0) + 2 * margin_m
        chosen = cell_m or default_cell_m((width, height), margin_m)
        return cls.from_polygon(shapely.get_coordinates(outline.exterior), chosen)

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"FieldGrid({rows} x {columns} cells of {self.cell_m:g} m, {np.count_nonzero(self.mask)} inside)"

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return len(self.y_m), len(self.x_m)

    @property
    def cells(self) -> Array:
        """Centres of the cells inside, row by row from the south, shape (g, 2) [m]."""
        row, column = np.nonzero(self.mask)
        return np.column_stack([self.x_m[column], self.y_m[row]])

    @property
    def extent_m(self) -> float:
        """Longer side of the raster [m]."""
        return float(max(np.ptp(self.x_m), np.ptp(self.y_m))) + self.cell_m

    @property
    def box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """South-west and north-east corner of the raster [m]."""
        half = self.cell_m / 2
        (west, east), (south, north) = ((float(axis[0]), float(axis[-1])) for axis in (self.x_m, self.y_m))
        return (west - half, south - half), (east + half, north + half)

    @property
    def area_m2(self) -> float:
        """Area of the cells inside [m^2]."""
        return float(np.count_nonzero(self.mask)) * self.cell_m**2

    def to_raster(self, values: ArrayLike) -> Array:
        """Values of the inside :attr:`cells` on the raster, shape (ny, nx), NaN outside."""
        inside = floats(values)
        wanted = (int(np.count_nonzero(self.mask)),)
        if inside.shape != wanted:
            raise ValueError(f"values must have shape {wanted}, one per inside cell, got {inside.shape}")
        raster = np.full(self.shape, np.nan)
        raster[self.mask] = inside
        return raster


def default_cell_m(extent_m: tuple[float, float], footprint_radius_m: float = 10.0) -> float:
    """Cell size from the 1-2-5 series [m].

    At most a quarter of the footprint's radius (the map cannot hold more detail) and a fiftieth of the
    longer side (it should not look coarse), but never so small that the box has more than 70,000 cells.
    """
    width, height = extent_m
    for name, value in (("width", width), ("height", height), ("footprint_radius_m", footprint_radius_m)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    fine = min(footprint_radius_m / 4, max(width, height) / USUAL_CELLS_ACROSS)
    coarse = math.sqrt(width * height / USUAL_CELLS)
    steps = [1.0, 2.0, 5.0]
    exponent = math.floor(math.log10(max(fine, coarse))) - 1
    series = [step * 10.0**power for power in range(exponent, exponent + 4) for step in steps]
    tolerance = 1 + 1e-9
    cell = max(size for size in series if size <= max(fine, coarse) * tolerance)
    return cell if cell * tolerance >= coarse else min(size for size in series if size * tolerance >= coarse)


def _corners(ring: ArrayLike, what: str) -> Array:
    corners = np.array(floats(ring))
    if corners.ndim != 2 or corners.shape[1] != 2:
        raise ValueError(f"a {what} must have shape (k, 2), got {corners.shape}")
    if not np.isfinite(corners).all():
        raise ValueError(f"a vertex of a {what} is not finite")
    if len(corners) > 1 and (corners[0] == corners[-1]).all():
        corners = corners[:-1]
    if len(corners) < 3:
        raise ValueError(f"a {what} needs at least 3 vertices, got {len(corners)}")
    corners.setflags(write=False)
    return corners


def _area(rings: Sequence[Array], what: str) -> BaseGeometry:
    """Union of the areas of outlines, each checked."""
    import shapely

    areas = [shapely.Polygon(ring) for ring in rings]
    for number, area in enumerate(areas):
        which = f"{what} {number + 1}" if len(areas) > 1 else f"the {what}"
        if area.convex_hull.area == 0:
            raise ValueError(f"{which} has no area: its vertices lie on one line")
        if not area.is_valid:
            reason = shapely.is_valid_reason(area)
            raise ValueError(f"{which} crosses itself ({reason}); give its vertices in order around the field")
    return shapely.union_all(areas)


def _check_cell(polygon: Array, cell_m: float) -> None:
    if not (np.isfinite(cell_m) and cell_m > 0):
        raise ValueError(f"cell_m must be > 0 and finite, got {cell_m}")
    width, height = np.ptp(polygon, axis=0).tolist()
    if cell_m > max(width, height) > 0:
        raise ValueError(
            f"a cell of {cell_m:g} m is larger than the field of {width:g} m x {height:g} m; use smaller cells"
        )
    count = (width / cell_m + 1) * (height / cell_m + 1)
    if count > MAX_CELLS:
        raise ValueError(
            f"a cell of {cell_m:g} m gives {count:.3g} cells over {width:g} m x {height:g} m (at most "
            f"{MAX_CELLS:.3g}); use larger cells, and check that the coordinates are metres of one field"
        )


def _axis(values: Array, cell_m: float) -> Array:
    """Centres of the cells that cover the values; edges lie on multiples of the cell size."""
    first = math.floor(values.min() / cell_m + 1e-9)
    last = max(math.ceil(values.max() / cell_m - 1e-9), first + 1)
    return (np.arange(first, last) + 0.5) * cell_m


def _inside(area: BaseGeometry, x_m: Array, y_m: Array) -> NDArray[np.bool_]:
    import shapely

    shapely.prepare(area)
    return np.asarray(shapely.contains_xy(area, x_m[None, :], y_m[:, None]), bool)
