# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging of the cells of a raster: on a large one tile by tile from few functions, else cell by cell.

Rate and variance of a cell with covariances c are ``a.L^-1 c`` and ``|L^-1 c|^2`` (:mod:`.poisson_kriging`), forms
of n variables. Over a tile, a part of the raster, the covariances of all samples far away are combinations of
those with r of its points, the *skeleton*. With the m near samples, the forms have m + r variables, and only m
covariances of each cell are needed. At 300 samples and 70,000 cells that takes a fifth of the time of a solve for
each cell.

**Far.** A correlation is singular only at distance 0 (the spherical one also at its range; it has no tiles). In
the plane where it is isotropic, let the half sides of the tile have lengths up to h, and the sample a distance of
at least e h. Fix one coordinate and count the other in half sides from the middle. The correlation is then
analytic in the Bernstein ellipse of parameter ``rho = e + sqrt(e^2 + 1)``, whose smaller semi-axis is e. The error
of interpolation from p Chebyshev points is at most ``4 rho^(1-p) / (rho - 1)`` (Trefethen, *Approximation Theory
and Approximation Practice*, SIAM 2013, chapter 8). A Gaussian has no singularity: in tiles that are small against
its range all samples are far.

**Skeleton.** An interpolative decomposition (Cheng, Gimbutas, Martinsson & Rokhlin 2005, SIAM Journal on
Scientific Computing 26:1389-1404) of the correlations of Chebyshev points of a tile with sources outside of its
margin. All tiles have one shape, and so one skeleton. The correlations are off by at most 1e-8, the variance by
about as much of the sill.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats
from soilmoist_ros.mapping.kriging.system import KrigingSystem, Points, Progress, target_variance
from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

MIN_SAMPLES, MIN_CELLS = 50, 16_000  # minimum numbers of samples and of cells from which tiles are faster
MIN_PIVOT = 1e-6
"""Minimum share of a sample's variance unexplained by earlier samples; below, the inverse of L is too inexact."""
MARGIN = 2.0  # minimum distance of a far sample from a tile, in half sides
EVERYWHERE, MAX_ANALYTIC = -1.0, 0.6
"""Margin of an analytic correlation: no sample is near; and the largest half side, in ranges, for that."""
CELLS = 1200  # target number of cells of a tile; about the optimum for 70 to 1000 samples
TOLERANCE = 3e-11  # correlation, root mean square over the sources, that the skeleton may leave unexplained
_POINTS = 14  # Chebyshev points of a tile along each axis, among which the skeleton is chosen
_PRODUCT_POINTS = 18  # Chebyshev points of a tile along each axis for products of two smooth functions
_SOURCES, _SKETCH = 600, 140  # sources, and random combinations of them that represent all
_REACH = 20.0  # distance of the farthest sources, in half sides; correlations with farther ones are no less smooth
_AT_ONCE = 8  # tiles processed at a time


def krige_raster(
    system: KrigingSystem, x_m: Array, y_m: Array, mask: Mask, nugget: bool, progress: Progress | None = None
) -> Array:
    """Rate [counts/s] and variance [(counts/s)^2] of wanted cells, not clipped, else NaN; shape (2, ny, nx)."""
    rasters = np.full((2, *mask.shape), np.nan)
    row, column = np.nonzero(mask)
    cells = Points(
        system.variogram, system.places.xy, np.column_stack([x_m[column], y_m[row]]), system.places.spread
    )
    found = _by_tiles(system, x_m, y_m, mask, nugget, cells.xy, progress)
    rasters[:, mask] = system.surfaces(cells, nugget, progress) if found is None else found
    rasters[1, mask] += target_variance(system.variogram, nugget)
    return rasters


def check_raster(x_m: ArrayLike, y_m: ArrayLike, mask: Mask | None) -> tuple[Array, Array, Mask]:
    """Axes of shapes (nx,) and (ny,) [m], and the cells wanted, shape (ny, nx); ``ValueError`` for others."""
    x, y = floats(x_m), floats(y_m)
    for name, axis in (("x_m", x), ("y_m", y)):
        if axis.ndim != 1 or not np.isfinite(axis).all():
            raise ValueError(f"{name} must be a finite vector, got shape {axis.shape}")
    wanted = np.ones((len(y), len(x)), bool) if mask is None else np.asarray(mask, bool)
    if wanted.shape != (len(y), len(x)):
        raise ValueError(f"mask must have shape {(len(y), len(x))}, got {wanted.shape}")
    return x, y, wanted


# -- Tiles -------------------------------------------------------------------------------------------


def _by_tiles(
    system: KrigingSystem,
    x_m: Array,
    y_m: Array,
    mask: Mask,
    nugget: bool,
    cells_xy: Array,
    progress: Progress | None,
) -> Array | None:
    """Rate and variance by tiles; ``None`` if tiles are not faster, or for a nearly singular matrix."""
    variogram, factor, ones = system.variogram, system.factor, system.ones
    is_small = len(system.places) < MIN_SAMPLES or len(cells_xy) < MIN_CELLS
    if is_small or variogram.structured_sill == 0 or variogram.correlation_model.has_edge:
        return None
    if system.prior is not None:
        return None
    if (np.diag(factor) ** 2 < MIN_PIVOT * np.einsum("ij,ij->i", factor, factor)).any():
        return None
    tiles = find_tiles(variogram, x_m, y_m, mask)
    if tiles is None or len(tiles.top) * math.prod(tiles.shape) > 2 * len(cells_xy):
        return None
    sums = np.empty((3 + system.uncertain.shape[1], *mask.shape))
    for done, (rows, columns, part) in enumerate(tile_sums(system, x_m, y_m, tiles, nugget), start=1):
        sums[:, rows, columns] = part
        if progress is not None:
            progress(done / len(tiles.top))
    squares, rate, of_ones, *uncertain = sums[:, mask]
    variance = (of_ones - 1) ** 2 / (ones @ ones) - squares
    for mean, one in zip(system.uncertain_mean.tolist(), uncertain, strict=True):
        variance += (mean + one) ** 2
    return np.array([system.mean + rate, variance])


class Tiles(NamedTuple):
    """Equal parts of a regular raster; neighbours may overlap."""

    shape: tuple[int, int]  # rows and columns of a tile
    top: Indices  # first row of each tile, shape (tiles,)
    left: Indices  # first column of each


def find_tiles(variogram: Variogram, x_m: Array, y_m: Array, mask: Mask) -> Tiles | None:
    """The tiles with a wanted cell, about square in the plane where the variogram is isotropic."""
    steps_m = []
    for axis in (x_m, y_m):
        steps = np.diff(axis)
        if len(steps) and np.ptp(steps) > 1e-9 * np.abs(steps).min():
            return None
        steps_m.append(max(float(np.ptp(axis)), 1e-9) / max(len(axis) - 1, 1))
    x_step, y_step = np.hypot(*scaled(variogram, *np.diag(steps_m))).tolist()
    width = min(math.sqrt(CELLS * y_step / x_step), len(x_m))
    height = min(CELLS / width, len(y_m))
    sides = [
        math.ceil(count / max(1, round(count / side)))  # equal parts
        for count, side in zip(mask.shape, (height, CELLS / height), strict=True)
    ]
    tops, lefts = (
        [min(start, count - side) for start in range(0, count, side)]
        for count, side in zip(mask.shape, sides, strict=True)
    )
    firsts = [(i, j) for i in tops for j in lefts if mask[i : i + sides[0], j : j + sides[1]].any()]
    top, left = np.array(firsts, np.intp).reshape(-1, 2).T
    return Tiles((sides[0], sides[1]), top, left)


def tile_sums(
    system: KrigingSystem, x_m: Array, y_m: Array, tiles: Tiles, nugget: bool
) -> Iterator[tuple[slice, slice, Array]]:
    """Sums over the rows of W = L^-1 C_.0 for the cells of each tile.

    :returns: rows and columns of a tile; the sum of squares of W, residual W, ones W, and uncertain W,
        shape (3 + k, height, width)
    """
    from scipy.linalg.blas import dtrmm

    (height, width), top, left = tiles
    columns, rows = (first[:, None] + np.arange(side) for first, side in ((left, width), (top, height)))
    x, y = x_m[columns], y_m[rows]
    variogram, places, inverse = system.variogram, system.places, _Inverse.of(system)
    tile = _TileShape.of(variogram, float(x[0, -1] - x[0, 0]) / 2, float(y[0, -1] - y[0, 0]) / 2)
    skeleton = find_skeleton(variogram, tile, tiles.shape)
    r = len(skeleton.x)
    middle = [(axis[:, :1] + axis[:, -1:]) / 2 for axis in (x, y)]
    is_near = tile.are_near(variogram, Supports(places.xy, places.spread), *middle)
    cell, sample = _cells_at(places.xy[: len(places) if nugget else 0], x_m, y_m)
    has_cell = [(away >= 0) & (away < side) for away, side in ((cell[0] - top, height), (cell[1] - left, width))]
    is_near[sample] |= has_cell[0] & has_cell[1]
    skeletons = middle[0] + tile.half_m[0] * skeleton.x, middle[1] + tile.half_m[1] * skeleton.y
    functions = np.empty((r + int(is_near.sum(axis=0).max()), height * width))
    functions[:r] = skeleton.to_cells
    for start in range(0, len(top), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        far = _covariance(system, slice(None), np.column_stack([axis[some].ravel() for axis in skeletons]))
        far.reshape(-1, r, len(places)).transpose(0, 2, 1)[is_near[:, some].T] = 0.0
        solved = dtrmm(1.0, inverse.factor, far.T, lower=1, overwrite_b=1)
        for number, of_far in enumerate(np.split(solved, solved.shape[1] // r, axis=1), start):
            near = np.flatnonzero(is_near[:, number])
            grid = np.meshgrid(x[number], y[number])
            covariance = functions[r : r + len(near)]
            if len(near):
                covariance[:] = _covariance(system, near, np.column_stack([axis.ravel() for axis in grid])).T
                here = (has_cell[0] & has_cell[1])[:, number]
                of_tile = (cell[0] - top[number])[here] * width + (cell[1] - left[number])[here]
                covariance[near.searchsorted(sample[here]), of_tile[:, 0]] += variogram.nugget
            sums = _sums(inverse, near, of_far, skeleton, functions[: r + len(near)])
            yield (
                slice(top[number], top[number] + height),
                slice(left[number], left[number] + width),
                sums.reshape(-1, height, width),
            )


def _covariance(system: KrigingSystem, which: Indices | slice, xy: Array) -> Array:
    """Structured covariance of places, shape (g, 2) [m], with some of the samples, shape (g, m)."""
    variogram, places = system.variogram, system.places
    covariance = Points(variogram, places.xy[which], xy, places.spread[which]).correlation(slice(0, len(xy)))
    covariance *= variogram.structured_sill
    return covariance


class _TileShape(NamedTuple):
    """A tile as a parallelogram in the plane where the variogram is isotropic, in units of its range."""

    half_m: tuple[float, float]  # half of the ways from the first to the last column, and from row to row [m]
    sides: Array  # half sides there, one in each row, shape (2, 2)
    lengths: Array  # their lengths, shape (2,)
    area: float  # a quarter of the area
    margin: float  # least distance of far samples from the lines along the sides

    @classmethod
    def of(cls, variogram: Variogram, half_x_m: float, half_y_m: float) -> _TileShape:
        least = 1e-6 * (abs(half_x_m) + abs(half_y_m))  # treats a tile of one row like one of two close rows
        halves = np.diag([half if abs(half) > least else least for half in (half_x_m, half_y_m)])
        sides = np.transpose(scaled(variogram, *halves.T))
        lengths = np.hypot(*sides.T)
        is_analytic = variogram.correlation_model.is_product and lengths.max() <= MAX_ANALYTIC
        margin = (EVERYWHERE if is_analytic else MARGIN) * lengths.max()
        return cls((half_x_m, half_y_m), sides, lengths, abs(float(np.linalg.det(sides))), float(margin))

    def are_near(self, variogram: Variogram, samples: Supports, x_m: Array, y_m: Array) -> Mask:
        """Mask of the samples that have a point near a tile about (x, y), shape (samples, tiles)."""
        near = np.zeros((len(samples.layers[0][1]), len(x_m)), bool)
        for which, points, _ in samples.layers:
            way = scaled(variogram, points[:, 0, None] - x_m[:, 0], points[:, 1, None] - y_m[:, 0])
            first, second = (
                (np.abs(way[0] * side[1] - way[1] * side[0]) - self.area) / length
                for side, length in zip(self.sides, self.lengths, strict=True)
            )
            near[which] |= np.maximum(first, second) < self.margin
        return near


def _cells_at(xy: Array, x_m: Array, y_m: Array) -> tuple[tuple[Indices, Indices], Indices]:
    """Rows and columns, shape (k, 1) each, of cells with their centre at a place; numbers of the places."""
    found = []
    for axis, values in ((y_m, xy[:, 1]), (x_m, xy[:, 0])):
        order = np.argsort(axis, kind="stable")
        found.append(order[np.minimum(np.searchsorted(axis, values, sorter=order), len(axis) - 1)])
    row, column = found
    number = np.flatnonzero((x_m[column] == xy[:, 0]) & (y_m[row] == xy[:, 1]))
    return (row[number, None], column[number, None]), number


class _Inverse(NamedTuple):
    """Inverse of a kriging system, and products that the quadratic forms need."""

    factor: Array  # L^-1, lower triangle, shape (n, n), columns contiguous
    matrix: Array  # K^-1, shape (n, n)
    data: Array  # residual, ones and uncertain errors, shape (2 + k, n)
    weights: Array  # data L^-1, shape (2 + k, n)

    @classmethod
    def of(cls, system: KrigingSystem) -> _Inverse:
        from scipy.linalg.lapack import dlauum, dtrtri

        factor = dtrtri(system.factor, lower=1)[0]
        matrix = dlauum(factor, lower=1)[0]
        for start in range(0, len(matrix), 256):  # upper from lower triangle
            rows = slice(start, start + 256)
            matrix[rows, rows] = np.tril(matrix[rows, rows]) + np.tril(matrix[rows, rows], -1).T
            matrix[rows, start + 256 :] = matrix[start + 256 :, rows].T
        data = np.array([system.residual, system.ones, *system.uncertain.T])
        return cls(factor, matrix, data, data @ factor)


def _sums(inverse: _Inverse, near: Indices, of_far: Array, skeleton: Skeleton, functions: Array) -> Array:
    """The sums of :func:`tile_sums` for the cells of one tile, shape (3 + k, cells)."""
    m, r = len(near), of_far.shape[1]
    form = np.empty((m + len(inverse.data), r + m))
    np.matmul(inverse.factor.T[near], of_far, out=form[:m, :r])
    form[:m, :r] *= 2
    form[:m, r:] = inverse.matrix[near[:, None], near]
    form[m:, :r] = inverse.data @ of_far
    form[m:, r:] = inverse.weights[:, near]
    products = form @ functions
    at_points = skeleton.to_points @ (of_far.T @ of_far)
    smooth = np.einsum("ij,ij->i", at_points, skeleton.to_points).reshape(_PRODUCT_POINTS, -1)
    squares = (skeleton.along @ smooth @ skeleton.across).ravel()
    squares += np.einsum("ij,ij->j", products[:m], functions[r:])
    return np.vstack([squares, products[m:]])


# -- Skeleton ----------------------------------------------------------------------------------------


class Skeleton(NamedTuple):
    """Points of a tile, and the way from the values of smooth functions there to those elsewhere in the tile."""

    x: Array  # places between the middle of the tile and its border, -1 to 1, shape (r,)
    y: Array  # the other coordinate
    to_cells: Array  # matrix for the cells, row by row, shape (r, cells)
    to_points: Array  # matrix for the points of products, shape (_PRODUCT_POINTS^2, r)
    across: Array  # from products at their points to columns, shape (_PRODUCT_POINTS, width)
    along: Array  # from there to rows, shape (height, _PRODUCT_POINTS)


def find_skeleton(variogram: Variogram, tile: _TileShape, shape: tuple[int, int]) -> Skeleton:
    """The skeleton of a tile."""
    from scipy.linalg import qr, solve_triangular

    points, _ = _on_unit(np.zeros(0), _POINTS)
    x, y = (grid.ravel() for grid in np.meshgrid(points, points))
    found = _source_correlation(variogram, tile, x, y)
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


def _source_correlation(variogram: Variogram, tile: _TileShape, x: Array, y: Array) -> Array:
    """Correlations of points of a tile with sources on and outside of its margin, shape (points, _SOURCES).

    Half of the sources are within 1.3 half sides of the margin, where it matters most.
    """
    (ax, ay), (bx, by) = tile.sides.tolist()
    number = np.arange(_SOURCES)
    distance = tile.margin + _REACH * (number / _SOURCES) ** 4 * tile.lengths.max()
    out = [1 + distance * length / tile.area for length in tile.lengths[::-1].tolist()]
    golden = number * 0.6180339887498949 % 1 * 2 - 1
    beyond, east_or_west = 1 - 2 * (number % 2), number % 4 < 2
    s = np.where(east_or_west, beyond, golden) * out[0]
    t = np.where(east_or_west, golden, beyond) * out[1]
    s, t = x[:, None] - s, y[:, None] - t
    return variogram.correlation_of_square((s * ax + t * bx) ** 2 + (s * ay + t * by) ** 2)


def _on_unit(axis: Array, degree: int) -> tuple[Array, Array]:
    """Chebyshev points of [-1, 1], and interpolation from there to an axis inside, shape (places, degree)."""
    from scipy.fft import dct

    points = np.cos(np.pi * (np.arange(degree) + 0.5) / degree)
    coefficients = np.asarray(dct(np.eye(degree), axis=-1), float) / degree
    coefficients[:, 0] /= 2
    return points, np.cos(np.arccos(axis)[:, None] * np.arange(degree)) @ coefficients.T
