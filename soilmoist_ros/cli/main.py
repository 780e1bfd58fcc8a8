# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ``soilmoist`` command.

Each subcommand is in the file of its name and is loaded on use, which keeps ``--help`` fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from soilmoist_ros.cli.answer import EXIT_CODES
from soilmoist_ros.foundation import __version__, did_you_mean

COMMANDS = {
    "map": "Map soil moisture from neutron LOGS.",
    "simulate": "Explore a surrogate field with a simulated robot, without ROS.",
    "demo": "Run the whole ROS system on a simulated field: all nodes as processes, with a live view.",
    "guide": "Guide a person with a hand cart, quad or car through an adaptive survey, without ROS.",
    "watch": "Watch a running survey in a terminal, until Ctrl-C: state, forecast and numbers.",
    "campaign": "Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).",
    "replay": "Map the records of a BAG again: the folder of a run or bag, or an MCAP, db3 or ROS 1 .bag file.",
    "bag": "Inspect recordings, play them, and recover interrupted ones.",
    "export": "Export a RUN for GIS, paper and farm terminals.",
    "season": "Make a time series of all RUNS of one field.",
    "calibrate": "Find N0 from soil CORES (a CSV file) and the counts at the calibration.",
    "graph": "Build a travel graph for a FIELD: a topological map, or a graph of Nav2.",
    "list": "List what can be chosen by name: fields, strategies, loggers, sites ...",
    "logger": "Draft a logger format (YAML) from the header and first lines of FILE.",
    "failsafe": "Show what the guard does about a CAUSE, and why: in each phase of a mission.",
    "check": "Check configuration files and report every mistake in them.",
}
"""Subcommands with the first sentence of their help."""
_PLAY = "play recordings with soilmoist bag play"
_RAW = "soilmoist map corrects the lines in a bag anew, with these options but --source"
RENAMED = {
    "--variogram": "use --model", "--also": "use --property FIELD[:WEIGHT]",
    "--also-weight": "use --property FIELD:WEIGHT", "--overhead": "use --stop-overhead",
    "--also-truth": "use --truth PROPERTY=FIELD", "--speed": f"use --time-factor, or {_PLAY}",
    **dict.fromkeys(("--live", "--topics", "--start"), _PLAY),
    "--figures": "print report.html, or draw map.tif", "--local": "the variance is alike everywhere",
    "--formats": "soilmoist list exports shows the formats", "--step": "a GIS draws contours from map.tif",
    **dict.fromkeys(("--learn-travel", "--no-learn-travel"), "the planner always learns from the legs driven"),
    **dict.fromkeys(("--survey-days", "--pattern-days"), "surveys are a week apart"),
    "--real-speed": "use --speed", "--turn": "turns are part of the travel times that the planner learns",
    "--stop-cost": "--min-dwell makes stops longer and fewer",
    **dict.fromkeys(("--source", "--logger-topic", "--fix-topic", "--gnss-shift"), _RAW),
    "--property": "replay maps all properties, or that of --counts-topic; watch shows the mission alone",
    **dict.fromkeys(("--zones", "--root-depth"), "management zones are those of the report"),
    "--reference": "maps allow for a change during a survey by themselves",
    **dict.fromkeys(("--exact", "--workers"), "of more than 2000 samples, neighbours are pooled"),
    "--scheduler": "maps pool neighbours; for a campaign, docs/campaigns.md says how several computers share it",
}  # fmt: skip
"""Options of earlier releases, and what to do."""
EXAMPLES = {
    "map": (
        "map examples/rover_gypsum_transect_2018-05-01.KSU --site gypsum_transect --out out/gypsum",
        "map survey.log --nmea gnss.nmea --site my_site.yaml --field my_field.yaml --out out/may",
        "map survey.bag --logger-topic /crns/line --fix-topic /gps/fix --site my_site.yaml --out out/ros1",
        "map june.log --earlier out/may --covariate relief.tif:slope --out out/june",
    ),
    "simulate": (
        "simulate --field patches --hours 1 --out out/patches",
        "simulate --strategy lattice --dwell fmi:120 --seed 7 --out out/lattice",
        "simulate --field validation --robots 3 --until-sd 0.02 --out out/three",
    ),
    "demo": (
        "demo --out out/demo",
        "demo --field validation --hours 2 --robots 3 --out out/team",
        "demo --scenario bad_link --no-console --exit --out out/bad-link",
    ),
    "guide": (
        "guide --field my_field.yaml --logger-uri tcp://192.168.1.20:4001 --gnss-uri serial:///dev/ttyACM0 "
        "--hours 1.5 --out out/monday",
        "guide --field my_field.yaml --site my_site.yaml --logger-uri serial:///dev/ttyUSB0?baud=9600 "
        "--gnss-uri tcp://127.0.0.1:4002 --host 0.0.0.0 --out out/tuesday",
    ),
    "watch": ("watch", "watch --robot robot_1 --robot robot_2"),
    "campaign": (
        "campaign paper --runs 1 --out out/paper",
        "campaign my_campaign.yaml --workers 4 --out out/mine",
    ),
    "replay": (
        "replay out/demo --out out/again",
        "replay out/demo --model exponential --nugget filter --out out/smooth",
        "replay bag_0.mcap --field my_field.yaml --site my_site.yaml --out out/field",
    ),
    "bag": ("bag info out/demo", "bag verify runs/may/bag runs/june/bag", "bag recover broken.mcap --out whole"),
    "bag info": ("bag info out/demo", "bag info bag_0.mcap --json"),
    "bag verify": ("bag verify out/demo", "bag verify runs/may/bag runs/june/bag"),
    "bag recover": ("bag recover broken.mcap --out whole",),
    "bag play": ("bag play out/demo --time-factor 10", "bag play out/demo --start 600 --topics '/counts|/fix'"),
    "export": ("export out/farm --to qgis --to sheet", "export out/farm --to zones --min-zone 1 --out terminal"),
    "season": ("season out/may out/june --out out/season", "season out --title 'Home field' --out out/season"),
    "calibrate": (
        "calibrate cores.csv --site my_site.yaml --log survey.log --dry-run",
        "calibrate cores.csv --site my_site.yaml --counts 61200 --exposure 20400 --date 2026-05-02",
    ),
    "graph": (
        "graph patches --spacing 8 --out lattice.yaml",
        "graph my_field.yaml --rows 3 --heading 20 --out rows.yaml",
        "graph my_field.yaml --swaths swaths.geojson --to nav2-route --out lanes.geojson",
    ),
    "list": ("list", "list fields", "list loggers --json"),
    "logger": (
        "logger DATA001.csv --out my_logger.yaml",
        "logger table.csv --time Datum --time Zeit --neutrons N1",
    ),
    "failsafe": (
        "failsafe",
        "failsafe moving off_route",
        "failsafe off_route --response pause --phase travelling",
    ),
    "check": (
        "check --site my_site.yaml --field my_field.yaml",
        "check --log survey.KSU --logger hydroinnova_rover --site gypsum_transect",
    ),
}
"""Example commands of each subcommand, without ``soilmoist``."""


class _Commands(click.Group):
    """Loads each subcommand on use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all subcommands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load a subcommand; an unknown name is a usage error."""
        if cmd_name not in COMMANDS:
            ctx.fail(f"there is no command {cmd_name!r}{did_you_mean(cmd_name, COMMANDS)}")
        module, name = ("check", "logger") if cmd_name == "logger" else (cmd_name, "command")
        command: click.Command = getattr(import_module(f"soilmoist_ros.cli.{module}"), name)
        command.epilog = epilog(cmd_name)
        if isinstance(command, click.Group):
            for name, one in command.commands.items():
                one.epilog = epilog(f"{cmd_name} {name}")
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run the subcommand; an option of an earlier release is a usage error that names the new one."""
        try:
            return super().invoke(ctx)
        except click.NoSuchOption as error:
            if (remedy := RENAMED.get(error.option_name)) is None:
                raise
            message = f"there is no option {error.option_name} any more: {remedy}"
            raise click.UsageError(message, error.ctx) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write names and help texts without loading a subcommand."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
        with formatter.section("Exit codes"):
            formatter.write_dl([(str(code), meaning) for code, meaning in EXIT_CODES.items()])


# Examples at the end of each ``--help``; a test parses them all -------------------------------------------------


def epilog(command: str) -> str:
    """The examples of a subcommand as a text that click leaves as it is."""
    return "\n".join(["\b", "Examples:", *(f"  soilmoist {example}" for example in EXAMPLES[command])])


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="soilmoist")
def main() -> None:
    """Soil-moisture mapping with a cosmic-ray neutron sensor.

    soilmoist COMMAND --help shows the options of a command, with examples. Results go to the folder --out.
    """


if __name__ == "__main__":
    main()
