"""Subcommands of ``soilmoist`` about runs with ROS: ``demo``, ``replay`` and ``bag``."""

from __future__ import annotations

import importlib.util
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli.console import FILE, VariogramModel, progress_bar, rate_error, report_errors
from soilmoist_ros.cli.mission_options import chosen_settings, mission_options
from soilmoist_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from soilmoist_ros.replay import Replay
    from soilmoist_ros.reporting.live.live_mission import LiveMission

_SHOW_S = 0.5
DEMO = ("field", "strategy", "dwell", "hours", "seed", "model", "fit", "preset", "properties")
"""Settings of a mission that the demo has as options."""
DEMO_HOURS = 1.0
"""Mission time of a demo if none is given [h]: a minute with the default time factor."""


@click.command("demo")
@mission_options(DEMO)
@click.option("--time-factor", type=click.FloatRange(min=0.1, max=200), default=60.0, show_default=True,
              help="Simulated time per real time.")  # fmt: skip
@click.option("--speed", "old_speed", type=float, hidden=True)
@click.option("--navigator", type=click.Choice(["goto_node", "goal_pose"]),
              help="How goals are sent. Default: goto_node if its action is built, else goal_pose.")  # fmt: skip
@click.option("--scenario", default="", help="What goes wrong: thorvald, bad_link, or a file. Default: nothing.")
@click.option("--out", type=FILE, required=True, help="Folder for the run; made if missing.")
@report_errors
def demo_command(
    out: Path,
    navigator: str | None,
    choices: dict[str, Any],
    old_speed: float | None,
    time_factor: float,
    scenario: str,
) -> None:
    """Run the whole ROS system on a simulated field: all nodes as processes, with a live view.

    Writes summary.json, map.tif, samples.geojson, report.html, series.csv and visits.csv to the folder --out, and
    there the recording (bag/), the configuration of the nodes (configuration/) and their output (log/).
    """
    for module, remedy in (("rclpy", "scripts/demo sets it up; on a robot, source /opt/ros/jazzy/setup.bash"),):
        if importlib.util.find_spec(module) is None:
            raise InputError(f"{module} is not installed", remedy)
    if old_speed is not None:
        click.echo("warning: --speed of the demo has become --time-factor", err=True)
        time_factor = old_speed
    if navigator is None:
        navigator = "goto_node" if importlib.util.find_spec("topological_navigation_msgs") else "goal_pose"
    from soilmoist_ros.nodes.system.demo import DemoSettings, run_demo
    from soilmoist_ros.reporting import write_outputs

    try:
        with _live_view() as show:
            mission = chosen_settings({"hours": DEMO_HOURS, **choices})
            replay = run_demo(DemoSettings(out, mission, time_factor, navigator, scenario), show)
    except KeyboardInterrupt:
        click.echo(f"interrupted: the nodes have ended; soilmoist replay {out} maps what was recorded", err=True)
        sys.exit(130)
    written = write_outputs(out, replay.run)
    print_replay(replay)
    for path in (*written, out / "bag"):
        click.echo(f"wrote {path}")


@click.command("replay")
@click.argument("bag", type=FILE)
@click.option("--field", help="Field file. Default: that of the run.")
@click.option("--site", help="Site file: corrections, soil, calibration. Default: that of the run.")
@click.option("--property", "properties", multiple=True,
              help="Property of the bag to map, repeatable. Default: all.")  # fmt: skip
@click.option("--truth", "truths", multiple=True, metavar="[PROPERTY=]FIELD",
              help="Surrogate field to compare with: a built-in one, or a field file with a truth. Of the first "
              "property if none is named; repeatable.")  # fmt: skip
@click.option("--also-truth", hidden=True)
@click.option(
    "--model",
    type=VariogramModel(),
    help="Variogram model: gaussian, exponential, spherical, matern32, matern52, "
    "or that of a plug-in. Default: that of the run.",
)
@click.option("--fit", type=click.Choice(["reml", "soft_l1"]), help="Variogram fit. Default: that of the run.")
@click.option("--nugget", type=click.Choice(["keep", "filter"]),
              help="Map the rate with its micro-scale variation, or its smooth part only.")  # fmt: skip
@click.option("--cell", "cell_m", type=click.FloatRange(min=0, min_open=True), help="Cell size [m].")
@click.option("--merge", "merge_radius_m", type=click.FloatRange(min=0),
              help="Records within this radius become one sample [m].")  # fmt: skip
@click.option("--source", type=click.Choice(["counts", "raw"]), default="counts", show_default=True,
              help="The records as the driver corrected them, or the raw lines, corrected anew.")  # fmt: skip
@click.option("--logger", help="Logger format of the raw lines. Default: told from their header.")
@click.option("--counts-topic", default="counts", show_default=True, help="Topic with the records.")
@click.option("--crs", help="CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum.")
@click.option("--out", type=FILE, help="Folder for the results; made if missing. Required without --live.")
@click.option("--live", is_flag=True,
              help="Publish the bag to running nodes, with /clock; the options below are for this.")  # fmt: skip
@click.option("--topics", help="Pattern of the full names to publish. Default: what mapper and planner take in.")
@click.option("--speed", type=click.FloatRange(min=0.01, max=200), help="Recorded time per time. Default: 1.")
@click.option("--start", "start_s", type=click.FloatRange(min=0), help="Start after this time of the bag [s].")
@click.pass_context
@report_errors
def replay_command(
    context: click.Context,
    bag: Path,
    out: Path | None,
    crs: str | None,
    nugget: str | None,
    live: bool,
    topics: str | None,
    speed: float | None,
    start_s: float | None,
    truths: tuple[str, ...],
    also_truth: str | None,
    **choices: Any,
) -> None:
    """Map the records of a BAG again: the folder of a run or bag, or an MCAP or db3 file.

    With the settings of the run the map is the one that the robot had, bit for bit.

    With --live nothing is mapped here: nodes with use_sim_time hear the robot again. The space bar pauses.
    """
    for name in set(context.params) - {"bag", "live"}:
        given = context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE
        if given and live != (name in ("topics", "speed", "start_s")):
            option = next(one.opts[0] for one in context.command.params if one.name == name)
            raise InputError(f"{option} means nothing {'with' if live else 'without'} --live", "leave it out")
    if live:
        _play(bag, topics, speed or 1.0, start_s or 0.0)
        return
    if out is None:
        raise InputError("there is no folder for the results", "give it with --out, or play the bag with --live")
    from soilmoist_ros.replay import ReplaySettings, replay_bag
    from soilmoist_ros.reporting import write_outputs

    keep_nugget = None if nugget is None else nugget == "keep"
    named: dict[str | int, str] = dict(_truth(text) for text in truths)
    if also_truth is not None:
        click.echo("warning: --also-truth is deprecated: give --truth PROPERTY=FIELD", err=True)
        named[1] = also_truth
    with progress_bar() as progress:
        replay = replay_bag(bag, ReplaySettings(keep_nugget=keep_nugget, truths=named, **choices), progress)
        progress("writing the results", 1.0)
        written = write_outputs(out, replay.run, crs)
    print_replay(replay)
    for path in written:
        click.echo(f"wrote {path}")


def _truth(text: str) -> tuple[str | int, str]:
    """Property, 0 for the first, and field of a ``--truth``; an = in the path of a file splits nothing."""
    name, equals, field = text.partition("=")
    return (name, field) if equals and name.isidentifier() else (0, text)


def _play(bag: Path, topics: str | None, speed: float, start_s: float) -> None:
    """Play a bag to the nodes of this ROS system."""
    if importlib.util.find_spec("rclpy") is None:
        raise InputError("rclpy is not installed", "on a robot, source /opt/ros/jazzy/setup.bash")
    from soilmoist_ros.cli.key_press import on_space
    from soilmoist_ros.nodes.wiring.bag_player import player_of
    from soilmoist_ros.recording.bag.playback import INPUTS
    from soilmoist_ros.recording.run_folder import bag_of

    def say(text: str) -> None:
        click.echo(f"note: {text}", err=True)

    with (
        player_of(bag_of(bag), topics or INPUTS, speed, start_s, say) as player,
        on_space(player.toggle),
        progress_bar() as progress,
    ):
        progress("waiting for nodes that listen", 0.0)
        player.wait_for_listeners()
        count = player.play(progress)
    click.echo(f"played {count} messages")


@click.group("bag")
def bag_group() -> None:
    """Look into recordings, and recover those that were cut off."""


@bag_group.command("info")
@click.argument("bag", type=FILE)
@report_errors
def bag_info_command(bag: Path) -> None:
    """Tell what is in a BAG. Exit code 1 if it is damaged or unfinished."""
    from rich.console import Console

    from soilmoist_ros.recording.bag.info import bag_info
    from soilmoist_ros.recording.bag.tables import info_table, print_plain
    from soilmoist_ros.recording.run_folder import bag_of

    info = bag_info(bag_of(bag))
    print_plain(Console(), info_table(info))
    if not info.whole:
        sys.exit(1)


@bag_group.command("recover")
@click.argument("bag", type=FILE)
@click.option("--out", type=FILE, required=True, help="Folder for the recovered bag; must not exist.")
@report_errors
def bag_recover_command(bag: Path, out: Path) -> None:
    """Make a valid bag of a BAG that was cut off at any byte. The original stays as it is."""
    from rich.console import Console

    from soilmoist_ros.recording.bag.recovery import recover_bag
    from soilmoist_ros.recording.bag.tables import print_plain, recovery_table
    from soilmoist_ros.recording.run_folder import bag_of, copy_configuration

    recovered = recover_bag(bag_of(bag), out)
    copy_configuration(bag_of(bag), out)
    print_plain(Console(), recovery_table(recovered))


def print_replay(replay: Replay) -> None:
    """What a run came to, in a few lines."""
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
        click.echo(f"map        {comparison.message}")


@contextmanager
def _live_view() -> Iterator[Callable[[LiveMission], None]]:
    """Show a mission: a picture that is kept up to date on a terminal, a line per change of state otherwise."""
    from rich.console import Console

    from soilmoist_ros.reporting.live.terminal import render

    console = Console()
    if not console.is_terminal:
        said = ""

        def plain(live: LiveMission) -> None:
            nonlocal said
            text = live.state
            if text.partition(" (")[0] != said:
                said = text.partition(" (")[0]
                used_s = float(live.status.get("time_used_s", 0.0))
                click.echo(f"{used_s:7.0f} s  {text}")

        yield plain
        return
    from rich.live import Live

    shown_s = 0.0
    with Live(console=console, auto_refresh=False, transient=False) as screen:

        def picture(live: LiveMission) -> None:
            nonlocal shown_s
            now_s = time.monotonic()
            if now_s - shown_s >= _SHOW_S:
                shown_s = now_s
                rows = max(6, min(22, console.height - 9 - len(live.maps)))
                screen.update(render(live.view(), min(64, console.width - 2), rows), refresh=True)

        yield picture
