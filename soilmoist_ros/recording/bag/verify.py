# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads every message of a bag, compares them with metadata and checksums, and recovers what is whole."""

from __future__ import annotations

import hashlib
import re
import shutil
from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path, PurePath
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagFile, BagMessage, Extent, TimedMessage, joined
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
from soilmoist_ros.recording.bag.writer import CHECKSUMS, BagWriter, is_being_written

_PATTERNS: Final = ("*.bag", "*.mcap", "*.mcap.zstd", "*.db3", "*.db3.zstd")
_STORAGES: Final = {".mcap": "mcap", ".db3": "sqlite3", ".bag": "ROS 1"}
_SUM: Final = re.compile(r"([0-9a-f]{64}) [ *]([^/\0]+)")
_SHORT_NS: Final = 1_000_000_000
"""A bag that is shorter than its metadata say by more than this lacks messages [ns]."""
_REGULAR_FROM: Final = 10
_REGULAR_SHARE: Final = 0.8
_GAP_FACTOR: Final = 5.0
_MIN_GAP_S: Final = 1.0


@dataclass(frozen=True)
class Gap:
    """A silence of an otherwise regular topic, from the last message before it [s since 1970-01-01 UTC]."""

    start_s: float
    duration_s: float


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag; the median time between messages is ``None`` for fewer than two."""

    name: str
    type_name: str
    extent: Extent
    size_bytes: int
    interval_s: float | None
    gaps: tuple[Gap, ...]


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
    files: tuple[BagFile, ...]
    checksums: int  # number of files whose checksum is right
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
    files, problems = [], [f"{file.name} was not closed" for file in path.glob("*.bag.active")]
    for file in paths:
        extent = Extent()
        try:
            for name, kind, log_ns, data in stored_messages(file, problems):
                extent = extent.with_message(log_ns)
                times.setdefault((name, kind), array("Q")).append(log_ns)
                sizes[name, kind] += len(data)
        except Exception as error:  # a stranger's file: rosbags does not check everything
            if not path.is_dir() and not extent.messages:
                raise unreadable(path, error) from None
            problems.append(f"{file.name} cannot be read: {_text(error)}" if not extent.messages else _text(error))
        files.append(BagFile(file.name, extent))
    try:
        recording = any(file.suffix == ".mcap" and is_being_written(file) for file in paths)
        right, topics = 0, tuple(_topic_info(*key, times[key], sizes[key]) for key in sorted(times))
        if path.is_dir() and not recording:
            right, wrong = _compared(path, files, topics, required=storage != "ROS 1")
            problems += wrong
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
        tuple(files),
        right,
        recording,
        tuple(problems),
        remedy,
        recorder_notes(path),
    )


def stored_messages(
    file: Path, problems: list[str], topics: Collection[str] | None = None
) -> Iterator[BagMessage]:
    """Messages of topics, or of all, of a file in any condition; its problems are added to those of the bag."""
    with ExitStack() as stack:
        path = unpacked(file, stack)
        if path.suffix != ".mcap":
            yield from messages_of(open_file(path, stack), topics)
            return
        scan = McapScan(path)
        yield from scanned_messages(scan, topics)
        problems += scan.findings()


def find_gaps(times_s: ArrayLike) -> tuple[Gap, ...]:
    """Silences of a topic with regular messages at these times [s], in order; none for an irregular topic.

    A topic is regular if 80 % of its intervals are within half of the median. A silence is longer than 5 times
    the median, and longer than 1 s.

    >>> find_gaps([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20])
    (Gap(start_s=10.0, duration_s=10.0),)
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


def _topic_info(name: str, type_name: str, times: array[int], size_bytes: int) -> TopicInfo:
    stamps_ns = np.sort(np.frombuffer(times, np.uint64))
    seconds = stamps_ns * 1e-9
    interval_s = float(np.median(np.diff(seconds))) if len(times) > 1 else None
    extent = Extent(len(times), int(stamps_ns[0]), int(stamps_ns[-1]))
    return TopicInfo(name, type_name, extent, size_bytes, interval_s, find_gaps(seconds))


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


def _compared(
    bag: Path, files: list[BagFile], topics: tuple[TopicInfo, ...], required: bool
) -> tuple[int, list[str]]:
    """Number of files with right checksums, and what checksums and metadata say otherwise.

    The numbers of messages by topic decide. What recorders are known to write wrongly does not: numbers by file,
    and the duration of a split bag.
    """
    right, problems = _checked_sums(bag)
    if not (bag / METADATA).is_file():
        return right, [*problems, f"{METADATA} is missing"] if required else problems
    said, counts = Counter[str](), Counter[str]()
    try:
        metadata = read_metadata(bag)
        listed = [PurePath(name).name for name in metadata["relative_file_paths"]]
        for one in metadata["topics_with_message_count"] or ():
            said[topic_name(str(one["topic_metadata"]["name"]))] += int(one["message_count"])
        duration_ns = int(metadata["duration"]["nanoseconds"])
    except (InputError, LookupError, TypeError, ValueError, AttributeError) as error:
        return right, [*problems, f"{METADATA} cannot be read: {_text(error)}"]
    there = [_plain(file.name) for file in files]
    problems += [f"{name} is missing" for name in listed if _plain(name) not in there]
    problems += [f"{name} is not in {METADATA}" for name in there if name not in map(_plain, listed)]
    for topic in topics:
        counts[topic_name(topic.name)] += topic.extent.messages
    wrong = [name for name in sorted(counts.keys() | said.keys()) if counts[name] != said[name]]
    problems += [f"{name} has {counts[name]} messages, and {METADATA} says {said[name]}" for name in wrong]
    lasts_ns = joined([file.extent for file in files]).duration_ns
    if not wrong and lasts_ns < duration_ns - _SHORT_NS:
        problems.append(f"it lasts {lasts_ns * 1e-9:.1f} s, and {METADATA} says {duration_ns * 1e-9:.1f} s")
    return right, list(dict.fromkeys(problems))


def _checked_sums(bag: Path) -> tuple[int, list[str]]:
    """Number of right checksums, and what is wrong with the others."""
    path = bag / CHECKSUMS
    right, problems = 0, []
    lines = path.read_bytes().decode("utf-8", "replace") if path.is_file() else ""
    for line in lines.splitlines():
        match = _SUM.fullmatch(line)
        if match is None:
            problems.append(f"{CHECKSUMS} has a line that is no checksum: {line[:80]!r}")
        elif not (bag / match[2]).is_file():
            problems.append(f"{match[2]} is missing")
        else:
            with (bag / match[2]).open("rb") as stream:
                same = hashlib.file_digest(stream, "sha256").hexdigest() == match[1]
            right += same
            if not same:
                problems.append(f"{match[2]} is not the file that was recorded: its checksum is another one")
    return right, problems


def _plain(name: str) -> str:
    return name.removesuffix(".zstd")


def _text(error: BaseException) -> str:
    return error.mistakes[0].message if isinstance(error, InputError) else f"{error}"


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else -1, path.name)


@dataclass(frozen=True)
class RecoveredBag:
    """A bag that was written in ``folder``, its messages by topic, and the problems of its source."""

    source: Path
    folder: Path
    extent: Extent
    counts: dict[str, int]
    problems: tuple[str, ...]


def recover_bag(path: Path, out: Path) -> RecoveredBag:
    """Write every complete message of a bag, or an MCAP file, to a new folder, as a bag that any reader accepts.

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
    problems = bag_info(path).problems if path.is_dir() else [text for scan in scans for text in scan.findings()]
    counts = {topic.name: count for topic, count in writer.counts.items()}
    return RecoveredBag(path, out, writer.extent, counts, tuple(problems))


def _readable(scan: McapScan) -> Iterator[TimedMessage]:
    try:
        yield from scan.messages()
    except OSError as error:
        remedy = "check the disk and permissions; a failing disk: copy the file by ddrescue, and recover the copy"
        raise InputError(f"cannot be read: {error.strerror}", remedy, scan.path) from None
