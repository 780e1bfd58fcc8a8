"""Bytes in pieces of any size to whole lines, within bounded memory."""

from __future__ import annotations

from collections import deque

MAX_LINE = 65_536
"""Longer lines are noise, and are thrown away [bytes]."""


class LineBuffer:
    """Collects bytes and hands out lines; empty ones are left out.

    Lines end with LF, CR LF or CR. One that grows too long is dropped up to its end, wherever that comes.

    :param longest: longest line that is kept [bytes]
    """

    def __init__(self, longest: int = MAX_LINE) -> None:
        self.n_oversized = 0
        self._longest = longest
        self._lines: deque[bytes] = deque()
        self._rest = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> int:
        """Take bytes; the number of lines that they complete."""
        before = len(self._lines)
        pieces = data.replace(b"\r", b"\n").split(b"\n")
        for piece in pieces[:-1]:
            self._collect(piece)
            self.end_line()
        self._collect(pieces[-1])
        return len(self._lines) - before

    def end_line(self) -> None:
        """Take what was collected as a line, as the end of a datagram or file does."""
        if self._rest and not self._skipping:
            self._lines.append(bytes(self._rest))
        self.drop_rest()

    def drop_rest(self) -> None:
        """Forget a line that has begun, as when a connection breaks."""
        self._rest.clear()
        self._skipping = False

    def pop(self) -> bytes | None:
        """The oldest line, ``None`` if there is none."""
        return self._lines.popleft() if self._lines else None

    def _collect(self, piece: bytes) -> None:
        if self._skipping:
            return
        if len(self._rest) + len(piece) > self._longest:
            self._rest.clear()
            self._skipping = True
            self.n_oversized += 1
            return
        self._rest += piece
