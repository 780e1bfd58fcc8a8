# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mission_state``: the status of the mission as a soilmoist_msgs/Mission, as numbers and codes to plot."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any, Final, TypeVar

from geometry_msgs.msg import Point, Point32, Polygon
from soilmoist_msgs.msg import Alarm as AlarmMessage
from soilmoist_msgs.msg import Mission as MissionMessage
from std_msgs.msg import Header

from msg_adapters.mission import status_level
from msg_adapters.point_cloud import FRAME
from msg_adapters.soilmoist.command import choice_from_message, choice_to_message
from msg_adapters.stamps import to_time
from soilmoist_ros.exploration import Alarm, MissionEnd, MissionStatus, Phase, Response, Stop
from soilmoist_ros.foundation import foreign_text

Code = TypeVar("Code", bound=Enum)


def _codes(message: Any, kind: type[Code], prefix: str = "") -> dict[Code, int]:
    """Constants of a message for the members of an enumeration."""
    return {member: int(getattr(message, f"{prefix}{member.name}")) for member in kind}


_PHASES: Final = _codes(MissionMessage, Phase, "PHASE_")
_ENDS: Final = _codes(MissionMessage, MissionEnd, "END_")
_RESPONSES: Final = {response: int(getattr(AlarmMessage, str(response.value).upper())) for response in Response}


def mission_state_to_message(
    status: MissionStatus, stamp_s: float, robot: str = "", frame_id: str = FRAME
) -> MissionMessage:
    """Message of a status; corners of areas are rounded to 32 bits.

    :param status: the status
    :param stamp_s: time of the message [s since 1970-01-01 UTC]
    :param robot: namespace of the planner
    """
    stop, forecast = status.target, status.forecast
    return MissionMessage(
        header=Header(stamp=to_time(stamp_s), frame_id=frame_id),
        robot=robot,
        phase=_PHASES[status.phase],
        reason=status.reason,
        ended=_ENDS[status.ended] if status.ended else MissionMessage.END_NONE,
        level=int(status_level(status)),
        needs_operator=bool(status.needs_operator),
        silent=bool(status.silent),
        emergency_stop=bool(status.emergency),
        stop_requests=int(status.stop_requests),
        stop_confirmed=not status.stop_requests,
        alarms=[_alarm_to_message(alarm) for alarm in status.alarms],
        stop=stop.name if stop else "",
        stop_position=Point(x=float(stop.x_m if stop else math.nan), y=float(stop.y_m if stop else math.nan)),
        planned_dwell_s=float(status.planned_dwell_s),
        dwell_s=float(status.dwell_s),
        progress=float(status.progress),
        raw_counts=int(status.raw_counts),
        mission_time_s=float(status.now_s),
        time_used_s=float(status.time_used_s),
        time_left_s=float(status.time_left_s),
        estimated_end_s=float(math.nan if status.estimated_end_s is None else status.estimated_end_s),
        clock_offset_s=float(status.clock_offset_s),
        distance_m=float(status.distance_m),
        samples=int(status.samples),
        counting_s=float(status.counting_s),
        failures=int(status.failures),
        queue=list(status.queue),
        ruled_out=list(status.blacklisted),
        ruled_out_areas=[Polygon(points=[_corner(*corner) for corner in area]) for area in status.ruled_out],
        strategy=status.strategy,
        map_sd=float(forecast.sd if forecast else math.nan),
        map_sd_at_end=float(forecast.sd_end if forecast else math.nan),
        map_sd_is_vwc=bool(forecast and forecast.moisture),
        forecast=forecast.text if forecast else "",
        field=status.field,
        earlier=choice_to_message(status.earlier),
        covariates=choice_to_message(status.covariates),
    )


def mission_state_from_message(message: MissionMessage) -> MissionStatus:
    """Status of a message, without its forecast.

    :raises ValueError: if a code is not known
    """
    place = float(message.stop_position.x), float(message.stop_position.y)
    end_s = float(message.estimated_end_s)
    return MissionStatus(
        now_s=float(message.mission_time_s),
        phase=_member(_PHASES, message.phase, "phase"),
        reason=foreign_text(message.reason),
        target=None if math.isnan(place[0]) else Stop(foreign_text(message.stop), *place),
        planned_dwell_s=float(message.planned_dwell_s),
        dwell_s=float(message.dwell_s),
        progress=float(message.progress),
        time_used_s=float(message.time_used_s),
        time_left_s=float(message.time_left_s),
        distance_m=float(message.distance_m),
        samples=int(message.samples),
        counting_s=float(message.counting_s),
        raw_counts=int(message.raw_counts),
        failures=int(message.failures),
        blacklisted=tuple(map(foreign_text, message.ruled_out)),
        estimated_end_s=None if math.isnan(end_s) else end_s,
        needs_operator=bool(message.needs_operator),
        silent=bool(message.silent),
        ended=None if message.ended == MissionMessage.END_NONE else _member(_ENDS, message.ended, "end"),
        alarms=tuple(_alarm_from_message(alarm) for alarm in message.alarms),
        emergency=bool(message.emergency_stop),
        stop_requests=int(message.stop_requests),
        queue=tuple(map(foreign_text, message.queue)),
        strategy=foreign_text(message.strategy),
        field=foreign_text(message.field),
        earlier=choice_from_message(message.earlier),
        covariates=choice_from_message(message.covariates),
        clock_offset_s=float(message.clock_offset_s),
        ruled_out=tuple(
            tuple((float(corner.x), float(corner.y)) for corner in area.points) for area in message.ruled_out_areas
        ),
    )


def survey_from_message(message: MissionMessage) -> dict[str, Any]:
    """Field, earlier runs and covariates that an operator has chosen, by the names of the parameters."""
    lists = {
        name: list(chosen)
        for name in ("earlier", "covariates")
        if (chosen := choice_from_message(getattr(message, name))) is not None
    }
    return {**({"field": message.field} if message.field else {}), **lists}


def _corner(x_m: float, y_m: float) -> Point32:
    return Point32(x=float(x_m), y=float(y_m))


def _alarm_to_message(alarm: Alarm) -> AlarmMessage:
    response = _RESPONSES[alarm.response]
    return AlarmMessage(cause=str(alarm.cause), response=response, reason=alarm.reason, since_s=float(alarm.now_s))


def _alarm_from_message(message: AlarmMessage) -> Alarm:
    response = _member(_RESPONSES, message.response, "response")
    return Alarm(float(message.since_s), foreign_text(message.cause), response, foreign_text(message.reason))


def _member(codes: dict[Code, int], code: int, what: str) -> Code:
    for member, known in codes.items():
        if known == code:
            return member
    raise ValueError(f"{what} {code} is not known: it was published by another version")
