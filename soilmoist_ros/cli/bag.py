# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist bag``: inspect, verify, play and recover recordings."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import asdict
from pathlib import Path

import click

from soilmoist_ros.cli.answer import answering, progress_bar, put, say, tables, warn
from soilmoist_ros.cli.options import FILE
from soilmoist_ros.foundation import InputError


@click.group("bag")
def command() -> None:
    """Inspect recordings, play them, and recover interrupted ones."""


@command.command("info")
@click.argument("bag", type=FILE)
@answering
def bag_info_command(bag: Path) -> None:
    """Show the content of a BAG. Exit code 1 if the bag is not whole."""
    from soilmoist_ros.recording import bag_info, bag_of, info_table, print_plain

    info = bag_info(bag_of(bag))
    put(bag=asdict(info), whole=info.whole)
    print_plain(tables(), info_table(info))
    if not info.whole:
        sys.exit(1)


@command.command("verify")
@click.argument("bags", type=FILE, nargs=-1, required=True)
@answering
def bag_verify_command(bags: tuple[Path, ...]) -> None:
    """Verify BAGS: every message by its checksum, and what the metadata say. Exit code 1 if one is not whole."""
    from soilmoist_ros.recording import bag_info, bag_of, print_plain, verified_table

    wrong, results = False, []
    for bag in bags:
        found = bag_info(bag_of(bag))
        wrong |= not found.whole
        paths = [found.path if found.path.is_file() else found.path / name for name in found.files]
        results.append({"bag": found.path, "paths": paths, **asdict(found)})  # keys of 0.2.0
        print_plain(tables(), verified_table(found))
    put(bags=results)
    if wrong:
        sys.exit(1)


@command.command("recover")
@click.argument("bag", type=FILE)
@click.option("--out", type=FILE, required=True, help="Folder for the recovered bag; must not exist.")
@answering
def bag_recover_command(bag: Path, out: Path) -> None:
    """Rebuild a readable bag from an interrupted BAG. The original is not changed."""
    from soilmoist_ros.recording import (
        bag_info,
        bag_of,
        copy_configuration,
        info_table,
        plain_text,
        print_plain,
        recover_bag,
    )

    problems = recover_bag(source := bag_of(bag), out)
    copy_configuration(source, out)
    info = bag_info(out)
    put(source=source, folder=out, problems=problems, bag=asdict(info))
    print_plain(tables(), plain_text("\n".join(problems) or f"{bag} was whole", "yellow" if problems else ""))
    print_plain(tables(), info_table(info))


@command.command("play")
@click.argument("bag", type=FILE)
@click.option("--topics", help="Pattern of topic names to publish. Default: the inputs of mapper and planner.")
@click.option("--time-factor", type=click.FloatRange(min=0.01, max=200), default=1.0, show_default=True,
              help="Recorded seconds per real second.")  # fmt: skip
@click.option("--start", "start_s", type=click.FloatRange(min=0), default=0.0, show_default=True,
              help="Time after the begin of the bag at which to start [s].")  # fmt: skip
@answering
def bag_play_command(bag: Path, topics: str | None, time_factor: float, start_s: float) -> None:
    """Publish a BAG to running nodes, with /clock.

    Nodes with use_sim_time receive the records, positions and raw lines again. Ctrl-Z pauses, fg resumes.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise InputError("rclpy is not installed", "on a robot, source /opt/ros/jazzy/setup.bash")
    from soilmoist_ros.nodes import player_of
    from soilmoist_ros.recording import INPUTS, bag_of

    with (
        player_of(
            bag_of(bag), topics or INPUTS, time_factor, start_s, lambda text: warn(f"note: {text}")
        ) as player,
        progress_bar() as progress,
    ):
        progress("waiting for subscribers", 0.0)
        player.wait_for_listeners()
        count = player.play(progress)
    put(messages=count)
    say(f"played {count} messages")
