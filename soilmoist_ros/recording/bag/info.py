# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The content of a bag, and its problems."""

from __future__ import annotations

import contextlib
from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.bag.recovery import findings, mcap_files
from soilmoist_ros.recording.bag.storage import FAULTS, recorder_notes
from soilmoist_ros.recording.bag.writer import is_being_written
from soilmoist_ros.recording.mcap.metadata import Extent, joined
from soilmoist_ros.recording.mcap.scan import McapScan
from soilmoist_ros.recording.ros1.bag_file import Ros1File

_REGULAR_FROM: Final = 10
_REGULAR_SHARE: Final = 0.8
_GAP_FACTOR: Final = 5.0
_MIN_GAP_S: Final = 1.0


@dataclass(frozen=True)
class Gap:
    """A silence of an otherwise regular topic.

    :param start_s: time of the last message before it [s since 1970-01-01 UTC]
    :param duration_s: its length [s]
    """

    start_s: float
    duration_s: float


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag.

    :param name: full name
    :param type_name: name of its type
    :param extent: its messages
    :param size_bytes: size of all its messages [bytes]
    :param interval_s: median time between messages [s], ``None`` for fewer than two
    :param gaps: silences, if it is regular
    """

    name: str
    type_name: str
    extent: Extent
    size_bytes: int
    interval_s: float | None
    gaps: tuple[Gap, ...]


@dataclass(frozen=True)
class BagInfo:
    """A bag.

    :param path: its folder, or its file
    :param storage: ``mcap`` or ``sqlite3``
    :param size_bytes: size of its files [bytes]
    :param extent: all messages
    :param topics: its topics, by name
    :param recording: whether it is being recorded now
    :param problems: its problems, in words
    :param remedy: what to do about the problems; empty without problems
    :param notes: what the recorder has noted, such as the number of messages that it lost
    """

    path: Path
    storage: str
    size_bytes: int
    extent: Extent
    topics: tuple[TopicInfo, ...]
    recording: bool
    problems: tuple[str, ...]
    remedy: str
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether it has no problems."""
        return not self.problems

    def __repr__(self) -> str:
        return f"<BagInfo {self.path}: {self.extent.messages} messages of {len(self.topics)} topics>"


def bag_info(path: Path) -> BagInfo:
    """Read every message of a bag, and summarise them.

    :param path: folder of a bag, or one of its files; it may be incomplete, damaged, or still being recorded
    :raises InputError: if there is no bag, or it cannot be read
    """
    files = _files(path)
    if files[0].suffix == ".bag":
        topics = _topics(_ros1_notes(files))
        return BagInfo(path, "ROS 1", _size(files), _whole(topics), topics, False, (), "")
    if files[0].suffix != ".mcap":
        return _from_reader(path, files)
    scans = [McapScan(file) for file in mcap_files(path)]
    notes = (
        (m.topic.name, m.topic.definition.type_name, m.log_ns, len(m.data)) for s in scans for m in s.messages()
    )
    topics = _topics(_checked(notes, path))
    problems = [text for scan in scans for text in findings(scan)]
    recording = any(is_being_written(scan.path) for scan in scans)
    if path.is_dir() and not recording and not (path / "metadata.yaml").is_file():
        problems.append("metadata.yaml is missing")
    remedy = "soilmoist bag recover" if problems else ""
    if recording:
        remedy = "stop the recorder"
    return BagInfo(
        path,
        "mcap",
        _size(files),
        _whole(topics),
        topics,
        recording,
        tuple(problems),
        remedy,
        recorder_notes(path),
    )


def find_gaps(times_s: ArrayLike) -> tuple[Gap, ...]:
    """Silences of a topic with regular messages; none for an irregular topic.

    A topic is regular if 80 % of its intervals are within half of the median. A silence is longer than 5 times
    the median, and longer than 1 s.

    >>> find_gaps([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20])
    (Gap(start_s=10.0, duration_s=10.0),)

    :param times_s: times of its messages, in order [s]
    """
    starts = np.asarray(times_s, float)
    intervals = np.diff(starts)
    if len(intervals) < _REGULAR_FROM:
        return ()
    usual = float(np.median(intervals))
    regular = np.count_nonzero((0.5 * usual <= intervals) & (intervals <= 1.5 * usual))
    if regular < _REGULAR_SHARE * len(intervals):
        return ()
    longest = max(_GAP_FACTOR * usual, _MIN_GAP_S)
    return tuple(Gap(float(starts[k]), float(intervals[k])) for k in np.flatnonzero(intervals > longest))


def _ros1_notes(files: Iterable[Path]) -> Iterator[tuple[str, str, int, int]]:
    """Topic, type, time and size of the messages of ROS 1, whatever their types."""
    for file in files:
        try:
            with contextlib.closing(Ros1File(file)) as bag:
                names = {one.topic for one in bag.connections.values()}
                for name, kind, log_ns, data in bag.messages(names, convert=False):
                    yield name, kind, log_ns, len(data)
        except InputError:
            raise
        except FAULTS as error:
            raise InputError(f"is damaged: {error}", "rosbag fix or rosbag reindex (ROS 1)", file) from None


def _from_reader(path: Path, files: list[Path]) -> BagInfo:
    with BagReader(path) as reader:
        storage = "sqlite3" if files[0].suffix == ".db3" or ".db3." in files[0].name else "mcap"
        notes = ((m.topic, m.type_name, m.log_ns, len(m.data)) for m in reader.messages())
        topics = _topics(notes)
    return BagInfo(path, storage, _size(files), _whole(topics), topics, False, (), "")


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    found = [
        file
        for pattern in ("*.bag", "*.mcap", "*.mcap.zstd", "*.db3", "*.db3.zstd")
        for file in path.glob(pattern)
    ]
    return sorted(found) or mcap_files(path)  # its error says what is wrong


def _topics(notes: Iterable[tuple[str, str, int, int]]) -> tuple[TopicInfo, ...]:
    times: dict[tuple[str, str], array[int]] = {}  # the numbers only: there may be many messages
    sizes: dict[tuple[str, str], int] = {}
    for name, type_name, log_ns, size in notes:
        times.setdefault((name, type_name), array("Q")).append(log_ns)
        sizes[name, type_name] = sizes.get((name, type_name), 0) + size
    topics = []
    for (name, type_name), stamps in sorted(times.items()):
        stamps_ns = np.sort(np.frombuffer(stamps, np.uint64))
        seconds = stamps_ns * 1e-9
        interval_s = float(np.median(np.diff(seconds))) if len(stamps) > 1 else None
        extent = Extent(len(stamps), int(stamps_ns[0]), int(stamps_ns[-1]))
        topics.append(TopicInfo(name, type_name, extent, sizes[name, type_name], interval_s, find_gaps(seconds)))
    return tuple(topics)


def _whole(topics: tuple[TopicInfo, ...]) -> Extent:
    return joined([topic.extent for topic in topics])


def _size(files: Iterable[Path]) -> int:
    return sum(file.stat().st_size for file in files)


def _checked(notes: Iterator[tuple[str, str, int, int]], path: Path) -> Iterator[tuple[str, str, int, int]]:
    try:
        yield from notes
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the disk and permissions", path) from None
