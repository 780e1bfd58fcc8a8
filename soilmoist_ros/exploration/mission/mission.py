# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission: a pure state machine between operator, planner, navigation and sensor.

:meth:`Mission.step` takes an event and gives the actions to carry out. There is no clock, no randomness and no
input or output in it, so the same mission runs in the planner node, in a simulator a thousand times faster, and
from a journal of its events. :data:`ALWAYS`, :data:`IN_PHASE`, :data:`COMMANDS` and :data:`DEADLINES`
at the end are the tables of what it does.

What it holds to:

* A goal is sent only when the one before is known to have ended, or after a pause in which the robot stood.
* Answers to goals and plans that are not current are ignored.
* A record counts for a stop only if it was counted wholly after the arrival, and at the stop; the map uses all.
* The time for the way home is kept back, judged from where the robot is.
* What follows a cancellation waits until the robot is known to stand still.
* A robot that is moved while it counts ends its visit, and waits for people: something else drives or pushes it.
  A person with the sensor goes where they like: what they count is kept, and the next stop is chosen from there.
* While paused the robot never moves, not even home when the time is used up.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from functools import cached_property
from operator import itemgetter
from typing import Any, Final, assert_never

from soilmoist_ros.exploration.mission import events
from soilmoist_ros.exploration.mission.state import (
    Goal,
    MissionState,
    OpenVisit,
    PendingPlan,
    QueuedStop,
    RuledOut,
    Target,
    Todo,
    blacklisted,
    changed_rules,
    dwell_rule,
    mission_status,
    replace,
    shown,
    state_from_json,
    to_dict,
)
from soilmoist_ros.exploration.mission.types import (
    MOVING,
    READY,
    Alarm,
    Changes,
    MissionEnd,
    MissionRules,
    MissionStatus,
    Phase,
    PlanKind,
    Response,
    Verb,
)
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.exploration.planning.dwell import DwellRule, parse_dwell
from soilmoist_ros.exploration.planning.forecast import SOON_S, Forecast
from soilmoist_ros.exploration.travel.stop import Stop, inside_any
from soilmoist_ros.foundation import InputError

MOVED_S: Final = 3.0
"""A robot is moved away from where it counts when it is seen elsewhere for this time [s]; one fix may be bad."""
UNDER_THE_WHEELS_M: Final = 0.1
"""A robot that stands this near a stop needs no goal to it [m]; navigations are not more precise."""
SDS: Final = 3.0  # errors of positions up to this many standard deviations are noise
MIN_GOOD_SAMPLES: Final = 10  # fewer samples say too little of the field to call its map good enough
GOOD_FORECASTS: Final = 3
"""A mission ends by so many forecasts in a row: each fit of the variogram makes them jump a little."""
SATISFIED: Final = (MissionEnd.GOOD_ENOUGH, MissionEnd.LITTLE_GAIN)
"""Ends of a mission whose map is as good as demanded, or would not become much better."""
_RESUMES: Final = {
    Phase.PLANNING: Todo.PLAN,
    Phase.TRAVELLING: Todo.TRAVEL,
    Phase.COUNTING: Todo.COUNT,
    Phase.RETURNING: Todo.RETURN,
}
"""Task that is resumed after a pause, by the phase that the pause interrupts."""
_EARLY: Final = {
    MissionEnd.RETURNED: VisitEnd.RETURNED,
    MissionEnd.FAILSAFE: VisitEnd.FAILSAFE,
    **dict.fromkeys(SATISFIED, VisitEnd.ENOUGH),
}
"""Ends of a visit with the mission; the time is up with all others."""
_MAX_AT_ONCE: Final = 10
"""Maximum number of deadlines per step; more are due only if limits are below the resolution of the clock."""
_ROUNDING: Final = 1e-9  # relative rounding error allowed in sums of exposures

Place = tuple[float, float]
Done = tuple[bool, str]  # verdict on a command: if it is accepted, and what happens or why not


class Mission:
    """A mission that remembers its state between events.

    :param state: where to go on from; a new mission if left out
    """

    def __init__(self, rules: MissionRules, state: MissionState | None = None) -> None:
        self.rules = rules
        self.state = state if state is not None else MissionState()
        self._last = _Step(rules, self.state)

    def step(self, event: events.Event) -> tuple[events.Action, ...]:
        """The actions to carry out after an event, in their order.

        Time never runs backwards: an event that is late is taken to happen at the time of the one before.

        :raises ValueError: if the time of the event is not finite
        """
        if not math.isfinite(event.now_s):
            raise ValueError(f"the time of an event must be finite, got {event!r}")
        before = self.state
        now_s = event.now_s if before.now_s is None else max(before.now_s, event.now_s)
        self._last = step = _Step(self.rules, before if now_s == before.now_s else replace(before, now_s=now_s))
        step.handle(event)
        step.meet_deadlines()
        if shown(step.state) != shown(before):
            step.do(events.Publish())
        self.state = step.state
        return tuple(step.actions)

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
        return json.dumps(to_dict(self.state), allow_nan=False)

    @classmethod
    def restore(cls, rules: MissionRules, snapshot: str) -> Mission:
        """The mission that :meth:`snapshot` wrote, under the same rules.

        :raises InputError: if the text is not a snapshot
        """
        return cls(rules, state_from_json(snapshot))


class _Step:
    """One step of a mission: the state so far, the requested actions, and all that a mission can do."""

    def __init__(self, rules: MissionRules, state: MissionState) -> None:
        self.rules = rules if state.changes is None else changed_rules(rules, state.changes)
        self.given_rules = rules
        self.state = state
        self.now_s = math.nan if state.now_s is None else state.now_s  # NaN before the first
        self.actions: list[events.Action] = []

    def do(self, action: events.Action) -> None:
        self.actions.append(action)

    def set(self, **changes: Any) -> None:
        self.state = replace(self.state, **changes)

    def recount(self, **changes: Any) -> None:
        self.state = replace(self.state, counting=replace(self.counting, **changes))

    @property
    def place(self) -> Place:
        assert self.state.position is not None, "a mission does not start without a position"
        return self.state.position

    @property
    def goal(self) -> Goal:
        assert self.state.goal is not None
        return self.state.goal

    @property
    def target(self) -> Target:
        assert self.state.target is not None
        return self.state.target

    @property
    def counting(self) -> OpenVisit:
        assert self.state.counting is not None
        return self.state.counting

    @property
    def started_s(self) -> float:
        assert self.state.started_s is not None
        return self.state.started_s

    @property
    def noise_m(self) -> float:
        """Error that the robot's position may have [m]."""
        return SDS * self.state.position_sd_m

    @property
    def noise_at_stop_m(self) -> float:
        """Distance between the robot's position and that of its arrival which noise explains [m]."""
        return SDS * math.hypot(self.state.position_sd_m, self.counting.sd_m)

    # Events --------------------------------------------------------------------------------------------------

    def handle(self, event: events.Event) -> None:
        if (take := ALWAYS.get(type(event))) is not None:
            take(self, event)
        follow = IN_PHASE.get((type(event), self.state.phase))
        if follow is not None and self.is_current(event):
            follow(self, event)

    def is_current(self, event: events.Event) -> bool:
        """False for the answer to a plan request or a goal that is not the open one."""
        plan, goal = self.state.plan, self.state.goal
        match event:
            case events.Planned(plan_id=plan_id) | events.PlanFailed(plan_id=plan_id):
                return plan is not None and plan.plan_id == plan_id
            case events.GoalReached(goal_id=goal_id) | events.GoalFailed(goal_id=goal_id):
                return goal is not None and goal.goal_id == goal_id and not goal.over
            case _:
                return True

    def locate(self, event: events.Moved) -> None:
        """The robot is at a place."""
        place, still_s = (event.x_m, event.y_m), event.still_s
        if not (math.isfinite(event.x_m) and math.isfinite(event.y_m)):
            return
        still_at, still_since_s = self.state.still_at, self.state.still_since_s
        if still_s is not None:
            still_at, before_s = place, still_since_s if still_s and still_since_s is not None else self.now_s
            still_since_s = min(before_s, self.now_s - still_s)
        elif still_at is None or math.dist(still_at, place) > events.STILL_M:
            still_at, still_since_s = place, self.now_s
        start = self.state.odometer_at or place
        driven_m, counted = event.driven_m, place
        if driven_m is None:
            moved_m = math.dist(start, place)
            driven_m, counted = (moved_m, place) if moved_m >= self.rules.odometer_step_m else (0.0, start)
        self.set(
            position=place,
            position_s=self.now_s,
            position_sd_m=event.sd_m if math.isfinite(event.sd_m) else 0.0,
            still_at=still_at,
            still_since_s=still_since_s,
            unseen_mps=event.unseen_mps,
            odometer_at=counted,
            distance_m=self.state.distance_m + (driven_m if self.state.under_way else 0.0),
        )
        if self.state.phase is Phase.CANCELLING:
            self.stopped()
        elif self.state.counting is not None and self.state.counting.since_s is not None:
            self.watch_stop(place)

    def watch_stop(self, place: Place) -> None:
        """End the visit of a robot that was moved away while it counts: it has no goal, so others move it."""
        counting, stop, noise_m = self.counting, self.target.stop, self.noise_at_stop_m
        away_m = math.dist(place, (counting.x_m, counting.y_m))
        away_s = None
        if away_m - noise_m > self.rules.reach_m(stop, noise_m):
            away_s = self.now_s if counting.away_s is None else counting.away_s
        if away_s is not None and self.now_s - away_s >= MOVED_S:
            reason = f"the robot was moved by {away_m:.1f} m while it counted at {stop.name}"
            self.leave_stop(VisitEnd.MOVED, reason)
            if self.rules.by_person:
                self.then(Todo.PLAN, f"{stop.name} was left")
                return
            self.hold(Todo.PLAN, f"{reason}, and not by the planner; check the robot, then resume or abort")
        elif away_s != counting.away_s:
            self.recount(away_s=away_s)

    def record_arrived(self, event: events.RecordArrived) -> None:
        """Add a record to the mission, and to the stop if it was counted there."""
        record, state, newest_s = event.record, self.state, self.state.last_stamp_s
        stamp_s = record.stamp_s - state.stamp_offset_s
        usable = math.isfinite(record.stamp_s) and record.raw_counts >= 0
        usable = usable and 0 < record.exposure_s < math.inf and 0 < record.effective_exposure_s < math.inf
        if not usable or (newest_s is not None and stamp_s <= newest_s):
            return  # broken, repeated or out of order
        ended_s = min(stamp_s, self.now_s)
        began_s = ended_s - record.exposure_s
        if newest_s is not None and ended_s - newest_s < 2 * record.exposure_s:
            began_s = min(began_s, newest_s)  # the live time is shorter than the interval when a tube is missing
        raw_counts, exposure_s = state.raw_counts, state.exposure_s
        if state.under_way:
            raw_counts, exposure_s = raw_counts + record.raw_counts, exposure_s + record.exposure_s
        self.set(last_stamp_s=ended_s, raw_counts=raw_counts, exposure_s=exposure_s)
        counting = state.counting
        if state.phase not in (Phase.COUNTING, Phase.PLANNING) or counting is None or counting.since_s is None:
            return
        away_m = math.dist((record.x_m, record.y_m), (counting.x_m, counting.y_m))
        there_m = self.rules.reach_m(self.target.stop, self.noise_at_stop_m) + self.rules.antenna_m
        if began_s < counting.since_s or not away_m <= there_m:  # not if its place is NaN
            return
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
        self.set(counting=counting, reason=reason)
        too_short = counting.exposure_s < self.rules.min_dwell_s * (1 - _ROUNDING)
        if too_short or counting.met is not None or counting.to_the_end:
            return
        dwell = dwell_rule(self.rules, self.state)
        judged_counts, judged_s = counting.judged
        if dwell.enough(judged_counts, judged_s):
            code = VisitEnd.MAX_DWELL if judged_s >= dwell.longest_s else VisitEnd.ENOUGH
            outcome = dwell.outcome(counting.raw_counts, counting.exposure_s)
            if self.rules.stays:  # the visit stays open until the next stop is chosen
                self.recount(met=code, outcome=outcome)
                self.then(Todo.PLAN, f"{self.target.stop.name} is done: {outcome}")
            else:
                self.complete(code, outcome)

    def planned(self, event: events.Planned) -> None:
        """Go to the stop that the planner has chosen, or count on, or end."""
        choice = event.choice
        if event.forecast is not None:
            end = satisfied(self.rules, event.forecast, self.state.samples)
            good = 0 if end is None else self.state.good_forecasts + 1
            self.set(forecast=event.forecast, forecast_s=self.now_s, good_forecasts=good)
            if end is not None and good >= GOOD_FORECASTS and not event.to_certify:
                self.end(*end)
                return
        if event.certificate:
            self.set(certificate=event.certificate)
        staying = self.staying
        if staying is not None and (choice is None or choice.stop.name == staying.stop.name):
            staying = replace(staying, home_s=event.home_s)
            self.set(target=staying)
        if choice is None:
            reason = "nothing is left that is worth measuring or can be reached" + after_colon(event.reason)
            self.end_or_count_on(MissionEnd.NOTHING_LEFT, reason)
        elif staying is not None and choice.stop.name == staying.stop.name:
            self.count_on(choice.dwell, choice.reason)
        elif choice.stop.name in blacklisted(self.state) or inside_any(self.state.ruled_out, choice.stop.xy)[0]:
            self.fail(Todo.PLAN, f"the planner chose {choice.stop.name}, which is ruled out for now")
        else:
            travel_s = event.travel_s
            if travel_s is None:
                travel_s = self.rules.travel_s(self.place, choice.stop.xy)
            if staying is not None and not self.fits(choice.stop, travel_s, event.home_s):
                self.end_or_count_on(MissionEnd.TIME_UP, f"no time is left for {choice.stop.name}")
                return
            self.settle()
            target = Target(
                choice.stop, choice.reason, travel_s, dwell=choice.dwell, home_s=event.home_s,
                certifies=choice.certifies,
            )  # fmt: skip
            self.set(target=target)
            if self.rules.stays and math.dist(self.place, choice.stop.xy) <= UNDER_THE_WHEELS_M:
                self.arrive()
            else:
                self.travel(travel_s, f"going to {choice.stop.name}{after_colon(choice.reason)}")

    def goal_over(self, _event: events.GoalReached | events.GoalFailed) -> None:
        self.set(goal=replace(self.goal, over=True))
        self.stopped()

    def goal_reached(self, event: events.GoalReached) -> None:
        """The goal has ended at its stop, if the robot's own place agrees: count there, or finish at home."""
        stop, place = self.goal.stop, (event.x_m, event.y_m)
        self.set(goal=None)
        if self.rules.by_person and self.state.phase is Phase.TRAVELLING:
            self.stand_at(place, event.goal_id)
        elif self.rules.by_person:
            self.finish(self.state.ending)
        elif not self.rules.is_at(place, stop, self.noise_m):
            away_m = math.dist(place, stop.xy)
            self.failed_on_way(f"reported as reached, but the robot is {away_m:.1f} m away from it")
        elif self.state.phase is Phase.RETURNING:
            self.finish(f"{self.state.ending}; the robot is back home")
        else:
            self.arrive(place)

    def goal_failed(self, event: events.GoalFailed) -> None:
        """The goal did not lead to its stop, or others have replaced or cancelled it: then people decide."""
        resume = self.to_resume
        if event.stopped and resume is not None:  # the robot may still roll, or not obey
            self.set(goal=replace(self.goal, over=True, cancelled_s=self.now_s, requests=1))
            self.hold(resume, f"{event.reason}; check the robot, then resume or abort")
            self.stopped()
            return
        self.set(goal=None)
        if event.superseded and resume is not None:
            self.hold(resume, f"{event.reason}; wait until the other goal is over, then resume or abort")
        else:
            self.failed_on_way(event.reason, event.refused)

    # Dangers -------------------------------------------------------------------------------------------------

    def alarm(self, alarm: Alarm) -> None:
        others = {other.cause: other for other in self.state.alarms}
        known = others.pop(alarm.cause, None)
        self.set(alarms=(*others.values(), alarm))
        goal = self.state.goal
        if alarm.cause == MOVING and alarm.response.stops and (goal is None or goal.over):
            # again with each alarm: nothing else tells it to stop
            self.do(events.CancelGoal(events.ANYBODYS))
        if self.state.under_way and (known is None or known.response is not alarm.response):
            self.respond(alarm.response, alarm.reason)

    def respond(self, response: Response, reason: str) -> None:
        resume = self.to_resume
        paused = self.state.phase is Phase.PAUSED or self.state.todo is Todo.PAUSE
        match response:
            case Response.PAUSE if resume is not None:
                self.hold(resume, f"{reason}; check the robot, then resume or abort")
            case Response.HOLD if resume is not None and not paused:
                self.hold(resume, f"{reason}; going on when that is over", needs_operator=False, held=True)
            case Response.RETURN if resume is not None and resume is not Todo.RETURN and not paused:
                self.end(MissionEnd.FAILSAFE, reason)
            case Response.ABORT if resume is not None:
                self.abandon(MissionEnd.FAILSAFE, reason)

    def alarm_over(self, event: events.AlarmOver) -> None:
        alarms = tuple(alarm for alarm in self.state.alarms if alarm.cause != event.cause)
        self.set(alarms=alarms)
        self.release()

    def emergency(self, event: events.EmergencyStop) -> None:
        """Stop at once and stay, whatever the mission is doing; a release only ends the reason."""
        others = tuple(other for other in self.state.emergency if other != event.source)
        released = not event.active and self.state.emergency and not others and not self.state.alarms
        self.set(emergency=(*others, event.source) if event.active else others)
        if released and self.state.phase is Phase.PAUSED and not self.state.held:
            self.set(reason="the emergency stop is released; resume or abort")
        if not event.active:
            return
        reason = f"emergency stop{after_colon(event.source)}"
        goal = self.state.goal
        # another client may drive, also if a goal of the mission is open
        self.do(events.CancelGoal(events.ANYBODYS))
        if goal is not None and goal.cancelled_s is not None:  # the others are cancelled by the pause
            self.do(events.CancelGoal(goal.goal_id))
        resume = self.to_resume
        if self.state.under_way and resume is not None:
            self.hold(resume, f"{reason}; release it, then resume or abort")

    # Commands ------------------------------------------------------------------------------------------------

    def start(self, _command: events.Command) -> Done:
        state = self.state
        if state.phase not in (Phase.IDLE, Phase.FINISHED):
            return False, f"a mission is under way ({state.phase}): resume or abort it"
        if state.position is None:
            return False, "the robot's position is not known yet: wait for a fix"
        if state.start_hindrance:
            return False, state.start_hindrance
        self.state = MissionState(
            **{name: getattr(state, name) for name in _KEPT}, started_s=state.now_s, odometer_at=state.position
        )
        self.plan("started")
        return True, self.state.reason

    def pause(self, command: events.Command) -> Done:
        state = self.state
        if state.phase is Phase.PAUSED or state.todo is Todo.PAUSE:
            own = command.who == events.RESTART and (state.held or state.interrupted)
            self.set(held=False, interrupted=own)  # otherwise it is the operator's from now on
            return True, state.reason
        resume = self.to_resume
        if resume is None:
            return False, f"there is nothing to pause: {state.reason}"
        self.hold(resume, f"paused by {command.by}", needs_operator=False)
        if command.who == events.RESTART:
            self.set(interrupted=True)
        return True, self.state.reason

    def resume(self, command: events.Command) -> Done:
        resume = self.state.resume
        if resume is None:
            return False, f"nothing is paused: {self.state.reason}"
        if self.state.hindrance:
            return False, f"not yet: {self.state.hindrance}"
        self.set(failures=0, wait_until_s=None)
        self.go_on_with(resume, f"resumed by {command.by}" if command.who else "resumed")
        return True, self.state.reason

    def abort(self, command: events.Command) -> Done:
        """Stop, and end the mission where the robot is; without a mission, stop whatever drives the robot."""
        reason = f"aborted by {command.by}"
        if self.state.under_way:
            self.abandon(MissionEnd.ABORTED, reason)
        else:
            if self.state.phase is Phase.FINISHED:
                self.enter(Phase.IDLE, READY)
            self.do(events.CancelGoal(events.ANYBODYS))
            if not self.seen_standing:
                return True, f"{reason}: whatever drives the robot is asked to stop; it is not known to stand"
        return True, self.state.reason

    def skip(self, command: events.Command) -> Done:
        target = self.state.target
        if target is None:
            return False, f"there is no stop to skip: {self.state.reason}"
        cause = command.cause or f"by {command.by}"
        self.rule_out(target.stop)
        self.leave(f"{target.stop.name} skipped {cause}")
        return True, self.state.reason

    def leave(self, reason: str) -> None:
        """Leave the target, and choose another stop unless paused."""
        self.leave_stop(VisitEnd.SKIPPED, reason)
        self.set(wait_until_s=None)
        if self.state.resume is not None:
            self.hold(Todo.PLAN, f"{reason}; still paused", self.state.needs_operator, self.state.held)
        else:
            self.then(Todo.PLAN, reason)

    def measure(self, command: events.Command) -> Done:
        stop, queue, dwell_s = command.stop, self.state.queue, command.dwell_s
        assert stop is not None
        if not self.state.under_way or self.to_resume in (None, Todo.RETURN):
            return False, f"no mission is measuring: {self.state.reason}"
        if stop.name in {queued.stop.name for queued in queue}:
            return False, f"{stop.name} is in the queue already"
        if inside_any(self.state.ruled_out, stop.xy)[0]:
            return False, f"{stop.name} lies in an area that is ruled out"
        if self.rules.by_person and self.state.phase is Phase.TRAVELLING and self.is_close_to(stop):
            goal_id = self.goal.goal_id
            self.do(events.CancelGoal(goal_id))
            self.set(goal=None)
            self.stand_at(self.place, goal_id)
            return True, self.state.reason
        queued = QueuedStop(stop, command.by, "" if dwell_s is None else f"fmi:{dwell_s:g}")
        self.set(queue=(*queue, queued))
        self.plan_again(f"{stop.name} requested by {command.by}")
        names = ", ".join(queued.stop.name for queued in self.state.queue)
        return True, f"queued: {names}" if names else self.state.reason

    def rule_out_area(self, command: events.Command) -> Done:
        """Choose no stop in an area; driving through it stays allowed."""
        corners = command.polygon
        kept = tuple(queued for queued in self.state.queue if not inside_any([corners], queued.stop.xy)[0])
        self.set(ruled_out=(*self.state.ruled_out, corners), queue=kept)
        target = self.state.target
        if target is not None and inside_any([corners], target.stop.xy)[0]:
            self.leave(f"{target.stop.name} is ruled out by {command.by}")  # as long as its area is
        else:
            self.plan_again(f"an area is ruled out by {command.by}")
        return True, f"no stop is chosen in the area; {self.state.reason}"

    def lift_area(self, command: events.Command) -> Done:
        """Let stops be chosen again in an area that was ruled out."""
        self.set(ruled_out=tuple(area for area in self.state.ruled_out if area != command.polygon))
        self.plan_again(f"an area is lifted by {command.by}")
        return True, f"stops may be chosen in the area again; {self.state.reason}"

    def order(self, command: events.Command) -> Done:
        queued = {one.stop.name: one for one in self.state.queue}
        unknown = [name for name in command.stops if name not in queued]
        if unknown or len(set(command.stops)) < len(command.stops):
            names = ", ".join(queued) or "nothing"
            return False, f"the queue holds {names}: name each of them once at most"
        self.set(queue=tuple(queued[name] for name in command.stops))
        return True, f"queued: {', '.join(command.stops) or 'nothing'}"

    def change(self, command: events.Command) -> Done:
        new = command.changes
        assert new is not None
        values = new.given
        if new.of_survey and self.state.under_way:
            return False, f"a mission is under way: end it before {' and '.join(new.of_survey)} can change"
        changes = dataclasses.replace(self.state.changes or Changes(), **values)
        try:
            rules = changed_rules(self.given_rules, changes)
        except (InputError, ValueError) as error:
            return False, str(error)
        used_s = self.state.time_used_s
        if new.budget_s is not None and self.state.under_way and new.budget_s <= used_s:
            return False, f"{used_s / 3600:.2f} h are used already: give more, or send the robot home"
        self.set(changes=changes)
        if new.home is not None and self.state.target is not None:
            self.set(target=replace(self.state.target, home_s=0.0))
        self.rules = rules
        self.plan_again(f"settings changed by {command.by}")
        return True, f"changed: {', '.join(f'{name} {_plain(value)}' for name, value in values.items())}"

    def return_home(self, command: events.Command) -> Done:
        resume = self.to_resume
        if self.rules.home is None:
            return False, "there is no home: set one, or abort"
        if not self.state.under_way or resume is None:
            return False, f"no mission is under way: {self.state.reason}"
        if self.state.hindrance:
            return False, f"not yet: {self.state.hindrance}"
        self.set(wait_until_s=None, queue=())
        if resume is Todo.RETURN:
            self.then(Todo.RETURN, f"sent home by {command.by}")
        else:
            self.end(MissionEnd.RETURNED, f"sent home by {command.by}")
        return True, self.state.reason

    # Stopping and going on -----------------------------------------------------------------------------------

    def enter(self, phase: Phase, reason: str) -> None:
        """Change the phase, and clear the data of other phases."""
        state = self.state
        paused = phase is Phase.PAUSED or (phase is Phase.CANCELLING and state.todo is Todo.PAUSE)
        waits = phase in (Phase.CANCELLING, Phase.WAITING)
        self.set(
            phase=phase,
            reason=reason,
            plan=state.plan if phase is Phase.PLANNING else None,
            todo=state.todo if waits else None,
            cause=state.cause if waits else "",
            resume=state.resume if paused else None,
            held=state.held and paused,
            interrupted=state.interrupted and paused,
        )

    def then(self, todo: Todo, reason: str) -> None:
        """Carry out a todo after the robot has stopped, at once if no goal is open."""
        goal = self.state.goal
        if goal is None:
            self.carry_out(todo, reason)
            return
        if goal.cancelled_s is None:
            self.do(events.CancelGoal(goal.goal_id))
            goal = replace(goal, cancelled_s=self.now_s, requests=1)
        self.set(goal=goal, todo=todo, cause=reason)
        self.enter(Phase.CANCELLING, f"{reason}; waiting for the robot to stop")

    @property
    def stands(self) -> bool:
        """True if places reported after the cancellation show that the robot stands still."""
        state, cancelled_s = self.state, self.goal.cancelled_s
        assert cancelled_s is not None
        if self.rules.standstill_s == 0:
            return True
        return self.seen_standing and state.position_s is not None and state.position_s > cancelled_s

    @property
    def seen_standing(self) -> bool:
        """True if the last place showed that the robot stood."""
        at_s, since_s = self.state.position_s, self.state.still_since_s
        return at_s is not None and since_s is not None and at_s - since_s >= self.rules.standstill_s

    def stopped(self) -> None:
        """Carry out what the cancellation was for, once the goal is over and the robot stands."""
        goal, todo, cause = self.state.goal, self.state.todo, self.state.cause
        if self.state.phase is Phase.CANCELLING and goal is not None and goal.over and self.stands:
            assert todo is not None
            self.set(goal=None)
            self.carry_out(todo, cause + self.unseen)

    @property
    def unseen(self) -> str:
        """Speed below which the noise hides a motion, to add to a text; empty if it hides none."""
        mps = self.state.unseen_mps
        return f" (a motion below {mps:.1g} m/s would not show in the noise of the fixes)" if mps else ""

    def carry_out(self, todo: Todo, reason: str) -> None:
        """Carry out a todo, or wait with a new attempt; no goal is open now."""
        wait_until_s = self.state.wait_until_s
        self.set(wait_until_s=None)
        attempts = (Todo.PLAN, Todo.TRAVEL, Todo.RETURN)
        if wait_until_s is not None and self.now_s < wait_until_s and todo in attempts:
            self.set(wait_until_s=wait_until_s, todo=todo, cause=reason)
            self.enter(Phase.WAITING, f"{reason}; trying again in {wait_until_s - self.now_s:.0f} s")
            return
        match todo:
            case Todo.PLAN:
                self.plan(reason)
            case Todo.TRAVEL:
                stop = self.target.stop
                self.travel(self.rules.travel_s(self.place, stop.xy), f"going to {stop.name} again: {reason}")
            case Todo.COUNT:
                self.count_again(reason)
            case Todo.RETURN:
                self.go_home(reason)
            case Todo.PAUSE:
                self.enter(Phase.PAUSED, reason)
                self.release()
            case Todo.FINISH:
                self.finish(self.state.ending)
            case Todo.IDLE:
                self.finish(reason, Phase.IDLE)
            case _:
                assert_never(todo)

    def hold(self, resume: Todo, reason: str, needs_operator: bool = True, held: bool = False) -> None:
        """Pause: stop the robot, and store what to resume."""
        self.settle()
        self.suspend()
        self.set(resume=resume, needs_operator=needs_operator, held=held, interrupted=False, wait_until_s=None)
        self.then(Todo.PAUSE, reason)

    @property
    def to_resume(self) -> Todo | None:
        """Task to resume after a pause now; ``None`` if no task is under way or the mission is ending."""
        state = self.state
        if state.resume is not None:
            return state.resume
        if state.phase in (Phase.CANCELLING, Phase.WAITING):
            return None if state.todo in (Todo.IDLE, Todo.FINISH) else state.todo
        return _RESUMES.get(state.phase)

    def release(self) -> None:
        """Go on by itself after a hold, once nothing speaks against it."""
        state = self.state
        if state.phase is Phase.PAUSED and state.held and state.resume is not None and not state.hindrance:
            self.go_on_with(state.resume, "all is well again")

    def go_on_with(self, todo: Todo, reason: str) -> None:
        """End a pause; go home instead if the guard asks for it."""
        home = next((alarm for alarm in self.state.alarms if alarm.response is Response.RETURN), None)
        if home is not None and todo is not Todo.RETURN:
            self.end(MissionEnd.FAILSAFE, f"{reason}, but {home.reason}")
        else:
            self.then(todo, reason)

    # Choosing and driving ------------------------------------------------------------------------------------

    def plan(self, reason: str) -> None:
        """Go to the next stop that was asked for, or request one, if the time left suffices."""
        reason, going = self.take_queued(reason)
        if going:
            return
        left_s = self.leave_by_s() - self.now_s
        if left_s <= self.rules.needed_dwell_s:
            self.end_or_count_on(MissionEnd.TIME_UP, f"{reason}; the time left is too short for another stop")
            return
        state, staying = self.state, self.staying
        samples = state.samples + (staying is not None)
        warm_up = samples < self.rules.warm_up_stops
        request = events.RequestPlan(
            state.plans + 1,
            PlanKind.WARM_UP if warm_up else PlanKind.EXPLORE,
            blacklisted(state),
            left_s,
            self.left_s,
            state.ruled_out,
            "" if staying is None else staying.stop.name,
            state.time_used_s,
            state.certificate,
            state.certified,
            state.good_forecasts >= GOOD_FORECASTS,
        )
        self.do(request)
        plan = PendingPlan(request.plan_id, self.now_s + self.rules.plan_limit_s)
        self.set(plan=plan, plans=plan.plan_id, target=staying)
        number = f"warm-up stop {samples + 1} of {self.rules.warm_up_stops}"
        self.enter(Phase.PLANNING, f"{reason}; choosing {number if warm_up else 'the next stop'}")

    def take_queued(self, reason: str) -> tuple[str, bool]:
        """Go to the first queued stop that fits into the time, and drop those before.

        :returns: the reason with the stops that were dropped, and whether the robot goes to one
        """
        while self.state.queue:
            queued, *rest = self.state.queue
            self.set(queue=tuple(rest))
            travel_s = self.rules.travel_s(self.place, queued.stop.xy)
            if self.fits(queued.stop, travel_s):
                self.settle()
                dwell = parse_dwell(queued.dwell) if queued.dwell else None
                asked = f"requested by {queued.who}"
                target = Target(queued.stop, asked, travel_s, dwell=dwell)
                self.set(plan=None, target=target)
                self.travel(travel_s, f"{reason}; going to {queued.stop.name}: {asked}")
                return reason, True
            reason = f"{reason}; no time for {queued.stop.name}, which {queued.who} requested"
        return reason, False

    def plan_again(self, reason: str) -> None:
        """Choose again under changed terms, while the stop is being chosen or the rest of the time is counted."""
        counting = self.state.counting
        if self.state.phase is Phase.COUNTING and counting is not None and counting.to_the_end:
            counting = replace(counting, met=VisitEnd.ENOUGH, outcome=reason, to_the_end=False)
            self.set(counting=counting)
            self.plan(reason)
        elif self.state.phase is Phase.PLANNING:
            self.plan(reason)

    def needed_s(self, stop: Stop, travel_s: float, home_s: float) -> float:
        return travel_s + self.rules.needed_dwell_s + self.rules.way_home_s(stop.xy, home_s)

    def fits(self, stop: Stop, travel_s: float, home_s: float = 0.0) -> bool:
        return self.needed_s(stop, travel_s, home_s) <= self.left_s and self.now_s < self.leave_by_s()

    @property
    def left_s(self) -> float:
        return self.rules.budget_s - self.state.time_used_s

    def travel(self, travel_s: float, reason: str) -> None:
        """Send the robot to its target, if the time left suffices."""
        target = self.target
        if self.fits(target.stop, travel_s, target.home_s):
            self.send(Phase.TRAVELLING, target.stop, max(travel_s, target.travel_s), reason)
        else:
            needed_s = self.needed_s(target.stop, travel_s, target.home_s)
            reason = f"no time for {target.stop.name}: it needs {needed_s:.0f} s and {self.left_s:.0f} s are left"
            self.end(MissionEnd.TIME_UP, reason)

    def send(self, phase: Phase, stop: Stop, travel_s: float, reason: str) -> None:
        assert self.state.goal is None, "a goal is sent only after the one before has ended"
        limit_s = self.rules.goal_time_factor * travel_s + self.rules.goal_time_margin_s
        goal = Goal(self.state.goals + 1, stop, self.now_s + limit_s)
        self.do(events.GoTo(goal.goal_id, stop, reason))
        self.set(goal=goal, goals=goal.goal_id)
        self.enter(phase, reason)

    def failed_on_way(self, reason: str, refused: bool = False) -> None:
        """The goal has not led to its stop, or home; it has ended or must be cancelled."""
        if self.state.phase is Phase.RETURNING:
            self.return_failed(reason)
            return
        target = replace(self.target, attempts=self.target.attempts + 1)
        if target.attempts <= self.rules.retries and not refused:
            self.set(target=target)
            self.fail(Todo.TRAVEL, f"{target.stop.name} was not reached: {reason}")
        else:
            self.rule_out(target.stop)
            self.set(target=None)
            self.fail(Todo.PLAN, f"{target.stop.name} is ruled out for now: {reason}")

    def return_failed(self, reason: str) -> None:
        """The robot did not get home: retry, or finish where it is."""
        self.set(returns=self.state.returns + 1)
        if self.state.returns <= self.rules.retries:
            self.back_off(self.state.returns)
            self.then(Todo.RETURN, f"home was not reached: {reason}")
        else:
            ending = f"{self.state.ending}; the robot did not get home: {reason}"
            self.set(ending=ending)
            self.then(Todo.FINISH, ending)

    def fail(self, todo: Todo, reason: str) -> None:
        """Continue after a failure, or ask the operator after too many failures."""
        self.settle()
        failures = self.state.failures + 1
        self.set(failures=failures)
        if failures < self.rules.failures_to_pause:
            self.back_off(failures)
            self.then(todo, reason)
        else:
            many = f"{failures} failures since the last sample" if failures > 1 else "failed"
            self.hold(todo, f"{many}: {reason}; check the robot, then resume or abort")

    def back_off(self, failures: int) -> None:
        """Wait before the next attempt, twice as long after each failure in a row."""
        wait_s = min(self.rules.backoff_s * 2.0 ** (failures - 1), self.rules.backoff_limit_s)
        self.set(wait_until_s=self.now_s + wait_s if wait_s > 0 else None)

    def rule_out(self, stop: Stop) -> None:
        """Do not choose a stop for a while."""
        others = (out for out in self.state.blacklist if out.name != stop.name and self.now_s < out.until_s)
        out = RuledOut(stop.name, self.now_s + self.rules.blacklist_s)
        self.set(blacklist=(*others, out))

    def leave_by_s(self) -> float:
        """Time when to set off for home at the latest, from here and from the target."""
        home_s = 0.0 if self.state.target is None else self.state.target.home_s
        return self.started_s + self.rules.budget_s - self.rules.way_home_s(self.place, home_s)

    # Counting -------------------------------------------------------------------------------------------------

    def arrive(self, place: Place | None = None) -> None:
        now_s, sd_m = self.now_s, self.state.position_sd_m
        self.count(OpenVisit(*(place or self.place), arrived_s=now_s, since_s=now_s, heard_s=now_s, sd_m=sd_m))

    def is_close_to(self, stop: Stop) -> bool:
        """True if the fixes of a person who stands at a stop may be where they are."""
        return math.dist(self.place, stop.xy) <= max(self.rules.arrival_radius_m, self.noise_m)

    def stand_at(self, place: Place, goal_id: int) -> None:
        """Measure where a person stands: at the target, or at a stop of their own choice."""
        if not self.is_close_to(self.target.stop):
            self.do(events.CancelGoal(goal_id))  # nothing is learned from this leg
            name = f"x{place[0]:.1f}y{place[1]:.1f}"
            self.set(target=Target(Stop(name, *place), "the person stands here", 0.0))
        self.arrive(place)

    def count(self, counting: OpenVisit) -> None:
        self.set(counting=counting)
        self.enter(Phase.COUNTING, self.counting_reason())
        self.do(events.StartCounting())

    def counting_reason(self) -> str:
        """Reason in the status while counting, with the mission's dwell rule: a stop's rule is not readable."""
        to_the_end = self.state.counting is not None and self.state.counting.to_the_end
        until = "until the time is used up" if to_the_end else str(self.rules.dwell)
        return f"counting at {self.target.stop.name} ({until})"

    @property
    def staying(self) -> Target | None:
        """The stop where the robot stands with its visit open while the next stop is chosen."""
        counting = self.state.counting
        return self.state.target if counting is not None and counting.met is not None else None

    def settle(self) -> None:
        """Close the visit of a stop whose dwell is over, if it is still open."""
        counting = self.state.counting
        if counting is not None and counting.met is not None:
            self.leave_stop(counting.met, counting.outcome)

    def count_on(self, dwell: DwellRule | None, reason: str) -> None:
        """Count on at the stop where the robot stands, in the same visit: the planner has chosen it again.

        :param dwell: its new dwell rule, for what is counted from now on; ``None`` for the mission's
        """
        target, counting = self.target, self.counting
        counting = replace(
            counting, earlier_counts=counting.raw_counts, earlier_s=counting.exposure_s, met=None, outcome=""
        )
        self.set(target=replace(target, dwell=dwell), counting=counting)
        self.enter(Phase.COUNTING, f"counting on at {target.stop.name}{after_colon(reason)}")

    def end_or_count_on(self, code: MissionEnd, reason: str) -> None:
        """Use what is left of the time at the stop where the robot counts; end the mission if it is at none."""
        if self.staying is None:
            self.end(code, reason)
            return
        self.recount(met=None, outcome="", to_the_end=True)
        self.enter(Phase.COUNTING, f"{self.counting_reason()}: {reason}")

    def suspend(self) -> None:
        """Stop counting for the time being."""
        counting = self.state.counting
        if counting is not None:
            self.recount(before_s=counting.dwell_s(self.now_s), since_s=None)

    def count_again(self, reason: str) -> None:
        """Resume counting after a pause, unless the robot was moved in the pause."""
        counting = self.counting
        moved_m = math.dist(self.place, (counting.x_m, counting.y_m))
        if moved_m > self.rules.reach_m(self.target.stop, self.noise_at_stop_m):
            moved = f"{reason}, but the robot was moved by {moved_m:.1f} m in the pause"
            self.leave_stop(VisitEnd.MOVED, moved)
            self.then(Todo.PLAN, moved)
        else:
            self.count(replace(counting, since_s=self.now_s, heard_s=self.now_s, silent=False, away_s=None))

    def complete(self, code: VisitEnd, reason: str) -> None:
        """End counting; a stop without records is a failure."""
        stop = self.target.stop
        if self.leave_stop(code, reason) > 0:
            self.then(Todo.PLAN, f"{stop.name} is done: {reason}")
        else:
            self.rule_out(stop)
            self.fail(Todo.PLAN, f"nothing was counted at {stop.name}: {reason}")

    def leave_stop(self, code: VisitEnd, reason: str) -> int:
        """Close the stop and return the number of its records; a stop with records becomes a visit.

        A dwell that is over keeps its own reason.
        """
        self.suspend()
        target, counting = self.state.target, self.state.counting
        self.set(target=None, counting=None)
        if target is None or counting is None:
            return 0
        if counting.met is not None:
            code, reason = counting.met, counting.outcome
        self.set(counting_s=self.state.counting_s + counting.before_s)
        if counting.records > 0:  # zero is a count, too
            visit = self.visit(target, counting, code, reason)
            certified = (*self.state.certified, visit) if target.certifies else self.state.certified
            self.set(samples=self.state.samples + 1, failures=0, certified=certified)
            self.do(events.VisitDone(visit))
        return counting.records

    def visit(self, target: Target, counting: OpenVisit, code: VisitEnd, reason: str) -> Visit:
        return Visit(
            name=target.stop.name,
            x_m=counting.x_m,
            y_m=counting.y_m,
            arrived_s=counting.arrived_s - self.started_s,
            dwell_s=counting.before_s,
            raw_counts=counting.raw_counts,
            reason=target.reason,
            records=counting.records,
            exposure_s=counting.exposure_s,
            effective_exposure_s=counting.effective_exposure_s,
            ended=code,
            outcome=reason,
            dwell=str(self.rules.dwell),
            arrival_stamp_s=counting.arrived_s + self.state.stamp_offset_s,
            end_stamp_s=self.now_s + self.state.stamp_offset_s,
            stop_x_m=target.stop.x_m,
            stop_y_m=target.stop.y_m,
        )

    # The end -------------------------------------------------------------------------------------------------

    def end(self, code: MissionEnd, reason: str) -> None:
        """Stop measuring: go home if there is a home, then finish."""
        self.leave_stop(_EARLY.get(code, VisitEnd.TIME_UP), reason)
        self.set(ending=reason, ended=code, returns=0, wait_until_s=None)
        self.then(Todo.RETURN, reason)

    def abandon(self, code: MissionEnd, reason: str) -> None:
        """Abort the mission where the robot is, as soon as it has stopped."""
        self.leave_stop(VisitEnd(code), reason)
        self.set(ending=reason, ended=code)
        self.then(Todo.IDLE, reason)

    def go_home(self, reason: str) -> None:
        """Return home and finish; finish at once if there is no home or the robot is there."""
        home = self.rules.home
        if home is None:
            self.finish(self.state.ending)
        elif self.rules.is_at(self.place, home, self.noise_m):
            self.finish(f"{self.state.ending}; the robot is home")
        else:
            self.send(Phase.RETURNING, home, self.rules.travel_s(self.place, home.xy), f"going home: {reason}")

    def finish(self, reason: str, phase: Phase = Phase.FINISHED) -> None:
        """The mission is over, finished or aborted."""
        aborted = phase is Phase.IDLE
        self.set(ended_s=self.now_s)
        self.enter(phase, f"{reason}; {READY}" if aborted else reason)
        # Journals of earlier versions hold no code.
        code = self.state.ended or (MissionEnd.ABORTED if aborted else MissionEnd.TIME_UP)
        self.do(events.Finish(reason, code))

    # Deadlines -----------------------------------------------------------------------------------------------

    def next_deadline(self) -> tuple[float, Callable[[_Step], None] | None]:
        """Time at which the mission acts without an event [s], the first of equals, and what it does then."""
        times = ((time_s(self), act) for time_s, act in DEADLINES.get(self.state.phase, ()))
        return min(times, key=itemgetter(0), default=(math.inf, None))

    @cached_property
    def deadline_s(self) -> float | None:
        """The earliest deadline after the step, ``None`` without deadlines."""
        time_s = self.next_deadline()[0]
        return time_s if time_s < math.inf else None

    def meet_deadlines(self) -> None:
        """Carry out due deadlines, the earliest first; after a gap without events there may be several."""
        for _ in range(_MAX_AT_ONCE):
            time_s, act = self.next_deadline()
            self.deadline_s = time_s if time_s < math.inf else None
            if act is None or time_s > self.now_s:
                break
            act(self)

    def longest_dwell_s(self) -> float:
        """Time when the longest dwell is over [s]; never where the rest of the time is counted."""
        counting = self.counting
        assert counting.since_s is not None
        longest_s = counting.since_s + counting.earlier_s + self.rules.dwell.longest_s - counting.before_s
        return math.inf if counting.to_the_end else longest_s

    def silence_s(self) -> float:
        """Time when the sensor counts as silent [s]; never again once that is reported."""
        return math.inf if self.counting.silent else self.counting.heard_s + self.rules.silence_limit_s

    def end_of_pause_s(self) -> float:
        """Time when the time is up in a pause [s]; never on the way home.

        In a pause that the mission began, the place may be wrong, so it does not decide.
        """
        if self.state.resume in (Todo.RETURN, Todo.FINISH):
            return math.inf
        if self.state.needs_operator or self.state.held:
            return self.started_s + self.rules.budget_s
        return self.leave_by_s()

    def time_up(self) -> None:
        away = self.rules.way_home_s(self.place) > 0
        reason = "the time left is needed for the way home" if away else "the mission time is used up"
        self.end(MissionEnd.TIME_UP, reason)

    def time_up_in_pause(self) -> None:
        """Time is up in a pause: the robot must not move before the operator resumes."""
        reason = "the mission time was used up in a pause"
        if self.rules.way_home_s(self.place) == 0:
            self.end(MissionEnd.TIME_UP, reason)
            return
        self.leave_stop(VisitEnd.TIME_UP, reason)
        self.set(ending=reason, ended=MissionEnd.TIME_UP, returns=0)
        self.hold(Todo.RETURN, f"{reason}: resume to go home, or abort")

    def cancel_late(self) -> None:
        """The navigation did not report the end of a cancelled goal, or the robot is not known to stand."""
        goal, todo, limit_s, stands = self.goal, self.state.todo, self.rules.cancel_limit_s, self.stands
        if stands and todo in (Todo.PAUSE, Todo.IDLE, Todo.FINISH):
            self.set(goal=None)
            cause = f"{self.state.cause} (the end of the goal was not reported in {limit_s:.0f} s){self.unseen}"
            self.carry_out(todo, cause)
            return
        self.do(events.CancelGoal(goal.goal_id))
        goal = replace(goal, cancelled_s=self.now_s, requests=goal.requests + 1)
        self.set(goal=goal)
        unknown = self.state.position_s is None or self.now_s - self.state.position_s > limit_s
        doubt = f"the robot is not known to stand ({'its place is not known' if unknown else 'it still moves'})"
        remedy = ""
        if stands:  # the navigation may still send it on
            doubt = f"the navigation has not reported the end of the goal to {goal.stop.name}"
            remedy = "; cancel it there or start the navigation again, or pause or abort here"
        self.enter(Phase.CANCELLING, f"{self.state.cause}; {doubt}: asked {goal.requests} times to stop{remedy}")

    def dwell_late(self) -> None:
        self.complete(VisitEnd.MAX_DWELL, f"the longest dwell of {self.rules.dwell.longest_s:.0f} s is over")

    def silence(self) -> None:
        """Say that no record comes; the wait ends with the dwell rule's longest time, or by the failsafes."""
        limit_s = self.rules.silence_limit_s
        reason = f"no record from this stop for {limit_s:.0f} s: check the logger and the position; still waiting"
        self.set(counting=replace(self.counting, silent=True), reason=reason)


# The tables --------------------------------------------------------------------------------------------------

ALWAYS: Final[dict[type[events.Event], Callable[[_Step, Any], None]]] = {
    events.RecordArrived: _Step.record_arrived,
    events.Moved: _Step.locate,
    events.GoalReached: lambda step, e: step.locate(
        events.Moved(e.now_s, e.x_m, e.y_m, None, step.state.unseen_mps, step.state.position_sd_m)
    ),
    events.Command: lambda step, e: step.do(events.Answer(*COMMANDS[e.verb](step, e))),
    Alarm: _Step.alarm,
    events.AlarmOver: _Step.alarm_over,
    events.EmergencyStop: _Step.emergency,
    events.ClockStarted: lambda step, e: step.set(boot=e.boot, steady_offset_s=e.offset_s),
    events.ClockStepped: lambda step, e: step.set(stamp_offset_s=step.state.stamp_offset_s + e.step_s),
}
"""Handlers of events in every phase; a :class:`Tick` only meets deadlines."""

IN_PHASE: Final[dict[tuple[type[events.Event], Phase], Callable[[_Step, Any], None]]] = {
    (events.Planned, Phase.PLANNING): _Step.planned,
    (events.PlanFailed, Phase.PLANNING): lambda step, e: step.fail(Todo.PLAN, f"planning failed: {e.reason}"),
    (events.GoalReached, Phase.TRAVELLING): _Step.goal_reached,
    (events.GoalReached, Phase.RETURNING): _Step.goal_reached,
    (events.GoalReached, Phase.CANCELLING): _Step.goal_over,
    (events.GoalFailed, Phase.TRAVELLING): _Step.goal_failed,
    (events.GoalFailed, Phase.RETURNING): _Step.goal_failed,
    (events.GoalFailed, Phase.CANCELLING): _Step.goal_over,
}
"""Further handlers of answers to plan requests and goals, in the phase that waits for them."""

COMMANDS: Final[dict[Verb, Callable[[_Step, events.Command], Done]]] = {
    Verb.START: _Step.start,
    Verb.PAUSE: _Step.pause,
    Verb.RESUME: _Step.resume,
    Verb.ABORT: _Step.abort,
    Verb.SKIP: _Step.skip,
    Verb.MEASURE: _Step.measure,
    Verb.RULE_OUT: _Step.rule_out_area,
    Verb.LIFT: _Step.lift_area,
    Verb.ORDER: _Step.order,
    Verb.CHANGE: _Step.change,
    Verb.RETURN: _Step.return_home,
}
"""Handlers of operators' commands, by their verb."""

_Deadline = tuple[Callable[[_Step], float], Callable[[_Step], None]]
"""A time when a mission acts without an event [s], and what it does then."""
_GOAL_LATE: Final[_Deadline] = (
    lambda step: step.goal.deadline_s,
    lambda step: step.failed_on_way("it took too long"),
)
DEADLINES: Final[dict[Phase, tuple[_Deadline, ...]]] = {
    Phase.PLANNING: (
        (_Step.leave_by_s, _Step.time_up),
        (
            lambda step: step.state.plan.deadline_s if step.state.plan else math.inf,
            lambda step: step.fail(Todo.PLAN, f"no plan within {step.rules.plan_limit_s:.0f} s"),
        ),
    ),
    Phase.TRAVELLING: ((_Step.leave_by_s, _Step.time_up), _GOAL_LATE),
    Phase.COUNTING: (
        (_Step.leave_by_s, _Step.time_up),
        (_Step.longest_dwell_s, _Step.dwell_late),
        (_Step.silence_s, _Step.silence),
    ),
    Phase.WAITING: (
        (lambda step: math.inf if step.state.todo is Todo.RETURN else step.leave_by_s(), _Step.time_up),
        (
            lambda step: math.inf if step.state.wait_until_s is None else step.state.wait_until_s,
            lambda step: step.carry_out(step.state.todo or Todo.PLAN, step.state.cause),
        ),
    ),
    Phase.CANCELLING: (
        (lambda step: (step.goal.cancelled_s or 0.0) + step.rules.cancel_limit_s, _Step.cancel_late),
    ),
    Phase.PAUSED: ((_Step.end_of_pause_s, _Step.time_up_in_pause),),
    Phase.RETURNING: (_GOAL_LATE,),
}
"""The deadlines of each phase."""

_KEPT: Final = (
    "now_s", "position", "position_s", "position_sd_m", "still_at", "still_since_s", "unseen_mps",
    "stamp_offset_s", "boot", "steady_offset_s", "alarms", "ruled_out", "changes", "plans", "goals",
    "last_stamp_s",
)  # fmt: skip
"""Fields of the state that a new mission takes over from the mission before."""


def satisfied(rules: MissionRules, forecast: Forecast, samples: int) -> tuple[MissionEnd, str] | None:
    """Reason why a mission may end by a forecast, as code and in words; ``None`` if it goes on."""
    if forecast.is_decided:
        return MissionEnd.GOOD_ENOUGH, f"the decision is made: {forecast.wrong_text}"
    if rules.until is None and 0 < rules.until_sd >= forecast.sd:
        limit = f"{100 * rules.until_sd:.3g} {forecast.unit}"
        return MissionEnd.GOOD_ENOUGH, f"the map is good enough: ±{100 * forecast.sd:.3g} of {limit} demanded"
    reaching = forecast.reaching if rules.until is not None and samples >= MIN_GOOD_SAMPLES else None
    if reaching is not None and reaching.is_met:
        return MissionEnd.GOOD_ENOUGH, f"the map is good enough: {reaching.met_text}"
    if rules.until_gain <= 0 or forecast.is_guess or 100 * forecast.gain >= rules.until_gain:
        return None
    return (
        MissionEnd.LITTLE_GAIN,
        f"little is to be gained: in {SOON_S / 60:.0f} min the map would become "
        f"{100 * forecast.gain:.2g} % better, less than the {rules.until_gain:g} % demanded",
    )


def after_colon(reason: str) -> str:
    """A reason to add to a text; nothing if it is empty."""
    return f": {reason}" if reason else ""


def _plain(value: Any) -> str:
    """A new value in words."""
    if isinstance(value, Stop):
        return value.name
    return ", ".join(value) or "none" if isinstance(value, tuple) else str(value)
