# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Offset of the logger's clock against GNSS time: its drift, and the times when the clock was set."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

MAX_PAIRS = 600  # number of comparisons beyond which every second one is dropped
MAX_STEPS = 100  # number of times that the clock was set which are remembered
MIN_PAIRS = 9
MIN_DRIFT_S = 3.0  # change of the offset over a log that matters: a rover drives 30 m in this time [s]
JITTERS = 4.0  # change of the offset that the delays of lines do not cause, in their standard deviations
MIN_STEP_S = 5.0
"""Change of the offset from one comparison to the next by which the clock was set, or a line is late [s]."""
STEP_PAIRS = 3
"""Successive comparisons with one new offset that show that the clock was set: late lines do not agree."""
STEP_JITTER_S = 2.0  # maximum difference of such comparisons [s]


class ClockDrift:
    """Offset of the logger's clock over time, from comparisons with GNSS time.

    The medians of the first and the last third make the line, so single late lines do not matter. When the clock
    is set, all begins anew; :attr:`segments` keeps what was before.

    >>> drift = ClockDrift()
    >>> for hour in range(24):
    ...     drift.add(3600.0 * hour, 2.0 + 0.5 * hour)
    >>> drift.is_clear, round(3600 * drift.slope, 2)
    (True, 0.5)
    """

    def __init__(self) -> None:
        self._pairs: list[tuple[float, float]] = []
        self._every, self._skipped = 1, 0
        self._odd: list[tuple[float, float]] = []  # late lines, or the first ones after the clock was set
        self._last_s, self._last_ahead_s = math.nan, math.nan
        self._line: tuple[float, float, float, float, float] | None = None
        self._before: deque[ClockDrift] = deque(maxlen=MAX_STEPS)
        self.n_steps = 0
        """Number of times that the clock was set."""
        self.steps: deque[str] = deque(maxlen=MAX_STEPS)
        """The last of them in words."""

    def __len__(self) -> int:
        return len(self._pairs)

    def add(self, stamp_s: float, ahead_s: float) -> None:
        """Add a comparison."""
        if not math.isfinite(ahead_s):
            return
        is_odd = abs(ahead_s - self._last_ahead_s) > MIN_STEP_S
        if not is_odd or any(abs(ahead_s - odd_s) > STEP_JITTER_S for _, odd_s in self._odd):
            for late in self._odd:
                self._keep(*late)
            self._odd = []
        if is_odd:
            self._odd.append((stamp_s, ahead_s))
            if len(self._odd) == STEP_PAIRS:
                self._begin_anew()
            return
        self._last_s, self._last_ahead_s = stamp_s, ahead_s
        self._keep(stamp_s, ahead_s)

    def _keep(self, stamp_s: float, ahead_s: float) -> None:
        self._skipped += 1
        if self._skipped < self._every:
            return
        self._skipped, self._line = 0, None
        self._pairs.append((stamp_s, ahead_s))
        if len(self._pairs) > MAX_PAIRS:
            self._pairs, self._every = self._pairs[::2], 2 * self._every

    def _begin_anew(self) -> None:
        """Forget the offset from before the clock was set."""
        new, self._odd = self._odd, []
        if len(self._pairs) >= STEP_PAIRS:  # fewer may have been late lines
            before_s, after_s = self.ahead_s(self._last_s), new[-1][1]
            self.n_steps += 1
            self.steps.append(f"the logger's clock was set: {before_s:+.0f} s off GNSS time, now {after_s:+.0f} s")
            before = ClockDrift()
            before._pairs, before._last_s = self._pairs, self._last_s
            self._before.append(before)
            self._pairs, self._every, self._skipped = [], 1, 0
        self._last_s, self._last_ahead_s = new[-1]
        for one in new:
            self._keep(*one)

    @property
    def segments(self) -> tuple[ClockDrift, ...]:
        """The clock each time before it was set, in order, and since then."""
        return (*self._before, self)

    @property
    def last_s(self) -> float:
        """Time of the logger at the last comparison [s since 1970 UTC], NaN without one."""
        return self._last_s

    @property
    def median_s(self) -> float:
        """Median offset since the clock was set [s], NaN without a comparison."""
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
        """True if the clock has drifted by more than delays of lines can explain."""
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
        if self._line is None:
            self._line = _line_through(self._pairs)
        return self._line


def _line_through(pairs: list[tuple[float, float]]) -> tuple[float, float, float, float, float]:
    if len(pairs) < MIN_PAIRS:
        return (0.0,) * 5
    table = np.array(pairs)
    third = len(table) // 3
    begin, end = np.median(table[:third], axis=0), np.median(table[-third:], axis=0)
    line = begin[1] + (end[1] - begin[1]) / max(end[0] - begin[0], 1e-9) * (table[:, 0] - begin[0])
    jitter_s = 1.4826 * float(np.median(np.abs(table[:, 1] - line)))
    return float(begin[1]), float(end[1]), float(begin[0]), float(end[0]), jitter_s
