# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The bytes of a file on a disk that may fail, or that another process makes shorter."""

from __future__ import annotations

import errno
import os
import struct
from typing import Any, BinaryIO, Final

_BLOCK: Final = 16 << 10
_SECTOR: Final = 4096


class FileBytes:
    """The bytes of a file, read when they are needed.

    A map of the file in memory would end the process where the disk fails, or where the file has become shorter.

    :param file: the file; its size is that of now
    :param salvage: whether bytes that cannot be read are zeros, not an error
    """

    def __init__(self, file: BinaryIO, salvage: bool = False) -> None:
        self.fault = ""
        """Why bytes could not be read; empty if all could."""
        self._file = file
        self._salvage = salvage
        self._size = os.fstat(file.fileno()).st_size
        self._block = 0, b""
        self._lost: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, place: slice) -> bytes:
        """The bytes of a slice without a step.

        :raises OSError: if they cannot be read and are not salvaged
        """
        begin, end, _ = place.indices(self._size)
        if end - begin > _BLOCK:
            return self._read(begin, end)
        at, block = self._block
        if not at <= begin <= end <= at + len(block):
            at, block = self._load(begin)
        return block[begin - at : max(begin, end) - at]

    def unpack(self, form: struct.Struct, at: int) -> tuple[Any, ...]:
        """Values at a place.

        :raises struct.error: if the file ends before
        :raises OSError: if they cannot be read and are not salvaged
        """
        begin, block = self._block
        if not begin <= at <= begin + len(block) - form.size:
            begin, block = self._load(at)
        return form.unpack_from(block, at - begin)

    def is_lost(self, begin: int, end: int) -> bool:
        """Whether bytes of a range that was read are zeros because they could not be read."""
        return bool(self._lost) and any(first < end and begin < last for first, last in self._lost)

    def _load(self, begin: int) -> tuple[int, bytes]:
        self._block = begin, self._read(begin, min(begin + _BLOCK, self._size))
        return self._block

    def _read(self, begin: int, end: int) -> bytes:
        pieces: list[bytes] = []
        while begin < end:
            try:
                piece = os.pread(self._file.fileno(), end - begin, begin)
                if not piece:
                    raise OSError(errno.EIO, "it became shorter while it was read")
            except OSError as error:
                if not self._salvage:
                    raise
                self.fault = error.strerror or str(error)
                piece = bytes(min(end, begin - begin % _SECTOR + _SECTOR) - begin)
                self._lose(begin, begin + len(piece))
            pieces.append(piece)
            begin += len(piece)
        return b"".join(pieces)

    def _lose(self, begin: int, end: int) -> None:
        if self._lost and self._lost[-1][0] <= begin <= self._lost[-1][1]:
            begin, end = self._lost[-1][0], max(end, self._lost.pop()[1])
        self._lost.append((begin, end))
