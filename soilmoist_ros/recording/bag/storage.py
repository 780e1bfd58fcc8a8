# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag: MCAP, SQLite, ROS 1, also compressed. They may come from a stranger."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, Final, Protocol

import zstandard

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import (
    BagMessage,
    Content,
    Definition,
    Extent,
    Topic,
    joined,
    qos_from_yaml,
)
from soilmoist_ros.recording.bag.recorder import NUMBER
from soilmoist_ros.recording.bag.ros1 import ROS1, Ros1File, converted
from soilmoist_ros.recording.bag.scan import MAX_CHUNK_BYTES, McapScan
from soilmoist_ros.recording.bag.writer import is_being_written

METADATA: Final = "metadata.yaml"
MAX_UNPACKED: Final = 1000  # size of a file relative to its compressed size beyond which it was made to do harm
_PIECE: Final = 1 << 20
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
FAULTS: Final = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    sqlite3.Error,
    zstandard.ZstdError,
    MemoryError,
    RecursionError,
)
"""Errors of a file that is damaged, or not what its name says."""


class Storage(Protocol):
    """A file of a bag."""

    @property
    def content(self) -> Content:
        """Topics and messages of the file."""

    def messages(
        self, topics: Collection[str] | None, by_time: bool = True, convert: bool = True
    ) -> Iterator[BagMessage]:
        """Messages of topics, or of all.

        :param by_time: in the order of time, or else in the order in which they were written
        :param convert: whether those of ROS 1 become those of ROS 2
        :raises ValueError: if the file is damaged, unless it has :meth:`problems` that say so
        """

    def problems(self) -> list[str]:
        """Problems of the file, in words; complete after all messages were read."""

    def close(self) -> None:
        """Close the file."""


def open_file(path: Path, stack: ExitStack) -> Storage:
    """A file of a bag by its kind, unpacked if it was compressed as a whole; the stack closes it."""
    if path.suffix == ".zstd":
        path = unpacked(path, Path(stack.enter_context(TemporaryDirectory())) / path.stem)
    kinds: dict[str, Any] = {".bag": Ros1File, ".db3": _SqliteFile}
    storage: Storage = kinds.get(path.suffix, _McapFile)(path)
    stack.callback(storage.close)
    return storage


def remedy_of(path: Path) -> str:
    """Remedy for a damaged bag, by the kind of its files."""
    kinds = {path.suffix} if path.is_file() else {file.suffix for file in path.glob("*")}
    return next((remedy for kind, remedy in _REMEDIES.items() if kind in kinds), _RECOVER)


def inside(folder: Path, path: Path) -> Path:
    """The path, if it is a file of this folder and no link out of it; raises ``InputError`` otherwise."""
    if not path.resolve().is_relative_to(folder.resolve()):
        remedy = "copy the file into the folder if it belongs to the bag, or remove the link"
        raise InputError(f"is a link to a file outside of its bag: {path.resolve()}", remedy, path)
    return path


def read_metadata(folder: Path) -> dict[str, Any]:
    """Content of ``metadata.yaml`` of a bag; ``InputError``, ``OSError`` or ``ValueError`` if it has faults."""
    from soilmoist_ros.foundation import parse_yaml

    path = inside(folder, folder / METADATA)
    with path.open("rb") as file:
        text = file.read(4 << 20).decode()
    content = parse_yaml(text, path)
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
    return {str(name): str(value) for name, value in notes if name not in (NUMBER, "closed_s")}


def listed_files(folder: Path) -> list[Path]:
    """The files that ``metadata.yaml`` lists, in the order of recording; people may have unpacked them before."""
    metadata = read_metadata(folder)
    mode, packing = (str(metadata.get(f"compression_{what}") or "").lower() for what in ("mode", "format"))
    if mode in ("file", "message") and packing != "zstd":
        raise ValueError(f"compression {packing!r} is not supported")
    files = [inside(folder, folder / PurePath(name).name) for name in metadata["relative_file_paths"]]
    plain = [inside(folder, file.with_suffix("")) if file.suffix == ".zstd" else file for file in files]
    files = [one if one.is_file() else file for one, file in zip(plain, files, strict=True)]
    if missing := [file.name for file in files if not file.is_file()]:
        raise ValueError(f"files are missing: {', '.join(missing)}")
    return files


def unpacked(source: Path, target: Path) -> Path:
    """Unpack a file that was compressed as a whole, and return its new path."""
    left = MAX_UNPACKED * source.stat().st_size + MAX_CHUNK_BYTES
    with source.open("rb") as packed, target.open("wb") as out:
        unpacker = zstandard.ZstdDecompressor(max_window_size=2 * MAX_CHUNK_BYTES)
        reader = unpacker.stream_reader(packed, read_across_frames=True)
        while piece := reader.read(_PIECE):
            left -= len(piece)
            if left < 0:
                raise ValueError("it unpacks to far more than a recording of its size can")
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


class _McapFile:
    """An MCAP file, see :class:`Storage`. If it was not closed, its complete messages are read."""

    def __init__(self, path: Path) -> None:
        self._scan = McapScan(path)

    @cached_property
    def content(self) -> Content:
        scan = McapScan(self._scan.path)
        if scan.read_summary() and scan.statistics is not None:
            numbers, topics = scan.statistics, {key: _as_ros2(one) for key, one in scan.topics().items()}
            counts = Counter(dict.fromkeys((one.name for one in topics.values()), 0))
            for number, topic in topics.items():
                counts[topic.name] += numbers.channel_message_counts.get(number, 0)
            total = counts.total()
            extent = Extent(total, numbers.message_start_time, numbers.message_end_time) if total else Extent()
            return Content(list(topics.values()), counts, extent)
        content = Content()
        for message in scan.messages():
            content.counts[message.topic.name] += 1
            content.extent = content.extent.with_message(message.log_ns)
        content.topics = list(map(_as_ros2, scan.topics().values()))
        _require_whole(scan)
        return content

    def messages(
        self, topics: Collection[str] | None, by_time: bool = True, convert: bool = True
    ) -> Iterator[BagMessage]:
        scan = self._scan = McapScan(self._scan.path)
        for message in scan.sorted_messages(topics) if by_time else scan.messages(topics):
            topic, data = _as_ros2(message.topic), message.data
            kind = topic.definition.type_name
            if topic.definition.encoding != ROS1:
                data = plain_message(data)
            elif convert:
                data = converted(topic.name, kind, topic.definition.text, data)
            yield BagMessage(topic.name, kind, message.log_ns, data)
        if convert:
            _require_whole(scan)

    def problems(self) -> list[str]:
        return findings(self._scan)

    def close(self) -> None:
        pass


def _require_whole(scan: McapScan) -> None:
    if found := findings(scan):
        raise ValueError(found[0])


def findings(scan: McapScan) -> list[str]:
    """Problems of a scanned file, in words."""
    name, found = scan.path.name, []
    if is_being_written(scan.path):
        found.append(f"{name} is still being recorded")
    elif not scan.finished:
        cut = f"; its last {scan.cut_bytes} bytes are an incomplete message" if scan.cut_bytes else ""
        found.append(f"{name} was not closed{cut}")
    if scan.too_large:
        chunks = f"{scan.too_large} chunk{'s'[: scan.too_large > 1]}"
        found.append(f"{name} has {chunks} of more than {MAX_CHUNK_BYTES >> 20} MB: not read")
    if scan.damaged:
        found.append(f"{name} is damaged in {scan.damaged} place{'s'[: scan.damaged > 1]}")
    return found


class _SqliteFile:
    """A file of rosbag2's older storage, see :class:`Storage`."""

    def __init__(self, path: Path) -> None:
        log = path.with_name(f"{path.name}-wal")
        if log.is_file() and log.stat().st_size:  # to read both, SQLite would write
            message = f"{log.name} has messages that it lacks: it is being recorded, or its recorder was killed"
            merge = 'sqlite3 COPY.db3 "PRAGMA wal_checkpoint(TRUNCATE)"'
            raise InputError(message, f"copy both files, and merge the copies: {merge}", path)
        self._path = path
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        self._base = sqlite3.connect(uri, uri=True, check_same_thread=False)
        try:
            self._read_topics()
        except BaseException:
            self.close()
            raise

    def _read_topics(self) -> None:
        self._base.execute("PRAGMA trusted_schema=OFF")
        self._base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)
        tables = {name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type='table'")}
        if not {"messages", "topics"} <= tables:
            raise ValueError("is not a bag of rosbag2")
        definitions: dict[str, Definition] = {}
        if "message_definitions" in tables:
            wanted = "topic_type, encoded_message_definition, encoding, type_description_hash"
            rows = self._base.execute(f"SELECT {wanted} FROM message_definitions")
            definitions = {str(row[0]): Definition(*map(str, row)) for row in rows}
        known = {row[1] for row in self._base.execute("PRAGMA table_info(topics)")}
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
        for number, count, *times in rows:
            if number in self._topics:
                self.content.counts[self._topics[number].name] += count
                self.content.extent = joined([self.content.extent, Extent(count, *map(_time_ns, times))])

    def messages(
        self, topics: Collection[str] | None, by_time: bool = True, convert: bool = True
    ) -> Iterator[BagMessage]:
        wanted = {n: topic for n, topic in self._topics.items() if topics is None or topic.name in topics}
        marks = ", ".join("?" * len(wanted))
        where = f"WHERE topic_id IN ({marks}) ORDER BY {'timestamp, ' if by_time else ''}id"
        rows = self._base.execute(f"SELECT topic_id, timestamp, data FROM messages {where}", tuple(wanted))
        for number, time_ns, data in rows:
            if not isinstance(data, bytes):
                raise ValueError("a message has no data")
            topic = wanted[number]
            yield BagMessage(topic.name, topic.definition.type_name, _time_ns(time_ns), plain_message(data))

    def problems(self) -> list[str]:
        """A problem if the file is shorter than its header says: SQLite reads zeros there."""
        with self._path.open("rb") as stream:
            header = stream.read(100)
        page, pages = (int.from_bytes(header[at : at + size]) for at, size in ((16, 2), (28, 4)))
        size, there = (page if page > 1 else 1 << 16) * pages, self._path.stat().st_size
        valid = header[24:28] == header[92:96]  # older versions of SQLite do not write the number of pages
        return [f"{self._path.name} was cut: it has {there} of {size} bytes"] if valid and there < size else []

    def close(self) -> None:
        self._base.close()


def _time_ns(value: Any) -> int:
    """A time of SQLite, whose columns may have values of any type [ns since 1970-01-01 UTC]."""
    if type(value) is not int or value < 0:
        raise ValueError(f"a message has the time {value!r:.30}")
    return value
