# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Chunks of an MCAP file, unpacked within limits: a file may come from a stranger, or from a failing disk."""

from __future__ import annotations

import errno
import os
import struct
import zlib
from collections.abc import Iterator
from heapq import heappop, heappush
from typing import Any, BinaryIO, Final, Generic, NamedTuple, TypeVar

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

_BLOCK: Final = 16 << 10
_SECTOR: Final = 4096
RECORD: Final = struct.Struct("<BQ")
"""Head of a record: opcode, and length of its content."""
MAX_CHUNK_BYTES: Final = 64 << 20
"""Largest chunk that is unpacked, and largest record that is read [bytes]; recorders write 1 to 8 MB."""

_FREE_BYTES: Final = 64 << 20
_EXPANSION: Final = 10_000
"""A file of 100 kB may unpack to 1 GB. Only empty grids, again and again, come near it."""
_FREE_RECORDS: Final = 300_000
_SEARCH: Final = 16
_HEAD: Final = struct.Struct("<QQQII")
_LENGTH: Final = struct.Struct("<Q")
_PIECE: Final = 1 << 20
_KNOWN: Final = frozenset(int(opcode) for opcode in Opcode)
_IN_CHUNKS: Final = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))

Record = tuple[int, bytes]
_MAX_BYTES: Final = 2 * MAX_CHUNK_BYTES
_OVERHEAD: Final = 300
"""Memory of a message without its data [bytes]."""
_LATEST_NS: Final = 2**64

Message = TypeVar("Message")


class FileBytes:
    """The bytes of a file, read when they are needed.

    A map of the file in memory would end the process where the disk fails, or where the file has become shorter.

    :param file: the file; its size is that of now
    :param salvage: whether bytes that cannot be read are zeros, not an error
    """

    def __init__(self, file: BinaryIO, salvage: bool = False) -> None:
        self.fault = ""
        """Reason why bytes could not be read; empty if all could."""
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
        """True if bytes of a range that was read are zeros because they could not be read."""
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


class TooMuchError(Exception):
    """A file unpacks to more than a recording of its size can."""


class Allowance:
    """What may still be unpacked from a file, so that the work grows with its size, whatever it claims.

    :param file_bytes: size of the file [bytes]
    """

    def __init__(self, file_bytes: int) -> None:
        self._bytes = _FREE_BYTES + _EXPANSION * file_bytes
        self._records = _FREE_RECORDS + file_bytes
        self._searched = _FREE_BYTES + _SEARCH * file_bytes

    def take(self, size: int) -> None:
        """Count unpacked bytes.

        :raises TooMuchError: if there were too many
        """
        self._bytes -= size
        if self._bytes < 0:
            raise TooMuchError

    def take_records(self, count: int = 1) -> None:
        """Count records.

        :raises TooMuchError: if there were too many
        """
        self._records -= count
        if self._records < 0:
            raise TooMuchError

    def search(self, size: int) -> bool:
        """Count bytes of a place that looks like a chunk; returns whether it may be unpacked."""
        self._searched -= size
        return self._searched >= 0


class Chunk(NamedTuple):
    """The head of a chunk.

    :param start_ns: time of its earliest message, as it claims [ns]
    :param size: size of its records, as it claims [bytes]
    :param checksum: CRC-32 of its records, 0 for none
    :param compression: ``zstd``, ``lz4`` or empty
    :param begin: start of its packed data in the file
    :param end: end of its packed data, and of the chunk
    """

    start_ns: int
    size: int
    checksum: int
    compression: bytes
    begin: int
    end: int

    @property
    def too_large(self) -> bool:
        """True if it is larger than what is unpacked."""
        return max(self.size, self.end - self.begin) > MAX_CHUNK_BYTES


def chunk_at(data: FileBytes, start: int) -> Chunk | None:
    """The head of a chunk, ``None`` if there cannot be one."""
    if len(data) - start < _HEAD.size:
        return None
    start_ns, _, size, checksum, name_length = data.unpack(_HEAD, start)
    name_at = start + _HEAD.size
    begin = name_at + name_length + 8
    if name_length > 4 or begin > len(data):
        return None
    compression = data[name_at : name_at + name_length]
    (length,) = data.unpack(_LENGTH, begin - 8)
    if compression not in (b"", b"lz4", b"zstd"):
        return None
    return Chunk(start_ns, size, checksum, compression, begin, begin + length)


def whole_chunk(data: FileBytes, chunk: Chunk, allowance: Allowance) -> bytes | None:
    """Records of a chunk, as one piece; ``None`` if it is damaged or too large.

    :raises TooMuchError: if the file has unpacked to too much
    """
    if chunk.end > len(data) or chunk.too_large:
        return None
    records = _unpacked(data, chunk, allowance)
    if len(records) != chunk.size or (chunk.checksum and zlib.crc32(records) != chunk.checksum):
        return None
    at = 0
    while len(records) - at >= RECORD.size:
        opcode, length = RECORD.unpack_from(records, at)
        at += RECORD.size + length
        if opcode not in _IN_CHUNKS:
            return None
        allowance.take_records()
    return records if at == len(records) else None


def begun_chunk(data: FileBytes, chunk: Chunk, allowance: Allowance) -> bytes:
    """The part of an incomplete chunk that can be unpacked.

    :raises TooMuchError: if the file has unpacked to too much
    """
    return b"" if chunk.too_large else _unpacked(data, chunk, allowance)


def split(data: bytes) -> Iterator[Record]:
    """Complete records of a piece of data."""
    at = 0
    while len(data) - at >= RECORD.size:
        opcode, length = RECORD.unpack_from(data, at)
        start = at + RECORD.size
        if opcode not in _KNOWN or start + length > len(data):
            return
        at = start + length
        yield opcode, data[start:at]


def _unpacked(data: FileBytes, chunk: Chunk, allowance: Allowance) -> bytes:
    """The unpacked data, at most one byte more than the chunk claims; as far as they can be unpacked."""
    packed = data[chunk.begin : chunk.end]
    if data.is_lost(chunk.begin, chunk.end):  # zeros would pass where the chunk has no checksum
        return b""
    if not chunk.compression:
        allowance.take(len(packed))
        return packed
    found = bytearray()
    try:
        for piece in _zstd(packed) if chunk.compression == b"zstd" else _lz4(packed):
            found += piece
            allowance.take(len(piece))
            if len(found) > chunk.size:
                break
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        pass
    return bytes(found[: chunk.size + 1])


def _zstd(packed: bytes) -> Iterator[bytes]:
    decompressor = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
    with decompressor.stream_reader(packed, read_across_frames=True) as reader:
        while piece := reader.read(_PIECE):
            yield piece


def _lz4(packed: bytes) -> Iterator[bytes]:
    decompressor = lz4.frame.LZ4FrameDecompressor()
    rest = packed
    while not decompressor.eof:
        piece = decompressor.decompress(rest, max_length=_PIECE)
        rest = b""
        if not piece and decompressor.needs_input:
            return
        yield piece


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
