# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options for logs and positions of a survey: topics in bags, and a shift of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from soilmoist_ros.cli.options.times import Shift

gnss_shift_option = click.option(
    "--gnss-shift",
    "gnss_shift_s",
    type=Shift(),
    metavar="DURATION",
    default=0.0,
    show_default=False,
    help="Time added to that of the positions, such as 1024w, 2h or -18s. Default: none.",
)


def position_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--gnss-shift``, ``--logger-topic`` and ``--fix-topic``."""
    fix = click.option(
        "--fix-topic",
        default="",
        metavar="TOPIC",
        help="In bags: topic with positions, fixes or NMEA. Default: raw/gnss, or fix.",
    )
    logger = click.option(
        "--logger-topic",
        default="",
        metavar="TOPIC",
        help="In bags: topic with the logger's lines. Default: raw/logger, or the only text.",
    )
    return gnss_shift_option(logger(fix(command)))
