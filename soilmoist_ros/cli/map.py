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
              help="Positions, for loggers without them: NMEA, GPX, CSV, "
              "RTKLIB or a bag, by content. Repeatable.")  # fmt: skip
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

    A log is a file of the logger, a folder or ZIP archive of such files, or a bag with its lines: .bag of ROS 1,
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
    import numpy as np

    from soilmoist_ros.foundation import coordinates_text
    from soilmoist_ros.reporting import at_one_place, irrigation, is_usable, mean_moisture, unusable_share

    soil_map = run.soil_map
    lost = sum(row.count for row in run.losses if row.consequence == "lost")
    out = f"{len(run.quarantined)} quarantined, {lost} lost"
    say(f"records    {len(run.track)} used, {out}; samples after merging: {len(soil_map.samples)}")
    print_losses(run)
    inside, placed = run.inside
    where = coordinates_text(run.frame.latitude_deg, run.frame.longitude_deg)
    say(f"place      {inside} of {placed} records inside the field, {where}")
    for key, text in run.settings.items():
        if key.startswith("log: ") and key != "log: not used":
            say(f"{key.removeprefix('log: '):<10} {text}")
    origin = run.calibration
    if origin is not None and origin.method == "general" and origin.n0_sd_cps:
        error = f"{origin.n0_sd_cps / origin.n0_cps:.0%}"
        say(f"N0         {origin.n0_cps:.4g} counts/s +- {error}, {origin.source}")
    if at_one_place(run):
        _print_place(run)
        return
    rate, sd = np.nanmean(soil_map.rate), np.nanmean(soil_map.rate_sd)
    say(f"rate       mean {rate:.3f} counts/s, standard deviation of a cell {sd:.3f}")
    if soil_map.curve is None:
        say(f"moisture   not mapped: {NO_MOISTURE}")
    else:
        low, high = 100 * np.nanquantile(soil_map.vwc, [0.05, 0.95])
        known, mean = mean_moisture(soil_map), float(np.nanmean(soil_map.vwc))
        if is_usable(soil_map):
            of_mean = (mean, math.nan, math.nan) if known is None else (known.value, known.p05, known.p95)
            _print_moisture(run, of_mean, f"5 to 95 % of the area have {low:.1f} to {high:.1f}")
        else:
            share = 100 * unusable_share(soil_map)
            say(f"moisture   impossible on {share:.0f} % of the area: N0 does not fit the rate")
        say(f"irrigation {irrigation(run).steps[0]}")
    say(f"map of     {run.support_text}")
    if soil_map.pooling:
        say(f"kriging    {soil_map.pooling}")
    print_knowledge(run)
    print_notes(run)


def _print_place(run: MapRun) -> None:
    """Mean and course of the moisture at one place."""
    from soilmoist_ros.reporting import moisture_of_all, moisture_series

    curve = run.soil_map.curve
    mean, series = moisture_of_all(run.track, curve), moisture_series(run.track, curve)
    say(f"rate       mean {mean.rate:.4f} +- {mean.rate_sd:.4f} counts/s")
    if curve is None:
        say(f"moisture   not computed: {NO_MOISTURE}")
    else:
        low, high = 100 * series.bands.vwc.min(), 100 * series.bands.vwc.max()
        steps = f"{len(series.begin_s)} steps of {series.step_s / 3600:g} h"
        of_mean = float(mean.vwc), float(mean.vwc_p05), float(mean.vwc_p95)
        _print_moisture(run, of_mean, f"{low:.1f} to {high:.1f} over time, in {steps}")
    print_notes(run)


def _print_moisture(run: MapRun, mean: tuple[float, float, float], more: str) -> None:
    """Mean moisture with its 90 % interval, as far as calibration and soil let it hold."""
    from soilmoist_ros.reporting import irrigation, moisture_text
    from soilmoist_ros.sensing import UNKNOWN_SENSOR

    value, interval, remark = moisture_text(*mean, run.soil_map.limits)
    between = f" (90 % interval {interval})" if interval and not math.isnan(mean[1]) else ""
    guessed = run.calibration is not None and run.calibration.illustrative
    guess = "level not known (illustrative N0)" if guessed else ""
    say("; ".join(filter(None, [f"moisture   mean {value}{between} % by volume", guess, remark, more])))
    if run.calibration is not None and run.calibration.method == UNKNOWN_SENSOR:
        say(f"level      {irrigation(run).level}")
