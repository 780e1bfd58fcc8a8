# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drift of the logger's clock against GNSS time: a slope, in addition to an offset."""

from __future__ import annotations

import math

import numpy as np

MAX_PAIRS = 600
"""Number of comparisons beyond which every second one is dropped."""
MIN_PAIRS = 9
MIN_DRIFT_S = 3.0
"""Change of the offset over a log that matters: a rover drives 30 m in this time [s]."""
JITTERS = 4.0
"""Change of the offset that the delays of lines do not cause, in their standard deviations."""


class ClockDrift:
    """Offset of the logger's clock over time, from comparisons with GNSS time.

    The medians of the first and the last third make the line, so single late lines do not matter.

    >>> drift = ClockDrift()
    >>> for hour in range(24):
    ...     drift.add(3600.0 * hour, 2.0 + 0.5 * hour)
    >>> drift.is_clear, round(3600 * drift.slope, 2)
    (True, 0.5)
    """

    def __init__(self) -> None:
        self._pairs: list[tuple[float, float]] = []
        self._every, self._skipped = 1, 0

    def __len__(self) -> int:
        return len(self._pairs)

    def __repr__(self) -> str:
        return f"ClockDrift({self.message})"

    def add(self, stamp_s: float, ahead_s: float) -> None:
        """Add a comparison.

        :param stamp_s: time of the logger [s since 1970 UTC]
        :param ahead_s: logger's clock minus GNSS time [s]; NaN is ignored
        """
        self._skipped += 1
        if self._skipped < self._every or not math.isfinite(ahead_s):
            return
        self._skipped = 0
        self._pairs.append((stamp_s, ahead_s))
        if len(self._pairs) > MAX_PAIRS:
            self._pairs, self._every = self._pairs[::2], 2 * self._every

    @property
    def median_s(self) -> float:
        """Median offset [s], NaN without a comparison."""
        return float(np.median([ahead_s for _, ahead_s in self._pairs])) if self._pairs else math.nan

    @property
    def change_s(self) -> float:
        """Change of the offset from the first to the last third [s], 0 while there are few comparisons."""
        return self._thirds[1] - self._thirds[0]

    @property
    def slope(self) -> float:
        """Drift of the logger's clock [s/s], 0 while there are few comparisons."""
        first_s, last_s, begin_s, end_s, _ = self._thirds
        return (last_s - first_s) / (end_s - begin_s) if end_s > begin_s else 0.0

    @property
    def is_clear(self) -> bool:
        """Whether the clock has drifted by more than delays of lines can explain."""
        return abs(self.change_s) > max(MIN_DRIFT_S, JITTERS * self._thirds[4])

    @property
    def message(self) -> str:
        """The drift in words."""
        return f"the logger's clock drifts by {3600 * self.slope:+.2f} s/h, by {self.change_s:+.1f} s in this log"

    def ahead_s(self, stamp_s: float) -> float:
        """Offset at a time of the logger [s]: the median, or on the line of a clear drift; 0 if unknown."""
        if not self._pairs:
            return 0.0
        if not self.is_clear:
            return self.median_s
        first_s, _, begin_s, _, _ = self._thirds
        return first_s + self.slope * (stamp_s - begin_s)

    @property
    def _thirds(self) -> tuple[float, float, float, float, float]:
        """Median offsets of the first and the last third, their median times, and the jitter around them [s]."""
        if len(self._pairs) < MIN_PAIRS:
            return (0.0,) * 5
        table = np.array(self._pairs)
        third = len(table) // 3
        begin, end = np.median(table[:third], axis=0), np.median(table[-third:], axis=0)
        line = begin[1] + (end[1] - begin[1]) / max(end[0] - begin[0], 1e-9) * (table[:, 0] - begin[0])
        jitter_s = 1.4826 * float(np.median(np.abs(table[:, 1] - line)))
        return float(begin[1]), float(end[1]), float(begin[0]), float(end[0]), jitter_s
