# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist replay``: map a recorded run again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli import options
from soilmoist_ros.cli.answer import (
    answering,
    print_certificate,
    print_knowledge,
    print_losses,
    print_mission,
    print_notes,
    progress_bar,
    say,
    wrote,
)

if TYPE_CHECKING:
    from soilmoist_ros.pipeline import Replay, ReplaySettings


@click.command("replay")
@click.argument("bag", type=options.FILE)
@click.option("--field", type=options.named("field"), help="Field file. Default: as in the run.")
@click.option(
    "--site", type=options.named("site"), help="Site file: corrections, soil, calibration. Default: as in the run."
)
@click.option("--truth", "truths", type=options.Parsed("field"), multiple=True, metavar="[PROPERTY=]FIELD",
              help="Surrogate field to compare with: a built-in one, or a field file with a truth. "
              "PROPERTY defaults to the first one. Repeatable.")  # fmt: skip
@options.map_options("as in the run")
@click.option("--counts-topic", default="counts", show_default=True, help="Topic with the records.")
@options.earlier_option(" Default: as in the run; none for a map without.")
@options.covariate_option(" Default: as in the run; none for those of the field only.")
@options.crs_option
@options.output_options()
@answering
def command(
    bag: Path,
    out: Path,
    overwrite: bool,
    crs: str | None,
    truths: tuple[str, ...],
    earlier: tuple[Path, ...],
    covariates: tuple[str, ...],
    **choices: Any,
) -> None:
    """Map the records of a BAG again: the folder of a run or bag, or an MCAP, db3 or ROS 1 .bag file.

    With the settings of the run, the map equals the map of the robot bit for bit.
    """
    options.prepare_output(out, overwrite)
    from soilmoist_ros.pipeline import ReplaySettings

    named = dict(_truth(text) for text in truths)
    settings = ReplaySettings(
        truths=named, crs=crs, earlier=_earlier(earlier),
        covariates=() if covariates == ("none",) else covariates or None, **options.chosen_settings(choices),
        **choices,
    )  # fmt: skip
    wrote(map_recording(bag, settings, out), out)


def map_recording(bag: Path, settings: ReplaySettings | None, out: Path) -> list[Path]:
    """Map a recording into a folder, print what came of it, and return the files; without a map, write why."""
    from soilmoist_ros.pipeline import NoMapError, replay_bag
    from soilmoist_ros.reporting import write_failed, write_outputs

    with progress_bar() as progress:
        try:
            replay = replay_bag(bag, settings, progress)
        except NoMapError as error:
            wrote(write_failed(out, error.failed), out)
            raise
        progress("writing the results", 1.0)
        written = write_outputs(out, replay.run, settings.crs if settings else None)
    _print(replay)
    return written


def _earlier(paths: tuple[Path, ...]) -> tuple[Path, ...] | None:
    """Earlier runs from the command line: ``None`` (as in the bag) without any, empty for ``none``."""
    return () if paths == (Path("none"),) else paths or None


def _truth(text: str) -> tuple[str, str]:
    """Property, empty for the first, and field of a ``--truth``. An = within a file path does not split it."""
    name, equals, field = text.partition("=")
    return (name, field) if equals and name.isidentifier() else ("", text)


def _print(replay: Replay) -> None:
    """Print the results of a run in a few lines."""
    from soilmoist_ros.reporting import truth_score

    if replay.run.mission is not None:
        print_mission(replay.run.mission)
    print_certificate(replay.run)
    for run, comparison in zip(replay.run.properties, replay.comparisons, strict=True):
        what = run.name if run.soil_map.curve else f"{run.name}, rates only: it needs a calibrated --site"
        samples = len(run.soil_map.samples)
        say(f"property   {what}; {len(run.track)} records merged into {samples} sample{'s' * (samples != 1)}")
        print_losses(run)
        if run.truth_rate is not None:
            score = truth_score(run.soil_map, run.truth_rate)
            inside = f"{100 * score.coverage95:.0f} % of the cells within their 95 % interval"
            say(f"rate       MSE {score.rmse**2:.4f} (counts/s)2, {inside}")
        print_knowledge(run)
        say(f"map        {comparison}")
        print_notes(run)
