# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Smooth surfaces on rasters, interpolated to all cells from few Chebyshev points.

For a function that is analytic in a box, the interpolation error falls geometrically with the number of Chebyshev
points. The last coefficients show how small the error is (Trefethen, *Approximation Theory and Approximation
Practice*, SIAM 2013, chapters 3, 4 and 8). The kriging mean and variance of a Gaussian variogram are analytic:
sums and products of Gaussians.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TOLERANCE = 3e-12
"""Size of the last coefficients, relative to the scale of a surface, at which the surface counts as resolved."""
WORTH_SHARE = 0.5
"""Maximum number of points, as a share of the cells, for which interpolation is faster."""
_NEGLIGIBLE = TOLERANCE / 30
"""Size of negligible coefficients, relative to the scale of a surface."""
_TAIL = 3
_KEPT = 32
"""Number of cached sets of points."""
_MIN_GROWTH, _LARGEST_GROWTH = 1.12, 1.5


def raster_by_interpolation(
    evaluate: Evaluate,
    x_m: Array,
    y_m: Array,
    length_m: float,
    scale: Array,
    cells: int,
    growth: float | None = None,
) -> Array | None:
    """Surfaces on a raster, interpolated from Chebyshev points.

    :param evaluate: returns the k surfaces at the points (p along x, q along y), shape (k, q, p), or ``None``
    :param x_m: columns of the raster, shape (nx,), nx >= 1 [m]
    :param y_m: rows, shape (ny,), ny >= 1 [m]
    :param length_m: length over which the surfaces vary [m], > 0; starts the search of the number of points
    :param scale: size of each surface, shape (k,), to which :data:`TOLERANCE` is relative
    :param cells: number of cells wanted, which limits the number of points
    :param growth: factor from one number of points along each axis to the next, by default from the last
        coefficients. A fixed factor leads to few different sets of points
    :returns: shape (k, ny, nx), or ``None`` if ``evaluate`` returns ``None`` or too many points are needed (a
        length too short for the raster, or surfaces that are not smooth enough)
    """
    first = degrees = first_degrees(x_m, y_m, length_m)
    spent = 0
    for level in itertools.count(1):
        spent += math.prod(degrees)
        if spent > WORTH_SHARE * cells:
            break
        nodes = _nodes(x_m.tobytes(), y_m.tobytes(), degrees)
        surfaces = evaluate(nodes)
        if surfaces is None:
            break
        coefficients = nodes.coefficients(surfaces)
        tails = nodes.tails(coefficients, scale)
        if max(tails) <= TOLERANCE:
            return nodes.raster(coefficients, scale)
        if growth is None:
            degrees = tuple(math.ceil(d * _growth(tail)) for d, tail in zip(degrees, tails, strict=True))
        else:
            degrees = tuple(math.ceil(d * growth**level) for d in first)
    return None


class Coefficients(NamedTuple):
    """Chebyshev coefficients of k surfaces, along each axis first of even, then of odd degree.

    :param values: shape (k, q, p)
    :param sizes_x: largest absolute value of each degree along x, shape (k, p)
    :param sizes_y: largest absolute value of each degree along y, shape (k, q)
    """

    values: Array
    sizes_x: Array
    sizes_y: Array


class ChebyshevNodes:
    """Chebyshev points of the box of a raster, and the interpolation from the points to the cells.

    :param x_m: columns of the raster, shape (nx,), nx >= 1 [m]
    :param y_m: rows, shape (ny,), ny >= 1 [m]
    :param degrees: numbers of points (p, q) along x and y

    Attributes
    ----------
    x_m, y_m : NDArray
        axes of the points, shapes (p,) and (q,) [m]
    """

    def __init__(self, x_m: Array, y_m: Array, degrees: tuple[int, ...]) -> None:
        self._across, self._along = (_Series(*of_axis) for of_axis in zip((x_m, y_m), degrees, strict=True))
        self.x_m, self.y_m = self._across.points, self._along.points

    def coefficients(self, values: Array) -> Coefficients:
        """Coefficients of k surfaces from their values at the points, shape (k, q, p)."""
        coefficients = self._along.of_values.T @ (values @ self._across.of_values)
        sizes = np.abs(coefficients)
        return Coefficients(coefficients, sizes.max(axis=1), sizes.max(axis=2))

    def tails(self, coefficients: Coefficients, scale: Array) -> tuple[float, float]:
        """Size of the last coefficients along x and y, relative to the scale of each surface, shape (k,)."""
        tails_x = coefficients.sizes_x[:, self._across.last].max(axis=1) / scale
        tails_y = coefficients.sizes_y[:, self._along.last].max(axis=1) / scale
        return float(tails_x.max()), float(tails_y.max())

    def raster(self, coefficients: Coefficients, scale: Array) -> Array:
        """The surfaces on the raster, shape (k, ny, nx), without negligible coefficients."""
        rasters = np.empty((len(scale), len(self._along), len(self._across)))
        for raster, least, values, sizes_x, sizes_y in zip(
            rasters, _NEGLIGIBLE * scale, *coefficients, strict=True
        ):
            even_x, odd_x = _first_terms(sizes_x > least)
            even_y, odd_y = _first_terms(sizes_y > least)
            on_columns = self._across.sums(values.T[even_x], values.T[odd_x])
            self._along.sums(on_columns.T[even_y], on_columns.T[odd_y], out=raster)
        return rasters


class _Series:
    """Sums of Chebyshev polynomials along an axis, first of even, then of odd degree.

    :param axis_m: positions, in ascending or descending order, shape (places,) [m]
    :param degree: number of polynomials

    Attributes
    ----------
    points : NDArray
        Chebyshev points, shape (degree,) [m]
    of_values : NDArray
        matrix whose row i has the coefficients of the polynomial that is 1 at point i and 0 at the others
    last : NDArray
        numbers of the polynomials of the highest degrees
    """

    def __init__(self, axis_m: Array, degree: int) -> None:
        low, high = float(axis_m.min()), float(axis_m.max())
        order = np.r_[0:degree:2, 1:degree:2]
        self.points = _points(degree, low, high)
        self.of_values = np.ascontiguousarray(_coefficients(np.eye(degree))[:, order])
        self.last = np.flatnonzero(order >= degree - _TAIL)
        # Even polynomials are equal on both sides of the middle, odd ones change their sign.
        symmetric = np.abs(axis_m + axis_m[::-1] - (low + high)).max() <= 1e-12 * np.abs(axis_m).max()
        self._mirrored = len(axis_m) // 2 if symmetric else 0
        polynomials = _polynomials(axis_m[: len(axis_m) - self._mirrored], degree, low, high)
        self._even, self._odd = (np.ascontiguousarray(polynomials[:, parity::2]) for parity in (0, 1))

    def __len__(self) -> int:
        return len(self._even) + self._mirrored

    def sums(self, of_even: Array, of_odd: Array, out: Array | None = None) -> Array:
        """Sums of the first even and odd polynomials at all positions, shape (places, m).

        :param of_even: coefficients of the even polynomials, shape (k, m)
        :param of_odd: coefficients of the odd polynomials
        :param out: memory for the sums
        """
        half, mirrored = len(self._even), self._mirrored
        sums = np.empty((len(self), of_even.shape[1])) if out is None else out
        even = np.matmul(self._even[:, : len(of_even)], of_even, out=sums[:half])
        odd = self._odd[:, : len(of_odd)] @ of_odd
        np.subtract(even[:mirrored], odd[:mirrored], out=sums[half:][::-1])
        even += odd
        return sums


def _first_terms(matter: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Even terms and the odd terms after them, each up to the last that matters."""
    half = (len(matter) + 1) // 2
    even = half - int(matter[:half][::-1].argmax())
    return slice(even), slice(half, len(matter) - int(matter[half:][::-1].argmax()))


def interpolation(axis_m: Array, degree: int) -> tuple[Array, Array]:
    """Polynomial interpolation along an axis.

    :returns: Chebyshev points of the range of the axis, shape (degree,); matrix from values at these points to
        values along the axis, shape (places, degree)
    """
    low, high = float(axis_m.min()), float(axis_m.max())
    matrix = _polynomials(axis_m, degree, low, high) @ _coefficients(np.eye(degree)).T
    return _points(degree, low, high), np.asarray(matrix)


Evaluate = Callable[[ChebyshevNodes], Array | None]


@lru_cache(maxsize=_KEPT)
def _nodes(x_m: bytes, y_m: bytes, degrees: tuple[int, ...]) -> ChebyshevNodes:
    """Points for axes as bytes. Cached because all maps of a field have the same axes."""
    return ChebyshevNodes(np.frombuffer(x_m), np.frombuffer(y_m), degrees)


def first_degrees(x_m: Array, y_m: Array, length_m: float) -> tuple[int, ...]:
    """First guess of the numbers of points along x and y; parameters as :func:`raster_by_interpolation`."""
    return tuple(_first_guess((float(axis.max()) - float(axis.min())) / length_m) for axis in (x_m, y_m))


def _first_guess(lengths: float) -> int:
    """Number of points for a product of two Gaussians ``exp(-(h / length)^2)`` over a number of lengths.

    The coefficients of ``exp(-k u^2)``, u in [-1, 1], fall below e once their number exceeds about
    ``2 sqrt(k log(1/e))``. The constant is for surfaces that vary slowly.
    """
    return 12 + math.ceil(lengths * math.sqrt(math.log(1 / TOLERANCE)))


def _growth(tail: float) -> float:
    """Factor for the number of points, from the size of the last coefficients.

    The coefficients of a Gaussian fall like a Gaussian: their logarithm with the square of their number.
    """
    if tail <= TOLERANCE:
        return 1.0
    if tail >= 1.0:
        return _LARGEST_GROWTH
    return min(max(math.sqrt(math.log(TOLERANCE) / math.log(tail)), _MIN_GROWTH), _LARGEST_GROWTH)


def _points(degree: int, low: float, high: float) -> Array:
    """Chebyshev points of the first kind in an interval, descending."""
    angles = np.pi * (np.arange(degree) + 0.5) / degree
    return 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angles)


def _coefficients(values: Array) -> Array:
    """Chebyshev coefficients along the last axis from values at the points."""
    from scipy.fft import dct

    coefficients: Array = np.asarray(dct(values, axis=-1), float) / values.shape[-1]
    coefficients[..., 0] /= 2
    return coefficients


def _polynomials(axis: Array, degree: int, low: float, high: float) -> Array:
    """Chebyshev polynomials below a degree at positions in an interval, shape (places, degree)."""
    half = 0.5 * (high - low)
    unit = (axis - 0.5 * (low + high)) / half if half > 0 else np.zeros_like(axis)
    angles = np.arccos(np.clip(unit, -1.0, 1.0))
    return np.asarray(np.cos(angles[:, None] * np.arange(degree)))
