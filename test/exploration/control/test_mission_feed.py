# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The way into a mission: order of events, positions, and broken actions."""

import math
from dataclasses import replace

import pytest

from soilmoist_ros.exploration.control.mission_feed import FIX_SILENCE_S, MissionFeed
from soilmoist_ros.exploration.mission.events import (
    ClockStepped,
    Command,
    GoTo,
    Moved,
    Planned,
    Publish,
    RecordArrived,
    RequestPlan,
    VisitDone,
)
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import MissionRules, Phase, Verb
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.sensing.position.place_judge import PlaceFix
from soilmoist_ros.sensing.records import CountRecord

EAST = Stop("east", 30.0, 0.0)
RECORD = CountRecord(
    stamp_s=10.0, x_m=1.0, y_m=2.0, z_m=0.0, raw_counts=40, exposure_s=10.0, effective_exposure_s=10.0,
    f_pressure=1.0, f_humidity=1.0, f_intensity=1.0,
)  # fmt: skip


class Watched:
    """A feed whose plans come at once, from within the action that asks for them."""

    def __init__(self, broken=()):
        self.actions, self.shown, self.events, self.broken = [], [], [], broken
        rules = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:10"), warm_up_stops=0)
        self.mission = Mission(rules)
        self.secured = []
        """Numbers of events noted, and of actions carried out, at each sync of the disk."""
        self.feed = MissionFeed(self.mission, self.carry_out, self.events.append, secure=self.secure)

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


def test_an_event_from_within_an_action_waits_for_the_others():
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, 0.0, 0.0))
    answer = watched.feed.command(Command(2.0, Verb.START))
    assert answer.accepted
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


def test_a_broken_action_does_not_stop_the_others(caplog):
    watched = Watched(broken=(GoTo,))
    watched.feed.fix(PlaceFix(1.0, 0.0, 0.0))
    watched.feed.command(Command(2.0, Verb.START))
    assert isinstance(watched.actions[-1], Publish)
    assert "a mistake" in caplog.text


def test_a_command_says_why_not():
    answer = Watched().feed.command(Command(1.0, Verb.START))
    assert not answer.accepted
    assert "wait for a fix" in answer.message


def test_success_is_handed_on_with_the_robots_own_position():
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, 0.0, 0.0))
    watched.feed.command(Command(2.0, Verb.START))
    goal_id = watched.mission.state.goal.goal_id
    watched.feed.ended(3.0, Ended(goal_id, Outcome.SUCCEEDED, ""))
    assert "30.0 m away" in watched.mission.state.reason


@pytest.mark.parametrize("outcome", [Outcome.FAILED, Outcome.CANCELED])
def test_other_ends_are_failures(outcome):
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, 30.0, 0.0))
    watched.feed.command(Command(2.0, Verb.START))
    watched.feed.ended(3.0, Ended(watched.mission.state.goal.goal_id, outcome, "blocked"))
    assert "blocked" in watched.mission.state.reason


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
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, 0.0, 0.0))
    watched.feed.command(Command(2.0, Verb.START))
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
    watched = Watched()
    watched.feed.fix(PlaceFix(1.0, 30.0, 0.0))
    watched.feed.command(Command(2.0, Verb.START))
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
