# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that reads lines in the background."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable

from soilmoist_ros.sensing.links.line_source import LineSource, LinkStatus

MAX_WAITING = 20_000
"""Maximum number of waiting lines; above it, the reader pauses."""
MAX_WAITING_BYTES = 16 << 20
"""Maximum size of waiting lines [bytes]; above it, the reader pauses."""
_WAIT_S = 0.2
_STOP_S = 5.0
_log = logging.getLogger(__name__)


class LineReader:
    """Reads a source in a background thread.

    :param source: the source; closed at the end
    :param on_line: called from the thread after each line; must return quickly
    """

    def __init__(self, source: LineSource, on_line: Callable[[], None]) -> None:
        self._source = source
        self._on_line = on_line
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._taken = threading.Condition()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="line reader", daemon=True)
        self._thread.start()

    @property
    def status(self) -> LinkStatus:
        """State of the link."""
        return self._source.status

    def take(self, max_lines: int) -> list[bytes]:
        """Remove and return at most ``max_lines`` lines, oldest first."""
        with self._taken:
            lines = [self._waiting.popleft() for _ in range(min(max_lines, len(self._waiting)))]
            self._waiting_bytes -= sum(map(len, lines))
            self._taken.notify()
        return lines

    def stop(self) -> None:
        """End the thread and close the source."""
        self._stopping.set()
        self._thread.join(_STOP_S)  # the thread may remain: a name lookup cannot be interrupted
        self._source.close()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                line = self._source.read_line(_WAIT_S)
            except Exception:  # a bug in reading must not silence the sensor
                _log.exception("reading a line failed; reading continues")
                self._stopping.wait(1.0)
                continue
            if line is not None:
                self._put(line)

    def _put(self, line: bytes) -> None:
        with self._taken:
            while not self._taken.wait_for(lambda: self._has_room(line), _WAIT_S):
                if self._stopping.is_set():
                    return
            self._waiting.append(line)
            self._waiting_bytes += len(line)
        self._on_line()

    def _has_room(self, line: bytes) -> bool:
        return len(self._waiting) < MAX_WAITING and self._waiting_bytes + len(line) <= MAX_WAITING_BYTES
