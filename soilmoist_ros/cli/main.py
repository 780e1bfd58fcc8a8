"""The ``soilmoist`` command. Exit code 0: all was done; 1: not all of it; 2: bad input; 130: interrupted.

Each subcommand stands in the file of its name and is loaded when it is used, so that ``--help`` answers at once.
"""

from __future__ import annotations

from importlib import import_module

import click

from soilmoist_ros.foundation.suggestions import did_you_mean
from soilmoist_ros.foundation.version import __version__

COMMANDS = {
    "map": "Map soil moisture from neutron LOGS.",
    "simulate": "Explore a surrogate field with a simulated robot, without ROS.",
    "demo": "Run the whole ROS system on a simulated field: all nodes as processes, with a live view.",
    "campaign": "Run the missions of a CAMPAIGN (a YAML file, or the name of a shipped one: paper).",
    "replay": "Map the records of a BAG again: the folder of a run or bag, or an MCAP or db3 file.",
    "bag": "Look into recordings, play them, and recover interrupted ones.",
    "calibrate": "Find N0 from soil CORES (a CSV file) and the counts at the calibration.",
    "graph": "Lay a travel graph over a FIELD and write it as a topological map.",
    "check": "Check configuration files; name every mistake in all of them.",
}
"""Subcommands with the first sentence of their help."""


class _Commands(click.Group):
    """Loads a subcommand when it is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A subcommand; ends with a message if there is none of the name."""
        if cmd_name not in COMMANDS:
            ctx.fail(f"there is no command {cmd_name!r}{did_you_mean(cmd_name, COMMANDS)}")
        command: click.Command = import_module(f"soilmoist_ros.cli.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The names and their texts, without a subcommand loaded."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="soilmoist")
def main() -> None:
    """Soil-moisture mapping with a cosmic-ray neutron sensor."""


if __name__ == "__main__":
    main()
