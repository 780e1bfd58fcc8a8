# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist season``: all surveys of a field over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli.answer import answering, progress_bar, say, warn, wrote
from soilmoist_ros.cli.options import FILE, MODEL, named, output_options, prepare_output


@click.command("season")
@click.argument("runs", type=FILE, nargs=-1, required=True)
@click.option("--field", type=named("field"), help="Field file. Default: the boundary of the last run.")
@click.option(
    "--site", type=named("site"), help="Site file with the calibration. Default: the calibration of the last run."
)
@click.option("--model", type=MODEL, default="matern32", show_default=True, help="Variogram model.")
@click.option("--cell", "cell_m", type=click.FloatRange(min=0, min_open=True), help="Cell size [m].")
@click.option("--title", help="Title of the page.")
@output_options()
@answering
def command(
    runs: tuple[Path, ...], field: str | None, site: str | None, out: Path, overwrite: bool, **choices: Any
) -> None:
    """Make a time series of all RUNS of one field.

    RUNS are output folders of map, simulate, replay or demo, recordings, or folders of such. The map of each
    survey is made from the counts of all. Writes report.html, season.csv, summary.json and survey_N.tif to --out.
    """
    prepare_output(out, overwrite)
    from soilmoist_ros.foundation import resource
    from soilmoist_ros.reporting import SeasonSettings, estimate_text, make_season, write_season

    settings = SeasonSettings(
        field=resource("fields", field) if field else None,
        site=resource("sites", site) if site else None,
        **choices,
    )
    with progress_bar() as progress:
        season = make_season(runs, settings, progress)
        progress("writing the results", 1.0)
        written = write_season(out, season)
    share = season.persistence
    say(f"patterns   correlation of two surveys {share.share:.2f} +- {share.sd:.2f}")
    for label, survey in zip(season.labels, season.surveys, strict=True):
        say(f"{label:10} {estimate_text(survey)}")
    for survey in season.surveys:
        for remark in survey.run.remarks:
            say(f"remark     {survey.run.survey.name}: {remark}")
    for note in season.notes:
        warn(f"warning    {note}")
    wrote(written, out)
