# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``planner/command``: an operator's request and its reply as a soilmoist_msgs/Command."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Point32
from soilmoist_msgs.srv import Command

from soilmoist_ros.exploration import OperatorRequest, Reply, ReplyCode
from soilmoist_ros.foundation import foreign_text


def request_to_message(request: OperatorRequest) -> Command.Request:
    """Message of a request; corners of the polygon are rounded to 32 bits."""
    return Command.Request(
        verb=request.verb,
        who=request.who,
        place=[float(value) for value in request.place],
        geographic_place=[float(value) for value in request.geographic_place],
        dwell=request.dwell,
        polygon=[Point32(x=float(x_m), y=float(y_m)) for x_m, y_m in request.polygon],
        stops=list(request.stops),
        hours=float(request.hours),
        strategy=request.strategy,
        target=request.target,
        home=request.home,
        until_sd=_to_limit(request.until_sd),
        until_gain=_to_limit(request.until_gain),
        field=request.field,
        earlier=choice_to_message(request.earlier),
        covariates=choice_to_message(request.covariates),
    )


def request_from_message(message: Command.Request) -> OperatorRequest:
    """Request of a message, unchecked."""
    return OperatorRequest(
        verb=foreign_text(message.verb),
        who=foreign_text(message.who)[:60],
        place=tuple(float(value) for value in message.place),
        geographic_place=tuple(float(value) for value in message.geographic_place),
        dwell=foreign_text(message.dwell),
        polygon=tuple((float(corner.x), float(corner.y)) for corner in message.polygon),
        stops=tuple(map(foreign_text, message.stops)),
        hours=float(message.hours),
        strategy=foreign_text(message.strategy),
        target=foreign_text(message.target),
        home=foreign_text(message.home),
        until_sd=_from_limit(message.until_sd),
        until_gain=_from_limit(message.until_gain),
        field=foreign_text(message.field),
        earlier=choice_from_message(message.earlier),
        covariates=choice_from_message(message.covariates),
    )


def choice_to_message(chosen: Sequence[str] | None) -> list[str]:
    """A list that may be chosen: empty for no choice, one empty text for a choice of none."""
    return [] if chosen is None else list(chosen) or [""]


def choice_from_message(chosen: Sequence[str]) -> tuple[str, ...] | None:
    """What :func:`choice_to_message` wrote."""
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
    """Reply of a message.

    :raises ValueError: if its code is not known
    """
    return Reply(ReplyCode(message.code), foreign_text(message.message))
