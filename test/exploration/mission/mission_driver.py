# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Feeds a mission with events, for tests."""

import math

from soilmoist_ros.exploration import Choice, Mission, MissionRules, Stop, Verb, parse_dwell
from soilmoist_ros.exploration.mission.events import (
    Answer,
    Command,
    GoalFailed,
    GoalReached,
    GoTo,
    Moved,
    Planned,
    RecordArrived,
    RequestPlan,
)
from soilmoist_ros.sensing.records import CountRecord

HOME = Stop("home", 0.0, 0.0)
EAST, NORTH = Stop("east", 30.0, 0.0), Stop("north", 0.0, 30.0)


def make_rules(**changes):
    values = {"budget_s": 7200.0, "dwell": parse_dwell("fmi:60"), "speed_mps": 1.0, "stop_overhead_s": 10.0}
    values["min_last_dwell_s"] = 60.0
    return MissionRules(
        **{**values, "detour": 1.0, "warm_up_stops": 1, "standstill_s": 0.0, "backoff_s": 0.0, **changes}
    )


class Driver:
    """Feeds a mission, and keeps what it asked for."""

    def __init__(self, **changes):
        self.mission = Mission(make_rules(**changes))
        self.now_s = 1000.0
        self.actions = ()
        self.all_actions = []

    def send(self, kind, *values, after=0.0, **named):
        self.now_s += after
        self.actions = self.mission.step(kind(self.now_s, *values, **named))
        self.all_actions += self.actions
        return self

    def command(self, verb):
        return self.send(Command, Verb(verb))

    def record(self, raw_counts=30, exposure_s=10.0, after=10.0, stamp_s=None, place=None):
        self.now_s += after
        x_m, y_m = place if place is not None else self.mission.state.position
        stamp_s = self.now_s if stamp_s is None else stamp_s
        record = CountRecord(stamp_s, x_m, y_m, math.nan, raw_counts, exposure_s, exposure_s / 1.25)
        return self.send(RecordArrived, record)

    def start(self):
        return self.send(Moved, 0.0, 0.0).command("start")

    def plan(self, stop=EAST, dwell="", **named):
        rule = parse_dwell(dwell) if dwell else None
        choice = Choice(stop, "it is the least known place", dwell=rule) if stop is not None else None
        return self.send(Planned, self.last(RequestPlan).plan_id, choice, **named)

    def travelling(self, stop=EAST):
        return self.start().plan(stop)

    def reach(self, stop=None, after=20.0):
        goal = self.last(GoTo)
        stop = stop or goal.stop
        return self.send(GoalReached, goal.goal_id, stop.x_m, stop.y_m, after=after)

    def counting(self, stop=EAST):
        return self.travelling(stop).reach()

    def fail_goal(self, reason="blocked"):
        return self.send(GoalFailed, self.last(GoTo).goal_id, reason, after=5.0)

    def last(self, kind):
        return next(action for action in reversed(self.all_actions) if isinstance(action, kind))

    def count_of(self, kind):
        return sum(isinstance(action, kind) for action in self.all_actions)

    @property
    def phase(self):
        return self.mission.state.phase

    @property
    def reason(self):
        return self.mission.status.reason

    def kinds(self):
        return [type(action) for action in self.actions]

    @property
    def answer(self):
        return next(action for action in self.actions if isinstance(action, Answer))
