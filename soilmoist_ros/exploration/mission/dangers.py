# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a mission does about alarms of the guard, and about an emergency stop."""

from __future__ import annotations

from soilmoist_ros.exploration.mission.actions import ANYBODYS, CancelGoal
from soilmoist_ros.exploration.mission.moves import Moves, after_colon
from soilmoist_ros.exploration.mission.state import Todo, replace
from soilmoist_ros.exploration.mission.types import MOVING, Alarm, MissionEnd, Phase, Response


class Dangers(Moves):
    """One step: what the guard or an emergency stop sets off."""

    def alarm(self, alarm: Alarm) -> None:
        """The guard has found a danger."""
        others = tuple(other for other in self.state.alarms if other.cause != alarm.cause)
        known = next((other for other in self.state.alarms if other.cause == alarm.cause), None)
        if alarm.response is Response.IGNORE:
            self.state = replace(self.state, alarms=others)
            return
        self.state = replace(self.state, alarms=(*others, alarm))
        goal = self.state.goal
        if alarm.cause == MOVING and alarm.response.stops and (goal is None or goal.over):
            self.do(CancelGoal(ANYBODYS, alarm.reason))  # again with each alarm: nothing else tells it to stop
        if self.state.under_way and (known is None or known.response is not alarm.response):
            self.respond(alarm)

    def respond(self, alarm: Alarm) -> None:
        """Do what a danger demands."""
        state, reason, resume = self.state, alarm.reason, self.to_resume
        paused = state.phase is Phase.PAUSED or state.todo is Todo.PAUSE
        match alarm.response:
            case Response.PAUSE if resume is not None:
                self.hold(resume, f"{reason}; check the robot, then resume or abort")
            case Response.HOLD if resume is not None and not paused:
                self.hold(resume, f"{reason}; going on when that is over", needs_operator=False, held=True)
            case Response.RETURN if resume is not None and resume is not Todo.RETURN and not paused:
                self.end(MissionEnd.FAILSAFE, reason)
            case Response.ABORT if resume is not None:
                self.abandon(MissionEnd.FAILSAFE, reason)

    def alarm_over(self, cause: str) -> None:
        """A danger is over."""
        self.state = replace(
            self.state, alarms=tuple(alarm for alarm in self.state.alarms if alarm.cause != cause)
        )
        self.release()

    def emergency(self, active: bool, source: str) -> None:
        """Stop at once and stay, whatever the mission is doing; a release only ends the reason."""
        others = tuple(other for other in self.state.emergency if other != source)
        self.state = replace(self.state, emergency=(*others, source) if active else others)
        if not active:
            return
        reason = f"emergency stop{after_colon(source)}"
        goal = self.state.goal
        self.do(CancelGoal(ANYBODYS, reason))  # another client may drive, also if a goal of the mission is open
        if goal is not None and goal.cancelled_s is not None:  # the others are cancelled by the pause
            self.do(CancelGoal(goal.goal_id, reason))
        resume = self.to_resume
        if self.state.under_way and resume is not None:
            self.hold(resume, f"{reason}; release it, then resume or abort")
