# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist simulate``: simulate one mission on a surrogate field."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli import options
from soilmoist_ros.cli.answer import (
    answering,
    echo,
    print_certificate,
    print_knowledge,
    print_mission,
    print_notes,
    progress_bar,
    say,
    wrote,
)
from soilmoist_ros.cli.mission_options import (
    GroupedCommand,
    chosen_settings,
    irrigation_of,
    irrigation_option,
    mission_options,
)

if TYPE_CHECKING:
    from soilmoist_ros.console import WatchedMission
    from soilmoist_ros.pipeline import MapRun
    from soilmoist_ros.simulation import MissionResult, MissionSettings

TIME_FACTOR = 60.0
"""Simulated seconds per real second of a mission that is watched."""


@click.command("simulate", cls=GroupedCommand)
@mission_options()
@click.option("--live", is_flag=True,
              help="Show the mission in a browser as it runs; Ctrl-C ends it and keeps the results.")  # fmt: skip
@click.option("--time-factor", type=click.FloatRange(min=0.1),
              help="Simulated seconds per real second, with --live. Default: 60.")  # fmt: skip
@options.earlier_option(" Not for a series of simulated surveys: --earlier-surveys.")
@options.covariate_option()
@irrigation_option
@options.output_options()
@answering
def command(
    out: Path,
    overwrite: bool,
    live: bool,
    time_factor: float | None,
    earlier: tuple[Path, ...],
    covariates: tuple[str, ...],
    site: str | None,
    choices: dict[str, Any],
) -> None:
    """Explore a surrogate field with a simulated robot, without ROS.

    Writes summary.json, map.tif, samples.geojson, soilmoist.qgs, report.html, series.csv and visits.csv to --out.
    Each additional property NAME also gets map_NAME.tif and samples_NAME.geojson.
    """
    if time_factor is not None and not live:
        raise click.UsageError("--time-factor requires --live")
    irrigation = irrigation_of(site)
    settings = chosen_settings(choices, irrigation)
    options.prepare_output(out, overwrite)
    from soilmoist_ros.mapping import CovariateSource
    from soilmoist_ros.pipeline import mission_earlier
    from soilmoist_ros.reporting import mission_run, write_mission
    from soilmoist_ros.simulation import simulate_mission

    sources = list(map(CovariateSource.parse, covariates))
    with ExitStack() as stack:
        page = stack.enter_context(_live(settings, time_factor or TIME_FACTOR, out)) if live else None
        watch = None if page is None else page.show
        with progress_bar() as progress:
            runs = mission_earlier(settings, earlier)
            surveys = {name: [run.survey for run in its] for name, its in runs.items()}
            result = simulate_mission(
                settings, lambda share: progress("exploring", share), True, surveys, sources, watch
            )
            progress("writing the results", 1.0)
            run = None if result.soil_map is None else mission_run(result, earlier=runs, irrigation=irrigation)
            written = write_mission(out, result, run=run)
        _print_summary(result, run)
        wrote(written, out)
        if page is not None and not page.stopped and sys.stdin.isatty() and sys.stdout.isatty():
            say(f"page       {page.address} stays until Ctrl-C")
            page.wait()
        elif page is not None and page.stopped:
            echo("interrupted: the results are those of the mission until then", err=True)
            sys.exit(130)
    if run is None:
        sys.exit(1)


@contextmanager
def _live(settings: MissionSettings, time_factor: float, out: Path) -> Iterator[WatchedMission]:
    """The page of the mission; the first Ctrl-C ends the mission, and the second one the command."""
    from soilmoist_ros.console import WatchedMission
    from soilmoist_ros.simulation import robot_namespaces, surrogate_field

    field = surrogate_field(settings.field_name).field
    robots = robot_namespaces(settings.robots)
    note = f"A simulated mission, {time_factor:g} times as fast as a real one. Ctrl-C in the terminal ends it."
    with WatchedMission(
        field, field.grid(settings.cell_m), robots, time_factor, out.absolute().parent, note
    ) as page:
        say(f"page       {page.address}")
        before = signal.getsignal(signal.SIGINT)

        def stop(*_: object) -> None:
            page.stop()
            signal.signal(signal.SIGINT, before)

        signal.signal(signal.SIGINT, stop)
        try:
            yield page
        finally:
            signal.signal(signal.SIGINT, before)


def _print_summary(result: MissionResult, run: MapRun | None) -> None:
    from soilmoist_ros.reporting import decision, irrigation

    print_mission(result)
    if run is None:
        say("map        no map: the mission ended before the first map update; report.html says what to do")
        return
    for one in run.properties:
        print_knowledge(one)
    if run.soil_map.curve is not None:
        say(f"irrigation {irrigation(run).steps[0]}")
    if (decided := decision(run)) is not None:
        say(f"decision   {decided.shares}\n           {decided.level}")
    print_certificate(run)
    for one in run.properties:
        print_notes(one)
