# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads every message of a bag, compares them with the metadata, and recovers what is whole."""

from __future__ import annotations

import re
import shutil
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path, PurePath
from typing import Final

import numpy as np

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagMessage, Extent, TimedMessage, joined
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.bag.storage import (
    METADATA,
    messages_of,
    open_file,
    plain_message,
    read_metadata,
    recorder_notes,
    remedy_of,
    scanned_messages,
    topic_name,
    unpacked,
    unreadable,
)
from soilmoist_ros.recording.bag.writer import BagWriter, is_being_written

_PATTERNS: Final = ("*.bag", "*.mcap", "*.mcap.zstd", "*.db3", "*.db3.zstd")
_STORAGES: Final = {".mcap": "mcap", ".db3": "sqlite3", ".bag": "ROS 1"}


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag; the median and the longest time between messages are ``None`` for fewer than two.

    ``silent_from_s`` is when the longest time began [s since 1970-01-01 UTC].
    """

    name: str
    type_name: str
    extent: Extent
    size_bytes: int
    interval_s: float | None
    silent_s: float | None
    silent_from_s: float | None


@dataclass(frozen=True)
class BagInfo:
    """A bag that was read as a whole.

    :param notes: what the recorder has noted, such as the number of messages that it lost
    """

    path: Path
    storage: str  # mcap, sqlite3 or ROS 1
    size_bytes: int
    extent: Extent
    topics: tuple[TopicInfo, ...]
    files: tuple[str, ...]
    recording: bool
    problems: tuple[str, ...]  # why it is not whole, in words, with a remedy; empty if it is
    remedy: str
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """True if it has no problems."""
        return not self.problems

    def __repr__(self) -> str:
        return f"<BagInfo {self.path}: {self.extent.messages} messages of {len(self.topics)} topics>"


def bag_info(path: Path) -> BagInfo:
    """Read every message of a bag, and say what it has and whether it is whole; it may still be recorded.

    :param path: folder of a bag, or one of its files, which is not compared with metadata
    :raises InputError: if there is no bag, or the only file cannot be read
    """
    times: dict[tuple[str, str], array[int]] = {}  # the numbers only: there may be many messages
    sizes: Counter[tuple[str, str]] = Counter()
    paths = files_of(path)
    storage = _STORAGES[Path(_plain(paths[0].name)).suffix] if paths else "mcap"
    problems = [f"{file.name} was not closed" for file in path.glob("*.bag.active")]
    for file in paths:
        extent = Extent()
        try:
            for name, kind, log_ns, data in _messages(file, problems):
                extent = extent.with_message(log_ns)
                times.setdefault((name, kind), array("Q")).append(log_ns)
                sizes[name, kind] += len(data)
        except Exception as error:  # a stranger's file: rosbags does not check everything
            if not path.is_dir() and not extent.messages:
                raise unreadable(path, error) from None
            problems.append(f"{file.name} cannot be read: {_text(error)}" if not extent.messages else _text(error))
    try:
        recording = any(file.suffix == ".mcap" and is_being_written(file) for file in paths)
        topics = tuple(_topic_info(*key, times[key], sizes[key]) for key in sorted(times))
        if path.is_dir() and not recording:
            problems += _compared(path, [file.name for file in paths], topics, required=storage != "ROS 1")
    except OSError as error:
        raise unreadable(path, error) from None
    remedy = "" if not problems else "stop the recorder" if recording else remedy_of(path)
    if not recording and any(problem.endswith(" is missing") and METADATA not in problem for problem in problems):
        remedy = "copy the missing files into the folder of the bag, if they still exist"
    return BagInfo(
        path,
        storage,
        sum(file.stat().st_size for file in paths),
        joined([topic.extent for topic in topics]),
        topics,
        tuple(file.name for file in paths),
        recording,
        tuple(problems),
        remedy,
        recorder_notes(path),
    )


def _messages(file: Path, problems: list[str]) -> Iterator[BagMessage]:
    """Messages of a file in any condition; its problems are added to those of the bag."""
    with ExitStack() as stack:
        path = unpacked(file, stack)
        if path.suffix != ".mcap":
            yield from messages_of(open_file(path, stack))
            return
        scan = McapScan(path)
        yield from scanned_messages(scan)
        problems += scan.findings()


def _topic_info(name: str, type_name: str, times: array[int], size_bytes: int) -> TopicInfo:
    stamps_ns = np.sort(np.frombuffer(times, np.uint64))
    extent = Extent(len(times), int(stamps_ns[0]), int(stamps_ns[-1]))
    steps_s = np.diff(stamps_ns * 1e-9)
    if not len(steps_s):
        return TopicInfo(name, type_name, extent, size_bytes, None, None, None)
    longest = int(np.argmax(steps_s))
    silent = float(steps_s[longest]), float(stamps_ns[longest] * 1e-9)
    return TopicInfo(name, type_name, extent, size_bytes, float(np.median(steps_s)), *silent)


def files_of(path: Path) -> list[Path]:
    """The files of a bag in the order of recording; none in a folder with metadata only.

    :raises InputError: if there is no bag
    """
    give = "give the folder of a bag or an MCAP file"
    if path.is_file() and Path(_plain(path.name)).suffix in _STORAGES:
        return [path]
    if not path.exists():
        raise InputError("there is no such bag", give, path)
    # computers of Apple add a file of their own to each on a foreign disk
    found = [one for pattern in _PATTERNS for one in path.glob(pattern) if not one.name.startswith("._")]
    names = {file.name for file in found}  # a file and its copy that was unpacked are one
    found = [file for file in found if not (file.suffix == ".zstd" and _plain(file.name) in names)]
    if not found and not (path / METADATA).is_file():
        active = path.suffix == ".active" or any(path.glob("*.bag.active"))
        raise InputError("is not a bag", remedy_of(path) if active else give, path)
    return sorted(found, key=_split_number)


def _compared(bag: Path, files: list[str], topics: tuple[TopicInfo, ...], required: bool) -> list[str]:
    """Differences of a bag from its metadata, in words.

    The numbers of messages by topic decide. What recorders are known to write wrongly does not: numbers by file,
    and the duration of a split bag.
    """
    if not (bag / METADATA).is_file():
        return [f"{METADATA} is missing"] if required else []
    said, counts = Counter[str](), Counter[str]()
    try:
        metadata = read_metadata(bag)
        listed = [PurePath(name).name for name in metadata["relative_file_paths"]]
        for one in metadata["topics_with_message_count"] or ():
            said[topic_name(str(one["topic_metadata"]["name"]))] += int(one["message_count"])
    except (InputError, LookupError, TypeError, ValueError, AttributeError) as error:
        return [f"{METADATA} cannot be read: {_text(error)}"]
    there = list(map(_plain, files))
    problems = [f"{name} is missing" for name in listed if _plain(name) not in there]
    problems += [f"{name} is not in {METADATA}" for name in there if name not in map(_plain, listed)]
    for topic in topics:
        counts[topic_name(topic.name)] += topic.extent.messages
    wrong = [name for name in sorted(counts.keys() | said.keys()) if counts[name] != said[name]]
    problems += [f"{name} has {counts[name]} messages, and {METADATA} says {said[name]}" for name in wrong]
    return list(dict.fromkeys(problems))


def _plain(name: str) -> str:
    return name.removesuffix(".zstd")


def _text(error: BaseException) -> str:
    return error.mistakes[0].message if isinstance(error, InputError) else f"{error}"


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else -1, path.name)


def recover_bag(path: Path, out: Path) -> tuple[str, ...]:
    """Write every complete message of a bag, or an MCAP file, to a new folder, as a bag that any reader accepts.

    :returns: the problems of the source
    :raises InputError: if nothing can be read, or the new bag cannot be written
    """
    files = files_of(path)
    scans = [McapScan(file) for file in files if file.suffix == ".mcap"]
    if not scans:
        kinds = ", ".join(sorted({file.suffix for file in files}))
        raise InputError(f"holds no MCAP file{', only ' * bool(kinds)}{kinds}", remedy_of(path), path)
    messages = chain.from_iterable(map(_readable, scans))
    first = next(messages, None)
    if first is None:
        raise InputError("holds no complete message", "nothing can be recovered: remove it", path)
    writer = BagWriter(out)
    try:
        with writer:
            for message in chain([first], messages):
                writer.write(message.topic, message.log_ns, message.publish_ns, plain_message(message.data))
    except (InputError, OSError) as error:
        shutil.rmtree(out, ignore_errors=True)
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be written: {error.strerror}", "choose a disk with more space", out) from None
    return bag_info(path).problems if path.is_dir() else tuple(scans[0].findings())


def _readable(scan: McapScan) -> Iterator[TimedMessage]:
    try:
        yield from scan.messages()
    except OSError as error:
        remedy = "check the disk and permissions; a failing disk: copy the file by ddrescue, and recover the copy"
        raise InputError(f"cannot be read: {error.strerror}", remedy, scan.path) from None
