# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The content of a bag and its problems, as tables for people."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.filesize import decimal
from rich.table import Table
from rich.text import Text

from soilmoist_ros.foundation import duration, printable
from soilmoist_ros.recording.bag.metadata import Extent
from soilmoist_ros.recording.bag.verify import BagInfo, TopicInfo

_PLAIN_WIDTH: Final = 240


def info_table(info: BagInfo) -> RenderableType:
    """The result of :func:`bag_info` as a table."""
    head = plain_text(
        f"{info.path}  {info.storage}, {decimal(info.size_bytes)}, {_extent_text(info.extent)}", no_wrap=True
    )
    table = Table("topic", "type", box=None, pad_edge=False)
    for title in ("messages", "every", "longest silence", "size"):
        table.add_column(title, justify="right", no_wrap=True)
    for topic in info.topics:
        table.add_row(
            plain_text(topic.name),
            plain_text(topic.type_name),
            str(topic.extent.messages),
            "" if topic.interval_s is None else _time_text(topic.interval_s),
            _silence_text(topic),
            decimal(topic.size_bytes),
        )
    said = [plain_text(f"{name}: {value}", style="yellow") for name, value in info.notes.items()]
    now = Text("being recorded now", style="yellow")
    return Group(head, table, *said, now if info.recording else _verdict(info))


def verified_table(bag: BagInfo) -> RenderableType:
    """The result of :func:`bag_info` in two lines."""
    number = len(bag.files)
    kind = "MCAP" if bag.storage == "mcap" else bag.storage
    files = f"{number} {kind} file{'s' * (number != 1)}, {bag.extent.messages} messages"
    return Group(plain_text(f"{bag.path}  {files}", no_wrap=True), _verdict(bag))


def _verdict(bag: BagInfo) -> Text:
    if bag.whole:
        return Text("whole", style="green")
    return plain_text("\n".join(bag.problems) + f"\n-> {bag.remedy}", style="red")


def plain_text(text: str, style: str = "", *, no_wrap: bool = False) -> Text:
    """A text with words of files in it: rich would read a ``str`` as markup."""
    return Text(printable(text), style, no_wrap=no_wrap)


def print_plain(console: Console, content: RenderableType) -> None:
    """Print; outside a terminal, long names are not truncated."""
    if not console.is_terminal:
        console = Console(file=console.file, width=_PLAIN_WIDTH)
    console.print(content, highlight=False, crop=False)


def _extent_text(extent: Extent) -> str:
    if not extent.messages:
        return "no messages"
    start = datetime.fromtimestamp(extent.start_ns * 1e-9, UTC)
    return f"{extent.messages} messages in {_time_text(extent.duration_ns * 1e-9)} from {start:%Y-%m-%d %H:%M:%S}Z"


def _silence_text(topic: TopicInfo) -> str:
    if topic.silent_s is None or topic.silent_from_s is None:
        return ""
    return f"{_time_text(topic.silent_s)} from {datetime.fromtimestamp(topic.silent_from_s, UTC):%H:%M:%S}Z"


def _time_text(time_s: float) -> str:
    return f"{time_s:.3g} s" if time_s < 60 else duration(time_s)
