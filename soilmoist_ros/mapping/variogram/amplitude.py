# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A smooth field of amplitudes: how much the rate varies around each place, relative to the whole field.

A field that is rough in one part and flat in another has the covariance ``a(x) a(y) C(x - y)``, with the
covariance C of a stationary variogram and the amplitude a. Kriging then is that of the stationary part, in units
of the amplitude: samples ``rate / a`` with noise variance ``noise / a^2``, and the unknown mean times ``1 / a``.

The logarithm of the amplitude is a tensor product of uniform cubic B-splines (de Boor 2001, A Practical Guide to
Splines) over the box of the field. Outside the box the amplitude is that of the nearest place inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Corner = tuple[float, float]
Box = tuple[Corner, Corner]
"""South-west and north-east corner [m]."""

MAX_LOG = 5.0
"""Largest absolute value of the logarithm of an amplitude."""
_TERMS = 4
"""Splines along each axis that are not 0 at a place."""


@dataclass(frozen=True)
class Amplitude:
    """Amplitudes over the box of a field.

    :param low: south-west corner of the box [m]
    :param high: north-east corner [m], each coordinate above that of ``low``
    :param log_values: coefficients of the logarithm, rows from south to north, at least 4 x 4; equal coefficients
        make a constant
    :raises ValueError: if the box is empty, the coefficients are no table, or a number is not finite

    >>> Amplitude((0, 0), (10, 10), ((0.0,) * 4,) * 4)(np.array([[3.0, 4.0], [99.0, -1.0]]))
    array([1., 1.])
    """

    low: Corner
    high: Corner
    log_values: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        low, high = (tuple(map(float, corner)) for corner in (self.low, self.high))
        rows = tuple(tuple(map(float, row)) for row in self.log_values)
        if len(low) != 2 or len(high) != 2 or not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"the box of an amplitude must have an extent, got {low} to {high}")
        if len(rows) < _TERMS or len(rows[0]) < _TERMS or len({len(row) for row in rows}) > 1:
            raise ValueError(f"an amplitude needs a table of at least {_TERMS} x {_TERMS} coefficients")
        if not all(np.isfinite(values).all() for values in (low, high, *rows)):
            raise ValueError("an amplitude must have finite numbers")
        for name, value in (("low", low), ("high", high), ("log_values", rows)):
            object.__setattr__(self, name, value)

    def __call__(self, xy: Array) -> Array:
        """Amplitudes at places of shape (n, 2) [m], shape (n,).

        The amplitude at a place does not depend on the other places, bit for bit.
        """
        table = _table(self.log_values)
        total = np.zeros(len(xy))
        for row, column, weight in _terms(self.low, self.high, table.shape, xy):
            total += weight * table[row, column]
        return np.exp(np.clip(total, -MAX_LOG, MAX_LOG))

    @property
    def spread(self) -> tuple[float, float]:
        """Smallest and largest amplitude on an even lattice of the box, one place at each coefficient."""
        values = self(lattice(self.low, self.high, _table(self.log_values).shape))
        return float(values.min()), float(values.max())


def spline_matrix(low: Corner, high: Corner, shape: tuple[int, int], xy: Array) -> Array:
    """Values of all splines at places, shape (n, rows * columns): the logarithm is linear in the coefficients.

    :param low: south-west corner of the box [m]
    :param high: north-east corner [m]
    :param shape: rows and columns of coefficients
    :param xy: places, shape (n, 2) [m]
    """
    matrix = np.zeros((len(xy), *shape))
    number = np.arange(len(xy))
    for row, column, weight in _terms(low, high, shape, xy):
        matrix[number, row, column] = weight
    return matrix.reshape(len(xy), -1)


def knots(low: Corner, high: Corner, shape: tuple[int, int]) -> Array:
    """Middle of each spline, shape (rows * columns, 2) [m]; those at the edge lie outside the box."""
    steps = [(b - a) / (count - 3) for a, b, count in zip(low, high, shape[::-1], strict=True)]
    axes = [a + step * np.arange(-1, count - 1) for a, step, count in zip(low, steps, shape[::-1], strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def lattice(low: Corner, high: Corner, shape: tuple[int, int]) -> Array:
    """Middles of equal parts of the box, shape (rows * columns, 2) [m]."""
    axes = [
        a + (b - a) * (np.arange(count) + 0.5) / count for a, b, count in zip(low, high, shape[::-1], strict=True)
    ]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def _terms(
    low: Corner, high: Corner, shape: tuple[int, int], xy: Array
) -> Iterator[tuple[Indices, Indices, Array]]:
    """Rows, columns and values of the splines that are not 0 at places, each of shape (n,)."""
    (x, of_x), (y, of_y) = (
        _axis(xy[:, axis], low[axis], high[axis], shape[1 - axis] - _TERMS + 1) for axis in (0, 1)
    )
    for j, i in product(range(_TERMS), repeat=2):
        yield y + j, x + i, of_y[j] * of_x[i]


def _axis(values_m: Array, low_m: float, high_m: float, intervals: int) -> tuple[Indices, list[Array]]:
    """Number of the first spline and values of the four splines along an axis."""
    position = (np.clip(values_m, low_m, high_m) - low_m) * (intervals / (high_m - low_m))
    first = np.minimum(position.astype(np.intp), intervals - 1)
    u = position - first
    v = 1 - u
    square, cube = u * u, u * u * u
    splines = [v * v * v / 6, (3 * cube - 6 * square + 4) / 6, (-3 * cube + 3 * square + 3 * u + 1) / 6, cube / 6]
    return first, splines


@lru_cache(maxsize=8)
def _table(rows: tuple[tuple[float, ...], ...]) -> Array:
    return np.array(rows)
