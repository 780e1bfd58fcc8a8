# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Actions that a mission asks for, all of them frozen data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from soilmoist_ros.exploration.mission.types import MissionEnd, PlanKind, Polygons, Verb
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.travel.stop import Stop

ANYBODYS: Final = 0
"""Instead of the id of a goal: whatever drives the robot, though this mission has sent nothing."""
FORGOTTEN: Final = -1
"""Instead of the id of a goal: that of a mission before, which is forgotten. Ids of goals begin at 1."""


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
    :param staying: name of the stop where the robot stands with its visit open: to choose it again means to count
        on there, without a trip; empty if the visit is closed
    :param time_used_s: time since the start of the mission [s]
    """

    plan_id: int
    kind: PlanKind
    blacklisted: tuple[str, ...]
    time_left_s: float
    budget_left_s: float
    ruled_out: Polygons = ()
    staying: str = ""
    time_used_s: float = 0.0


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

    The mission repeats it until the robot is known to stand.

    :param goal_id: the goal; :data:`ANYBODYS` for an emergency stop, or an abort without a mission
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
