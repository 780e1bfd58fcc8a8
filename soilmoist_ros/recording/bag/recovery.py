# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rebuild a readable bag from an interrupted or damaged one; the original is only read."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.retention import NUMBER, next_number
from soilmoist_ros.recording.bag.storage import TOO_MUCH, inside
from soilmoist_ros.recording.bag.writer import BagWriter, is_being_written
from soilmoist_ros.recording.mcap.chunks import MAX_CHUNK_BYTES
from soilmoist_ros.recording.mcap.metadata import Extent
from soilmoist_ros.recording.mcap.scan import McapScan, ScannedMessage


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


def mcap_files(path: Path) -> list[Path]:
    """MCAP files of a bag in the order of recording.

    :param path: folder of a bag, or one of its files
    :raises InputError: if there are none, or one is a link to a file outside of the folder
    """
    if path.is_file() and path.suffix == ".mcap":
        return [path]
    if path.is_dir():
        found = [inside(path, file) for file in sorted(path.glob("*.mcap"), key=_split_number)]
        if found:
            return found
        if any(path.glob("*.mcap.zstd")):
            raise InputError("its files are compressed", "unpack them with unzstd first", path)
    if not path.exists():
        raise InputError("there is no such bag", "give the folder of a bag or an MCAP file", path)
    names = [path.name, *(file.name for file in path.glob("*"))]
    if any(re.search(r"\.db3(\.zstd)?$", name) for name in names):
        message = "is an SQLite bag, which needs no recovery and has no checksums: this command is for MCAP"
        raise InputError(message, "see soilmoist bag info; without metadata.yaml: ros2 bag reindex", path)
    if any(name.endswith(".bag") for name in names):
        message = "is a bag of ROS 1: this command is for MCAP"
        raise InputError(message, "see soilmoist bag info; if it was not closed: rosbag reindex (ROS 1)", path)
    raise InputError("holds no MCAP file", "give the folder of a bag or an MCAP file", path)


def recover_bag(path: Path, out: Path) -> RecoveredBag:
    """Write every complete message of a bag into a new bag that any reader accepts.

    :param path: folder of a bag, or an MCAP file; only read
    :param out: folder to make; must not exist
    :raises InputError: if nothing can be read, or the new bag cannot be written
    """
    scans = [McapScan(file) for file in mcap_files(path)]
    messages = chain.from_iterable(_readable(scan) for scan in scans)
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
                writer.write(message.topic, message.log_ns, message.publish_ns, message.data)
    except InputError:
        shutil.rmtree(out, ignore_errors=True)
        raise
    except OSError as error:
        shutil.rmtree(out, ignore_errors=True)
        raise InputError(f"cannot be written: {error.strerror}", "choose a disk with more space", out) from None
    problems = [text for scan in scans for text in findings(scan)]
    counts = {topic.name: count for topic, count in writer.counts.items()}
    return RecoveredBag(path, out, writer.extent, counts, tuple(problems))


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


def _readable(scan: McapScan) -> Iterator[ScannedMessage]:
    try:
        yield from scan.messages()
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror}", "check the disk and permissions", scan.path
        ) from None


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else -1, path.name)
