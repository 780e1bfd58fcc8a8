"""Rules, events, actions and status of a mission, all of them frozen data.

All times ``now_s`` come from the clock that stamps the records (ROS time, or the simulator's clock).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.planning.dwell import DwellRule
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.sensing.records import CountRecord

Polygon = tuple[tuple[float, float], ...]
Polygons = tuple[Polygon, ...]
"""Corners of areas: metres east and north of the field's datum."""


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
        """Whether the robot must not move while the cause lasts."""
        return self in (Response.PAUSE, Response.HOLD, Response.ABORT)


class PlanKind(StrEnum):
    """Kind of stop that a plan request asks for."""

    WARM_UP = "warm_up"
    EXPLORE = "explore"


class MissionEnd(StrEnum):
    """Why a mission ended."""

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
    :param min_dwell_s: minimum useful dwell; stops that leave less are skipped [s]
    :param speed_mps: speed, to estimate travel [m/s]
    :param stop_overhead_s: time of each trip that is not driving [s]
    :param detour: driven distance over straight distance, where the planner gives no travel time [-]
    :param arrival_radius_m: the robot is at a stop within this distance; keep it above the positions' noise [m]
    :param goal_time_factor: maximum trip time as a multiple of the expected time ... [-]
    :param goal_time_margin_s: ... plus this [s]
    :param return_margin_s: reserve kept for the way home [s]
    :param cancel_limit_s: time after which a goal is cancelled again, while the robot is not known to stand [s]
    :param standstill_s: a stop is confirmed when the robot has not moved for this time [s]; 0: it is confirmed by
        the end of the goal, and a goal whose end is not reported counts as ended
    :param backoff_s: wait after the first failure; it doubles with each failure in a row [s]
    :param backoff_limit_s: longest wait after a failure [s]
    :param plan_limit_s: a plan request that is not answered in this time has failed [s]
    :param retries: how often a goal that failed is sent again before its stop is ruled out
    :param blacklist_s: how long a stop is ruled out after it failed or was skipped [s]
    :param failures_to_pause: failures without a visit in between after which the operator is asked
    :param silence_limit_s: time without a record of the stop, while counting, that counts as silence [s]
    :param on_silence: what to do on silence; ``wait`` ends with the dwell rule's longest time
    :param odometer_step_m: moves shorter than this count as noise of the position [m]
    :raises ValueError: if a value is out of its range
    """

    budget_s: float
    dwell: DwellRule
    home: Stop | None = None
    warm_up_stops: int = 3
    min_dwell_s: float = 60.0
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

    def travel_s(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        """Estimated time of a trip [s]."""
        return self.stop_overhead_s + self.detour * math.dist(start, end) / self.speed_mps

    def way_home_s(self, start: tuple[float, float]) -> float:
        """Time to keep for the way home [s]; 0 without a home, or at home."""
        if self.home is None or self.is_at(start, self.home):
            return 0.0
        return self.travel_s(start, (self.home.x_m, self.home.y_m)) + self.return_margin_s

    def is_at(self, place: tuple[float, float], stop: Stop) -> bool:
        """Whether a place is within the arrival radius of a stop."""
        return math.dist(place, (stop.x_m, stop.y_m)) <= self.arrival_radius_m


@dataclass(frozen=True, slots=True)
class Changes:
    """Settings that an operator changes in mid-mission; ``None`` leaves a setting as it is.

    :param budget_s: time of the mission from its start [s]
    :param dwell: dwell rule, as text
    :param strategy: how stops are chosen
    :param target: which map is to be good, ``rate`` or ``vwc``
    :param home: where to go at the end
    :param warm_up_stops: number of stops before the map guides the choice; follows from the strategy
    """

    budget_s: float | None = None
    dwell: str | None = None
    strategy: str | None = None
    target: str | None = None
    home: Stop | None = None
    warm_up_stops: int | None = None


# Events ------------------------------------------------------------------------------------------------------


RESTART = "a restart of the planner"
"""Who pauses a mission that a planner finds under way when it starts."""


@dataclass(frozen=True, slots=True)
class Command:
    """The operator asks for something; the mission answers with one :class:`Answer`.

    :param now_s: time [s]
    :param verb: what
    :param cause: why a stop is skipped, for its sample and the status; empty: by the operator
    :param who: who asks; empty: the operator
    :param stop: where to measure (``MEASURE``); it joins the queue
    :param dwell_s: for how long [s]; ``None``: as the dwell rule says
    :param polygon: corners of an area in which no stop may be chosen (``RULE_OUT``) [m]
    :param stops: names of the queued stops in their new order; the others are dropped (``ORDER``)
    :param changes: new settings (``CHANGE``)
    """

    now_s: float
    verb: Verb
    cause: str = ""
    who: str = ""
    stop: Stop | None = None
    dwell_s: float | None = None
    polygon: Polygon = ()
    stops: tuple[str, ...] = ()
    changes: Changes | None = None

    @property
    def by(self) -> str:
        """Who asks, for texts."""
        return self.who or "the operator"


@dataclass(frozen=True, slots=True)
class Planned:
    """The planner answers a :class:`RequestPlan`.

    :param now_s: time [s]
    :param plan_id: id of the request
    :param choice: next stop, ``None`` if no stop is useful and reachable
    :param travel_s: expected travel time to it [s]; estimated from the straight distance if ``None``
    :param reason: why there is no choice
    """

    now_s: float
    plan_id: int
    choice: Choice | None
    travel_s: float | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class PlanFailed:
    """The planner failed. The mission retries, and finally asks the operator."""

    now_s: float
    plan_id: int
    reason: str


@dataclass(frozen=True, slots=True)
class GoalReached:
    """The navigation reports success; the mission still checks the distance to the stop [m]."""

    now_s: float
    goal_id: int
    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class GoalFailed:
    """A goal has ended in any other way: aborted, rejected, or cancelled as asked.

    :param now_s: time [s]
    :param goal_id: id of the goal
    :param reason: why
    :param refused: the fence refused the goal, and it was never sent; its stop is ruled out without a retry
    """

    now_s: float
    goal_id: int
    reason: str
    refused: bool = False


@dataclass(frozen=True, slots=True)
class RecordArrived:
    """The sensor delivered a record."""

    now_s: float
    record: CountRecord


@dataclass(frozen=True, slots=True)
class Moved:
    """The robot is at this place [m]."""

    now_s: float
    x_m: float
    y_m: float


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
class AlarmOver:
    """A danger is over."""

    now_s: float
    cause: str


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Somebody has pressed or released an emergency stop; releasing it moves nothing.

    :param now_s: time [s]
    :param active: whether it is pressed
    :param source: which one
    """

    now_s: float
    active: bool
    source: str = ""


@dataclass(frozen=True, slots=True)
class ClockStarted:
    """Mission time follows a steady clock.

    :param now_s: time [s]
    :param boot: names the start of the computer from which steady time counts
    :param offset_s: mission time minus steady time [s]
    """

    now_s: float
    boot: str
    offset_s: float


@dataclass(frozen=True, slots=True)
class ClockStepped:
    """The clock that stamps the records was set, forward (positive) or back [s]. Mission time goes on evenly."""

    now_s: float
    step_s: float


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed. Needed at :attr:`Mission.next_deadline_s`, harmless at any other time."""

    now_s: float


Event = (
    Command
    | Planned
    | PlanFailed
    | GoalReached
    | GoalFailed
    | RecordArrived
    | Moved
    | Alarm
    | AlarmOver
    | EmergencyStop
    | ClockStarted
    | ClockStepped
    | Tick
)


# Actions -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a :class:`Command`: whether it is accepted, and what happens or why not."""

    verb: Verb
    accepted: bool
    message: str


@dataclass(frozen=True, slots=True)
class RequestPlan:
    """Choose the next stop and send :class:`Planned` or :class:`PlanFailed` with this id.

    :param plan_id: id of the request
    :param kind: a warm-up stop, or one that the map guides
    :param blacklisted: names of stops that must not be chosen now
    :param time_left_s: time left minus the way home *from here* [s]; for strategies
    :param ruled_out: polygons in which no stop must be chosen, corners [m]
    :param budget_left_s: time until the robot must be home [s]. A stop fits if the travel to it, the shortest
        useful dwell and the way home *from there* fit in; offer only such stops, since the mission ends
        when the choice does not fit.
    """

    plan_id: int
    kind: PlanKind
    blacklisted: tuple[str, ...]
    time_left_s: float
    budget_left_s: float
    ruled_out: Polygons = ()


@dataclass(frozen=True, slots=True)
class GoTo:
    """Send the robot to a stop; answer with :class:`GoalReached` or :class:`GoalFailed` with this id."""

    goal_id: int
    stop: Stop
    reason: str
    expected_s: float


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Stop the robot; answer with :class:`GoalFailed` (or :class:`GoalReached`) when the goal has ended.

    The mission repeats it until the robot is known to stand. In an emergency the goal may have ended already.
    """

    goal_id: int
    reason: str


@dataclass(frozen=True, slots=True)
class StartCounting:
    """From now on records count for this stop; displays show it, and no action is needed."""

    stop: Stop
    dwell: str
    expected_s: float


@dataclass(frozen=True, slots=True)
class StopCounting:
    """Records do not count for a stop any more."""

    reason: str


@dataclass(frozen=True, slots=True)
class VisitDone:
    """A stop is complete: update the map. A new plan request follows at once."""

    visit: Visit


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
    :param needs_operator: whether it is paused and did not pause at the operator's command
    :param silent: whether the sensor is silent while the robot counts
    :param ended: why the mission has ended or is ending; ``None`` before
    :param alarms: dangers that the guard reports now
    :param emergency: whether an emergency stop is pressed
    :param stop_requests: how often the robot was asked to stop and is not yet known to stand still
    :param queue: names of the stops that an operator has asked for
    :param strategy: how stops are chosen, if an operator has changed it
    :param clock_offset_s: how far the clock that stamps the records has been set since the start [s]
    :param ruled_out: areas in which no stop is chosen
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
    clock_offset_s: float = 0.0
    ruled_out: Polygons = ()


@dataclass(frozen=True, slots=True)
class Publish:
    """Publish the status of the mission, because more than the time has changed."""


@dataclass(frozen=True, slots=True)
class Save:
    """Write map and samples to disk."""

    reason: str


@dataclass(frozen=True, slots=True)
class Finish:
    """The mission has ended; nothing is moving any more.

    :param reason: why, for reports
    :param code: reason code
    """

    reason: str
    code: MissionEnd

    @property
    def aborted(self) -> bool:
        """Whether the operator, a silent sensor or the guard ended it."""
        return self.code in (MissionEnd.ABORTED, MissionEnd.SILENT_SENSOR, MissionEnd.FAILSAFE)


Action = (
    Answer | RequestPlan | GoTo | CancelGoal | StartCounting | StopCounting | VisitDone | Publish | Save | Finish
)
