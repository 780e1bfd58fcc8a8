# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Read every complete message of an MCAP file, even if the file is cut off or damaged, or made to do harm."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Final

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from soilmoist_ros.recording.bag.chunks import (
    MAX_CHUNK_BYTES,
    RECORD,
    Allowance,
    FileBytes,
    Record,
    TimeOrder,
    TooMuchError,
    begun_chunk,
    chunk_at,
    split,
    whole_chunk,
)
from soilmoist_ros.recording.bag.metadata import Definition, Qos, Topic, qos_from_yaml

_MAGIC: Final = b"\x89MCAP0\r\n"
_MESSAGE: Final = struct.Struct("<HIQQ")
_FOOTER: Final = struct.Struct("<QQI")
_LENGTH: Final = struct.Struct("<I")
_KNOWN: Final = frozenset(int(opcode) for opcode in Opcode)
_READ: Final = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))
_SKIPPED: Final = frozenset((Opcode.HEADER, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA))
_MAX_DESCRIPTIONS: Final = 32 << 20
_MAX_QOS: Final = 32 << 10
"""Size of all different qualities of service of a file [bytes]: YAML is slow to read."""
_A_CHUNK: Final = re.compile(rb"(?=\x06[\x00-\xff]{5}\x00{3})")
"""Opcode of a chunk, and a length below a terabyte."""
_WINDOW: Final = 8 << 10
"""Part of a file in which a chunk is searched at once [bytes]."""
_FAULTS: Final = (McapError, struct.error, ValueError, KeyError, MemoryError, OverflowError)


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
    checksum is skipped: a lost message is better than a wrong one. In a file with chunks only chunks have
    checksums, so a message outside of them is taken for a damaged index. Memory and time are limited, whatever the
    file claims.

    :param path: the file; only read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.finished = False
        """True if the file was closed."""
        self.cut_bytes = 0
        """Size of the incomplete record at the end [bytes]."""
        self.damaged = 0
        """Places in the middle that cannot be read, or fail their checksum."""
        self.orphans = 0
        """Number of complete messages of topics without a description."""
        self.too_large = 0
        """Number of chunks that are too large to be read."""
        self.fault = ""
        """Reason why parts of the file could not be read; empty if all could. They are damaged places."""
        self.too_much = False
        """True if reading ended because the file unpacks to more than a recording of its size can."""
        self.statistics: Statistics | None = None
        """Numbers of messages, from the end of a closed file."""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._topics: dict[int, Topic | None] = {}
        self._described = 0
        self._qos: dict[str, tuple[Qos, ...]] = {}
        self._qos_bytes = 0

    def topics(self) -> dict[int, Topic]:
        """The topics that were described so far, by the number of their channel."""
        return {number: topic for number in self._channels if (topic := self._topic(number)) is not None}

    def read_summary(self) -> bool:
        """Read the end of a closed file: topics and statistics; returns whether it has both.

        :raises OSError: if the file cannot be read
        """
        with self.path.open("rb") as file:
            self._read_summary(FileBytes(file, salvage=True))
        return self.statistics is not None

    def messages(self) -> Iterator[ScannedMessage]:
        """Every complete message, in the order of the file.

        :raises OSError: if the file cannot be read
        """
        for _, messages in self._pieces():
            yield from messages

    def sorted_messages(self) -> Iterator[ScannedMessage]:
        """Every complete message in the order of time, if no more than 128 MB of messages are out of it.

        :raises OSError: if the file cannot be read
        """
        waiting: TimeOrder[ScannedMessage] = TimeOrder()
        for later_ns, messages in self._pieces():
            for message in messages:
                waiting.add(message.log_ns, len(message.data), message)
            yield from waiting.ready(-1 if later_ns is None else later_ns)
        yield from waiting.ready()

    def _pieces(self) -> Iterator[tuple[int | None, Iterable[ScannedMessage]]]:
        """Messages of each chunk, and the time of the earliest message in later chunks, if it is known [ns]."""
        with self.path.open("rb") as file:
            data = FileBytes(file, salvage=True)
            try:
                self._read_summary(data)
                later_ns = _later_ns(data)
                for at, records in self._records(data, Allowance(len(data))):
                    yield later_ns.get(at), self._messages(records)
            except TooMuchError:
                self.too_much = True
            finally:
                self.fault = data.fault

    def _messages(self, records: Iterable[Record]) -> Iterator[ScannedMessage]:
        for opcode, body in records:
            message = self._take(opcode, body)
            if message is not None:
                yield message

    def _records(self, data: FileBytes, allowance: Allowance) -> Iterator[tuple[int, Iterable[Record]]]:
        """Place and records of each chunk; outside of chunks, of each record."""
        at, size, chunked, in_summary = len(_MAGIC), len(data), False, False
        if data[:at] != _MAGIC[: min(at, size)]:
            self.damaged += 1
        while at < size:
            opcode, length = data.unpack(RECORD, at) if size - at >= RECORD.size else (0, size)
            start = at + RECORD.size
            end = start + length
            if not _plausible(data, opcode, start, end):
                found = _next_chunk(data, at, allowance)
                if found is None:
                    self.cut_bytes = size - at
                    chunk = chunk_at(data, start) if opcode == Opcode.CHUNK else None
                    if chunk is not None:
                        yield at, split(begun_chunk(data, chunk, allowance))
                    return
                self.damaged += 1
                at, chunked = found, True
                continue
            if opcode == Opcode.FOOTER:
                self.finished = size - end == len(_MAGIC)
                self.cut_bytes = 0 if self.finished else size - end
                return
            if opcode == Opcode.CHUNK:
                chunked = True
                chunk = chunk_at(data, start)
                records = None if chunk is None else whole_chunk(data, chunk, allowance)
                if chunk is not None and chunk.too_large:
                    self.too_large += 1
                else:
                    self.damaged += records is None
                yield at, split(records or b"")
            elif opcode in _READ:
                if chunked or in_summary or at == len(_MAGIC) or length > MAX_CHUNK_BYTES:
                    self.damaged += not in_summary
                else:
                    allowance.take_records()
                    body = data[start:end]
                    if data.is_lost(at, end):
                        self.damaged += 1
                    else:
                        yield at, ((opcode, body),)
            elif opcode == Opcode.DATA_END:
                in_summary = True
            else:  # a record of the summary among the data was a chunk, or its index
                self.damaged += opcode not in _SKIPPED and not in_summary
            at = end

    def _read_summary(self, data: FileBytes) -> None:
        """Read schemas and channels from the end of a closed file, in case a chunk with them is damaged."""
        footer = len(data) - len(_MAGIC) - _FOOTER.size - RECORD.size
        if data[-len(_MAGIC) :] != _MAGIC or footer < 0 or data.unpack(RECORD, footer)[0] != Opcode.FOOTER:
            return
        start, _, checksum = data.unpack(_FOOTER, footer + RECORD.size)
        if not 0 < start < footer or footer - start > MAX_CHUNK_BYTES:
            return
        summary = data[start : -len(_MAGIC) - 4]
        if data.is_lost(start, len(data)) or (checksum and zlib.crc32(summary) != checksum):
            return
        for opcode, body in split(summary):
            if opcode == Opcode.FOOTER:
                return
            if opcode == Opcode.STATISTICS:
                try:
                    self.statistics = Statistics.read(ReadDataStream(BytesIO(body)))
                except _FAULTS:
                    self.damaged += 1
            elif opcode != Opcode.MESSAGE:
                self._take(opcode, body)

    def _take(self, opcode: int, body: bytes) -> ScannedMessage | None:
        if opcode == Opcode.MESSAGE:
            if len(body) < _MESSAGE.size:
                self.damaged += 1
                return None
            channel, _, log_ns, publish_ns = _MESSAGE.unpack_from(body)
            topic = self._topic(channel)
            if topic is not None:
                return ScannedMessage(topic, log_ns, publish_ns, body[_MESSAGE.size :])
            self.orphans += 1
        elif opcode in _READ:
            try:
                self._describe(opcode, body)
            except _FAULTS:
                self.damaged += 1
        return None

    def _describe(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        known = int.from_bytes(body[:2], "little") in (
            self._schemas if opcode == Opcode.SCHEMA else self._channels
        )
        if known:
            return
        self._described += len(body)
        if self._described > _MAX_DESCRIPTIONS:
            raise TooMuchError
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
        else:
            channel = Channel.read(stream)
            self._channels[channel.id] = channel

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
                self._offered(channel.metadata.get("offered_qos_profiles", "")),
            )
        return self._topics[number]

    def _offered(self, text: str) -> tuple[Qos, ...]:
        if text not in self._qos:
            self._qos_bytes += len(text)
            self._qos[text] = qos_from_yaml(text) if self._qos_bytes <= _MAX_QOS else ()
        return self._qos[text]


def _plausible(data: FileBytes, opcode: int, start: int, end: int) -> bool:
    """True if a record outside of chunks is as long as its content; a wrong length would skip what follows."""
    size = len(data)
    if opcode not in _KNOWN or end > size:
        return False
    if opcode == Opcode.FOOTER:
        return data[end : end + len(_MAGIC)] == _MAGIC[: size - end]
    if opcode == Opcode.CHUNK:
        chunk = chunk_at(data, start)
        return chunk is not None and chunk.end == end
    if opcode == Opcode.DATA_END:
        return end - start == 4
    if opcode in (Opcode.HEADER, Opcode.METADATA):  # two blocks with their lengths
        first = start + 4 + int(data.unpack(_LENGTH, start)[0]) if end - start >= 8 else end
        return first + 4 <= end and first + 4 + data.unpack(_LENGTH, first)[0] == end
    if opcode == Opcode.MESSAGE_INDEX:
        return end - start >= 6 and data.unpack(_LENGTH, start + 2)[0] == end - start - 6
    return True


def _later_ns(data: FileBytes) -> dict[int, int]:
    """For each chunk by its place, the time of the earliest message in later chunks [ns], as their heads claim."""
    starts: list[tuple[int, int]] = []
    at = len(_MAGIC)
    while len(data) - at >= RECORD.size:
        opcode, length = data.unpack(RECORD, at)
        if opcode not in _KNOWN or opcode == Opcode.DATA_END:
            break
        if opcode == Opcode.CHUNK and (chunk := chunk_at(data, at + RECORD.size)) is not None:
            starts.append((at, chunk.start_ns))
        at += RECORD.size + length
    found, earliest = {}, 2**64
    for at, start_ns in reversed(starts):
        found[at] = earliest
        earliest = min(earliest, start_ns)
    return found


def _next_chunk(data: FileBytes, after: int, allowance: Allowance) -> int | None:
    """Start of the next chunk that is complete and passes its checksum; of the one at this place, too."""
    for at in _chunk_places(data, after):
        chunk = chunk_at(data, at + RECORD.size)
        if chunk is None or chunk.end > len(data) or chunk.too_large:
            continue
        if not allowance.search(chunk.end - chunk.begin + chunk.size):
            return None
        _, length = data.unpack(RECORD, at)
        if chunk.end == at + RECORD.size + length and whole_chunk(data, chunk, allowance):
            return at
    return None


def _chunk_places(data: FileBytes, after: int) -> Iterator[int]:
    """Places that look like the start of a chunk."""
    for begin in range(after, len(data), _WINDOW):
        window = data[begin : begin + _WINDOW + RECORD.size - 1]
        yield from (begin + match.start() for match in _A_CHUNK.finditer(window))
