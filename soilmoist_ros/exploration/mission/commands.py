# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What operators may ask of a mission, and what it answers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from soilmoist_ros.exploration.mission.actions import ANYBODYS, CancelGoal
from soilmoist_ros.exploration.mission.events import RESTART, Command
from soilmoist_ros.exploration.mission.moves import Moves, xy
from soilmoist_ros.exploration.mission.state import MissionState, QueuedStop, Todo, changed_rules, replace
from soilmoist_ros.exploration.mission.types import READY, Changes, MissionEnd, Phase, Verb
from soilmoist_ros.exploration.mission.visit import VisitEnd
from soilmoist_ros.exploration.travel.stop import Stop, inside_any, is_polygon
from soilmoist_ros.foundation import InputError


class Commands(Moves):
    """One step: what an operator sets off."""

    def command(self, command: Command) -> tuple[bool, str]:
        """Do what the operator asks for; whether it can be done, and what happens or why not."""
        verbs: dict[Verb, Callable[[Command], tuple[bool, str]]] = {
            Verb.START: self.start,
            Verb.PAUSE: self.pause,
            Verb.RESUME: self.go_on,
            Verb.ABORT: self.abort,
            Verb.SKIP: self.skip,
            Verb.MEASURE: self.measure,
            Verb.RULE_OUT: self.rule_out_area,
            Verb.ORDER: self.order,
            Verb.CHANGE: self.change,
            Verb.RETURN: self.return_home,
        }
        return verbs[command.verb](command)

    def start(self, _command: Command) -> tuple[bool, str]:
        """Start a new mission."""
        if self.state.phase not in (Phase.IDLE, Phase.FINISHED):
            return False, f"a mission is under way ({self.state.phase}): resume or abort it"
        if self.state.position is None:
            return False, "the robot's position is not known yet: wait for a fix"
        if self.state.start_hindrance:
            return False, self.state.start_hindrance
        self.state = MissionState(
            now_s=self.state.now_s,
            started_s=self.state.now_s,
            position=self.state.position,
            position_s=self.state.position_s,
            position_sd_m=self.state.position_sd_m,
            still_at=self.state.still_at,
            still_since_s=self.state.still_since_s,
            unseen_mps=self.state.unseen_mps,
            stamp_offset_s=self.state.stamp_offset_s,
            boot=self.state.boot,
            steady_offset_s=self.state.steady_offset_s,
            alarms=self.state.alarms,
            ruled_out=self.state.ruled_out,
            changes=self.state.changes,
            odometer_at=self.state.position,
            plans=self.state.plans,
            goals=self.state.goals,
            last_stamp_s=self.state.last_stamp_s,
        )
        self.plan("started")
        return True, self.state.reason

    def pause(self, command: Command) -> tuple[bool, str]:
        """Stop, until an operator resumes."""
        state = self.state
        if state.phase is Phase.PAUSED or state.todo is Todo.PAUSE:
            own = command.who == RESTART and (state.held or state.interrupted)
            self.state = replace(state, held=False, interrupted=own)  # otherwise it is the operator's from now on
            return True, state.reason
        resume = self.to_resume
        if resume is None:
            return False, f"there is nothing to pause: {state.reason}"
        self.hold(resume, f"paused by {command.by}", needs_operator=False)
        if command.who == RESTART:
            self.state = replace(self.state, interrupted=True)
        return True, self.state.reason

    def go_on(self, command: Command) -> tuple[bool, str]:
        """Go on after a pause."""
        resume = self.state.resume
        if resume is None:
            return False, f"nothing is paused: {self.state.reason}"
        if self.state.hindrance:
            return False, f"not yet: {self.state.hindrance}"
        self.state = replace(self.state, failures=0, wait_until_s=None)
        self.go_on_with(resume, f"resumed by {command.by}" if command.who else "resumed")
        return True, self.state.reason

    def abort(self, command: Command) -> tuple[bool, str]:
        """Stop, and end the mission where the robot is; without a mission, stop whatever drives the robot."""
        reason = f"aborted by {command.by}"
        if self.state.under_way:
            self.abandon(MissionEnd.ABORTED, reason)
        else:
            if self.state.phase is Phase.FINISHED:
                self.enter(Phase.IDLE, READY)
            self.do(CancelGoal(ANYBODYS, reason))
            if not self.seen_standing:
                return True, f"{reason}: whatever drives the robot is asked to stop; it is not known to stand"
        return True, self.state.reason

    def skip(self, command: Command) -> tuple[bool, str]:
        """Leave the stop, and rule it out for a while."""
        target = self.state.target
        if target is None:
            return False, f"there is no stop to skip: {self.state.reason}"
        cause = command.cause or f"by {command.by}"
        self.leave_for_good(target.stop, f"{target.stop.name} skipped {cause}")
        return True, self.state.reason

    def leave_for_good(self, stop: Stop, reason: str) -> None:
        """Rule the target out, and choose another stop unless paused."""
        self.rule_out(stop)
        self.leave_stop(VisitEnd.SKIPPED, reason)
        self.state = replace(self.state, wait_until_s=None)
        if self.state.resume is not None:
            self.hold(Todo.PLAN, f"{reason}; still paused", self.state.needs_operator, self.state.held)
        else:
            self.then(Todo.PLAN, reason)

    def measure(self, command: Command) -> tuple[bool, str]:
        """Put a place into the queue of stops."""
        stop = command.stop
        if stop is None or not (math.isfinite(stop.x_m) and math.isfinite(stop.y_m)):
            return False, "there is no place to measure at: give x and y in metres"
        if not self.state.under_way or self.to_resume in (None, Todo.RETURN):
            return False, f"no mission is measuring: {self.state.reason}"
        if stop.name in {queued.stop.name for queued in self.state.queue}:
            return False, f"{stop.name} is in the queue already"
        if inside_any(self.state.ruled_out, xy(stop))[0]:
            return False, f"{stop.name} lies in an area that is ruled out"
        dwell = ""
        if command.dwell_s is not None:
            if not (math.isfinite(command.dwell_s) and command.dwell_s > 0):
                return False, f"a dwell of {command.dwell_s:g} s is not possible: give seconds above 0"
            dwell = f"fmi:{command.dwell_s:g}"
        queued = QueuedStop(stop, command.by, dwell)
        self.state = replace(self.state, queue=(*self.state.queue, queued))
        self.plan_again(f"{stop.name} requested by {command.by}")
        names = ", ".join(queued.stop.name for queued in self.state.queue)
        return True, f"queued: {names}" if names else self.state.reason

    def rule_out_area(self, command: Command) -> tuple[bool, str]:
        """Choose no stop in an area; driving through it stays allowed."""
        corners = command.polygon
        if len(corners) < 3 or not all(math.isfinite(value) for corner in corners for value in corner):
            return False, f"an area needs at least three corners in metres, got {len(corners)}"
        if not is_polygon(corners):
            return False, "the border of the area crosses itself or encloses nothing: give the corners in order"
        self.state = replace(self.state, ruled_out=(*self.state.ruled_out, corners))
        kept = tuple(queued for queued in self.state.queue if not inside_any([corners], xy(queued.stop))[0])
        self.state = replace(self.state, queue=kept)
        target = self.state.target
        if target is not None and inside_any([corners], xy(target.stop))[0]:
            self.leave_for_good(target.stop, f"{target.stop.name} is ruled out by {command.by}")
        else:
            self.plan_again(f"an area is ruled out by {command.by}")
        return True, f"no stop is chosen in the area; {self.state.reason}"

    def order(self, command: Command) -> tuple[bool, str]:
        """Put the queued stops in order, and drop those left out."""
        queued = {one.stop.name: one for one in self.state.queue}
        unknown = [name for name in command.stops if name not in queued]
        if unknown or len(set(command.stops)) < len(command.stops):
            names = ", ".join(queued) or "nothing"
            return False, f"the queue holds {names}: name each of them once at most"
        self.state = replace(self.state, queue=tuple(queued[name] for name in command.stops))
        return True, f"queued: {', '.join(command.stops) or 'nothing'}"

    def change(self, command: Command) -> tuple[bool, str]:
        """Change settings from now on."""
        new = command.changes
        if new is None or new == Changes():
            return False, "there is nothing to change"
        values = {field.name: value for field in fields(new) if (value := getattr(new, field.name)) is not None}
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
        self.state = replace(self.state, changes=changes)
        if new.home is not None and self.state.target is not None:
            self.state = replace(self.state, target=replace(self.state.target, home_s=0.0))
        self.rules = rules
        self.plan_again(f"settings changed by {command.by}")
        return True, f"changed: {', '.join(f'{name} {_plain(value)}' for name, value in values.items())}"

    def return_home(self, command: Command) -> tuple[bool, str]:
        """Stop measuring, go home and end."""
        resume = self.to_resume
        if self.rules.home is None:
            return False, "there is no home: set one, or abort"
        if not self.state.under_way or resume is None:
            return False, f"no mission is under way: {self.state.reason}"
        if self.state.hindrance:
            return False, f"not yet: {self.state.hindrance}"
        self.state = replace(self.state, wait_until_s=None, queue=())
        if resume is Todo.RETURN:
            self.then(Todo.RETURN, f"sent home by {command.by}")
        else:
            self.end(MissionEnd.RETURNED, f"sent home by {command.by}")
        return True, self.state.reason


def _plain(value: Any) -> str:
    """A new value in words."""
    if isinstance(value, Stop):
        return value.name
    return ", ".join(value) or "none" if isinstance(value, tuple) else str(value)
