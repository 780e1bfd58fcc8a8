# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bag files of ROS 1 (``.bag``, format 2.0), read within limits; their messages become those of ROS 2.

The format: http://wiki.ros.org/Bags/Format/2.0. Reading needs no ROS.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.mcap.chunks import MAX_CHUNK_BYTES, Allowance
from soilmoist_ros.recording.mcap.definitions import require_small
from soilmoist_ros.recording.mcap.file_bytes import FileBytes
from soilmoist_ros.recording.mcap.time_order import TimeOrder

MAGIC: Final = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7
ROS1: Final = "ros1msg"
"""Encoding of definitions of ROS 1."""
_HEADER_TYPE: Final = "std_msgs/msg/Header"
"""Has a number ``seq`` in ROS 1, which ROS 2 dropped."""
_LENGTH: Final = struct.Struct("<I")
_TIME: Final = struct.Struct("<II")

Message = tuple[str, str, int, bytes]
"""Topic, type as in ROS 2, time at which it was received [ns since 1970-01-01 UTC], and data in CDR."""


class Connection(NamedTuple):
    """What one publisher of a topic sent.

    :param topic: full name of the topic
    :param type_name: type as in ROS 2, ``std_msgs/msg/String``
    :param definition: definition of the type as in ROS 1
    """

    topic: str
    type_name: str
    definition: str


class _ChunkInfo(NamedTuple):
    start_ns: int
    end_ns: int
    position: int


class Ros1File:
    """A bag file of ROS 1.

    :param path: the file
    :raises InputError: if it was not closed, so that its index is missing
    :raises ValueError: if it is damaged
    :raises OSError: if it cannot be read

    Attributes
    ----------
    connections : dict of int to Connection
        publishers by number
    counts : dict of str to int
        number of messages by topic, as the index says
    chunks : list
        parts of the file in the order of their first messages
    """

    def __init__(self, path: Path) -> None:
        self.connections: dict[int, Connection] = {}
        self.counts: dict[str, int] = {}
        self._file = path.open("rb")
        self._data = FileBytes(self._file)
        self._allowance = Allowance(len(self._data))
        try:
            self.chunks = self._read_index(path)
        except BaseException:
            self.close()
            raise

    @property
    def extent_ns(self) -> tuple[int, int] | None:
        """Times of the first and the last message [ns since 1970-01-01 UTC], as the index says."""
        if not self.chunks:
            return None
        return min(one.start_ns for one in self.chunks), max(one.end_ns for one in self.chunks)

    def messages(self, topics: Collection[str], convert: bool = True) -> Iterator[Message]:
        """Messages of topics, converted to those of ROS 2, in the order of time as :class:`TimeOrder` keeps it.

        :param convert: whether to convert them; otherwise they are as in ROS 1, of any type
        :raises ValueError: if the file is damaged, or a message type has other fields in ROS 2
        """
        wanted = {number: one for number, one in self.connections.items() if one.topic in topics}
        waiting: TimeOrder[tuple[int, int, bytes]] = TimeOrder()
        allowance = Allowance(len(self._data))  # of this pass: a bag may be read once for each topic
        for chunk in self.chunks:
            for found in waiting.ready(chunk.start_ns):
                yield _converted(convert, wanted, *found)
            for number, time_ns, data in self._messages_of(chunk, allowance):
                if number in wanted:
                    waiting.add(time_ns, len(data), (number, time_ns, data))
        for found in waiting.ready():
            yield _converted(convert, wanted, *found)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read_index(self, path: Path) -> list[_ChunkInfo]:
        """Connections and chunks at the end of the file."""
        if self._data[: len(MAGIC)] != MAGIC:
            raise ValueError("is not a bag of ROS 1 (format 2.0)")
        head, _, _ = self._record(len(MAGIC), _BAG)
        position = _unpacked("<Q", head, b"index_pos")
        if not position:
            raise InputError("was not closed: its recorder was killed", "rosbag reindex FILE (ROS 1)", path)
        if position >= len(self._data):
            message = f"is cut off: its index would begin at byte {position}, it ends at byte {len(self._data)}"
            raise InputError(message, "copy it again, or rosbag reindex FILE (ROS 1)", path)
        chunks: dict[int, _ChunkInfo] = {}
        while position < len(self._data):
            head, (begin, end), position = self._record(position)
            kind = head.get(b"op", b"")[:1]
            if kind == bytes([_CONNECTION]):
                self._connect(head, self._data[begin:end])
            elif kind == bytes([_CHUNK_INFO]):
                at = _unpacked("<Q", head, b"chunk_pos")
                chunks[at] = _ChunkInfo(_time_ns(head, b"start_time"), _time_ns(head, b"end_time"), at)
                for number, count in struct.iter_unpack("<II", self._data[begin : end - (end - begin) % 8]):
                    if number in self.connections:
                        topic = self.connections[number].topic
                        self.counts[topic] = self.counts.get(topic, 0) + count
        return sorted(chunks.values())

    def _connect(self, head: dict[bytes, bytes], data: bytes) -> None:
        about = _fields(data)
        package, _, kind = about[b"type"].decode().rpartition("/")
        topic = f"/{head[b'topic'].decode().strip('/')}"
        definition = about.get(b"message_definition", b"").decode(errors="replace")
        self.connections[_unpacked("<I", head, b"conn")] = Connection(topic, f"{package}/msg/{kind}", definition)
        self.counts.setdefault(topic, 0)

    def _messages_of(self, chunk: _ChunkInfo, allowance: Allowance) -> Iterator[tuple[int, int, bytes]]:
        """Number of the connection, time and data of each message of a chunk."""
        head, (begin, end), _ = self._record(chunk.position, _CHUNK)
        data = _unpack(head[b"compression"], self._data[begin:end], _unpacked("<I", head, b"size"))
        allowance.take(len(data))
        position = 0
        while position < len(data):
            allowance.take_records()
            inner, (begin, end), position = _record_at(data, position)
            if inner.get(b"op") == bytes([_MESSAGE]):
                yield _unpacked("<I", inner, b"conn"), _time_ns(inner, b"time"), data[begin:end]

    def _record(self, position: int, kind: int = 0) -> tuple[dict[bytes, bytes], tuple[int, int], int]:
        self._allowance.take_records()
        found = _record_at(self._data, position)
        if kind and found[0].get(b"op") != bytes([kind]):
            raise ValueError(f"is damaged at byte {position}")
        return found


def _record_at(data: FileBytes | bytes, position: int) -> tuple[dict[bytes, bytes], tuple[int, int], int]:
    """Header of a record, begin and end of its data, and where the next one begins."""
    ends = []
    for _ in range(2):
        if position + 4 > len(data):
            raise ValueError("ends within a record")
        (length,) = _LENGTH.unpack(data[position : position + 4])
        begin, position = position + 4, position + 4 + length
        if position > len(data):
            raise ValueError("ends within a record")
        ends.append((begin, position))
    (begin, end), inside = ends
    if end - begin > MAX_CHUNK_BYTES or inside[1] - inside[0] > MAX_CHUNK_BYTES:
        raise ValueError(f"has a record of more than {MAX_CHUNK_BYTES >> 20} MB")
    return _fields(data[begin:end]), inside, position


def _fields(data: bytes) -> dict[bytes, bytes]:
    """The fields ``name=value`` of a header."""
    found, position = {}, 0
    while position < len(data):
        if position + 4 > len(data):
            raise ValueError("has a damaged header")
        (length,) = _LENGTH.unpack_from(data, position)
        position += 4
        name, equals, value = data[position : position + length].partition(b"=")
        if not equals or position + length > len(data):
            raise ValueError("has a damaged header")
        found[name] = value
        position += length
    return found


def _unpacked(form: str, head: dict[bytes, bytes], name: bytes) -> int:
    try:
        (number,) = struct.unpack(form, head[name])
    except (KeyError, struct.error):
        raise ValueError(f"has a header without {name.decode()}") from None
    return int(number)


def _time_ns(head: dict[bytes, bytes], name: bytes) -> int:
    try:
        seconds, nanoseconds = _TIME.unpack(head[name])
    except (KeyError, struct.error):
        raise ValueError(f"has a header without {name.decode()}") from None
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def _unpack(compression: bytes, data: bytes, size: int) -> bytes:
    """The records of a chunk."""
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"has a chunk of more than {MAX_CHUNK_BYTES >> 20} MB")
    if compression == b"none":
        return data
    if compression == b"bz2":
        found = bz2.BZ2Decompressor().decompress(data, size + 1)
    elif compression == b"lz4":
        try:
            found = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
        except RuntimeError as error:
            raise ValueError(f"has a damaged chunk: {error}") from None
    else:
        raise ValueError(f"has the compression {compression.decode(errors='replace')!r}, which is not supported")
    if len(found) != size:
        raise ValueError("has a chunk of another size than it says")
    return bytes(found)


@cache
def store_of(one: Connection) -> Any:
    """Types of ROS 2 with that of a topic; a type that ROS 2 does not have is taken from its definition.

    :raises ValueError: if the type has other fields in ROS 2: its bytes mean something else there
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    try:
        types = get_types_from_msg(one.definition, one.type_name) if len(one.definition) < 1 << 20 else {}
    except Exception as error:  # a stranger's definition: rosbags does not check everything
        raise ValueError(f"{one.topic} has a damaged definition of {one.type_name}: {error!s:.80}") from None
    if one.type_name not in types:
        raise ValueError(f"{one.topic} has no definition of {one.type_name}")
    new = {}
    for name, (consts, fields) in types.items():
        if name == _HEADER_TYPE:
            continue
        if name not in store.fielddefs:
            new[name] = consts, fields
        elif _plain(store.fielddefs[name][1]) != _plain(fields):
            raise ValueError(f"{one.topic}: the type {name} of ROS 1 has other fields in ROS 2")
    require_small({**store.fielddefs, **new}, new)
    store.register(new)
    return store


def _plain(fields: Any) -> list[tuple[str, str]]:
    """Names and types of fields; time and duration have the layout of those in ROS 2."""
    return [(name, str(kind)) for name, kind in fields]


def _converted(convert: bool, wanted: dict[int, Connection], number: int, time_ns: int, data: bytes) -> Message:
    one = wanted[number]
    return one.topic, one.type_name, time_ns, converted(one, data) if convert else data


def converted(one: Connection, data: bytes) -> bytes:
    """A message in CDR.

    :raises ValueError: if it is damaged, or its type has other fields in ROS 2
    """
    store = store_of(one)
    try:
        return bytes(store.ros1_to_cdr(data, one.type_name))
    except Exception as error:  # a stranger's data: rosbags does not check everything
        raise ValueError(f"{one.topic}: a message is damaged: {error}") from None
