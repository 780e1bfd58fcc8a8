# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules, phases, alarms and status of a mission, all of them frozen data."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any, Final

from soilmoist_ros.exploration.planning.dwell import DwellRule
from soilmoist_ros.exploration.planning.forecast import Forecast, forecast_to_text
from soilmoist_ros.exploration.planning.properties import Aim
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import Health, Level

Polygon = tuple[tuple[float, float], ...]
Polygons = tuple[Polygon, ...]  # corners of areas: metres east and north of the field's datum


READY = "waiting for start"  # reason of a mission that can be started
MOVING = "moving"  # cause of an alarm: the robot moves although no goal moves it
PUBLISHED_MIN_LAST_DWELL_S = 60.0  # with the published presets, stops that leave less for counting are skipped [s]
OTHER_ROBOT = "other_robot"  # cause of an alarm: another robot is too near
MAX_UNTIL_SD = 0.5
"""Largest standard deviation that can end a mission [m^3/m^3, or share of the rate]; more is meant in percent."""


class Phase(StrEnum):
    """Phase of a mission."""

    IDLE = "idle"
    PLANNING = "planning"
    WAITING = "waiting"
    TRAVELLING = "travelling"
    COUNTING = "counting"
    PAUSED = "paused"
    CANCELLING = "cancelling"
    RETURNING = "returning"
    FINISHED = "finished"


class Verb(StrEnum):
    """Commands of an operator."""

    START = "start"
    PAUSE = "pause"
    RESUME = "resume"
    ABORT = "abort"
    SKIP = "skip"
    MEASURE = "measure"
    RULE_OUT = "rule_out"
    LIFT = "lift"
    ORDER = "order"
    CHANGE = "change"
    RETURN = "return_home"


TRIGGERS = (Verb.START, Verb.PAUSE, Verb.RESUME, Verb.ABORT, Verb.SKIP)
"""Commands that need nothing but their name."""


class Response(StrEnum):
    """Response of the mission while the guard reports a cause of danger."""

    IGNORE = "ignore"
    WARN = "warn"  # show it
    PAUSE = "pause"  # stop, and wait for an operator
    HOLD = "hold"  # stop, and go on when the cause is over
    RETURN = "return_home"  # stop measuring, go home and end
    ABORT = "abort"  # stop and end the mission where the robot is

    @property
    def stops(self) -> bool:
        """True if the robot must not move while the cause lasts."""
        return self in (Response.PAUSE, Response.HOLD, Response.ABORT)


class PlanKind(StrEnum):
    """Kind of stop that a plan request asks for."""

    WARM_UP = "warm_up"
    EXPLORE = "explore"


class MissionEnd(StrEnum):
    """Reason why a mission ended."""

    TIME_UP = "time_up"  # the budget was used up, or the rest was too short for another stop
    NOTHING_LEFT = "nothing_left"  # no reachable and useful stop was left
    ABORTED = "aborted"  # the operator aborted it
    SILENT_SENSOR = "silent_sensor"  # no record arrived; in recordings of earlier versions
    RETURNED = "returned"  # the operator sent the robot home
    FAILSAFE = "failsafe"  # the guard reported a danger that ends the mission
    GOOD_ENOUGH = "good_enough"  # the deviation of the map is as small as demanded, or its decision is made
    LITTLE_GAIN = "little_gain"  # the map would become less better than demanded
    NOTHING_VARIES = "nothing_varies"  # the counts showed no differences; in recordings of earlier versions


@dataclass(frozen=True, kw_only=True)
class MissionRules:
    """Rules of a mission from start to end.

    The budget runs from the start to the end of measuring *and* of the way home. It keeps running while the
    mission is paused: batteries, daylight and the people in the field do not stop for a pause.

    :param min_dwell_s: shortest dwell, whatever the dwell rule says; stops that leave less are skipped [s]
    :param arrival_radius_m: the robot is at a stop within this distance, or within ``reach_m`` of the stop if that
        is less; keep it above the positions' noise [m]
    :param cancel_limit_s: time after which a goal is cancelled again, while the robot is not known to stand [s]
    :param standstill_s: a stop is confirmed when the robot has not moved for this time [s]; 0: it is confirmed by
        the end of the goal, or after ``cancel_limit_s`` where the robot is to stay
    :param stays: when the dwell rule is met, the visit stays open until the next stop is chosen, so that the
        planner may choose to count on. Without, the visit closes first, as published
    :param until_sd: the mission ends when the standard deviation of the map is at most this: of the moisture
        [m^3/m^3], or of the rate as a share of its mean [-]; see :class:`Forecast`. 0: never
    :param until_gain: the mission ends when the standard deviation will fall by less than this in ten minutes
        [%]; 0: never
    :param until: how good the map must be; the tour is planned to reach it in the shortest time, and the mission
        ends then. ``until_sd`` only ends the mission
    :param by_person: a person carries the sensor: who stands at another place than the target measures there, and
        who leaves a stop ends its visit; neither is a failure
    :param antenna_m: distance from the robot's place to the antenna, where its records lie [m]
    :raises ValueError: if a value is out of its range
    """

    budget_s: float  # time of the mission, the way home and pauses included [s]
    dwell: DwellRule  # rule for the end of counting at a stop
    home: Stop | None = None  # stop at which the mission ends, ``None`` to stay at the last one
    warm_up_stops: int = 3  # number of ``warm_up`` samples before the map guides the choice
    min_dwell_s: float = 10.0
    min_last_dwell_s: float = 0.0  # stops that leave less are skipped, if it is more than ``min_dwell_s`` [s]
    speed_mps: float = 0.6  # speed, to estimate travel [m/s]
    stop_overhead_s: float = 12.0  # time of each trip that is not driving [s]
    detour: float = 1.3  # driven distance over straight distance, where the planner gives no travel time [-]
    arrival_radius_m: float = 3.0
    goal_time_factor: float = 3.0  # maximum trip time as a multiple of the expected time, before the margin [-]
    goal_time_margin_s: float = 60.0  # time added to the multiple of the expected trip time [s]
    return_margin_s: float = 60.0  # reserve kept for the way home [s]
    cancel_limit_s: float = 30.0
    standstill_s: float = 4.0
    backoff_s: float = 2.0  # wait after the first failure; it doubles with each failure in a row [s]
    backoff_limit_s: float = 60.0  # longest wait after a failure [s]
    plan_limit_s: float = 120.0  # a plan request that is not answered in this time has failed [s]
    retries: int = 1  # number of times that a failed goal is sent again before its stop is ruled out
    blacklist_s: float = 900.0  # time for which a stop is ruled out after it failed or was skipped [s]
    failures_to_pause: int = 5  # failures without a visit in between after which the operator is asked
    silence_limit_s: float = 60.0  # time without a record of the stop, while counting, that counts as silence [s]
    odometer_step_m: float = 0.5  # moves shorter than this count as noise of the position [m]
    stays: bool = False
    until_sd: float = 0.0
    until_gain: float = 0.0
    until: Aim | None = None
    by_person: bool = False
    antenna_m: float = 0.0

    def __post_init__(self) -> None:
        above_zero = {
            "budget_s", "speed_mps", "arrival_radius_m", "goal_time_factor", "cancel_limit_s", "plan_limit_s",
            "blacklist_s", "failures_to_pause", "silence_limit_s",
        }  # fmt: skip
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int | float):
                continue
            low = 1.0 if field.name == "detour" else 0.0
            if not (math.isfinite(value) and value >= low) or (field.name in above_zero and value <= 0):
                limit = "> 0" if field.name in above_zero else f">= {low:g}"
                raise ValueError(f"{field.name} must be {limit} and finite, got {value}")

    @property
    def aim(self) -> Aim | None:
        """Quality of the map at which the mission ends early; ``None`` if the time decides."""
        return self.until or (Aim("sd", self.until_sd) if self.until_sd > 0 else None)

    @property
    def needed_dwell_s(self) -> float:
        """Time that a stop must leave for counting [s]."""
        return max(self.min_dwell_s, self.min_last_dwell_s)

    def travel_s(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        """Estimated time of a trip [s]."""
        return self.stop_overhead_s + self.detour * math.dist(start, end) / self.speed_mps

    def way_home_s(self, start: tuple[float, float], travel_s: float = 0.0) -> float:
        """Time to keep for the way home [s]; 0 without a home, or at home.

        :param start: where the robot sets off [m]
        :param travel_s: travel time along the real route [s]; 0 if it is not known
        """
        if self.home is None or self.is_at(start, self.home):
            return 0.0
        return max(travel_s, self.travel_s(start, self.home.xy)) + self.return_margin_s

    def is_at(self, place: tuple[float, float], stop: Stop, noise_m: float = 0.0) -> bool:
        """True if a robot at a place is at a stop; see :meth:`reach_m`."""
        return math.dist(place, stop.xy) <= self.reach_m(stop, noise_m)

    def reach_m(self, stop: Stop, noise_m: float = 0.0) -> float:
        """Distance up to which the robot is at a stop: within that of the stop, at most the arrival radius [m].

        :param noise_m: error that the positions may have [m]; nearer stops cannot be told apart
        """
        return min(self.arrival_radius_m, max(stop.reach_m, noise_m))


@dataclass(frozen=True, slots=True)
class Changes:
    """Settings that an operator changes; ``None`` leaves a setting as it is.

    The last three change between missions only.
    """

    budget_s: float | None = None  # time of the mission from its start [s]
    dwell: str | None = None  # dwell rule, as text
    strategy: str | None = None  # name of the strategy that chooses stops
    target: str | None = None  # map that plans improve, ``rate`` or ``vwc``, or ``decision``
    home: Stop | None = None  # stop at which the mission ends
    warm_up_stops: int | None = None  # number of stops before the map guides the choice; follows from the strategy
    until_sd: float | None = None  # standard deviation of the map at which the mission ends; 0: never
    until_gain: float | None = None  # gain in ten minutes below which it ends [%]; 0: never
    field: str | None = None  # field file
    earlier: tuple[str, ...] | None = None  # earlier runs of the field that inform map and plan
    covariates: tuple[str, ...] | None = None  # files that may explain the map

    @property
    def given(self) -> dict[str, Any]:
        """Settings that are changed, by the names of their fields."""
        return {one.name: value for one in fields(self) if (value := getattr(self, one.name)) is not None}

    @property
    def of_survey(self) -> dict[str, Any]:
        """Changed settings that take effect only between missions, by the names of their fields."""
        return {name: value for name, value in self.given.items() if name in ("field", "earlier", "covariates")}


@dataclass(frozen=True, slots=True)
class Alarm:
    """The guard has found a danger, or has more to say of one."""

    now_s: float
    cause: str  # code of the cause; each cause is on or off
    response: Response  # response of the mission
    reason: str  # the cause in words


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """The mission at one time, for operators and displays.

    :param needs_operator: whether it is paused and did not pause at the operator's command, or the robot was asked
        more than once to stop and is not known to stand
    """

    now_s: float  # time of the last event [s]; NaN before the first
    phase: Phase  # phase of the mission
    reason: str  # why, never empty
    target: Stop | None  # stop to which the robot drives, or at which it counts
    planned_dwell_s: float  # expected dwell at the target [s]; 0 without a stop
    dwell_s: float  # time spent counting there so far [s]
    progress: float  # share of the dwell that is done, 0..1
    time_used_s: float  # time since the start, pauses included [s]
    time_left_s: float  # rest of the budget [s]
    distance_m: float  # distance travelled [m]
    samples: int  # samples completed
    counting_s: float  # time spent counting at all stops [s]
    raw_counts: int  # raw counts at the target so far
    failures: int  # failures since the last sample
    blacklisted: tuple[str, ...]  # names of the stops that are ruled out
    estimated_end_s: float | None  # latest time at which the mission ends [s]; ``None`` when no mission is running
    needs_operator: bool = False
    silent: bool = False  # whether the sensor is silent while the robot counts
    ended: MissionEnd | None = None  # why the mission has ended or is ending; ``None`` before
    alarms: tuple[Alarm, ...] = ()  # dangers that the guard reports now
    emergency: bool = False  # whether an emergency stop is pressed
    stop_requests: int = 0  # number of requests to stop while the robot is not yet known to stand still
    queue: tuple[str, ...] = ()  # names of the stops that an operator has asked for
    changes: Changes = Changes()  # settings that an operator has changed
    clock_offset_s: float = 0.0  # step of the clock that stamps the records, since the start [s]
    ruled_out: Polygons = ()  # areas in which no stop is chosen
    forecast: Forecast | None = None  # the last forecast of the map's standard deviation
    place: tuple[float, float] | None = None  # place of the robot [m]; ``None`` if it is unknown
    yields: bool = False  # whether it is paused until another robot is away
    hindered: bool = False  # whether no mission is running and a start would be refused now
    certificate: str = ""  # sealed sample of the mission; empty without a certificate


# The status as values, for the topic ``mission`` of the planner and of recordings --------------------------------

STATUS_FLOATS: Final = {"elapsed_dwell_s": "dwell_s"} | {
    name: name
    for name in ("planned_dwell_s", "progress", "time_used_s", "time_left_s", "distance_m", "counting_s")
}
STATUS_COUNTS: Final = ("samples", "raw_counts", "failures")
STATUS_FLAGS: Final = ("needs_operator", "silent", "emergency", "hindered")
"""Values of the status as a state of health, and the fields of the status that they have."""


def status_health(status: MissionStatus, more: Mapping[str, str] | None = None) -> Health:
    """A status as a state of health with values, as the topic ``mission`` has it.

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
        **{key: _text(getattr(status, name)) for key, name in STATUS_FLOATS.items()},
        **{name: str(int(getattr(status, name))) for name in STATUS_COUNTS},
        **{name: str(bool(getattr(status, name))) for name in STATUS_FLAGS},
        **({"certificate": status.certificate} if status.certificate else {}),
        **(more or {}),
    }
    return Health("mission", status_level(status), f"{status.phase}: {status.reason}", values)


def status_level(status: MissionStatus) -> Level:
    """Severity of a status, see :func:`status_health`."""
    if status.emergency or status.needs_operator:
        return Level.ERROR
    doubtful = status.phase is Phase.PAUSED or status.failures or status.silent or status.alarms
    return Level.WARN if doubtful else Level.OK


def _text(value: float) -> str:
    return repr(float(value))


def _calendar(time_s: float | None) -> str:
    if time_s is None or not math.isfinite(time_s):
        return ""
    try:
        return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds")
    except (OverflowError, ValueError, OSError):
        return ""
