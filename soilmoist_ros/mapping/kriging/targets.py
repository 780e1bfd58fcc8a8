# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the map is wanted: sets of target places that know their distances to the samples.

A target set returns correlations tile by tile. The kriging needs no more than this, so a set
with structure (a raster) can compute them more cheaply than arbitrary points.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import squared_distances
from soilmoist_ros.mapping.variogram.model import Variogram, isotropic_plane
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

_AT_ONCE = 16384
"""Correlations computed at a time, so that intermediate results stay in the cache."""


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
    :param spread: spreads of the samples, shape (p, 4); all points if ``None``
    """

    def __init__(self, variogram: Variogram, places_xy: Array, xy: Array, spread: Array | None = None) -> None:
        self.xy = xy
        self._variogram = variogram
        self._places = Supports(places_xy, spread)
        self._scaled = variogram.scaled(xy)

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        variogram, scaled = self._variogram, self._scaled[tile]
        return self._places.average(lambda points: _correlation(variogram, scaled, variogram.scaled(points)))


class RasterCells:
    """Cells of a raster: squared distances are sums of one table per axis; a Gaussian is a product of them.

    That holds where the longest range lies along an axis, or no direction is special; otherwise cells are as good
    as any points.

    :param variogram: its range and model
    :param places_xy: places of the samples, shape (p, 2) [m]
    :param x_m: centres of the columns, shape (nx,) [m]
    :param y_m: centres of the rows, shape (ny,) [m]
    :param mask: the cells wanted, shape (ny, nx)
    :param spread: spreads of the samples, shape (p, 4); all points if ``None``
    """

    def __init__(
        self,
        variogram: Variogram,
        places_xy: Array,
        x_m: Array,
        y_m: Array,
        mask: NDArray[np.bool_],
        spread: Array | None = None,
    ) -> None:
        self._row, self._column = np.nonzero(mask)
        self.xy = np.column_stack([x_m[self._column], y_m[self._row]])
        self._variogram = variogram
        self._separable = variogram.correlation_model.is_product
        self._points = None
        if not variogram.along_axes:
            self._points = Points(variogram, places_xy, self.xy, spread)
            return
        self._places = Supports(places_xy, spread)
        plane = isotropic_plane(variogram.anisotropy, variogram.angle_deg)
        x_range_m, y_range_m = (variogram.range_m / plane.diagonal()).tolist()
        self._tables = [
            (self._table(x_m, points[:, 0], x_range_m), self._table(y_m, points[:, 1], y_range_m))
            for _, points, _ in self._places.layers
        ]

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        if self._points is not None:
            return self._points.correlation(tile)
        column, row = self._column[tile], self._row[tile]
        return self._places.combine(self._of_tables(x[column], y[row]) for x, y in self._tables)

    def _of_tables(self, x: Array, y: Array) -> Array:
        if self._separable:
            x *= y
            return x
        x += y
        return self._variogram.correlation_of_square(x)

    def _table(self, axis_m: Array, places_m: Array, range_m: float) -> Array:
        square = ((axis_m[:, None] - places_m) / range_m) ** 2
        return self._variogram.correlation_of_square(square) if self._separable else square


def sample_correlation(variogram: Variogram, xy: Array, spread: Array | None = None, first: int = 0) -> Array:
    """Structured correlation of samples with those of them from ``first`` on, shape (n, n - first), new memory.

    :param xy: places of the samples, shape (n, 2) [m]
    :param spread: their spreads, shape (n, 4); all points if ``None``
    """
    every = Supports(xy, spread)

    def with_points(points: Array) -> Array:
        scaled = variogram.scaled(points)
        return every.average(lambda others: _correlation(variogram, scaled, variogram.scaled(others))).T

    return Supports(xy[first:], None if spread is None else spread[first:]).average(with_points)


def _correlation(variogram: Variogram, scaled: Array, others: Array) -> Array:
    """Correlation between points of shapes (n, 2) and (m, 2), as of :meth:`Variogram.scaled`; shape (n, m)."""
    correlation = np.empty((len(scaled), len(others)))
    step = max(1, _AT_ONCE // max(1, len(others)))
    for some in (slice(start, start + step) for start in range(0, len(scaled), step)):
        correlation[some] = variogram.correlation_of_square(squared_distances(scaled[some], others))
    return correlation


def coincident(xy: Array, places_xy: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Targets that lie exactly at a place: their numbers, and the numbers of those (distinct) places."""
    keys = places_xy[:, 0] + 1j * places_xy[:, 1]
    wanted = xy[:, 0] + 1j * xy[:, 1]
    order = np.argsort(keys)
    position = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
    place = order[position]
    target = np.flatnonzero(keys[place] == wanted)
    return target, place[target]
