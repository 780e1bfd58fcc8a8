# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Repeated kriging of the cells of one raster, on line, while samples are added or grow.

Row i of the Cholesky factor L, of its inverse and of W = L^-1 C_.0 (see :mod:`.poisson_kriging`) depends only on
the samples up to i. When a record changes the last sample or begins a new one, all earlier rows stay valid: one
row of some thousand numbers is new, not 300. The new row is a weighted sum of the covariances C_.0 of all samples;
rate and variance are sums over the rows.

The result must not depend on the stored rows: it equals a fresh computation bit for bit. Each number therefore
always comes from equal operations on arrays of equal shapes. Rows in full blocks of fixed size are stored only as
sums. Rows after the last full block, the *tail*, are computed one by one. The number of samples determines which
blocks are full. Each row depends only on the samples up to the row or to the end of its block. This holds for one
BLAS thread; two threads may split a product differently each time.

With some hundred targets, the triangular solve of all of them takes less time than the administration of known
rows. So only covariances are kept there, and the matrix is factored anew (:class:`FewTargets`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.raster import MIN_CELLS, MIN_PIVOT
from soilmoist_ros.mapping.kriging.system import SamplePoints, target_variance
from soilmoist_ros.mapping.samples import Samples, merge_exactly
from soilmoist_ros.mapping.variogram.local import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

BLOCK = 32
"""Rows of a full block."""
MIN_TAIL = 8
"""Minimum rows of the tail, for places where robots stand now and the exposure grows with every record."""
MAX_ROWS = 2000
"""Maximum number of samples."""
MAX_ELEMENTS = 32_000_000
"""Maximum number of stored covariances with targets (256 MB): 450 samples and 70,000 cells."""
MAX_TARGETS, MAX_SAMPLES = 1000, 400
"""Numbers up to which :class:`FewTargets` takes half the time of :class:`KrigingRows` where old samples change,
and at most some milliseconds where only the last one does."""
_MIN_ROOM = 64
"""Samples for which memory is allocated at the start."""
_CHUNK = 128
"""Samples whose covariances with the targets are added up together."""
_PART = 256
"""Elements of a row of L computed at a time."""


@dataclass(frozen=True, eq=False)
class KnownCovariances:
    """Structured covariances, in units of the amplitude at the places [(counts/s)^2]."""

    of_samples: Array  # lower triangle of those between the samples, shape (n, n)
    with_targets: Array  # those of the samples with the targets, shape (n, g)


class RasterKriging:
    """Krigs the cells of one raster repeatedly. Not thread-safe.

    :param x_m: centres of the columns, shape (nx,) [m]
    :param y_m: centres of the rows, shape (ny,) [m]
    :param mask: cells wanted, shape (ny, nx)
    :param keep_nugget: as :class:`PoissonKriging`

    Attributes
    ----------
    known : KnownCovariances | None
        those of the samples of the last :meth:`update`, and with the wanted cells; ``None`` if they were not
        needed as a whole
    """

    def __init__(self, x_m: Array, y_m: Array, mask: NDArray[np.bool_], keep_nugget: bool) -> None:
        self.keep_nugget = keep_nugget
        self.known: KnownCovariances | None = None
        self._mask = mask
        row, column = np.nonzero(mask)
        self._xy = np.column_stack([x_m[column], y_m[row]])
        self._cells: KrigingRows | FewTargets | None = None

    def update(self, samples: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Rate and kriging variance from what is kept of the last update.

        Fast if most samples are as in the last update. The result depends only on the samples and the variogram,
        bit for bit. It differs from kriging cell by cell by some 1e-12 of the standard deviation and of the
        variance of the rate.

        :param samples: at least one
        :param variogram: variogram of the latent rate
        :param rate: rate in the noise variances rate/t [counts/s]: the mean rate m*, or that at each place
        :returns: rate [counts/s] and variance [(counts/s)^2], not yet clipped at 0, shape (2, ny, nx), NaN in
            unwanted cells; ``None``, independent of earlier updates, with too many samples or cells, or for a
            nearly singular matrix
        """
        places = merge_exactly(samples)[0]
        self.known = None
        if len(places) > MAX_ROWS or len(places) * len(self._xy) > MAX_ELEMENTS:
            return None
        if len(self._xy) >= MIN_CELLS and variogram.correlation_model.is_product:
            return None  # tiles take a tenth of the memory, and little time
        few = len(self._xy) <= MAX_TARGETS and len(places) <= MAX_SAMPLES
        if self._cells is None or few != isinstance(self._cells, FewTargets):
            self._cells = (FewTargets if few else KrigingRows)(self._xy, self.keep_nugget)
        surfaces = self._cells.update(places, variogram, rate)
        if isinstance(self._cells, FewTargets):
            self.known = self._cells.known
        if surfaces is None:
            return None
        surfaces[1] += target_variance(variogram, self.keep_nugget, self._xy)
        found = np.full((2, *self._mask.shape), np.nan)
        found[:, self._mask] = surfaces
        return found


class _Covariances:
    """Structured covariances of samples with each other and with fixed targets, kept while samples are added.

    :param xy: the targets, distinct, shape (g, 2) [m]

    Attributes
    ----------
    between : NDArray
        covariances of the samples, below the diagonal; arbitrary numbers above it
    with_targets : list[NDArray]
        covariances with the targets, :data:`_CHUNK` samples together
    amplitude : NDArray | None
        of the targets
    """

    def __init__(self, xy: Array) -> None:
        self.between = np.zeros((_MIN_ROOM, _MIN_ROOM))
        self.with_targets: list[Array] = []
        self.amplitude: Array | None = None
        self._xy, self._scaled = xy, (xy[:, 0], xy[:, 1])
        self._variogram: Variogram | None = None
        self._samples = np.empty((0, 6))  # places and spreads of those whose covariances are known

    def update(self, samples: Array, variogram: Variogram) -> tuple[bool, Indices]:
        """Compute the covariances of new and changed samples."""
        is_other = variogram != self._variogram
        if is_other:
            self._variogram, self._samples = variogram, self._samples[:0]
            self._scaled = scaled(variogram, *np.ascontiguousarray(self._xy.T))
            self.amplitude = variogram.amplitude_at(self._xy)
        changed, room = _differences(self._samples, samples), len(self.between)
        if len(samples) > room:
            self.between = np.pad(self.between, (0, max(room, len(samples) - room)))
        self._samples = samples
        if not len(changed):
            return is_other, changed
        self._keep_between(changed)
        for _ in range(len(self.with_targets), -(-len(samples) // _CHUNK)):
            self.with_targets.append(np.empty((_CHUNK, len(self._xy))))
        for run in np.split(changed, np.flatnonzero((np.diff(changed) > 1) | (changed[1:] % _CHUNK == 0)) + 1):
            chunk, first = divmod(int(run[0]), _CHUNK)
            rows = self.with_targets[chunk][first : first + len(run)]
            SamplePoints(variogram, samples[run]).covariance(*self._scaled, rows)
        return is_other, changed

    def _keep_between(self, changed: Indices) -> None:
        """Compute the covariances of changed samples with all; those of a later with an earlier one are used."""
        samples = self._samples
        self.between[changed, : len(samples)] = self._of(samples[changed], samples)
        later = np.setdiff1d(np.arange(changed[0] + 1, len(samples)), changed)
        if len(later):
            self.between[later[:, None], changed] = self._of(samples[later], samples[changed])

    def _of(self, later: Array, samples: Array) -> Array:
        """Covariance of some samples with others, shape (m, n)."""
        variogram = self._variogram
        assert variogram is not None
        points, supports = SamplePoints(variogram, samples), Supports(later[:, :2], later[:, 2:6])

        def with_points(xy: Array) -> Array:
            covariance = np.empty((len(samples), len(xy)))
            points.covariance(*scaled(variogram, *xy.T), covariance)
            return covariance

        return np.ascontiguousarray(supports.average(with_points).T)


def _differences(known: Array, samples: Array) -> Indices:
    """Numbers of the rows of a table that are not as in another one, or not in it."""
    both = min(len(known), len(samples))
    differs = np.ones(len(samples), bool)
    differs[:both] = (known[:both] != samples[:both]).any(axis=1)
    return np.flatnonzero(differs)


def _numbers(xy: Array, nugget: bool) -> dict[tuple[float, float], int]:
    """Numbers of the targets by their places; none unless they share the nugget of a sample exactly there."""
    return {(x, y): number for number, (x, y) in enumerate(xy.tolist())} if nugget else {}


# -- Few targets: all anew ---------------------------------------------------------------------------


class FewTargets:
    """Kriges few targets repeatedly; covariances are kept from one set of samples to the next.

    :param xy: the targets, distinct, shape (g, 2) [m]
    :param nugget: whether a target exactly where a sample is shares its nugget

    Attributes
    ----------
    known : KnownCovariances | None
        covariances of the samples of the last update
    """

    def __init__(self, xy: Array, nugget: bool) -> None:
        self._numbers = _numbers(xy, nugget)
        self._covariances = _Covariances(xy)
        self.known: KnownCovariances | None = None

    def update(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Krige the targets; parameters and result as of :meth:`KrigingRows.update`."""
        from scipy.linalg.blas import dtrsm
        from scipy.linalg.lapack import dpotrf

        n, kept = len(places), self._covariances
        kept.update(np.column_stack([places.xy, places.spread]), variogram)
        noise, data = noise_rates(rate, places.xy) / places.exposure_s, np.array([places.rate_cps, np.ones(n)])
        amplitude, of_mean = variogram.amplitude_at(places.xy), np.ones(1)
        if amplitude is not None and kept.amplitude is not None:
            noise, data, of_mean = noise / amplitude**2, data / amplitude, 1 / kept.amplitude
        with_targets = np.concatenate(kept.with_targets)[:n]
        self.known = KnownCovariances(kept.between[:n, :n].copy(), with_targets)
        matrix = kept.between[:n, :n].copy()
        matrix[np.diag_indices(n)] += variogram.nugget + noise
        total = matrix.diagonal().copy()
        factor, info = dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)  # the transpose of L
        if info or (factor.diagonal() ** 2 < MIN_PIVOT * total).any():
            return None
        rows = np.column_stack([data.T, with_targets])
        for row, (x, y) in zip(rows, places.xy.tolist(), strict=True):
            if (target := self._numbers.get((x, y))) is not None:
                row[2 + target] += variogram.nugget
        solved = dtrsm(1.0, factor, rows.T, side=1, lower=0, overwrite_b=1)
        values, ones = np.ascontiguousarray(solved[:2])
        of_targets = solved[2:]
        whole = float(ones @ ones)
        of_rate, of_ones = (of_targets @ np.column_stack([values, ones])).T
        of_ones = of_ones - of_mean
        surfaces = np.array(
            [
                of_rate - of_ones * (float(values @ ones) / whole),
                of_ones**2 / whole - np.einsum("ij,ij->i", of_targets, of_targets),
            ]
        )
        if kept.amplitude is not None:
            surfaces *= np.array([kept.amplitude, kept.amplitude**2])
        return surfaces


# -- Rows --------------------------------------------------------------------------------------------


class KrigingRows:
    """Rows of the inverse of L and of W for fixed targets, kept from one set of samples to the next.

    :param xy: the targets, distinct, shape (g, 2) [m]
    :param nugget: whether a target exactly where a sample is shares its nugget
    """

    def __init__(self, xy: Array, nugget: bool) -> None:
        self._size = len(xy)
        self._numbers = _numbers(xy, nugget)
        self._covariances = _Covariances(xy)
        self._samples = np.empty((0, 9))  # x, y, spread, noise, rate, 1 of those whose rows are known
        self._unit = np.zeros((_MIN_ROOM, _MIN_ROOM))  # L^-1, its rows times the diagonal of L
        self._diagonal = np.empty(MAX_ROWS)  # of L
        self._data = np.zeros((2, MAX_ROWS))  # L^-1 rate, L^-1 1
        self._blocks: list[Array] = []  # sums over the rows up to the end of each block, see _add_row
        self._tail = np.empty((BLOCK + MIN_TAIL, self._size))  # of W times the diagonal, the latest rows
        self._row_of = np.full(len(self._tail), -1)  # numbers of these rows, -1 for none
        # Sums over rows, how many of these are in blocks, and how many they are
        self._sums = (np.empty((3, self._size)), 0, -1), (np.empty((3, self._size)), 0, -1)

    def update(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Krige the targets.

        :param places: samples at distinct places, 1 <= n <= :data:`MAX_ROWS`
        :param variogram: variogram of the latent rate
        :param rate: rate in the noise variances rate/t [counts/s]: the mean rate m*, or that at each place
        :returns: rate [counts/s], and the change of a target's variance by samples and unknown mean (mostly < 0)
            [(counts/s)^2], shape (2, g), new memory; ``None`` if the matrix is nearly singular (:data:`MIN_PIVOT`)
        """
        n = len(places)
        noise, values, ones = noise_rates(rate, places.xy) / places.exposure_s, places.rate_cps, np.ones(n)
        amplitude = variogram.amplitude_at(places.xy)
        if amplitude is not None:
            noise, values, ones = noise / amplitude**2, values / amplitude, ones / amplitude
        samples = np.column_stack([places.xy, places.spread, variogram.nugget + noise, values, ones])
        is_other, changed = self._covariances.update(samples[:, :6], variogram)
        for number in changed.tolist():
            if (target := self._numbers.get(tuple(samples[number, :2].tolist()))) is not None:
                self._covariances.with_targets[number // _CHUNK][number % _CHUNK, target] += variogram.nugget
        if is_other:
            self._forget(0, samples[:0])
        differs = _differences(self._samples, samples)
        first = int(differs[0]) if len(differs) else n
        self._forget(first, samples)
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
        self._row_of[self._row_of >= first + same_place] = -1
        self._samples = known[:first]
        del self._blocks[first // BLOCK :]
        one, other = ((sums, full, count if count <= first else -1) for sums, full, count in self._sums)
        self._sums = one, other

    def _factorise(self, first: int, samples: Array) -> bool:
        """Rows of the inverse of L from ``first`` on."""
        if (more := len(self._covariances.between) - len(self._unit)) > 0:
            self._unit = np.pad(self._unit, (0, more))
        unit, diagonal = self._unit, self._diagonal
        data = np.ascontiguousarray(samples[:, 7:9])
        for i in range(first, len(samples)):
            right = self._covariances.between[i]
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

    def _combine(self, weights: Array) -> Array:
        """Weighted sums of the covariances of the first n samples; weights of shape (m, n), n >= 1."""
        first, *others = self._covariances.with_targets[: -(-weights.shape[1] // _CHUNK)]
        total = weights[:, :_CHUNK] @ first[: weights.shape[1]]
        for number, chunk in enumerate(others, start=1):
            part = weights[:, _CHUNK * number : _CHUNK * (number + 1)]
            total += part @ chunk[: part.shape[1]]
        return np.asarray(total)

    def _add_block(self, start: int) -> None:
        """Add the sums over all rows up to the end of the next block."""
        stop = start + BLOCK
        sums = self._blocks[-1].copy() if start else self._no_rows()
        rows = self._combine(self._unit[start:stop, :stop] / self._diagonal[start:stop, None])
        sums[::2] += np.ascontiguousarray(self._data[:, start:stop]) @ rows
        sums[1] += np.einsum("ij,ij->j", rows, rows)
        self._blocks.append(sums)

    def _make_tail(self, full: int, n: int) -> None:
        """Compute the unknown rows from ``full`` on."""
        slots = np.arange(full, n) % len(self._tail)
        for number in (np.flatnonzero(self._row_of[slots] != np.arange(full, n)) + full).tolist():
            slot = number % len(self._tail)
            self._tail[slot] = self._combine(self._unit[number : number + 1, : number + 1])[0]
            self._row_of[slot] = number

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
        rate, ones = self._data[:, :n]
        whole = float(ones @ ones)
        of_rate, squares, of_ones = total
        surfaces = np.array(
            [of_rate - of_ones * (float(rate @ ones) / whole), of_ones * of_ones * (1 / whole) - squares]
        )
        amplitude = self._covariances.amplitude
        if amplitude is not None:
            surfaces *= np.array([amplitude, amplitude**2])
        return surfaces

    def _no_rows(self) -> Array:
        """Sums over no rows."""
        amplitude = self._covariances.amplitude
        sums = np.zeros((3, self._size))
        sums[2] = -1.0 if amplitude is None else -1.0 / amplitude
        return sums

    def _add_row(self, number: int, sums: Array, out: Array) -> None:
        """Add a row of W to the sums of (L^-1 rate) W, W^2 and (L^-1 1) W minus 1, shape (3, g)."""
        rate, ones = self._data[:, number].tolist()
        row = self._tail[number % len(self._tail)] * (1 / self._diagonal[number])
        np.add(sums, [row * rate, row * row, row * ones], out=out)
