# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of ``recorder``."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.declaration import Parameter

PARAMETERS: Final = (
    Parameter(name="out", default="recordings", description="folder for bags; created if missing"),
    Parameter(name="name", default="", description="name of the bag; its start time if empty"),
    Parameter(
        name="include", default=".*", description="regular expression for the full names of topics to record"
    ),
    Parameter(
        name="exclude",
        default="",
        description="regular expression for the full names of topics to exclude; empty for none",
    ),
    Parameter(
        name="autostart",
        default=True,
        description="whether to record from the start; otherwise the service recorder/start starts it",
    ),
    Parameter(
        name="flush_period_s",
        default=0.5,
        description="time between flushes to the disk; a crash loses at most the messages of this time",
        unit="s",
        low=0.05,
        high=60.0,
    ),
    Parameter(
        name="queue_mb",
        default=64.0,
        description="size of messages that may wait while the disk is slow or full; further messages are lost",
        unit="MB",
        low=1.0,
        high=4096.0,
    ),
    Parameter(
        name="low_disk_mb",
        default=500.0,
        description="free disk space below which the recorder warns",
        unit="MB",
        low=0.0,
    ),
    Parameter(
        name="full_soon_h",
        default=1.0,
        description="time to a full disk or to keep_gb, at the rate of the last minutes, below which the recorder "
        "warns",
        unit="h",
        low=0.0,
    ),
    Parameter(
        name="file_mb",
        default=0.0,
        description="size of a file after which a bag continues in another file; 0 for no limit",
        unit="MB",
        low=0.0,
    ),
    Parameter(
        name="file_min",
        default=0.0,
        description="time after which a bag continues in another file; 0 for no limit",
        unit="min",
        low=0.0,
    ),
    Parameter(
        name="keep_days",
        default=0.0,
        description="age of bags above which the recorder warns, or deletes those that were closed while the "
        "clock was synchronised; 0 for no limit",
        unit="d",
        low=0.0,
    ),
    Parameter(
        name="keep_gb",
        default=0.0,
        description="size of all bags above which the recorder warns, or deletes the oldest; 0 for no limit",
        unit="GB",
        low=0.0,
    ),
    Parameter(
        name="delete_oldest",
        default=False,
        description="whether closed bags beyond keep_days and keep_gb are deleted, the oldest first, and finished "
        "files of the running bag beyond keep_gb",
    ),
)
