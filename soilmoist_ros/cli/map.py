# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist map``: logs of a neutron sensor to a map."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli import options
from soilmoist_ros.cli.answer import (
    answering,
    print_knowledge,
    print_losses,
    print_notes,
    progress_bar,
    say,
    wrote,
)
from soilmoist_ros.simulation import PRESETS

if TYPE_CHECKING:
    from soilmoist_ros.pipeline import MapRun

NO_MOISTURE = "the site file asks for the rate alone, or its soil is peat without organic_carbon"


@click.command("map")
@click.argument("logs", type=options.INPUT, nargs=-1, required=True)
@click.option("--logger", type=options.named("logger"),
              help="Logger format: a shipped name or a YAML file. Default: detected from the header.")  # fmt: skip
@click.option(
    "--site",
    type=options.named("site"),
    help="Site file: corrections, soil, calibration. Default: standard corrections.",
)
@options.sensor_option
@click.option(
    "--field",
    type=options.named("field"),
    help="Field file: boundary, cell size. Default: the surroundings of the track.",
)
@click.option("--nmea", "--track", type=options.INPUT, multiple=True,
              help="Positions, for loggers without them: NMEA, GPX, CSV "
              "or a bag, by content. Repeatable.")  # fmt: skip
@click.option("--from", "start", type=options.TIME, metavar="TIME",
              help="Map records after this time, such as 2026-05-02T14:30+02:00; UTC without a zone.")  # fmt: skip
@click.option("--to", "end", type=options.TIME, metavar="TIME",
              help="Map records up to this time; UTC without a zone.")  # fmt: skip
@options.position_options
@click.option("--preset", type=click.Choice(tuple(PRESETS)), default="recommended", show_default=True,
              help="Model and fit where none are given: the recommended ones, or the published ones.")  # fmt: skip
@options.map_options("by --preset")
@options.earlier_option()
@options.covariate_option()
@options.crs_option
@click.option("--title", help="Title of the report.")
@options.output_options()
@answering
def command(
    logs: tuple[Path, ...],
    site: str | None,
    field: str | None,
    preset: str,
    crs: str | None,
    out: Path,
    overwrite: bool,
    covariates: tuple[str, ...],
    start: datetime | None,
    end: datetime | None,
    **choices: Any,
) -> None:
    """Map soil moisture from neutron LOGS.

    A log is a file of the logger, a folder of such files, or a bag with its lines: .bag of ROS 1,
    .mcap or .db3.

    Writes summary.json, map.tif, samples.geojson, soilmoist.qgs and report.html to the folder --out.
    """
    start_s, end_s = start.timestamp() if start else -math.inf, end.timestamp() if end else math.inf
    if start_s >= end_s:
        raise click.UsageError("--from must be before --to")
    options.prepare_output(out, overwrite)
    from soilmoist_ros.mapping import CovariateSource
    from soilmoist_ros.pipeline import MapSettings, map_logs
    from soilmoist_ros.reporting import write_outputs
    from soilmoist_ros.sensing import utc_text

    settings = MapSettings(
        site=site, field=field, crs=crs, covariates=tuple(map(CovariateSource.parse, covariates)),
        times_s=(start_s, end_s), **options.chosen_settings(choices, PRESETS[preset]), **choices,
    )  # fmt: skip
    with progress_bar() as progress:
        run = map_logs(logs, settings, progress)
        progress("writing the results", 0.0)
        written = write_outputs(out, run, crs)
    if start or end:
        stamps = [record.stamp_s for record in run.track]
        say(f"time       {' to '.join(map(utc_text, (min(stamps), max(stamps))))} UTC, by --from and --to")
    _print_summary(run)
    wrote(written, out)


def _print_summary(run: MapRun) -> None:
    """Print what was mapped, and what the report leads with."""
    import numpy as np

    from soilmoist_ros.foundation import coordinates_text
    from soilmoist_ros.reporting import at_one_place, facts, has_no_level, irrigation, moisture_of_all

    lost = sum(row.count for row in run.losses if row.consequence == "lost")
    out = f"{len(run.quarantined)} quarantined, {lost} lost"
    say(f"records    {len(run.track)} used, {out}; samples after merging: {len(run.soil_map.samples)}")
    print_losses(run)
    say(f"place      {coordinates_text(run.frame.latitude_deg, run.frame.longitude_deg)}")
    for key, text in run.settings.items():
        if key.startswith("log: ") and key != "log: not used":
            say(f"{key.removeprefix('log: '):<10} {text}")
    origin = run.calibration
    if origin is not None and origin.method == "general" and origin.n0_sd_cps:
        error = f"{origin.n0_sd_cps / origin.n0_cps:.0%}"
        say(f"N0         {origin.n0_cps:.4g} counts/s +- {error}, {origin.source}")
    if run.soil_map.curve is None:
        say(f"moisture   not mapped: {NO_MOISTURE}")
    elif at_one_place(run):
        mean = moisture_of_all(run.track, run.soil_map.curve)
        say(f"rate       mean {mean.rate:.4f} +- {mean.rate_sd:.4f} counts/s")
    else:
        rate, sd = np.nanmean(run.soil_map.rate), np.nanmean(run.soil_map.rate_sd)
        say(f"rate       mean {rate:.4f} counts/s, standard deviation of a cell {sd:.4f}")
    for number, fact in enumerate(facts(run)):
        say(f"{'' if number else 'result':<10} {f'{fact.value} {fact.unit}':<28} {fact.meaning}")
    if has_no_level(run):
        say(f"level      {irrigation(run).level}")
    if not at_one_place(run):
        say(f"irrigation {irrigation(run).steps[0]}")
        say(f"map of     {run.support_text}")
    print_knowledge(run)
    print_notes(run)
