# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging a raster once: rate and variance of each tile as forms of few functions.

Rate and variance of a cell with covariances c are ``a.L^-1 c`` and ``|L^-1 c|^2`` (:mod:`poisson_kriging`), forms
of n variables. Over a tile, a part of the raster, the covariances of all samples far away are combinations of
those with r of its points, the *skeleton*; :mod:`tile_covariances` says why. With the m near samples, the forms
have m + r variables, and only m covariances of each cell are needed.

The skeleton is an interpolative decomposition (Cheng, Gimbutas, Martinsson & Rokhlin 2005, SIAM Journal on
Scientific Computing 26:1389-1404) of the correlations of Chebyshev points of a tile with sources outside of its
margin. All tiles have one shape, and so one skeleton. The correlations are off by at most 1e-8, the variance by
about as much of the sill.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.chebyshev import interpolation
from soilmoist_ros.mapping.kriging.covariances import SamplePoints
from soilmoist_ros.mapping.kriging.system import KrigingSystem
from soilmoist_ros.mapping.kriging.tile_covariances import MARGIN, Boxes, square_tiles
from soilmoist_ros.mapping.variogram.model import Variogram, scaled

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
OnCells = tuple[Indices, Indices, Indices]
"""Rows and columns of cells that have a sample exactly in their centre, and the numbers of these samples."""

CELLS = 1200
"""Target number of cells of a tile; about the optimum for 70 to 1000 samples."""
TOLERANCE = 3e-11
"""Correlation, root mean square over the sources, that the skeleton may leave unexplained."""
_POINTS = 14
"""Chebyshev points of a tile along each axis, among which the skeleton is chosen."""
_PRODUCT_POINTS = 18
"""The same for products of two smooth functions."""
_SOURCES, _SKETCH = 600, 140
"""Sources, and random combinations of them that represent all."""
_REACH = 20.0
"""Distance of the farthest sources, in half sides; correlations with farther ones are no less smooth."""
_AT_ONCE = 8
"""Tiles processed at a time."""


class Skeleton(NamedTuple):
    """Points of a tile, and the way from the values of smooth functions there to those elsewhere in the tile.

    :param x: places between the middle of the tile and its border, -1 to 1, shape (r,)
    :param y: the same
    :param to_cells: matrix for the cells, row by row, shape (r, cells)
    :param to_points: matrix for the points of products, shape (_PRODUCT_POINTS^2, r)
    :param across: from products at their points to columns, shape (_PRODUCT_POINTS, width)
    :param along: the same for rows, shape (height, _PRODUCT_POINTS)
    """

    x: Array
    y: Array
    to_cells: Array
    to_points: Array
    across: Array
    along: Array


def find_skeleton(variogram: Variogram, half_m: tuple[float, float], shape: tuple[int, int]) -> Skeleton:
    """The skeleton of a tile.

    :param variogram: variogram of the latent rate
    :param half_m: half of the ways from the first to the last column, and from row to row [m]
    :param shape: rows and columns of the tile
    """
    from scipy.linalg import qr, solve_triangular

    points, _ = _on_unit(np.zeros(0), _POINTS)
    x, y = (grid.ravel() for grid in np.meshgrid(points, points))
    found = _source_correlation(variogram, half_m, x, y)
    sketch = found @ np.random.default_rng(0).standard_normal((_SOURCES, _SKETCH))
    triangle, order = qr(sketch.T, mode="r", pivoting=True, check_finite=False)
    left = np.abs(triangle.diagonal()) / np.sqrt(_SOURCES * _SKETCH)
    r = max(1, int(np.count_nonzero(left > TOLERANCE)))
    weights = np.zeros((_POINTS**2, r))
    weights[order[:r]] = np.eye(r)
    if left[0] > TOLERANCE:  # else nothing reaches the tile
        weights[order[r:]] = solve_triangular(triangle[:r, :r], triangle[:r, r:], check_finite=False).T

    def at(x_axis: Array, y_axis: Array) -> Array:
        """From the skeleton to the points of two axes, row by row, shape (points, r)."""
        across, along = (_on_unit(axis, _POINTS)[1] for axis in (x_axis, y_axis))
        rows = (along @ weights.reshape(_POINTS, -1)).reshape(-1, _POINTS, r)
        return np.asarray(across @ rows).reshape(-1, r)

    axes = [np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(1) for count in shape]
    products, along = _on_unit(axes[0], _PRODUCT_POINTS)
    _, across = _on_unit(axes[1], _PRODUCT_POINTS)
    to_cells = np.ascontiguousarray(at(axes[1], axes[0]).T)
    return Skeleton(x[order[:r]], y[order[:r]], to_cells, at(products, products), across.T, along)


def _source_correlation(variogram: Variogram, half_m: tuple[float, float], x: Array, y: Array) -> Array:
    """Correlations of points of a tile with sources on and outside of its margin, shape (points, _SOURCES).

    The margin is that of :class:`Boxes`: distances from the lines along the sides in the isotropic plane, in the
    longest half side. Half of the sources are within 1.3 half sides of it, where it matters most.
    """
    least = 1e-6 * (abs(half_m[0]) + abs(half_m[1]))
    sides = np.diag([half if abs(half) > least else least for half in half_m])
    (ax, ay), (bx, by) = np.transpose(scaled(variogram, *sides.T)).tolist()
    lengths, area = (np.hypot(ax, ay), np.hypot(bx, by)), abs(ax * by - ay * bx)
    number = np.arange(_SOURCES)
    distance = (MARGIN + _REACH * (number / _SOURCES) ** 4) * max(lengths)
    out = [1 + distance * length / area for length in lengths[::-1]]
    golden = number * 0.6180339887498949 % 1 * 2 - 1
    beyond, east_or_west = 1 - 2 * (number % 2), number % 4 < 2
    s = np.where(east_or_west, beyond, golden) * out[0]
    t = np.where(east_or_west, golden, beyond) * out[1]
    s, t = x[:, None] - s, y[:, None] - t
    return variogram.correlation_of_square((s * ax + t * bx) ** 2 + (s * ay + t * by) ** 2)


def _on_unit(axis: Array, degree: int) -> tuple[Array, Array]:
    """Chebyshev points of [-1, 1], and interpolation from there to an axis inside, shape (places, degree)."""
    points, matrix = interpolation(np.concatenate([[-1.0, 1.0], axis]), degree)
    return points, matrix[2:]


class Tiles(NamedTuple):
    """Equal parts of a regular raster; neighbours may overlap.

    :param shape: rows and columns of a tile
    :param top: first row of each tile, shape (tiles,)
    :param left: first column of each
    """

    shape: tuple[int, int]
    top: Indices
    left: Indices


def find_tiles(variogram: Variogram, x_m: Array, y_m: Array, mask: Mask) -> Tiles | None:
    """The tiles with a wanted cell, about square in the plane where the variogram is isotropic.

    :param x_m: columns, shape (nx,) [m]
    :param y_m: rows, shape (ny,) [m]
    :param mask: cells wanted, shape (ny, nx)
    :returns: ``None`` if rows or columns are not at equal distances
    """
    for axis in (x_m, y_m):
        steps = np.diff(axis)
        if len(steps) and np.ptp(steps) > 1e-9 * np.abs(steps).min():
            return None
    height, width = shape = square_tiles(variogram, x_m, y_m, CELLS)
    tops, lefts = (
        [min(start, count - side) for start in range(0, count, side)]
        for count, side in zip(mask.shape, shape, strict=True)
    )
    firsts = [(i, j) for i in tops for j in lefts if mask[i : i + height, j : j + width].any()]
    top, left = np.array(firsts, np.intp).reshape(-1, 2).T
    return Tiles(shape, top, left)


class _Inverse(NamedTuple):
    """What the forms need of a factored system.

    :param factor: L^-1, lower triangle, shape (n, n), columns contiguous
    :param matrix: K^-1, shape (n, n)
    :param data: residual and ones, shape (2, n)
    :param weights: data L^-1, shape (2, n)
    """

    factor: Array
    matrix: Array
    data: Array
    weights: Array

    @classmethod
    def of(cls, system: KrigingSystem) -> _Inverse:
        from scipy.linalg.lapack import dlauum, dtrtri

        factor = dtrtri(system.factor, lower=1)[0]
        matrix = dlauum(factor, lower=1)[0]
        for start in range(0, len(matrix), 256):  # upper from lower triangle
            rows = slice(start, start + 256)
            matrix[rows, rows] = np.tril(matrix[rows, rows]) + np.tril(matrix[rows, rows], -1).T
            matrix[rows, start + 256 :] = matrix[start + 256 :, rows].T
        data = np.array([system.residual, system.ones])
        return cls(factor, matrix, data, data @ factor)


def tile_sums(
    system: KrigingSystem, x_m: Array, y_m: Array, tiles: Tiles, on_cells: OnCells
) -> Iterator[tuple[slice, slice, Array]]:
    """Sums over the rows of W = L^-1 C_.0 for the cells of each tile.

    :param system: the factored system of at least one sample
    :param x_m: columns, shape (nx,) [m]
    :param y_m: rows, shape (ny,) [m]
    :param tiles: from :func:`find_tiles`
    :param on_cells: samples whose cells share their nugget
    :returns: rows and columns of a tile; residual W, ones W and the sum of squares of W, shape (3, height, width)
    """
    from scipy.linalg.blas import dtrmm

    (height, width), top, left = tiles
    columns, rows = (first[:, None] + np.arange(side) for first, side in ((left, width), (top, height)))
    x, y = x_m[columns], y_m[rows]
    variogram, places, inverse = system.variogram, system.places, _Inverse.of(system)
    samples = np.column_stack([places.xy, places.spread])
    points = SamplePoints(variogram, samples)
    is_near = Boxes(variogram, x, y).are_near(points)
    half_m = float(x[0, -1] - x[0, 0]) / 2, float(y[0, -1] - y[0, 0]) / 2
    skeleton = find_skeleton(variogram, half_m, tiles.shape)
    r = len(skeleton.x)
    middle = [(axis[:, :1] + axis[:, -1:]) / 2 for axis in (x, y)]
    skeletons = middle[0] + half_m[0] * skeleton.x, middle[1] + half_m[1] * skeleton.y
    functions = np.empty((r + int(is_near.sum(axis=0).max()), height * width))
    functions[:r] = skeleton.to_cells
    for start in range(0, len(top), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        far = np.empty((len(samples), skeletons[0][some].size))
        points.covariance(*scaled(variogram, skeletons[0][some].ravel(), skeletons[1][some].ravel()), far)
        far.reshape(len(far), -1, r)[is_near[:, some]] = 0.0
        solved = dtrmm(1.0, inverse.factor, far.T, side=1, lower=1, trans_a=1, overwrite_b=1).T
        for number, of_far in enumerate(np.split(solved, solved.shape[1] // r, axis=1), start):
            near = np.flatnonzero(is_near[:, number])
            grid = np.meshgrid(x[number], y[number])
            covariance = functions[r : r + len(near)]
            if len(near):
                cells = scaled(variogram, grid[0].ravel(), grid[1].ravel())
                SamplePoints(variogram, samples[near]).covariance(*cells, covariance)
                cell, which = _on_tile(on_cells, rows[number], columns[number])
                covariance[near.searchsorted(which), cell] += variogram.nugget
            sums = _sums(inverse, near, of_far, skeleton, functions[: r + len(near)])
            yield _slice(rows[number]), _slice(columns[number]), sums.reshape(3, height, width)


def _sums(inverse: _Inverse, near: Indices, of_far: Array, skeleton: Skeleton, functions: Array) -> Array:
    """The sums of :func:`tile_sums` for the cells of one tile, shape (3, cells).

    :param near: numbers of the near samples, shape (m,)
    :param of_far: W of the far samples with the skeleton, shape (n, r)
    :param functions: skeleton to cells, then the covariances of the near samples, shape (r + m, cells)
    """
    m, r = len(near), of_far.shape[1]
    form = np.empty((m + 2, r + m))
    np.matmul(inverse.factor.T[near], of_far, out=form[:m, :r])
    form[:m, :r] *= 2
    form[:m, r:] = inverse.matrix[near[:, None], near]
    form[m:, :r] = inverse.data @ of_far
    form[m:, r:] = inverse.weights[:, near]
    products = form @ functions
    at_points = skeleton.to_points @ (of_far.T @ of_far)
    smooth = np.einsum("ij,ij->i", at_points, skeleton.to_points).reshape(_PRODUCT_POINTS, -1)
    sums = np.empty((3, functions.shape[1]))
    sums[:2] = products[m:]
    sums[2] = (skeleton.along @ smooth @ skeleton.across).ravel()
    sums[2] += np.einsum("ij,ij->j", products[:m], functions[r:])
    return sums


def _on_tile(on_cells: OnCells, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:
    """Numbers of the cells of a tile that have a sample, and of these samples."""
    row, column = on_cells[0] - rows[0], on_cells[1] - columns[0]
    inside = (row >= 0) & (row < len(rows)) & (column >= 0) & (column < len(columns))
    return row[inside] * len(columns) + column[inside], on_cells[2][inside]


def _slice(numbers: Indices) -> slice:
    return slice(numbers[0], numbers[-1] + 1)
