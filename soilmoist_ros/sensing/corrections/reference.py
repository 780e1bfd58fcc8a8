# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A stationary reference sensor: what it says of the change of the rate while a survey lasts.

The reference counts at one place of the field, or next to it, while the survey goes on. Its rate rises and falls
with drying and rain, as that of the field does. The logarithm of its rate is a trend plus a random walk, whose
variances are their posterior means by the restricted likelihood; the counts have Poisson noise (local-level model;
Durbin & Koopman 2012, Time Series Analysis by State Space Methods, chapter 2). The counts of the survey are then
corrected to its end through the effective exposure, as for the incoming neutrons.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing.gnss import utc_text
from soilmoist_ros.sensing.records import CountRecord

Array = NDArray[np.float64]

BIN_S = 600.0  # duration of the bins whose counts are smoothed [s]
AROUND_S = 6 * 3600.0  # time before and after the survey from which counts of the reference are used [s]
MAX_GAP_S = 1800.0  # longest time within the survey without a count of the reference [s]
_SIZES = np.concatenate([[0.0], np.geomspace(0.003, 0.5, 11)])
"""Trends [1/h] and random walks [1/sqrt(h)] that are compared."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The smoothed rate of a reference sensor, relative to that at the end of a survey.

    :param middle_s: middle of the bins, shape (n,) [s]
    :param weights: of the bins in the logarithm of the rate, shape (n,)
    :param covariance: matrix that is solved for each variance, shape (n, n)
    :param trend: standard deviation of the trend [1/h]
    :param walk: standard deviation of the random walk [1/sqrt(h)]
    """

    start_s: float
    end_s: float
    middle_s: Array
    weights: Array
    covariance: Array
    trend: float
    walk: float

    def factor(self, stamp_s: Array) -> Array:
        """Rate at the end of the survey divided by the rate at some times, shape (m,) [-]."""
        log_rate = self._shape(np.append(stamp_s, self.end_s), self.middle_s) @ self.weights
        return np.asarray(np.exp(log_rate[-1] - log_rate[:-1]))

    def factor_covariance(self, stamp_s: Array) -> Array:
        """Covariance of the logarithm of :meth:`factor`, shape (m, m) [-]."""
        times_s = np.append(stamp_s, self.end_s)
        kernel = self._shape(times_s, self.middle_s)
        ones = np.linalg.solve(self.covariance, np.ones(len(self.middle_s)))
        square = self._shape(times_s, times_s) - kernel @ np.linalg.solve(self.covariance, kernel.T)
        mean = 1 - kernel @ ones
        square += np.multiply.outer(mean, mean) / ones.sum()
        # Of the differences between the end and the times.
        return np.asarray(square[:-1, :-1] - square[:-1, -1:] - square[-1:, :-1] + square[-1, -1])

    @property
    def change(self) -> tuple[float, float]:
        """Relative change of the rate from the begin to the end of the survey, and its standard deviation."""
        begin = np.array([self.start_s])
        factor, variance = float(self.factor(begin)[0]), float(self.factor_covariance(begin)[0, 0])
        return factor - 1, factor * math.sqrt(max(variance, 0.0))

    def corrected(self, records: Iterable[CountRecord]) -> list[CountRecord]:
        """Records corrected to the rate at the end of the survey."""
        records = list(records)
        middle_s = np.array([record.stamp_s - record.exposure_s / 2 for record in records])
        factors = self.factor(np.clip(middle_s, self.start_s, self.end_s)).tolist()
        return [
            replace(record, effective_exposure_s=record.effective_exposure_s / factor)
            for record, factor in zip(records, factors, strict=True)
        ]

    def _shape(self, stamp_s: Array, others_s: Array) -> Array:
        return _shape(stamp_s, others_s, float(self.middle_s[0]), self.trend, self.walk)


def fit_reference(
    reference: Sequence[CountRecord], start_s: float, end_s: float, path: Path | None = None
) -> Reference:
    """Smooth the rate of a reference sensor from its corrected records; their places do not matter.

    :raises InputError: if the reference did not count during the survey, or has a long gap
    """
    near = [one for one in reference if start_s - AROUND_S <= one.stamp_s <= end_s + AROUND_S]
    near = sorted((one for one in near if not one.quarantine), key=lambda record: record.stamp_s)
    _check_gaps(near, start_s, end_s, path)
    stamp_s = np.array([one.stamp_s - one.exposure_s / 2 for one in near])
    bins = np.unique(np.floor((stamp_s - stamp_s[0]) / BIN_S), return_inverse=True)[1]
    counts = np.bincount(bins, [one.raw_counts for one in near])
    exposure_s = np.bincount(bins, [one.effective_exposure_s for one in near])
    middle_s = np.bincount(bins, stamp_s) / np.bincount(bins)
    if not counts.any():
        raise InputError("the reference sensor counted nothing during the survey", "check its detector", path)
    value = np.log((counts + 0.5) / exposure_s)
    noise = np.diag(1 / (counts + 0.5))

    def fitted(trend: float, walk: float) -> tuple[float, Array, Array]:
        covariance = _shape(middle_s, middle_s, float(middle_s[0]), trend, walk) + noise
        solved = np.linalg.solve(covariance, np.column_stack([value, np.ones(len(value))]))
        of_ones = solved[:, 1]
        weights = solved[:, 0] - of_ones * (of_ones @ value) / of_ones.sum()
        determinant = np.linalg.slogdet(covariance)[1] + np.log(of_ones.sum())
        return float(-0.5 * (determinant + value @ weights)), weights, covariance

    sizes = [(trend, walk) for trend in _SIZES.tolist() for walk in _SIZES.tolist()]
    # Posterior means: the likeliest size is often none, which would be known without an error.
    rise = np.array([fitted(*both)[0] for both in sizes])
    likely = np.exp(rise - rise.max())
    trend, walk = np.sqrt(likely @ np.square(sizes) / likely.sum()).tolist()
    _, weights, covariance = fitted(trend, walk)
    return Reference(start_s, end_s, middle_s, weights, covariance, trend, walk)


def _shape(stamp_s: Array, others_s: Array, begin_s: float, trend: float, walk: float) -> Array:
    """Covariance of the logarithm of the rate at two sets of times, shape (m, n)."""
    time_h, others_h = (stamp_s - begin_s) / 3600, (others_s - begin_s) / 3600
    walked = np.minimum.outer(np.maximum(time_h, 0.0), np.maximum(others_h, 0.0))
    return np.asarray(trend**2 * np.multiply.outer(time_h, others_h) + walk**2 * walked)


def _check_gaps(near: Sequence[CountRecord], start_s: float, end_s: float, path: Path | None) -> None:
    """Refuse a reference that does not last for the whole survey."""
    remedy = f"give a log that lasts from {utc_text(start_s)} to {utc_text(end_s)} UTC, or leave the reference out"
    spans = [(one.stamp_s - one.exposure_s, one.stamp_s) for one in near]
    spans = [(begin_s, stamp_s) for begin_s, stamp_s in spans if stamp_s > start_s and begin_s < end_s]
    if not spans:
        raise InputError("the reference sensor has no good record during the survey", remedy, path)
    ends, begins = [start_s, *(stamp_s for _, stamp_s in spans)], [*(begin_s for begin_s, _ in spans), end_s]
    gaps = np.subtract(begins, ends)
    worst = int(np.argmax(gaps))
    if gaps[worst] > MAX_GAP_S:
        raise InputError(
            f"the reference sensor has no good record for {gaps[worst] / 60:.0f} min of the survey, from "
            f"{utc_text(ends[worst])} UTC on",
            remedy,
            path,
        )
