# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Repeated kriging of the few cells of one raster while samples are added or grow, as in a simulated mission.

Covariances are kept from one set of samples to the next, and the matrix is factored anew. The map of a state does
not depend on what was kept, bit for bit. For 750 cells that takes half the time of :class:`PoissonKriging`; a map
of 70,000 cells and 300 samples takes 0.2 s anew, far less than a record, so nothing is kept for large rasters.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.raster import MIN_PIVOT
from soilmoist_ros.mapping.kriging.system import SamplePoints, target_variance
from soilmoist_ros.mapping.samples import Samples, merge_exactly
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram, scaled
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_TARGETS, MAX_SAMPLES = 1000, 400  # numbers of cells and of samples up to which covariances are kept
_MIN_ROOM = 64  # samples for which memory is allocated at the start


class RasterKriging:
    """Krigs the cells of one raster repeatedly. Not thread-safe."""

    def __init__(self, x_m: Array, y_m: Array, mask: NDArray[np.bool_], keep_nugget: bool) -> None:
        self.keep_nugget = keep_nugget
        self._mask = mask
        row, column = np.nonzero(mask)
        self._xy = np.column_stack([x_m[column], y_m[row]])
        self._numbers = {(x, y): number for number, (x, y) in enumerate(self._xy.tolist())} if keep_nugget else {}
        self._covariances = _Covariances(self._xy)

    def update(self, samples: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Rate [counts/s] and kriging variance [(counts/s)^2], not clipped, shape (2, ny, nx), NaN outside.

        :param rate: rate in the noise variances rate/t [counts/s]: the mean rate m*, or that at each place
        :returns: ``None`` with too many samples or cells, or for a nearly singular matrix
        """
        from scipy.linalg.blas import dtrsm
        from scipy.linalg.lapack import dpotrf

        places = merge_exactly(samples)[0]
        n = len(places)
        if n > MAX_SAMPLES or len(self._xy) > MAX_TARGETS:
            return None
        kept = self._covariances
        kept.update(np.column_stack([places.xy, places.spread]), variogram)
        noise, data = noise_rates(rate, places.xy) / places.exposure_s, np.array([places.rate_cps, np.ones(n)])
        matrix = kept.between[:n, :n].copy()
        matrix[np.diag_indices(n)] += variogram.nugget + noise
        total = matrix.diagonal().copy()
        factor, info = dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)  # the transpose of L
        if info or (factor.diagonal() ** 2 < MIN_PIVOT * total).any():
            return None
        right = np.column_stack([data.T, kept.with_targets[:n]])
        for row, (x, y) in zip(right, places.xy.tolist(), strict=True):
            if (target := self._numbers.get((x, y))) is not None:
                row[2 + target] += variogram.nugget
        solved = dtrsm(1.0, factor, right.T, side=1, lower=0, overwrite_b=1)
        values, ones = np.ascontiguousarray(solved[:2])
        of_targets = solved[2:]
        whole = float(ones @ ones)
        of_rate, of_ones = (of_targets @ np.column_stack([values, ones])).T
        of_ones = of_ones - 1
        surfaces = np.array(
            [
                of_rate - of_ones * (float(values @ ones) / whole),
                of_ones**2 / whole - np.einsum("ij,ij->i", of_targets, of_targets),
            ]
        )
        surfaces[1] += target_variance(variogram, self.keep_nugget)
        found = np.full((2, *self._mask.shape), np.nan)
        found[:, self._mask] = surfaces
        return found


class _Covariances:
    """Structured covariances of samples with each other and with fixed targets, kept while samples are added.

    :param xy: the targets, distinct, shape (g, 2) [m]
    """

    def __init__(self, xy: Array) -> None:
        self.between = np.zeros((_MIN_ROOM, _MIN_ROOM))  # of the samples; above the diagonal anything
        self.with_targets = np.zeros((_MIN_ROOM, len(xy)))
        self._xy, self._scaled = xy, (xy[:, 0], xy[:, 1])
        self._variogram: Variogram | None = None
        self._samples = np.empty((0, 6))  # places and spreads of those whose covariances are known

    def update(self, samples: Array, variogram: Variogram) -> None:
        """Compute the covariances of new and changed samples."""
        if variogram != self._variogram:
            self._variogram, self._samples = variogram, self._samples[:0]
            self._scaled = scaled(variogram, *np.ascontiguousarray(self._xy.T))
        room, both = len(self.between), min(len(self._samples), len(samples))
        if len(samples) > room:
            more = max(room, len(samples) - room)
            self.between = np.pad(self.between, (0, more))
            self.with_targets = np.pad(self.with_targets, ((0, more), (0, 0)))
        differs = np.ones(len(samples), bool)
        differs[:both] = (self._samples[:both] != samples[:both]).any(axis=1)
        self._samples, changed = samples, np.flatnonzero(differs)
        if not len(changed):
            return
        self.between[changed, : len(samples)] = self._of(samples[changed], samples)
        # Those of a later sample with an earlier one are used.
        later = np.setdiff1d(np.arange(changed[0] + 1, len(samples)), changed)
        if len(later):
            self.between[later[:, None], changed] = self._of(samples[later], samples[changed])
        rows = np.empty((len(changed), len(self._xy)))
        SamplePoints(variogram, samples[changed]).covariance(*self._scaled, rows)
        self.with_targets[changed] = rows

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
