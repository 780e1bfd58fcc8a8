# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State and status of a mission, and both as plain data for a journal."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, get_args

from pydantic import TypeAdapter, ValidationError

from soilmoist_ros.exploration.mission.events import Event
from soilmoist_ros.exploration.mission.types import (
    OTHER_ROBOT,
    READY,
    Alarm,
    Changes,
    MissionEnd,
    MissionRules,
    MissionStatus,
    Phase,
    Polygons,
    Response,
)
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.exploration.planning.dwell import DwellRule, StopRule, parse_dwell
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import InputError, nan_as_text, read_json


class Todo(StrEnum):
    """Task that follows once the robot has stopped (``CANCELLING``) or the operator resumes (``PAUSED``)."""

    PLAN = "plan"
    TRAVEL = "travel"
    COUNT = "count"
    RETURN = "return"
    PAUSE = "pause"
    FINISH = "finish"
    IDLE = "idle"


@dataclass(frozen=True, slots=True)
class PendingPlan:
    """A plan request that is not answered yet."""

    plan_id: int
    deadline_s: float


@dataclass(frozen=True)
class Target:
    """A stop that was chosen."""

    stop: Stop
    reason: str
    travel_s: float  # time expected to it [s]
    attempts: int = 0  # number of failed attempts to go there
    dwell: StopRule = None  # its own dwell rule, ``None`` for the mission's
    home_s: float = 0.0  # travel time from it to the home [s]; 0 if the planner has not given it
    certifies: bool = False  # whether it is of the sealed sample of a certificate


@dataclass(frozen=True)
class Goal:
    """A goal that the navigation works on, or whose robot is not yet known to stand."""

    goal_id: int
    stop: Stop
    deadline_s: float  # time from which the goal is late [s]
    cancelled_s: float | None = None  # when it was cancelled last [s]; ``None`` if it was not
    requests: int = 0  # how often it was cancelled
    over: bool = False  # whether the navigation has reported its end


@dataclass(frozen=True)
class OpenVisit:
    """Visit in progress at the stop where the robot stands."""

    x_m: float  # place of the robot, east [m]
    y_m: float  # place of the robot, north [m]
    arrived_s: float  # time of arrival [s]
    since_s: float | None  # time at which counting began or was resumed [s]; ``None`` while it is suspended
    heard_s: float  # time of the last record of this stop, or ``since_s`` [s]
    before_s: float = 0.0  # time counted before the last resumption [s]
    silent: bool = False  # whether silence has been reported
    records: int = 0
    raw_counts: int = 0
    exposure_s: float = 0.0
    effective_exposure_s: float = 0.0
    earlier_counts: int = (
        0  # of ``raw_counts``, when the planner chose to count on: the dwell rule judges the rest
    )
    earlier_s: float = 0.0  # their exposure [s]
    met: VisitEnd | None = None  # why the dwell is over while the next stop is being chosen
    outcome: str = ""  # as ``met``, in words
    to_the_end: bool = False  # whether the robot counts here until the time is up, since no other stop fits in
    sd_m: float = 0.0  # standard deviation of that place [m], 0 if unknown
    away_s: float | None = None  # since when the robot is elsewhere without a pause [s]; ``None`` if it is there

    @property
    def judged(self) -> tuple[int, float]:
        """Raw counts that the dwell rule judges, and their exposure [s]."""
        return self.raw_counts - self.earlier_counts, self.exposure_s - self.earlier_s

    def dwell_s(self, now_s: float) -> float:
        """Time spent counting [s]."""
        return self.before_s + (now_s - self.since_s if self.since_s is not None else 0.0)


@dataclass(frozen=True, slots=True)
class RuledOut:
    """A stop that must not be chosen until a time [s]."""

    name: str
    until_s: float


@dataclass(frozen=True)
class QueuedStop:
    """A stop that somebody has asked for; ``dwell`` is its own dwell rule as text, empty for the mission's."""

    stop: Stop
    who: str
    dwell: str = ""


@dataclass(frozen=True)
class MissionState:
    """All that a mission remembers; :class:`MissionRules` and this determine what an event does."""

    phase: Phase = Phase.IDLE
    reason: str = READY
    now_s: float | None = None
    started_s: float | None = None  # start of the mission [s]; ``None`` before
    ended_s: float | None = None  # end of the mission [s]; ``None`` while it is under way
    todo: Todo | None = None  # task after the stop of the robot (``CANCELLING``), or after the wait (``WAITING``)
    resume: Todo | None = None  # what the operator's ``resume`` does (in ``PAUSED``, or on the way there)
    cause: str = ""  # what ``CANCELLING`` is for, said again when the robot has stopped
    ending: str = ""  # why the mission is ending
    plan: PendingPlan | None = None
    goal: Goal | None = None
    target: Target | None = None
    counting: OpenVisit | None = None
    blacklist: tuple[RuledOut, ...] = ()
    plans: int = 0  # id of the last plan request; ids are never used twice
    goals: int = 0  # id of the last goal
    returns: int = 0  # number of failed attempts to go home
    failures: int = 0  # failures since the last sample
    position: tuple[float, float] | None = None  # place of the robot [m]
    odometer_at: tuple[float, float] | None = None  # up to where the distance has been added up [m]
    distance_m: float = 0.0
    samples: int = 0
    counting_s: float = 0.0
    last_stamp_s: float | None = None  # stamp of the newest record [s]
    raw_counts: int = 0  # counts of all records of this mission, ``exposure_s`` their exposure [s]
    exposure_s: float = 0.0
    needs_operator: bool = False  # whether the last pause was the mission's own: it waits for the operator
    ended: MissionEnd | None = None  # why the mission has ended or is ending
    held: bool = False  # whether the last pause ends by itself, when the guard has nothing more against it
    interrupted: bool = False  # whether the last pause is only because the planner was restarted
    wait_until_s: float | None = None  # no new attempt before [s]
    position_s: float | None = None  # time of the position [s]
    position_sd_m: float = 0.0  # standard deviation of the position [m], 0 if unknown
    still_at: tuple[float, float] | None = None  # the place that the robot has not left [m] ...
    still_since_s: float | None = None  # ... since then [s]
    unseen_mps: float = 0.0  # a slower motion would not have shown in the noise of its places [m/s]
    stamp_offset_s: float = 0.0  # the clock that stamps the records minus mission time [s]
    boot: str = ""  # names the start of the computer from which the steady clock counts; empty if unknown
    steady_offset_s: float = 0.0  # mission time minus steady time [s]
    alarms: tuple[Alarm, ...] = ()  # dangers that are on
    emergency: tuple[str, ...] = ()  # emergency stops that are pressed
    queue: tuple[QueuedStop, ...] = ()  # stops that an operator has asked for
    ruled_out: Polygons = ()  # polygons in which no stop is chosen, corners [m]
    changes: Changes | None = None  # settings that an operator has changed
    forecast: Forecast | None = None  # the last one of the map's standard deviation
    forecast_s: float | None = None  # time of the forecast [s]
    good_forecasts: int = 0  # the last forecasts by which the mission may end, in a row
    certificate: str = ""  # sealed sample of the mission; empty without a certificate
    certified: tuple[Visit, ...] = ()  # visits at its stops

    @property
    def time_used_s(self) -> float:
        """Time since the start, pauses included [s]."""
        if self.started_s is None or self.now_s is None:
            return 0.0
        return (self.ended_s if self.ended_s is not None else self.now_s) - self.started_s

    @property
    def all_counting_s(self) -> float:
        """Time spent counting at all stops, that under way included [s]."""
        if self.counting is None or self.now_s is None:
            return self.counting_s
        return self.counting_s + self.counting.dwell_s(self.now_s)

    @property
    def waits_for_people(self) -> bool:
        """True if it was paused or stopped until people resume."""
        paused = self.resume is not None and not self.held and not self.interrupted
        return paused or bool(self.emergency)

    @property
    def under_way(self) -> bool:
        """True if a mission has started and not ended."""
        return self.started_s is not None and self.ended_s is None

    @property
    def hindrance(self) -> str:
        """Reason why the robot must not move, in words; empty if it may."""
        if self.emergency:
            return f"the emergency stop is pressed ({', '.join(self.emergency)}): release it first"
        return "; ".join(alarm.reason for alarm in self.alarms if alarm.response.stops)

    @property
    def start_hindrance(self) -> str:
        """Reason why no mission may start, in words; empty if one may."""
        home = (alarm.reason for alarm in self.alarms if alarm.response is Response.RETURN)
        return "; ".join(filter(None, (self.hindrance, *home)))


if TYPE_CHECKING:
    from dataclasses import replace as replace
else:

    def replace(state, **changes):
        """A state or a part of one with some of its fields changed.

        As :func:`dataclasses.replace` and ten times as fast: a mission changes its state thousands of times. For
        dataclasses without slots, checks or cached properties of their own.

        :raises TypeError: for an unknown field
        """
        values = state.__dict__ | changes
        if len(values) != len(state.__dict__):
            raise TypeError(f"{type(state).__name__} has no {', '.join(changes.keys() - state.__dict__.keys())}")
        new = object.__new__(type(state))
        object.__setattr__(new, "__dict__", values)
        return new


def mission_status(rules: MissionRules, state: MissionState) -> MissionStatus:
    """The status that belongs to a state."""
    now_s = state.now_s if state.now_s is not None else math.nan
    counting = state.counting
    progress = 0.0
    if counting is not None:
        progress = 1.0 if counting.met is not None else dwell_rule(rules, state).progress(*counting.judged)
    used_s = state.time_used_s
    left_s = max(0.0, rules.budget_s - used_s)
    returning = state.goal if state.phase is Phase.RETURNING else None
    stop = state.target.stop if state.target else None
    end_s = returning.deadline_s if returning else now_s + left_s
    requests = state.goal.requests if state.goal else 0
    return MissionStatus(
        now_s=now_s,
        phase=state.phase,
        reason=state.reason,
        target=returning.stop if returning else stop,
        planned_dwell_s=_planned_dwell_s(rules, state) if state.target else 0.0,
        dwell_s=counting.dwell_s(now_s) if counting else 0.0,
        progress=progress,
        time_used_s=used_s,
        time_left_s=left_s,
        distance_m=state.distance_m,
        samples=state.samples,
        counting_s=state.all_counting_s,
        raw_counts=counting.raw_counts if counting else 0,
        failures=state.failures,
        blacklisted=blacklisted(state),
        estimated_end_s=end_s if state.under_way else None,
        needs_operator=(state.phase is Phase.PAUSED and state.needs_operator) or requests > 1,
        silent=counting is not None and counting.silent,
        ended=state.ended,
        alarms=state.alarms,
        emergency=bool(state.emergency),
        stop_requests=requests,
        queue=tuple(queued.stop.name for queued in state.queue),
        changes=state.changes or Changes(),
        clock_offset_s=state.stamp_offset_s,
        ruled_out=state.ruled_out,
        forecast=state.forecast,
        place=state.position,
        yields=state.phase is Phase.PAUSED and any(alarm.cause == OTHER_ROBOT for alarm in state.alarms),
        certificate=state.certificate,
    )


def _planned_dwell_s(rules: MissionRules, state: MissionState) -> float:
    """Expected dwell at the target, with what is counted there already [s]."""
    counting = state.counting
    if counting is not None and counting.to_the_end and state.now_s is not None:
        return counting.dwell_s(state.now_s) + max(0.0, rules.budget_s - state.time_used_s)
    earlier_s = counting.earlier_s if counting is not None else 0.0
    return max(earlier_s + dwell_rule(rules, state).expected_s(raw_rate(state)), rules.min_dwell_s)


@lru_cache(maxsize=4)
def changed_rules(rules: MissionRules, changes: Changes | None) -> MissionRules:
    """The rules with the settings that an operator has changed.

    :raises InputError: if the dwell rule is not one
    :raises ValueError: if a value is out of its range
    """
    if changes is None:
        return rules
    new: dict[str, Any] = {
        name: value
        for name in ("budget_s", "home", "warm_up_stops", "until_sd", "until_gain")
        if (value := getattr(changes, name)) is not None
    }
    if changes.until_sd is not None:
        new["until"] = None
    if changes.home is not None and rules.home is not None and changes.home.name == rules.home.name:
        new["home"] = rules.home  # on a new map the stop has another place
    if changes.dwell is not None:
        new["dwell"] = parse_dwell(changes.dwell, rules.dwell.longest_s)
    return dataclasses.replace(rules, **new)


def dwell_rule(rules: MissionRules, state: MissionState) -> DwellRule:
    """The dwell rule at the target: its own, else the mission's."""
    own = state.target.dwell if state.target is not None else None
    return own or rules.dwell


def shown(state: MissionState) -> tuple[object, ...]:
    """Part of a mission's state whose changes are published as a new status."""
    counted = state.counting and state.counting.records
    guarded = state.alarms, state.emergency, state.queue, state.ruled_out, state.changes, state.stamp_offset_s
    return state.phase, state.reason, state.target, state.samples, counted, state.forecast, *guarded


def blacklisted(state: MissionState) -> tuple[str, ...]:
    """Names of the stops that are ruled out now."""
    if not state.blacklist:
        return ()
    return tuple(out.name for out in state.blacklist if state.now_s is None or state.now_s < out.until_s)


def raw_rate(state: MissionState) -> float:
    """Raw rate at this stop, or of the mission before anything is counted here [counts/s]; NaN if unknown."""
    for gathered in (state.counting, state):
        if gathered is not None and gathered.exposure_s > 0:
            # No count at all is a measurement, too: of a low rate, as in the dwell rules.
            return max(gathered.raw_counts, 0.5) / gathered.exposure_s
    return math.nan


# State, events and visits as dictionaries of numbers, texts and lists, fit for strict JSON ----------------------


def state_from_json(text: str) -> MissionState:
    """The state that a snapshot of a mission holds.

    :raises InputError: if the text is not a snapshot
    """
    try:
        content = read_json(text)
    except ValueError as error:
        raise InputError(f"the mission's state is not valid JSON: {error}", "start without it") from None
    state: MissionState = _read(MissionState, content, "a mission state")
    return state


def event_to_dict(event: Event) -> dict[str, Any]:
    """An event as plain data, fit for JSON; ``event`` holds its kind."""
    return {"event": type(event).__name__, **to_dict(event)}


def event_from_dict(content: dict[str, Any]) -> Event:
    """The event that :func:`event_to_dict` wrote.

    :raises InputError: if it is not one
    """
    name = content.get("event")
    if not isinstance(name, str) or name not in _EVENTS:
        raise InputError(f"{name!r} is not a mission event", f"known are {', '.join(_EVENTS)}")
    values = {key: value for key, value in content.items() if key != "event"}
    event: Event = _read(_EVENTS[name], values, f"a mission event {name!r}")
    return event


_EVENTS: dict[str, Any] = {kind.__name__: kind for kind in get_args(Event)}
_adapter = cache(TypeAdapter)


def to_dict(value: MissionState | Visit | Event) -> dict[str, Any]:
    """A state, a visit or an event as plain data, fit for JSON."""
    kind: Any = type(value)
    content = nan_as_text(_adapter(kind).dump_python(value, mode="json"))
    assert isinstance(content, dict)
    return content


def _read(kind: Any, content: object, what: str) -> Any:
    remedy = "it was written by another version or has been changed: start without it"
    unknown = set(content) - {field.name for field in fields(kind)} if isinstance(content, dict) else set()
    if unknown:
        raise InputError(f"this is not {what}: unknown {', '.join(sorted(map(str, unknown)))}", remedy)
    try:
        return _adapter(kind).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"this is not {what}: {where or 'its type'}: {first['msg']}", remedy) from None
