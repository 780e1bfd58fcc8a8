# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Repeated kriging of few fixed targets while samples are added or grow.

With some hundred targets, the triangular solve of all of them takes less time than the administration of known
rows (:mod:`rows`). So only covariances are kept, and the matrix is factored anew. The result does not depend on
what was kept: it equals a fresh computation bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.covariances import SamplePoints, differences
from soilmoist_ros.mapping.kriging.rows import MIN_PIVOT, keep_between
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.variogram.local import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram, scaled

Array = NDArray[np.float64]

MAX_TARGETS, MAX_SAMPLES = 1000, 400
"""Numbers up to which this takes half the time of :class:`KrigingRows` where old samples change, and at most some
milliseconds where only the last one does."""
_MIN_ROOM = 64
"""Samples for which memory is allocated at the start."""


@dataclass(frozen=True, eq=False)
class KnownCovariances:
    """Structured covariances, in units of the amplitude at the places [(counts/s)^2].

    :param of_samples: lower triangle of those between the samples, shape (n, n)
    :param with_targets: those of the samples with the targets, shape (n, g)
    """

    of_samples: Array
    with_targets: Array


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
        self._xy = xy
        self._numbers = {(x, y): number for number, (x, y) in enumerate(xy.tolist())} if nugget else {}
        self._variogram: Variogram | None = None
        self._scaled = xy[:, 0], xy[:, 1]
        self._amplitude: Array | None = None  # of the targets
        self._kept = np.empty((0, 6))  # places and spreads of the samples whose covariances are
        self._between = np.zeros((_MIN_ROOM, _MIN_ROOM))  # used below the diagonal only, but numbers above it too
        self._with_targets = np.empty((_MIN_ROOM, len(xy)))
        self.known: KnownCovariances | None = None

    def update(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Krige the targets; parameters and result as of :meth:`KrigingRows.update`."""
        from scipy.linalg.blas import dtrsm
        from scipy.linalg.lapack import dpotrf

        n = len(places)
        self._keep(variogram, np.column_stack([places.xy, places.spread]))
        noise, data = noise_rates(rate, places.xy) / places.exposure_s, np.array([places.rate_cps, np.ones(n)])
        amplitude, of_mean = variogram.amplitude_at(places.xy), np.ones(1)
        if amplitude is not None and self._amplitude is not None:
            noise, data, of_mean = noise / amplitude**2, data / amplitude, 1 / self._amplitude
        self.known = KnownCovariances(self._between[:n, :n].copy(), self._with_targets[:n].copy())
        matrix = self._between[:n, :n].copy()
        matrix[np.diag_indices(n)] += variogram.nugget + noise
        total = matrix.diagonal().copy()
        factor, info = dpotrf(matrix.T, lower=0, clean=0, overwrite_a=1)  # the transpose of L
        if info or (factor.diagonal() ** 2 < MIN_PIVOT * total).any():
            return None
        rows = np.empty((n, 2 + len(self._xy)))  # all together
        rows[:, :2], rows[:, 2:] = data.T, self._with_targets[:n]
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
        if self._amplitude is not None:
            surfaces *= np.array([self._amplitude, self._amplitude**2])
        return surfaces

    def _keep(self, variogram: Variogram, samples: Array) -> None:
        """Compute the covariances of new and changed samples."""
        if variogram != self._variogram:
            self._variogram, self._kept = variogram, self._kept[:0]
            self._scaled = scaled(variogram, *np.ascontiguousarray(self._xy.T))
            self._amplitude = None if variogram.amplitude is None else variogram.amplitude(self._xy)
        changed, room = differences(self._kept, samples), len(self._between)
        if len(samples) > room:
            more = max(room, len(samples) - room)
            self._between = np.pad(self._between, (0, more))
            self._with_targets = np.pad(self._with_targets, ((0, more), (0, 0)))
        self._kept = samples
        if not len(changed):
            return
        keep_between(self._between, variogram, samples, changed)
        rows = np.empty((len(changed), len(self._xy)))
        SamplePoints(variogram, samples[changed]).covariance(*self._scaled, rows)
        self._with_targets[changed] = rows
