# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Joins pieces of bytes into whole lines, in bounded memory."""

from __future__ import annotations

from collections import deque

from soilmoist_ros.sensing.formats.log_values import MAX_LINE


class LineBuffer:
    """Collects bytes and returns lines, without empty lines.

    Lines end with LF, CR LF or CR. A line that is too long is dropped up to its end.

    :param max_line: maximum length of a line [bytes]
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
