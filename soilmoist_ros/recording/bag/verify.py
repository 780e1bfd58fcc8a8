# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decides whether a bag is whole: every message is read, and compared with ``metadata.yaml`` and the checksums."""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PurePath
from typing import Final

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.chunks import MAX_CHUNK_BYTES
from soilmoist_ros.recording.bag.metadata import BagFile, Extent, joined
from soilmoist_ros.recording.bag.retention import NUMBER, next_number
from soilmoist_ros.recording.bag.ros1 import ROS1, Ros1File
from soilmoist_ros.recording.bag.scan import McapScan, ScannedMessage
from soilmoist_ros.recording.bag.storage import (
    FAULTS,
    TOO_MUCH,
    SqliteFile,
    inside,
    plain_message,
    read_metadata,
    remedy_of,
    unpacked,
)
from soilmoist_ros.recording.bag.writer import CHECKSUMS, BagWriter, is_being_written

METADATA: Final = "metadata.yaml"
_PATTERNS: Final = ("*.bag", "*.mcap", "*.mcap.zstd", "*.db3", "*.db3.zstd")
_STORAGES: Final = {".mcap": "mcap", ".db3": "sqlite3", ".bag": "ROS 1"}
_LINE: Final = re.compile(r"([0-9a-f]{64}) [ *]([^/\0]+)")
_MAX_SUMS: Final = 1 << 20
_SHORT_NS: Final = 1_000_000_000
"""A bag that is shorter than its metadata say by more than this lacks messages [ns]."""

Note = Callable[[str, str, int, int], None]
"""Takes topic, type, time [ns] and size [bytes] of a message."""


@dataclass(frozen=True)
class Verified:
    """What was found.

    :param bag: the bag
    :param storage: ``mcap``, ``sqlite3`` or ``ROS 1``
    :param paths: the files that are there
    :param files: their messages
    :param checksums: number of files whose checksum is right
    :param recording: whether the bag is being recorded now
    :param problems: why it is not whole, in words; empty if it is
    :param remedy: what to do about the problems; empty without problems
    """

    bag: Path
    storage: str
    paths: tuple[Path, ...]
    files: tuple[BagFile, ...]
    checksums: int
    recording: bool
    problems: tuple[str, ...]
    remedy: str


def mcap_files(path: Path) -> list[Path]:
    """MCAP files of a bag in the order of recording.

    :raises InputError: if there are none, or one is a link to a file outside of the folder
    """
    if path.is_file() and path.suffix == ".mcap":
        return [path]
    if path.is_dir():
        found = [inside(path, file) for file in sorted(_named(path, "*.mcap"), key=_split_number)]
        if found:
            return found
        if any(path.glob("*.mcap.zstd")):
            raise InputError("its files are compressed", "unpack them with unzstd first", path)
    if not path.exists():
        raise InputError("there is no such bag", "give the folder of a bag or an MCAP file", path)
    names = [path.name, *(file.name for file in path.glob("*"))]
    if any(re.search(r"\.db3(\.zstd)?$", name) for name in names):
        message = "is an SQLite bag, which needs no recovery: this command is for MCAP"
        raise InputError(message, "see soilmoist bag info; without metadata.yaml: ros2 bag reindex", path)
    if any(name.endswith((".bag", ".bag.active")) for name in names):
        message = "is a bag of ROS 1: this command is for MCAP"
        raise InputError(message, "see soilmoist bag info; if it was not closed: rosbag reindex (ROS 1)", path)
    raise InputError("holds no MCAP file", "give the folder of a bag or an MCAP file", path)


def verify_bag(path: Path, note: Note = lambda name, kind, log_ns, size: None) -> Verified:
    """Read every message of a bag, and say whether it is whole.

    :param path: folder of a bag, or one of its files; a file alone is not compared with metadata
    :param note: called with every message
    :raises InputError: if there is no bag, or the only file cannot be read
    """
    try:
        paths = _files(path)
        storage = _STORAGES[Path(paths[0].name.removesuffix(".zstd")).suffix] if paths else "mcap"
        counts: Counter[str] = Counter()
        files, problems = [], [f"{file.name} was not closed" for file in path.glob("*.bag.active")]
        for file in paths:
            try:
                extent, found = _read(file, counts, note)
            except FAULTS as error:
                if len(paths) == 1 and not path.is_dir():
                    raise
                extent, found = Extent(), [f"{file.name} cannot be read: {_text(error)}"]
            files.append(BagFile(file.name, extent))
            problems += found
        recording = any(file.suffix == ".mcap" and is_being_written(file) for file in paths)
        right = 0
        if path.is_dir() and not recording:
            right, wrong = compared(path, files, counts, required=storage != "ROS 1")
            problems += wrong
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the disk and permissions", path) from None
    except InputError:
        raise
    except FAULTS as error:
        raise InputError(f"cannot be read as a bag: {error}", remedy_of(path), path) from None
    remedy = "" if not problems else "stop the recorder" if recording else remedy_of(path)
    if not recording and any(problem.endswith(" is missing") and METADATA not in problem for problem in problems):
        remedy = "copy the missing files into the folder of the bag, if they still exist"
    return Verified(path, storage, tuple(paths), tuple(files), right, recording, tuple(problems), remedy)


def compared(
    bag: Path, files: list[BagFile], counts: Mapping[str, int], required: bool = True
) -> tuple[int, list[str]]:
    """Number of files with right checksums, and what checksums and metadata say otherwise.

    The numbers of messages by topic decide. What recorders are known to write wrongly does not: numbers by file,
    and the duration of a split bag.
    """
    right, problems = _checked_sums(bag)
    if not (bag / METADATA).is_file():
        return right, [*problems, f"{METADATA} is missing"] if required else problems
    try:
        metadata = read_metadata(bag)
        listed = [PurePath(str(name)).name for name in metadata["relative_file_paths"]]
        by_file = {
            _plain(PurePath(str(one["path"])).name): int(one["message_count"])
            for one in metadata.get("files") or ()
        }
        said: Counter[str] = Counter()
        for one in metadata["topics_with_message_count"] or ():
            said[str(one["topic_metadata"]["name"])] += int(one["message_count"])
        duration_ns = int(metadata["duration"]["nanoseconds"])
    except (InputError, LookupError, TypeError, ValueError, AttributeError) as error:
        return right, [*problems, f"{METADATA} cannot be read: {_text(error)}"]
    there = {_plain(file.name): file.extent.messages for file in files}
    problems += [f"{name} is missing" for name in listed if _plain(name) not in there]
    problems += [f"{name} is not in {METADATA}" for name in there if name not in map(_plain, listed)]
    wrong = [name for name in sorted(counts.keys() | said.keys()) if counts.get(name, 0) != said[name]]
    if wrong:
        problems += [
            f"{name} has {there[name]} messages, and {METADATA} says {count}"
            for name, count in by_file.items()
            if there.get(name, count) != count
        ]
    problems += [f"{name} has {counts.get(name, 0)} messages, and {METADATA} says {said[name]}" for name in wrong]
    lasts_ns = joined([file.extent for file in files]).duration_ns
    if not wrong and lasts_ns < duration_ns - _SHORT_NS:
        problems.append(f"it lasts {lasts_ns * 1e-9:.1f} s, and {METADATA} says {duration_ns * 1e-9:.1f} s")
    return right, list(dict.fromkeys(problems))


def findings(scan: McapScan) -> list[str]:
    """Problems of a scanned file, in words."""
    name = scan.path.name
    found = []
    if is_being_written(scan.path):
        found.append(f"{name} is still being recorded")
    elif not scan.finished and not scan.too_much:
        cut = f"; its last {scan.cut_bytes} bytes are an incomplete message" if scan.cut_bytes else ""
        found.append(f"{name} was not closed{cut}")
    if scan.fault:
        found.append(f"{name} cannot be read everywhere: {scan.fault}")
    if scan.too_much:
        found.append(f"{name} {TOO_MUCH}; the rest of it was not read")
        return found
    if scan.too_large:
        limit = f"{MAX_CHUNK_BYTES >> 20} MB"
        found.append(
            f"{name} has {scan.too_large} chunk{'s'[: scan.too_large > 1]} of more than {limit}: not read"
        )
    if scan.damaged:
        found.append(f"{name} is damaged in {scan.damaged} place{'s'[: scan.damaged > 1]}")
    if scan.orphans:
        found.append(f"{name} holds {scan.orphans} messages of a topic whose description is damaged")
    return found


def _files(path: Path) -> list[Path]:
    """The files of a bag in the order of recording; none in a folder with metadata only."""
    if path.is_file():
        return [path] if Path(path.name.removesuffix(".zstd")).suffix in _STORAGES else mcap_files(path)
    found = [inside(path, file) for pattern in _PATTERNS for file in _named(path, pattern)]
    names = {file.name for file in found}  # a file and its copy that was unpacked are one
    found = [file for file in found if not (file.suffix == ".zstd" and _plain(file.name) in names)]
    if not found and not (path / METADATA).is_file():
        return mcap_files(path)  # its error says what is wrong
    return sorted(found, key=_split_number)


def _read(file: Path, counts: Counter[str], note: Note) -> tuple[Extent, list[str]]:
    """Read the messages of a file: their extent, and its problems."""
    if file.suffix == ".zstd":
        with tempfile.TemporaryDirectory() as folder:
            return _read(unpacked(file, Path(folder) / file.stem), counts, note)
    extent, here = Extent(), Counter[str]()

    def take(name: str, kind: str, log_ns: int, size: int) -> None:
        nonlocal extent
        extent = extent.with_message(log_ns)
        here[name] += 1
        note(name, kind, log_ns, size)

    problems = []
    try:
        if file.suffix == ".mcap":
            scan = McapScan(file)
            for message in scan.messages():
                take(message.topic.name, message.topic.definition.type_name, message.log_ns, len(message.data))
            problems = findings(scan)
        elif file.suffix == ".db3":
            problems = _cut(file)
            with closing(SqliteFile(file)) as base:
                for name, kind, log_ns, data in base.messages(base.content.counts, by_time=False):
                    take(name, kind, log_ns, len(data))
        else:
            with closing(Ros1File(file)) as bag:
                for name, kind, log_ns, data in bag.messages(bag.content.counts, convert=False):
                    take(name, kind, log_ns, len(data))
                problems = [
                    f"{name} has {here[name]} messages, and the index of {file.name} says {count}"
                    for name, count in bag.content.counts.items()
                    if here[name] != count
                ]
    finally:
        counts.update(here)
    return extent, problems


def _cut(file: Path) -> list[str]:
    """True if an SQLite file is shorter than its header says, in words."""
    with file.open("rb") as stream:
        header = stream.read(100)
    page, pages = (int.from_bytes(header[at : at + size]) for at, size in ((16, 2), (28, 4)))
    size, there = (page if page > 1 else 1 << 16) * pages, file.stat().st_size
    valid = header[24:28] == header[92:96]  # older versions of SQLite do not write the number of pages
    return [f"{file.name} was cut: it has {there} of {size} bytes"] if valid and there < size else []


def _checked_sums(bag: Path) -> tuple[int, list[str]]:
    """Number of right checksums, and what is wrong with the others."""
    path = bag / CHECKSUMS
    if not path.is_file():
        return 0, []
    right, problems = 0, []
    for line in inside(bag, path).read_bytes()[:_MAX_SUMS].decode("utf-8", "replace").splitlines():
        match = _LINE.fullmatch(line)
        if match is None:
            problems.append(f"{CHECKSUMS} has a line that is no checksum: {line[:80]!r}")
            continue
        file = bag / match[2]
        if not file.is_file():
            problems.append(f"{match[2]} is missing")
            continue
        with inside(bag, file).open("rb") as stream:
            found = hashlib.file_digest(stream, "sha256").hexdigest()
        right += found == match[1]
        if found != match[1]:
            problems.append(f"{match[2]} is not the file that was recorded: its checksum is another one")
    return right, problems


def _named(folder: Path, pattern: str) -> Iterator[Path]:
    """Files of a folder; computers of Apple add one of their own to each on a foreign disk."""
    return (file for file in folder.glob(pattern) if not file.name.startswith("._"))


def _plain(name: str) -> str:
    return name.removesuffix(".zstd")


def _text(error: BaseException) -> str:
    return error.mistakes[0].message if isinstance(error, InputError) else f"{error}"


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else -1, path.name)


@dataclass(frozen=True)
class RecoveredBag:
    """Result of a recovery.

    :param source: the bag that was read
    :param folder: the bag that was written
    :param extent: the messages in it
    :param counts: number of messages of each topic
    :param problems: problems of the source, in words
    """

    source: Path
    folder: Path
    extent: Extent
    counts: dict[str, int]
    problems: tuple[str, ...]


def recover_bag(path: Path, out: Path) -> RecoveredBag:
    """Write every complete message of a bag into a new bag that any reader accepts.

    :param path: folder of a bag, or an MCAP file; only read
    :param out: folder to make; must not exist
    :raises InputError: if nothing can be read, or the new bag cannot be written
    """
    scans = [McapScan(file) for file in mcap_files(path)]
    extents, found = [Extent()] * len(scans), Counter[str]()

    def readable(number: int) -> Iterator[ScannedMessage]:
        for message in _readable(scans[number]):
            extents[number] = extents[number].with_message(message.log_ns)
            found[message.topic.name] += 1
            yield message

    messages = chain.from_iterable(map(readable, range(len(scans))))
    first = next(messages, None)
    if first is None:
        raise InputError("holds no complete message", "nothing can be recovered: remove it", path)
    try:
        notes = {NUMBER: str(next_number(out.parent))}  # or a recorder would delete it as the oldest
    except OSError:  # no recorder can record in a folder that cannot be listed
        notes = {}
    writer = BagWriter(out, notes=notes)
    try:
        with writer:
            for message in chain([first], messages):
                data = message.data if message.topic.definition.encoding == ROS1 else plain_message(message.data)
                writer.write(message.topic, message.log_ns, message.publish_ns, data)
    except InputError:
        shutil.rmtree(out, ignore_errors=True)
        raise
    except OSError as error:
        shutil.rmtree(out, ignore_errors=True)
        raise InputError(f"cannot be written: {error.strerror}", "choose a disk with more space", out) from None
    problems = [text for scan in scans for text in findings(scan)]
    if path.is_dir() and not any(is_being_written(scan.path) for scan in scans):
        files = [BagFile(scan.path.name, extent) for scan, extent in zip(scans, extents, strict=True)]
        problems += compared(path, files, found)[1]
    counts = {topic.name: count for topic, count in writer.counts.items()}
    return RecoveredBag(path, out, writer.extent, counts, tuple(problems))


def _readable(scan: McapScan) -> Iterator[ScannedMessage]:
    try:
        yield from scan.messages()
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror}", "check the disk and permissions", scan.path
        ) from None
