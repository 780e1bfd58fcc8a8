# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Limits for the bags of a recorder: their age, and the space they take."""

from __future__ import annotations

import ctypes
import math
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from soilmoist_ros.recording.bag.writer import is_being_written

_STEP_S: Final = 60.0
"""Change between the time of day and a steady clock from which the clock was set [s]."""
_SETTLED_S: Final = 3600.0
_TIMEX_BYTES: Final = 512
"""More than the size of ``struct timex`` on any machine; zeros ask without setting anything."""
_TIME_ERROR: Final = 5
NUMBER: Final = "number"
"""Note of a bag: one more than those of all earlier bags in its folder, whatever the clock said."""
CLOSED_S: Final = "closed_s"
"""Note of a bag that was closed while the clock was right: the time [s since 1970-01-01 UTC]."""
_NOTE: Final = re.compile(rf"^ +({NUMBER}|{CLOSED_S}): '(\d+)'$", re.MULTILINE)


class ClockWatch:
    """Compares the time of day with a steady clock.

    Attributes
    ----------
    right : bool
        whether the clock was synchronised since it was last set
    settled : bool
        whether it is right, and was not set for an hour
    """

    def __init__(self) -> None:
        self.right = self.settled = False
        self._offset_s = math.nan
        self._since_s = 0.0

    def look(self, now_s: float, steady_s: float, synchronised: bool) -> None:
        """Compare now; call it every minute or so.

        >>> watch = ClockWatch()
        >>> watch.look(1000.0, 5.0, synchronised=False)
        >>> watch.right
        False
        >>> watch.look(1.8e9, 65.0, synchronised=True)
        >>> watch.right, watch.settled
        (True, False)

        :param now_s: time of day [s since 1970-01-01 UTC]
        :param steady_s: time of a clock that nobody sets [s]
        :param synchronised: whether NTP or GNSS keeps the clock right now
        """
        offset_s = now_s - steady_s
        if not abs(offset_s - self._offset_s) <= _STEP_S:  # the first offset is not a number
            self._since_s, self.right = steady_s, False
        self._offset_s = offset_s
        self.right = self.right or synchronised
        self.settled = self.right and steady_s - self._since_s >= _SETTLED_S


def is_synchronised() -> bool:
    """True if the kernel knows of something that keeps the clock of this computer right, such as NTP or GNSS."""
    state = getattr(ctypes.CDLL(None), "adjtimex", None)
    return state is not None and 0 <= state(ctypes.create_string_buffer(_TIMEX_BYTES)) < _TIME_ERROR


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
        """True if there is a limit."""
        return math.isfinite(self.size_bytes) or math.isfinite(self.age_s)


@dataclass(frozen=True)
class Excess:
    """What is beyond the limits.

    :param bags: bags that would have to go, the oldest first
    :param left_bytes: space that bags may still take [bytes]; negative if all together exceed their limit
    :param undated: bags that seem too old, but were not closed by a clock that was right; they stay
    """

    bags: tuple[Path, ...] = ()
    left_bytes: float = math.inf
    undated: tuple[Path, ...] = ()


@dataclass(frozen=True)
class _Closed:
    """A bag that was closed, its size [bytes] and number (0 for none).

    :param changed_s: when its metadata were written, by the clock of then [s since 1970-01-01 UTC]
    :param closed_s: when it was closed, if the clock was right [s since 1970-01-01 UTC]
    """

    folder: Path
    size: int
    changed_s: float
    number: int
    closed_s: float | None


def find_excess(out: Path, limits: Limits, now_s: float, clock_right: bool) -> Excess:
    """What is beyond the limits in a folder of bags.

    A bag that was not closed counts, but is never among those to go: it may hold what nobody has recovered yet.
    A wrong clock makes no bag old: bags are in the order of their numbers, and only one that was closed by a right
    clock can be too old.

    :param out: folder of the bags
    :param limits: the limits
    :param now_s: time of now [s since 1970-01-01 UTC]
    :param clock_right: whether that time is known to be right; no bag is too old otherwise
    :raises OSError: if the folder cannot be read
    """
    closed, total = _closed_bags(out)
    latest_s = now_s if clock_right else math.inf  # a bag of the future had the clock of a wrong server
    closed = [replace(bag, closed_s=None) if (bag.closed_s or 0) > latest_s else bag for bag in closed]
    found, undated, left_bytes = [], [], limits.size_bytes - total
    for bag in _oldest_first(closed):
        too_old = clock_right and bag.closed_s is not None and now_s - bag.closed_s > limits.age_s
        if too_old or total > limits.size_bytes:
            found.append(bag.folder)
            total -= bag.size
        elif bag.closed_s is None and now_s - bag.changed_s > limits.age_s:
            undated.append(bag.folder)
    return Excess(tuple(found), left_bytes, tuple(undated))


def next_number(out: Path) -> int:
    """The number of the next bag in a folder.

    :raises OSError: if the folder cannot be read
    """
    return 1 + max((bag.number for bag in _closed_bags(out)[0]), default=0) if out.is_dir() else 1


def _closed_bags(out: Path) -> tuple[list[_Closed], int]:
    """Closed bags of a folder, and the size of all [bytes]."""
    closed, total = [], 0
    for folder in sorted(path for path in out.iterdir() if path.is_dir() and not path.is_symlink()):
        files = list(folder.glob("*.mcap"))
        if not files:
            continue
        size = sum(file.lstat().st_size for file in files)
        total += size
        metadata = folder / "metadata.yaml"
        if metadata.is_file() and not any(map(is_being_written, files)):
            notes = _notes(metadata)
            changed_s = metadata.stat().st_mtime
            closed.append(_Closed(folder, size, changed_s, notes.get(NUMBER, 0), notes.get(CLOSED_S)))
    return closed, total


def _notes(metadata: Path) -> dict[str, int]:
    """The notes above. A YAML parser would take a core for seconds if there are many bags."""
    try:
        return {name: int(value) for name, value in _NOTE.findall(metadata.read_text(errors="replace"))}
    except (OSError, ValueError):  # one bad bag does not stop a recorder
        return {}


def _oldest_first(bags: Sequence[_Closed]) -> list[_Closed]:
    """Bags by number; one without, such as one of an earlier release, is sorted in by its time.

    For that, a bag with a number is of the time of the last one before it that a right clock has closed, or of the
    first such one; while there is none, bags without a number count as bags of an earlier release. None was closed
    before one with a lower number, whatever its clock said: in the result ``closed_s`` grows with the number.
    """
    numbered = sorted((bag for bag in bags if bag.number), key=lambda bag: bag.number)
    placed = [(bag.changed_s, 0, bag) for bag in bags if not bag.number]
    time_s = next((bag.closed_s for bag in numbered if bag.closed_s is not None), math.inf)
    for bag in numbered:
        if bag.closed_s is not None:
            time_s = max(time_s, bag.closed_s)
        closed_s = None if bag.closed_s is None else time_s
        placed.append((time_s, bag.number, replace(bag, closed_s=closed_s)))
    return [bag for *_, bag in sorted(placed, key=lambda place: place[:2])]


def excess_text(excess: Excess, drops: bool) -> str:
    """What is beyond the limits, in words, with what to do; empty if nothing is.

    :param drops: whether the oldest files of a bag are deleted while it is recorded
    """
    if excess.bags:
        return f"{len(excess.bags)} bags are beyond keep_days or keep_gb, the oldest is {excess.bags[0]}"
    if excess.left_bytes < 0 and not drops:
        remedy = "move some, or let file_mb and delete_oldest delete the oldest files of the running one"
        return f"the recordings take {-excess.left_bytes / 1e6:.0f} MB more than keep_gb: {remedy}"
    if excess.undated:
        said = f"{len(excess.undated)} bags seem older than keep_days, the first is {excess.undated[0]}"
        return f"{said}: they stay, as no synchronised clock has dated them; move them or delete them by hand"
    return ""


def delete_bags(bags: Sequence[Path]) -> list[Path]:
    """Delete bags; returns those that are gone."""
    for bag in bags:
        shutil.rmtree(bag, ignore_errors=True)
    return [bag for bag in bags if not bag.exists()]
