# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The content of a bag, and its problems."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from soilmoist_ros.foundation import printable
from soilmoist_ros.recording.bag.metadata import Extent, joined
from soilmoist_ros.recording.bag.storage import recorder_notes
from soilmoist_ros.recording.bag.verify import RecoveredBag, Verified, verify_bag
from soilmoist_ros.sensing import reason_text

_REGULAR_FROM: Final = 10
_REGULAR_SHARE: Final = 0.8
_GAP_FACTOR: Final = 5.0
_MIN_GAP_S: Final = 1.0
_PLAIN_WIDTH: Final = 240


@dataclass(frozen=True)
class Gap:
    """A silence of an otherwise regular topic.

    :param start_s: time of the last message before it [s since 1970-01-01 UTC]
    :param duration_s: its length [s]
    """

    start_s: float
    duration_s: float


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag.

    :param name: full name
    :param type_name: name of its type
    :param extent: its messages
    :param size_bytes: size of all its messages [bytes]
    :param interval_s: median time between messages [s], ``None`` for fewer than two
    :param gaps: silences, if it is regular
    """

    name: str
    type_name: str
    extent: Extent
    size_bytes: int
    interval_s: float | None
    gaps: tuple[Gap, ...]


@dataclass(frozen=True)
class BagInfo:
    """A bag.

    :param path: its folder, or its file
    :param storage: ``mcap``, ``sqlite3`` or ``ROS 1``
    :param size_bytes: size of its files [bytes]
    :param extent: all messages
    :param topics: its topics, by name
    :param recording: whether it is being recorded now
    :param problems: its problems, in words
    :param remedy: what to do about the problems; empty without problems
    :param notes: what the recorder has noted, such as the number of messages that it lost
    """

    path: Path
    storage: str
    size_bytes: int
    extent: Extent
    topics: tuple[TopicInfo, ...]
    recording: bool
    problems: tuple[str, ...]
    remedy: str
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """True if it has no problems."""
        return not self.problems

    def __repr__(self) -> str:
        return f"<BagInfo {self.path}: {self.extent.messages} messages of {len(self.topics)} topics>"


def bag_info(path: Path) -> BagInfo:
    """Read every message of a bag, and summarise them.

    :param path: folder of a bag, or one of its files; it may be incomplete, damaged, or still being recorded
    :raises InputError: if there is no bag, or it cannot be read
    """
    times: dict[tuple[str, str], array[int]] = {}  # the numbers only: there may be many messages
    sizes: dict[tuple[str, str], int] = {}

    def note(name: str, kind: str, log_ns: int, size: int) -> None:
        times.setdefault((name, kind), array("Q")).append(log_ns)
        sizes[name, kind] = sizes.get((name, kind), 0) + size

    found = verify_bag(path, note)
    topics = _topics(times, sizes)
    return BagInfo(
        path,
        found.storage,
        sum(file.stat().st_size for file in found.paths),
        joined([topic.extent for topic in topics]),
        topics,
        found.recording,
        found.problems,
        found.remedy,
        recorder_notes(path),
    )


def find_gaps(times_s: ArrayLike) -> tuple[Gap, ...]:
    """Silences of a topic with regular messages; none for an irregular topic.

    A topic is regular if 80 % of its intervals are within half of the median. A silence is longer than 5 times
    the median, and longer than 1 s.

    >>> find_gaps([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20])
    (Gap(start_s=10.0, duration_s=10.0),)

    :param times_s: times of its messages, in order [s]
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


def _topics(
    times: Mapping[tuple[str, str], array[int]], sizes: Mapping[tuple[str, str], int]
) -> tuple[TopicInfo, ...]:
    topics = []
    for (name, type_name), stamps in sorted(times.items()):
        stamps_ns = np.sort(np.frombuffer(stamps, np.uint64))
        seconds = stamps_ns * 1e-9
        interval_s = float(np.median(np.diff(seconds))) if len(stamps) > 1 else None
        extent = Extent(len(stamps), int(stamps_ns[0]), int(stamps_ns[-1]))
        topics.append(TopicInfo(name, type_name, extent, sizes[name, type_name], interval_s, find_gaps(seconds)))
    return tuple(topics)


def info_table(info: BagInfo, quarantined: Mapping[str, Mapping[str, int]] | None = None) -> RenderableType:
    """The result of :func:`bag_info` as a table.

    :param quarantined: number of quarantined records, by topic and code of the reason
    """
    head = plain_text(
        f"{info.path}  {info.storage}, {size_text(info.size_bytes)}, {_extent_text(info.extent)}", no_wrap=True
    )
    table = Table("topic", "type", box=None, pad_edge=False)
    for title in ("messages", "every", "size", "gaps"):
        table.add_column(title, justify="right", no_wrap=True)
    for topic in info.topics:
        table.add_row(
            plain_text(topic.name),
            plain_text(topic.type_name),
            str(topic.extent.messages),
            "" if topic.interval_s is None else _seconds_text(topic.interval_s),
            size_text(topic.size_bytes),
            _gaps_text(topic),
        )
    bad = [
        plain_text(f"{name}: quarantined records: {_reasons_text(reasons)}", style="yellow")
        for name, reasons in (quarantined or {}).items()
    ]
    bad += [plain_text(f"{name}: {value}", style="yellow") for name, value in info.notes.items()]
    if info.recording:
        verdict = Text("being recorded now", style="yellow")
    elif info.whole:
        verdict = Text("whole", style="green")
    else:
        verdict = plain_text("\n".join(info.problems) + f"\n-> {info.remedy}", style="red")
    return Group(head, table, *bad, verdict)


def recovery_table(bag: RecoveredBag) -> RenderableType:
    """The result of :func:`recover_bag` as a table."""
    table = Table("topic", box=None, pad_edge=False)
    table.add_column("messages", justify="right")
    for name, count in sorted(bag.counts.items()):
        table.add_row(plain_text(name), str(count))
    problems = plain_text("\n".join(bag.problems) or f"{bag.source} was whole", "yellow" if bag.problems else "")
    return Group(
        problems, plain_text(f"recovered to {bag.folder}: {_extent_text(bag.extent)}", no_wrap=True), table
    )


def verified_table(bag: Verified) -> RenderableType:
    """The result of :func:`verify_bag`."""
    messages = sum(file.extent.messages for file in bag.files)
    number, right = len(bag.files), bag.checksums
    kind = "MCAP" if bag.storage == "mcap" else bag.storage
    files = f"{number} {kind} file{'s' * (number != 1)}, {messages} messages"
    sums = f"right checksums of {right} file{'s' * (right != 1)}" if right else "without checksums"
    head = plain_text(f"{bag.bag}  {files}, {sums}", no_wrap=True)
    if bag.problems:
        return Group(head, plain_text("\n".join(bag.problems) + f"\n-> {bag.remedy}", style="red"))
    return Group(head, Text("whole", style="green"))


def plain_text(text: str, style: str = "", *, no_wrap: bool = False) -> Text:
    """A text with words of files in it: rich would read a ``str`` as markup."""
    return Text(printable(text), style, no_wrap=no_wrap)


def print_plain(console: Console, content: RenderableType) -> None:
    """Print; outside a terminal, long names are not truncated."""
    if not console.is_terminal:
        console = Console(file=console.file, width=_PLAIN_WIDTH)
    console.print(content, highlight=False, crop=False)


def size_text(size_bytes: int) -> str:
    """A size for people.

    >>> size_text(1234567)
    '1.23 MB'
    """
    size = float(size_bytes)
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} GB"


def _reasons_text(reasons: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {reason_text(code)}" for code, count in reasons.items())


def _extent_text(extent: Extent) -> str:
    if not extent.messages:
        return "no messages"
    start = datetime.fromtimestamp(extent.start_ns * 1e-9, UTC)
    return (
        f"{extent.messages} messages in {_seconds_text(extent.duration_ns * 1e-9)} from {start:%Y-%m-%d %H:%M:%S}Z"
    )


def _gaps_text(topic: TopicInfo) -> str:
    if not topic.gaps:
        return ""
    longest = max(topic.gaps, key=lambda gap: gap.duration_s)
    start = datetime.fromtimestamp(longest.start_s, UTC)
    return f"{len(topic.gaps)}, longest {_seconds_text(longest.duration_s)} at {start:%H:%M:%S}Z"


def _seconds_text(time_s: float) -> str:
    if time_s < 60:
        return f"{time_s:.3g} s"
    minutes, seconds = divmod(round(time_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {seconds:02} s"
