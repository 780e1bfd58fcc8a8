# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shares of the tubes in the rate of the whole sensor, estimated from good counts only, with their uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PRIOR_COUNTS = 10.0
"""Weight of equal shares, as counts of each tube: tubes of one sensor may differ by a factor of two."""
LEARNED_COUNTS = 300.0
"""Weight of shares that are known from the whole log, likewise."""
MEMORY_RECORDS = 1000.0
"""Number of records after which earlier counts have lost two thirds of their weight: tubes age."""


class GoodShares:
    """Shares of the tubes, learned record by record.

    :param start: shares to start from, shape (tubes,), adding up to 1
    :param prior_counts: weight of the start, as counts of each tube
    """

    def __init__(self, start: Array, prior_counts: float) -> None:
        self._start, self._prior_counts = start, prior_counts
        self._seen, self._expected = np.zeros(len(start)), np.zeros(len(start))
        self.shares = start

    @property
    def counts(self) -> Array:
        """Counts behind the share of each tube, shape (tubes,)."""
        return self._seen + self._prior_counts

    def learn(self, counts: Array, live_s: Array, good: Mask) -> None:
        """Add the good counts of a record; one step of expectation and maximisation.

        :param counts: counts of the tubes, shape (tubes,)
        :param live_s: live times of the tubes, shape (tubes,) [s]
        :param good: tubes with good counts, at least one, shape (tubes,)
        """
        weights = self.shares * live_s
        rate_cps = counts[good].sum() / weights[good].sum()
        keep = 1 - 1 / MEMORY_RECORDS
        self._seen *= keep
        self._expected *= keep
        self._seen[good] += counts[good]
        self._expected[good] += rate_cps * live_s[good]
        known = self._start > 0
        new = np.zeros(len(self._start))
        before = self._prior_counts / self._start[known]
        new[known] = (self._prior_counts + self._seen[known]) / (before + self._expected[known])
        self.shares = new / new.sum()
