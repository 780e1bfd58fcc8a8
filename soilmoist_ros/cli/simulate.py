"""Subcommands of ``soilmoist`` that simulate missions without ROS: ``simulate`` and ``campaign``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli.console import FILE, progress_bar, rate_error, report_errors
from soilmoist_ros.cli.mission_options import chosen_settings, mission_options


@click.command("simulate")
@mission_options()
@click.option("--out", type=FILE, required=True, help="Folder for the results; made if missing.")
@report_errors
def simulate_command(out: Path, choices: dict[str, Any]) -> None:
    """Explore a surrogate field with a simulated robot, without ROS.

    Writes summary.json, map.tif, samples.geojson, report.html, series.csv and visits.csv to the folder --out, and
    map_NAME.tif and samples_NAME.geojson for each further property NAME.
    """
    from soilmoist_ros.exploration.travel.travel import polyline_length_m
    from soilmoist_ros.reporting.mission_report import write_mission
    from soilmoist_ros.simulation.mission.efficiency import mission_efficiency
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

    settings = chosen_settings(choices)
    with progress_bar() as progress:
        result = simulate_mission(settings, lambda share: progress("exploring", share))
        progress("writing the results", 1.0)
        written = write_mission(out, result)
    last = result.series[-1]
    click.echo(
        f"mission    {last.time_s / 3600:.2f} h, {last.distance_m:.0f} m, {last.samples} samples: {result.ended}"
    )
    if settings.robots > 1:
        click.echo(f"robots     {', '.join(f'{polyline_length_m(track):.0f} m' for track in result.tracks)}")
    if result.soil_map is None:
        click.echo("map        no map: the mission ended before the first")
    else:
        click.echo(f"rate       {rate_error(last.mse, last.coverage95)}")
        rmse = f"RMSE {last.vwc_rmse:.4f} m3/m3"
        click.echo(f"moisture   {rmse if result.soil_map.curve else 'not mapped: the field has no calibration'}")
        for mapped, errors in zip(result.properties[1:], last.errors[1:], strict=True):
            click.echo(f"property   {mapped.name}: {rate_error(errors.mse, errors.coverage95)}")
        if (plan := mission_efficiency(result)) is not None:
            click.echo(f"efficiency {100 * plan.reached:.0f} % of what any plan could have done in the time")
    for path in written:
        click.echo(f"wrote {path}")


@click.command("campaign")
@click.argument("campaign")
@click.option("--workers", type=click.IntRange(min=0), help="Local processes. Default: one per core.")
@click.option("--scheduler", help="Address of a Dask scheduler to run on instead, such as tcp://host:8786.")
@click.option("--out", type=FILE, required=True, help="Folder for the results; made if missing.")
@report_errors
def campaign_command(campaign: str, workers: int | None, scheduler: str | None, out: Path) -> None:
    """Run the many missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).

    Finished missions are kept in the folder --out: run the same command again to go on after an interruption.
    Writes results.parquet, results.csv and report.html.
    """
    from soilmoist_ros.reporting.campaign.report import write_campaign_report
    from soilmoist_ros.simulation.campaign.campaign import CampaignInterrupted, load_campaign, run_campaign
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

    plan = load_campaign(campaign)
    try:
        with progress_bar() as progress:
            outcome = run_campaign(
                plan,
                out,
                simulate_mission,
                workers,
                scheduler,
                lambda done, total, left_s: progress(f"simulating {total} missions", done / max(total, 1)),
            )
    except CampaignInterrupted as stopped:
        click.echo(str(stopped), err=True)
        sys.exit(130)
    for remark in outcome.remarks:
        click.echo(f"note: {remark}")
    click.echo(
        f"missions   {outcome.computed} simulated, {outcome.reused} taken over, {len(outcome.failures)} failed"
    )
    for failure in outcome.failures:
        click.echo(f"failed: {failure}", err=True)
    with progress_bar() as progress:
        progress("writing the report", 1.0)
        report = write_campaign_report(plan, out, outcome.failures)
    for path in (*outcome.written, *filter(None, [report])):
        click.echo(f"wrote {path}")
    if not outcome.complete:
        sys.exit(1)
