"""Error messages, exit codes and progress bars of the commands."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.foundation.errors import InputError, SoilmoistError

if TYPE_CHECKING:
    from soilmoist_ros.reporting.run import MapRun

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


def print_knowledge(run: MapRun) -> None:
    """Print what a reference sensor, earlier surveys and covariates contributed to a map, and what has changed."""
    from soilmoist_ros.reporting.page.covariates import covariate_importance
    from soilmoist_ros.reporting.page.earlier_section import change_amount, change_since, dated, relations
    from soilmoist_ros.reporting.run import REFERENCE

    for row in run.corrections:
        if row.name == REFERENCE:
            click.echo(f"reference  {', '.join(f'{name} {value}' for name, value in row.parameters.items())}")
    related = relations(run)
    for one in run.earlier:
        known = related.get(one.survey.name)
        relation = "" if known is None else f", correlation of the patterns {known:.2f}"
        remarks = "".join(f". {remark.rstrip('.')}" for remark in one.remarks)
        click.echo(f"earlier    {dated(one)}: {len(one.survey.samples)} samples{relation}{remarks}")
    found = run.change
    if found is not None:
        share = 1 - found.sd / found.sd_alone if found.sd_alone > 0 else 0.0
        drier, wetter = found.change.shares
        click.echo(f"           the standard deviation of the smooth rate is {100 * share:.0f} % lower with them")
        click.echo(f"change     {change_since(found)}: mean {change_amount(found)}")
        click.echo(f"           {100 * wetter:.0f} % of the field significantly wetter, {100 * drier:.0f} % drier")
    for part in covariate_importance(run):
        effect, share95 = part.rate_cps, part.variance_share
        click.echo(
            f"covariate  {part.name}: {effect.value:+.3f} counts/s per standard deviation "
            f"({effect.p025:+.3f} to {effect.p975:+.3f}), {100 * share95.value:.0f} % of the variance"
        )


def print_notes(run: MapRun) -> None:
    """Print the notes on a map."""
    from soilmoist_ros.reporting.page.notes import notes

    for note in notes(run):
        click.echo(f"warning    {note}")


@contextmanager
def progress_bar(time_left: bool = True) -> Iterator[Callable[[str, float], None]]:
    """Report progress: a bar on a terminal, otherwise a line per step and tenth.

    :param time_left: whether the bar states the remaining time
    """
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

    columns = (TextColumn("{task.description:32}"), BarColumn(), *([TimeRemainingColumn()] * time_left))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda step, share: bar.update(task, description=step, completed=share)
