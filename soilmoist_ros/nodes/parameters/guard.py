# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the watch: limits of the causes, and what follows each cause."""

from __future__ import annotations

from typing import Any, Final

from soilmoist_ros.exploration import FAILSAFES, LIMITS, POSES_FROZEN_S, Cause, Response, Watch, WatchLimits
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.parameters.declaration import Parameter, Parameters, Value
from soilmoist_ros.nodes.parameters.stamps import STAMP_LIMITS, stamp_limits
from soilmoist_ros.sensing import PlaceLimits

_PLACE = PlaceLimits()
_FASTER: Final = 2.0
"""Highest speed as a multiple of the robot's usual one, where it is not given."""


def _row(
    name: str, default: Value, text: str, unit: str = "", low: float = 0, high: float | None = None
) -> Parameter:
    return Parameter(name=name, default=default, description=text, unit=unit, low=low, high=high)


def failsafe_name(cause: Cause) -> str:
    """Name of the parameter that sets the response to a cause."""
    return f"failsafe.{cause}"


WATCH_PARAMETERS: Final = (
    *(
        Parameter(
            name=failsafe_name(cause),
            default=row.response.value,
            description=f"response when {row.about}",
            choices=tuple(Response),
        )
        for cause, row in FAILSAFES.items()
    ),
    *(_row(name, limit.default, limit.about, limit.unit, limit.low, limit.high) for name, limit in LIMITS.items()),
    _row(
        "max_jump_m",
        _PLACE.max_jump_m,
        "largest accepted distance of a fix from where the robot can have driven since the last ones, "
        "whatever error the receiver states",
        "m",
    ),
    _row(
        "max_speed_mps",
        0.0,
        f"highest speed of the robot; 0 for {_PLACE.max_speed_mps:g} m/s, or twice speed_mps if that is more",
        "m/s",
    ),
    _row("max_fix_sd_m", _PLACE.max_sd_m, "fixes with a larger standard deviation are not used", "m"),
    _row("first_fixes", _PLACE.first_fixes, "number of fixes that must agree on the first place", low=1),
    _row(
        "agree_fixes",
        _PLACE.agree_fixes,
        "number of fixes in a row that must agree on a place after a jump",
        low=1,
    ),
    *STAMP_LIMITS,
)


def make_watch(parameters: Parameters) -> Watch:
    """The watch of a planner.

    :param parameters: values of :data:`WATCH_PARAMETERS`, ``speed_mps`` and ``navigator``
    :raises InputError: if limits contradict each other
    """
    number, usual_mps = parameters.number, parameters.number("speed_mps")
    speed_mps = number("max_speed_mps") or max(_PLACE.max_speed_mps, _FASTER * usual_mps)
    if speed_mps <= usual_mps:
        raise InputError(
            f"max_speed_mps is {speed_mps:g}, but the robot drives at speed_mps = {usual_mps:g}",
            "set max_speed_mps above speed_mps, or to 0",
        )
    place = PlaceLimits(
        max_jump_m=number("max_jump_m"),
        max_speed_mps=speed_mps,
        max_sd_m=number("max_fix_sd_m"),
        first_fixes=parameters.whole("first_fixes"),
        agree_fixes=parameters.whole("agree_fixes"),
        max_gap_s=number("fix_old_s"),
    )
    values: dict[str, Any] = {name: number(name) for name in LIMITS}
    if values["fix_frozen_s"] and parameters.text("navigator") == "goal_pose":
        values["fix_frozen_s"] = max(values["fix_frozen_s"], POSES_FROZEN_S)
    try:
        limits = WatchLimits(
            place=place,
            stamps=stamp_limits(parameters),
            **values,
        )
    except ValueError as error:
        raise InputError(str(error), "correct the parameters") from None
    return Watch(limits, {cause: Response(parameters.text(failsafe_name(cause))) for cause in Cause})
