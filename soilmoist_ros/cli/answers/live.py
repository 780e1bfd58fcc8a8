# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A running mission on the terminal, or as lines of JSON."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli.answers.answer import current, say, tables

if TYPE_CHECKING:
    from soilmoist_ros.reporting import LiveMission

_SHOW_S = 0.5
_LINE_S = 1.0


@contextmanager
def live_view() -> Iterator[Callable[[LiveMission], None]]:
    """Show a mission: a live picture on a terminal, otherwise a line per change of state; nothing with --quiet."""
    from soilmoist_ros.reporting import render

    if current().quiet:
        yield lambda live: None
        return
    console = tables()
    if not console.is_terminal:
        said: dict[str, str] = {}

        def plain(live: LiveMission) -> None:
            for robot in live.robots:
                text = robot.state
                if text.partition(" (")[0] != said.get(robot.namespace):
                    said[robot.namespace] = text.partition(" (")[0]
                    used_s = float(robot.status.get("time_used_s", 0.0))
                    name = f"{robot.namespace.replace('_', ' ')}: " if robot.namespace else ""
                    say(f"{used_s:7.0f} s  {name}{text}")

        yield plain
        return
    from rich.live import Live

    shown_s = 0.0
    with Live(console=console, auto_refresh=False, transient=False) as screen:

        def picture(live: LiveMission) -> None:
            nonlocal shown_s
            now_s = time.monotonic()
            if now_s - shown_s >= _SHOW_S:
                shown_s = now_s
                rows = max(6, min(22, console.height - 7 - len(live.maps) - 3 * len(live.robots)))
                screen.update(render(live.view(), min(64, console.width - 2), rows), refresh=True)

        yield picture


@contextmanager
def json_lines() -> Iterator[Callable[[LiveMission], None]]:
    """Print a mission for programs: a JSON object a line when it has changed, once a second at most."""
    from soilmoist_ros.reporting import dumps, jsonable

    printed: dict[str, Any] = {}
    printed_s = -_LINE_S

    def line(live: LiveMission) -> None:
        nonlocal printed, printed_s
        now_s = time.monotonic()
        if now_s - printed_s < _LINE_S:
            return
        values = jsonable(live.values)  # NaN differs from itself, None does not
        if values != printed:
            printed, printed_s = values, now_s
            click.echo(dumps({"time_utc": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", **values}))

    yield line
