"""Option ``--earlier`` of commands that make a map."""

from __future__ import annotations

from collections.abc import Callable

import click

from soilmoist_ros.cli.console import FILE

Command = Callable[..., None]


def earlier_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--earlier``; the command receives the paths as ``earlier``.

    :param more: text that follows in the help
    """
    text = (
        "Earlier run of the same field, whose counts inform this map: an output folder, a recording, or a folder "
        f"of such. Repeatable.{more}"
    )
    return click.option("--earlier", "earlier", type=FILE, multiple=True, metavar="RUN", help=text)
