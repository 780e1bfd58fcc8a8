# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Repeated kriging of fixed targets, row by row, while samples are added or grow.

Row i of the Cholesky factor L, of its inverse and of W = L^-1 C_.0 (see :mod:`poisson_kriging`) depends only on
the samples up to i. When a record changes the last sample or begins a new one, all earlier rows stay valid: one
row of 70,000 numbers is new, not 300. The new row is a weighted sum of the covariances C_.0 of all samples; rate
and variance are sums over the rows.

The result must not depend on the stored rows: it equals a fresh computation bit for bit. Each number therefore
always comes from equal operations on arrays of equal shapes. Rows in full blocks of fixed size are stored only as
sums. Rows after the last full block, the *tail*, are computed one by one. The number of samples determines which
blocks are full. Each row depends only on the samples up to the row or to the end of its block. This holds for one
BLAS thread; two threads may split a product differently each time.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.covariances import (
    Covariances,
    SamplePoints,
    add_rows,
    differences,
    first_changed,
)
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.variogram.local import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

BLOCK = 32
"""Rows of a full block."""
MIN_TAIL = 8
"""Minimum rows of the tail, for places where robots stand now and the exposure grows with every record."""
MAX_ROWS = 2000
"""Maximum number of samples."""
MAX_ELEMENTS = 32_000_000
"""Maximum stored covariances and sums (256 MB): 900 samples and 70,000 cells with Matern 3/2, 400 in full."""
MIN_PIVOT = 1e-6
"""Minimum share of a sample's variance unexplained by earlier samples; below, the inverse of L is too inexact."""
_MIN_ROOM = 64
"""Rows and columns allocated at the start."""
_PART = 256
"""Elements of a row of L computed at a time."""
_AT_ONCE = 8192
"""Targets processed at a time, so that intermediate results stay in the cache."""


class KrigingRows:
    """Rows of the inverse of L and of W for fixed targets, kept from one set of samples to the next.

    :param covariances: of samples with the targets
    """

    def __init__(self, covariances: Covariances) -> None:
        self._covariances = covariances
        self._variogram: Variogram | None = None
        self._samples = np.empty((0, 9))  # x, y, spread, noise, rate, 1 of those whose rows are known
        self._amplitude: Array | None = None  # of the targets
        self._kept = self._samples[:, :6]  # those whose covariances are
        self._unit = np.zeros((_MIN_ROOM, _MIN_ROOM))  # L^-1, its rows times the diagonal of L
        self._between = np.empty((_MIN_ROOM, _MIN_ROOM))  # covariances of the samples, below the diagonal
        self._diagonal = np.empty(MAX_ROWS)  # of L
        self._data = np.zeros((2, MAX_ROWS))  # L^-1 rate, L^-1 1
        self._blocks: list[Array] = []  # sums over the rows up to the end of each block, see _add_row
        self._tail = np.empty((BLOCK + MIN_TAIL, covariances.size))  # of W times the diagonal, the latest rows
        self._numbers = np.full(len(self._tail), -1)  # of these rows, -1 for none
        # Sums over rows, how many of these are in blocks, and how many they are
        self._sums = (np.empty((3, covariances.size)), 0, -1), (np.empty((3, covariances.size)), 0, -1)

    def update(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Krige the targets.

        :param places: samples at distinct places, n >= 1
        :param variogram: variogram of the latent rate
        :param rate: rate in the noise variances rate/t [counts/s]: the mean rate m*, or that at each place
        :returns: rate [counts/s], and the change of a target's variance by samples and unknown mean (mostly < 0)
            [(counts/s)^2], shape (2, size), new memory; ``None`` if the limits of memory are exceeded or the
            matrix is nearly singular (:data:`MIN_PIVOT`)
        """
        n = len(places)
        noise, values, ones = noise_rates(rate, places.xy) / places.exposure_s, places.rate_cps, np.ones(n)
        amplitude = variogram.amplitude_at(places.xy)
        if amplitude is not None:
            noise, values, ones = noise / amplitude**2, values / amplitude, ones / amplitude
        samples = np.column_stack([places.xy, places.spread, variogram.nugget + noise, values, ones])
        if variogram != self._variogram:
            self._variogram = variogram
            self._amplitude = None if variogram.amplitude is None else variogram.amplitude(self._covariances.xy)
            self._covariances.begin(variogram)
            self._kept = self._kept[:0]
            self._forget(0, samples[:0])
        first = first_changed(differences(self._samples, samples), len(samples))
        self._forget(first, samples)
        room = MAX_ELEMENTS - n // BLOCK * 3 * self._covariances.size
        changed = differences(self._kept, samples[:, :6])
        if n > MAX_ROWS or not self._covariances.keep(samples[:, :6], changed, room):
            self._kept = self._kept[:0]
            self._forget(0, samples)
            return None
        self._kept = samples[:, :6]
        self._keep_between(variogram, samples, changed)
        if not self._factorise(first, samples):
            return None
        self._samples = samples
        full = max(0, n - MIN_TAIL) // BLOCK * BLOCK
        for start in range(len(self._blocks) * BLOCK, full, BLOCK):
            self._add_block(start)
        self._make_tail(full, n)
        return self._surfaces(full, n)

    def _forget(self, first: int, samples: Array) -> None:
        """Forget the rows from ``first`` on, where samples differ from the known ones."""
        known = self._samples
        # If a sample has only grown, its row stays valid and only the diagonal of L changes.
        same_place = first < min(len(known), len(samples)) and (known[first, :6] == samples[first, :6]).all()
        self._numbers[self._numbers >= first + same_place] = -1
        self._samples = known[:first]
        del self._blocks[first // BLOCK :]
        one, other = ((sums, full, count if count <= first else -1) for sums, full, count in self._sums)
        self._sums = one, other

    # -- L ---------------------------------------------------------------------------------------------

    def _keep_between(self, variogram: Variogram, samples: Array, changed: NDArray[np.intp]) -> None:
        """Compute the covariances of changed samples with all."""
        room = len(self._unit)
        if len(samples) > room:
            more = max(room, len(samples) - room)
            self._unit, self._between = np.pad(self._unit, (0, more)), np.pad(self._between, (0, more))
        if len(changed):
            keep_between(self._between, variogram, samples, changed)

    def _factorise(self, first: int, samples: Array) -> bool:
        """Rows of the inverse of L from ``first`` on.

        :returns: whether the matrix is well-conditioned enough
        """
        unit, diagonal = self._unit, self._diagonal
        data = np.ascontiguousarray(samples[:, 7:9])
        for i in range(first, len(samples)):
            right = self._between[i]
            row = np.empty(i)  # of L
            weights = np.zeros(i)
            for start, stop in pairwise([*range(0, i, _PART), i]):
                row[start:stop] = unit[start:stop, :stop] @ right[:stop]
                row[start:stop] /= diagonal[start:stop]
                weights[:stop] -= (row[start:stop] / diagonal[start:stop]) @ unit[start:stop, :stop]
            total = right[i] + samples[i, 6]
            pivot = total - row @ row
            if not pivot >= MIN_PIVOT * total:
                return False
            unit[i, :i], unit[i, i] = weights, 1.0
            diagonal[i] = math.sqrt(pivot)
            self._data[:, i] = unit[i, : i + 1] @ data[: i + 1] / diagonal[i]
        return True

    # -- W ---------------------------------------------------------------------------------------------

    def _add_block(self, start: int) -> None:
        """Add the sums over all rows up to the end of the next block."""
        stop = start + BLOCK
        sums = self._blocks[-1].copy() if start else self._no_rows()
        data = np.ascontiguousarray(self._data[:, start:stop])
        weights = self._unit[start:stop, :stop] / self._diagonal[start:stop, None]
        add_rows(self._covariances, weights, data, sums[::2], sums[1])
        self._blocks.append(sums)

    def _make_tail(self, full: int, n: int) -> None:
        """Compute the unknown rows from ``full`` on."""
        slots = np.arange(full, n) % len(self._tail)
        for number in (np.flatnonzero(self._numbers[slots] != np.arange(full, n)) + full).tolist():
            slot = number % len(self._tail)
            for some, row in self._covariances.combine(self._unit[number : number + 1, : number + 1]):
                self._tail[slot, some] = row[0]
            self._numbers[slot] = number

    def _surfaces(self, full: int, n: int) -> Array:
        """Rate and variance from the sums over all rows."""
        some, others = sorted(
            self._sums, key=lambda known: known[1:] != (full, n - 1)
        )  # those to go on from first
        sums, of_blocks, count = some
        if of_blocks != full or not full <= count < n:
            sums[:] = self._blocks[full // BLOCK - 1] if full else self._no_rows()
            count = full
        for number in range(count, n - 1):
            self._add_row(number, sums, sums)
        total = others[0]
        self._add_row(n - 1, sums, total)
        self._sums = (sums, full, n - 1), (total, full, n)
        surfaces = np.empty((2, self._covariances.size))
        for part in self._parts():
            self._finish(total[:, part], surfaces[:, part])
        if self._amplitude is not None:
            surfaces[0] *= self._amplitude
            surfaces[1] *= self._amplitude**2
        return surfaces

    def at_samples(self, numbers: NDArray[np.intp]) -> Array:
        """Results as :meth:`update` at some samples of the last update, including their nugget; no amplitude."""
        known, n, variogram = self._samples, len(self._samples), self._variogram
        assert variogram is not None
        covariance = np.empty((n, len(numbers)))
        x, y = known[numbers, :2].T
        SamplePoints(variogram, known).covariance(*scaled(variogram, x, y), covariance)
        covariance[numbers, np.arange(len(numbers))] += variogram.nugget
        solved = self._unit[:n, :n] @ covariance
        solved /= self._diagonal[:n, None]
        rate, ones = self._data[:, :n]
        total = np.array([rate @ solved, np.einsum("ij,ij->j", solved, solved), ones @ solved - 1])
        surfaces = np.empty((2, len(numbers)))
        self._finish(total, surfaces)
        return surfaces

    def _no_rows(self) -> Array:
        """Sums over no rows."""
        sums = np.zeros((3, self._covariances.size))
        sums[2] = -1.0 if self._amplitude is None else -1.0 / self._amplitude
        return sums

    def _add_row(self, number: int, sums: Array, out: Array) -> None:
        """Add a row of W to the sums of (L^-1 rate) W, W^2 and (L^-1 1) W minus 1, shape (3, g)."""
        rate, ones = self._data[:, number].tolist()
        factor = 1 / self._diagonal[number]
        row = self._tail[number % len(self._tail)]
        for some in self._parts():
            part = row[some] * factor
            terms = np.empty((3, len(part)))
            for factor_of, term in zip((rate, part, ones), terms, strict=True):
                np.multiply(part, factor_of, out=term)
            np.add(sums[:, some], terms, out=out[:, some])

    def _finish(self, sums: Array, surfaces: Array) -> None:
        """Rate and variance from the sums over all rows, shapes (2, g) and (3, g)."""
        rate, ones = self._data[:, : len(self._samples)]
        whole = float(ones @ ones)
        of_rate, squares, of_ones = sums
        scaled_ones = of_ones * (float(rate @ ones) / whole)
        np.subtract(of_rate, scaled_ones, out=surfaces[0])
        np.multiply(of_ones, of_ones, out=scaled_ones)
        scaled_ones *= 1 / whole
        np.subtract(scaled_ones, squares, out=surfaces[1])

    def _parts(self) -> list[slice]:
        return [slice(start, start + _AT_ONCE) for start in range(0, self._covariances.size, _AT_ONCE)]


def keep_between(table: Array, variogram: Variogram, samples: Array, changed: NDArray[np.intp]) -> None:
    """Compute the covariances of changed samples with all; those of a later with an earlier one are used.

    :param table: takes the covariances below the diagonal
    :param samples: x, y and the spread in the first columns, shape (n, 6 or more)
    :param changed: numbers of the changed samples, at least one
    """
    table[changed, : len(samples)] = _between(variogram, samples[changed], samples)
    later = np.setdiff1d(np.arange(changed[0] + 1, len(samples)), changed)
    if len(later):
        table[later[:, None], changed] = _between(variogram, samples[later], samples[changed])


def _between(variogram: Variogram, later: Array, samples: Array) -> Array:
    """Structured covariance of some samples with others, shape (m, n)."""
    points, supports = SamplePoints(variogram, samples), Supports(later[:, :2], later[:, 2:6])

    def with_points(xy: Array) -> Array:
        covariance = np.empty((len(samples), len(xy)))
        points.covariance(*scaled(variogram, *xy.T), covariance)
        return covariance

    return np.ascontiguousarray(supports.average(with_points).T)
