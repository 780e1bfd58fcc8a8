# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a mission can do in one step: send and cancel goals, count, plan, go home, and end."""

from __future__ import annotations

import math
from typing import assert_never

from soilmoist_ros.exploration.mission.actions import (
    Action,
    CancelGoal,
    Finish,
    GoTo,
    RequestPlan,
    Save,
    StartCounting,
    StopCounting,
    VisitDone,
)
from soilmoist_ros.exploration.mission.state import (
    Counting,
    Goal,
    MissionState,
    PendingPlan,
    RuledOut,
    Target,
    Todo,
    blacklisted,
    changed_rules,
    dwell_rule,
    raw_rate,
    replace,
)
from soilmoist_ros.exploration.mission.types import READY, MissionEnd, MissionRules, Phase, PlanKind, Response
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.exploration.planning.dwell import DwellRule, parse_dwell
from soilmoist_ros.exploration.travel.stop import Stop

_RESUMES = {
    Phase.PLANNING: Todo.PLAN,
    Phase.TRAVELLING: Todo.TRAVEL,
    Phase.COUNTING: Todo.COUNT,
    Phase.RETURNING: Todo.RETURN,
}
"""What to go on with after a pause."""
SDS = 3.0
"""Errors of positions up to this many standard deviations are noise."""
SATISFIED = (MissionEnd.GOOD_ENOUGH, MissionEnd.LITTLE_GAIN, MissionEnd.NOTHING_VARIES)
"""Ends of a mission whose map is as good as demanded, or would not become much better."""


class Moves:
    """One step: the state so far, the requested actions, and the possible moves.

    :param rules: rules of the mission
    :param state: the state at the time of the step

    Attributes
    ----------
    now_s : float
        time of this step [s], NaN before the first
    """

    def __init__(self, rules: MissionRules, state: MissionState) -> None:
        self.rules = rules if state.changes is None else changed_rules(rules, state.changes)
        self.given_rules = rules
        self.state = state
        self.now_s = math.nan if state.now_s is None else state.now_s
        self.actions: list[Action] = []

    def do(self, action: Action) -> None:
        """Ask for an action."""
        self.actions.append(action)

    @property
    def place(self) -> tuple[float, float]:
        """Where the robot is [m]."""
        assert self.state.position is not None, "a mission does not start without a position"
        return self.state.position

    @property
    def noise_m(self) -> float:
        """Error that the robot's position may have [m]."""
        return SDS * self.state.position_sd_m

    def noise_at_stop_m(self, counting: Counting) -> float:
        """Distance between the robot's position and that of its arrival which noise explains [m]."""
        return SDS * math.hypot(self.state.position_sd_m, counting.sd_m)

    # What may follow -----------------------------------------------------------------------------------------

    def enter(self, phase: Phase, reason: str) -> None:
        """Change the phase, and clear the data of other phases."""
        state = self.state
        paused = phase is Phase.PAUSED or (phase is Phase.CANCELLING and state.todo is Todo.PAUSE)
        waits = phase in (Phase.CANCELLING, Phase.WAITING)
        self.state = replace(
            state,
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
            self.do(CancelGoal(goal.goal_id, reason))
            goal = replace(goal, cancelled_s=self.now_s, requests=1)
        self.state = replace(self.state, goal=goal, todo=todo, cause=reason)
        self.enter(Phase.CANCELLING, f"{reason}; waiting for the robot to stop")

    @property
    def stands(self) -> bool:
        """Whether places reported after the cancellation show that the robot stands still."""
        state, goal = self.state, self.state.goal
        assert goal is not None
        assert goal.cancelled_s is not None
        if self.rules.standstill_s == 0:
            return True
        return self.seen_standing and state.position_s is not None and state.position_s > goal.cancelled_s

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
            self.state = replace(self.state, goal=None)
            self.carry_out(todo, cause + self.unseen)

    @property
    def unseen(self) -> str:
        """Speed below which the noise hides a motion, to add to a text; empty if it hides none."""
        mps = self.state.unseen_mps
        return f" (a motion below {mps:.1g} m/s would not show in the noise of the fixes)" if mps else ""

    def carry_out(self, todo: Todo, reason: str) -> None:
        """Carry out a todo, or wait with a new attempt; no goal is open now."""
        wait_until_s = self.state.wait_until_s
        self.state = replace(self.state, wait_until_s=None)
        attempts = (Todo.PLAN, Todo.TRAVEL, Todo.RETURN)
        if wait_until_s is not None and self.now_s < wait_until_s and todo in attempts:
            self.state = replace(self.state, wait_until_s=wait_until_s, todo=todo, cause=reason)
            self.enter(Phase.WAITING, f"{reason}; trying again in {wait_until_s - self.now_s:.0f} s")
            return
        match todo:
            case Todo.PLAN:
                self.plan(reason)
            case Todo.TRAVEL:
                target = self.state.target
                assert target is not None
                travel_s = self.rules.travel_s(self.place, xy(target.stop))
                self.travel(travel_s, f"going to {target.stop.name} again: {reason}")
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

    def plan(self, reason: str) -> None:
        """Go to the next stop that was asked for, or request one, if the time left suffices."""
        reason, going = self.take_queued(reason)
        if going:
            return
        left_s = self.leave_by_s() - self.now_s
        if left_s <= self.rules.needed_dwell_s:
            self.end_or_count_on(MissionEnd.TIME_UP, f"{reason}; the time left is too short for another stop")
            return
        staying = self.staying
        samples = self.state.samples + (staying is not None)
        warm_up = samples < self.rules.warm_up_stops
        kind = PlanKind.WARM_UP if warm_up else PlanKind.EXPLORE
        plan_id = self.state.plans + 1
        budget_left_s = self.left_s
        out, areas = blacklisted(self.state), self.state.ruled_out
        at = "" if staying is None else staying.stop.name
        self.do(RequestPlan(plan_id, kind, out, left_s, budget_left_s, areas, at, self.state.time_used_s))
        plan = PendingPlan(plan_id, self.now_s + self.rules.plan_limit_s)
        self.state = replace(self.state, plan=plan, plans=plan_id, target=staying)
        number = f"warm-up stop {samples + 1} of {self.rules.warm_up_stops}"
        self.enter(Phase.PLANNING, f"{reason}; choosing {number if warm_up else 'the next stop'}")

    def take_queued(self, reason: str) -> tuple[str, bool]:
        """Go to the first queued stop that fits into the time, and drop those before.

        :returns: the reason with the stops that were dropped, and whether the robot goes to one
        """
        while self.state.queue:
            queued, *rest = self.state.queue
            self.state = replace(self.state, queue=tuple(rest))
            travel_s = self.rules.travel_s(self.place, xy(queued.stop))
            if self.fits(queued.stop, travel_s):
                self.settle()
                dwell = parse_dwell(queued.dwell) if queued.dwell else None
                asked = f"requested by {queued.who}"
                self.state = replace(
                    self.state, plan=None, target=Target(queued.stop, asked, travel_s, dwell=dwell)
                )
                self.travel(travel_s, f"{reason}; going to {queued.stop.name}: {asked}")
                return reason, True
            reason = f"{reason}; no time for {queued.stop.name}, which {queued.who} requested"
        return reason, False

    def fits(self, stop: Stop, travel_s: float, home_s: float = 0.0) -> bool:
        """Whether the time left suffices for a stop and the way home from it."""
        needed_s = travel_s + self.rules.needed_dwell_s + self.rules.way_home_s(xy(stop), home_s)
        return needed_s <= self.left_s and self.now_s < self.leave_by_s()

    @property
    def left_s(self) -> float:
        """Rest of the budget [s]."""
        return self.rules.budget_s - self.state.time_used_s

    def travel(self, travel_s: float, reason: str) -> None:
        """Send the robot to its target, if the time left suffices."""
        target = self.state.target
        assert target is not None
        needed_s = travel_s + self.rules.needed_dwell_s + self.rules.way_home_s(xy(target.stop), target.home_s)
        left_s = self.left_s
        if self.fits(target.stop, travel_s, target.home_s):
            self.send(Phase.TRAVELLING, target.stop, max(travel_s, target.travel_s), reason)
        else:
            reason = f"no time for {target.stop.name}: it needs {needed_s:.0f} s and {left_s:.0f} s are left"
            self.end(MissionEnd.TIME_UP, reason)

    def send(self, phase: Phase, stop: Stop, travel_s: float, reason: str) -> None:
        """Send the robot somewhere."""
        assert self.state.goal is None, "a goal is sent only after the one before has ended"
        limit_s = self.rules.goal_time_factor * travel_s + self.rules.goal_time_margin_s
        goal = Goal(self.state.goals + 1, stop, self.now_s + limit_s)
        self.do(GoTo(goal.goal_id, stop, reason, travel_s))
        self.state = replace(self.state, goal=goal, goals=goal.goal_id)
        self.enter(phase, reason)

    def goal_failed(self, reason: str, refused: bool = False) -> None:
        """The current goal has not led to its stop; it has ended or must be cancelled."""
        if self.state.phase is Phase.RETURNING:
            self.return_failed(reason)
        else:
            self.travel_failed(reason, refused)

    def travel_failed(self, reason: str, refused: bool = False) -> None:
        """The robot did not reach its stop: retry unless it was refused, or rule the stop out."""
        target = self.state.target
        assert target is not None
        target = replace(target, attempts=target.attempts + 1)
        if target.attempts <= self.rules.retries and not refused:
            self.state = replace(self.state, target=target)
            self.fail(Todo.TRAVEL, f"{target.stop.name} was not reached: {reason}")
        else:
            self.rule_out(target.stop)
            self.state = replace(self.state, target=None)
            self.fail(Todo.PLAN, f"{target.stop.name} is ruled out for now: {reason}")

    def return_failed(self, reason: str) -> None:
        """The robot did not get home: retry, or finish where it is."""
        self.state = replace(self.state, returns=self.state.returns + 1)
        if self.state.returns <= self.rules.retries:
            self.back_off(self.state.returns)
            self.then(Todo.RETURN, f"home was not reached: {reason}")
        else:
            ending = f"{self.state.ending}; the robot did not get home: {reason}"
            self.state = replace(self.state, ending=ending)
            self.then(Todo.FINISH, ending)

    def fail(self, todo: Todo, reason: str) -> None:
        """Continue after a failure, or ask the operator after too many failures."""
        self.settle()
        self.state = replace(self.state, failures=self.state.failures + 1)
        if self.state.failures < self.rules.failures_to_pause:
            self.back_off(self.state.failures)
            self.then(todo, reason)
        else:
            many = f"{self.state.failures} failures since the last sample" if self.state.failures > 1 else "failed"
            self.hold(todo, f"{many}: {reason}; check the robot, then resume or abort")

    def back_off(self, failures: int) -> None:
        """Wait before the next attempt, twice as long after each failure in a row."""
        wait_s = min(self.rules.backoff_s * 2.0 ** (failures - 1), self.rules.backoff_limit_s)
        self.state = replace(self.state, wait_until_s=self.now_s + wait_s if wait_s > 0 else None)

    def hold(self, resume: Todo, reason: str, needs_operator: bool = True, held: bool = False) -> None:
        """Pause: stop the robot, and store what to resume."""
        self.settle()
        self.suspend(reason)
        self.state = replace(
            self.state,
            resume=resume,
            needs_operator=needs_operator,
            held=held,
            interrupted=False,
            wait_until_s=None,
        )
        self.then(Todo.PAUSE, reason)

    @property
    def to_resume(self) -> Todo | None:
        """What a pause would interrupt; ``None`` if nothing is under way or the mission is being ended."""
        state = self.state
        if state.resume is not None:
            return state.resume
        if state.phase in (Phase.CANCELLING, Phase.WAITING):
            ending = (Todo.IDLE, Todo.FINISH)
            return None if state.todo in ending else state.todo
        return _RESUMES.get(state.phase)

    def release(self) -> None:
        """Go on by itself after a hold, once nothing speaks against it."""
        resume = self.state.resume
        if (
            self.state.phase is Phase.PAUSED
            and self.state.held
            and resume is not None
            and not self.state.hindrance
        ):
            self.go_on_with(resume, "all is well again")

    def go_on_with(self, todo: Todo, reason: str) -> None:
        """End a pause; go home instead if the guard asks for it."""
        home = next((alarm for alarm in self.state.alarms if alarm.response is Response.RETURN), None)
        if home is not None and todo is not Todo.RETURN:
            self.end(MissionEnd.FAILSAFE, f"{reason}, but {home.reason}")
        else:
            self.then(todo, reason)

    def rule_out(self, stop: Stop) -> None:
        """Do not choose a stop for a while."""
        others = (out for out in self.state.blacklist if out.name != stop.name and self.now_s < out.until_s)
        out = RuledOut(stop.name, self.now_s + self.rules.blacklist_s)
        self.state = replace(self.state, blacklist=(*others, out))

    def end(self, code: MissionEnd, reason: str) -> None:
        """Stop measuring: go home if there is a home, then finish."""
        early = {
            MissionEnd.RETURNED: VisitEnd.RETURNED,
            MissionEnd.FAILSAFE: VisitEnd.FAILSAFE,
            **dict.fromkeys(SATISFIED, VisitEnd.ENOUGH),
        }
        self.leave_stop(early.get(code, VisitEnd.TIME_UP), reason)
        self.state = replace(self.state, ending=reason, ended=code, returns=0, wait_until_s=None)
        self.then(Todo.RETURN, reason)

    def abandon(self, code: MissionEnd, reason: str) -> None:
        """Abort the mission where the robot is, as soon as it has stopped."""
        self.leave_stop(VisitEnd(code), reason)
        self.state = replace(self.state, ending=reason, ended=code)
        self.then(Todo.IDLE, reason)

    def go_home(self, reason: str) -> None:
        """Return home and finish; finish at once if there is no home or the robot is there."""
        home = self.rules.home
        if home is None:
            self.finish(self.state.ending)
        elif self.rules.is_at(self.place, home, self.noise_m):
            self.finish(f"{self.state.ending}; the robot is home")
        else:
            travel_s = self.rules.travel_s(self.place, xy(home))
            self.send(Phase.RETURNING, home, travel_s, f"going home: {reason}")

    def finish(self, reason: str, phase: Phase = Phase.FINISHED) -> None:
        """The mission is over, finished or aborted."""
        aborted = phase is Phase.IDLE
        self.state = replace(self.state, ended_s=self.now_s)
        self.enter(phase, f"{reason}; {READY}" if aborted else reason)
        self.do(Save(reason))
        # Journals of earlier versions hold no code.
        code = self.state.ended or (MissionEnd.ABORTED if aborted else MissionEnd.TIME_UP)
        self.do(Finish(reason, code))

    # Counting ------------------------------------------------------------------------------------------------

    @property
    def dwell_name(self) -> str:
        """The mission's dwell rule; the rule of a single stop is not readable for people."""
        return str(self.rules.dwell)

    def counting_reason(self) -> str:
        """What the status says while counting."""
        assert self.state.target is not None
        until = self.dwell_name
        if self.state.counting is not None and self.state.counting.to_the_end:
            until = "until the time is used up"
        return f"counting at {self.state.target.stop.name} ({until})"

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
        target, counting = self.state.target, self.state.counting
        assert target is not None
        assert counting is not None
        counting = replace(
            counting, earlier_counts=counting.raw_counts, earlier_s=counting.exposure_s, met=None, outcome=""
        )
        self.state = replace(self.state, target=replace(target, dwell=dwell), counting=counting)
        self.enter(Phase.COUNTING, f"counting on at {target.stop.name}{after_colon(reason)}")

    def end_or_count_on(self, code: MissionEnd, reason: str) -> None:
        """Use what is left of the time at the stop where the robot counts; end the mission if it is at none."""
        target, counting = self.staying, self.state.counting
        if target is None or counting is None:
            self.end(code, reason)
            return
        self.state = replace(self.state, counting=replace(counting, met=None, outcome="", to_the_end=True))
        self.enter(Phase.COUNTING, f"{self.counting_reason()}: {reason}")

    def plan_again(self, reason: str) -> None:
        """Choose again under changed terms, while the stop is being chosen or the rest of the time is counted."""
        counting = self.state.counting
        if self.state.phase is Phase.COUNTING and counting is not None and counting.to_the_end:
            counting = replace(counting, met=VisitEnd.ENOUGH, outcome=reason, to_the_end=False)
            self.state = replace(self.state, counting=counting)
            self.plan(reason)
        elif self.state.phase is Phase.PLANNING:
            self.plan(reason)

    def count(self, counting: Counting) -> None:
        """Count from now on."""
        target = self.state.target
        assert target is not None
        self.state = replace(self.state, counting=counting)
        self.enter(Phase.COUNTING, self.counting_reason())
        expected_s = dwell_rule(self.rules, self.state).expected_s(raw_rate(self.state))
        self.do(StartCounting(target.stop, self.dwell_name, expected_s))

    def suspend(self, reason: str) -> None:
        """Stop counting for the time being."""
        counting = self.state.counting
        if counting is not None and counting.since_s is not None:
            self.do(StopCounting(reason))
            before_s = counting.dwell_s(self.now_s)
            self.state = replace(self.state, counting=replace(counting, before_s=before_s, since_s=None))

    def count_again(self, reason: str) -> None:
        """Resume counting after a pause, unless the robot was moved in the pause."""
        counting = self.state.counting
        assert counting is not None
        moved_m = math.dist(self.place, (counting.x_m, counting.y_m))
        assert self.state.target is not None
        if moved_m > self.rules.reach_m(self.state.target.stop, self.noise_at_stop_m(counting)):
            moved = f"{reason}, but the robot was moved by {moved_m:.1f} m in the pause"
            self.leave_stop(VisitEnd.MOVED, moved)
            self.then(Todo.PLAN, moved)
        else:
            self.count(replace(counting, since_s=self.now_s, heard_s=self.now_s, silent=False, away_s=None))

    def leave_stop(self, code: VisitEnd, reason: str) -> int:
        """Close the stop and return the number of its records; a stop with records becomes a visit.

        A dwell that is over keeps its own reason.
        """
        self.suspend(reason)
        target, counting = self.state.target, self.state.counting
        self.state = replace(self.state, target=None, counting=None)
        if target is None or counting is None:
            return 0
        if counting.met is not None:
            code, reason = counting.met, counting.outcome
        self.state = replace(self.state, counting_s=self.state.counting_s + counting.before_s)
        if counting.records > 0:  # zero is a count, too
            self.state = replace(self.state, samples=self.state.samples + 1, failures=0)
            self.do(VisitDone(self.visit(target, counting, code, reason)))
        return counting.records

    def visit(self, target: Target, counting: Counting, code: VisitEnd, reason: str) -> Visit:
        """The visit of a stop."""
        assert self.state.started_s is not None
        return Visit(
            name=target.stop.name,
            x_m=counting.x_m,
            y_m=counting.y_m,
            arrived_s=counting.arrived_s - self.state.started_s,
            dwell_s=counting.before_s,
            raw_counts=counting.raw_counts,
            reason=target.reason,
            records=counting.records,
            exposure_s=counting.exposure_s,
            effective_exposure_s=counting.effective_exposure_s,
            ended=code,
            outcome=reason,
            dwell=self.dwell_name,
            arrival_stamp_s=counting.arrived_s + self.state.stamp_offset_s,
            end_stamp_s=self.now_s + self.state.stamp_offset_s,
            stop_x_m=target.stop.x_m,
            stop_y_m=target.stop.y_m,
        )

    def complete(self, code: VisitEnd, reason: str) -> None:
        """End counting; a stop without records is a failure."""
        assert self.state.target is not None
        stop = self.state.target.stop
        if self.leave_stop(code, reason) > 0:
            self.then(Todo.PLAN, f"{stop.name} is done: {reason}")
        else:
            self.rule_out(stop)
            self.fail(Todo.PLAN, f"nothing was counted at {stop.name}: {reason}")

    def dwell_is_over(self, code: VisitEnd, reason: str) -> None:
        """The dwell rule is met: choose the next stop, with the visit open where the rules say so."""
        target, counting = self.state.target, self.state.counting
        assert target is not None
        assert counting is not None
        if self.rules.stays:
            self.state = replace(self.state, counting=replace(counting, met=code, outcome=reason))
            self.then(Todo.PLAN, f"{target.stop.name} is done: {reason}")
        else:
            self.complete(code, reason)

    # Time ----------------------------------------------------------------------------------------------------

    def leave_by_s(self) -> float:
        """When to set off for home at the latest, from here and from the target."""
        assert self.state.started_s is not None
        home_s = 0.0 if self.state.target is None else self.state.target.home_s
        return self.state.started_s + self.rules.budget_s - self.rules.way_home_s(self.place, home_s)


def xy(stop: Stop) -> tuple[float, float]:
    """Place of a stop [m]."""
    return stop.x_m, stop.y_m


def after_colon(reason: str) -> str:
    """A reason to add to a text; nothing if it is empty."""
    return f": {reason}" if reason else ""
