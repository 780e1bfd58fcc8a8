# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist demo``: the whole ROS system on a simulated field."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli import options
from soilmoist_ros.cli.answer import answering, echo, live_view, say, warn, wrote
from soilmoist_ros.cli.mission_options import (
    GroupedCommand,
    chosen_settings,
    irrigation_of,
    irrigation_option,
    mission_options,
)
from soilmoist_ros.cli.replay import map_recording
from soilmoist_ros.foundation import InputError, install, is_installed
from soilmoist_ros.mapping import FIT_SETTINGS

DEMO = (
    *("field", "strategy", "dwell", "target", "threshold", "hours", "seed", "robots", *FIT_SETTINGS),
    *("preset", "until", "until_sd", "until_gain", "certify", "properties", "stop_overhead_s"),
    *("metre_cost_s", "min_dwell_s"),
)
"""Mission settings that are options of the demo."""
_TYPES = {"goto_node": "topological_navigation_msgs", "navigate_to_pose": "nav2_msgs"}
"""Package with the action of a navigator."""
DEFAULTS = {"field": "farm", "hours": 1.0}
"""Settings of a demo that differ from those of a simulated mission; the hour lasts a minute."""


@click.command("demo", cls=GroupedCommand)
@mission_options(DEMO, DEFAULTS)
@click.option("--time-factor", type=click.FloatRange(min=0.1, max=200), default=60.0, show_default=True,
              help="Simulated seconds per real second.")  # fmt: skip
@click.option("--navigator", type=click.Choice(["goto_node", "navigate_to_pose", "goal_pose"]),
              help="Navigation interface. Default: goto_node if its action is built, else goal_pose.")  # fmt: skip
@click.option("--scenario", type=options.named("scenario"), default="",
              help="Simulated faults: thorvald, nav2, bad_link, bad_sensor, "
              "or a file. Default: none.")  # fmt: skip
@click.option("--console/--no-console", "console", default=True, show_default=True,
              help="Serve the operator's page on this machine.")  # fmt: skip
@click.option("--autostart/--no-autostart", default=True, show_default=True,
              help="Start the mission at once, or wait for a start on the operator's page.")  # fmt: skip
@click.option("--exit", "leave", is_flag=True, help="End with the mission, also on a terminal.")
@options.earlier_option()
@options.covariate_option()
@irrigation_option
@options.output_options("Folder for the run; made if missing.")
@answering
def command(
    out: Path,
    overwrite: bool,
    navigator: str | None,
    choices: dict[str, Any],
    time_factor: float,
    scenario: str,
    console: bool,
    autostart: bool,
    leave: bool,
    earlier: tuple[Path, ...],
    covariates: tuple[str, ...],
    site: str | None,
) -> None:
    """Run the whole ROS system on a simulated field: all nodes as processes, with a live view.

    Writes summary.json, map.tif, samples.geojson, soilmoist.qgs, report.html, series.csv and visits.csv to --out.
    The folder also gets the recording (bag/), the configuration (configuration/) and the node output (log/).
    On a terminal the operator's page stays after the mission until Ctrl-C.
    """
    if importlib.util.find_spec("rclpy") is None:
        remedy = "scripts/demo sets it up; on a robot, source /opt/ros/jazzy/setup.bash"
        raise InputError("rclpy is not installed", remedy)
    if navigator is None:
        navigator = "goto_node" if importlib.util.find_spec("topological_navigation_msgs") else "goal_pose"
    package = _TYPES.get(navigator, "rclpy")
    if importlib.util.find_spec(package) is None:
        raise InputError(f"{package} is not installed, and {navigator} needs it", "run scripts/build_interfaces")
    irrigation = irrigation_of(site)
    mission = chosen_settings(choices, irrigation)
    _prepare(out, overwrite)
    from soilmoist_ros.console import PORT, free_port
    from soilmoist_ros.mapping import CovariateSource, read_covariates
    from soilmoist_ros.nodes import DemoSettings, run_demo
    from soilmoist_ros.pipeline import mission_earlier
    from soilmoist_ros.simulation import surrogate_field

    mission_earlier(mission, earlier)  # before the nodes start
    sources = tuple(map(CovariateSource.parse, covariates))
    field = surrogate_field(mission.field_name).field
    read_covariates((*field.covariates, *sources), field.frame, field.grid())
    if console and not is_installed("aiohttp"):
        console = False
        warn(f"console: not served, aiohttp is not installed -> {install('console')}")
    port = free_port(PORT) if console else 0
    settings = DemoSettings(
        out, mission, time_factor, navigator, scenario, autostart, True, earlier, sources, port, irrigation
    )
    address = f"console    http://127.0.0.1:{port}/"
    written = list[Path]()
    try:
        with ExitStack() as stack:
            with live_view() as show:
                recorded = stack.enter_context(run_demo(settings, show, partial(say, address)))
            written = map_recording(out / "bag", recorded, out)
            wrote((*written, out / "bag"), out)
            if console and not leave and sys.stdin.isatty() and sys.stdout.isatty():
                say(f"{address} stays until Ctrl-C")
                while True:
                    time.sleep(1.0)
    except KeyboardInterrupt:
        if not written:
            remedy = f"soilmoist replay {out} --out {out}-map maps the recording"
            echo(f"interrupted: all nodes have stopped; {remedy}", err=True)
            sys.exit(130)


def _prepare(out: Path, overwrite: bool) -> None:
    """Check the output folder, and remove the recording of an earlier demo that may be replaced."""
    recorded = (out / "bag").exists()
    if recorded and not (out / "configuration" / "field_simulator.yaml").is_file():
        raise InputError(
            "has a recording that is not of a demo", "choose another folder: it is never replaced", out
        )
    if recorded and not overwrite:
        raise InputError("has the recording of a demo", "choose another folder, or give --overwrite", out)
    options.prepare_output(out, overwrite)
    if recorded:
        from soilmoist_ros.reporting import earlier_outputs, remove_earlier

        for name in ("bag", "configuration", "log", "viewers"):
            shutil.rmtree(out / name, ignore_errors=True)
        for saved in (out / "map", *out.glob("map_*/")):  # by the mappers
            remove_earlier(saved, earlier_outputs(saved), ())
