# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a mission does without an event: the time is up, or somebody is late."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from operator import itemgetter

from soilmoist_ros.exploration.mission.actions import CancelGoal
from soilmoist_ros.exploration.mission.moves import Moves
from soilmoist_ros.exploration.mission.state import Todo, replace
from soilmoist_ros.exploration.mission.types import MissionEnd, OnSilence, Phase
from soilmoist_ros.exploration.mission.visit import VisitEnd

_MAX_AT_ONCE = 10
"""Maximum number of deadlines per step; more are due only if limits are below the resolution of the clock."""


class Deadlines(Moves):
    """The part of a step that deals with deadlines."""

    def deadlines(self) -> list[tuple[float, Callable[[], None]]]:
        """Times at which the mission acts without an event, and the action."""
        state, rules, goal, counting = self.state, self.rules, self.state.goal, self.state.counting
        match state.phase:
            case Phase.COUNTING:  # the phase of nearly all steps
                assert counting is not None
                assert counting.since_s is not None
                longest_s = counting.since_s + counting.earlier_s + rules.dwell.longest_s - counting.before_s
                times = [(self.leave_by_s(), self.time_up)]
                if not counting.to_the_end:
                    times.append((longest_s, self.dwell_late))
                if not counting.silent:
                    times.append((counting.heard_s + rules.silence_limit_s, self.silence))
                return times
            case Phase.PLANNING:
                assert state.plan is not None
                return [(self.leave_by_s(), self.time_up), (state.plan.deadline_s, self.plan_late)]
            case Phase.TRAVELLING:
                assert goal is not None
                return [(self.leave_by_s(), self.time_up), (goal.deadline_s, self.goal_late)]
            case Phase.PAUSED if state.resume is not Todo.RETURN and state.resume is not Todo.FINISH:
                return [(self.end_of_pause_s(), self.time_up_in_pause)]
            case Phase.CANCELLING:
                assert goal is not None
                assert goal.cancelled_s is not None
                return [(goal.cancelled_s + rules.cancel_limit_s, self.cancel_late)]
            case Phase.WAITING:
                assert state.wait_until_s is not None
                times = [(state.wait_until_s, self.waited)]
                return times if state.todo is Todo.RETURN else [(self.leave_by_s(), self.time_up), *times]
            case Phase.RETURNING:
                assert goal is not None
                return [(goal.deadline_s, self.goal_late)]
            case _:
                return []

    @cached_property
    def deadline_s(self) -> float | None:
        """The earliest deadline after the step, ``None`` without deadlines."""
        return min((time_s for time_s, _ in self.deadlines()), default=None)

    def meet_deadlines(self) -> None:
        """Carry out due deadlines, the earliest first; after a gap without events there may be several."""
        for _ in range(_MAX_AT_ONCE):
            self.deadline_s, act = min(self.deadlines(), key=itemgetter(0), default=(None, None))
            if self.deadline_s is None or act is None or self.deadline_s > self.now_s:
                break
            act()

    def time_up(self) -> None:
        """Only the time for the way home is left."""
        away = self.rules.way_home_s(self.place) > 0
        reason = "the time left is needed for the way home" if away else "the mission time is used up"
        self.end(MissionEnd.TIME_UP, reason)

    def end_of_pause_s(self) -> float:
        """When the time is up in a pause [s].

        In a pause that the mission began, the place may be wrong, so it does not decide.
        """
        assert self.state.started_s is not None
        if self.state.needs_operator or self.state.held:
            return self.state.started_s + self.rules.budget_s
        return self.leave_by_s()

    def time_up_in_pause(self) -> None:
        """Time is up in a pause: the robot must not move before the operator resumes."""
        reason = "the mission time was used up in a pause"
        if self.rules.way_home_s(self.place) == 0:
            self.end(MissionEnd.TIME_UP, reason)
            return
        self.leave_stop(VisitEnd.TIME_UP, reason)
        self.state = replace(self.state, ending=reason, ended=MissionEnd.TIME_UP, returns=0)
        self.hold(Todo.RETURN, f"{reason}: resume to go home, or abort")

    def plan_late(self) -> None:
        """The planner did not answer in time."""
        self.fail(Todo.PLAN, f"no plan within {self.rules.plan_limit_s:.0f} s")

    def goal_late(self) -> None:
        """The robot did not arrive in time."""
        self.goal_failed("it took too long")

    def waited(self) -> None:
        """The wait after a failure is over."""
        todo = self.state.todo
        assert todo is not None
        self.carry_out(todo, self.state.cause)

    def cancel_late(self) -> None:
        """The navigation did not report the end of a cancelled goal, or the robot is not known to stand."""
        goal, todo, limit_s = self.state.goal, self.state.todo, self.rules.cancel_limit_s
        assert goal is not None
        assert todo is not None
        stands = self.stands
        if stands and todo in (Todo.PAUSE, Todo.IDLE, Todo.FINISH):
            self.state = replace(self.state, goal=None)
            cause = f"{self.state.cause} (the end of the goal was not reported in {limit_s:.0f} s){self.unseen}"
            self.carry_out(todo, cause)
            return
        self.do(CancelGoal(goal.goal_id, self.state.cause))
        goal = replace(goal, cancelled_s=self.now_s, requests=goal.requests + 1)
        self.state = replace(self.state, goal=goal)
        unknown = self.state.position_s is None or self.now_s - self.state.position_s > limit_s
        doubt = f"the robot is not known to stand ({'its place is not known' if unknown else 'it still moves'})"
        remedy = ""
        if stands:  # the navigation may still send it on
            doubt = f"the navigation has not reported the end of the goal to {goal.stop.name}"
            remedy = "; cancel it there or start the navigation again, or pause or abort here"
        self.enter(Phase.CANCELLING, f"{self.state.cause}; {doubt}: asked {goal.requests} times to stop{remedy}")

    def dwell_late(self) -> None:
        """The dwell rule did not end counting in time."""
        self.complete(VisitEnd.MAX_DWELL, f"the longest dwell of {self.rules.dwell.longest_s:.0f} s is over")

    def silence(self) -> None:
        """No record counted for this stop for some time."""
        limit_s = self.rules.silence_limit_s
        reason = f"no record from this stop for {limit_s:.0f} s: check the logger and the position"
        match self.rules.on_silence:
            case OnSilence.WAIT:
                assert self.state.counting is not None
                counting = replace(self.state.counting, silent=True)
                self.state = replace(self.state, counting=counting, reason=f"{reason}; still waiting")
            case OnSilence.PAUSE:
                self.hold(Todo.COUNT, f"{reason}; then resume or abort")
            case OnSilence.ABORT:
                self.abandon(MissionEnd.SILENT_SENSOR, reason)
