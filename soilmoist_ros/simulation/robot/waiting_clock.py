"""Simulated time waits for the planners, so that a slow computer sees the same mission as a fast one."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.foundation.health import Health, Level

ARRIVAL_EPOCHS = 2
"""Epochs of the receiver after the end of a goal that the planner may need to check its place."""


class Awaited(StrEnum):
    """What simulated time waits for."""

    PLAN = "the next plan"
    """The planner chooses a stop, with a map of all its records."""
    RECORD = "the last record"
    """The planner counts, and has not received the last record of the logger yet."""
    ARRIVAL = "the reaction to the end of a goal"
    """A goal has ended, and the mission has not reacted."""
    DEPARTURE = "the next goal"
    """The mission travels, and the navigation has no goal yet."""
    SAVE = "the end of the planner"
    """The mission has ended, and the map is being saved."""


LIMITS_S: Mapping[Awaited, float] = MappingProxyType(
    {Awaited.PLAN: 120.0, Awaited.RECORD: 30.0, Awaited.ARRIVAL: 30.0, Awaited.DEPARTURE: 5.0, Awaited.SAVE: 40.0}
)
"""Longest waits [s of the wall clock]."""
SHORT_S = 0.5
"""Longest wait for what did not come in time before [s of the wall clock]."""
NOTED_S = 5.0
"""Waits from this length on are worth a message [s of the wall clock]."""


CLOCK_PART = "clock"
"""Name of the clock in diagnostics."""
WAITS_FOR = "waits_for"
"""Value of the clock in diagnostics: what it waits for, if that has lasted long."""


@dataclass(frozen=True)
class RobotProgress:
    """How far robot and planner are. All times count from the start of the simulation.

    :param phase: phase of the mission; ``None`` without a planner
    :param sent_s: end of the last record that the logger sent whole to a client [s]; -inf for none
    :param handled_s: end of the last record that the planner has received [s]; NaN or -inf if unknown
    :param goal_ended_s: end of a goal to which the mission has not reacted [s]; NaN for none
    :param waits_for_goal: whether the robot stands away from the mission's target, without a goal
    """

    phase: Phase | None = None
    sent_s: float = -math.inf
    handled_s: float = math.nan
    goal_ended_s: float = math.nan
    waits_for_goal: bool = False


def awaited(progress: RobotProgress, now_s: float, epoch_s: float) -> Awaited | None:
    """What simulated time waits for at a robot, ``None`` for nothing.

    A mission that is paused or has not started, and a robot on its way do not stop the time.

    :param progress: how far robot and planner are
    :param now_s: simulated time [s]
    :param epoch_s: time between epochs of the receiver [s]
    """
    match progress.phase:
        case Phase.PLANNING:
            return Awaited.PLAN
        case Phase.FINISHED:
            return Awaited.SAVE
        case Phase.COUNTING if 1e-3 < progress.sent_s - progress.handled_s < math.inf:
            return Awaited.RECORD
        case Phase.TRAVELLING | Phase.RETURNING:
            if now_s >= progress.goal_ended_s + ARRIVAL_EPOCHS * epoch_s:
                return Awaited.ARRIVAL
            if progress.waits_for_goal and math.isnan(progress.goal_ended_s):
                return Awaited.DEPARTURE
    return None


class WaitingClock:
    """Decides whether simulated time stands still, and never waits forever.

    A wait ends at its limit, see :data:`LIMITS_S`. What did not come in time is waited for only briefly
    (:data:`SHORT_S`) until it comes in time again.
    """

    def __init__(self) -> None:
        self.waited_s = 0.0
        """Wall-clock time for which simulated time stood still [s]."""
        self._since: dict[tuple[str, Awaited], float] = {}
        self._late: set[tuple[str, Awaited]] = set()
        self._excused: set[tuple[str, Awaited]] = set()
        self._wall_s = math.nan
        self._stood = False

    def stands(self, wall_s: float, waits: Collection[tuple[str, Awaited]]) -> bool:
        """Whether time stands still now.

        :param wall_s: wall-clock time [s]
        :param waits: names of robots, and what is awaited of each
        """
        if self._stood:
            self.waited_s += wall_s - self._wall_s
        for key in self._since.keys() - set(waits):  # it has come
            del self._since[key]
            if key in self._excused:
                self._excused.discard(key)
            else:
                self._late.discard(key)
        for key in waits:
            since_s = self._since.setdefault(key, wall_s)
            if wall_s - since_s >= (SHORT_S if key in self._late else LIMITS_S[key[1]]):
                self._late.add(key)
                self._excused.add(key)
        self._wall_s, self._stood = wall_s, any(key not in self._excused for key in waits)
        return self._stood

    @property
    def health(self) -> Health:
        """State for diagnostics."""
        wait = self.long_wait
        waits_for = "" if wait is None else f"{wait[1]} of {wait[0]}"
        values = {WAITS_FOR: waits_for, "waited_s": f"{self.waited_s:.1f}"}
        if wait is None:
            return Health(CLOCK_PART, Level.OK, "runs", values)
        return Health(CLOCK_PART, Level.WARN, f"simulated time waits for {waits_for}", values)

    @property
    def long_wait(self) -> tuple[str, Awaited] | None:
        """The robot, and what is awaited of it, if that has lasted long already; ``None`` if not."""
        keys = [key for key, since_s in self._since.items() if self._wall_s - since_s >= NOTED_S]
        return min(keys, key=lambda key: self._since[key], default=None)
