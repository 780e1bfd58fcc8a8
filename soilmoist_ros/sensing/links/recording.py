"""Recorded lines, played at their own pace or faster."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

from soilmoist_ros.sensing.links.line_source import LinkState, LinkStatus
from soilmoist_ros.sensing.log_file import read_lines

StampOf = Callable[[bytes], float | None]
"""When a line was sent [s since 1970 UTC], ``None`` if it does not tell."""


class PlaybackClock:
    """Turns the time of recordings into the time of playing; recordings that share one stay in step.

    :param clock: monotonic time [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._start: tuple[float, float] | None = None

    def wait_s(self, stamp_s: float, speed: float) -> float:
        """How long to wait until a moment of the recording is due [s]; the first one asked for is due at once.

        :param stamp_s: time in the recording [s]
        :param speed: how many times faster than it was, > 0
        """
        now_s = self._clock()
        with self._lock:
            if self._start is None:
                self._start = (stamp_s, now_s)
        return self._start[1] + (stamp_s - self._start[0]) / speed - now_s


class RecordingSource:
    """A :class:`~soilmoist_ros.sensing.links.line_source.LineSource` that plays a file.

    :param path: the file
    :param speed: how many times faster than it was recorded; 0 for as fast as possible
    :param stamp_of: when a line was sent; lines that do not tell come right after the one before
    :param playback: shared by recordings that belong together
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
        self._closed = threading.Event()
        self._next = self._n_bytes = 0
        self._stamp_s: float | None = None
        self._looked_at = -1

    @property
    def status(self) -> LinkStatus:
        """How much was played."""
        state = LinkState.CONNECTED if self._next < len(self._lines) else LinkState.ENDED
        if self._closed.is_set():
            state = LinkState.CLOSED
        return LinkStatus(self._uri, state, connections=1, n_bytes=self._n_bytes, n_lines=self._next)

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line when it is due, ``None`` if that is later or there is none."""
        if self._closed.is_set():
            return None
        if self._next >= len(self._lines):
            self._closed.wait(timeout_s)
            return None
        line = self._lines[self._next]
        wait_s = self._wait_s(line)
        if wait_s > 0:
            self._closed.wait(min(wait_s, timeout_s))
            if wait_s > timeout_s or self._closed.is_set():
                return None
        self._next += 1
        self._n_bytes += len(line)
        return line

    def close(self) -> None:
        """Stop playing."""
        self._closed.set()

    def _wait_s(self, line: bytes) -> float:
        if self._stamp_of is None or self._speed <= 0:
            return 0.0
        if self._looked_at != self._next:  # each line once: what tells the time may remember the lines before
            self._looked_at = self._next
            self._stamp_s = self._stamp_of(line)
        return 0.0 if self._stamp_s is None else self._playback.wait_s(self._stamp_s, self._speed)
