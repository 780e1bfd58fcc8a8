"""``soilmoist campaign``: simulate and compare many missions."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from soilmoist_ros.cli.console import FILE, progress_bar, report_errors


@click.command("campaign")
@click.argument("campaign")
@click.option("--workers", type=click.IntRange(min=0), help="Local processes. Default: one per core.")
@click.option("--scheduler", help="Address of a Dask scheduler to use instead, such as tcp://host:8786.")
@click.option("--out", type=FILE, required=True, help="Folder for the results; made if missing.")
@report_errors
def command(campaign: str, workers: int | None, scheduler: str | None, out: Path) -> None:
    """Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).

    The folder --out keeps finished missions: run the same command again to resume after an interruption.
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
    click.echo(f"missions   {outcome.computed} simulated, {outcome.reused} reused, {len(outcome.failures)} failed")
    for failure in outcome.failures:
        click.echo(f"failed: {failure}", err=True)
    with progress_bar() as progress:
        progress("writing the report", 1.0)
        report = write_campaign_report(plan, out, outcome.failures)
    for path in (*outcome.written, *filter(None, [report])):
        click.echo(f"wrote {path}")
    if not outcome.complete:
        sys.exit(1)
