# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The output folder of a command: ``--out``, ``--overwrite``, and the question before results are replaced."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from soilmoist_ros.cli.answers.answer import wrote
from soilmoist_ros.cli.options.names import FILE
from soilmoist_ros.foundation import InputError, install, is_installed

Command = Callable[..., None]


def output_options(
    text: str = "Folder for the results; made if missing.", required: bool = True
) -> Callable[[Command], Command]:
    """Add ``--out`` and ``--overwrite``.

    :param text: help of ``--out``
    :param required: whether the command needs ``--out``
    """

    def decorate(command: Command) -> Command:
        command = overwrite_option("Replace the results of an earlier run in --out.")(command)
        return click.option("--out", type=FILE, required=required, help=text)(command)

    return decorate


def overwrite_option(text: str) -> Callable[[Command], Command]:
    """Add ``--overwrite``, which ``--force`` means as well.

    :param text: its help
    """
    return click.option("--overwrite", "--force", "overwrite", is_flag=True, help=text)


def figures_option(command: Command) -> Command:
    """Add ``--figures``; matplotlib is looked for before the work."""

    def known(_context: click.Context, _option: click.Parameter, chosen: tuple[str, ...]) -> tuple[str, ...]:
        if chosen and not is_installed("matplotlib"):
            raise InputError("--figures needs matplotlib, which is not installed", install("reports"))
        return chosen

    text = "Also write figures for publications, as svg or pdf, to figures/ in --out. Repeatable."
    return click.option("--figures", type=click.Choice(("svg", "pdf")), multiple=True, callback=known, help=text)(
        command
    )


def prepare_output(out: Path, overwrite: bool) -> None:
    """Check the output folder before the work; ask on a terminal before earlier results are replaced.

    :raises InputError: if it cannot be written, or has results that must not be replaced
    """
    from soilmoist_ros.reporting import require_free, require_writable, results_in

    if not overwrite:
        require_writable(out)
        overwrite = confirmed(out, results_in(out))
    require_free(out, overwrite)


def confirmed(out: Path, held: str) -> bool:
    """Whether the user agrees, on a terminal, that results are replaced; false without a terminal.

    :param held: the results, in words; empty if there is nothing to ask
    :raises InputError: if the user declines
    """
    if not held or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    if click.confirm(f"{out} has {held}. Replace them?", err=True):
        return True
    raise InputError("nothing was changed", "choose another output folder", out)


@contextmanager
def reported_failure(out: Path) -> Iterator[None]:
    """Write the report of a run without a map.

    :param out: output folder
    :raises NoMapError: why there is no map
    """
    from soilmoist_ros.pipeline import NoMapError

    try:
        yield
    except NoMapError as error:
        from soilmoist_ros.reporting import write_failed

        wrote(write_failed(out, error.failed), out)
        raise
