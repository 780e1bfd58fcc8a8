# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Verify a bag: checksums, every message, and what its metadata say."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.recovery import findings, mcap_files
from soilmoist_ros.recording.bag.storage import inside, read_metadata
from soilmoist_ros.recording.bag.writer import CHECKSUMS
from soilmoist_ros.recording.mcap.metadata import BagFile, Extent
from soilmoist_ros.recording.mcap.scan import McapScan

_LINE: Final = re.compile(r"([0-9a-f]{64}) [ *]([^/\0]+)")
_MAX_SUMS: Final = 1 << 20


@dataclass(frozen=True)
class Verified:
    """What was found.

    :param bag: the bag
    :param checksums: number of files whose checksum is right
    :param files: its MCAP files and their messages
    :param problems: what is wrong, in words
    """

    bag: Path
    checksums: int
    files: tuple[BagFile, ...]
    problems: tuple[str, ...]


def verify_bag(bag: Path) -> Verified:
    """Compare the files of a bag with their checksums, read every message, and compare with the metadata.

    :param bag: folder of an MCAP bag
    :raises InputError: if there is no such bag, or it cannot be read
    """
    try:
        right, problems = _checked_sums(bag)
        files = []
        counts: dict[str, int] = {}
        for path in mcap_files(bag):
            scan = McapScan(path)
            extent = Extent()
            for message in scan.messages():
                extent = extent.with_message(message.log_ns)
                counts[message.topic.name] = counts.get(message.topic.name, 0) + 1
            files.append(BagFile(path.name, extent))
            problems += findings(scan)
        if bag.is_dir():
            problems += _compared(bag, files, counts)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the disk and permissions", bag) from None
    return Verified(bag, right, tuple(files), tuple(problems))


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


def _compared(bag: Path, files: list[BagFile], counts: dict[str, int]) -> list[str]:
    """What ``metadata.yaml`` says otherwise."""
    if not (bag / "metadata.yaml").is_file():
        return ["metadata.yaml is missing"]
    try:
        metadata = read_metadata(bag)
        said = {str(one["path"]): int(one["message_count"]) for one in metadata["files"]}
        topics = {
            str(one["topic_metadata"]["name"]): int(one["message_count"])
            for one in metadata["topics_with_message_count"]
        }
    except (InputError, LookupError, TypeError, ValueError) as error:
        return [f"metadata.yaml cannot be read: {error}"]
    there = {file.name: file.extent.messages for file in files}
    problems = [f"{name} is missing" for name in said if name not in there and not (bag / name).is_file()]
    problems += [f"{name} is not in metadata.yaml" for name in there if name not in said]
    problems += [
        f"{name} has {there[name]} messages, and metadata.yaml says {count}"
        for name, count in said.items()
        if there.get(name, count) != count
    ]
    problems += [
        f"{name} has {counts.get(name, 0)} messages, and metadata.yaml says {topics.get(name, 0)}"
        for name in sorted(counts.keys() | topics.keys())
        if counts.get(name, 0) != topics.get(name, 0)
    ]
    return problems
