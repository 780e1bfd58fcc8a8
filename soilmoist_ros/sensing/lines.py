# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From bytes to lines: sources of lines, a thread that reads one, and files."""

from __future__ import annotations

import enum
import logging
import math
import re
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from soilmoist_ros.foundation import InputError

MAX_LINE = 65_536  # maximum length of a line [bytes]; longer lines are noise and are dropped
MAX_WAITING = 20_000  # maximum number of waiting lines; above it, the reader pauses
MAX_WAITING_BYTES = 16 << 20  # maximum size of waiting lines [bytes]; above it, the reader pauses
_WAIT_S = 0.2
_STOP_S = 5.0
_log = logging.getLogger(__name__)
_MAGIC = {
    b"PK\x03\x04": "a ZIP archive or a spreadsheet (.xlsx)", b"\x1f\x8b": "a gzip archive",
    b"%PDF": "a PDF document", b"\x89PNG": "an image", b"\xd0\xcf\x11\xe0": "an old Office document (.xls)",
    b"\x89MCAP": "a ROS bag (MCAP)", b"SQLite": "a database",
}  # fmt: skip


class LinkState(enum.Enum):
    """State of a link."""

    CONNECTING = "connecting"
    """Not connected; retries."""
    CONNECTED = "connected"
    SILENT = "silent"
    """Connected, but no bytes arrive."""
    CLOSED = "closed"
    """Closed from this side."""


@dataclass(frozen=True)
class LinkStatus:
    """State and counts of a link.

    :param attempts: attempts to connect since the last line, or since the link fell silent
    :param last_error: reason of the last failed or broken connection, empty if there is none
    :param n_oversized: lines dropped because they were too long
    :param sender: address whose datagrams are accepted; ``n_refused`` of others were dropped, of ``refused`` in
        the last minute
    :param silent_s: time since the last byte or connection [s]
    :param silence_limit_s: such a time after which the link reconnects [s]
    :param remedy: what to do about an error, if it is not the usual
    """

    uri: str
    state: LinkState
    attempts: int = 0
    connections: int = 0
    last_error: str = ""
    n_bytes: int = 0
    n_lines: int = 0
    n_oversized: int = 0
    n_refused: int = 0
    refused: str = ""
    sender: str = ""
    silent_s: float = 0.0
    silence_limit_s: float = math.inf
    remedy: str = ""


class LineSource(Protocol):
    """A stream of lines that never ends and never raises."""

    @property
    def status(self) -> LinkStatus:
        """State of the link; may be read from any thread."""

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line without its line end, ``None`` after the timeout.

        Connects first if necessary; connecting may take longer than the timeout.
        """

    def close(self) -> None:
        """Close the link; wakes a reader in another thread."""


# Joins pieces of bytes into whole lines, in bounded memory ------------------------------------------------------


class LineBuffer:
    """Collects bytes and returns lines, without empty lines.

    Lines end with LF, CR LF or CR. A line that is too long is dropped up to its end.
    """

    def __init__(self, max_line: int = MAX_LINE) -> None:
        self.n_oversized = 0
        self._max_line = max_line
        self._lines: deque[bytes] = deque()
        self._rest = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> int:
        """Add bytes; returns the number of completed lines."""
        before = len(self._lines)
        pieces = data.replace(b"\r", b"\n").split(b"\n")
        for piece in pieces[:-1]:
            self._collect(piece)
            self.end_line()
        self._collect(pieces[-1])
        return len(self._lines) - before

    def end_line(self) -> None:
        """End the current line, for example at the end of a datagram or file."""
        if self._rest and not self._skipping:
            self._lines.append(bytes(self._rest))
        self.drop_rest()

    def drop_rest(self) -> None:
        """Drop an incomplete line, for example when a connection breaks."""
        self._rest.clear()
        self._skipping = False

    def pop(self) -> bytes | None:
        """Remove and return the oldest line, ``None`` if there is none."""
        return self._lines.popleft() if self._lines else None

    def _collect(self, piece: bytes) -> None:
        if self._skipping:
            return
        if len(self._rest) + len(piece) > self._max_line:
            self._rest.clear()
            self._skipping = True
            self.n_oversized += 1
            return
        self._rest += piece


# A thread that reads lines in the background --------------------------------------------------------------------


class LineReader:
    """Reads a source in a background thread, and closes it; ``on_line`` is called there, and must be quick."""

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
            while not self._taken.wait_for(
                lambda: len(self._waiting) < MAX_WAITING and self._waiting_bytes + len(line) <= MAX_WAITING_BYTES,
                _WAIT_S,
            ):
                if self._stopping.is_set():
                    return
            self._waiting.append(line)
            self._waiting_bytes += len(line)
        self._on_line()


# Files ----------------------------------------------------------------------------------------------------------


def read_lines(path: Path, binary: bool = False) -> tuple[list[bytes], bool]:
    """Lines of a text file without line ends, and whether the last line had an end.

    :param binary: whether other bytes may stand between the lines
    :raises InputError: if the file is missing, a folder, not readable, empty or not text
    """
    if path.is_dir():
        raise InputError("is a folder, not a file", "give the path of a log file in it", path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError("there is no such file", "check the path", path) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", "check the path and its permissions", path) from None
    if not data.strip(b"\x00 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise InputError("is empty", "check that the logger wrote it, and that it was copied as a whole", path)
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise InputError(f"is {what}, not a text file", "unpack it or export it as text first", path)
    start = b"" if binary or utf16(data[:4096]) else data[:4096].replace(b"\x00", b"")  # zeros: the power failed
    if sum(byte < 32 and byte not in b"\t\r\n\x0c\x1a" for byte in start) > 0.05 * len(start):
        raise InputError("is not a text file", "give the text file that the logger wrote", path)
    return split_lines(data)


def log_files(paths: Iterable[Path]) -> list[Path]:
    """Files to read: those that are given, and those in folders, without hidden ones and runs.

    :raises InputError: if a folder has no file
    """
    found: list[Path] = []
    for path in paths:
        if not path.is_dir():
            found.append(path)
            continue
        runs = {one.parent for one in path.rglob("summary.json")}
        names = sorted(one for one in path.rglob("*") if one.is_file() and not runs.intersection(one.parents))
        files = [one for one in names if not any(part[0] in "._" for part in one.relative_to(path).parts)]
        if not files:
            raise InputError("has no file", "give a log file, or a folder with log files", path)
        found += files
    return found


def split_lines(data: bytes) -> tuple[list[bytes], bool]:
    """Lines of a file without line ends (LF, CR LF or CR), and whether the last line had an end.

    UTF-16, common in Windows tools, is converted to UTF-8. A run of NUL bytes becomes one, and ends no line.
    """
    if encoding := utf16(data):
        data = data.decode(encoding, errors="replace").encode("utf-8", errors="replace")
    data = re.sub(rb"\x00+", b"\x00", data) if b"\x00" in data else data
    return data.splitlines(), data.endswith((b"\n", b"\r"))


def utf16(data: bytes) -> str:
    """Encoding of a text in UTF-16, by its byte order mark or by every other byte of its start; else empty."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    start = data[:400]
    for name, high in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if len(high) > 4 and high.count(0) > 0.9 * len(high) and start.count(0) < 0.6 * len(start):
            return name
    return ""
