# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The space that the bags of a recorder may take. Bags are in the order of their numbers: clocks may be wrong."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from soilmoist_ros.recording.bag.writer import CHECKSUMS, is_being_written

NUMBER: Final = "number"
"""Note of a bag: one more than those of all earlier bags in its folder, whatever the clock said."""
_NUMBER: Final = re.compile(rf"^ +{NUMBER}: '(\d+)'$", re.MULTILINE)


class Excess(NamedTuple):
    """Closed bags that would have to go, the oldest first, and the space that bags may still take [bytes]."""

    bags: tuple[Path, ...] = ()
    left_bytes: float = math.inf


class _Closed(NamedTuple):
    """A bag that was closed; first its place in the order of bags: its number (0 for none), and its time [s]."""

    number: int
    changed_s: float
    folder: Path
    size: int


def find_excess(out: Path, size_bytes: float) -> Excess:
    """Bags beyond the space for all bags in a folder.

    Bags without a number, of an earlier release, are the oldest, by their time. Closed bags of other recorders,
    which people keep there, are left alone. A bag that was not closed counts, but is never among those to go: it
    may hold what nobody has recovered yet.

    :param size_bytes: the space [bytes]
    :raises OSError: if the folder cannot be read
    """
    closed, total = _closed_bags(out)
    left_bytes, found = size_bytes - total, list[Path]()
    for bag in sorted(closed):
        if total > size_bytes:
            found.append(bag.folder)
            total -= bag.size
    return Excess(tuple(found), left_bytes)


def next_number(out: Path) -> int:
    """The number of the next bag in a folder.

    :raises OSError: if the folder cannot be read
    """
    return 1 + max((bag.number for bag in _closed_bags(out)[0]), default=0) if out.is_dir() else 1


def _closed_bags(out: Path) -> tuple[list[_Closed], int]:
    """Closed bags of the recorder in a folder, and the size of all but closed ones of others [bytes]."""
    closed, total = [], 0
    for folder in sorted(path for path in out.iterdir() if path.is_dir() and not path.is_symlink()):
        files = list(folder.glob("*.mcap"))
        size = sum(file.lstat().st_size for file in files)
        metadata = folder / "metadata.yaml"
        if files and metadata.is_file() and not any(map(is_being_written, files)):
            number = _number(metadata)
            if not number and not (folder / CHECKSUMS).is_file():
                continue  # no release of this recorder has made it
            closed.append(_Closed(number, metadata.stat().st_mtime, folder, size))
        total += size
    return closed, total


def _number(metadata: Path) -> int:
    """Number of a bag. A YAML parser would take a core for seconds if there are many bags."""
    try:
        match = _NUMBER.search(metadata.read_text(errors="replace"))
    except OSError:  # one bad bag does not stop a recorder
        return 0
    return int(match[1]) if match and len(match[1]) < 20 else 0


def excess_text(excess: Excess, drops: bool) -> str:
    """Excess over the space for bags, with what to do; ``drops``: the running bag loses its oldest files."""
    if excess.bags:
        return f"{len(excess.bags)} bags are beyond keep_gb, the oldest is {excess.bags[0]}"
    if excess.left_bytes < 0 and not drops:
        remedy = "move some, or let file_mb and delete_oldest delete the oldest files of the running one"
        return f"the recordings take {-excess.left_bytes / 1e6:.0f} MB more than keep_gb: {remedy}"
    return ""


def delete_bags(bags: Sequence[Path]) -> list[Path]:
    """Delete bags; returns those that are gone."""
    for bag in bags:
        shutil.rmtree(bag, ignore_errors=True)
    return [bag for bag in bags if not bag.exists()]
