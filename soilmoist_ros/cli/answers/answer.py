# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The answer of a command: lines for people, or one JSON object with ``--json``; errors and exit codes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.foundation import InputError, Mistake, SoilmoistError, not_installed, printable

if TYPE_CHECKING:
    from rich.console import Console

EXIT_CODES = {
    0: "all was done; files that need an extra that is not installed are named",
    1: "failed, or done in part",
    2: "bad input: nothing was changed",
    130: "interrupted by Ctrl-C",
}
"""Exit codes of every command."""
_KEY = "soilmoist_ros.answer"


@dataclass
class Answer:
    """How a command answers, and what it has answered so far.

    :param as_json: lines go to standard error, and standard output gets one JSON object
    :param quiet: no lines and no progress, only warnings and errors
    """

    as_json: bool = False
    quiet: bool = False
    values: dict[str, Any] = field(default_factory=dict)


def current() -> Answer:
    """The answer of the running command."""
    context = click.get_current_context(silent=True)
    return Answer() if context is None else context.meta.setdefault(_KEY, Answer())


def echo(text: str, *, err: bool) -> None:
    """Print a line that may have words of files in it; every line for people goes through here.

    :param err: whether it goes to standard error
    """
    click.echo(printable(text), err=err)


def say(text: str) -> None:
    """Print a line of the result."""
    answer = current()
    if not answer.quiet:
        echo(text, err=answer.as_json)


def warn(text: str) -> None:
    """Print a line that must not be missed: with ``--quiet`` and ``--json`` it goes to standard error."""
    answer = current()
    answer.values.setdefault("warnings", []).append(text)
    echo(text, err=answer.as_json or answer.quiet)


def put(**values: Any) -> None:
    """Add values to the JSON object of the answer."""
    current().values.update(values)


def wrote(paths: Iterable[Path], out: Path | None = None) -> None:
    """Report the files that were written.

    :param out: their folder; its summary.json becomes part of the answer
    """
    answer = current()
    for path in paths:
        say(f"wrote {path}")
        answer.values.setdefault("written", []).append(str(path))
    if out is not None:
        if (out / "report.html").is_file():
            say(f"open       {(out / 'report.html').absolute().as_uri()}")
        answer.values["out"] = str(out)
        if answer.as_json:
            from soilmoist_ros.pipeline import read_summary
            from soilmoist_ros.recording import SUMMARY

            if (out / SUMMARY).is_file():
                answer.values["summary"] = read_summary(out)


def tables() -> Console:
    """A console of rich for the tables of the answer."""
    from rich.console import Console

    answer = current()
    return Console(stderr=answer.as_json, quiet=answer.quiet)


def answering(command: Callable[..., None]) -> Callable[..., None]:
    """Add ``--json`` and ``--quiet``, report errors as messages, and exit with a code of :data:`EXIT_CODES`."""

    @click.option("--json", "as_json", is_flag=True,
                  help="Print the result as one JSON object; all else goes to standard error.")  # fmt: skip
    @click.option("-q", "--quiet", is_flag=True, help="Print warnings and errors only.")
    @wraps(command)
    def run(*args: Any, as_json: bool, quiet: bool, **kwargs: Any) -> None:
        context = click.get_current_context()
        answer = context.meta[_KEY] = Answer(as_json, quiet)

        def checked() -> None:
            _require_inputs(context)
            command(*args, **kwargs)

        try:
            code, mistakes = _run(checked)
        except click.UsageError as error:  # click prints it
            _print_json(answer, context.command_path, 2, [Mistake(error.format_message())])
            raise
        _print_json(answer, context.command_path, code, mistakes)
        if code:
            sys.exit(code)

    return run


def reporting_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Report errors as messages, and exit with a code of :data:`EXIT_CODES`."""

    @wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        if code := _run(lambda: command(*args, **kwargs))[0]:
            sys.exit(code)

    return run


def _require_inputs(context: click.Context) -> None:
    """Check, before anything heavy is loaded, that the files and names that were given exist.

    :raises InputError: with all that are missing
    """
    mistakes: list[Mistake] = []
    for parameter in context.command.params:
        require, given = getattr(parameter.type, "require", None), context.params.get(parameter.name or "")
        if require is None or given is None:
            continue
        for value in given if isinstance(given, tuple) else (given,):
            try:
                require(value)
            except InputError as error:
                mistakes += error.mistakes
    if mistakes:
        raise InputError(mistakes)


def _run(command: Callable[[], None]) -> tuple[int, tuple[Mistake, ...]]:
    """Run a command; its exit code and mistakes, which are printed."""
    try:
        try:
            command()
        except ModuleNotFoundError as error:
            raise not_installed(error) from None
    except InputError as error:
        for mistake in error.mistakes:
            echo(f"error: {mistake}", err=True)
        return 2, error.mistakes
    except SoilmoistError as error:
        echo(f"error: {error}", err=True)
        return 1, (Mistake(str(error)),)
    except KeyboardInterrupt:
        echo("interrupted: nothing was written", err=True)
        return 130, ()
    except SystemExit as error:
        return (error.code if isinstance(error.code, int) else int(error.code is not None)), ()
    return 0, ()


def _print_json(answer: Answer, path: str, code: int, mistakes: Iterable[Mistake]) -> None:
    if not answer.as_json:
        return
    from soilmoist_ros.reporting import dumps

    errors = [
        {
            "message": one.message,
            "remedy": one.remedy,
            "path": one.path,
            "line": one.line or None,
            "key": one.column or None,
        }
        for one in mistakes
    ]
    click.echo(
        dumps({"command": path.partition(" ")[2], "exit_code": code, "errors": errors, **answer.values}, indent=2)
    )
