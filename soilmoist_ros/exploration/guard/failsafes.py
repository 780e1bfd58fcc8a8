# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the watch: what may be wrong, what follows, what the operator can do, and the limits.

Parameters of the planner, their documentation and the tables of the failsafes are made from them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from soilmoist_ros.exploration.mission import events
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import MOVING, OTHER_ROBOT, Alarm, MissionRules, Phase, Response, Verb
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.mapping import StampLimits
from soilmoist_ros.sensing import PlaceLimits


class Cause(StrEnum):
    """Cause of an alarm of the guard."""

    IN_NO_GO = "in_no_go"
    OUTSIDE = "outside"
    FAR_OFF_ROUTE = "far_off_route"
    OFF_ROUTE = "off_route"
    MOVING = MOVING
    JUMP = "jump"
    RELOCATED = "relocated"
    SPEED = "speed"
    FIX_OLD = "fix_old"
    FIX_FROZEN = "fix_frozen"
    RECORDS_OLD = "records_old"
    MAP_OLD = "map_old"
    NAVIGATION_SILENT = "navigation_silent"
    OTHER_CLIENT = "other_client"
    BATTERY_LOW = "battery_low"
    BATTERY_EMPTY = "battery_empty"
    BATTERY_SILENT = "battery_silent"
    RESERVE = "reserve"
    FRAME_MISMATCH = "frame_mismatch"
    MAP_CHANGED = "map_changed"
    CLOCK_STEP = "clock_step"
    COUNTS_FRAME = "counts_frame"
    COUNTS_STAMP = "counts_stamp"
    COUNTS_BAD = "counts_bad"
    OTHER_ROBOT = OTHER_ROBOT
    WATCHDOG = "watchdog"
    WATCHDOG_SILENT = "watchdog_silent"
    OPERATOR_GONE = "operator_gone"


@dataclass(frozen=True)
class Failsafe:
    """A row of the table of failsafes."""

    about: str  # when the alarm begins
    response: Response  # what follows unless it is set otherwise
    remedy: str  # what the operator can do
    limits: tuple[str, ...] = ()  # names of the parameters that limit it, in :data:`LIMITS` or others
    choices: tuple[Response, ...] = tuple(Response)  # responses that people may choose


@dataclass(frozen=True, kw_only=True)
class WatchLimits:
    """Limits of the causes; limits in :data:`LIMITS` are parameters of the planner, the others are not.

    :raises ValueError: if a value is out of its range
    """

    place: PlaceLimits = field(default_factory=PlaceLimits)  # its max_speed_mps also limits the cause speed
    stamps: StampLimits = field(default_factory=StampLimits)
    max_outside_m: float = 2.0
    max_entry_m: float = 10.0
    max_in_no_go_m: float = 0.5
    off_route_m: float = 5.0
    far_off_route_m: float = 10.0
    fix_old_s: float = 10.0
    fix_frozen_s: float = 12.0
    records_old_s: float = 60.0
    map_old_s: float = 300.0
    navigation_silent_s: float = 10.0
    operator_gone_s: float = 10.0
    battery_low: float = 0.25
    battery_empty: float = 0.1
    battery_low_v: float = 0.0
    battery_empty_v: float = 0.0
    moving_m: float = 0.5  # motion without a goal: more than the noise of RTK, and less than a step
    counts_bad_s: float = 60.0  # time in which more than half of the records must be good: six records
    watchdog_silent_s: float = 10.0  # it reports every second
    battery_silent_s: float = 60.0  # batteries report every second or every ten
    clear_s: float = 10.0  # time for which a cause must be over before its alarm ends: none flickers
    min_checks: int = 10  # checks without a message before silence counts: a busy computer first reads what came

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, int | float) and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{each.name} must be >= 0 and finite, got {value}")
        for low, high in (("battery_empty", "battery_low"), ("battery_empty_v", "battery_low_v")):
            if getattr(self, low) > getattr(self, high) > 0:
                raise ValueError(f"{low} must not be above {high}: {getattr(self, low)} > {getattr(self, high)}")


LIMITS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "max_outside_m": (
            "m", "distance outside the field from which a mission pauses; a robot that starts outside may drive in"
        ),
        "max_entry_m": (
            "m", "distance outside the field from which no goal is sent; from nearer the robot drives straight "
            "back in. At least max_outside_m counts"
        ),
        "max_in_no_go_m": (
            "m", "depth in a no-go area, the margin robot_radius_m included, from which a mission pauses"
        ),
        "off_route_m": ("m", "distance from the route that counts as off the route"),
        "far_off_route_m": ("m", "distance from the route from which a mission pauses"),
        "fix_old_s": ("s", "longest time without a plausible position"),
        "fix_frozen_s": (
            "s", "longest time without any change of the position while the robot is to drive, with goal_pose at "
            "least 30 s, as fixes show its arrivals; 0 for no limit"
        ),
        "records_old_s": ("s", "longest time without a record in a mission"),
        "map_old_s": ("s", "longest time that the map stays without the newest records"),
        "navigation_silent_s": (
            "s", "longest time without the navigation, or its feedback where that is regular"
        ),
        "operator_gone_s": ("s", "longest time in a mission without an operator, once one was present"),
        "battery_low": ("", "charge from 0 to 1 below which the battery is low; 0 for no limit"),
        "battery_empty": ("", "charge from 0 to 1 below which the battery is empty; 0 for no limit"),
        "battery_low_v": ("V", "voltage below which the battery is low; 0 for no limit"),
        "battery_empty_v": ("V", "voltage below which the battery is empty; 0 for no limit"),
    }
)  # fmt: skip
"""Unit and meaning of each limit that is a parameter, by its name."""

FAILSAFES: Final[Mapping[Cause, Failsafe]] = MappingProxyType(
    {
        Cause.IN_NO_GO: Failsafe(
            "the robot is deeper in a no-go area, its margin included, than the limit and the noise of the fixes",
            Response.PAUSE,
            "drive the robot out by hand, or check the no-go areas",
            ("max_in_no_go_m",),
        ),
        Cause.OUTSIDE: Failsafe(
            "the robot is farther outside the field than the limit and the noise of the fixes",
            Response.PAUSE,
            "drive the robot back in by hand, or check the field file",
            ("max_outside_m", "max_entry_m"),
        ),
        Cause.FAR_OFF_ROUTE: Failsafe(
            "the robot drives farther from the route than the second limit; or it is off the route, and would be "
            "outside the field or in a no-go area in 3 s",
            Response.PAUSE,
            "look at the robot and its navigation, drive it back by hand if needed, then resume",
            ("far_off_route_m",),
        ),
        Cause.OFF_ROUTE: Failsafe(
            "the robot drives farther from the route that was sent than the limit and the noise of the fixes",
            Response.WARN,
            "look at the robot: it may drive around an obstacle, or lose its way",
            ("off_route_m",),
        ),
        Cause.MOVING: Failsafe(
            "the robot moves farther than 0.5 m and the noise of the fixes, and no goal of the planner drives "
            "it; all goals of the navigation are cancelled",
            Response.PAUSE,
            "look at what moves the robot: its navigation, people, a slope; resume once it stands",
        ),
        Cause.JUMP: Failsafe(
            "several fixes in a row are at places that the robot cannot have reached; they are not used",
            Response.HOLD,
            "wait under open sky; if it stays, check the GNSS receiver and its corrections",
            ("max_speed_mps",),
        ),
        Cause.RELOCATED: Failsafe(
            "the fixes agree on another place, which the robot cannot have reached by itself, "
            "or the place of a standing robot drifts",
            Response.PAUSE,
            "check that the robot is where the map shows it, then resume",
        ),
        Cause.SPEED: Failsafe(
            "the robot moves faster than it can",
            Response.PAUSE,
            "check the robot and the GNSS receiver",
            ("max_speed_mps",),
        ),
        Cause.FIX_OLD: Failsafe(
            "no plausible position has come for the limit",
            Response.HOLD,
            "check the GNSS receiver and its view of the sky",
            ("fix_old_s", "max_fix_sd_m"),
        ),
        Cause.FIX_FROZEN: Failsafe(
            "the fixes repeat the very same place for the limit, while the robot is to drive",
            Response.PAUSE,
            "check the GNSS receiver, and whether the robot is stuck",
            ("fix_frozen_s",),
        ),
        Cause.RECORDS_OLD: Failsafe(
            "no record has come for the limit in a mission",
            Response.WARN,
            "check the neutron logger and its connection",
            ("records_old_s",),
        ),
        Cause.MAP_OLD: Failsafe(
            "the map has not taken in new records for the limit",
            Response.WARN,
            "check the mapper; the records are in the recording and can be mapped later",
            ("map_old_s",),
        ),
        Cause.NAVIGATION_SILENT: Failsafe(
            "the navigation is not there, two nodes answer in its name, it says nothing for the limit, or it does "
            "not end a cancelled goal, while it drives the robot",
            Response.HOLD,
            "check the navigation of the robot",
            ("navigation_silent_s",),
        ),
        Cause.OTHER_CLIENT: Failsafe(
            "the navigation works on a goal that the planner has not sent: another client drives the robot",
            Response.PAUSE,
            "let that client finish, or cancel its goal there; the planner sends nothing until then",
        ),
        Cause.BATTERY_LOW: Failsafe(
            "the charge or the voltage is below the first limit",
            Response.RETURN,
            "charge the battery",
            ("battery_low", "battery_low_v"),
        ),
        Cause.BATTERY_EMPTY: Failsafe(
            "the charge or the voltage is below the second limit",
            Response.ABORT,
            "fetch the robot and charge the battery",
            ("battery_empty", "battery_empty_v"),
        ),
        Cause.BATTERY_SILENT: Failsafe(
            "the state of the battery was there, and has not come for a minute in a mission",
            Response.WARN,
            "look at the robot's own display, and check what publishes battery_state",
        ),
        Cause.RESERVE: Failsafe(
            "the time left, or the charge left at its mean use, is needed for the way home",
            Response.RETURN,
            "set the home closer or the mission shorter",
            ("battery_empty",),
        ),
        Cause.FRAME_MISMATCH: Failsafe(
            "the pose of the navigation and the fix are more than 2 m apart",
            Response.HOLD,
            "check the datum of the field file and of the navigation",
        ),
        Cause.MAP_CHANGED: Failsafe(
            "a navigation that chooses the way itself has another map than the one that the ways are checked by",
            Response.PAUSE,
            "the new map is used once the robot stands: look at it, then resume or abort",
        ),
        Cause.CLOCK_STEP: Failsafe(
            "the clock was set; durations are not affected",
            Response.WARN,
            "check the time synchronisation of the computer",
        ),
        Cause.COUNTS_FRAME: Failsafe(
            "records are in another frame; they are not used",
            Response.WARN,
            "check that the driver and the planner have the same field file and frame",
        ),
        Cause.COUNTS_STAMP: Failsafe(
            "records are stamped over an hour ahead or a day old; they are not used",
            Response.WARN,
            "check the clocks of the computer and of the neutron logger",
        ),
        Cause.COUNTS_BAD: Failsafe(
            "more than half of the records of a minute are quarantined: their counts cannot be trusted",
            Response.PAUSE,
            "check the sensor as /diagnostics says; the mission can be resumed when its counts are good again",
        ),
        Cause.OTHER_ROBOT: Failsafe(
            "another robot is nearer than the limit while the robot drives, or is to drive first where both met",
            Response.HOLD,
            "the robot drives on by itself when the other one is away or stands; if both wait, move one of them",
        ),
        Cause.WATCHDOG: Failsafe(
            "the watchdog has cancelled the goals: the planner was silent or stuck, or another heartbeat is bad",
            Response.PAUSE,
            "look at the robot, and at the entry watchdog of /diagnostics, then resume",
            choices=(Response.PAUSE, Response.ABORT),
        ),
        Cause.WATCHDOG_SILENT: Failsafe(
            "the watchdog was there, and has not been heard for 10 s",
            Response.WARN,
            "start the watchdog again: nothing stops the robot if the planner dies",
        ),
        Cause.OPERATOR_GONE: Failsafe(
            "nobody is present any more, by the operator's page or a dead man's switch; with a response that "
            "stops the robot also if nobody ever was",
            Response.WARN,
            "open the page, or hold the switch",
            ("operator_gone_s",),
        ),
    }
)
"""The table of failsafes, by cause."""


def find_cause(name: str) -> Cause:
    """The cause of a name, as people write it.

    :raises InputError: if there is none, with the most similar name
    """
    known = name.strip().lower().replace("-", "_")
    if known not in set(Cause):
        near = did_you_mean(known, list(Cause))
        raise InputError(f"there is no cause {name!r}{near}", f"choose among {', '.join(Cause)}")
    return Cause(known)


def chosen_response(cause: Cause, response: Response) -> Response:
    """The response that people choose for a cause.

    :raises InputError: if the robot could drive on without people after a stop by the watchdog
    """
    if response not in FAILSAFES[cause].choices:
        what = f"{cause}:{response} is not possible: after a stop by the watchdog the robot waits for people"
        raise InputError(what, f"choose {' or '.join(FAILSAFES[cause].choices)}")
    return response


# What follows in each phase: the alarm is given to a mission, which is the one of the robot ---------------------

_HOME, _FIELD = Stop("home", 0.0, 0.0), Stop("the stop", 30.0, 0.0)
_START = events.Moved(1.0, 60.0, 0.0), events.Command(1.0, Verb.START)
_TRAVELLING = *_START, events.Planned(2.0, 1, Choice(_FIELD, "least known"))
_COUNTING = *_TRAVELLING, events.GoalReached(60.0, 1, 30.0, 0.0)
_RETURNING = *_COUNTING, events.Command(70.0, Verb.RETURN)
_WAY_TO: Final[Mapping[Phase, tuple[events.Event, ...]]] = MappingProxyType(
    {
        Phase.IDLE: _START[:1],
        Phase.PLANNING: _START,
        Phase.TRAVELLING: _TRAVELLING,
        Phase.COUNTING: _COUNTING,
        Phase.WAITING: (*_TRAVELLING, events.GoalFailed(20.0, 1, "blocked")),
        Phase.CANCELLING: (*_TRAVELLING, events.Command(20.0, Verb.SKIP)),
        Phase.PAUSED: (*_COUNTING, events.Command(70.0, Verb.PAUSE)),
        Phase.RETURNING: _RETURNING,
        Phase.FINISHED: (*_RETURNING, events.GoalReached(120.0, 2, 0.0, 0.0)),
    }
)
"""Events that lead a mission with a home into each phase."""


def _mission_in(phase: Phase) -> Mission:
    rules = MissionRules(
        budget_s=7200.0, dwell=parse_dwell("fmi:60"), home=_HOME, standstill_s=0.0, backoff_s=60.0
    )
    mission = Mission(rules)
    for event in _WAY_TO[phase]:
        mission.step(event)
    assert mission.state.phase is phase
    return mission


def consequence(response: Response, phase: Phase, cause: str = "cause", reason: str = "REASON") -> tuple[str, str]:
    """Consequence of an alarm for a mission in a phase, by comparison with a mission without the alarm.

    The mission is the pure state machine of the planner, so this is what a robot does.

    :returns: what it does, and the reason in its status right after the alarm; empty if that does not change
    """
    mission, other = _mission_in(phase), _mission_in(phase)
    now_s = other.state.now_s or 0.0
    actions = mission.step(Alarm(now_s, cause, response, reason))
    says = mission.state.reason if mission.state.reason != other.state.reason else ""
    cancels = [action.goal_id for action in actions if isinstance(action, events.CancelGoal)]
    which = "all goals of the navigation" if events.ANYBODYS in cancels else "the goal"
    does = [f"cancels {which}"] * bool(cancels)
    counted, counts = (one.state.counting and one.state.counting.since_s for one in (other, mission))
    does += ["stops counting"] * (counted is not None and counts is None)
    for one in (mission, other):
        if one.state.goal is not None and one.state.goal.cancelled_s is not None:
            one.step(events.GoalFailed(now_s + 1.0, one.state.goal.goal_id, "cancelled"))
    ends = mission.state.phase
    if ends is other.state.phase:
        verb = Verb.RESUME if ends is Phase.PAUSED else Verb.START if not mission.state.under_way else None
        if verb is not None:
            mission.step(events.Command(now_s + 2.0, verb))
            refused = mission.state.phase is ends
            home = mission.state.phase is Phase.RETURNING
            does += [f"refuses {verb}"] * refused + [f"{verb} sends the robot home"] * home
    elif ends is Phase.PAUSED:
        mission.step(events.AlarmOver(now_s + 2.0, cause))
        waits = mission.state.phase is Phase.PAUSED
        does.append("waits for people" if waits else "goes on by itself when it is over")
    elif ends is Phase.RETURNING:
        does.append("drives home and ends")
    else:
        does.append("ends where the robot is")
    shown = "shows it" if mission.state.alarms else "nothing"
    return ", ".join(does) or shown, says
