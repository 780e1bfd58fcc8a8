# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A quantity on the nodes of a grid with fast linear interpolation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MARGIN_M = 10.0
"""Margin of the grid around the box of the field [m]; robots and footprints may cross the boundary."""
MAX_NODES = 1_000_000
"""Maximum number of nodes of a grid; the step is doubled until the grid fits."""


class Extent(NamedTuple):
    """The box of a field and the resolution of its truth.

    :param low: south-west corner [m], shape (2,)
    :param high: north-east corner [m], shape (2,)
    :param step_m: distance between nodes [m], > 0
    """

    low: Array
    high: Array
    step_m: float

    @classmethod
    def of(cls, polygon: Array, cell_m: float) -> Extent:
        """Box of a polygon, with nodes at half cells: every cell centre is a node.

        :param polygon: boundary, shape (k, 2) [m]
        :param cell_m: cell size of the map [m], > 0
        """
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        step = cell_m / 2
        while np.prod((high - low + 2 * MARGIN_M) / step + 2) > MAX_NODES:
            step *= 2
        return cls(low, high, step)

    @property
    def centre(self) -> Array:
        """Middle of the box [m], shape (2,)."""
        return (self.low + self.high) / 2

    def axes(self) -> tuple[Array, Array]:
        """Node coordinates x and y [m]: multiples of the step that cover the box and its margin."""
        first = [math.floor((value - MARGIN_M) / self.step_m) for value in self.low]
        last = [math.ceil((value + MARGIN_M) / self.step_m) for value in self.high]
        x, y = (np.arange(first[axis], last[axis] + 1) * self.step_m for axis in (0, 1))
        return x, y


@dataclass(frozen=True, eq=False)
class RateGrid:
    """Interpolates values on a regular grid: bilinear between nodes, constant beyond the edges.

    :func:`scipy.ndimage.map_coordinates` interpolates a single position five times as fast as
    ``RegularGridInterpolator``, with equal results.

    :param x_m: columns, ascending and evenly spaced, shape (nx,), nx >= 2 [m]
    :param y_m: rows, ascending and evenly spaced, shape (ny,), ny >= 2 [m]
    :param values: values on the nodes, shape (ny, nx), finite
    :raises ValueError: if the shapes do not fit or a value is not finite
    """

    x_m: Array
    y_m: Array
    values: Array

    def __post_init__(self) -> None:
        shape = (len(self.y_m), len(self.x_m))
        if self.values.shape != shape or min(shape) < 2:
            raise ValueError(f"values must have shape {shape} of at least (2, 2), got {self.values.shape}")
        if not np.isfinite(self.values).all():
            raise ValueError("a value on the grid is not finite")

    def __call__(self, xy: Array) -> Array:
        """Values at positions of shape (n, 2) [m], shape (n,)."""
        from scipy.ndimage import map_coordinates

        column = (xy[:, 0] - self.x_m[0]) / (self.x_m[1] - self.x_m[0])
        row = (xy[:, 1] - self.y_m[0]) / (self.y_m[1] - self.y_m[0])
        return np.asarray(map_coordinates(self.values, [row, column], order=1, mode="nearest"))


def filled(values: Array) -> Array:
    """Replace each NaN by the nearest number; the raster needs at least one number."""
    from scipy.ndimage import distance_transform_edt

    gaps = np.isnan(values)
    if not gaps.any():
        return values
    rows, columns = distance_transform_edt(gaps, return_distances=False, return_indices=True)
    return np.asarray(values[rows, columns])
