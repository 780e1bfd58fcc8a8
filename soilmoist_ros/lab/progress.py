# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Progress of a campaign: missions done, missions a minute, and the time left."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from soilmoist_ros.foundation import duration


@dataclass(frozen=True)
class CampaignProgress:
    """State of a campaign.

    :param done: missions that have come to their end, failed and reused ones too
    :param total: missions of the campaign
    :param failed: missions that failed
    :param per_minute: missions a minute since the first mission of this run began; NaN while unknown
    :param left_s: estimated time left [s]; NaN while unknown
    :param note: what the campaign waits for; usually empty
    """

    done: int
    total: int
    failed: int = 0
    per_minute: float = math.nan
    left_s: float = math.nan
    note: str = ""

    def __str__(self) -> str:
        parts = [f"{self.done} of {self.total} missions"]
        if self.failed:
            parts.append(f"{self.failed} failed")
        if self.per_minute > 0:
            parts.append(f"{self.per_minute:.{0 if self.per_minute >= 10 else 1}f} a minute")
        if self.left_s > 0:
            parts.append(f"{duration(self.left_s)} left")
        return " · ".join([*parts, self.note] if self.note else parts)


Progress = Callable[[CampaignProgress], None]


class Pace:
    """Counts missions and estimates the time left by the pace since the first of them began.

    :param todo: number of missions that are not stored yet
    :param progress: called at once, and after each mission
    """

    def __init__(
        self, total: int, todo: int, progress: Progress, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._progress, self._clock, self._at_start = progress, clock, total - todo
        self._began_s: float | None = None
        self.state = CampaignProgress(self._at_start, total, left_s=math.nan if todo else 0.0)
        progress(self.state)

    def finished(self, time_s: float, failed: bool = False) -> None:
        """Count a mission that took its worker this time [s]; NaN if unknown."""
        now_s = self._clock()
        if self._began_s is None:  # what starts the workers is no part of the pace
            self._began_s = now_s - time_s if time_s >= 0 else now_s
        done, elapsed_s = self.state.done + 1, now_s - self._began_s
        each_s = elapsed_s / (done - self._at_start) if elapsed_s > 0 else math.nan
        self.state = replace(
            self.state,
            done=done,
            failed=self.state.failed + failed,
            per_minute=60 / each_s,
            left_s=(self.state.total - done) * each_s,
        )
        self._progress(self.state)

    def waits(self, note: str) -> None:
        """Report what the campaign waits for."""
        self._progress(replace(self.state, note=note))
