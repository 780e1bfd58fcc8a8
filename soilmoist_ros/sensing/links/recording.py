# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recorded lines, played at the recorded speed or faster."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from soilmoist_ros.sensing.formats.log_file import read_lines
from soilmoist_ros.sensing.links.line_source import LinkState, LinkStatus

StampOf = Callable[[bytes], float | None]
"""Time at which a line was sent [s since 1970 UTC], ``None`` if the line has no time."""


class PlaybackClock:
    """Converts recorded time to playing time.

    Recordings with a shared clock stay synchronous: a line is returned only after all earlier lines of all
    recordings.

    :param clock: monotonic time [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._turn = threading.Condition()
        self._at_s: list[float] = []
        self._start: tuple[float, float] | None = None

    def join(self) -> int:
        """Add a recording; returns its number."""
        with self._turn:
            self._at_s.append(-math.inf)  # other recordings wait until the first line is known
            return len(self._at_s) - 1

    def leave(self, number: int) -> None:
        """End a recording."""
        self._set_position(number, math.inf)

    def is_due(self, number: int, stamp_s: float, speed: float, timeout_s: float) -> bool:
        """Whether the next line of a recording is due; waits up to the timeout.

        :param number: number of the recording
        :param stamp_s: time at which the line was sent [s since 1970 UTC]; the first line of all is due at once
        :param speed: playing speed as a multiple of the recorded speed; 0 for as fast as possible
        :param timeout_s: maximum wait [s]
        """
        self._set_position(number, stamp_s)
        with self._turn:
            wait_s = self._wait_s(number, speed)
            if wait_s > 0 and timeout_s > 0:
                self._turn.wait(min(wait_s, timeout_s))
                wait_s = self._wait_s(number, speed)
        return wait_s <= 0

    def _set_position(self, number: int, stamp_s: float) -> None:
        with self._turn:
            self._at_s[number] = stamp_s
            self._turn.notify_all()

    def _wait_s(self, number: int, speed: float) -> float:
        stamp_s = self._at_s[number]
        if self._at_s.index(min(self._at_s)) != number:
            return math.inf
        now_s = self._clock()
        if self._start is None:
            self._start = (stamp_s, now_s)
        return self._start[1] + (stamp_s - self._start[0]) / speed - now_s if speed > 0 else 0.0


class RecordingSource:
    """A :class:`LineSource` that plays a file.

    :param speed: playing speed as a multiple of the recorded speed; 0 for as fast as possible
    :param stamp_of: time at which a line was sent; a line without a time follows the previous line at once
    :param playback: shared by recordings that are played together
    :raises InputError: if the file cannot be read
    """

    def __init__(
        self,
        path: Path,
        speed: float = 1.0,
        stamp_of: StampOf | None = None,
        playback: PlaybackClock | None = None,
    ) -> None:
        self._uri = path.absolute().as_uri()
        self._lines, _ = read_lines(path)
        self._speed = speed
        self._stamp_of = stamp_of
        self._playback = playback or PlaybackClock()
        self._number = self._playback.join()
        self._closed = threading.Event()
        self._next = self._n_bytes = 0
        self._stamp_s: float | None = None
        self._looked_at = -1

    @property
    def status(self) -> LinkStatus:
        """State of the recording."""
        state = LinkState.CONNECTED if self._next < len(self._lines) else LinkState.ENDED
        if self._closed.is_set():
            state = LinkState.CLOSED
        return LinkStatus(self._uri, state, connections=1, n_bytes=self._n_bytes, n_lines=self._next)

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line if it is due in time, else ``None``."""
        if self._closed.is_set():
            return None
        if self._next >= len(self._lines):
            self._playback.leave(self._number)
            self._closed.wait(timeout_s)
            return None
        line = self._lines[self._next]
        if not self._is_due(line, timeout_s) or self._closed.is_set():
            return None
        self._next += 1
        self._n_bytes += len(line)
        return line

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()
        self._playback.leave(self._number)

    def _is_due(self, line: bytes, timeout_s: float) -> bool:
        if self._stamp_of is None:
            return True
        if self._looked_at != self._next:  # each line once: `stamp_of` may remember earlier lines
            self._looked_at = self._next
            self._stamp_s = self._stamp_of(line)
        if self._stamp_s is None:
            return True
        return self._playback.is_due(self._number, self._stamp_s, self._speed, timeout_s)
