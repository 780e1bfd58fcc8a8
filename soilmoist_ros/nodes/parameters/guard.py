# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the watch: limits of the causes, and what follows each cause."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.exploration.guard.failsafes import FAILSAFES, Cause
from soilmoist_ros.exploration.guard.place_filter import PlaceLimits
from soilmoist_ros.exploration.guard.watch import Watch, WatchLimits
from soilmoist_ros.exploration.mission.types import Response
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.parameter import Parameter, Value
from soilmoist_ros.nodes.parameters.stamps import STAMP_LIMITS, stamp_limits

_WATCH, _PLACE = WatchLimits(), PlaceLimits()
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
    _row(
        "max_outside_m",
        _WATCH.max_outside_m,
        "distance outside the field from which a mission pauses; a robot that starts outside may drive in",
        "m",
    ),
    _row(
        "max_entry_m",
        _WATCH.max_entry_m,
        "distance outside the field, or depth in a no-go area, from which no goal is sent; from nearer the robot "
        "drives straight back in. At least max_outside_m counts",
        "m",
    ),
    _row(
        "max_in_no_go_m",
        _WATCH.max_in_no_go_m,
        "depth in a no-go area, the margin robot_radius_m included, from which a mission pauses",
        "m",
    ),
    _row("off_route_m", _WATCH.off_route_m, "distance from the route that counts as off the route", "m"),
    _row("far_off_route_m", _WATCH.far_off_route_m, "distance from the route from which a mission pauses", "m"),
    _row("moving_m", _WATCH.moving_m, "motion without a goal from which the robot is stopped again", "m"),
    _row("max_jump_m", _PLACE.max_jump_m, "moves between two fixes up to this distance are plausible", "m"),
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
    _row("fix_old_s", _WATCH.fix_old_s, "longest time without a plausible position", "s"),
    _row(
        "fix_frozen_s",
        _WATCH.fix_frozen_s,
        "longest time without any change of the position while the robot is to drive; 0 for no limit",
        "s",
    ),
    _row("records_old_s", _WATCH.records_old_s, "longest time without a record in a mission", "s"),
    _row(
        "counts_bad_s", _WATCH.counts_bad_s, "time in which more than half of the records must be good", "s", low=1
    ),
    _row("map_old_s", _WATCH.map_old_s, "longest time that the map stays without the newest records", "s"),
    _row(
        "navigation_silent_s",
        _WATCH.navigation_silent_s,
        "longest time without the navigation, or its feedback where that is regular",
        "s",
    ),
    _row("battery_low", _WATCH.battery_low, "charge below which the battery is low; 0 for no limit", high=1),
    _row("battery_empty", _WATCH.battery_empty, "charge below which the battery is empty; 0 for no limit", high=1),
    _row("battery_low_v", _WATCH.battery_low_v, "voltage below which the battery is low; 0 for no limit", "V"),
    _row(
        "battery_empty_v", _WATCH.battery_empty_v, "voltage below which the battery is empty; 0 for no limit", "V"
    ),
    _row(
        "battery_silent_s",
        _WATCH.battery_silent_s,
        "longest time in a mission without the state of a battery that was heard before; 0 for no limit",
        "s",
    ),
    _row("clear_s", _WATCH.clear_s, "time for which a cause must be over before its alarm ends", "s"),
    *STAMP_LIMITS,
)


def make_watch(parameters: Parameters) -> Watch:
    """The watch of a planner.

    :param parameters: values of :data:`WATCH_PARAMETERS`, and ``speed_mps``
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
    try:
        limits = WatchLimits(
            place=place,
            stamps=stamp_limits(parameters),
            max_outside_m=number("max_outside_m"),
            max_entry_m=number("max_entry_m"),
            max_in_no_go_m=number("max_in_no_go_m"),
            off_route_m=number("off_route_m"),
            far_off_route_m=number("far_off_route_m"),
            moving_m=number("moving_m"),
            fix_old_s=number("fix_old_s"),
            fix_frozen_s=number("fix_frozen_s"),
            records_old_s=number("records_old_s"),
            counts_bad_s=number("counts_bad_s"),
            map_old_s=number("map_old_s"),
            navigation_silent_s=number("navigation_silent_s"),
            battery_low=number("battery_low"),
            battery_empty=number("battery_empty"),
            battery_low_v=number("battery_low_v"),
            battery_empty_v=number("battery_empty_v"),
            battery_silent_s=number("battery_silent_s"),
            clear_s=number("clear_s"),
        )
    except ValueError as error:
        raise InputError(str(error), "correct the parameters") from None
    return Watch(limits, {cause: Response(parameters.text(failsafe_name(cause))) for cause in Cause})
