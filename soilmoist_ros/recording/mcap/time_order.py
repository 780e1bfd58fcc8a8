# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages sorted by time while a file is read, within limits of memory."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from typing import Final, Generic, TypeVar

from soilmoist_ros.recording.mcap.chunks import MAX_CHUNK_BYTES

_MAX_BYTES: Final = 2 * MAX_CHUNK_BYTES
_OVERHEAD: Final = 300
"""Memory of a message without its data [bytes]."""
_LATEST_NS: Final = 2**64

Message = TypeVar("Message")


class TimeOrder(Generic[Message]):
    """Messages that wait for earlier ones. Those of one time keep their order."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, int, Message]] = []
        self._bytes = 0
        self._added = 0

    def add(self, time_ns: int, size: int, message: Message) -> None:
        """Let a message wait.

        :param time_ns: its time [ns]
        :param size: size of its data [bytes]
        """
        self._added += 1
        self._bytes += size + _OVERHEAD
        heappush(self._waiting, (time_ns, self._added, size, message))

    def ready(self, until_ns: int = _LATEST_NS) -> Iterator[Message]:
        """Messages up to a time, and the earliest ones while more than 128 MB wait; they wait no longer."""
        while self._waiting and (self._waiting[0][0] <= until_ns or self._bytes > _MAX_BYTES):
            _, _, size, message = heappop(self._waiting)
            self._bytes -= size + _OVERHEAD
            yield message
