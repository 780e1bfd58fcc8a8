# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The way into a mission: order of events, positions, and broken actions."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import Choice, Mission, MissionRules, Phase, Stop, Verb, parse_dwell
from soilmoist_ros.exploration.control.mission_feed import FIX_SILENCE_S, MissionClock, MissionFeed
from soilmoist_ros.exploration.guard.motion import Motion
from soilmoist_ros.exploration.mission.events import (
    ClockStarted,
    ClockStepped,
    Command,
    Moved,
    Planned,
    Publish,
    RecordArrived,
    RequestPlan,
    VisitDone,
)
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.sensing import CountRecord, PlaceFix

EAST = Stop("east", 30.0, 0.0)
RECORD = CountRecord(10.0, 1.0, 2.0, 0.0, 40, 10.0, 10.0)


class Watched:
    """A feed whose plans come at once, from within the action that asks for them."""

    def __init__(self, broken=()):
        self.actions, self.shown, self.events, self.broken = [], [], [], broken
        rules = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:10"), warm_up_stops=0)
        self.mission = Mission(rules)
        self.secured = []
        """Numbers of events noted, and of actions carried out, at each sync of the disk."""
        self.feed = MissionFeed(self.mission, self.carry_out, self, self)
        self.places, self.motion = SimpleNamespace(sd_m=lambda sd_m: sd_m), Motion()

    def fix(self, fix):
        return fix.xy if math.isfinite(fix.x_m) else None

    def note(self, mission, event):
        self.events.append(event)

    def secure(self):
        self.secured.append((len(self.events), len(self.actions)))

    def carry_out(self, action):
        self.actions.append(action)
        if isinstance(action, Publish):
            self.shown.append(self.mission.state.phase)
        if isinstance(action, self.broken):
            raise RuntimeError("a mistake")
        if isinstance(action, RequestPlan):
            self.feed.give(Planned(0.0, action.plan_id, Choice(EAST, "far away")))


def started(x_m=0.0):
    """A mission that has started, with the robot at a place."""
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, x_m, 0.0))
    assert watched.feed.command(Command(2.0, Verb.START)).accepted
    return watched


def test_an_event_from_within_an_action_waits_for_the_others():
    watched = started()
    assert watched.shown[-1] is Phase.TRAVELLING, "the status shown last is the newest"


def test_the_age_of_a_place_is_that_of_its_own_source():
    """Records have the place of the middle of their interval."""
    feed = Watched().feed
    for second in range(30):
        feed.fix(PlaceFix(float(second), 0.0, 0.0, stamp_s=float(second)))
    assert feed.place_age_s == 0.0
    feed.fix(PlaceFix(60.0, 0.0, 0.0, stamp_s=45.0))
    assert feed.place_age_s == 15.0
    feed.give(ClockStepped(61.0, -3600.0))
    for second in (61, 62):
        feed.fix(PlaceFix(float(second), 0.0, 0.0, stamp_s=second - 3600.0))
    assert feed.place_age_s == 0.0
    for second in (70, 80):
        feed.records(float(second), [CountRecord(float(second), 0.0, 0.0, 0.0, 50, 10.0, 10.0)])
    assert feed.place_age_s == 0.0


def test_success_is_handed_on_with_the_robots_own_position():
    watched = started()
    goal_id = watched.mission.state.goal.goal_id
    watched.feed.ended(3.0, Ended(goal_id, Outcome.SUCCEEDED, ""))
    assert "30.0 m away" in watched.mission.state.reason


def test_positions_of_records_serve_only_without_fixes():
    watched = Watched()
    watched.feed.records(10.0, [RECORD])
    assert watched.feed.place == (1.0, 2.0)
    watched.feed.fix(PlaceFix(11.0, 5.0, 5.0))
    watched.feed.records(11.0 + FIX_SILENCE_S, [replace(RECORD, stamp_s=15.0)])
    assert watched.feed.place == (5.0, 5.0)
    watched.feed.records(12.0 + FIX_SILENCE_S, [replace(RECORD, stamp_s=16.0)])
    assert watched.feed.place == (1.0, 2.0)


def test_records_and_fixes_without_a_place_are_only_counted():
    watched = Watched()
    watched.feed.records(10.0, [replace(RECORD, x_m=math.nan)])
    watched.feed.fix(PlaceFix(10.0, math.nan, 0.0))
    assert watched.feed.records_without_place == 1
    assert not watched.events
    watched.feed.records(10.0, [RECORD])
    assert [type(event) for event in watched.events] == [Moved, RecordArrived]


def test_a_message_of_any_size_is_one_sync_and_one_status():
    watched = started()
    watched.feed.ended(3.0, Ended(watched.mission.state.goal.goal_id, Outcome.FAILED, "blocked"))
    watched.feed.fix(PlaceFix(100.0, 1.0, 2.0))
    watched.secured.clear()
    watched.actions.clear()
    many = [replace(RECORD, stamp_s=10.0 + number / 100) for number in range(1000)]
    watched.feed.records(101.0, many[:600], more=True)
    assert watched.secured == []
    watched.feed.records(101.0, many[600:])
    assert watched.secured == [(len(watched.events), len(watched.actions))]
    assert len(watched.actions) <= 2
    assert sum(isinstance(event, RecordArrived) for event in watched.events) == 1000


def test_an_event_is_on_the_disk_before_what_it_sets_off_is_carried_out():
    watched = started(30.0)
    watched.feed.ended(3.0, Ended(watched.mission.state.goal.goal_id, Outcome.SUCCEEDED, ""))
    assert watched.mission.state.phase is Phase.COUNTING
    watched.secured.clear()
    before = len(watched.actions)
    many = [replace(RECORD, stamp_s=end_s, x_m=30.0, y_m=0.0) for end_s in (13.0, 23.0)]
    watched.feed.records(25.0, many, more=True)
    done = next(n for n, action in enumerate(watched.actions) if isinstance(action, VisitDone))
    assert done >= before
    events_s, actions_s = watched.secured[0]
    assert actions_s <= done
    assert isinstance(watched.events[events_s - 1], RecordArrived)


# Mission time under clocks that are set -------------------------------------------------------------------------

RULES = MissionRules(budget_s=900.0, dwell=parse_dwell("fmi:30"))
NOW_S = 1.7e9


@dataclass
class Computer:
    """The clocks of a computer."""

    ros_s: float = NOW_S
    steady_s: float = 100.0

    def pass_time(self, time_s, step_s=0.0):
        self.steady_s += time_s
        self.ros_s += time_s + step_s

    def clock(self, boot="first", simulated=False):
        return MissionClock(lambda: self.ros_s, None if simulated else lambda: self.steady_s, boot)


def give(mission, clock):
    events = clock.events(mission.state)
    for event in events:
        mission.step(event)
    return events


@given(st.lists(st.tuples(st.floats(0, 1e4), st.sampled_from([0.0, 0.0, -3600.0, 21600.0, 1.5])), max_size=20))
@pytest.mark.slow
def test_time_runs_evenly_and_each_step_is_noted_once(course):
    computer, mission = Computer(), Mission(RULES)
    clock = computer.clock()
    assert clock.now_s() == NOW_S
    give(mission, clock)
    passed_s = 0.0
    for time_s, step_s in course:
        computer.pass_time(time_s, step_s)
        passed_s += time_s
        steps = [event.step_s for event in give(mission, clock)]
        assert steps == ([pytest.approx(step_s, abs=1e-5)] if step_s else [])
        assert clock.now_s() == pytest.approx(NOW_S + passed_s, abs=1e-5)
        assert clock.now_s() + mission.state.stamp_offset_s == pytest.approx(computer.ros_s, abs=1e-5)
        assert give(mission, clock) == []


def test_another_process_goes_on_in_the_same_time():
    computer, mission = Computer(), Mission(RULES)
    clock = computer.clock()
    give(mission, clock)
    computer.pass_time(50.0)
    mission.step(Moved(clock.now_s(), 0.0, 0.0))
    computer.pass_time(20.0, step_s=-3600.0)  # while no process runs
    again = computer.clock()
    again.go_on_from(mission.state)
    assert again.now_s() == pytest.approx(NOW_S + 70.0)
    assert give(mission, again) == [ClockStepped(pytest.approx(NOW_S + 70.0), pytest.approx(-3600.0))]


@pytest.mark.parametrize(("since_s", "expected_s"), [(500.0, 500.0), (-1e9, 50.0)])
def test_after_a_start_of_the_computer_ros_time_decides_but_never_backwards(since_s, expected_s):
    computer, mission = Computer(), Mission(RULES)
    give(mission, computer.clock())
    mission.step(Moved(NOW_S + 50.0, 0.0, 0.0))
    booted = Computer(ros_s=NOW_S + since_s, steady_s=3.0)
    clock = booted.clock("second")
    clock.go_on_from(mission.state)
    assert clock.now_s() == pytest.approx(NOW_S + expected_s)
    started, *steps = give(mission, clock)
    assert isinstance(started, ClockStarted)
    assert [event.step_s for event in steps] == ([] if since_s > 0 else [pytest.approx(since_s - 50.0)])
    assert clock.now_s() + mission.state.stamp_offset_s == pytest.approx(booted.ros_s)
