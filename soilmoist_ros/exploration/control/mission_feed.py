# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Feeds a mission with what happens, from any thread, one event at a time; and keeps its time."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import RLock

from soilmoist_ros.exploration.guard.motion import Standing
from soilmoist_ros.exploration.guard.watch import Watch
from soilmoist_ros.exploration.mission.events import (
    Action,
    Answer,
    ClockStarted,
    ClockStepped,
    Command,
    Event,
    GoalFailed,
    GoalReached,
    Moved,
    Publish,
    RecordArrived,
)
from soilmoist_ros.exploration.mission.journal import MissionJournal
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import MissionState
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.navigation.pose_client import MAX_AGE_S
from soilmoist_ros.sensing import CountRecord, PlaceAges, PlaceFix

FIX_SILENCE_S = 5.0  # without a fix for this time the positions of records serve, which are older [s]

_log = logging.getLogger(__name__)


class MissionFeed:
    """Passes events into a mission, one after the other.

    Events that actions set off in turn (a goal that fails at once) wait until all actions of the event before
    have been carried out.

    :param carry_out: carries out an action; :class:`Answer` is left out, :meth:`command` gives it
    :param journal: has each event before it is acted on, and is on the disk before actions are carried out, other
        than publishing, and at the end
    :param watch: decides on measured places, and whether the robot stands
    """

    def __init__(
        self, mission: Mission, carry_out: Callable[[Action], None], journal: MissionJournal, watch: Watch
    ) -> None:
        self.mission = mission
        self._watch, self._journal = watch, journal
        self.place: tuple[float, float] | None = None
        self.place_s = -math.inf
        self.place_age_s = math.inf  # age of the last place when it came [s]
        self.records_without_place = 0
        self.record_s = -math.inf
        self._fix_s = -math.inf
        self._fix_ages, self._record_ages = PlaceAges(), PlaceAges()
        self._carry_out = carry_out
        self._gathering = False
        self._publish: Publish | None = None
        self._events: deque[Event] = deque()
        self._answers: list[Answer] = []
        self._lock = RLock()
        self._busy = False
        self.closed = False

    def close(self) -> None:
        """Take in no further event: the process ends, and the mission stays as it is."""
        with self._lock:
            self.closed = True

    def give(self, event: Event) -> None:
        """Let the mission take in an event."""
        with self._lock:
            if self.closed:
                return
            self._events.append(event)
            if self._busy:
                return
            self._busy = True
            try:
                while self._events:
                    self._take(self._events.popleft())
            finally:
                self._busy = False
            if not self._gathering:
                self._journal.secure()

    def command(self, command: Command) -> Answer:
        """Ask the mission for something."""
        with self._lock:
            if self.closed:
                return Answer(False, "the planner ends")
            self._answers.clear()
            self.give(command)
            return self._answers[0]

    def fix(self, fix: PlaceFix) -> bool:
        """The robot may be here; whether that is its place now."""
        if math.isfinite(fix.x_m + fix.y_m):  # records have the places of the receiver that is not believed now
            self._fix_s = fix.now_s
        return self._moved(fix, self._fix_ages)

    def records(self, now_s: float, records: Sequence[CountRecord], more: bool = False) -> None:
        """Records have come; one without a position is only counted.

        The status is published once for all of them, and the disk synced once.

        :param more: whether further records of the same message follow
        """
        with self._lock:
            self._gathering = True
            try:
                for record in records:
                    self._record(now_s, record)
            finally:
                self._gathering = False
            if self._publish is not None:
                publish, self._publish = self._publish, None
                self._try(publish)
            if not more:
                self._journal.secure()

    def _record(self, now_s: float, record: CountRecord) -> None:
        self.record_s = now_s
        if not (math.isfinite(record.x_m) and math.isfinite(record.y_m)):
            self.records_without_place += 1
            return
        if now_s - self._fix_s > FIX_SILENCE_S:
            middle_s = record.stamp_s - record.exposure_s / 2
            self._moved(PlaceFix(now_s, record.x_m, record.y_m, stamp_s=middle_s), self._record_ages)
        self.give(RecordArrived(now_s, record))

    def ended(self, now_s: float, ended: Ended) -> None:
        """A goal has ended."""
        if ended.outcome is Outcome.SUCCEEDED and self.place is not None:
            self.give(GoalReached(now_s, ended.goal_id, *self.place))
        else:
            superseded, stopped = ended.outcome is Outcome.SUPERSEDED, ended.outcome is Outcome.STOPPED
            failed = GoalFailed(now_s, ended.goal_id, ended.reason, superseded=superseded, stopped=stopped)
            self.give(failed)

    def _moved(self, fix: PlaceFix, ages: PlaceAges) -> bool:
        age_s = ages.age_s(fix.now_s, fix.stamp_s)
        fix, watch = replace(fix, age_s=age_s), self._watch
        place = watch.fix(fix)
        if place is None:
            return False
        self.place, self.place_s, self.place_age_s = place, fix.now_s, age_s
        known_m = watch.places.sd_m(fix.sd_m)
        sd_m = known_m if math.isfinite(known_m) else 0.0
        standing = Standing(0.0)  # a late place shows where the robot was
        if age_s <= MAX_AGE_S:
            standing = watch.motion.standing(self.mission.rules.standstill_s)
        self.give(Moved(fix.now_s, *place, standing.for_s, standing.unseen_mps, sd_m, watch.motion.driven_m()))
        return True

    def _take(self, event: Event) -> None:
        if isinstance(event, ClockStepped):
            self._fix_ages.clear()
            self._record_ages.clear()
        self._journal.note(self.mission, event)
        actions = self.mission.step(event)
        if not all(isinstance(action, Answer | Publish) for action in actions):
            self._journal.secure()
        for action in actions:
            if isinstance(action, Answer):
                self._answers.append(action)
            elif isinstance(action, Publish) and self._gathering:
                self._publish = action
            else:
                self._try(action)

    def _try(self, action: Action) -> None:
        try:
            self._carry_out(action)
        except Exception:  # the others are carried out all the same; the mission's time limits do the rest
            _log.exception("an action of the mission failed: %s", action)


# Mission time: it runs evenly, whatever is done to the clock of the computer ------------------------------------

NOTICED_S = 0.1  # a smaller difference between the clocks is no step [s]
SLEPT_S = 5.0  # silence of a planner that was asleep [s]: after it, the navigation seems to have gone away
_Steady = Callable[[], float] | None
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class MissionClock:
    """Mission time begins as ROS time, and runs with steady time from then on. Durations and limits use it.

    Records, messages and visits keep stamps in ROS time; the mission knows the difference.

    :param ros_s: ROS time [s]; 0 while it does not run
    :param steady_s: steady time of the computer [s]; ``None`` where time is simulated
    :param boot: names the start of the computer from which steady time counts; empty if unknown
    :param awake_s: steady time also where time is simulated [s]; ``None`` where nothing can sleep
    """

    def __init__(
        self, ros_s: Callable[[], float], steady_s: _Steady = None, boot: str = "", awake_s: _Steady = None
    ) -> None:
        self._ros_s = ros_s
        self._steady_s = steady_s
        self._boot = boot
        self._offset_s: float | None = None
        self._steady_awake_s, self._awake_s = awake_s, math.inf

    def slept_s(self) -> float:
        """Time since the last call, if this process was stopped or stuck since then [s]; 0 if it was awake."""
        if self._steady_awake_s is None:
            return 0.0
        before_s, self._awake_s = self._awake_s, self._steady_awake_s()
        slept_s = self._awake_s - before_s
        return slept_s if slept_s > SLEPT_S else 0.0

    def now_s(self) -> float:
        """Mission time [s]; 0 while ROS time does not run."""
        if self._steady_s is None:
            return self._ros_s()
        if self._offset_s is None:
            ros_s = self._ros_s()
            if ros_s <= 0:
                return 0.0
            self._offset_s = ros_s - self._steady_s()
        return self._steady_s() + self._offset_s

    def go_on_from(self, state: MissionState) -> None:
        """Continue the time of a mission of an earlier process; it never runs backwards.

        Since the same start of the computer, steady time has gone on. Otherwise ROS time decides.
        """
        if self._steady_s is None or state.now_s is None:
            return
        steady_s = self._steady_s()
        if self._boot and state.boot == self._boot:
            self._offset_s = state.steady_offset_s
        else:
            self._offset_s = max(self._ros_s() - state.stamp_offset_s, state.now_s) - steady_s

    def events(self, state: MissionState) -> list[ClockStarted | ClockStepped]:
        """Start and steps of the clock that the mission has to know."""
        now_s = self.now_s()
        if self._steady_s is None or self._offset_s is None:
            return []
        found: list[ClockStarted | ClockStepped] = []
        if (state.boot, state.steady_offset_s) != (self._boot, self._offset_s):
            found.append(ClockStarted(now_s, self._boot, self._offset_s))
        step_s = self._ros_s() - now_s - state.stamp_offset_s
        if abs(step_s) > NOTICED_S:
            found.append(ClockStepped(now_s, step_s))
        return found


def boot_id() -> str:
    """Name of the last start of this computer, by Linux; empty where it gives none."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return ""
