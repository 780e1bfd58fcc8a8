# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Progress of a campaign: missions done, missions a minute, and the time left."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from soilmoist_ros.lab.campaign_file import Mission
from soilmoist_ros.simulation import MissionSettings


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
            parts.append(f"{duration_text(self.left_s)} left")
        return " · ".join([*parts, self.note] if self.note else parts)


Progress = Callable[[CampaignProgress], None]


def duration_text(time_s: float) -> str:
    """A time in words.

    >>> duration_text(42), duration_text(600), duration_text(9000)
    ('42 s', '10 min', '2 h 30 min')
    """
    minutes = round(time_s / 60)
    if time_s < 120:
        return f"{time_s:.0f} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


class Pace:
    """Counts missions and estimates the time left.

    Missions of different strategies take different times. What is left is estimated by combination: a mission
    takes as long as the finished ones of its combination have taken on average, or as all finished ones, as long
    as none of its combination has finished. The number of workers that share the work follows from the time that
    the finished missions have taken, divided by the time since the first of them began.
    :param todo: missions that are not stored yet
    :param progress: called at once, and after each mission
    """

    def __init__(
        self, total: int, todo: Iterable[Mission], progress: Progress, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._left = Counter(_combination(mission) for mission in todo)
        self._taken: dict[MissionSettings, tuple[int, float]] = {}
        self._progress, self._clock = progress, clock
        self._began_s: float | None = None
        todo_count = self._left.total()
        self._at_start = total - todo_count
        self.state = CampaignProgress(self._at_start, total, left_s=0.0 if todo_count == 0 else math.nan)
        progress(self.state)

    def finished(self, mission: Mission, time_s: float, failed: bool = False) -> None:
        """Count a mission that took its worker this time [s]; NaN if unknown."""
        combination = _combination(mission)
        self._left -= Counter({combination: 1})
        if time_s >= 0:
            count, sum_s = self._taken.get(combination, (0, 0.0))
            self._taken[combination] = (count + 1, sum_s + time_s)
        now_s = self._clock()
        if self._began_s is None:  # what starts the workers is no part of the pace
            self._began_s = now_s - time_s if time_s >= 0 else now_s
        done, elapsed_s = self.state.done + 1, now_s - self._began_s
        self.state = replace(
            self.state,
            done=done,
            failed=self.state.failed + failed,
            per_minute=60 * (done - self._at_start) / elapsed_s if elapsed_s > 0 else math.nan,
            left_s=self._left_s(elapsed_s),
            note="",
        )
        self._progress(self.state)

    def waits(self, note: str) -> None:
        """Report what the campaign waits for."""
        self._progress(replace(self.state, note=note))

    def _left_s(self, elapsed_s: float) -> float:
        count = sum(number for number, _ in self._taken.values())
        sum_s = sum(taken_s for _, taken_s in self._taken.values())
        if not self._left:
            return 0.0
        if not sum_s > 0:
            return math.nan
        means = {combination: taken_s / number for combination, (number, taken_s) in self._taken.items()}
        work_s = sum(number * means.get(name, sum_s / count) for name, number in self._left.items())
        return work_s * elapsed_s / sum_s


def _combination(mission: Mission) -> MissionSettings:
    """What missions that differ by their seeds share."""
    return replace(mission.settings, seed=0)
