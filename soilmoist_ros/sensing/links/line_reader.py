"""A thread that reads lines in the background."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

from soilmoist_ros.sensing.links.line_source import LineSource, LinkStatus

MAX_WAITING = 20_000
"""Maximum number of waiting lines; above it, the reader pauses."""
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
        self._waiting: queue.Queue[bytes] = queue.Queue(MAX_WAITING)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="line reader", daemon=True)
        self._thread.start()

    @property
    def status(self) -> LinkStatus:
        """State of the link."""
        return self._source.status

    def take(self, max_lines: int) -> list[bytes]:
        """Remove and return at most ``max_lines`` lines, oldest first."""
        lines: list[bytes] = []
        while len(lines) < max_lines:
            try:
                lines.append(self._waiting.get_nowait())
            except queue.Empty:
                break
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
        while not self._stopping.is_set():
            try:
                self._waiting.put(line, timeout=_WAIT_S)
            except queue.Full:
                continue
            self._on_line()
            return
