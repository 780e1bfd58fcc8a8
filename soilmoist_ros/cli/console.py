"""How commands speak to people: errors in plain words, and progress."""

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
    """Name of a registered variogram model; the registry is read when the option is used, as it needs numpy."""

    name = "model"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name itself, if there is such a model."""
        from soilmoist_ros.mapping.variogram.correlation import VARIOGRAM_MODELS

        try:
            VARIOGRAM_MODELS.get(value)
        except InputError as error:
            self.fail(str(error), param, ctx)
        return value

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """No names: to read the registry would make the help slow."""
        return "MODEL"


def report_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn bad input into a message and exit code 2, other trouble into 1, and an interrupt into 130."""

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
    """How good a map of a rate is: mean squared error [(counts/s)^2], and share of the cells in their interval."""
    return f"MSE {mse:.4f} (counts/s)2, {100 * coverage95:.0f} % of the cells within their 95 % interval"


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Report steps: a bar with the time left on a terminal, a plain line per step and tenth otherwise."""
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
