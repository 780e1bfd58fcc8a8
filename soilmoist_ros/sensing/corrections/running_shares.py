"""Shares of the tubes while the records still come in."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.corrections.tubes import tube_shares
from soilmoist_ros.sensing.records import NAN, LoggerRecord

REMEMBERED_RECORDS = 1000
ALIKE_COUNTS = 100.0
"""Tubes are taken for alike with the weight of so many counts of each: known to 10 % before anything has come."""


class RunningShares:
    """Shares of the tubes in the rate of the whole sensor, estimated from the records so far [-].

    They matter only for a record in which a tube is missing: then the exposure is that of the tubes present, and
    the rate remains that of *all* tubes, also if one has been missing from the start.

    :param unused: positions of the tubes that are left out on purpose; their share is 0
    """

    def __init__(self, unused: Sequence[int] = ()) -> None:
        self._unused = frozenset(unused)
        self._records: deque[LoggerRecord] = deque(maxlen=REMEMBERED_RECORDS)
        self._shares: NDArray[np.float64] = np.empty(0)

    def take(self, record: LoggerRecord) -> NDArray[np.float64]:
        """Take a record; gives the shares to use for it, shape (tubes,)."""
        tubes = len(record.tube_counts)
        if tubes != len(self._shares):
            self._records.clear()
            self._shares = self._estimate(tubes)
        self._records.append(record)
        used = [live_s for tube, live_s in enumerate(record.tube_live_s) if tube not in self._unused]
        if len(set(used)) > 1 or any(math.isnan(live_s) for live_s in used):
            self._shares = self._estimate(tubes)
        return self._shares

    def _estimate(self, tubes: int) -> NDArray[np.float64]:
        used = [tube not in self._unused for tube in range(tubes)]
        alike = LoggerRecord(
            NAN,
            tuple(ALIKE_COUNTS if tube else NAN for tube in used),
            tuple(1.0 if tube else NAN for tube in used),
        )
        return tube_shares([alike, *self._records])
