# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time: it follows the wall clock, and waits for the planners. Slow computers see the same mission."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from types import MappingProxyType

from soilmoist_ros.exploration import MAX_POSITIONS, Phase
from soilmoist_ros.foundation import Health, InputError, Level

SHORT_S = 0.5  # longest wait for what did not come in time before [s of the wall clock]
CRAWL_S = 0.1  # least real time until the first epoch after the end of a goal, if the mission does not react [s]
MAX_BEHIND_S = 5.0
"""Simulated time that the positions of a planner may be behind; half the age at which a guard acts [s]."""
MAX_STEP_S = 3.0
"""Longest step of simulated time with planners; this and :data:`MAX_BEHIND_S` stay below that age [s]."""
NOTED_S = 5.0  # waits from this length on are worth a message [s of the wall clock]
CLOCK_PART = "clock"
"""Name of the clock in diagnostics."""
WAITS_FOR = "waits_for"
"""Value of the clock in diagnostics: what it waits for, if that has lasted long."""
_USES_POSITIONS = (Phase.TRAVELLING, Phase.RETURNING, Phase.COUNTING, Phase.CANCELLING, Phase.WAITING)


class SimulatedTime:
    """Computes how far a simulation may advance in a step.

    On a busy machine, simulated time falls behind instead of jumping. The nodes are then as late as the
    simulation, and a jump would make their messages time out.
    """

    def __init__(self, speed: float, longest_step_s: float) -> None:
        self._speed = speed
        self._longest_step_s = longest_step_s
        self._wall_s = math.inf

    def step_s(self, wall_s: float) -> float:
        """Simulated time that may pass between the last call and a wall-clock time [s]; 0 at the first call."""
        passed_s = min(max(wall_s - self._wall_s, 0.0), self._longest_step_s)
        self._wall_s = wall_s
        return passed_s * self._speed


def read_start_time(text: str) -> float:
    """Seconds since 1970 UTC of an ISO 8601 text; UTC unless the text has an offset.

    :raises InputError: if the text is not an ISO 8601 time, or before 1970
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(
            f"the start time {text!r} is no ISO 8601 time", "write it like 2026-06-01T06:00:00Z"
        ) from None
    stamp_s = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    if stamp_s <= 0:
        raise InputError(f"the start time {text!r} is before 1970", "choose a later one")
    return stamp_s


class Awaited(StrEnum):
    """Event that simulated time waits for."""

    PLAN = "the next plan"  # the planner chooses a stop, with a map of all its records
    RECORD = "the last record"  # the planner counts, and has not received the last record of the logger yet
    ARRIVAL = "the reaction to the end of a goal"
    """A goal has ended, and the mission has not reacted. It needs positions, so time crawls."""
    DEPARTURE = "the next goal"  # the mission travels, and the navigation has no goal yet
    POSITION = "positions"
    """The planner has not received the positions of the last seconds, and would take them for stale."""
    SAVE = "the end of the planner"  # the mission has ended, and the map is being saved


LIMITS_S: Mapping[Awaited, float] = MappingProxyType({
    Awaited.PLAN: 120.0, Awaited.RECORD: 30.0, Awaited.ARRIVAL: 30.0,
    Awaited.DEPARTURE: 5.0, Awaited.POSITION: 30.0, Awaited.SAVE: 40.0,
})  # fmt: skip
"""Longest waits [s of the wall clock]."""


@dataclass(frozen=True)
class RobotProgress:
    """Progress of robot and planner. All times count from the start of the simulation; NaN or -inf if unknown."""

    phase: Phase | None = None  # phase of the mission; ``None`` without a planner
    sent_s: float = -math.inf  # end of the last record that the logger sent whole to a client [s]
    handled_s: float = math.nan  # end of the last record that the planner has received [s]
    goal_ended_s: float = math.nan  # end of a goal to which the mission has not reacted [s]
    goal_untrue: bool = False  # whether the navigation reported an arrival without motion
    waits_for_goal: bool = False  # whether the robot stands away from the mission's target, without a goal
    fixed_s: float = -math.inf  # time of the last fix that the receiver sent whole to a client [s]
    placed_s: float = math.nan  # when the planner received its last position [s]


def end_to_react_to(ended_s: float, now_s: float, fixed_s: float, epoch_s: float) -> float:
    """End of a goal to which a mission can react [s]; NaN for none.

    Without positions the planner cannot confirm an arrival, and time must run until the receiver has a fix again.
    """
    return math.nan if now_s - ended_s > 2 * epoch_s and fixed_s <= ended_s else ended_s


def awaited(progress: RobotProgress) -> Awaited | None:
    """Event that simulated time waits for at a robot; ``None`` without one.

    A mission that is paused or has not started, and a robot on its way do not stop the time.
    """
    match progress.phase:
        case Phase.PLANNING:
            return Awaited.PLAN
        case Phase.FINISHED:
            return Awaited.SAVE
        case Phase.COUNTING if 1e-3 < progress.sent_s - progress.handled_s < math.inf:
            return Awaited.RECORD
        case Phase.TRAVELLING | Phase.RETURNING:
            if not math.isnan(progress.goal_ended_s):
                return Awaited.ARRIVAL
            if progress.waits_for_goal:
                return Awaited.DEPARTURE
    is_behind = MAX_BEHIND_S <= progress.fixed_s - progress.placed_s < math.inf
    return Awaited.POSITION if is_behind and progress.phase in _USES_POSITIONS else None


class WaitingClock:
    """Decides how far simulated time may run, and never waits forever.

    A wait ends at its limit, see :data:`LIMITS_S`. What did not come in time is waited for only briefly
    (:data:`SHORT_S`) until it comes in time again.

    :param epoch_s: time between epochs of the receivers [s]
    :param limit_s: a wait ends after this time at the latest [s of the wall clock]; a message that a simulated
        fault has swallowed never comes
    """

    def __init__(self, epoch_s: float, limit_s: float = math.inf) -> None:
        self._epoch_s = epoch_s
        self._limit_s = limit_s
        self.waited_s = 0.0  # wall-clock time for which simulated time waited [s]
        self._answer_s = 0.0  # time that planners take to receive a record
        self._since: dict[tuple[str, Awaited], float] = {}
        self._late: set[tuple[str, Awaited]] = set()
        self._excused: set[tuple[str, Awaited]] = set()
        self._wall_s = math.nan
        self._waits = False

    def may_run_to(self, wall_s: float, robots: Mapping[str, RobotProgress]) -> float:
        """Simulated time that may be reached now [s]; inf if nothing is awaited, -inf if time stands still."""
        if self._waits:
            self.waited_s += wall_s - self._wall_s
        waits = {(name, found): its for name, its in robots.items() if (found := awaited(its)) is not None}
        for key in self._since.keys() - waits.keys():  # it has come
            lasted_s = wall_s - self._since.pop(key)
            if key[1] is Awaited.RECORD:
                self._answer_s = max(0.8 * self._answer_s, min(lasted_s, 1.0))
            if key in self._excused:
                self._excused.discard(key)
            else:
                self._late.discard(key)
        for key in waits:
            since_s = self._since.setdefault(key, wall_s)
            limit_s = SHORT_S if key in self._late else min(LIMITS_S[key[1]], self._limit_s)
            if wall_s - since_s >= limit_s:
                self._late.add(key)
                self._excused.add(key)
        open_waits = waits.keys() - self._excused
        self._wall_s, self._waits = wall_s, bool(open_waits)
        return min((self._end_s(key, waits[key]) for key in open_waits), default=math.inf)

    def _end_s(self, key: tuple[str, Awaited], progress: RobotProgress) -> float:
        """Simulated time that may be reached in spite of a wait [s]."""
        if key[1] is not Awaited.ARRIVAL:
            return -math.inf
        # The planner checks the place by a position after the result, so the next position comes when the result
        # should be there. If it is late, more positions come, and the time between two doubles: a result is never
        # without one for long, and a long wait takes little simulated time.
        # The client doubts an arrival after this number of positions that do not agree. They come at once: if time
        # crawled, the client's limit on the computer's clock would come first, after 30 s.
        untrue = MAX_POSITIONS if progress.goal_untrue else 0
        epochs = untrue + math.log2(1 + (self._wall_s - self._since[key]) / max(CRAWL_S, 2 * self._answer_s))
        return progress.goal_ended_s + epochs * self._epoch_s

    @property
    def health(self) -> Health:
        """State for diagnostics."""
        wait = self.long_wait
        waits_for = "" if wait is None else f"{wait[1]} of {wait[0]}"
        values = {WAITS_FOR: waits_for, "waited_s": f"{self.waited_s:.1f}"}
        text = f"simulated time waits for {waits_for}" if waits_for else "runs"
        return Health(CLOCK_PART, Level.WARN if waits_for else Level.OK, text, values)

    @property
    def long_wait(self) -> tuple[str, Awaited] | None:
        """The robot, and what is awaited of it, if that has lasted long already; ``None`` if not."""
        keys = [key for key, since_s in self._since.items() if self._wall_s - since_s >= NOTED_S]
        return min(keys, key=lambda key: self._since[key], default=None)
