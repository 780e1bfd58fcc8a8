# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The statuses of a recorded mission, as the planner published them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, get_type_hints

from soilmoist_ros.pipeline.topics import STATUS, RunTopics


class Status(NamedTuple):
    """The mission at one time; the fields are named like the values of the message.

    :param state: phase of the mission
    :param reason: reason for people
    :param target: name of the stop, empty without one
    :param target_x_m: east [m], NaN without a stop
    :param target_y_m: north [m], NaN without a stop
    :param elapsed_dwell_s: time spent counting at the stop so far [s]
    :param time_used_s: time since the start of the mission [s]
    :param time_left_s: remaining budget [s]
    :param distance_m: distance travelled [m]
    :param samples: number of finished stops
    :param counting_s: time spent counting at all stops [s]
    :param raw_counts: counts at the stop so far
    :param stamp_s: time of the status [s]
    :param last_command: last command of an operator, with its answer; empty without one
    :param last_command_s: its time, on the clock of ``stamp_s`` [s]; NaN without one
    :param forecast_data: the last forecast as JSON; empty without one
    """

    state: str
    reason: str
    target: str
    target_x_m: float
    target_y_m: float
    elapsed_dwell_s: float
    time_used_s: float
    time_left_s: float
    distance_m: float
    samples: int
    counting_s: float
    raw_counts: int
    stamp_s: float
    last_command: str = ""
    last_command_s: float = math.nan
    forecast_data: str = ""


_MAY_BE_UNKNOWN = {"target_x_m", "target_y_m", "stamp_s", "last_command_s"}
_OF_LATER_VERSIONS = {name: str(value) for name, value in Status._field_defaults.items()}


def read_statuses(topics: RunTopics) -> list[Status]:
    """Statuses of a robot's missions in order; empty if the bag has no mission.

    The order is that of writing: times go back where the clock was set.
    """
    name = topics.find("mission", STATUS)
    found = [
        _status({item.key: item.value for item in topics.reader.decode(message).values})
        for message in (topics.reader.messages([name], by_time=False) if name else ())
    ]
    return [status for status in found if status is not None]


def last_mission(statuses: Sequence[Status]) -> list[Status]:
    """Statuses of the last started mission; empty if none was started."""
    missions: list[list[Status]] = [[]]
    for status in statuses:
        if missions[-1] and status.time_used_s < missions[-1][-1].time_used_s:
            missions.append([])
        missions[-1].append(status)
    started = [mission for mission in missions if any(status.time_used_s > 0 for status in mission)]
    return started[-1] if started else []


def _status(values: dict[str, str]) -> Status | None:
    """The status of a message; ``None`` if the message lacks a value: another node may use the topic."""
    try:
        values = {**_OF_LATER_VERSIONS, **values}
        status = Status(**{name: kind(values[name]) for name, kind in get_type_hints(Status).items()})
    except (KeyError, ValueError):
        return None
    numbers = {name: value for name, value in status._asdict().items() if isinstance(value, float)}
    known = all(math.isfinite(value) for name, value in numbers.items() if name not in _MAY_BE_UNKNOWN)
    return status if known else None
