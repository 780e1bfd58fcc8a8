# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances of samples with the cells of a raster, interpolated in each tile that is far from the sample.

A correlation is singular only at distance 0 (the spherical one also at its range). Over a tile, a part of the
raster, it is therefore smooth if the sample is elsewhere. In the plane where the correlation is isotropic, let the
half sides of the tile have lengths up to h. Let the sample be at a distance of at least e h, e <= 2.

Fix one coordinate and count the other in half sides from the middle. The correlation is then analytic in the
Bernstein ellipse of parameter ``rho = e + sqrt(e^2 + 1)``, whose smaller semi-axis is e. At a singularity the
imaginary part is at least e minus the excess of the real part over 1, and all such points are outside the ellipse.
In the ellipse the exponential is below 1. The error of interpolation from p Chebyshev points is therefore at most
``4 rho^(1-p) / (rho - 1)`` (Trefethen, *Approximation Theory and Approximation Practice*, SIAM 2013, chapter 8):
1e-10 with :data:`MARGIN` and :data:`POINTS`. This bound allows for poles. The singularities are branch points, so
the error is at most 1e-12 of the structured sill for all models and ranges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.chebyshev import interpolation
from soilmoist_ros.mapping.kriging.covariances import Needles, Rows, SamplePoints, first_changed
from soilmoist_ros.mapping.variogram.model import Variogram, scaled

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MARGIN = 2.0
"""Minimum distance of a far sample from a tile, in half sides."""
POINTS = 18
"""Chebyshev points of a tile along each axis."""
CELLS = 2000
"""Target number of cells of a tile; about the optimum for a raster of 70,000 cells."""
_AT_ONCE = 8
"""Tiles processed at a time, so that intermediate results stay in the cache."""
WORTH_SHARE = 0.75
"""Maximum stored values per sample, as a share of the cells, for which tiles are faster."""


class TileCovariances:
    """Covariances with the cells of a raster; see :class:`Covariances`.

    The targets are all cells of the tiles that contain a wanted cell. All tiles have one size, so tiles at the end
    of an axis repeat cells.

    :param x_m: columns, ascending, shape (nx,) [m]
    :param y_m: rows, ascending, shape (ny,) [m]
    :param mask: cells wanted, at least one, shape (ny, nx)
    :param nugget: whether a cell exactly at a sample shares the sample's nugget
    :param shape: rows and columns of a tile, see :func:`tile_shape`

    Attributes
    ----------
    position : NDArray
        numbers of the cells among the targets, shape (ny, nx); arbitrary for unwanted cells
    """

    def __init__(self, x_m: Array, y_m: Array, mask: Mask, nugget: bool, shape: tuple[int, int]) -> None:
        (rows, row), (columns, column) = (_parts(n, side) for n, side in zip(mask.shape, shape, strict=True))
        down, right = np.nonzero(_wanted(mask, shape))
        self._tiles, self._cells = len(down), math.prod(shape)
        self.size = self._tiles * self._cells
        number = np.zeros((len(rows), len(columns)), int)
        number[down, right] = np.arange(self._tiles)
        (height, width), none = shape, np.newaxis
        in_tile = row[:, none] % height * width + column % width
        self.position = number[row[:, none] // height, column // width] * self._cells + in_tile
        self._x, self._y = x_m[columns[right]], y_m[rows[down]]
        (x_points, across), (y_points, self._along) = (_interpolations(axis) for axis in (self._x, self._y))
        self._across = np.ascontiguousarray(across.swapaxes(1, 2))
        self._points_m, self._cells_m = _grids(x_points, y_points), _grids(self._x, self._y)
        self._needles = Needles(*self._cells_m, nugget)
        self._far = Rows(self._tiles * POINTS**2)
        self._near = [_NearRows(self._cells) for _ in range(self._tiles)]

    @property
    def xy(self) -> Array:
        """See :class:`Covariances`."""
        x, y = self._cells_m
        return np.column_stack([x.ravel(), y.ravel()])

    def begin(self, variogram: Variogram) -> None:
        """See :class:`Covariances`."""
        self._variogram = variogram
        self._of_points, self._of_cells = (scaled(variogram, *grids) for grids in (self._points_m, self._cells_m))
        self._boxes = Boxes(variogram, self._x, self._y)
        self._is_near = np.empty((0, self._tiles), bool)

    def keep(self, samples: Array, changed: NDArray[np.intp], most: int) -> bool:
        """See :class:`Covariances`."""
        first = first_changed(changed, len(samples))
        self._is_near = self._is_near[:first]
        if first < len(samples):
            is_near = self._boxes.are_near(SamplePoints(self._variogram, samples[first:]))
            self._is_near = np.concatenate([self._is_near, is_near])
        if len(samples) * self._tiles * POINTS**2 + np.count_nonzero(self._is_near) * self._cells > most:
            return False
        for tile, count in zip(self._near, np.count_nonzero(self._is_near[:first], axis=0).tolist(), strict=True):
            tile.count = count
        for start, rows in self._far.writable(first, len(samples)):
            for number, row in enumerate(rows, start):
                self._keep_one(number, samples[number], row)
        return True

    def _keep_one(self, number: int, sample: Array, far: Array) -> None:
        points, near = SamplePoints(self._variogram, sample[None]), np.flatnonzero(self._is_near[number])
        x, y = self._of_points
        points.covariance(x.ravel(), y.ravel(), far[None])
        far.reshape(self._tiles, -1)[near] = 0.0
        covariance = np.empty((len(near), self._cells))
        x, y = self._of_cells
        points.covariance(x[near].ravel(), y[near].ravel(), covariance.reshape(1, -1))
        self._needles.add(self._variogram.nugget, covariance, sample, near)
        for tile, values in zip(near.tolist(), covariance, strict=True):
            self._near[tile].append(number, values)

    def combine(self, weights: Array) -> Iterator[tuple[slice, Array]]:
        """See :class:`Covariances`."""
        cells, m = self._cells, len(weights)
        far = self._far.combine(weights).reshape(m, self._tiles, POINTS, POINTS)
        for start in range(0, self._tiles, _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            sums = (self._along[some] @ (far[:, some] @ self._across[some])).reshape(m, -1, cells)
            for number, tile in enumerate(self._near[some]):
                tile.add_combined(weights, sums[:, number])
            yield slice(start * cells, (start + _AT_ONCE) * cells), sums.reshape(m, -1)


class _NearRows:
    """Covariances of the samples near a tile with its cells.

    :param cells: number of cells

    Attributes
    ----------
    count : int
        number of samples
    """

    def __init__(self, cells: int) -> None:
        self.count = 0
        self._samples, self._rows = np.empty(64, int), np.empty((64, cells))

    def append(self, sample: int, covariance: Array) -> None:
        count = self.count
        if count == len(self._rows):
            known = self._samples, self._rows
            self._samples, self._rows = (
                np.empty((count + count // 2, *table.shape[1:]), table.dtype) for table in known
            )
            self._samples[:count], self._rows[:count] = known
        self._samples[count], self._rows[count] = sample, covariance
        self.count = count + 1

    def add_combined(self, weights: Array, sums: Array) -> None:
        """Add the weighted sums over the first n samples; shapes (m, n) of weights, (m, cells) of sums."""
        count = int(self._samples[: self.count].searchsorted(weights.shape[1]))
        if count:
            sums += weights.take(self._samples[:count], axis=1) @ self._rows[:count]


class Boxes:
    """Tiles as parallelograms in the plane where the variogram is isotropic, in units of its range.

    :param variogram: variogram of the latent rate
    :param x: columns of each tile, shape (tiles, width) [m]
    :param y: rows, shape (tiles, height) [m]
    """

    def __init__(self, variogram: Variogram, x: Array, y: Array) -> None:
        middle = [(axis.min(axis=1) + axis.max(axis=1)) / 2 for axis in (x, y)]
        half = [np.ptp(axis, axis=1) / 2 for axis in (x, y)]
        least = 1e-6 * (half[0] + half[1])  # treats a tile of one row like one of two close rows
        none = np.zeros(len(x))
        self._middle = scaled(variogram, *middle)
        self._sides = [
            scaled(variogram, np.maximum(half[0], least), none),
            scaled(variogram, none, np.maximum(half[1], least)),
        ]
        lengths = [np.hypot(*side) for side in self._sides]
        self._area = np.abs(_cross(*self._sides))
        self._lengths = lengths
        self._margin = MARGIN * np.maximum(*lengths)
        self._to_corner = sum(lengths)
        self._has_edge = variogram.correlation_model.has_edge

    def are_near(self, samples: SamplePoints) -> Mask:
        """Which samples have a point near which tiles, shape (samples, tiles)."""
        near = np.zeros((len(samples.layers[0][1]), len(self._area)), bool)
        for which, x, y, _ in samples.layers:
            way = x[:, None] - self._middle[0], y[:, None] - self._middle[1]
            # Distances from the lines along each pair of sides; the distance from the tile is at least as large.
            first, second = (
                (np.abs(_cross(way, side)) - self._area) / length
                for side, length in zip(self._sides, self._lengths, strict=True)
            )
            distance = np.maximum(first, second)
            found = distance < self._margin
            if self._has_edge:
                to_middle = np.hypot(*way)
                least, largest = np.maximum(distance, to_middle - self._to_corner), to_middle + self._to_corner
                found |= (least < 1) & (largest > 1)
            near[which] |= found
        return near


def tile_shape(variogram: Variogram, x_m: Array, y_m: Array, mask: Mask) -> tuple[int, int] | None:
    """Rows and columns of tiles that are about square in the plane where the variogram is isotropic.

    :param x_m: columns, ascending, shape (nx,) [m]
    :param y_m: rows, ascending, shape (ny,) [m]
    :param mask: cells wanted, shape (ny, nx)
    :returns: ``None`` if tiles save little memory compared with all covariances
    """
    most = WORTH_SHARE * np.count_nonzero(mask)
    if most < 9 * CELLS:
        return None
    shape = square_tiles(variogram, x_m, y_m, CELLS)
    return shape if _kept(mask, shape) <= most else None


def square_tiles(variogram: Variogram, x_m: Array, y_m: Array, cells: int) -> tuple[int, int]:
    """Rows and columns of tiles of about a number of cells, parameters as :func:`tile_shape`."""
    none = np.zeros(1)
    x_step, y_step = (
        float(np.hypot(*scaled(variogram, *step)).item()) for step in ((_step(x_m), none), (none, _step(y_m)))
    )
    width = min(math.sqrt(cells * y_step / x_step), len(x_m))
    height = min(cells / width, len(y_m))
    return _length(len(y_m), height), _length(len(x_m), cells / height)


def _kept(mask: Mask, shape: tuple[int, int]) -> int:
    """Maximum number of values stored per sample."""
    return 9 * math.prod(shape) + int(np.count_nonzero(_wanted(mask, shape))) * POINTS**2


def _step(axis: Array) -> Array:
    """Mean distance between positions of an axis."""
    return np.array([max(np.ptp(axis), 1e-9) / max(len(axis) - 1, 1)])


def _length(count: int, side: float) -> int:
    """Length of equal parts, near ``side``."""
    return math.ceil(count / max(1, round(count / side)))


def _parts(count: int, length: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Numbers below a count: in parts of one length, repeating the last number if need be, and in all."""
    numbers = np.arange(math.ceil(count / length) * length)
    return np.minimum(numbers, count - 1).reshape(-1, length), numbers[:count]


def _wanted(mask: Mask, shape: tuple[int, int]) -> Mask:
    """Whether a tile contains a wanted cell, shape (down, across)."""
    rows = np.logical_or.reduceat(mask, range(0, mask.shape[0], shape[0]), axis=0)
    return np.asarray(np.logical_or.reduceat(rows, range(0, mask.shape[1], shape[1]), axis=1))


def _interpolations(axes: Array) -> tuple[Array, Array]:
    """Chebyshev points of each axis, shape (k, p), and interpolation matrices, shape (k, places, p)."""
    points, matrices = zip(*(interpolation(axis, POINTS) for axis in axes), strict=True)
    return np.array(points), np.array(matrices)


def _grids(x: Array, y: Array) -> tuple[Array, Array]:
    """Coordinates of the points of k grids, each of shape (k, rows * columns), from their axes."""
    shape = len(x), y.shape[1], x.shape[1]
    return (
        np.broadcast_to(x[:, None, :], shape).reshape(len(x), -1),
        np.broadcast_to(y[:, :, None], shape).reshape(len(x), -1),
    )


def _cross(a: tuple[Array, Array], b: tuple[Array, Array]) -> Array:
    return a[0] * b[1] - a[1] * b[0]
