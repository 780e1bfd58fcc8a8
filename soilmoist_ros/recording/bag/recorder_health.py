# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Health of the recorder for ``/diagnostics``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.recording.bag.recorder import RecorderState


def recorder_health(
    state: RecorderState,
    free_bytes: int | None,
    low_disk_bytes: float,
    skipped: int = 0,
    full_soon_s: float = 0.0,
    limits: str = "",
    lost: Mapping[str, int] = MappingProxyType({}),
    left_bytes: float = math.inf,
) -> Health:
    """Health of the recorder.

    :param state: its state
    :param free_bytes: space left on its disk [bytes], ``None`` if unknown
    :param low_disk_bytes: free space below which the recorder warns [bytes]
    :param skipped: topics that are not recorded because their type is not installed
    :param full_soon_s: time to a full disk below which the recorder warns [s]
    :param limits: what exceeds the limits of the recordings, in words
    :param lost: messages that did not reach the recorder, by topic
    :param left_bytes: space that bags may still take [bytes], infinite without a limit
    """
    limit_s = max(left_bytes, 0.0) / state.rate_bps if state.rate_bps > 0 else math.inf
    full_s = free_bytes / state.rate_bps if free_bytes is not None and state.rate_bps > 0 else math.inf
    if state.problem or state.gone:
        level, message = Level.ERROR, state.problem or state.gone
    elif not state.recording:
        level, message = Level.WARN, "not recording"
    elif free_bytes is not None and free_bytes < low_disk_bytes:
        level, message = Level.WARN, f"only {free_bytes / 1e6:.0f} MB left on the disk"
    elif full_s < full_soon_s:
        level, message = Level.WARN, f"the disk will be full in {full_s / 60:.0f} min"
    elif limits:
        level, message = Level.WARN, limits
    elif limit_s < full_soon_s:
        level, message = Level.WARN, f"the recordings will reach keep_gb in {limit_s / 60:.0f} min"
    elif state.dropped:
        level, message = Level.WARN, f"{state.dropped} messages lost: the disk is too slow"
    elif lost:
        topics = ", ".join(f"{count} of {name}" for name, count in sorted(lost.items()))
        level, message = Level.WARN, f"messages lost on the way to the recorder: {topics}"
    else:
        level, message = Level.OK, "recording"
    values = {
        "bag": str(state.bag or ""),
        "messages": str(state.messages),
        "dropped": str(state.dropped),
        "lost": str(sum(lost.values())),
        "topics": str(state.topics),
        "topics skipped": str(skipped),
        "size [MB]": f"{state.size_bytes / 1e6:.3f}",
        "waiting [MB]": f"{state.waiting_bytes / 1e6:.3f}",
        "written [kB/s]": f"{state.rate_bps / 1e3:.3g}",
        "disk full in [h]": f"{full_s / 3600:.1f}" if math.isfinite(full_s) else "unknown",
        "keep_gb reached in [h]": f"{limit_s / 3600:.1f}" if math.isfinite(limit_s) else "unknown",
        "files deleted": str(state.deleted),
        "disk free [MB]": "unknown" if free_bytes is None else f"{free_bytes / 1e6:.0f}",
    }
    return Health("bag", level, message, values)


class _Publishers:
    """Next numbers of the publishers of a topic.

    :param count: how many there are
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._next: list[int] = []  # the last entry has come last
        self._followed: list[bool] = []
        """Whether the very next number has come after each since the last one was new. All have: these are all the
        publishers, each with one entry; so is a single one at once."""

    def missing(self, number: int) -> int:
        """Messages that are missing before this one."""
        below = max((one for one in self._next if one <= number), default=None)
        all_known = len(self._next) == self.count and (self.count == 1 or all(self._followed))
        if below == number or (all_known and below is not None):
            at = self._next.index(below)
            del self._next[at], self._followed[at]
            self._append(number + 1, followed=True)
            return number - below
        if all_known:  # somebody has begun to count again
            self._next, self._followed = [], []
        self._followed = [False] * len(self._next)
        self._append(number + 1, followed=False)
        return 0

    def _append(self, number: int, followed: bool) -> None:
        self._next = [*self._next, number][-self.count :]
        self._followed = [*self._followed, followed][-self.count :]


class SequenceGaps:
    """Counts messages that their publishers numbered and that never came.

    A message does not say which publisher of its topic has sent it. It counts for the publisher whose next number
    is equal or the nearest below it, so the count is not too high. With several publishers, gaps count as soon as
    each has sent two messages in succession.

    Attributes
    ----------
    lost : dict[str, int]
        missing messages by topic, without topics that miss none
    """

    def __init__(self) -> None:
        self.lost: dict[str, int] = {}
        self._publishers: dict[str, _Publishers] = {}

    def take(self, topic: str, number: int | None, publishers: int = 1) -> None:
        """A message has come.

        >>> gaps = SequenceGaps()
        >>> for number in (7, 8, 11, 1, 2):  # the publisher starts again after 11
        ...     gaps.take("/counts", number)
        >>> gaps.lost
        {'/counts': 2}

        :param topic: its topic
        :param number: its number, which grows by 1 with each message of the publisher; ``None`` if unknown
        :param publishers: publishers of the topic now
        """
        if number is None:
            return
        known = self._publishers.get(topic)
        if known is None or known.count != publishers:
            known = self._publishers[topic] = _Publishers(publishers)
        missing = known.missing(number)
        if missing:
            self.lost[topic] = self.lost.get(topic, 0) + missing
