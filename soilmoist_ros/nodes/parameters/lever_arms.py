# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the places of antenna and sensor on the robot, shared by driver and planner."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.declaration import Parameter


def _rows(thing: str, name: str) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(
            name=f"{name}_{axis}_m",
            default=0.0,
            description=f"{thing}, {direction} of the base frame's origin",
            unit="m",
            low=-50.0,
            high=50.0,
        )
        for axis, direction in (("x", "forward"), ("y", "to the left"))
    )


ANTENNA: Final = _rows("GNSS antenna", "antenna")
SENSOR: Final = _rows("neutron sensor", "sensor")
