# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission: a pure state machine between operator, planner, navigation and sensor.

``step(rules, state, event)`` gives the next state and the actions to carry out. There is no clock, no randomness
and no input or output in it, so the same mission runs in the planner node, in a simulator a thousand times
faster, and from a journal of its events.

What it holds to:

* A goal is sent only when the one before is known to have ended, or after a pause in which the robot stood.
* Answers to goals and plans that are not current are ignored.
* A record counts for a stop only if it was counted wholly after the arrival, and at the stop. Others were taken
  while driving; the mapper uses them all the same.
* The time for the way home is kept back, judged from where the robot is.
* What follows a cancellation waits until the robot is known to stand still.
* A robot that is moved while it counts ends its visit, and waits for people: something else drives or pushes it.
* While paused the robot never moves, not even home when the time is used up.
"""

from __future__ import annotations

import json
import math
from typing import assert_never

from soilmoist_ros.exploration.mission.actions import Action, Answer, Publish
from soilmoist_ros.exploration.mission.commands import Commands
from soilmoist_ros.exploration.mission.dangers import Dangers
from soilmoist_ros.exploration.mission.deadlines import Deadlines
from soilmoist_ros.exploration.mission.events import (
    STILL_M,
    AlarmOver,
    ClockStarted,
    ClockStepped,
    Command,
    EmergencyStop,
    Event,
    GoalFailed,
    GoalReached,
    Moved,
    PlanFailed,
    Planned,
    RecordArrived,
    Tick,
)
from soilmoist_ros.exploration.mission.moves import after_colon, xy
from soilmoist_ros.exploration.mission.state import (
    Counting,
    Goal,
    MissionState,
    Target,
    Todo,
    blacklisted,
    changed_rules,
    dwell_rule,
    mission_status,
    replace,
    shown,
)
from soilmoist_ros.exploration.mission.stored import state_from_json, state_to_dict
from soilmoist_ros.exploration.mission.types import Alarm, MissionEnd, MissionRules, MissionStatus, Phase
from soilmoist_ros.exploration.mission.visit import VisitEnd
from soilmoist_ros.exploration.planning.forecast import SOON_S, Forecast
from soilmoist_ros.exploration.travel.stop import inside_any
from soilmoist_ros.sensing import CountRecord


class Mission:
    """A mission that remembers its state between events.

    :param rules: what governs it
    :param state: where to go on from; a new mission if left out
    """

    def __init__(self, rules: MissionRules, state: MissionState | None = None) -> None:
        self.rules = rules
        self.state = state if state is not None else MissionState()
        self._last = _Turn(rules, self.state)

    def step(self, event: Event) -> tuple[Action, ...]:
        """Take in an event; see :func:`step`."""
        self._last = _turn(self.rules, self.state, event)
        self.state = self._last.state
        return tuple(self._last.actions)

    @property
    def status(self) -> MissionStatus:
        """The mission as of the last event."""
        return mission_status(self.current_rules, self.state)

    @property
    def current_rules(self) -> MissionRules:
        """The rules with what an operator has changed."""
        return changed_rules(self.rules, self.state.changes)

    @property
    def next_deadline_s(self) -> float | None:
        """Time of the next :class:`Tick` that does something if nothing else happens before; ``None`` for none."""
        return self._last.deadline_s

    def snapshot(self) -> str:
        """The state as JSON; the rules are not part of it."""
        return json.dumps(state_to_dict(self.state), allow_nan=False)

    @classmethod
    def restore(cls, rules: MissionRules, snapshot: str) -> Mission:
        """The mission that :meth:`snapshot` wrote, under the same rules.

        :raises InputError: if the text is not a snapshot
        """
        return cls(rules, state_from_json(snapshot))


def step(rules: MissionRules, state: MissionState, event: Event) -> tuple[MissionState, tuple[Action, ...]]:
    """The next state, and the actions to carry out in their order.

    Time never runs backwards: an event that is late is taken to happen at the time of the one before.

    :raises ValueError: if the time of the event is not finite
    """
    turn = _turn(rules, state, event)
    return turn.state, tuple(turn.actions)


def _turn(rules: MissionRules, state: MissionState, event: Event) -> _Turn:
    """A step that has been done."""
    if not math.isfinite(event.now_s):
        raise ValueError(f"the time of an event must be finite, got {event!r}")
    now_s = event.now_s if state.now_s is None else max(state.now_s, event.now_s)
    turn = _Turn(rules, state if now_s == state.now_s else replace(state, now_s=now_s))
    turn.handle(event)
    turn.meet_deadlines()
    if shown(turn.state) != shown(state):
        turn.do(Publish())
    return turn


MOVED_S = 3.0
"""A robot is moved away from where it counts when it is seen elsewhere for this time [s]; one fix may be bad."""
UNDER_THE_WHEELS_M = 0.1
"""A robot that stands this near a stop needs no goal to it [m]; navigations are not more precise."""
_ROUNDING = 1e-9
"""Relative rounding error allowed in sums of exposures."""


class _Turn(Commands, Dangers, Deadlines):
    """One step: what an event, or the operator, sets off."""

    # Events --------------------------------------------------------------------------------------------------

    def handle(self, event: Event) -> None:
        match event:
            case RecordArrived(record=record):  # these two come first, as nearly all events are of them
                self.on_record(record)
            case Moved(x_m=x_m, y_m=y_m, still_s=still_s, unseen_mps=unseen_mps, sd_m=sd_m):
                self.on_moved((x_m, y_m), sd_m, still_s, unseen_mps)
            case Command():
                self.do(Answer(event.verb, *self.command(event)))
            case Planned(plan_id=plan_id):
                if self.is_awaited(plan_id):
                    self.on_plan(event)
            case PlanFailed(plan_id=plan_id, reason=reason):
                if self.is_awaited(plan_id):
                    self.fail(Todo.PLAN, f"planning failed: {reason}")
            case GoalReached(goal_id=goal_id, x_m=x_m, y_m=y_m):
                self.on_moved((x_m, y_m), self.state.position_sd_m)
                if (goal := self.ended_goal(goal_id)) is not None:
                    self.on_reached(goal, (x_m, y_m))
            case GoalFailed(goal_id=goal_id, reason=reason, refused=refused, superseded=superseded):
                if self.ended_goal(goal_id) is not None:
                    self.on_goal_ended(reason, refused, superseded)
            case Alarm():
                self.alarm(event)
            case AlarmOver(cause=cause):
                self.alarm_over(cause)
            case EmergencyStop(active=active, source=source):
                self.emergency(active, source)
            case ClockStarted(boot=boot, offset_s=offset_s):
                self.state = replace(self.state, boot=boot, steady_offset_s=offset_s)
            case ClockStepped(step_s=step_s):
                self.state = replace(self.state, stamp_offset_s=self.state.stamp_offset_s + step_s)
            case Tick():
                pass
            case _:
                assert_never(event)

    def is_awaited(self, plan_id: int) -> bool:
        return self.state.plan is not None and self.state.plan.plan_id == plan_id

    def ended_goal(self, goal_id: int) -> Goal | None:
        """The current goal, whose end the navigation reports; ``None`` if the id is another one's."""
        goal = self.state.goal
        if goal is None or goal.goal_id != goal_id or goal.over:
            return None
        cancelled = self.state.phase is Phase.CANCELLING
        self.state = replace(self.state, goal=replace(goal, over=True) if cancelled else None)
        return goal

    def on_plan(self, event: Planned) -> None:
        choice = event.choice
        if event.forecast is not None:
            end = satisfied(self.rules, event.forecast)
            good = 0 if end is None else self.state.good_forecasts + 1
            self.state = replace(self.state, forecast=event.forecast, forecast_s=self.now_s, good_forecasts=good)
            if end is not None and (good >= GOOD_FORECASTS or end[0] is MissionEnd.NOTHING_VARIES):
                self.end(*end)
                return
        staying = self.staying
        if staying is not None and (choice is None or choice.stop.name == staying.stop.name):
            staying = replace(staying, home_s=event.home_s)
            self.state = replace(self.state, target=staying)
        if choice is None:
            reason = "nothing is left that is worth measuring or can be reached" + after_colon(event.reason)
            self.end_or_count_on(MissionEnd.NOTHING_LEFT, reason)
        elif staying is not None and choice.stop.name == staying.stop.name:
            self.count_on(choice.dwell, choice.reason)
        elif choice.stop.name in blacklisted(self.state) or inside_any(self.state.ruled_out, xy(choice.stop))[0]:
            self.fail(Todo.PLAN, f"the planner chose {choice.stop.name}, which is ruled out for now")
        else:
            travel_s = event.travel_s
            if travel_s is None:
                travel_s = self.rules.travel_s(self.place, xy(choice.stop))
            if staying is not None and not self.fits(choice.stop, travel_s, event.home_s):
                self.end_or_count_on(MissionEnd.TIME_UP, f"no time is left for {choice.stop.name}")
                return
            self.settle()
            target = Target(choice.stop, choice.reason, travel_s, dwell=choice.dwell, home_s=event.home_s)
            self.state = replace(self.state, target=target)
            if self.rules.stays and math.dist(self.place, xy(choice.stop)) <= UNDER_THE_WHEELS_M:
                self.arrive(self.place)
            else:
                self.travel(travel_s, f"going to {choice.stop.name}{after_colon(choice.reason)}")

    def on_reached(self, goal: Goal, place: tuple[float, float]) -> None:
        if self.state.phase is Phase.CANCELLING:
            self.stopped()
        elif not self.rules.is_at(place, goal.stop, self.noise_m):
            away_m = math.dist(place, xy(goal.stop))
            self.on_goal_ended(f"reported as reached, but the robot is {away_m:.1f} m away from it")
        elif self.state.phase is Phase.RETURNING:
            self.finish(f"{self.state.ending}; the robot is back home")
        else:
            self.arrive(place)

    def arrive(self, place: tuple[float, float]) -> None:
        """The robot is at its stop: count there."""
        now_s, sd_m = self.now_s, self.state.position_sd_m
        self.count(Counting(*place, arrived_s=now_s, since_s=now_s, heard_s=now_s, sd_m=sd_m))

    def on_goal_ended(self, reason: str, refused: bool = False, superseded: bool = False) -> None:
        """The goal did not lead to its stop, it was cancelled on purpose, or another client has replaced it."""
        resume = self.to_resume
        if self.state.phase is Phase.CANCELLING:
            self.stopped()
        elif superseded and resume is not None:
            self.hold(resume, f"{reason}; wait until the other goal is over, then resume or abort")
        else:
            self.goal_failed(reason, refused)

    def on_moved(
        self,
        place: tuple[float, float],
        sd_m: float,
        still_s: float | None = None,
        unseen_mps: float | None = None,
    ) -> None:
        if not (math.isfinite(place[0]) and math.isfinite(place[1])):
            return
        still_at, still_since_s = self.state.still_at, self.state.still_since_s
        if still_s is not None:
            still_at, before_s = place, still_since_s if still_s and still_since_s is not None else self.now_s
            still_since_s = min(before_s, self.now_s - still_s)
        elif still_at is None or math.dist(still_at, place) > STILL_M:
            still_at, still_since_s = place, self.now_s
        self.state = replace(
            self.state,
            position=place,
            position_s=self.now_s,
            position_sd_m=sd_m if math.isfinite(sd_m) else 0.0,
            still_at=still_at,
            still_since_s=still_since_s,
            unseen_mps=self.state.unseen_mps if unseen_mps is None else unseen_mps,
        )
        start = self.state.odometer_at
        moved_m = math.dist(start, place) if start is not None else math.inf
        if moved_m >= self.rules.odometer_step_m:
            driven_m = moved_m if start is not None and self.state.under_way else 0.0
            self.state = replace(self.state, odometer_at=place, distance_m=self.state.distance_m + driven_m)
        if self.state.phase is Phase.CANCELLING:
            self.stopped()
        elif self.state.counting is not None and self.state.counting.since_s is not None:
            self.watch_stop(self.state.counting, place)

    def watch_stop(self, counting: Counting, place: tuple[float, float]) -> None:
        """End the visit of a robot that was moved away while it counts: it has no goal, so others move it."""
        assert self.state.target is not None
        stop, noise_m = self.state.target.stop, self.noise_at_stop_m(counting)
        away_m = math.dist(place, (counting.x_m, counting.y_m))
        away_s = None
        if away_m - noise_m > self.rules.reach_m(stop, noise_m):
            away_s = self.now_s if counting.away_s is None else counting.away_s
        if away_s is not None and self.now_s - away_s >= MOVED_S:
            reason = f"the robot was moved by {away_m:.1f} m while it counted at {stop.name}"
            self.leave_stop(VisitEnd.MOVED, reason)
            self.hold(Todo.PLAN, f"{reason}, and not by the planner; check the robot, then resume or abort")
        elif away_s != counting.away_s:
            self.state = replace(self.state, counting=replace(counting, away_s=away_s))

    def on_record(self, record: CountRecord) -> None:
        state, newest_s = self.state, self.state.last_stamp_s
        stamp_s = record.stamp_s - state.stamp_offset_s
        if not _usable(record) or (newest_s is not None and stamp_s <= newest_s):
            return  # broken, repeated or out of order
        ended_s = min(stamp_s, self.now_s)
        began_s = ended_s - record.exposure_s
        if newest_s is not None and ended_s - newest_s < 2 * record.exposure_s:
            began_s = min(began_s, newest_s)  # the live time is shorter than the interval when a tube is missing
        raw_counts, exposure_s = state.raw_counts, state.exposure_s
        if state.under_way:
            raw_counts, exposure_s = raw_counts + record.raw_counts, exposure_s + record.exposure_s
        self.state = replace(state, last_stamp_s=ended_s, raw_counts=raw_counts, exposure_s=exposure_s)
        counting = state.counting
        at_stop = state.phase is Phase.COUNTING or state.phase is Phase.PLANNING
        if at_stop and counting is not None and counting.since_s is not None:
            assert state.target is not None
            away_m = math.dist((record.x_m, record.y_m), (counting.x_m, counting.y_m))
            reach_m = self.rules.reach_m(state.target.stop, self.noise_at_stop_m(counting))
            if began_s >= counting.since_s and away_m <= reach_m:
                self.add(record, counting)

    def add(self, record: CountRecord, counting: Counting) -> None:
        """Count a record for this stop."""
        reason = self.counting_reason() if counting.silent else self.state.reason
        counting = replace(
            counting,
            heard_s=self.now_s,
            silent=False,
            records=counting.records + 1,
            raw_counts=counting.raw_counts + record.raw_counts,
            exposure_s=counting.exposure_s + record.exposure_s,
            effective_exposure_s=counting.effective_exposure_s + record.effective_exposure_s,
        )
        self.state = replace(self.state, counting=counting, reason=reason)
        too_short = counting.exposure_s < self.rules.min_dwell_s * (1 - _ROUNDING)
        if too_short or counting.met is not None or counting.to_the_end:
            return
        dwell = dwell_rule(self.rules, self.state)
        judged_counts, judged_s = counting.judged
        if dwell.enough(judged_counts, judged_s):
            longest = judged_s >= dwell.longest_s
            code = VisitEnd.MAX_DWELL if longest else VisitEnd.ENOUGH
            self.dwell_is_over(code, dwell.outcome(counting.raw_counts, counting.exposure_s))


GOOD_FORECASTS = 3
"""A mission ends by so many forecasts in a row: each fit of the variogram makes them jump a little."""


def satisfied(rules: MissionRules, forecast: Forecast) -> tuple[MissionEnd, str] | None:
    """Why a mission may end by a forecast, as code and in words; ``None`` if it goes on."""
    if rules.until_sd > 0 and forecast.sd <= rules.until_sd:
        limit = f"{100 * rules.until_sd:.3g} {forecast.unit}"
        return MissionEnd.GOOD_ENOUGH, f"the map is good enough: ±{100 * forecast.sd:.3g} of {limit} demanded"
    if rules.until_gain > 0 and not forecast.is_guess:
        if forecast.hidden is not None:
            return MissionEnd.NOTHING_VARIES, f"nothing varies: {forecast.uniform}"
        if 100 * forecast.gain < rules.until_gain:
            return (
                MissionEnd.LITTLE_GAIN,
                f"little is to be gained: in {SOON_S / 60:.0f} min the map would become "
                f"{100 * forecast.gain:.2g} % better, less than the {rules.until_gain:g} % demanded",
            )
    return None


def _usable(record: CountRecord) -> bool:
    return (
        math.isfinite(record.stamp_s)
        and record.raw_counts >= 0
        and 0 < record.exposure_s < math.inf
        and 0 < record.effective_exposure_s < math.inf
    )
