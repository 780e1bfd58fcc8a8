# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Limits for the bags of a recorder: their age, and the space they take."""

from __future__ import annotations

import math
import shutil
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


def excess_bags(out: Path, limits: Limits, now_s: float) -> list[Path]:
    """Bags beyond the limits, the oldest first.

    A bag that was not closed counts, but is never among them: it may hold what nobody has recovered yet.

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
    found = []
    for ended_s, folder, size in sorted(closed):
        if now_s - ended_s > limits.age_s or total > limits.size_bytes:
            found.append(folder)
            total -= size
    return found


def delete_bags(bags: list[Path]) -> list[Path]:
    """Delete bags; returns those that are gone."""
    for bag in bags:
        shutil.rmtree(bag, ignore_errors=True)
    return [bag for bag in bags if not bag.exists()]
