# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What no single record shows: cumulative sums of likelihood ratios, and runs of one number."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FACTORS = (0.0, 0.5, 2.0)
"""Shares of a bad tube that the cumulative sums look for, as multiples of its good share."""
MIN_LEARNED_COUNTS = 300.0
"""Counts behind a share from which half and twice the share differ clearly from an unknown share."""
RECOVERY = math.log(1000.0)
"""Logarithm of the likelihood ratio from which a masked tube counts again."""


class ShareCharts:
    """Cumulative sums for the tubes of one sensor: one for each tube and each share of :data:`FACTORS`."""

    def __init__(self, tubes: int) -> None:
        self.sums = np.zeros((len(FACTORS), tubes))
        self._begin_s = np.zeros((len(FACTORS), tubes))
        self._recovery = np.zeros(tubes)
        self._recovered_s = np.zeros(tubes)

    def add(self, stamp_s: float, ratios: Array, good: Mask) -> None:
        """Continue with a record.

        :param stamp_s: its stamp [s since 1970 UTC]
        :param ratios: log-likelihood ratios of :func:`share_ratios`
        :param good: tubes that are compared, shape (tubes,)
        """
        self._begin_s[self.sums <= 0] = stamp_s
        self.sums = np.maximum(self.sums + np.where(good, ratios, 0.0), 0.0)

    def worst(self) -> tuple[int, bool, float]:
        """Tube with the highest sum, whether it counts too much, and since when [s since 1970 UTC]."""
        row, tube = (int(index) for index in np.unravel_index(self.sums.argmax(), self.sums.shape))
        return tube, FACTORS[row] > 1, float(self._begin_s[row, tube])

    def recovered_s(self, stamp_s: float, tube: int, ratios: Array, too_many: bool) -> float | None:
        """Time from which a masked tube is good again [s since 1970 UTC], ``None`` if it is not.

        :param too_many: whether it was masked for too many counts
        """
        if self._recovery[tube] <= 0:
            self._recovered_s[tube] = stamp_s
        against = ratios[FACTORS.index(2.0 if too_many else 0.5), tube]
        self._recovery[tube] = max(self._recovery[tube] - against, 0.0)
        return float(self._recovered_s[tube]) if self._recovery[tube] > RECOVERY else None

    def clear(self, tube: int) -> None:
        """Start again after a tube was masked or has recovered: its counts were part of every total."""
        self.sums[:] = 0.0
        self._recovery[tube] = 0.0


def share_ratios(counts: Array, weights: Array, use: Mask, good: Mask, behind: Array) -> Array:
    """Log-likelihood ratios of bad shares against the good share, shape (factors, tubes).

    The counts of a tube are binomial given the total of the good tubes and the tube itself.

    :param counts: counts of the tubes, shape (tubes,)
    :param weights: share of each tube times its live time [s], shape (tubes,)
    :param use: tubes that the sensor uses, shape (tubes,)
    :param good: tubes that are good so far, at least one, shape (tubes,)
    :param behind: counts behind the share of each tube, shape (tubes,)
    """
    number, weight = np.where(good, 0.0, counts), np.where(good, 0.0, weights)
    total, whole = counts[good].sum() + number, weights[good].sum() + weight
    compared = use & (weights < whole * (1 - 1e-9))  # with another tube
    share = np.where(compared, weights / np.where(compared, whole, 1.0), 0.0)
    learned = compared & ((behind >= MIN_LEARNED_COUNTS) | ~good)  # masked tubes must be able to return
    ratios = np.empty((len(FACTORS), len(counts)))
    for row, factor in enumerate(FACTORS):
        against = total * np.log1p(share * (factor - 1))
        if factor == 0:
            ratios[row] = np.where(counts > 0, -math.inf, np.where(compared, -against, 0.0))
        else:
            ratios[row] = np.where(learned, counts * math.log(factor) - against, 0.0)
    return ratios


@dataclass
class Run:
    """How often a tube has repeated a number."""

    value: float = math.nan
    begin_s: float = math.nan
    surprise: float = 0.0
    step: int = 0

    def add(self, value: float, stamp_s: float) -> None:
        """Continue with the next count; ``surprise`` is minus the logarithm of the run's highest probability."""
        if value == self.value:
            likeliest = value * math.log(value) - value - math.lgamma(value + 1) if value > 0 else 0.0
            self.surprise += max(-likeliest - math.log(max(self.step, 1)), 0.0)
            return
        if not math.isnan(self.value):  # counts of some loggers are multiples of a number
            self.step = math.gcd(self.step, round(abs(value - self.value)))
        self.value, self.begin_s, self.surprise = value, stamp_s, 0.0
