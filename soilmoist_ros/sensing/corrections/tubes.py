# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several detector tubes as one sensor, even while some of them fail.

The whole sensor counts with the rate ``r`` and tube ``i`` with ``s_i r``; the *shares* ``s_i`` add up to 1.
In a record, the counts of the present tubes are independent, ``N_i ~ Poisson(s_i r t_i)``, with the live times
``t_i``. The sum of the counts is Poisson with the mean ``r * sum(s_i t_i)``. So

* raw counts ``sum N_i`` and
* exposure ``sum s_i t_i``, both over the tubes that are present,

make ``raw / exposure`` an unbiased estimate of the rate of *all* tubes. The raw counts are not rescaled and remain
Poisson. (The sum is a sufficient statistic for ``r``.) If all tubes are present with one live time ``t``, the
exposure is ``t``.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.records import NAN, LoggerRecord

ITERATIONS = 100
TOLERANCE = 1e-10
REMEMBERED_RECORDS = 1000
"""Maximum number of records for estimating the shares during a survey."""
PRIOR_COUNTS = 100.0
"""Weight of the prior of equal shares, as counts of each tube: 10 % before the first record."""


def tube_shares(records: Sequence[LoggerRecord]) -> NDArray[np.float64]:
    """Share of each tube in the rate of the whole sensor, estimated from records of the sensor [-].

    The maximum-likelihood estimate has one rate per record: neither changing soil nor tubes missing in some
    records bias the shares. If all tubes are present with equal live times in every record, a share is
    the tube's fraction of all counts. A tube that never counts has the share 0.

    :raises ValueError: if there are no records, their numbers of tubes differ, or nothing was counted
    """
    if not records:
        raise ValueError("there are no records to estimate the tubes' shares from")
    if len({len(record.tube_counts) for record in records}) != 1:
        raise ValueError("the records have different numbers of tubes")
    counts = np.array([record.tube_counts for record in records], float)
    live = np.array([record.tube_live_s for record in records], float)
    present = np.isfinite(counts) & np.isfinite(live) & (live > 0)
    counts, live = np.where(present, counts, 0.0), np.where(present, live, 0.0)
    if not counts.sum() > 0:
        raise ValueError("nothing was counted")
    return _maximum_likelihood(counts, live)


def _maximum_likelihood(counts: NDArray[np.float64], live: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the rates from the shares and the shares from the rates, alternately."""
    of_records, of_tubes = counts.sum(axis=1), counts.sum(axis=0)
    shares = np.where(of_tubes > 0, 1.0, 0.0) / np.count_nonzero(of_tubes)
    for _ in range(ITERATIONS):
        exposure = live @ shares
        rates = np.divide(of_records, exposure, out=np.zeros_like(exposure), where=exposure > 0)
        seen = rates @ live
        new = np.divide(of_tubes, seen, out=np.zeros_like(seen), where=seen > 0)
        new /= new.sum()
        if np.abs(new - shares).max() < TOLERANCE:
            return np.asarray(new)
        shares = new
    return np.asarray(shares)


def combine_tubes(record: LoggerRecord, shares: Sequence[float] | NDArray[np.float64]) -> tuple[int, float]:
    """Raw counts and exposure [s] of a record; see the docstring of this module.

    :param record: counts and live times, NaN where a tube is missing
    :param shares: share of each tube in the whole rate [-], adding up to 1
    :return: ``(raw_counts, exposure_s)``
    :raises ValueError: if there is not one share per tube, or no tube with a share counted
    """
    if len(shares) != len(record.tube_counts):
        raise ValueError(f"there are {len(shares)} shares for {len(record.tube_counts)} tubes")
    used = [
        (count, live_s, float(share))
        for count, live_s, share in zip(record.tube_counts, record.tube_live_s, shares, strict=True)
        if share > 0 and math.isfinite(count) and math.isfinite(live_s) and live_s > 0
    ]
    if not used:
        raise ValueError("no tube of the record is usable")
    raw_counts = int(sum(count for count, _, _ in used))
    live_times = {live_s for _, live_s, _ in used}
    if len(live_times) == 1 and len(used) == sum(share > 0 for share in shares):
        return raw_counts, live_times.pop()  # exact, where the sum of the shares would round
    return raw_counts, math.fsum(share * live_s for _, live_s, share in used)


class RunningShares:
    """Shares of the tubes in the rate of the whole sensor, estimated from the records so far [-].

    The shares matter only for a record with a missing tube: its exposure covers only the present tubes. The
    rate remains the rate of *all* tubes, even if one tube has been missing from the start.
    """

    def __init__(self) -> None:
        self._records: deque[LoggerRecord] = deque(maxlen=REMEMBERED_RECORDS)
        self._shares: NDArray[np.float64] = np.empty(0)

    def update(self, record: LoggerRecord, unused: Collection[int] = ()) -> NDArray[np.float64]:
        """Add a record, and return the shares for this record, shape (tubes,).

        :param unused: indices of the tubes that the format leaves out; their share is 0
        """
        tubes = len(record.tube_counts)
        if tubes != len(self._shares):
            self._records.clear()
            self._shares = self._estimate(tubes, unused)
        self._records.append(record)
        used = [live_s for tube, live_s in enumerate(record.tube_live_s) if tube not in unused]
        if len(set(used)) > 1 or any(math.isnan(live_s) for live_s in used):
            self._shares = self._estimate(tubes, unused)
        return self._shares

    def mask(self, tube: int, since_s: float) -> None:
        """Leave out what a bad tube has counted.

        :param tube: index of the tube
        :param since_s: first stamp of a bad record [s since 1970 UTC]
        """
        for index, record in enumerate(self._records):
            if record.stamp_s >= since_s:
                counts = tuple(NAN if each == tube else count for each, count in enumerate(record.tube_counts))
                self._records[index] = replace(record, tube_counts=counts)

    def _estimate(self, tubes: int, unused: Collection[int]) -> NDArray[np.float64]:
        used = [tube not in unused for tube in range(tubes)]
        alike = LoggerRecord(
            NAN,
            tuple(PRIOR_COUNTS if tube else NAN for tube in used),
            tuple(1.0 if tube else NAN for tube in used),
        )
        return tube_shares([alike, *self._records])
