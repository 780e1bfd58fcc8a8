# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Read every complete message of an MCAP file, even if it is cut off or damaged, which no library does."""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from soilmoist_ros.recording.bag.metadata import Definition, TimedMessage, Topic, qos_from_yaml
from soilmoist_ros.recording.bag.writer import is_being_written

MAX_CHUNK_BYTES: Final = 64 << 20
"""Larger chunks and records are damaged: recorders write 1 to 8 MB [bytes]."""
_MAGIC: Final = b"\x89MCAP0\r\n"
_RECORD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQII")
_LENGTH: Final = struct.Struct("<Q")
_MESSAGE: Final = struct.Struct("<HIQQ")
_FOOTER: Final = struct.Struct("<QQI")
_KNOWN: Final = frozenset(map(int, Opcode))
_READ: Final = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))
_SKIPPED: Final = frozenset((Opcode.HEADER, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA))
_A_CHUNK: Final = re.compile(rb"(?=\x06[\x00-\xff]{5}\x00{3})")  # opcode of a chunk, and a length below a terabyte
_WINDOW: Final = 64 << 10  # part of a file in which a chunk is searched at once [bytes]
_PIECE: Final = 1 << 20
_FAULTS: Final = (McapError, struct.error, ValueError, KeyError, MemoryError, OverflowError)

Record = tuple[int, bytes]


class _Bytes:
    """The bytes of a file, fewer where it ends: a map in memory would end the process if it became shorter."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.size = os.fstat(file.fileno()).st_size

    def read(self, begin: int, end: int) -> bytes:
        self._file.seek(begin)
        return self._file.read(max(0, min(end, self.size) - begin))

    def head(self, at: int) -> tuple[int, int]:
        """Opcode and end of the record at a place; opcode 0, which none has, if the file ends before."""
        data = self.read(at, at + _RECORD.size)
        if len(data) < _RECORD.size:
            return 0, self.size + 1
        opcode, length = _RECORD.unpack(data)
        return opcode, at + _RECORD.size + length


class _Chunk(NamedTuple):
    """Head of a chunk: size and CRC-32 of its records as it claims, and the place of its packed data."""

    size: int
    checksum: int
    compression: bytes
    begin: int
    end: int

    @property
    def too_large(self) -> bool:
        return max(self.size, self.end - self.begin) > MAX_CHUNK_BYTES


class McapScan:
    """One pass over an MCAP file, which is only read. Its findings are complete after the last message.

    Other readers need the index at the file's end, which is missing after a crash. A chunk that fails its checksum
    is skipped: a lost message is better than a wrong one. In a file with chunks only chunks have checksums, so a
    message outside of them is taken for a damaged index. Memory is limited, whatever the file claims.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.finished = False
        """True if the file was closed."""
        self.cut_bytes = 0
        """Size of the incomplete record at the end [bytes]."""
        self.damaged = 0
        """Places in the middle that cannot be read, or fail their checksum."""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._topics: dict[int, Topic] = {}
        self._undescribed: set[int] = set()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[TimedMessage]:
        """Complete messages of topics, or of all, in the order of the file; ``OSError`` if it cannot be read."""
        for opcode, body in self._records():
            message = self._take(opcode, body)
            if message is not None and (topics is None or message.topic.name in topics):
                yield message

    def findings(self) -> list[str]:
        """Problems of the file, in words; complete after the last message."""
        name, found = self.path.name, []
        if is_being_written(self.path):
            found.append(f"{name} is still being recorded")
        elif not self.finished:
            cut = f"; its last {self.cut_bytes} bytes are an incomplete message" if self.cut_bytes else ""
            found.append(f"{name} was not closed{cut}")
        if self.damaged:
            found.append(f"{name} is damaged in {self.damaged} place{'s'[: self.damaged > 1]}")
        return found

    def _records(self) -> Iterator[Record]:
        """Records of chunks, and those outside of chunks."""
        with self.path.open("rb") as file:
            data = _Bytes(file)
            self._read_summary(data)
            at, chunked, in_summary = len(_MAGIC), False, False
            if data.read(0, at) != _MAGIC[: data.size]:
                self.damaged += 1
            while at < data.size:
                opcode, end = data.head(at)
                start = at + _RECORD.size
                chunk = _chunk_at(data, start) if opcode == Opcode.CHUNK else None
                good = chunk.end == end if chunk else opcode != Opcode.CHUNK and _plausible(data, opcode, at, end)
                if not good or end > data.size:
                    found = _next_chunk(data, at + 1)
                    if found is not None:
                        self.damaged += 1
                        at, chunked = found, True
                        continue
                    self.cut_bytes = data.size - at
                    if chunk is not None and not chunk.too_large:  # it was being written
                        yield from _split(_unpacked(data, chunk))
                    return
                if opcode == Opcode.FOOTER:
                    self.cut_bytes = max(0, data.size - end - len(_MAGIC))
                    self.finished = data.read(end, end + len(_MAGIC)) == _MAGIC and not self.cut_bytes
                    return
                if chunk is not None:
                    chunked = True
                    records = _whole(data, chunk)
                    self.damaged += records is None
                    yield from _split(records or b"")
                elif opcode in _READ:
                    if chunked or in_summary or at == len(_MAGIC) or end - start > MAX_CHUNK_BYTES:
                        self.damaged += not in_summary
                    else:
                        yield opcode, data.read(start, end)
                elif opcode == Opcode.DATA_END:
                    in_summary = True
                else:  # a record of the summary among the data was a chunk, or its index
                    self.damaged += opcode not in _SKIPPED and not in_summary
                at = end

    def _read_summary(self, data: _Bytes) -> None:
        """Read the end of a closed file, in case a chunk with the descriptions of topics is damaged."""
        end = max(0, data.size - len(_MAGIC) - _FOOTER.size - _RECORD.size)
        tail = data.read(end, data.size)
        if not end or not tail.endswith(_MAGIC) or tail[0] != Opcode.FOOTER:
            return
        start, _, checksum = _FOOTER.unpack_from(tail, _RECORD.size)
        if not 0 < start < end or end - start > MAX_CHUNK_BYTES:
            return
        summary = data.read(start, data.size - len(_MAGIC) - 4)
        if checksum and zlib.crc32(summary) != checksum:
            return
        for opcode, body in _split(summary):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._take(opcode, body)

    def _take(self, opcode: int, body: bytes) -> TimedMessage | None:
        """The message of a record, or what it describes."""
        try:
            if opcode == Opcode.MESSAGE:
                number, _, log_ns, publish_ns = _MESSAGE.unpack_from(body)
                topic = self._topics.get(number) or self._topic(number)
                if topic is not None:
                    return TimedMessage(topic, log_ns, publish_ns, body[_MESSAGE.size :])
                self.damaged += number not in self._undescribed
                self._undescribed.add(number)
            elif opcode == Opcode.SCHEMA and int.from_bytes(body[:2], "little") not in self._schemas:
                schema = Schema.read(ReadDataStream(BytesIO(body)))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL and int.from_bytes(body[:2], "little") not in self._channels:
                channel = Channel.read(ReadDataStream(BytesIO(body)))
                self._channels[channel.id] = channel
        except _FAULTS:
            self.damaged += 1
        return None

    def _topic(self, number: int) -> Topic | None:
        channel = self._channels.get(number)
        schema = self._schemas.get(channel.schema_id) if channel is not None else None
        if channel is not None and schema is not None and number not in self._topics:
            about = channel.metadata
            text = schema.data.decode("utf-8", "replace")
            definition = Definition(schema.name, text, schema.encoding, about.get("topic_type_hash", ""))
            offered = qos_from_yaml(about.get("offered_qos_profiles", ""))
            self._topics[number] = Topic(channel.topic, definition, offered)
        return self._topics.get(number)


def profile_of(path: Path) -> str:
    """Profile in the header of an MCAP file: ``ros2``, ``ros1``, or empty; ``ros2`` of a damaged one."""
    with path.open("rb") as file:
        head = file.read(len(_MAGIC) + _RECORD.size + 4 + 64)
    begin = len(_MAGIC) + _RECORD.size + 4
    size = int.from_bytes(head[begin - 4 : begin], "little")
    damaged = not head.startswith(_MAGIC) or head[len(_MAGIC) : len(_MAGIC) + 1] != bytes([Opcode.HEADER])
    return "ros2" if damaged or size > 64 else head[begin : begin + size].decode("utf-8", "replace")


def _plausible(data: _Bytes, opcode: int, at: int, end: int) -> bool:
    """True if a record is followed by another one, or the end: a wrong length would skip what follows."""
    if opcode not in _KNOWN or end > data.size:
        return False
    if opcode == Opcode.FOOTER:
        return data.read(end, end + len(_MAGIC)) == _MAGIC[: data.size - end]
    if opcode == Opcode.MESSAGE_INDEX:  # a chunk whose opcode has one other bit
        return int.from_bytes(data.read(at + 11, at + 15), "little") == end - at - 15
    following = data.read(end, end + 1)
    return not following or following[0] in _KNOWN


def _chunk_at(data: _Bytes, start: int) -> _Chunk | None:
    """The head of a chunk, ``None`` if there cannot be one."""
    head = data.read(start, start + _CHUNK.size + 12)
    if len(head) < _CHUNK.size + 8:
        return None
    _, _, size, checksum, name_length = _CHUNK.unpack_from(head)
    begin = start + _CHUNK.size + name_length + 8
    compression = head[_CHUNK.size :][: min(name_length, 4)]
    if compression not in (b"", b"lz4", b"zstd") or len(compression) != name_length or begin > data.size:
        return None
    (length,) = _LENGTH.unpack_from(head, _CHUNK.size + name_length)
    return _Chunk(size, checksum, compression, begin, begin + length)


def _unpacked(data: _Bytes, chunk: _Chunk) -> bytes:
    """The records of a chunk, as far as they can be unpacked; at most one byte more than it claims."""
    packed = data.read(chunk.begin, chunk.end)
    if not chunk.compression:
        return packed
    if chunk.compression == b"lz4":
        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, chunk.size + 1))
        except (RuntimeError, EOFError, MemoryError):
            return b""
    found = bytearray()
    reader = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(
        packed, read_across_frames=True
    )
    with suppress(zstandard.ZstdError, MemoryError):
        while len(found) <= chunk.size and (piece := reader.read(min(_PIECE, chunk.size + 1 - len(found)))):
            found += piece
    return bytes(found)


def _whole(data: _Bytes, chunk: _Chunk) -> bytes | None:
    """The records of a chunk that passes its checksum and has nothing else; ``None`` otherwise."""
    records = b"" if chunk.too_large else _unpacked(data, chunk)
    if len(records) != chunk.size or (chunk.checksum and zlib.crc32(records) != chunk.checksum):
        return None
    at = 0
    while len(records) - at >= _RECORD.size:
        opcode, length = _RECORD.unpack_from(records, at)
        at += _RECORD.size + length
        if opcode not in _READ:
            return None
    return records if at == len(records) else None


def _split(data: bytes) -> Iterator[Record]:
    """Complete records of a piece of data."""
    at = 0
    while len(data) - at >= _RECORD.size:
        opcode, length = _RECORD.unpack_from(data, at)
        start = at + _RECORD.size
        at = start + length
        if opcode not in _KNOWN or at > len(data):
            return
        yield opcode, data[start:at]


def _next_chunk(data: _Bytes, after: int) -> int | None:
    """Start of the next chunk that is complete and passes its checksum."""
    for begin in range(after, data.size, _WINDOW):
        for match in _A_CHUNK.finditer(data.read(begin, begin + _WINDOW + _RECORD.size - 1)):
            at = begin + match.start()
            chunk = _chunk_at(data, at + _RECORD.size)
            if chunk and data.head(at)[1] == chunk.end <= data.size and _whole(data, chunk):
                return at
    return None
