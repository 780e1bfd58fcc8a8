"""``soilmoist replay``: map a recorded run again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli.bag import play
from soilmoist_ros.cli.console import (
    FILE,
    VariogramModel,
    print_knowledge,
    print_notes,
    progress_bar,
    rate_error,
    report_errors,
)
from soilmoist_ros.cli.options.knowledge_options import covariate_option, earlier_option, reference_option
from soilmoist_ros.cli.options.output_options import output_options, prepare_output, reported_failure
from soilmoist_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from soilmoist_ros.replay import Replay


@click.command("replay")
@click.argument("bag", type=FILE)
@click.option("--field", help="Field file. Default: as in the run.")
@click.option("--site", help="Site file: corrections, soil, calibration. Default: as in the run.")
@click.option("--property", "properties", multiple=True,
              help="Property of the bag to map, repeatable. Default: all.")  # fmt: skip
@click.option("--truth", "truths", multiple=True, metavar="[PROPERTY=]FIELD",
              help="Surrogate field to compare with: a built-in one, or a field file with a truth. "
              "PROPERTY defaults to the first one. Repeatable.")  # fmt: skip
@click.option("--also-truth", hidden=True)
@click.option(
    "--model",
    type=VariogramModel(),
    help="Variogram model: gaussian, exponential, spherical, matern32, matern52, "
    "or one of a plug-in. Default: as in the run.",
)
@click.option("--fit", type=click.Choice(["reml", "soft_l1"]), help="Variogram fit. Default: as in the run.")
@click.option(
    "--noise", type=click.Choice(["local", "mean"]), help="Rate in the Poisson noise. Default: as in the run."
)
@click.option("--local", type=click.Choice(["auto", "off"]),
              help="Whether the variance may differ from place to place. Default: as in the run.")  # fmt: skip
@click.option("--drift-model", type=click.Choice(["auto", "off"]),
              help="Whether the mean rate may change during the survey. Default: as in the run.")  # fmt: skip
@click.option("--nugget", type=click.Choice(["keep", "filter"]),
              help="keep: map the rate with its micro-scale variation; filter: its smooth part only.")  # fmt: skip
@click.option("--cell", "cell_m", type=click.FloatRange(min=0, min_open=True), help="Cell size [m].")
@click.option("--merge", "merge_radius_m", type=click.FloatRange(min=0),
              help="Radius within which records are merged into one sample [m].")  # fmt: skip
@click.option("--source", type=click.Choice(["counts", "raw"]), default="counts", show_default=True,
              help="counts: records as the driver corrected them; raw: raw lines, corrected again.")  # fmt: skip
@click.option("--logger", help="Logger format of the raw lines. Default: detected from the header.")
@click.option("--counts-topic", default="counts", show_default=True, help="Topic with the records.")
@earlier_option(" Default: as in the run; none for a map without.")
@reference_option
@covariate_option(" Default: as in the run; none for those of the field only.")
@click.option("--crs", help="CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum.")
@output_options("Folder for the results; made if missing. Required.", required=False)
@click.option("--live", is_flag=True, hidden=True)
@click.option("--topics", hidden=True)
@click.option("--speed", type=float, hidden=True)
@click.option("--start", "start_s", type=float, hidden=True)
@report_errors
def command(
    bag: Path,
    out: Path | None,
    overwrite: bool,
    crs: str | None,
    nugget: str | None,
    live: bool,
    topics: str | None,
    speed: float | None,
    start_s: float | None,
    truths: tuple[str, ...],
    earlier: tuple[Path, ...],
    covariates: tuple[str, ...],
    also_truth: str | None,
    **choices: Any,
) -> None:
    """Map the records of a BAG again: the folder of a run or bag, or an MCAP or db3 file.

    With the settings of the run, the map equals the map of the robot bit for bit.
    """
    if live:
        click.echo("warning: replay --live has become soilmoist bag play", err=True)
        play(bag, topics, speed or 1.0, start_s or 0.0)
        return
    if any(option is not None for option in (topics, speed, start_s)):
        raise InputError("replay does not support --topics, --speed and --start", "use soilmoist bag play")
    if out is None:
        raise InputError("replay needs a folder for the results", "give it with --out")
    prepare_output(out, overwrite)
    from soilmoist_ros.replay import ReplaySettings, replay_bag
    from soilmoist_ros.reporting import write_outputs

    keep_nugget = None if nugget is None else nugget == "keep"
    named: dict[str | int, str] = dict(_truth(text) for text in truths)
    if also_truth is not None:
        click.echo("warning: --also-truth is deprecated: give --truth PROPERTY=FIELD", err=True)
        named[1] = also_truth
    with progress_bar() as progress:
        settings = ReplaySettings(
            keep_nugget=keep_nugget,
            truths=named,
            crs=crs,
            earlier=_earlier(earlier),
            covariates=() if covariates == ("none",) else covariates or None,
            **choices,
        )
        with reported_failure(out):
            replay = replay_bag(bag, settings, progress)
        progress("writing the results", 1.0)
        written = write_outputs(out, replay.run, crs)
    print_replay(replay)
    for path in written:
        click.echo(f"wrote {path}")


def _earlier(paths: tuple[Path, ...]) -> tuple[Path, ...] | None:
    """Earlier runs: those of the run if none are given, and none for ``none``."""
    return () if paths == (Path("none"),) else paths or None


def _truth(text: str) -> tuple[str | int, str]:
    """Property and field of a ``--truth``; 0 is the first property. An = within a file path does not split it."""
    name, equals, field = text.partition("=")
    return (name, field) if equals and name.isidentifier() else (0, text)


def print_replay(replay: Replay) -> None:
    """Print the results of a run in a few lines."""
    from soilmoist_ros.reporting.page.statistics import truth_score

    mission = replay.run.mission
    if mission is not None and mission.series:
        last = mission.series[-1]
        click.echo(
            f"mission    {last.time_s / 3600:.2f} h, {last.distance_m:.0f} m, "
            f"{last.samples} stops: {mission.ended}"
        )
        if math.isfinite(last.vwc_rmse):
            click.echo(f"moisture   RMSE {last.vwc_rmse:.4f} m3/m3")
    for run, comparison in zip(replay.run.properties, replay.comparisons, strict=True):
        click.echo(
            f"property   {run.name}, {len(run.track)} records merged into {len(run.soil_map.samples)} samples"
        )
        if run.truth_rate is not None:
            score = truth_score(run.soil_map, run.truth_rate)
            click.echo(f"rate       {rate_error(score.rmse**2, score.coverage95)}")
        print_knowledge(run)
        click.echo(f"map        {comparison.message}")
        print_notes(run)
