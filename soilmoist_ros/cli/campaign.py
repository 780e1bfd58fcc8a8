"""``soilmoist campaign``: simulate and compare many missions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from soilmoist_ros.cli.console import progress_bar, report_errors
from soilmoist_ros.cli.options.output_options import confirmed, output_options, prepare_output
from soilmoist_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from soilmoist_ros.simulation.campaign.campaign import Campaign


@click.command("campaign")
@click.argument("campaign")
@click.option("--workers", type=click.IntRange(min=0), help="Local processes. Default: one per core.")
@click.option("--scheduler", help="Address of a Dask scheduler to use instead, such as tcp://host:8786.")
@output_options()
@report_errors
def command(campaign: str, workers: int | None, scheduler: str | None, out: Path, overwrite: bool) -> None:
    """Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).

    The folder --out keeps finished missions: run the same command again to resume after an interruption.
    Writes results.parquet, results.csv and report.html.
    """
    from soilmoist_ros.reporting.campaign.report import write_campaign_report
    from soilmoist_ros.simulation.campaign.campaign import CampaignInterrupted, load_campaign, run_campaign
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

    plan = load_campaign(campaign)
    _prepare(plan, out, overwrite)
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


def _prepare(plan: Campaign, out: Path, overwrite: bool) -> None:
    """Check the output folder; missions of this campaign in it are resumed without a question.

    :raises InputError: if it cannot be written, or has results that must not be replaced
    """
    from soilmoist_ros.simulation.campaign.campaign import RUNS, missions

    stored = {path.stem for path in (out / RUNS).glob("*.npz")}
    if not (out / RUNS).is_dir():
        from soilmoist_ros.reporting.output_folder import earlier_outputs, remove_earlier

        prepare_output(out, overwrite)
        remove_earlier(out, earlier_outputs(out), ())
    elif stored and stored.isdisjoint(mission.key for mission in missions(plan)):
        held = "the results of another campaign"
        if not (overwrite or confirmed(out, held)):
            raise InputError(f"has {held}", "choose another output folder, or give --overwrite", out)
