# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bag files of ROS 1 (``.bag``, format 2.0), read by rosbags within limits; messages become those of ROS 2."""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import lz4.frame  # type: ignore[import-untyped]
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Header, RecordType
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagMessage, Content, Definition, Extent, Topic, require_small
from soilmoist_ros.recording.bag.scan import MAX_CHUNK_BYTES

MAGIC: Final = b"#ROSBAG V2.0\n"
ROS1: Final = "ros1msg"  # encoding of definitions of ROS 1


class Ros1File:
    """A bag file of ROS 1, see :class:`.Storage`. ``InputError`` if not closed, ``ValueError`` if damaged."""

    def __init__(self, path: Path) -> None:
        _require_index(path)
        self._path = path
        self._reader = Reader(path)
        with _faults():
            self._reader.open()
        for place, chunk in self._reader.chunks.items():
            limited = partial(_unpacked, chunk.decompressor)
            self._reader.chunks[place] = chunk._replace(decompressor=limited)
        counts: Counter[str] = Counter()
        topics: dict[str, Topic] = {}
        for one in self._reader.connections:
            name = _name(one)
            topics[name] = Topic(name, Definition(one.msgtype, one.msgdef.data, ROS1))
            counts[name] += sum(info.connection_counts.get(one.id, 0) for info in self._reader.chunk_infos)
        total = counts.total()
        extent = Extent(total, self._reader.start_time, self._reader.end_time - 1) if total else Extent()
        self.content = Content(list(topics.values()), counts, extent)
        self._read: Counter[str] = Counter()

    def messages(
        self, topics: Collection[str] | None, by_time: bool = True, convert: bool = True
    ) -> Iterator[BagMessage]:
        """Messages in the order of time, since no recorder of this package wrote them; see :class:`.Storage`."""
        wanted = [one for one in self._reader.connections if topics is None or _name(one) in topics]
        if not wanted:  # rosbags would read all
            return
        self._read.clear()
        with _faults():
            for one, time_ns, data in self._reader.messages(wanted):
                name = _name(one)
                self._read[name] += 1
                if convert:
                    data = converted(name, one.msgtype, one.msgdef.data, data)
                yield BagMessage(name, one.msgtype, time_ns, data)

    def problems(self) -> list[str]:
        """Numbers of messages that differ from those of the index."""
        return [
            f"{name} has {self._read[name]} messages, and the index of {self._path.name} says {count}"
            for name, count in self.content.counts.items()
            if self._read[name] != count
        ]

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


def _name(connection: Any) -> str:
    return f"/{connection.topic.strip('/')}"


@contextmanager
def _faults() -> Iterator[None]:
    """Raise what rosbags raises for damaged files as the errors of a damaged file."""
    try:
        yield
    except (ReaderError, AssertionError, struct.error, LookupError, EOFError) as error:
        raise ValueError(f"is damaged: {error}") from None


def _require_index(path: Path) -> None:
    """Check the head of a file: ``InputError`` if it was not closed, ``ValueError`` if it is no bag of ROS 1."""
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


def _unpacked(rosbags: Callable[[bytes], bytes], data: bytes) -> bytes:
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
    return data


@cache
def _store_of(topic: str, type_name: str, definition: str) -> Any:
    """Types of ROS 2 with that of a topic; a type that ROS 2 does not have is taken from its definition.

    :raises ValueError: if the type has other fields in ROS 2: its bytes mean something else there
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    try:
        types = get_types_from_msg(definition, type_name) if len(definition) < 1 << 20 else {}
    except Exception as error:  # a stranger's definition: rosbags does not check everything
        raise ValueError(f"{topic} has a damaged definition of {type_name}: {error!s:.80}") from None
    if type_name not in types:
        raise ValueError(f"{topic} has no definition of {type_name}")
    new = {}
    for name, (consts, fields) in types.items():
        if name not in store.fielddefs:
            new[name] = consts, fields
        # the header has a number seq in ROS 1, which ROS 2 dropped; time and duration have the layout of ROS 2
        elif name != "std_msgs/msg/Header" and str(list(store.fielddefs[name][1])) != str(list(fields)):
            raise ValueError(f"{topic}: the type {name} of ROS 1 has other fields in ROS 2")
    require_small({**store.fielddefs, **new}, new)
    store.register(new)
    return store


def converted(topic: str, type_name: str, definition: str, data: bytes) -> bytes:
    """A message of ROS 1 in CDR; raises ``ValueError`` if it is damaged, or its type has other fields in ROS 2."""
    store = _store_of(topic, type_name, definition)
    try:
        return bytes(store.ros1_to_cdr(data, type_name))
    except Exception as error:  # a stranger's data: rosbags does not check everything
        raise ValueError(f"{topic}: a message is damaged: {error}") from None
