# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules, phases, alarms and status of a mission, all of them frozen data."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

from soilmoist_ros.exploration.planning.dwell import DwellRule
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.travel.stop import Stop

Polygon = tuple[tuple[float, float], ...]
Polygons = tuple[Polygon, ...]
"""Corners of areas: metres east and north of the field's datum."""


READY = "waiting for start"
"""End of the reason of a mission that can be started."""
MOVING = "moving"
"""Cause of an alarm: the robot moves although no goal moves it."""
PUBLISHED_MIN_LAST_DWELL_S = 60.0
"""With the published presets, stops that leave less for counting are skipped [s]."""
OTHER_ROBOT = "other_robot"
"""Cause of an alarm: another robot is too near."""
MAX_UNTIL_SD = 0.5
"""Largest standard deviation that can end a mission [m^3/m^3, or share of the rate]; more is meant in percent."""


class Phase(StrEnum):
    """What the mission is doing."""

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
    ORDER = "order"
    CHANGE = "change"
    RETURN = "return_home"


TRIGGERS = (Verb.START, Verb.PAUSE, Verb.RESUME, Verb.ABORT, Verb.SKIP)
"""Commands that need nothing but their name."""


class Response(StrEnum):
    """What the mission does while the guard reports a cause of danger."""

    IGNORE = "ignore"
    WARN = "warn"
    """Show it."""
    PAUSE = "pause"
    """Stop, and wait for an operator."""
    HOLD = "hold"
    """Stop, and go on when the cause is over."""
    RETURN = "return_home"
    """Stop measuring, go home and end."""
    ABORT = "abort"
    """Stop and end the mission where the robot is."""

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

    TIME_UP = "time_up"
    """The budget was used up, or the rest was too short for another stop."""
    NOTHING_LEFT = "nothing_left"
    """No reachable and useful stop was left."""
    ABORTED = "aborted"
    """The operator aborted it."""
    SILENT_SENSOR = "silent_sensor"
    """No record arrived, and the rules demand an abort."""
    RETURNED = "returned"
    """The operator sent the robot home."""
    FAILSAFE = "failsafe"
    """The guard reported a danger that ends the mission."""
    GOOD_ENOUGH = "good_enough"
    """The standard deviation of the map is as small as demanded."""
    LITTLE_GAIN = "little_gain"
    """The map would become less better than demanded."""
    NOTHING_VARIES = "nothing_varies"
    """The counts show no differences within the field, and the rules demand a gain."""


class OnSilence(StrEnum):
    """What to do when no record arrives while counting."""

    WAIT = "wait"
    PAUSE = "pause"
    ABORT = "abort"


@dataclass(frozen=True, kw_only=True)
class MissionRules:
    """Rules of a mission from start to end.

    The budget runs from the start to the end of measuring *and* of the way home. It keeps running while the
    mission is paused: batteries, daylight and the people in the field do not stop for a pause.

    :param budget_s: time of the mission, the way home and pauses included [s]
    :param dwell: when to end counting at a stop
    :param home: where to go at the end, ``None`` to stay at the last stop
    :param warm_up_stops: number of ``warm_up`` samples before the map guides the choice
    :param min_dwell_s: shortest dwell, whatever the dwell rule says; stops that leave less are skipped [s]
    :param min_last_dwell_s: stops that leave less are skipped, if it is more than ``min_dwell_s`` [s]
    :param speed_mps: speed, to estimate travel [m/s]
    :param stop_overhead_s: time of each trip that is not driving [s]
    :param detour: driven distance over straight distance, where the planner gives no travel time [-]
    :param arrival_radius_m: the robot is at a stop within this distance, or within ``reach_m`` of the stop if that
        is less; keep it above the positions' noise [m]
    :param goal_time_factor: maximum trip time as a multiple of the expected time ... [-]
    :param goal_time_margin_s: ... plus this [s]
    :param return_margin_s: reserve kept for the way home [s]
    :param cancel_limit_s: time after which a goal is cancelled again, while the robot is not known to stand [s]
    :param standstill_s: a stop is confirmed when the robot has not moved for this time [s]; 0: it is confirmed by
        the end of the goal, or after ``cancel_limit_s`` where the robot is to stay
    :param backoff_s: wait after the first failure; it doubles with each failure in a row [s]
    :param backoff_limit_s: longest wait after a failure [s]
    :param plan_limit_s: a plan request that is not answered in this time has failed [s]
    :param retries: how often a goal that failed is sent again before its stop is ruled out
    :param blacklist_s: how long a stop is ruled out after it failed or was skipped [s]
    :param failures_to_pause: failures without a visit in between after which the operator is asked
    :param silence_limit_s: time without a record of the stop, while counting, that counts as silence [s]
    :param on_silence: what to do on silence; ``wait`` ends with the dwell rule's longest time
    :param stays: when the dwell rule is met, the visit stays open until the next stop is chosen, so that the
        planner may choose to count on; what is left of the time is used where the robot stands. Without, the
        visit closes first, as published
    :param odometer_step_m: moves shorter than this count as noise of the position [m]
    :param until_sd: the mission ends when the standard deviation of the map is at most this: of the moisture
        [m^3/m^3], or of the rate as a share of its mean [-]; see :class:`Forecast`. 0: never
    :param until_gain: the mission ends when the standard deviation will fall by less than this in ten minutes [%],
        or when the counts show no differences within the field. 0: never
    :raises ValueError: if a value is out of its range
    """

    budget_s: float
    dwell: DwellRule
    home: Stop | None = None
    warm_up_stops: int = 3
    min_dwell_s: float = 10.0
    min_last_dwell_s: float = 0.0
    speed_mps: float = 0.6
    stop_overhead_s: float = 12.0
    detour: float = 1.3
    arrival_radius_m: float = 3.0
    goal_time_factor: float = 3.0
    goal_time_margin_s: float = 60.0
    return_margin_s: float = 60.0
    cancel_limit_s: float = 30.0
    standstill_s: float = 4.0
    backoff_s: float = 2.0
    backoff_limit_s: float = 60.0
    plan_limit_s: float = 120.0
    retries: int = 1
    blacklist_s: float = 900.0
    failures_to_pause: int = 5
    silence_limit_s: float = 60.0
    on_silence: OnSilence = OnSilence.WAIT
    odometer_step_m: float = 0.5
    stays: bool = False
    until_sd: float = 0.0
    until_gain: float = 0.0

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
        straight_s = self.travel_s(start, (self.home.x_m, self.home.y_m))
        return max(travel_s, straight_s) + self.return_margin_s

    def is_at(self, place: tuple[float, float], stop: Stop, noise_m: float = 0.0) -> bool:
        """True if a robot at a place is at a stop; see :meth:`reach_m`."""
        return math.dist(place, (stop.x_m, stop.y_m)) <= self.reach_m(stop, noise_m)

    def reach_m(self, stop: Stop, noise_m: float = 0.0) -> float:
        """Distance up to which the robot is at a stop: within that of the stop, at most the arrival radius [m].

        :param stop: the stop
        :param noise_m: error that the positions may have [m]; nearer stops cannot be told apart
        """
        return min(self.arrival_radius_m, max(stop.reach_m, noise_m))


@dataclass(frozen=True, slots=True)
class Changes:
    """Settings that an operator changes; ``None`` leaves a setting as it is.

    The last three change between missions only.

    :param budget_s: time of the mission from its start [s]
    :param dwell: dwell rule, as text
    :param strategy: how stops are chosen
    :param target: which map is to be good, ``rate`` or ``vwc``
    :param home: where to go at the end
    :param warm_up_stops: number of stops before the map guides the choice; follows from the strategy
    :param until_sd: standard deviation of the map at which the mission ends; 0: never
    :param until_gain: gain in ten minutes below which it ends [%]; 0: never
    :param field: field file
    :param earlier: earlier runs of the field that inform map and plan
    :param covariates: files that may explain the map
    """

    budget_s: float | None = None
    dwell: str | None = None
    strategy: str | None = None
    target: str | None = None
    home: Stop | None = None
    warm_up_stops: int | None = None
    until_sd: float | None = None
    until_gain: float | None = None
    field: str | None = None
    earlier: tuple[str, ...] | None = None
    covariates: tuple[str, ...] | None = None

    @property
    def of_survey(self) -> dict[str, Any]:
        """What is changed between missions only, by the names of the parameters."""
        named = {"field": self.field, "earlier": self.earlier, "covariates": self.covariates}
        return {name: value for name, value in named.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Alarm:
    """The guard has found a danger, or has more to say of one.

    :param now_s: time [s]
    :param cause: code of the cause; each cause is on or off
    :param response: what the mission does about it
    :param reason: the cause in words
    """

    now_s: float
    cause: str
    response: Response
    reason: str


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """The mission at one time, for operators and displays.

    :param now_s: time of the last event [s]; NaN before the first
    :param phase: what the mission is doing
    :param reason: why, never empty
    :param target: where the robot is going or counting
    :param planned_dwell_s: expected dwell at the target [s]; 0 without a stop
    :param dwell_s: time spent counting there so far [s]
    :param progress: share of the dwell that is done, 0..1
    :param time_used_s: time since the start, pauses included [s]
    :param time_left_s: rest of the budget [s]
    :param distance_m: distance travelled [m]
    :param samples: samples completed
    :param counting_s: time spent counting at all stops [s]
    :param raw_counts: raw counts at the target so far
    :param failures: failures since the last sample
    :param blacklisted: names of the stops that are ruled out
    :param estimated_end_s: latest time at which the mission ends [s]; ``None`` when no mission is running
    :param needs_operator: whether it is paused and did not pause at the operator's command, or the robot was asked
        more than once to stop and is not known to stand
    :param silent: whether the sensor is silent while the robot counts
    :param ended: why the mission has ended or is ending; ``None`` before
    :param alarms: dangers that the guard reports now
    :param emergency: whether an emergency stop is pressed
    :param stop_requests: how often the robot was asked to stop and is not yet known to stand still
    :param queue: names of the stops that an operator has asked for
    :param strategy: how stops are chosen, if an operator has changed it
    :param field: field file, if an operator has chosen another than that of the start
    :param earlier: earlier runs, if an operator has chosen them
    :param covariates: covariates, if an operator has chosen them
    :param clock_offset_s: how far the clock that stamps the records has been set since the start [s]
    :param ruled_out: areas in which no stop is chosen
    :param forecast: the last forecast of the map's standard deviation
    :param forecast_s: when it was made [s]; ``None`` without one
    :param place: where the robot is [m]; ``None`` if that is not known
    :param yields: whether it is paused until another robot is away
    """

    now_s: float
    phase: Phase
    reason: str
    target: Stop | None
    planned_dwell_s: float
    dwell_s: float
    progress: float
    time_used_s: float
    time_left_s: float
    distance_m: float
    samples: int
    counting_s: float
    raw_counts: int
    failures: int
    blacklisted: tuple[str, ...]
    estimated_end_s: float | None
    needs_operator: bool = False
    silent: bool = False
    ended: MissionEnd | None = None
    alarms: tuple[Alarm, ...] = ()
    emergency: bool = False
    stop_requests: int = 0
    queue: tuple[str, ...] = ()
    strategy: str = ""
    field: str = ""
    earlier: tuple[str, ...] | None = None
    covariates: tuple[str, ...] | None = None
    clock_offset_s: float = 0.0
    ruled_out: Polygons = ()
    forecast: Forecast | None = None
    forecast_s: float | None = None
    place: tuple[float, float] | None = None
    yields: bool = False
