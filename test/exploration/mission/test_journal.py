# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A mission written down and taken up again is the same mission."""

import json
import math
from dataclasses import replace

import pytest

from soilmoist_ros.exploration import Choice, Mission, MissionRules, Phase, Stop, Verb, parse_dwell
from soilmoist_ros.exploration.mission.events import Command, GoalReached, Moved, Planned, RecordArrived
from soilmoist_ros.exploration.mission.journal import MissionJournal, interrupted_mission, is_under_way
from soilmoist_ros.exploration.mission.state import event_from_dict, event_to_dict
from soilmoist_ros.exploration.mission.types import Changes
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.records import CountRecord

RECORD = CountRecord(2.0, 1.0, 2.0, 0.0, 40, 10.0, 9.5)


class Pages:
    """A journal in memory; a full one takes nothing."""

    def __init__(self):
        self.state, self.events, self.full = None, [], False
        self.syncs = self.snapshots = 0

    def append(self, kind, payload, *, durable=True):
        if self.full:
            raise OSError(28, "No space left on device")
        self.events.append(json.loads(json.dumps(payload)))
        return len(self.events)

    def sync(self):
        if self.full:
            raise OSError(28, "No space left on device")
        self.syncs += 1

    def doubt(self):
        pass

    def turn_over(self, state_json):
        pass

    def snapshot(self, state_json):
        self.append("", {})
        self.snapshots += 1
        self.state, self.events = state_json, []


def travelling():
    mission = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60")))
    choice = Choice(Stop("east", 30.0, 0.0), "far")
    events = [Moved(1.0, 0.0, 0.0), Command(2.0, Verb.START), Planned(3.0, 1, choice), Moved(9.0, 4.0, 0.0)]
    for event in events:
        mission.step(event)
    return mission, events


def test_the_same_mission_from_events_and_from_a_snapshot():
    mission, events = travelling()
    assert mission.state.phase is Phase.TRAVELLING
    for kept in range(len(events) + 1):
        pages, copy = Pages(), Mission(mission.rules)
        journal = MissionJournal(pages)
        for number, event in enumerate(events):
            journal.note(copy, event)
            copy.step(event)
            if number + 1 == kept:
                journal.keep(copy)
        found = interrupted_mission(mission.rules, pages.state, pages.events)
        assert found.state == mission.state


def test_a_mission_of_a_strategy_that_is_gone_goes_on_with_its_successor(caplog):
    mission, events = travelling()
    pages = Pages()
    for event in (*events, Command(10.0, Verb.CHANGE, changes=Changes(strategy="ivr"))):
        MissionJournal(pages).note(mission, event)
    found = interrupted_mission(mission.rules, pages.state, pages.events)
    assert found.state.changes.strategy == "gcb"
    assert "the strategy ivr of the interrupted mission is gone" in caplog.text


def test_whether_a_mission_is_under_way_with_a_state_and_by_the_commands_alone():
    mission = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60")))
    every, pages = [], Pages()
    journal = MissionJournal(pages)
    assert not is_under_way(None, [])
    for event, under_way in [
        (RecordArrived(1.0, RECORD), False),
        (Moved(1.5, 0.0, 0.0), False),
        (Command(2.0, Verb.START), True),
        (RecordArrived(3.0, RECORD), True),
        (Command(4.0, Verb.ABORT), False),
        (RecordArrived(5.0, RECORD), False),
        (Command(6.0, Verb.START), True),
    ]:
        journal.note(mission, event)
        every += pages.events
        pages.events = []
        mission.step(event)
        journal.keep(mission)
        pages.events = []
        assert is_under_way(pages.state, every) == is_under_way(None, every) == under_way


def test_the_records_of_a_further_property_by_earlier_versions_do_not_touch_the_mission():
    mission, _ = travelling()
    pages = Pages()
    MissionJournal(pages).keep(mission)
    record = {**event_to_dict(RecordArrived(mission.state.now_s + 50.0, RECORD)), "property": "salt"}
    assert interrupted_mission(mission.rules, pages.state, [record]).state == mission.state


def test_the_disk_is_synced_once_for_all_that_was_noted_and_not_for_places():
    mission, _ = travelling()
    pages = Pages()
    journal = MissionJournal(pages)
    for number in range(50):
        journal.note(mission, RecordArrived(20.0 + number, replace(RECORD, stamp_s=20.0 + number)))
    journal.secure()
    journal.secure()
    journal.note(mission, Moved(80.0, 0.0, 0.0))
    journal.secure()
    assert (len(pages.events), pages.syncs) == (51, 1)


def test_a_state_is_kept_only_if_more_than_the_records_at_the_stop_has_changed():
    mission, _ = travelling()
    pages = Pages()
    journal = MissionJournal(pages)
    journal.keep(mission)
    mission.step(GoalReached(10.0, mission.state.goal.goal_id, 30.0, 0.0))
    journal.keep(mission)
    assert (mission.state.phase, pages.snapshots) == (Phase.COUNTING, 2)
    for end_s in (20.0, 30.0):
        event = RecordArrived(end_s, CountRecord(end_s, 30.0, 0.0, 0.0, 40, 10.0, 9.5))
        journal.note(mission, event)
        mission.step(event)
        journal.keep(mission)
    assert pages.snapshots == 2
    assert interrupted_mission(mission.rules, pages.state, pages.events).state == mission.state


def test_a_full_disk_does_not_stop_the_mission(caplog):
    mission, _ = travelling()
    pages = Pages()
    journal = MissionJournal(pages)
    pages.full = True
    for _ in range(3):
        journal.note(mission, Moved(mission.state.now_s, 0.0, 0.0))
        journal.keep(mission)
    assert "No space left" in journal.problem
    assert len(caplog.records) == 1, "logged once"
    pages.full = False
    journal.note(mission, Moved(mission.state.now_s, 0.0, 0.0))
    assert not journal.problem


def test_an_event_is_written_as_strict_json_and_read_back():
    record = RecordArrived(8.0, CountRecord(10.0, 1.0, 2.0, math.nan, 30, 10.0, 8.0))
    text = json.dumps(event_to_dict(record), allow_nan=False)
    assert repr(event_from_dict(json.loads(text))) == repr(record), "NaN equals nothing"
    with pytest.raises(InputError, match="'Teleported' is not a mission event"):
        event_from_dict({"event": "Teleported", "now_s": 1.0})
