# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mission``: the mission's status as a diagnostic_msgs/DiagnosticStatus, for operators and displays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.environment import health_from_status, health_to_status
from soilmoist_ros.exploration import (
    OTHER_ROBOT,
    STATUS_COUNTS,
    STATUS_FLAGS,
    STATUS_FLOATS,
    MissionEnd,
    MissionStatus,
    Phase,
    Stop,
    forecast_from_text,
    status_health,
)
from soilmoist_ros.foundation import foreign_text, read_json


def mission_to_message(status: MissionStatus, more: Mapping[str, str] | None = None) -> DiagnosticStatus:
    """Message of a status, with the level of :func:`status_health`."""
    return health_to_status(status_health(status, more))


def mission_from_message(message: DiagnosticStatus) -> MissionStatus:
    """Status of a message; ``ValueError`` if a value is missing or impossible, further ones are ignored."""
    values = health_from_status(message).values
    try:
        end_s = float(values["estimated_end_s"])
        place = float(values["target_x_m"]), float(values["target_y_m"])
        robot = float(values.get("robot_x_m", "nan")), float(values.get("robot_y_m", "nan"))
        phase = Phase(values["state"])
        numbers: dict[str, Any] = {name: float(values[key]) for key, name in STATUS_FLOATS.items()}
        numbers |= {name: int(values[name]) for name in STATUS_COUNTS}
        numbers |= {name: values.get(name) == "True" for name in STATUS_FLAGS}  # missing in earlier versions
        return MissionStatus(
            now_s=float(values["stamp_s"]),
            phase=phase,
            reason=values["reason"],
            target=None if math.isnan(place[0]) else Stop(values["target"], *place),
            **numbers,
            blacklisted=_names(values["ruled_out"]),
            estimated_end_s=None if math.isnan(end_s) else end_s,
            ended=MissionEnd(values["ended"]) if values.get("ended") else None,
            stop_requests=int(values.get("stop_requests", 0)),
            queue=_names(values.get("queue", "[]")),
            forecast=forecast_from_text(values.get("forecast_data", "")),
            place=None if math.isnan(robot[0]) else robot,
            yields=phase is Phase.PAUSED
            and isinstance(alarms := read_json(values.get("alarms", "{}")), dict)
            and OTHER_ROBOT in alarms,
        )
    except KeyError as error:
        raise ValueError(f"the mission's status has no value {error.args[0]!r}") from None


def _names(text: str) -> tuple[str, ...]:
    """Names of stops in a value; refuses what is no list of texts."""
    found = read_json(text)
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise ValueError(f"{text[:40]!r} is no list of names")
    return tuple(map(foreign_text, found))
