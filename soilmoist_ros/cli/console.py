"""Error messages, exit codes and progress bars of the commands."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.foundation.errors import InputError, SoilmoistError

FILE = click.Path(path_type=Path)


class VariogramModel(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Name of a registered variogram model. Only a given option loads the registry, because it needs numpy."""

    name = "model"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name if a model has it; fail otherwise."""
        from soilmoist_ros.mapping.variogram.correlation import VARIOGRAM_MODELS

        try:
            VARIOGRAM_MODELS.get(value)
        except InputError as error:
            self.fail(str(error), param, ctx)
        return value

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """A placeholder: reading the names from the registry would make the help slow."""
        return "MODEL"


def report_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Report errors as messages and exit codes: 2 for bad input, 1 for other errors, 130 for an interrupt."""

    @wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except InputError as error:
            for mistake in error.mistakes:
                click.echo(f"error: {mistake}", err=True)
            sys.exit(2)
        except SoilmoistError as error:
            click.echo(f"error: {error}", err=True)
            sys.exit(1)
        except KeyboardInterrupt:
            click.echo("interrupted: nothing was written", err=True)
            sys.exit(130)

    return run


def rate_error(mse: float, coverage95: float) -> str:
    """Error of a rate map: mean squared error [(counts/s)^2] and share of the cells within their interval."""
    return f"MSE {mse:.4f} (counts/s)2, {100 * coverage95:.0f} % of the cells within their 95 % interval"


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Report progress: a bar with the remaining time on a terminal, otherwise a line per step and tenth."""
    if not sys.stderr.isatty():
        last = ("", 0)

        def plain(step: str, share: float) -> None:
            nonlocal last
            tenths = int(10 * share)
            if step != last[0]:
                click.echo(f"... {step}", err=True)
            elif tenths > last[1] and tenths < 10:
                click.echo(f"... {step}: {10 * tenths} %", err=True)
            last = (step, tenths)

        yield plain
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:32}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda step, share: bar.update(task, description=step, completed=share)
