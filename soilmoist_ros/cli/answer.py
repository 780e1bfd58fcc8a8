# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The answer of a command: lines for people, or one JSON object; progress, a live view, errors, exit codes."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.foundation import InputError, Mistake, SoilmoistError, not_installed, printable

if TYPE_CHECKING:
    from rich.console import Console

    from soilmoist_ros.pipeline import MapRun
    from soilmoist_ros.reporting import LiveMission
    from soilmoist_ros.simulation import MissionResult

EXIT_CODES = {
    0: "all was done; files that need an extra that is not installed are named",
    1: "failed, or done in part",
    2: "bad input: nothing was changed",
    130: "interrupted by Ctrl-C",
}
"""Exit codes of every command."""
_KEY = "soilmoist_ros.answer"
_SHOW_S = 0.5
MAX_REASONS = 3
"""Number of reasons for lost records that are printed."""


@dataclass
class CommandAnswer:
    """Answer of a command: its form, and what was said so far."""

    as_json: bool = False
    quiet: bool = False
    values: dict[str, Any] = field(default_factory=dict)


def current() -> CommandAnswer:
    """The answer of the running command."""
    context = click.get_current_context(silent=True)
    return CommandAnswer() if context is None else context.meta.setdefault(_KEY, CommandAnswer())


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
    """Report the files that were written."""
    answer = current()
    for path in paths:
        say(f"wrote {path}")
        answer.values.setdefault("written", []).append(str(path))
    if out is not None:
        if (out / "report.html").is_file():
            say(f"open       {(out / 'report.html').absolute().as_uri()}")
        answer.values["out"] = str(out)
        if answer.as_json:
            from soilmoist_ros.recording import SUMMARY

            if (out / SUMMARY).is_file():
                answer.values["summary"] = json.loads((out / SUMMARY).read_text(encoding="utf-8"))


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
        answer = context.meta[_KEY] = CommandAnswer(as_json, quiet)

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
    """Check, before anything heavy is loaded, that the files and names that were given exist."""
    mistakes: list[Mistake] = []
    for parameter in context.command.params:
        require, given = getattr(parameter.type, "require", None), context.params.get(parameter.name or "")
        for value in given if isinstance(given, tuple) else (given,):
            try:
                if require is not None and value is not None:
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


def _print_json(answer: CommandAnswer, path: str, code: int, mistakes: Iterable[Mistake]) -> None:
    if not answer.as_json:
        return
    from soilmoist_ros.reporting import dumps

    errors = [
        {"message": one.message, "remedy": one.remedy, "path": one.path,
         "line": one.line or None, "key": one.column or None}
        for one in mistakes
    ]  # fmt: skip
    content = {"command": path.partition(" ")[2], "exit_code": code, "errors": errors, **answer.values}
    click.echo(dumps(content, indent=2))


# Progress of the commands: a bar on a terminal, otherwise plain lines -------------------------------------------


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Report progress: a bar on a terminal, otherwise a line per step and tenth; nothing with ``--quiet``."""
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
            elif last[1] < tenths < 10:
                echo(f"... {step}: {10 * tenths} %", err=True)
            last = (step, tenths)

        yield plain
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = [TextColumn("{task.description:32}", markup=False), BarColumn(), TimeRemainingColumn()]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda step, share: bar.update(task, description=printable(step), completed=share)


# A running mission on the terminal ------------------------------------------------------------------------------


@contextmanager
def live_view() -> Iterator[Callable[[LiveMission], None]]:
    """Show a mission: its facts on a terminal, otherwise a line per change of state; nothing with --quiet."""
    if current().quiet:
        yield lambda live: None
        return
    console = tables()
    if not console.is_terminal:
        said: dict[str, str] = {}

        def plain(live: LiveMission) -> None:
            for robot in live.robots:
                state = robot.state.partition(" (")[0]
                if state != said.get(robot.namespace):
                    said[robot.namespace] = state
                    used_s = float(robot.status.get("time_used_s", 0.0))
                    name = f"{robot.namespace.replace('_', ' ')}: " if robot.namespace else ""
                    say(f"{used_s:7.0f} s  {name}{robot.state}")

        yield plain
        return
    from rich.console import Group
    from rich.live import Live
    from rich.table import Column, Table
    from rich.text import Text

    shown_s = 0.0
    with Live(console=console, auto_refresh=False, transient=False) as screen:

        def table(live: LiveMission) -> None:
            nonlocal shown_s
            now_s = time.monotonic()
            if now_s - shown_s >= _SHOW_S:
                shown_s = now_s
                facts = Table.grid(Column(style="bold", no_wrap=True), Column(overflow="fold"), padding=(0, 2))
                for name, value in live.facts.items():  # as Text: rich would read brackets as markup
                    facts.add_row(Text(printable(name)), Text(printable(value)))
                title = Text(printable(live.title), style="bold reverse")
                screen.update(Group(title, facts), refresh=True)

        yield table


# Lines on a map that several commands print ---------------------------------------------------------------------


def print_mission(mission: MissionResult) -> None:
    """Print the course and the result of a mission."""
    from soilmoist_ros.reporting import mission_sentences

    for number, sentence in enumerate(mission_sentences(mission)):
        say(f"{'' if number else 'mission':<10} {sentence}")


def print_certificate(run: MapRun) -> None:
    """Print what the certificate of a run states, if it has one."""
    from soilmoist_ros.reporting import certificate_of, sample_text, statement_text

    if (found := certificate_of(run)) is not None:
        say(f"certified  {statement_text(found, run.calibrated)}")
        say(f"           {sample_text(found)}")


def print_knowledge(run: MapRun) -> None:
    """Print what earlier surveys and covariates contributed to a map, and what has changed."""
    from soilmoist_ros.reporting import change_text, contribution, covariate_rows, dated, relations

    fit, unit = run.soil_map.fit, "% by volume" if run.calibrated else "counts/s"
    if fit is not None and fit.other_fields:
        say(f"prior      {fit.other_fields}")
    related = relations(run)
    for one in run.earlier:
        known = related.get(one.survey.name)
        relation = "" if known is None else f", correlation of the patterns {known:.2f}"
        remarks = "".join(f". {remark.rstrip('.')}" for remark in one.remarks)
        say(f"earlier    {dated(one)}: {len(one.survey.samples)} samples{relation}{remarks}")
    if run.change is not None:
        say(f"           {contribution(run.change)}")
        say(f"change     {change_text(run.change)}")
    for name, effect, share, _ in covariate_rows(run):
        about = f"{effect} {unit} per standard deviation, {share} of the variance"
        say(f"covariate  {name}: {about if effect else 'left out'}")


def print_losses(run: MapRun) -> None:
    """Print why records were lost, the most frequent reasons first."""
    for row in [row for row in run.losses if row.consequence == "lost"][:MAX_REASONS]:
        remedy = f" -> {row.remedy}" if row.remedy else ""
        warn(f"lost       {row.count} by {row.kind}, such as {row.example}{remedy}")


def print_notes(run: MapRun) -> None:
    """Print the notes on a map."""
    from soilmoist_ros.reporting import notes

    for note in notes(run):
        warn(f"warning    {note}")
