# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Limits for the bags of a recorder: their age, and the space they take."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.recording.bag.writer import is_being_written


@dataclass(frozen=True)
class Limits:
    """Limits for all bags in a folder.

    :param size_bytes: space that they may take [bytes]
    :param age_s: time after which a bag is old [s]
    """

    size_bytes: float = math.inf
    age_s: float = math.inf

    @property
    def exist(self) -> bool:
        """Whether there is a limit."""
        return math.isfinite(self.size_bytes) or math.isfinite(self.age_s)


@dataclass(frozen=True)
class Excess:
    """What is beyond the limits.

    :param bags: bags that would have to go, the oldest first
    :param left_bytes: space that bags may still take [bytes]; negative if all together exceed their limit
    """

    bags: tuple[Path, ...] = ()
    left_bytes: float = math.inf


def find_excess(out: Path, limits: Limits, now_s: float) -> Excess:
    """What is beyond the limits in a folder of bags.

    A bag that was not closed counts, but is never among those to go: it may hold what nobody has recovered yet.

    :param out: folder of the bags
    :param limits: the limits
    :param now_s: time of now, as of files [s since 1970-01-01 UTC]
    :raises OSError: if the folder cannot be read
    """
    closed: list[tuple[float, Path, int]] = []
    total = 0
    for folder in sorted(path for path in out.iterdir() if path.is_dir() and not path.is_symlink()):
        files = list(folder.glob("*.mcap"))
        if not files:
            continue
        size = sum(file.lstat().st_size for file in files)
        total += size
        metadata = folder / "metadata.yaml"
        if metadata.is_file() and not any(map(is_being_written, files)):
            closed.append((metadata.stat().st_mtime, folder, size))
    found, left_bytes = [], limits.size_bytes - total
    for ended_s, folder, size in sorted(closed):
        if now_s - ended_s > limits.age_s or total > limits.size_bytes:
            found.append(folder)
            total -= size
    return Excess(tuple(found), left_bytes)


def excess_text(excess: Excess, drops: bool) -> str:
    """What is beyond the limits, in words, with what to do; empty if nothing is.

    :param drops: whether the oldest files of a bag are deleted while it is recorded
    """
    if excess.bags:
        return f"{len(excess.bags)} bags are beyond keep_days or keep_gb, the oldest is {excess.bags[0]}"
    if excess.left_bytes < 0 and not drops:
        remedy = "move some, or let file_mb and delete_oldest delete the oldest files of the running one"
        return f"the recordings take {-excess.left_bytes / 1e6:.0f} MB more than keep_gb: {remedy}"
    return ""


def delete_bags(bags: Sequence[Path]) -> list[Path]:
    """Delete bags; returns those that are gone."""
    for bag in bags:
        shutil.rmtree(bag, ignore_errors=True)
    return [bag for bag in bags if not bag.exists()]
