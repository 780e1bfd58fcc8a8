# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist watch``: the live view of a running survey in a terminal."""

from __future__ import annotations

import importlib.util
import os
import time

import click

from soilmoist_ros.cli.answer import live_view, reporting_errors
from soilmoist_ros.foundation import InputError

_POLL_S = 0.2


@click.command("watch")
@click.option("--robot", "robots", multiple=True, help="Namespace of a robot, repeatable. Default: none.")
@reporting_errors
def command(robots: tuple[str, ...]) -> None:
    """Watch a running survey in a terminal, until Ctrl-C: state, forecast and numbers.

    It listens on the ROS domain of the shell, and changes nothing.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise InputError("rclpy is not installed", "on a robot, source /opt/ros/jazzy/setup.bash")
    from soilmoist_ros.nodes import monitored
    from soilmoist_ros.reporting import LiveMission

    live = LiveMission(" survey ", [name.strip("/") for name in robots] or [""])
    try:
        domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    except ValueError:
        raise InputError("ROS_DOMAIN_ID is no number", "export ROS_DOMAIN_ID=0") from None
    try:
        with monitored(live, domain), live_view() as show:
            while True:
                show(live)
                time.sleep(_POLL_S)
    except KeyboardInterrupt:
        return
