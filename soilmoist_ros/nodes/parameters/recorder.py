"""Parameters of ``recorder``."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.parameter import Parameter

PARAMETERS: Final = (
    Parameter(name="out", default="recordings", description="folder for bags; made if it does not exist"),
    Parameter(name="name", default="", description="name of the bag; the time of its beginning if empty"),
    Parameter(name="include", default=".*", description="pattern of the full names of topics to record"),
    Parameter(name="exclude", default="", description="pattern of the full names of topics to leave out"),
    Parameter(name="autostart", default=True, description="whether to record from the start"),
    Parameter(
        name="flush_period_s",
        default=0.5,
        description="time between flushes to the disk, which is what a crash can cost",
        unit="s",
        low=0.05,
        high=60.0,
    ),
    Parameter(
        name="queue_mb",
        default=64.0,
        description="size of messages that may wait while the disk is slow or full",
        unit="MB",
        low=1.0,
        high=4096.0,
    ),
    Parameter(
        name="low_disk_mb", default=500.0, description="space on the disk below which to warn", unit="MB", low=0.0
    ),
)
