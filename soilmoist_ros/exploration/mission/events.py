# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Events that a mission takes and actions that it asks for, all of them frozen data.

All times ``now_s`` come from the mission's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from soilmoist_ros.exploration.mission.types import Alarm, Changes, MissionEnd, PlanKind, Polygon, Polygons, Verb
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.sensing import CountRecord

RESTART = "a restart of the planner"  # who pauses a mission that a planner finds under way when it starts
STILL_M = 0.1
"""Shortest distance that counts as motion [m]: without an estimate of the noise, a robot within it stands."""


@dataclass(frozen=True, slots=True)
class Command:
    """The operator asks for something; the mission answers with one :class:`Answer`."""

    now_s: float
    verb: Verb
    cause: str = ""  # why a stop is skipped, for its sample and the status; empty: by the operator
    who: str = ""  # name of the client; empty: the operator
    stop: Stop | None = None  # stop to measure at (``MEASURE``); it joins the queue
    dwell_s: float | None = None  # for how long [s]; ``None``: as the dwell rule says
    polygon: Polygon = ()  # corners of an area without stops (``RULE_OUT``), or with stops again (``LIFT``) [m]
    stops: tuple[str, ...] = ()  # names of the queued stops in their new order; the others are dropped (``ORDER``)
    changes: Changes | None = None  # new settings (``CHANGE``)

    @property
    def by(self) -> str:
        """Name of the client of a command, for texts."""
        return self.who or "the operator"


@dataclass(frozen=True, slots=True)
class Planned:
    """The planner answers a :class:`RequestPlan`."""

    now_s: float
    plan_id: int
    choice: Choice | None  # next stop, ``None`` if no stop is useful and reachable
    travel_s: float | None = None  # expected travel time to it [s]; ``None``: by the straight distance
    reason: str = ""  # why there is no choice
    forecast: Forecast | None = None  # a new one of the map, ``None`` if the last one is recent
    home_s: float = 0.0  # travel time home from the choice, or from where the robot stays [s]; 0 if not known
    certificate: str = ""  # sealed sample that was drawn with this plan, see :class:`SealedSample`
    to_certify: int = 0  # number of its stops that are left: the mission does not end early before them


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
    """A goal has ended in any other way: aborted, rejected, or cancelled as asked."""

    now_s: float
    goal_id: int
    reason: str
    refused: bool = False  # the fence refused it, and it was never sent; its stop is ruled out without a retry
    superseded: bool = False  # another client's goal has replaced it: no failure, and people decide what follows
    stopped: bool = False  # somebody else has cancelled it: the same, once the robot stands


@dataclass(frozen=True, slots=True)
class RecordArrived:
    """The sensor delivered a record."""

    now_s: float
    record: CountRecord


@dataclass(frozen=True, slots=True)
class Moved:
    """The robot is at a place.

    :param still_s: for how long it stands, by the noise of its places [s]; 0 if it moves. ``None``, as in journals
        of before: it stands while it stays within :data:`STILL_M`
    :param driven_m: distance driven since the event before [m], without noise; ``None``: by the places
    """

    now_s: float
    x_m: float
    y_m: float
    still_s: float | None = None
    unseen_mps: float = 0.0  # a slower motion would not show in the noise [m/s]; 0 if it is negligible
    sd_m: float = 0.0  # standard deviation of each coordinate [m], 0 if unknown
    driven_m: float | None = None


@dataclass(frozen=True, slots=True)
class AlarmOver:
    """A danger is over."""

    now_s: float
    cause: str


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Somebody has pressed or released an emergency stop; releasing it moves nothing."""

    now_s: float
    active: bool  # whether it is pressed
    source: str = ""  # which one


@dataclass(frozen=True, slots=True)
class ClockStarted:
    """Mission time follows a steady clock."""

    now_s: float
    boot: str  # names the start of the computer from which steady time counts
    offset_s: float  # mission time minus steady time [s]


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


# Actions --------------------------------------------------------------------------------------------------------

ANYBODYS: Final = 0  # instead of the id of a goal: whatever drives the robot, though this mission has sent nothing
FORGOTTEN: Final = -1
"""Instead of the id of a goal: that of a mission before, which is forgotten. Ids of goals begin at 1."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a :class:`Command`: whether it is accepted, and what happens or why not."""

    accepted: bool
    message: str


@dataclass(frozen=True, slots=True)
class RequestPlan:
    """Choose the next stop and send :class:`Planned` or :class:`PlanFailed` with this id.

    :param budget_left_s: time until the robot must be home [s]. A stop fits if the travel to it, the shortest
        useful dwell and the way home *from there* fit in; offer only such stops, since the mission ends
        when the choice does not fit.
    :param staying: name of the stop where the robot stands with its visit open: to choose it again means to count
        on there, without a trip; empty if the visit is closed
    """

    plan_id: int
    kind: PlanKind  # a warm-up stop, or one that the map guides
    blacklisted: tuple[str, ...]  # names of stops that must not be chosen now
    time_left_s: float  # time left minus the way home *from here* [s]; for strategies
    budget_left_s: float
    ruled_out: Polygons = ()  # polygons in which no stop must be chosen, corners [m]
    staying: str = ""
    time_used_s: float = 0.0  # time since the start of the mission [s]
    certificate: str = ""  # sealed sample of the mission; empty before the first plan
    certified: tuple[Visit, ...] = ()  # visits at stops of the sealed sample
    certify_now: bool = False  # whether the mission may end once the sealed sample is complete


@dataclass(frozen=True, slots=True)
class GoTo:
    """Send the robot to a stop; answer with :class:`GoalReached` or :class:`GoalFailed` with this id."""

    goal_id: int
    stop: Stop
    reason: str


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Stop the robot; answer with :class:`GoalFailed` (or :class:`GoalReached`) when the goal has ended.

    The mission repeats it until the robot is known to stand.
    """

    goal_id: int  # the goal; ANYBODYS for an emergency stop, or an abort without a mission


@dataclass(frozen=True, slots=True)
class StartCounting:
    """The robot has arrived: from now on records count for its stop."""


@dataclass(frozen=True, slots=True)
class VisitDone:
    """A stop is complete: update the map. A new plan request follows at once."""

    visit: Visit


@dataclass(frozen=True, slots=True)
class Publish:
    """Publish the status of the mission, because more than the time has changed."""


@dataclass(frozen=True, slots=True)
class Finish:
    """The mission has ended, and nothing is moving any more: write map and samples to disk."""

    reason: str
    code: MissionEnd  # reason code


Action = Answer | RequestPlan | GoTo | CancelGoal | StartCounting | VisitDone | Publish | Finish
