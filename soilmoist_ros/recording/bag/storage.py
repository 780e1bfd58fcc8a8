# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, read within limits: MCAP, SQLite, ROS 1, also compressed. It may come from a stranger."""

from __future__ import annotations

import contextlib
import sqlite3
import tempfile
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any, Final, Protocol

import zstandard

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.chunks import MAX_CHUNK_BYTES, Allowance, TooMuchError
from soilmoist_ros.recording.bag.metadata import Content, Definition, Extent, Topic, qos_from_yaml
from soilmoist_ros.recording.bag.retention import CLOSED_S, NUMBER
from soilmoist_ros.recording.bag.ros1 import ROS1, Connection, Message, Ros1File, converted
from soilmoist_ros.recording.bag.scan import McapScan

TOO_MUCH: Final = "unpacks to far more than a recording of its size can: it is damaged, or was made to do harm"
_PIECE: Final = 1 << 20
_RECOVER: Final = "soilmoist bag recover"
_REINDEX: Final = "rosbag fix or rosbag reindex (ROS 1)"
_REMEDIES: Final = {
    ".zstd": "unpack its files with unzstd, which unpacks a part of one that was cut; then soilmoist bag recover "
    "(MCAP) or ros2 bag reindex (SQLite), which reads no packed files",
    ".mcap": _RECOVER,
    ".db3": "ros2 bag reindex writes metadata.yaml anew; a damaged file may be read by .recover of sqlite3",
    ".bag": _REINDEX,
    ".active": _REINDEX,
}
_MAX_DEFAULT: Final = 100
"""Longest default of a column of SQLite: rows that lack the column do not store it, however long it is."""


class Storage(Protocol):
    """A file of a bag."""

    @property
    def content(self) -> Content:
        """What it has."""

    def messages(self, topics: Collection[str], by_time: bool = True) -> Iterator[Message]:
        """Messages of topics in the order of time, or else in the order in which they were written.

        :raises ValueError: if the file is damaged
        """

    def close(self) -> None:
        """Close the file."""


def open_storages(path: Path) -> tuple[list[Storage], contextlib.ExitStack]:
    """The files of a bag in the order of recording, and what closes them.

    :raises InputError: if there is no bag
    :raises ValueError: if it is damaged
    """
    with contextlib.ExitStack() as stack:
        files = [path] if path.is_file() else _listed(path, stack)
        storages: list[Storage] = []
        for file in files:
            one: Storage
            if file.suffix == ".bag":
                one = Ros1File(file)
            else:
                one = SqliteFile(file) if file.suffix == ".db3" else _Mcap(file)
            stack.callback(one.close)
            storages.append(one)
        return storages, stack.pop_all()


def remedy_of(path: Path) -> str:
    """Remedy for a damaged bag, by the kind of its files."""
    kinds = {path.suffix} if path.is_file() else {file.suffix for file in path.glob("*")}
    return next((remedy for kind, remedy in _REMEDIES.items() if kind in kinds), _RECOVER)


def inside(folder: Path, path: Path) -> Path:
    """The path, if it is a file of this folder and no link out of it.

    :raises InputError: otherwise
    """
    if not path.resolve().is_relative_to(folder.resolve()):
        remedy = "copy the file into the folder if it belongs to the bag, or remove the link"
        raise InputError(f"is a link to a file outside of its bag: {path.resolve()}", remedy, path)
    return path


def read_metadata(folder: Path) -> dict[str, Any]:
    """What ``metadata.yaml`` of a bag says.

    :raises InputError: if it is no YAML, too large, or a link to another folder
    :raises OSError: if it cannot be read
    :raises ValueError: if it is not that of a bag
    """
    from soilmoist_ros.foundation import parse_yaml

    path = inside(folder, folder / "metadata.yaml")
    with path.open("rb") as file:
        text = file.read(4 << 20).decode()
    content = parse_yaml(text, path)
    found = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    if not isinstance(found, dict):
        raise ValueError("metadata.yaml is not that of a bag")
    listed = found.get("relative_file_paths")
    if not isinstance(listed, list) or not listed or not all(isinstance(name, str) for name in listed):
        raise ValueError("metadata.yaml lists no files")
    return found


def recorder_notes(path: Path) -> dict[str, str]:
    """What the recorder of a bag has noted as lost; empty if there is nothing that can be read."""
    if not (path / "metadata.yaml").is_file():
        return {}
    try:
        found = read_metadata(path).get("custom_data")
    except (InputError, ValueError, OSError):
        return {}
    if not isinstance(found, dict):
        return {}
    return {str(name): str(value) for name, value in found.items() if name not in (NUMBER, CLOSED_S)}


def _listed(folder: Path, stack: contextlib.ExitStack) -> list[Path]:
    """The files that ``metadata.yaml`` lists, unpacked; people may have unpacked them before."""
    metadata = read_metadata(folder)
    mode, packing = (str(metadata.get(f"compression_{what}") or "").lower() for what in ("mode", "format"))
    if mode in ("file", "message") and packing != "zstd":
        raise ValueError(f"compression {packing!r} is not supported")
    files, missing, target = list[Path](), list[str](), None
    for name in metadata["relative_file_paths"]:
        file = inside(folder, folder / PurePath(name).name)
        if file.suffix == ".zstd" and file.with_suffix("").is_file():
            file = inside(folder, file.with_suffix(""))
        if not file.is_file():
            missing.append(file.name)
        elif file.suffix == ".zstd":
            target = target or Path(stack.enter_context(tempfile.TemporaryDirectory()))
            file = unpacked(file, target / file.stem)
        files.append(file)
    if missing:
        raise ValueError(f"files are missing: {', '.join(missing)}")
    return files


def unpacked(source: Path, target: Path) -> Path:
    """Unpack a file that was compressed as a whole, and return its new path."""
    allowance = Allowance(source.stat().st_size)
    with source.open("rb") as packed, target.open("wb") as out:
        reader = zstandard.ZstdDecompressor(max_window_size=2 * MAX_CHUNK_BYTES).stream_reader(
            packed, read_across_frames=True
        )
        while piece := reader.read(_PIECE):
            allowance.take(len(piece))
            out.write(piece)
    return target


def plain_message(data: bytes) -> bytes:
    """A message, unpacked if it was compressed alone; the first byte of one of ROS 2 is always 0."""
    if not data.startswith(zstandard.FRAME_HEADER):
        return data
    return zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(data).read(MAX_CHUNK_BYTES)


def _as_ros2(topic: Topic) -> Topic:
    """A topic with the name that its type has in ROS 2: ``std_msgs/msg/String``."""
    package, _, kind = topic.definition.type_name.partition("/")
    if topic.definition.encoding != ROS1 or "/" in kind:
        return topic
    return replace(topic, definition=replace(topic.definition, type_name=f"{package}/msg/{kind}"))


class _Mcap:
    def __init__(self, path: Path) -> None:
        self._path = path
        scan = McapScan(path)
        if scan.read_summary() and scan.statistics is not None:
            numbers, topics = scan.statistics, {key: _as_ros2(one) for key, one in scan.topics().items()}
            counts: dict[str, int] = {}
            for number, topic in topics.items():
                had = counts.get(topic.name, 0)
                counts[topic.name] = had + numbers.channel_message_counts.get(number, 0)
            total = sum(counts.values())
            extent = Extent(total, numbers.message_start_time, numbers.message_end_time) if total else Extent()
            self.content = Content(list(topics.values()), counts, extent)
            return
        content = Content()
        for message in scan.messages():
            name = message.topic.name
            content.counts[name] = content.counts.get(name, 0) + 1
            content.extent = content.extent.with_message(message.log_ns)
        content.topics = list(map(_as_ros2, scan.topics().values()))
        self.content = content
        self._check(scan)

    def messages(self, topics: Collection[str], by_time: bool = True) -> Iterator[Message]:
        scan = McapScan(self._path)
        for message in scan.sorted_messages() if by_time else scan.messages():
            if message.topic.name in topics:
                definition = _as_ros2(message.topic).definition
                if definition.encoding == ROS1:
                    connection = Connection(message.topic.name, definition.type_name, definition.text)
                    data = converted(connection, message.data)
                else:
                    data = plain_message(message.data)
                yield message.topic.name, definition.type_name, message.log_ns, data
        self._check(scan)

    def close(self) -> None:
        pass

    @staticmethod
    def _check(scan: McapScan) -> None:
        if scan.too_much:
            raise ValueError(TOO_MUCH)
        if scan.too_large:
            raise ValueError(f"{scan.path.name} has chunks of more than {MAX_CHUNK_BYTES >> 20} MB")
        if scan.damaged:
            raise ValueError(f"{scan.path.name} is damaged in {scan.damaged} places")
        if not scan.finished:
            raise ValueError(f"{scan.path.name} was not closed")


class SqliteFile:
    """A file of rosbag2's older storage."""

    def __init__(self, path: Path) -> None:
        log = path.with_name(f"{path.name}-wal")
        if log.is_file() and log.stat().st_size:  # to read both, SQLite would write
            message = f"{log.name} has messages that it lacks: it is being recorded, or its recorder was killed"
            merge = 'sqlite3 COPY.db3 "PRAGMA wal_checkpoint(TRUNCATE)"'
            raise InputError(message, f"copy both files, and merge the copies: {merge}", path)
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        self._base = sqlite3.connect(uri, uri=True, check_same_thread=False)
        self._base.execute("PRAGMA trusted_schema=OFF")
        self._base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)
        tables = {name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type='table'")}
        if not {"messages", "topics"} <= tables:
            raise ValueError("is not a bag of rosbag2")
        columns = {
            name: self._base.execute(f"PRAGMA table_xinfo({name})").fetchall()
            for name in tables & {"messages", "topics", "message_definitions"}
        }
        for name, described in columns.items():
            if any(hidden or len(default or "") > _MAX_DEFAULT for *_, default, _, hidden in described):
                raise ValueError(f"the table {name} has values that are not in the file")
        definitions: dict[str, Definition] = {}
        if "message_definitions" in tables:
            wanted = "topic_type, encoded_message_definition, encoding, type_description_hash"
            rows = self._base.execute(f"SELECT {wanted} FROM message_definitions")
            definitions = {str(row[0]): Definition(*map(str, row)) for row in rows}
        known = {row[1] for row in columns["topics"]}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in known else "''"
        self._topics: dict[int, Topic] = {}
        self.content = Content()
        for number, name, kind, offered in self._base.execute(f"SELECT id, name, type, {qos} FROM topics"):
            definition = definitions.get(str(kind), Definition(str(kind), ""))
            self._topics[number] = topic = Topic(str(name), definition, qos_from_yaml(str(offered)))
            self.content.topics.append(topic)
            self.content.counts[topic.name] = 0
        rows = self._base.execute(
            "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY 1"
        )
        for number, count, first, last in rows:
            if number in self._topics:
                self.content.counts[self._topics[number].name] += count
                had = self.content.extent.with_message(_time_ns(first)).with_message(_time_ns(last))
                self.content.extent = Extent(had.messages + count - 2, had.start_ns, had.end_ns)

    def messages(self, topics: Collection[str], by_time: bool = True) -> Iterator[Message]:
        """See :class:`Storage`."""
        wanted = {number: topic for number, topic in self._topics.items() if topic.name in topics}
        marks = ", ".join("?" * len(wanted))
        where = f"WHERE topic_id IN ({marks}) ORDER BY {'timestamp, ' if by_time else ''}id"
        rows = self._base.execute(f"SELECT topic_id, timestamp, data FROM messages {where}", tuple(wanted))
        for number, time_ns, data in rows:
            if not isinstance(data, bytes):
                raise ValueError("a message has no data")
            yield wanted[number].name, wanted[number].definition.type_name, _time_ns(time_ns), plain_message(data)

    def close(self) -> None:
        """See :class:`Storage`."""
        self._base.close()


def _time_ns(value: Any) -> int:
    """A time of SQLite, whose columns may have values of any type [ns since 1970-01-01 UTC]."""
    if type(value) is not int or value < 0:
        raise ValueError(f"a message has the time {value!r:.30}")
    return value


FAULTS: Final = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    sqlite3.Error,
    zstandard.ZstdError,
    TooMuchError,
    MemoryError,
    RecursionError,
)
"""Errors of a file that is damaged, or not what its name says."""
