# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist campaign``: simulate and compare many missions."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from soilmoist_ros.cli.answer import answering, echo, progress_bar, put, say, warn, wrote
from soilmoist_ros.cli.options import Parsed, output_options, prepare_output
from soilmoist_ros.foundation import THREADS, InputError

if TYPE_CHECKING:
    from soilmoist_ros.lab import Campaign


@click.command("campaign")
@click.argument("campaign", type=Parsed("campaign"))
@click.option("--runs", type=click.IntRange(min=1), help="Runs of each combination, instead of those of the file.")
@click.option("--workers", type=click.IntRange(min=0), help="Local processes. Default: one per core.")
@output_options()
@answering
def command(campaign: str, runs: int | None, workers: int | None, out: Path, overwrite: bool) -> None:
    """Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).

    The folder --out keeps finished missions: run the same command again to resume after an interruption.
    Writes results.csv, missions.csv and report.html.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before numpy is loaded: more threads round differently
    from soilmoist_ros.lab import CampaignInterrupted, load_campaign, run_campaign, write_campaign_report
    from soilmoist_ros.simulation import simulate_mission

    plan = load_campaign(campaign)
    if runs is not None:
        plan = plan.model_copy(update={"runs": tuple(range(1, runs + 1))})
    _prepare(plan, out, overwrite)
    try:
        with progress_bar() as progress:
            outcome = run_campaign(
                plan, out, simulate_mission, workers,
                lambda done, total: progress(f"{total} missions", done / total),
            )  # fmt: skip
    except CampaignInterrupted as stopped:
        echo(str(stopped), err=True)
        sys.exit(130)
    for remark in outcome.remarks:
        warn(f"note: {remark}")
    put(simulated=outcome.computed, reused=outcome.reused, failures=list(map(str, outcome.failures)), out=str(out))
    say(f"missions   {outcome.computed} simulated, {outcome.reused} reused, {len(outcome.failures)} failed")
    for failure in outcome.failures:
        echo(f"failed: {failure}", err=True)
    with progress_bar() as progress_of:
        progress_of("writing the report", 1.0)
        report = write_campaign_report(plan, out, outcome.runs, outcome.failures)
    wrote((*outcome.written, *filter(None, [report])))
    if not outcome.complete:
        sys.exit(1)


def _prepare(plan: Campaign, out: Path, overwrite: bool) -> None:
    """Check the output folder; missions of this campaign in it are resumed without a question."""
    from soilmoist_ros.lab import RUNS, missions

    stored = {path.stem for path in (out / RUNS).glob("*.npz")}
    if not (out / RUNS).is_dir():
        from soilmoist_ros.reporting import earlier_outputs, remove_earlier

        prepare_output(out, overwrite)
        remove_earlier(out, earlier_outputs(out), ())
    elif stored and stored.isdisjoint(mission.key for mission in missions(plan)) and not overwrite:
        remedy = "choose another output folder, or give --overwrite"
        raise InputError("has the results of another campaign", remedy, out)
