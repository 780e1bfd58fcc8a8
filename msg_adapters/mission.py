# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mission``: the mission's status as a diagnostic_msgs/DiagnosticStatus, for operators and displays."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.environment import health_from_status, health_to_status
from soilmoist_ros.exploration import (
    OTHER_ROBOT,
    MissionEnd,
    MissionStatus,
    Phase,
    Stop,
    forecast_from_text,
    forecast_to_text,
)
from soilmoist_ros.foundation import Health, Level, foreign_text, read_json

_FLOATS: Final = {"elapsed_dwell_s": "dwell_s"} | {
    name: name
    for name in ("planned_dwell_s", "progress", "time_used_s", "time_left_s", "distance_m", "counting_s")
}
_COUNTS: Final = ("samples", "raw_counts", "failures")
_FLAGS: Final = ("needs_operator", "silent", "emergency")
"""Values of the message, and the fields of the status that they have."""


def mission_to_message(status: MissionStatus, more: Mapping[str, str] | None = None) -> DiagnosticStatus:
    """Message of a status.

    The level is an error if the mission waits for the operator although nobody paused it, if an emergency stop is
    pressed, or if the robot does not stop. The level is a warning if the mission is paused, has failed since the
    last visit, gets no records, or if the guard reports something.
    """
    target, end_s, forecast = status.target, status.estimated_end_s, status.forecast
    values = {
        "state": str(status.phase),
        "reason": status.reason,
        "target": target.name if target else "",
        "target_x_m": _text(target.x_m if target else math.nan),
        "target_y_m": _text(target.y_m if target else math.nan),
        "ruled_out": json.dumps(list(status.blacklisted)),
        "estimated_end": _calendar(end_s),
        "estimated_end_s": _text(math.nan if end_s is None else end_s),
        "stamp_s": _text(status.now_s),
        "ended": str(status.ended or ""),
        "alarms": json.dumps({alarm.cause: alarm.reason for alarm in status.alarms}),
        "stop_requests": str(int(status.stop_requests)),
        "queue": json.dumps(list(status.queue)),
        "forecast": forecast.text if forecast else "",
        "forecast_data": forecast_to_text(forecast),
        "robot_x_m": _text(status.place[0] if status.place else math.nan),
        "robot_y_m": _text(status.place[1] if status.place else math.nan),
        **{key: _text(getattr(status, name)) for key, name in _FLOATS.items()},
        **{name: str(int(getattr(status, name))) for name in _COUNTS},
        **{name: str(bool(getattr(status, name))) for name in _FLAGS},
        **(more or {}),
    }
    return health_to_status(Health("mission", status_level(status), f"{status.phase}: {status.reason}", values))


def mission_from_message(message: DiagnosticStatus) -> MissionStatus:
    """Status of a message; ``ValueError`` if a value is missing or impossible, further ones are ignored."""
    values = health_from_status(message).values
    try:
        end_s = float(values["estimated_end_s"])
        place = float(values["target_x_m"]), float(values["target_y_m"])
        robot = float(values.get("robot_x_m", "nan")), float(values.get("robot_y_m", "nan"))
        phase = Phase(values["state"])
        numbers: dict[str, Any] = {name: float(values[key]) for key, name in _FLOATS.items()}
        numbers |= {name: int(values[name]) for name in _COUNTS}
        numbers |= {name: values.get(name) == "True" for name in _FLAGS}  # missing in earlier versions
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


def status_level(status: MissionStatus) -> Level:
    """Severity of a status, see :func:`mission_to_message`."""
    if status.emergency or status.needs_operator:
        return Level.ERROR
    doubtful = status.phase is Phase.PAUSED or status.failures or status.silent or status.alarms
    return Level.WARN if doubtful else Level.OK


def _names(text: str) -> tuple[str, ...]:
    """Names of stops in a value; refuses what is no list of texts."""
    found = read_json(text)
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise ValueError(f"{text[:40]!r} is no list of names")
    return tuple(map(foreign_text, found))


def _text(value: float) -> str:
    return repr(float(value))


def _calendar(time_s: float | None) -> str:
    if time_s is None or not math.isfinite(time_s):
        return ""
    try:
        return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds")
    except (OverflowError, ValueError, OSError):
        return ""
