# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag (MCAP, SQLite, ROS 1, also compressed), opened by rosbags, and its ``metadata.yaml``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from operator import attrgetter
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import zstandard
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    TopicInfo,
)

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagMessage, Extent, Qos, Topic, qos_of
from soilmoist_ros.recording.bag.scan import McapScan, profile_of

METADATA: Final = "metadata.yaml"
_RECOVER: Final = "soilmoist bag recover"
_REINDEX: Final = "rosbag fix or rosbag reindex (ROS 1)"
_REMEDIES: Final = {
    ".zstd": f"unpack its files with unzstd, also those that were cut; then {_RECOVER} (MCAP) or ros2 bag reindex "
    "(SQLite)",
    ".mcap": _RECOVER,
    ".db3": "ros2 bag reindex writes metadata.yaml anew; a damaged file may be read by .recover of sqlite3",
    ".bag": _REINDEX,
    ".active": _REINDEX,
}


def unpacked(path: Path, stack: ExitStack) -> Path:
    """The path of a file; of one that was compressed as a whole, that of its content until the stack closes."""
    if path.suffix != ".zstd":
        return path
    target = Path(stack.enter_context(TemporaryDirectory())) / path.stem
    with path.open("rb") as packed, target.open("wb") as out:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        while piece := reader.read(1 << 20):
            out.write(piece)
    return target


class ScannedFile:
    """MCAP file that is read from its beginning to its end, as a reader of rosbags, which refuses it.

    Its profile is not ``ros2`` (ROS 1, or a tool without profiles), or it has no index, as those written fast.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._scan = path, McapScan(path)
        counts, extent, topics = Counter[str](), Extent(), dict[str, Topic]()
        for message in self._scan.messages():
            counts[message.topic.name] += 1
            topics[message.topic.name] = message.topic
            extent = extent.with_message(message.log_ns)
        if found := self._scan.findings():
            raise ValueError("; ".join(found))
        self.of_ros1 = any(topic.definition.encoding == "ros1msg" for topic in topics.values())
        self.message_count, self.start_time, self.end_time = extent.messages, extent.start_ns, extent.end_ns + 1
        self.offered = {name: topic.offered for name, topic in topics.items()}
        self.connections: list[Connection] = []
        for name, topic in topics.items():
            about, number = topic.definition, len(self.connections)
            form = MessageDefinitionFormat.IDL if about.encoding == "ros2idl" else MessageDefinitionFormat.MSG
            text, ext = MessageDefinition(form, about.text), ConnectionExtRosbag2("", [])
            kind = _full_type(about.type_name)
            self.connections.append(Connection(number, name, kind, text, "", counts[name], ext, self))
        self.topics = {
            one.topic: TopicInfo(one.msgtype, one.msgdef, one.msgcount, [one]) for one in self.connections
        }

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages of connections in the order of time, each with its time of receipt [ns]."""
        wanted = {one.topic: one for one in connections}
        found = sorted(self._scan.messages(wanted.keys()), key=attrgetter("log_ns"))
        return ((wanted[one.topic.name], one.log_ns, one.data) for one in found)


if TYPE_CHECKING:  # the readers of rosbags take 15 MB, and nodes import this module
    from rosbags import rosbag1, rosbag2

    BagFileReader: TypeAlias = rosbag1.Reader | rosbag2.Reader | ScannedFile
    """Reader of one file."""


def _full_type(name: str) -> str:
    """Name of a type as in ROS 2; ROS 1 has no ``msg`` in it."""
    package, _, kind = name.partition("/")
    return name if "/" in kind or not kind else f"{package}/msg/{kind}"


def open_file(path: Path, stack: ExitStack) -> BagFileReader:
    """A file of a bag, by its kind; the stack closes it. Raises what rosbags raises for a damaged file."""
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag2.storage_mcap import McapReader

    path = unpacked(path, stack)
    if path.suffix == ".db3":
        _require_whole_database(path)
    if path.suffix == ".bag":
        return stack.enter_context(rosbag1.Reader(path))
    if path.suffix == ".mcap" and profile_of(path) != "ros2":
        return ScannedFile(path)
    reader = stack.enter_context(rosbag2.Reader(path))
    unindexed = isinstance(reader.storage, McapReader) and not reader.storage.chunks
    return ScannedFile(path) if unindexed and reader.message_count else reader


def topic_name(name: str) -> str:
    """Full name of a topic; bags of ROS 1 may lack the first slash."""
    return f"/{name.strip('/')}"


def counts_of(reader: BagFileReader) -> Counter[str]:
    """Number of messages by topic, as the index of a file says."""
    return Counter({topic_name(name): about.msgcount for name, about in reader.topics.items()})


def messages_of(reader: BagFileReader, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
    """Messages of topics, or of all, in the order of time.

    :raises ValueError: after the last message if the index of the file says another number
    """
    wanted = [one for one in reader.connections if topics is None or topic_name(one.topic) in topics]
    read = Counter[str]()
    for one, log_ns, data in reader.messages(wanted) if wanted else ():  # without a choice it reads all
        name = topic_name(one.topic)
        read[name] += 1
        yield BagMessage(name, one.msgtype, log_ns, plain_message(bytes(data)))
    said = counts_of(reader)
    for name in {topic_name(one.topic): None for one in wanted}:
        if read[name] != said[name]:
            file = Path(str(reader.path)).name
            raise ValueError(f"{name} has {read[name]} messages, and the index of {file} says {said[name]}")


def offered_of(reader: BagFileReader, connection: Connection) -> tuple[Qos, ...]:
    """Quality of service that the publishers of a connection offered, if the file has it."""
    if isinstance(reader, ScannedFile):
        return reader.offered[connection.topic]
    return tuple(map(qos_of, getattr(connection.ext, "offered_qos_profiles", ())))


def scanned_messages(scan: McapScan, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
    """Messages of topics, or of all, of a file in any condition, in the order of writing."""
    for one in scan.messages(topics):
        yield BagMessage(one.topic.name, one.topic.definition.type_name, one.log_ns, one.data)


def extent_of(reader: BagFileReader) -> Extent:
    """All messages of a file."""
    count = reader.message_count
    return Extent(count, reader.start_time, reader.end_time - 1) if count else Extent()


def remedy_of(path: Path) -> str:
    """Remedy for a damaged bag, by the kind of its files."""
    kinds = {path.suffix} if path.is_file() else {file.suffix for file in path.glob("*")}
    return next((remedy for kind, remedy in _REMEDIES.items() if kind in kinds), _RECOVER)


def unreadable(path: Path, error: Exception) -> InputError:
    """An error of reading a bag in words, with the remedy for its kind."""
    if isinstance(error, InputError):
        return error
    if isinstance(error, OSError):
        return InputError(f"cannot be read: {error.strerror}", "check the disk and permissions", path)
    return InputError(f"cannot be read as a bag: {error}", remedy_of(path), path)


def read_metadata(folder: Path) -> dict[str, Any]:
    """Content of ``metadata.yaml`` of a bag; ``InputError``, ``OSError`` or ``ValueError`` if it has faults."""
    from soilmoist_ros.foundation import parse_yaml

    path = folder / METADATA
    content = parse_yaml(path.read_text(), path)
    found = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    if not isinstance(found, dict):
        raise ValueError(f"{METADATA} is not that of a bag")
    listed = found.get("relative_file_paths")
    if not isinstance(listed, list) or not listed or not all(isinstance(name, str) for name in listed):
        raise ValueError(f"{METADATA} lists no files")
    return found


def recorder_notes(path: Path) -> dict[str, str]:
    """Losses that the recorder of a bag has noted; empty if there is nothing that can be read."""
    if not (path / METADATA).is_file():
        return {}
    try:
        found = read_metadata(path).get("custom_data")
    except (InputError, ValueError, OSError):
        return {}
    notes = found.items() if isinstance(found, dict) else ()
    of_earlier_releases = ("number", "closed_s")  # no losses
    return {str(name): str(value) for name, value in notes if name not in of_earlier_releases}


def listed_files(folder: Path) -> list[Path]:
    """The files that ``metadata.yaml`` lists, in the order of recording; people may have unpacked them before."""
    found = []
    for name in read_metadata(folder)["relative_file_paths"]:
        file = folder / PurePath(name).name
        plain = file.with_suffix("") if file.suffix == ".zstd" else file
        found.append(plain if plain.is_file() else file)
    if missing := [file.name for file in found if not file.is_file()]:
        raise ValueError(f"files are missing: {', '.join(missing)}")
    return found


def plain_message(data: bytes) -> bytes:
    """A message, unpacked if it was compressed alone; the first byte of one of ROS 2 is always 0."""
    packed = data.startswith(zstandard.FRAME_HEADER)
    return zstandard.ZstdDecompressor().decompressobj().decompress(data) if packed else data


def _require_whole_database(path: Path) -> None:
    """Refuse a file of SQLite without its latest messages, or its end, where SQLite reads zeros."""
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:  # to read both, SQLite would write
        message = f"{log.name} has messages that it lacks: it is being recorded, or its recorder was killed"
        merge = 'sqlite3 COPY.db3 "PRAGMA wal_checkpoint(TRUNCATE)"'
        raise InputError(message, f"copy both files, and merge the copies: {merge}", path)
    with path.open("rb") as stream:
        header = stream.read(100)
    page, pages = (int.from_bytes(header[at : at + size]) for at, size in ((16, 2), (28, 4)))
    size, there = (page if page > 1 else 1 << 16) * pages, path.stat().st_size
    knows = header[24:28] == header[92:96]  # older versions of SQLite do not write the number of pages
    if knows and there < size:
        raise ValueError(f"{path.name} was cut: it has {there} of {size} bytes")
