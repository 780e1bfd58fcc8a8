"""``soilmoist check``: report mistakes in configuration files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from soilmoist_ros.cli.console import report_errors
from soilmoist_ros.foundation.errors import InputError, Mistake


@click.command("check")
@click.option("--logger", multiple=True, help="Logger format: a shipped name or a YAML file. Repeatable.")
@click.option("--site", multiple=True, help="Site file: a shipped name or a YAML file. Repeatable.")
@click.option("--field", multiple=True, help="Field file: a shipped name or a YAML file. Repeatable.")
@report_errors
def command(logger: tuple[str, ...], site: tuple[str, ...], field: tuple[str, ...]) -> None:
    """Check configuration files and report every mistake in them."""
    from soilmoist_ros.foundation.configuration import read_yaml, resource
    from soilmoist_ros.mapping.field import load_field
    from soilmoist_ros.sensing.formats.logger_format import load_logger_format
    from soilmoist_ros.sensing.moisture.site import load_site
    from soilmoist_ros.sensing.survey.correction import intensity_source
    from soilmoist_ros.simulation.fields.truth_file import load_surrogate

    def check_site(name: str) -> None:
        intensity_source(load_site(name).corrections)

    def check_field(path: Path) -> None:
        load_field(path)
        if "truth" in read_yaml(path):
            load_surrogate(path)

    checks: list[tuple[str, Callable[[], object]]] = [
        *((name, lambda name=name: load_logger_format(name)) for name in logger),
        *((name, lambda name=name: check_site(name)) for name in site),
        *((name, lambda name=name: check_field(resource("fields", name))) for name in field),
    ]
    if not checks:
        raise click.UsageError("give at least one of --logger, --site, --field")
    mistakes: list[Mistake] = []
    for name, check in checks:
        try:
            check()
            click.echo(f"ok: {name}")
        except InputError as error:
            mistakes += error.mistakes
    if mistakes:
        raise InputError(mistakes)
