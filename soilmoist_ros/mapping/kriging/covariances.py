# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances of samples with fixed targets, stored while samples are added, and weighted sums of the covariances.

The stored values of a sample depend only on this sample and earlier ones. A sum always uses equal operations on
arrays of equal shapes, whatever was stored or summed before, so the result is reproducible bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

_CHUNK = 128
"""Rows allocated at a time."""
_AT_ONCE = 16384
"""Covariances computed at a time, so that intermediate results stay in the cache."""


class Covariances(Protocol):
    """Covariances of samples with targets.

    Attributes
    ----------
    size : int
        number of targets
    """

    size: int

    @property
    def xy(self) -> Array:
        """The targets, shape (size, 2) [m]."""
        ...

    def begin(self, variogram: Variogram) -> None:
        """Forget all samples and use another variogram of the latent rate; call this first."""
        ...

    def keep(self, samples: Array, changed: NDArray[np.intp], most: int) -> bool:
        """Compute the covariances of samples that are new or have changed.

        :param samples: x, y and the spread, shape (n, 6)
        :param changed: numbers of these, ascending
        :param most: maximum number of stored values
        :returns: ``False`` if there are too many values; then none are stored
        """
        ...

    def combine(self, weights: Array) -> Iterator[tuple[slice, Array]]:
        """Weighted sums over the first n samples.

        :param weights: shape (m, n)
        :returns: slices of consecutive targets, and their sums, shape (m, targets)
        """
        ...


def add_rows(covariances: Covariances, weights: Array, data: Array, of_data: Array, squares: Array) -> None:
    """Add weighted sums over samples, row by row.

    :param weights: rows of weights, shape (m, n)
    :param data: k factors of each row, shape (k, m)
    :param of_data: increased by the sums of the rows times the factors, shape (k, size)
    :param squares: increased by the sum of the squared rows, shape (size,)
    """
    for some, rows in covariances.combine(weights):
        of_data[:, some] += data @ rows
        squares[some] += np.einsum("ij,ij->j", rows, rows)


class PointCovariances:
    """Covariances with arbitrary places, all stored.

    :param xy: the places, shape (g, 2), g >= 1 [m]
    :param nugget: whether a place exactly where a sample is shares its nugget
    """

    def __init__(self, xy: Array, nugget: bool) -> None:
        self.size = len(xy)
        self._x, self._y = np.ascontiguousarray(xy.T)
        self._needles = Needles(self._x, self._y, nugget)
        self._rows = Rows(len(xy))

    @property
    def xy(self) -> Array:
        """See :class:`Covariances`."""
        return np.column_stack([self._x, self._y])

    def begin(self, variogram: Variogram) -> None:
        """See :class:`Covariances`."""
        self._variogram = variogram
        self._scaled = scaled(variogram, self._x, self._y)

    def keep(self, samples: Array, changed: NDArray[np.intp], most: int) -> bool:
        """See :class:`Covariances`."""
        if len(samples) * self.size > most:
            return False
        for run in np.split(changed, np.flatnonzero(np.diff(changed) > 1) + 1) if len(changed) else ():
            for start, rows in self._rows.writable(int(run[0]), int(run[-1]) + 1):
                some = samples[start : start + len(rows)]
                SamplePoints(self._variogram, some).covariance(*self._scaled, rows)
                for row, sample in zip(rows, some, strict=True):
                    self._needles.add(self._variogram.nugget, row, sample)
        return True

    def combine(self, weights: Array) -> Iterator[tuple[slice, Array]]:
        """See :class:`Covariances`."""
        for start in range(0, self.size, _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            yield some, self._rows.combine(weights, some)


class AxesCovariances:
    """Gaussian covariances with the points of a grid: products of one factor for each axis.

    The longest range must lie along an axis, if any direction is special.

    :param x_m: columns, shape (p,) [m]
    :param y_m: rows, shape (q,); there are p q targets, row by row [m]
    """

    def __init__(self, x_m: Array, y_m: Array) -> None:
        self.size = len(x_m) * len(y_m)
        self._x_m, self._y_m = x_m, y_m

    @property
    def xy(self) -> Array:
        """See :class:`Covariances`."""
        x, y = np.meshgrid(self._x_m, self._y_m)
        return np.column_stack([x.ravel(), y.ravel()])

    def begin(self, variogram: Variogram) -> None:
        """See :class:`Covariances`."""
        self._variogram, none = variogram, np.zeros(1)
        self._x, self._y = scaled(variogram, self._x_m, none)[0], scaled(variogram, none, self._y_m)[1]
        self._sample = np.empty(0, int)  # which each point is of
        self._columns, self._rows = np.empty((0, len(self._x))), np.empty((0, len(self._y)))

    def keep(self, samples: Array, changed: NDArray[np.intp], most: int) -> bool:
        """See :class:`Covariances`."""
        first = first_changed(changed, len(samples))
        self._sample = self._sample[: self._sample.searchsorted(first)]
        if first < len(samples):
            self._add(samples, first)
        return len(self._sample) * (len(self._x) + len(self._y)) <= most

    def _add(self, samples: Array, first: int) -> None:
        points = SamplePoints(self._variogram, samples[first:])
        sample = np.concatenate([np.arange(first, len(samples))[which] for which, *_ in points.layers])
        order = np.argsort(sample, kind="stable")
        x, y, factor = (np.concatenate([layer[k] for layer in points.layers])[order] for k in (1, 2, 3))
        known = len(self._sample)
        self._sample = np.concatenate([self._sample, sample[order]])
        count = len(self._sample)
        if count > len(self._columns):
            room = 2 * count
            self._columns, self._rows = (
                np.concatenate([table[:known], np.empty((room - known, table.shape[1]))])
                for table in (self._columns, self._rows)
            )
        np.exp(-((self._x - x[:, None]) ** 2), out=self._columns[known:count])
        np.multiply(np.exp(-((self._y - y[:, None]) ** 2)), factor[:, None], out=self._rows[known:count])

    def combine(self, weights: Array) -> Iterator[tuple[slice, Array]]:
        """See :class:`Covariances`."""
        known = int(self._sample.searchsorted(weights.shape[1]))
        columns, rows = self._columns[:known], self._rows[:known]
        of_points = weights.take(self._sample[:known], axis=1)
        sums = np.empty((len(weights), rows.shape[1], columns.shape[1]))
        for some, total in zip(of_points, sums, strict=True):
            np.matmul((rows * some[:, None]).T, columns, out=total)
        yield slice(None), sums.reshape(len(weights), -1)


class Rows:
    """A table that grows.

    :param width: elements of a row
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._chunks: list[Array] = []

    def writable(self, start: int, stop: int) -> Iterator[tuple[int, Array]]:
        """The number of the first, and rows to write, some at a time, from ``start`` to ``stop``."""
        while start < stop:
            number, row = divmod(start, _CHUNK)
            if number == len(self._chunks):
                self._chunks.append(np.empty((_CHUNK, self._width)))
            rows = self._chunks[number][row : row + stop - start]
            yield start, rows
            start += len(rows)

    def combine(self, weights: Array, some: slice = slice(None)) -> Array:
        """Weighted sums of some elements of the first n rows; weights of shape (m, n), n >= 1."""
        total = weights[:, :_CHUNK] @ self._chunks[0][: weights.shape[1], some]
        for number in range(1, -(-weights.shape[1] // _CHUNK)):
            part = weights[:, _CHUNK * number : _CHUNK * (number + 1)]
            total += part @ self._chunks[number][: part.shape[1], some]
        return np.asarray(total)


class Needles:
    """The nugget, which a target shares with a sample exactly there.

    :param x_m: targets, any shape [m]
    :param y_m: the same shape [m]
    :param are_shared: whether they share it
    """

    def __init__(self, x_m: Array, y_m: Array, are_shared: bool) -> None:
        self._x, self._y = x_m, y_m
        self._columns, self._lines = (set(axis.ravel().tolist()) if are_shared else set() for axis in (x_m, y_m))

    def add(
        self, nugget: float, covariance: Array, sample: Array, some: slice | NDArray[np.intp] = slice(None)
    ) -> None:
        """Add the nugget to the covariance of a sample with some of the targets."""
        if sample[0] in self._columns and sample[1] in self._lines:
            covariance[(self._x[some] == sample[0]) & (self._y[some] == sample[1])] += nugget


class SamplePoints:
    """Samples that know their covariance with places.

    :param variogram: variogram of the latent rate
    :param samples: x, y and the spread in the first columns, shape (m, 6 or more)

    Attributes
    ----------
    layers : list
        (samples, x, y, factor): whose points they are, as in :class:`Supports`,
        their places as of :func:`scaled` and their weights times the structured sill, each of shape (k,)
    """

    def __init__(self, variogram: Variogram, samples: Array) -> None:
        self._correlation = variogram.correlation_model.correlation
        self.layers: list[tuple[slice | NDArray[np.intp], Array, Array, Array]] = []
        for which, points, weight in Supports(samples[:, :2], samples[:, 2:6]).layers:
            factor = np.full(len(points), variogram.structured_sill)
            factor *= 1.0 if weight is None else weight
            self.layers.append((which, *scaled(variogram, *points.T), factor))

    def covariance(self, x: Array, y: Array, out: Array) -> None:
        """Structured covariance with places.

        :param x: scaled east, shape (g,); see :func:`scaled`
        :param y: scaled north
        :param out: takes the result, shape (m, g)
        """
        at_once = max(1, _AT_ONCE // max(1, len(x)))
        east, north, factor = (np.concatenate([layer[k] for layer in self.layers]) for k in (1, 2, 3))
        for some in (slice(start, start + _AT_ONCE) for start in range(0, len(x), _AT_ONCE)):
            for start in range(0, len(east), at_once):
                points = slice(start, start + at_once)
                square = x[some] - east[points, None]
                square *= square
                north_square = y[some] - north[points, None]
                north_square *= north_square
                square += north_square
                correlation = self._correlation(square)
                correlation *= factor[points, None]
                self._add(correlation, start, out[:, some])

    def _add(self, values: Array, first: int, out: Array) -> None:
        """Add the values of points, numbered through all layers from ``first`` on, to those of their samples."""
        begin = 0
        for which, east, _, _ in self.layers:
            start, stop = max(first - begin, 0), min(first + len(values) - begin, len(east))
            if start < stop:
                part = values[begin + start - first : begin + stop - first]
                if isinstance(which, slice):
                    out[start:stop] = part
                else:
                    out[which[start:stop]] += part
            begin += len(east)


def differences(known: Array, samples: Array) -> NDArray[np.intp]:
    """Numbers of the rows of a table that are not as in another one, or not in it."""
    both = min(len(known), len(samples))
    differs = np.ones(len(samples), bool)
    differs[:both] = (known[:both] != samples[:both]).any(axis=1)
    return np.flatnonzero(differs)


def first_changed(changed: NDArray[np.intp], count: int) -> int:
    """The first row of a table that changed, ``count`` if none did: the rows before it are as they were.

    :param changed: numbers of the rows that changed, as from :func:`differences`
    :param count: number of rows
    """
    return int(changed[0]) if len(changed) else count
