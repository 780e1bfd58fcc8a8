# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Types of soilmoist_msgs: commands, visits, and the state of the mission.

The import fails if that package is not built.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Any, Final, TypeVar

from geometry_msgs.msg import Point, Point32, Polygon
from soilmoist_msgs.msg import Alarm as AlarmMessage
from soilmoist_msgs.msg import Mission as MissionMessage
from soilmoist_msgs.msg import Visit as VisitMessage
from soilmoist_msgs.srv import Command
from std_msgs.msg import Header

from msg_adapters.point_cloud import FRAME, to_time
from soilmoist_ros.exploration import (
    Alarm,
    MissionEnd,
    MissionStatus,
    OperatorRequest,
    Phase,
    Reply,
    ReplyCode,
    Response,
    Visit,
    status_level,
)
from soilmoist_ros.foundation import foreign_text
from soilmoist_ros.recording import visit_of, visit_values

Code = TypeVar("Code", bound=Enum)
_RESPONSES: Final = {response: int(getattr(AlarmMessage, str(response.value).upper())) for response in Response}

_TEXTS: Final = ("verb", "who", "dwell", "strategy", "target", "home", "field")
_FLOATS: Final = (
    "planned_dwell_s", "dwell_s", "progress", "time_used_s", "time_left_s", "clock_offset_s", "distance_m",
    "counting_s",
)  # fmt: skip
_COUNTS: Final = ("raw_counts", "samples", "failures", "stop_requests")


def request_to_message(request: OperatorRequest) -> Command.Request:
    """Message of a request; corners of the polygon are rounded to 32 bits."""
    return Command.Request(
        place=[float(value) for value in request.place],
        geographic_place=[float(value) for value in request.geographic_place],
        polygon=[_corner(*corner) for corner in request.polygon],
        stops=list(request.stops),
        hours=float(request.hours),
        until_sd=_to_limit(request.until_sd),
        until_gain=_to_limit(request.until_gain),
        earlier=choice_to_message(request.earlier),
        covariates=choice_to_message(request.covariates),
        **{name: getattr(request, name) for name in _TEXTS},
    )


def request_from_message(message: Command.Request) -> OperatorRequest:
    """Request of a message, unchecked."""
    texts = {name: foreign_text(getattr(message, name)) for name in _TEXTS}
    given: dict[str, Any] = {**texts, "who": texts["who"][:60]}
    return OperatorRequest(
        place=tuple(float(value) for value in message.place),
        geographic_place=tuple(float(value) for value in message.geographic_place),
        polygon=tuple((float(corner.x), float(corner.y)) for corner in message.polygon),
        stops=tuple(map(foreign_text, message.stops)),
        hours=float(message.hours),
        until_sd=_from_limit(message.until_sd),
        until_gain=_from_limit(message.until_gain),
        earlier=choice_from_message(message.earlier),
        covariates=choice_from_message(message.covariates),
        **given,
    )


def choice_to_message(chosen: Sequence[str] | None) -> list[str]:
    """A list that may be chosen: empty for no choice, one empty text for a choice of none."""
    return [] if chosen is None else list(chosen) or [""]


def choice_from_message(chosen: Sequence[str]) -> tuple[str, ...] | None:
    """List that :func:`choice_to_message` wrote; ``None`` for no choice."""
    return tuple(filter(None, map(foreign_text, chosen))) if chosen else None


def _to_limit(value: float | None) -> float:
    """0 leaves a limit as it is, below 0 removes it."""
    return 0.0 if value is None else float(value) or -1.0


def _from_limit(value: float) -> float | None:
    return None if value == 0 else max(float(value), 0.0)


def reply_to_message(reply: Reply) -> Command.Response:
    """Message of a reply."""
    return Command.Response(accepted=bool(reply.accepted), code=str(reply.code), message=reply.message)


def reply_from_message(message: Command.Response) -> Reply:
    """Reply of a message; ``ValueError`` for an unknown code."""
    return Reply(ReplyCode(message.code), foreign_text(message.message))


# ``visits``: each visit as a soilmoist_msgs/Visit ---------------------------------------------------------------


def visit_to_message(visit: Visit, robot: str = "", frame_id: str = FRAME) -> VisitMessage:
    """Message of a visit."""
    return VisitMessage(
        header=Header(stamp=to_time(visit.end_stamp_s), frame_id=frame_id),
        robot=robot,
        stop_position=Point(x=float(visit.stop_x_m), y=float(visit.stop_y_m)),
        position=Point(x=float(visit.x_m), y=float(visit.y_m)),
        arrival=to_time(visit.arrival_stamp_s),
        **visit_values(visit),
    )


def visit_from_message(message: VisitMessage, robot: int = 1) -> Visit:
    """Visit of a message; ``robot`` sets the visit's robot number, since the message has only a namespace."""
    return visit_of(message, robot)


# ``mission_state``: the status of the mission as a soilmoist_msgs/Mission, as numbers and codes to plot ---------


def _codes(message: Any, kind: type[Code], prefix: str = "") -> dict[Code, int]:
    return {member: int(getattr(message, f"{prefix}{member.name}")) for member in kind}


_PHASES: Final = _codes(MissionMessage, Phase, "PHASE_")
_ENDS: Final = _codes(MissionMessage, MissionEnd, "END_")


def mission_state_to_message(
    status: MissionStatus, stamp_s: float, robot: str = "", frame_id: str = FRAME
) -> MissionMessage:
    """Message of a status; corners of areas are rounded to 32 bits."""
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
        stop_confirmed=not status.stop_requests,
        alarms=[_alarm_to_message(alarm) for alarm in status.alarms],
        stop=stop.name if stop else "",
        stop_position=Point(x=float(stop.x_m if stop else math.nan), y=float(stop.y_m if stop else math.nan)),
        mission_time_s=float(status.now_s),
        estimated_end_s=float(math.nan if status.estimated_end_s is None else status.estimated_end_s),
        queue=list(status.queue),
        ruled_out=list(status.blacklisted),
        ruled_out_areas=[Polygon(points=[_corner(*corner) for corner in area]) for area in status.ruled_out],
        strategy=status.changes.strategy or "",
        map_sd=float(forecast.sd if forecast else math.nan),
        map_sd_at_end=float(forecast.sd_end if forecast else math.nan),
        map_sd_is_vwc=bool(forecast and forecast.moisture),
        forecast=forecast.text if forecast else "",
        field=status.changes.field or "",
        earlier=choice_to_message(status.changes.earlier),
        covariates=choice_to_message(status.changes.covariates),
        **_numbers(status),
    )


def _numbers(of: Any) -> dict[str, Any]:
    """Numbers that status and message have under one name."""
    return {name: float(getattr(of, name)) for name in _FLOATS} | {
        name: int(getattr(of, name)) for name in _COUNTS
    }


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
