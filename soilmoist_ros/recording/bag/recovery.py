# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rebuild a readable bag from an interrupted or damaged one; the original is only read."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.retention import NUMBER, next_number
from soilmoist_ros.recording.bag.storage import plain_message
from soilmoist_ros.recording.bag.verify import compared, findings, mcap_files
from soilmoist_ros.recording.bag.writer import BagWriter, is_being_written
from soilmoist_ros.recording.mcap.metadata import BagFile, Extent
from soilmoist_ros.recording.mcap.scan import McapScan, ScannedMessage
from soilmoist_ros.recording.ros1.bag_file import ROS1


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
