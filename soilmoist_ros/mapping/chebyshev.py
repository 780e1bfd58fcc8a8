"""Smooth surfaces on rasters: evaluated at few Chebyshev points, interpolated to all cells.

A function that is analytic in a box is interpolated from the Chebyshev points of the box with an error that falls
geometrically with their number, and the last coefficients tell how far that has gone (Trefethen, *Approximation
Theory and Approximation Practice*, SIAM 2013, chapters 3, 4 and 8). The kriging mean and variance of a Gaussian
variogram are such functions: sums and products of Gaussians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Evaluate = Callable[[Array, Array], Array]

TOLERANCE = 3e-12
"""Size of the last coefficients, relative to the scale of a surface, at which it counts as resolved."""
WORTH_SHARE = 0.5
"""With more points than this share of the cells there is nothing to gain."""
_TAIL = 3
_KEPT = 32
"""Sets of points that are kept."""
_LEAST_GROWTH, _LARGEST_GROWTH = 1.12, 1.5


def raster_by_interpolation(
    evaluate: Evaluate, x_m: Array, y_m: Array, length_m: float, scale: Array, cells: int
) -> Array | None:
    """Surfaces on a raster, interpolated from Chebyshev points.

    :param evaluate: takes axes (x of shape (p,), y of shape (q,)) and gives the k surfaces there, shape (k, q, p)
    :param x_m: columns of the raster, shape (nx,), nx >= 1 [m]
    :param y_m: rows, shape (ny,), ny >= 1 [m]
    :param length_m: length over which the surfaces vary [m], > 0: a start for the search of the number of points
    :param scale: size of each surface, shape (k,), to which :data:`TOLERANCE` is relative
    :param cells: how many cells are wanted in all: what this way must be cheaper than
    :returns: shape (k, ny, nx), or ``None`` if it would take too many points (a length too short for the raster,
        or surfaces that are not smooth enough)
    """
    degrees = first_degrees(x_m, y_m, length_m)
    spent = 0
    while True:
        spent += math.prod(degrees)
        if spent > WORTH_SHARE * cells:
            return None
        nodes = _nodes(x_m.tobytes(), y_m.tobytes(), degrees)
        coefficients = nodes.coefficients(evaluate(nodes.x_m, nodes.y_m))
        tails = nodes.tails(coefficients, scale)
        if max(tails) <= TOLERANCE:
            return nodes.raster(coefficients)
        degrees = tuple(math.ceil(d * _growth(tail)) for d, tail in zip(degrees, tails, strict=True))


class ChebyshevNodes:
    """Chebyshev points of the box of a raster, and what takes surfaces from there to the cells.

    :param x_m: columns of the raster, shape (nx,), nx >= 1 [m]
    :param y_m: rows, shape (ny,), ny >= 1 [m]
    :param degrees: numbers of points (p, q) along x and y

    Attributes
    ----------
    x_m, y_m : NDArray
        axes of the points, shapes (p,) and (q,) [m]
    """

    def __init__(self, x_m: Array, y_m: Array, degrees: tuple[int, ...]) -> None:
        boxes = [(float(axis.min()), float(axis.max())) for axis in (x_m, y_m)]
        self.x_m, self.y_m = (_points(degree, *box) for degree, box in zip(degrees, boxes, strict=True))
        self._across, self._along = (
            _polynomials(axis, degree, *box) for axis, degree, box in zip((x_m, y_m), degrees, boxes, strict=True)
        )
        self._symmetric = np.abs(y_m + y_m[::-1] - sum(boxes[1])).max() <= 1e-12 * np.abs(y_m).max()
        half = (len(y_m) + 1) // 2
        self._even, self._odd = (np.ascontiguousarray(self._along[:half, parity::2]) for parity in (0, 1))
        self._of_columns, self._of_rows = (_coefficients(np.eye(degree)) for degree in degrees)

    def coefficients(self, values: Array) -> Array:
        """Chebyshev coefficients of k surfaces from their values at the points, both of shape (k, q, p)."""
        return np.asarray(self._of_rows.T @ (values @ self._of_columns))

    def tails(self, coefficients: Array, scale: Array) -> tuple[float, float]:
        """Size of the last coefficients along x and y, relative to the scale of each surface, shape (k,)."""
        beyond_x, beyond_y = np.abs(coefficients[:, :, -_TAIL:]), np.abs(coefficients[:, -_TAIL:, :])
        return float((beyond_x.max((1, 2)) / scale).max()), float((beyond_y.max((1, 2)) / scale).max())

    def raster(self, coefficients: Array) -> Array:
        """The surfaces on the raster, shape (k, ny, nx)."""
        on_columns = coefficients @ self._across.T
        if not self._symmetric:
            return np.asarray(self._along @ on_columns)
        # Polynomials of even degree are the same on both sides of the middle, odd ones change their sign.
        rows = len(self._along)
        half, mirrored = (rows + 1) // 2, rows // 2
        even = self._even @ on_columns[:, ::2]
        odd = self._odd @ on_columns[:, 1::2]
        raster = np.empty((len(coefficients), rows, len(self._across)))
        np.add(even, odd, out=raster[:, :half])
        np.subtract(even[:, :mirrored], odd[:, :mirrored], out=raster[:, half:][:, ::-1])
        return raster


@lru_cache(maxsize=_KEPT)
def _nodes(x_m: bytes, y_m: bytes, degrees: tuple[int, ...]) -> ChebyshevNodes:
    """Points for axes given by their bytes; kept, as the maps of all missions on a field have the same axes."""
    return ChebyshevNodes(np.frombuffer(x_m), np.frombuffer(y_m), degrees)


def first_degrees(x_m: Array, y_m: Array, length_m: float) -> tuple[int, ...]:
    """Numbers of points along x and y that may do; parameters as those of :func:`raster_by_interpolation`."""
    return tuple(_first_guess((float(axis.max()) - float(axis.min())) / length_m) for axis in (x_m, y_m))


def _first_guess(lengths: float) -> int:
    """Number of points for a product of two Gaussians ``exp(-(h / length)^2)`` over so many lengths.

    The coefficients of ``exp(-k u^2)``, u in [-1, 1], fall below e once their number exceeds about
    ``2 sqrt(k log(1/e))``; a surface that varies slowly needs a few all the same.
    """
    return 12 + math.ceil(lengths * math.sqrt(math.log(1 / TOLERANCE)))


def _growth(tail: float) -> float:
    """How many times more points are needed where the last coefficients are still so large.

    Those of a Gaussian fall like a Gaussian: their logarithm with the square of their number.
    """
    if tail <= TOLERANCE:
        return 1.0
    if tail >= 1.0:
        return _LARGEST_GROWTH
    return min(max(math.sqrt(math.log(TOLERANCE) / math.log(tail)), _LEAST_GROWTH), _LARGEST_GROWTH)


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
    """Chebyshev polynomials below a degree at places of an interval, shape (places, degree)."""
    half = 0.5 * (high - low)
    unit = (axis - 0.5 * (low + high)) / half if half > 0 else np.zeros_like(axis)
    angles = np.arccos(np.clip(unit, -1.0, 1.0))
    return np.asarray(np.cos(angles[:, None] * np.arange(degree)))
