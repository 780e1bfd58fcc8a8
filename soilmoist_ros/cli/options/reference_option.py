"""Option ``--reference`` of commands that make a map from records."""

from __future__ import annotations

from collections.abc import Callable

import click

from soilmoist_ros.cli.console import FILE

Command = Callable[..., None]


def reference_option(command: Command) -> Command:
    """Add ``--reference``; the command receives the path as ``reference``."""
    text = (
        "Log of a stationary neutron sensor at the field, which counted during the survey: its changes correct "
        "the counts to the end of the survey. The site file is used for both."
    )
    return click.option("--reference", type=FILE, metavar="LOG", help=text)(command)
