# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the counts of a sensor can be trusted: how many of the last records were quarantined, and why."""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import Final

from soilmoist_ros.sensing import Kind, reason_text

MIN_RECORDS: Final = 3
"""Number of records from which they are judged; also of those that are looked at if a sensor sends fewer."""
MAX_RECORDS: Final = 200
"""Number of records that are remembered."""
FORGOTTEN: Final = 3.0
"""Multiple of the time after which records without a successor are no longer judged."""
OF_PLACE: Final = frozenset((Kind.PLACE_JUMP.value, Kind.PLACE_DOUBT.value, Kind.CLOCK_DRIFT.value))
"""Reasons that say nothing about the counts; the causes ``jump``, ``fix_old`` and ``counts_stamp`` are theirs."""


class CountTrust:
    """Judges the records of the last time.

    :param last_s: how far back records are looked at [s]
    """

    def __init__(self, last_s: float) -> None:
        self._last_s = last_s
        self._records: deque[tuple[float, str]] = deque(maxlen=MAX_RECORDS)

    def take(self, now_s: float, reason: str = "") -> None:
        """A record has come.

        :param now_s: time [s]
        :param reason: why it is quarantined, empty for a good record
        """
        if reason not in OF_PLACE:
            self._records.append((now_s, reason))

    def fault(self, now_s: float) -> str:
        """Why the counts cannot be trusted now: more than half of them are quarantined; empty if they can.

        :param now_s: time [s]
        """
        newest_s = self._records[-1][0] if self._records else -math.inf
        if now_s - newest_s > FORGOTTEN * self._last_s:
            return ""
        judged = [reason for time_s, reason in self._records if now_s - time_s <= self._last_s]
        if len(judged) < MIN_RECORDS:
            judged = [reason for _, reason in list(self._records)[-MIN_RECORDS:]]
        bad = [reason for reason in judged if reason]
        if len(judged) < MIN_RECORDS or 2 * len(bad) <= len(judged):
            return ""
        [(reason, _)] = Counter(bad).most_common(1)
        return f"{len(bad)} of the last {len(judged)} records are quarantined ({reason_text(reason)})"
