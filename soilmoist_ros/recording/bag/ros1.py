# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bag files of ROS 1 (``.bag``, format 2.0), read by rosbags within limits; messages become those of ROS 2."""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Header, RecordType
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.chunks import MAX_CHUNK_BYTES, Allowance
from soilmoist_ros.recording.bag.metadata import Content, Definition, Extent, Topic, require_small

MAGIC: Final = b"#ROSBAG V2.0\n"
ROS1: Final = "ros1msg"
"""Encoding of definitions of ROS 1."""
_HEADER_TYPE: Final = "std_msgs/msg/Header"
"""Has a number ``seq`` in ROS 1, which ROS 2 dropped."""

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
    content : Content
        topics, and number and times of their messages, as the index says
    """

    def __init__(self, path: Path) -> None:
        _require_index(path)
        self._size = path.stat().st_size
        self._reader = Reader(path)
        with _faults():
            self._reader.open()
        self.connections: dict[int, Connection] = {}
        self._chunks, infos = dict(self._reader.chunks), self._reader.chunk_infos
        counts: dict[str, int] = {}
        for one in self._reader.connections:
            topic = f"/{one.topic.strip('/')}"
            self.connections[one.id] = Connection(topic, one.msgtype, one.msgdef.data)
            counts[topic] = counts.get(topic, 0) + sum(info.connection_counts.get(one.id, 0) for info in infos)
        kinds = {one.topic: one for one in self.connections.values()}
        topics = [Topic(name, Definition(one.type_name, one.definition, ROS1)) for name, one in kinds.items()]
        total = sum(counts.values())
        extent = Extent(total, self._reader.start_time, self._reader.end_time - 1) if total else Extent()
        self.content = Content(topics, counts, extent)

    def messages(self, topics: Collection[str], by_time: bool = True, convert: bool = True) -> Iterator[Message]:
        """Messages of topics, converted to those of ROS 2, in the order of time.

        :param by_time: has no effect: no recorder of this package has written it
        :param convert: whether to convert them; otherwise they are as in ROS 1, of any type
        :raises ValueError: if the file is damaged, or a message type has other fields in ROS 2
        """
        wanted = [one for one in self._reader.connections if self.connections[one.id].topic in topics]
        if not wanted:  # rosbags would read all
            return
        allowance = Allowance(self._size)  # of this pass: a bag may be read once for each topic
        for place, chunk in self._chunks.items():
            limited = partial(_unpacked, chunk.decompressor, allowance)
            self._reader.chunks[place] = chunk._replace(decompressor=limited)
        with _faults():
            for connection, time_ns, data in self._reader.messages(wanted):
                allowance.take_records()
                one = self.connections[connection.id]
                yield one.topic, one.type_name, time_ns, converted(one, data) if convert else data

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


@contextmanager
def _faults() -> Iterator[None]:
    """What rosbags raises for damaged files, as the errors of a damaged file."""
    try:
        yield
    except (ReaderError, AssertionError, struct.error, LookupError, EOFError) as error:
        raise ValueError(f"is damaged: {error}") from None


def _require_index(path: Path) -> None:
    """Check the head of a file.

    :raises InputError: if the file was not closed, or is cut off before its index
    :raises ValueError: if it is no bag of ROS 1
    """
    with path.open("rb") as file:
        if file.readline(len(MAGIC)) != MAGIC:
            raise ValueError("is not a bag of ROS 1 (format 2.0)")
        with _faults():
            position = Header.read(file, RecordType.BAGHEADER).get_uint64("index_pos")
        size = path.stat().st_size
    if not position:
        raise InputError("was not closed: its recorder was killed", "rosbag reindex FILE (ROS 1)", path)
    if position >= size:
        message = f"is cut off: its index would begin at byte {position}, it ends at byte {size}"
        raise InputError(message, "copy it again, or rosbag reindex FILE (ROS 1)", path)


def _unpacked(rosbags: Callable[[bytes], bytes], allowance: Allowance, data: bytes) -> bytes:
    """The records of a chunk, by a decompressor with a limit instead of that of rosbags."""
    if rosbags is bz2.decompress:
        data = bz2.BZ2Decompressor().decompress(data, MAX_CHUNK_BYTES + 1)
    elif rosbags is lz4.frame.decompress:
        try:
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, MAX_CHUNK_BYTES + 1)
        except RuntimeError as error:
            raise ValueError(f"has a damaged chunk: {error}") from None
    if len(data) > MAX_CHUNK_BYTES:
        raise ValueError(f"has a chunk of more than {MAX_CHUNK_BYTES >> 20} MB")
    allowance.take(len(data))
    return data


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


def converted(one: Connection, data: bytes) -> bytes:
    """A message in CDR.

    :raises ValueError: if it is damaged, or its type has other fields in ROS 2
    """
    store = store_of(one)
    try:
        return bytes(store.ros1_to_cdr(data, one.type_name))
    except Exception as error:  # a stranger's data: rosbags does not check everything
        raise ValueError(f"{one.topic}: a message is damaged: {error}") from None
