# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ``soilmoist`` command.

Each subcommand is in the file of its name and is loaded on use, which keeps ``--help`` fast.
"""

from __future__ import annotations

import gc
from importlib import import_module
from typing import Any

import click

from soilmoist_ros.cli.answers.answer import EXIT_CODES
from soilmoist_ros.cli.options.examples import epilog
from soilmoist_ros.foundation import __version__, did_you_mean

COMMANDS = {
    "map": "Map soil moisture from neutron LOGS.",
    "simulate": "Explore a surrogate field with a simulated robot, without ROS.",
    "demo": "Run the whole ROS system on a simulated field: all nodes as processes, with a live view.",
    "watch": "Watch a running survey in a terminal, until Ctrl-C: state, numbers, and the map as it grows.",
    "campaign": "Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).",
    "replay": "Map the records of a BAG again: the folder of a run or bag, or an MCAP, db3 or ROS 1 .bag file.",
    "bag": "Inspect recordings, play them, and recover interrupted ones.",
    "export": "Export a RUN for GIS, phones and farm terminals.",
    "season": "Make a time series of all RUNS of one field.",
    "calibrate": "Find N0 from soil CORES (a CSV file) and the counts at the calibration.",
    "graph": "Build a travel graph for a FIELD and write it as a topological map.",
    "list": "List what can be chosen by name: fields, strategies, loggers, sites ...",
    "logger": "Draft a logger format (YAML) from the header and first lines of FILE.",
    "check": "Check configuration files and report every mistake in them.",
}
"""Subcommands with the first sentence of their help."""
_PLAY = "play recordings with soilmoist bag play"
RENAMED = {
    ("simulate", "--variogram"): "use --model",
    ("demo", "--variogram"): "use --model",
    ("simulate", "--also"): "use --property FIELD[:WEIGHT]",
    ("demo", "--also"): "use --property FIELD[:WEIGHT]",
    ("simulate", "--also-weight"): "use --property FIELD:WEIGHT",
    ("demo", "--also-weight"): "use --property FIELD:WEIGHT",
    ("simulate", "--overhead"): "use --stop-overhead",
    ("demo", "--overhead"): "use --stop-overhead",
    ("demo", "--speed"): "use --time-factor",
    ("replay", "--also-truth"): "use --truth PROPERTY=FIELD",
    ("replay", "--live"): _PLAY,
    ("replay", "--topics"): _PLAY,
    ("replay", "--speed"): _PLAY,
    ("replay", "--start"): _PLAY,
    ("export", "--formats"): "soilmoist list exports shows the formats",
}
"""Options of earlier releases, by command and name -> what to do."""


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
        gc.set_threshold(50_000)  # what is imported stays: looking for garbage among it takes a tenth of the start
        try:
            return super().invoke(ctx)
        except click.NoSuchOption as error:
            name = error.ctx.info_name if error.ctx is not None else None
            remedy = RENAMED.get((name or "", error.option_name))
            if remedy is None:
                raise
            raise click.UsageError(
                f"there is no option {error.option_name} any more: {remedy}", error.ctx
            ) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write names and help texts without loading a subcommand."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
        with formatter.section("Exit codes"):
            formatter.write_dl([(str(code), meaning) for code, meaning in EXIT_CODES.items()])


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="soilmoist")
def main() -> None:
    """Soil-moisture mapping with a cosmic-ray neutron sensor.

    soilmoist COMMAND --help shows the options of a command, with examples. Results go to the folder --out.
    """


if __name__ == "__main__":
    main()
