"""Read every complete message of an MCAP file, even if the file is cut off or damaged."""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Final

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from soilmoist_ros.foundation.dataclass import dataclass
from soilmoist_ros.recording.bag.definitions import Definition
from soilmoist_ros.recording.bag.metadata import Topic, qos_from_yaml

_MAGIC: Final = b"\x89MCAP0\r\n"
_RECORD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<HIQQ")
_CHUNK: Final = struct.Struct("<QQQI")
_FOOTER: Final = struct.Struct("<QQI")
_KNOWN: Final = frozenset(int(opcode) for opcode in Opcode)
_A_CHUNK: Final = re.compile(rb"(?=\x06[\x00-\xff]{5}\x00{3})")
"""Opcode of a chunk, and a length below a terabyte."""

Record = tuple[int, bytes]


@dataclass(frozen=True, slots=True)
class ScannedMessage:
    """A message of a file.

    :param topic: its topic
    :param log_ns: time at which it was received [ns since 1970-01-01 UTC]
    :param publish_ns: time at which it was published [ns since 1970-01-01 UTC]
    :param data: the message in CDR
    """

    topic: Topic
    log_ns: int
    publish_ns: int
    data: bytes


class McapScan:
    """One pass over an MCAP file. Its findings are complete after the last message.

    Other readers need the index at the file's end, which is missing after a crash. A message that fails its
    checksum is skipped: a lost message is better than a wrong one.

    :param path: the file; only read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.finished = False
        """Whether the file was closed."""
        self.cut_bytes = 0
        """Size of the incomplete record at the end [bytes]."""
        self.damaged = 0
        """Places in the middle that cannot be read, or fail their checksum."""
        self.orphans = 0
        """Number of complete messages of topics without a description."""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._topics: dict[int, Topic | None] = {}

    def messages(self) -> Iterator[ScannedMessage]:
        """Every complete message, in the order of the file.

        :raises OSError: if the file cannot be read
        """
        with self.path.open("rb") as file:
            if not self.path.stat().st_size:
                return
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                self._read_summary(data)
                for opcode, body in self._records(data):
                    message = self._take(opcode, body)
                    if message is not None:
                        yield message

    def _records(self, data: mmap.mmap) -> Iterator[Record]:
        """Records of the file; a chunk is replaced by its records."""
        at, size = len(_MAGIC), len(data)
        if data[:at] != _MAGIC[: min(at, size)]:
            self.damaged += 1
        while at < size:
            opcode, length = _RECORD.unpack_from(data, at) if size - at >= _RECORD.size else (0, size)
            start = at + _RECORD.size
            end = start + length
            misread = opcode == Opcode.FOOTER and (end > size or data[end:] != _MAGIC[: size - end])
            if opcode not in _KNOWN or end > size or misread:
                found = _next_chunk(data, at + 1)
                if found is None:
                    self.cut_bytes = size - at
                    if opcode == Opcode.CHUNK:
                        yield from _split(_begun_chunk(data[start:]))[0]
                    return
                self.damaged += 1
                at = found
                continue
            at = end
            if opcode == Opcode.FOOTER:
                self.finished = size - at == len(_MAGIC)
                self.cut_bytes = 0 if self.finished else size - at
                return
            if opcode != Opcode.CHUNK:
                yield opcode, data[start:at]
                continue
            records = _whole_chunk(data[start:at])
            self.damaged += records is None
            yield from records or ()

    def _read_summary(self, data: mmap.mmap) -> None:
        """Read schemas and channels from the end of a closed file, in case a chunk with them is damaged."""
        footer = len(data) - len(_MAGIC) - _FOOTER.size - _RECORD.size
        if data[-len(_MAGIC) :] != _MAGIC or footer < 0 or data[footer] != Opcode.FOOTER:
            return
        start, _, checksum = _FOOTER.unpack_from(data, footer + _RECORD.size)
        if not 0 < start < footer or (checksum and zlib.crc32(data[start : -len(_MAGIC) - 4]) != checksum):
            return
        for opcode, body in _split(data[start:footer])[0]:
            self._take(opcode, body)

    def _take(self, opcode: int, body: bytes) -> ScannedMessage | None:
        if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
            channel, _, log_ns, publish_ns = _MESSAGE.unpack_from(body)
            topic = self._topic(channel)
            if topic is not None:
                return ScannedMessage(topic, log_ns, publish_ns, body[_MESSAGE.size :])
            self.orphans += 1
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(body)))
                self._schemas.setdefault(schema.id, schema)
            elif opcode == Opcode.CHANNEL:
                description = Channel.read(ReadDataStream(BytesIO(body)))
                self._channels.setdefault(description.id, description)
        except (McapError, struct.error, UnicodeDecodeError):
            self.damaged += 1
        return None

    def _topic(self, number: int) -> Topic | None:
        if number not in self._topics:
            channel = self._channels.get(number)
            schema = self._schemas.get(channel.schema_id) if channel is not None else None
            if channel is None or schema is None:
                return None
            text = schema.data.decode("utf-8", "replace")
            type_hash = channel.metadata.get("topic_type_hash", "")
            self._topics[number] = Topic(
                channel.topic,
                Definition(schema.name, text, schema.encoding, type_hash),
                qos_from_yaml(channel.metadata.get("offered_qos_profiles", "")),
            )
        return self._topics[number]


def _split(data: bytes) -> tuple[list[Record], bool]:
    """Complete records of a piece of data, and whether they fill it."""
    records: list[Record] = []
    at = 0
    while len(data) - at >= _RECORD.size:
        opcode, length = _RECORD.unpack_from(data, at)
        start = at + _RECORD.size
        if opcode not in _KNOWN or start + length > len(data):
            break
        at = start + length
        records.append((opcode, data[start:at]))
    return records, at == len(data)


def _whole_chunk(body: bytes) -> list[Record] | None:
    """Records of a chunk, ``None`` if it is damaged."""
    try:
        _, _, size, checksum = _CHUNK.unpack_from(body)
        compression, packed, length = _packed(body)
        if len(packed) != length:
            return None
        if compression == b"zstd":
            data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        elif compression == b"lz4":
            data = lz4.frame.decompress(packed)
        else:
            data = packed
    except (struct.error, zstandard.ZstdError, RuntimeError, EOFError, MemoryError, OverflowError):
        return None
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        return None
    records, whole = _split(data)
    return records if whole else None


def _begun_chunk(body: bytes) -> bytes:
    """The part of an incomplete chunk that can be unpacked."""
    try:
        compression, packed, _ = _packed(body)
        if compression == b"zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(packed)
        if compression == b"lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed))
    except (struct.error, zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        return b""
    return packed


def _packed(body: bytes) -> tuple[bytes, bytes, int]:
    """Compression of a chunk, the available part of its packed data, and their full length."""
    (name_length,) = struct.unpack_from("<I", body, _CHUNK.size)
    name_at = _CHUNK.size + 4
    (length,) = struct.unpack_from("<Q", body, name_at + name_length)
    start = name_at + name_length + 8
    return body[name_at : name_at + name_length], body[start : start + length], length


def _next_chunk(data: mmap.mmap, start: int) -> int | None:
    """Start of the next chunk that is complete and passes its checksum."""
    for match in _A_CHUNK.finditer(data, start):
        at = match.start()
        _, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        if end <= len(data) and _whole_chunk(data[at + _RECORD.size : end]):
            return at
    return None
