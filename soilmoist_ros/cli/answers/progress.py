# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Progress of the commands: a bar on a terminal, otherwise plain lines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from soilmoist_ros.cli.answers.answer import current, echo
from soilmoist_ros.foundation import printable


@contextmanager
def progress_bar(time_left: bool = True) -> Iterator[Callable[[str, float], None]]:
    """Report progress: a bar on a terminal, otherwise a line per step and tenth; nothing with ``--quiet``.

    :param time_left: whether the bar states the remaining time
    """
    if current().quiet:
        yield lambda step, share: None
        return
    if not sys.stderr.isatty():
        last = ("", 0)

        def plain(step: str, share: float) -> None:
            nonlocal last
            tenths = int(10 * share)
            if step != last[0]:
                echo(f"... {step}", err=True)
            elif tenths > last[1] and tenths < 10:
                echo(f"... {step}: {10 * tenths} %", err=True)
            last = (step, tenths)

        yield plain
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description:32}", markup=False),
        BarColumn(),
        *([TimeRemainingColumn()] * time_left),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda step, share: bar.update(task, description=printable(step), completed=share)
