"""Kriging of one set of targets again and again, while samples are added or grow: row by row.

With the samples in order, row i of the Cholesky factor L and of W = L^-1 C_.0 (see
:mod:`~soilmoist_ros.mapping.poisson_kriging`) depends on the samples up to i alone. When a record has changed the
last sample, or begun a new one, all rows before are as they were: one row of 70,000 numbers is new, not 300.

The answer must not depend on what was kept: its last bits are those of a fresh computation. So each number is
made by the same operations on arrays of the same shapes, whenever that happens. Rows make full blocks of fixed
size; those behind the last full block, the *tail*, are made one by one. Which rows are full follows from the
number of samples, and a block is made from nothing but the samples up to its end. That holds for one BLAS thread;
two may share out a product differently from one time to the next.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.support import Supports
from soilmoist_ros.mapping.variogram import MODELS, Variogram, isotropic_plane

Array = NDArray[np.float64]

BLOCK = 32
"""Rows of a full block."""
LEAST_TAIL = 8
"""Rows that stay in the tail: places where robots stand now, whose exposure grows with every record."""
MOST_ROWS = 2000
"""Samples that rows are kept of."""
MOST_ELEMENTS = 32_000_000
"""Numbers in all rows of W (256 MB): 450 samples and 70,000 targets."""
LEAST_PIVOT = 1e-6
"""Share of a sample's variance that those before must leave unexplained; the inverse of L is too inexact below."""
_PART = 256
"""Elements of a row of L that are computed at a time, a multiple of :data:`BLOCK`."""
_AT_ONCE = 16384
"""Covariances computed at a time: what comes between stays in the cache."""
_TILE = 4096
"""Most targets of a tile: a block of it and a row of all tiles fit into a cache of 1 MB."""

_NONE = Variogram("exponential", 0.0, 1.0, 0.0)


class Surfaces(NamedTuple):
    """The map but for the variance of the targets themselves.

    :param rate: shape (g,) [counts/s]
    :param variance: what samples and unknown mean add to the variance of a target (mostly below 0), shape (g,)
        [(counts/s)^2]
    """

    rate: Array
    variance: Array


class KrigingRows:
    """Rows of L, of its inverse and of W for fixed targets, kept from one set of samples to the next.

    :param xy: targets, shape (g, 2), g >= 1 [m]
    :param nugget: whether a target exactly where a sample is shares its nugget
    """

    def __init__(self, xy: Array, nugget: bool) -> None:
        count = len(xy)
        tiles = -(-count // _TILE)
        width = -(-count // (8 * tiles)) * 8
        filled = np.concatenate([xy, np.repeat(xy[-1:], tiles * width - count, axis=0)])
        self._count = count
        self._x, self._y = np.ascontiguousarray(filled.T).reshape(2, tiles, width)
        self._columns, self._lines = (set(xy[:, axis].tolist()) if nugget else set() for axis in (0, 1))
        self._variogram = _NONE
        self._scaled = self._x, self._y
        self._samples = np.empty((0, 7))  # x, y, spread, noise, rate of those whose rows are known
        self._factor, self._inverse = np.zeros((2, MOST_ROWS, MOST_ROWS))
        self._data = np.zeros((2, MOST_ROWS))  # L^-1 rate, L^-1 1
        self._blocks: list[Array] = []  # of W, each of shape (tiles, BLOCK, width)
        self._full = 0  # rows in blocks that are valid
        self._of_blocks = np.zeros((3, tiles, width))  # sums of (L^-1 rate) W, (L^-1 1) W and W^2 over these
        size = tiles, BLOCK + LEAST_TAIL, width
        self._explained = np.empty(size)  # of the tail: covariance less what full blocks explain
        self._tail = np.empty(size)  # of W
        self._scratch = np.empty((tiles, width))
        self._made = 0  # rows of W that are valid, in blocks and tail
        self._before = np.empty((3, tiles, width)), -1  # sums over the rows before the last, and their number

    def follow(self, places: Samples, variogram: Variogram, mean_rate: float) -> Surfaces | None:
        """Krige the targets.

        :param places: samples at distinct places, n >= 1
        :param variogram: variogram of the latent rate
        :param mean_rate: mean rate m* in the noise variances m*/t [counts/s]
        :returns: the surfaces in new memory; ``None`` if that is too much to keep, or if the matrix is so near to
            singular (:data:`LEAST_PIVOT`) that its inverse must not be used
        """
        n = len(places)
        if n > MOST_ROWS or n * self._count > MOST_ELEMENTS:
            self._blocks.clear()
            self._forget(0)
            return None
        if variogram != self._variogram:
            self._variogram = variogram
            self._scaled = _scaled(variogram, self._x, self._y)
            self._forget(0)
        noise = variogram.nugget + mean_rate / places.exposure_s
        samples = np.column_stack([places.xy, places.spread, noise, places.rate_cps])
        known, was_full = self._samples, self._full
        first = _first_difference(known, samples)
        full = max(0, n - LEAST_TAIL) // BLOCK * BLOCK
        self._forget(first, min(full, first // BLOCK * BLOCK))
        if not self._factorise(first, samples):
            return None
        stays = np.zeros(n, bool)  # the tail's rows of which the full blocks explain as much as before
        if self._full == was_full:
            both = slice(was_full, min(n, len(known)))
            stays[both] = (known[both, :5] == samples[both, :5]).all(axis=1)
        for start in range(self._full, full, BLOCK):
            self._fill_block(start, samples, stays)
        self._make_tail(samples, stays)
        self._samples = samples
        return self._surfaces(n)

    def _forget(self, first: int, full: int = 0) -> None:
        """Take the rows from ``first`` on for unknown, and no more than ``full`` for those of blocks."""
        self._samples = self._samples[:first]
        self._made = min(self._made, first)
        if full < self._full:
            self._of_blocks[:] = 0.0
            for start in range(0, full, BLOCK):
                self._add_block(start)
            self._full = self._made = full
        if self._made < self._before[1]:
            self._before = self._before[0], -1

    # -- L ---------------------------------------------------------------------------------------------

    def _factorise(self, first: int, samples: Array) -> bool:
        """Rows of L and its inverse from ``first`` on.

        :returns: whether the matrix is well-conditioned enough
        """
        factor, inverse = self._factor, self._inverse
        data = np.column_stack([samples[:, 6], np.ones(len(samples))])
        covariance = _between(self._variogram, samples, first) if first < len(samples) else np.empty((0, 0))
        for i in range(first, len(samples)):
            right = covariance[i - first]
            row = factor[i, :i]
            # In parts, so that what belongs to full blocks is made without the samples of the tail, whichever
            # of the last two ends of blocks that may begin at.
            middle = max(0, i // BLOCK - 1) * BLOCK
            for start, stop in pairwise([*range(0, middle, _PART), middle, min(middle + BLOCK, i), i]):
                if start < stop:
                    row[start:stop] = inverse[start:stop, :stop] @ right[:stop]
            total = right[i] + samples[i, 5]
            pivot = total - row @ row
            if not pivot >= LEAST_PIVOT * total:
                return False
            diagonal = factor[i, i] = math.sqrt(pivot)
            inverse[i, :i] = row @ inverse[:i, :i]
            inverse[i, :i] /= -diagonal
            inverse[i, i] = 1 / diagonal
            self._data[:, i] = inverse[i, : i + 1] @ data[: i + 1]
        return True

    # -- W ---------------------------------------------------------------------------------------------

    def _fill_block(self, start: int, samples: Array, stays: NDArray[np.bool_]) -> None:
        """Make the next full block, and bring the rows of the tail that stay up to it."""
        from scipy.linalg.blas import dgemm, dgemv

        number, rows = start // BLOCK, slice(start, start + BLOCK)
        if number == len(self._blocks):
            self._blocks.append(np.empty((self._x.shape[0], BLOCK, self._x.shape[1])))
        block = self._blocks[number]
        before = [np.ascontiguousarray(self._factor[rows, BLOCK * k : BLOCK * (k + 1)]) for k in range(number)]
        diagonal = np.ascontiguousarray(self._inverse[rows, rows])
        points = _Points(self._variogram, samples[rows])
        scratch = np.empty(block.shape[1:])
        later = [j for j in range(rows.stop, len(samples)) if stays[j]]
        for tile in range(len(block)):
            self._covariance(points, samples[rows], slice(tile, tile + 1), scratch)
            for factor, earlier in zip(before, self._blocks, strict=False):
                dgemm(-1.0, earlier[tile].T, factor.T, beta=1.0, c=scratch.T, overwrite_c=1)
            np.matmul(diagonal, scratch, out=block[tile])
            for j in later:
                explained = self._explained[tile, j - start]
                dgemv(-1.0, block[tile].T, self._factor[j, rows], beta=1.0, y=explained, overwrite_y=1)
        for j in later:
            self._explained[:, j - rows.stop] = self._explained[:, j - start]
        self._add_block(start)
        self._full = self._made = rows.stop
        self._before = self._before[0], -1

    def _add_block(self, start: int) -> None:
        """Add a block to the sums over all."""
        data = np.ascontiguousarray(self._data[:, start : start + BLOCK])
        for tile, rows in enumerate(self._blocks[start // BLOCK]):
            self._of_blocks[:2, tile] += data @ rows
            self._of_blocks[2, tile] += np.einsum("ij,ij->j", rows, rows)

    def _make_tail(self, samples: Array, stays: NDArray[np.bool_]) -> None:
        """Make the rows of the tail that are new or changed."""
        from scipy.linalg.blas import dgemv

        full, n = self._full, len(samples)
        fresh = [j for j in range(full, n) if not stays[j]]
        for j in fresh:
            points = _Points(self._variogram, samples[j : j + 1])
            self._covariance(points, samples[j : j + 1], slice(None), self._scratch.reshape(1, -1))
            self._explained[:, j - full] = self._scratch
        for tile in range(len(self._x)):
            for number, block in enumerate(self._blocks[: full // BLOCK]):
                rows = slice(BLOCK * number, BLOCK * (number + 1))
                for j in fresh:
                    explained = self._explained[tile, j - full]
                    dgemv(-1.0, block[tile].T, self._factor[j, rows], beta=1.0, y=explained, overwrite_y=1)
        for j in range(self._made, n):
            for tile, known in enumerate(self._tail):
                row = known[j - full]
                row[:] = self._explained[tile, j - full]
                if j > full:
                    earlier = known[: j - full]
                    dgemv(-1.0, earlier.T, self._factor[j, full:j], beta=1.0, y=row, overwrite_y=1)
                row /= self._factor[j, j]
        self._made = n

    def _surfaces(self, n: int) -> Surfaces:
        """Sum up the rows."""
        before, count = self._before
        if count < 0 or count > n - 1:
            before[:] = self._of_blocks
            count = self._full
        while count < n - 1:
            self._add_row(count, before, before)
            count += 1
        self._before = before, count
        sums = np.empty_like(before)
        self._add_row(count, before, sums)
        return self._finished(sums.reshape(3, -1)[:, : self._count])

    def _finished(self, sums: Array) -> Surfaces:
        """Surfaces of the sums of (L^-1 rate) W, (L^-1 1) W and W^2, shape (3, g), which are overwritten."""
        rate, ones = self._data[:, : len(self._samples)]
        whole = float(ones @ ones)
        mean = float(rate @ ones) / whole
        of_rate, of_ones, squares = sums
        of_ones -= 1.0
        np.subtract(of_ones * of_ones / whole, squares, out=squares)
        of_ones *= mean
        of_rate -= of_ones
        return Surfaces(of_rate, squares)

    def at_samples(self, numbers: NDArray[np.intp]) -> Surfaces:
        """The same exactly where some of the samples of the last :meth:`follow` are, their nugget shared."""
        known, n = self._samples, len(self._samples)
        covariance = np.empty((n, len(numbers)))
        x, y = known[numbers, :2].T
        _Points(self._variogram, known).covariance(*_scaled(self._variogram, x, y), covariance)
        covariance[numbers, np.arange(len(numbers))] += self._variogram.nugget
        solved = self._inverse[:n, :n] @ covariance
        of_data = self._data[:, :n] @ solved
        return self._finished(np.stack([*of_data, np.einsum("ij,ij->j", solved, solved)]))

    def _add_row(self, number: int, sums: Array, out: Array) -> None:
        """Add a row of the tail to sums."""
        row, scratch = self._tail[:, number - self._full], self._scratch
        rate, ones = self._data[:, number].tolist()
        for total, factor, result in zip(sums, (rate, ones, row), out, strict=True):
            np.add(total, np.multiply(row, factor, out=scratch), out=result)

    def _covariance(self, points: _Points, samples: Array, tiles: slice, out: Array) -> None:
        """Covariance of samples with the targets of tiles, shape (samples, targets)."""
        points.covariance(self._scaled[0][tiles].ravel(), self._scaled[1][tiles].ravel(), out)
        for row, (x_m, y_m) in zip(out, samples[:, :2].tolist(), strict=True):
            if x_m in self._columns and y_m in self._lines:
                here = (self._x[tiles].ravel() == x_m) & (self._y[tiles].ravel() == y_m)
                row[here] += self._variogram.nugget


class _Points:
    """Samples that know their covariance with places.

    :param variogram: variogram of the latent rate
    :param samples: x, y and the spread in the first columns, shape (m, 5 or more)
    """

    def __init__(self, variogram: Variogram, samples: Array) -> None:
        supports = Supports(samples[:, :2], samples[:, 2:5])
        self._correlation = MODELS[variogram.model].correlation
        self._layers = []
        for which, points, weight in supports.layers:
            factor = np.full(len(points), variogram.structured_sill)
            factor *= 1.0 if weight is None else weight
            self._layers.append((which, *_scaled(variogram, *points.T), factor[:, None]))

    def covariance(self, x: Array, y: Array, out: Array) -> None:
        """Structured covariance with places.

        :param x: scaled east, shape (g,); see :func:`_scaled`
        :param y: scaled north
        :param out: takes the result, shape (m, g)
        """
        at_once = max(1, _AT_ONCE // len(x))
        for which, east, north, factor in self._layers:
            for part in range(0, len(east), at_once):
                rows = slice(part, part + at_once)
                square = x - east[rows, None]
                square *= square
                north_square = y - north[rows, None]
                north_square *= north_square
                square += north_square
                correlation = self._correlation(square)
                if isinstance(which, slice):
                    np.multiply(correlation, factor[rows], out=out[rows])
                else:
                    correlation *= factor[rows]
                    out[which[rows]] += correlation


def _between(variogram: Variogram, samples: Array, first: int) -> Array:
    """Structured covariance of the samples from ``first`` on with all, shape (n - first, n)."""
    every, later = _Points(variogram, samples), Supports(samples[first:, :2], samples[first:, 2:5])

    def with_points(xy: Array) -> Array:
        covariance = np.empty((len(samples), len(xy)))
        every.covariance(*_scaled(variogram, *xy.T), covariance)
        return covariance

    return np.ascontiguousarray(later.average(with_points).T)


def _scaled(variogram: Variogram, x: Array, y: Array) -> tuple[Array, Array]:
    """As :meth:`Variogram.scaled`, but no product of matrices: bits do not depend on the number of places."""
    if variogram.anisotropy == 1:
        return x / variogram.range_m, y / variogram.range_m
    (xx, xy), (_, yy) = isotropic_plane(variogram.anisotropy, variogram.angle_deg) / variogram.range_m
    return xx * x + xy * y, xy * x + yy * y


def _first_difference(known: Array, samples: Array) -> int:
    """Number of the first row in which two tables differ."""
    both = min(len(known), len(samples))
    differs = (known[:both] != samples[:both]).any(axis=1)
    return int(differs.argmax()) if differs.any() else both
