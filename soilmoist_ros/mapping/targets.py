"""Where the map is wanted: sets of target places that know their distances to the samples.

A target set hands out squared distances tile by tile. The kriging needs no more than this, so a set
with structure (a raster) can compute them in a cheaper way than arbitrary points.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram import Variogram

Array = NDArray[np.float64]


class Targets(Protocol):
    """Target places of one prediction; ``xy`` has shape (g, 2) [m]."""

    xy: Array

    def correlation(self, tile: slice) -> Array:
        """Structured correlation of the targets of a tile with all places, shape (tile, places), new memory."""
        ...


class Points:
    """Arbitrary target points.

    :param variogram: its range and model
    :param places_xy: places of the samples, shape (p, 2) [m]
    :param xy: targets, shape (g, 2) [m]
    """

    def __init__(self, variogram: Variogram, places_xy: Array, xy: Array) -> None:
        self.xy = xy
        self._variogram = variogram
        self._places = places_xy / variogram.range_m
        self._scaled = xy / variogram.range_m

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        from scipy.spatial.distance import cdist

        return self._variogram.correlation_of_square(cdist(self._scaled[tile], self._places, "sqeuclidean"))


class RasterCells:
    """Cells of a raster: squared distances are sums of one table per axis; a Gaussian is a product of them.

    :param variogram: its range and model
    :param places_xy: places of the samples, shape (p, 2) [m]
    :param x_m: centres of the columns, shape (nx,) [m]
    :param y_m: centres of the rows, shape (ny,) [m]
    :param mask: the cells wanted, shape (ny, nx)

    Attributes
    ----------
    row, column : NDArray
        indices of the cells wanted, shape (g,)
    """

    def __init__(
        self, variogram: Variogram, places_xy: Array, x_m: Array, y_m: Array, mask: NDArray[np.bool_]
    ) -> None:
        self.row, self.column = np.nonzero(mask)
        self.xy = np.column_stack([x_m[self.column], y_m[self.row]])
        self._variogram = variogram
        self._separable = variogram.model == "gaussian"
        self._table_x = self._table(x_m, places_xy[:, 0])
        self._table_y = self._table(y_m, places_xy[:, 1])

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns between which all cells wanted lie; empty without cells."""
        if not len(self.xy):
            return slice(0, 0), slice(0, 0)
        return slice(self.row.min(), self.row.max() + 1), slice(self.column.min(), self.column.max() + 1)

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        result = self._table_x[self.column[tile]]
        if self._separable:
            result *= self._table_y[self.row[tile]]
            return result
        result += self._table_y[self.row[tile]]
        return self._variogram.correlation_of_square(result)

    def _table(self, axis_m: Array, places_m: Array) -> Array:
        square = ((axis_m[:, None] - places_m) / self._variogram.range_m) ** 2
        return self._variogram.correlation_of_square(square) if self._separable else square


def coincident(xy: Array, places_xy: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Targets that lie exactly at a place: their numbers, and the numbers of those (distinct) places."""
    keys = places_xy[:, 0] + 1j * places_xy[:, 1]
    wanted = xy[:, 0] + 1j * xy[:, 1]
    order = np.argsort(keys)
    position = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
    place = order[position]
    target = np.flatnonzero(keys[place] == wanted)
    return target, place[target]
