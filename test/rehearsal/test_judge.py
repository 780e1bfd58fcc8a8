# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The judge finds each kind of violation: ``judge.py``."""

from dataclasses import replace

import numpy as np
import pytest

from rehearsal.cases import Ground
from rehearsal.judge import Judge, Kind
from soilmoist_ros.exploration import Finish, MissionEnd, MissionStatus, Phase, Stop
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.sensing.records import CountRecord

SQUARE = np.array([(0, 0), (40, 0), (40, 40), (0, 40)], float)
POND = np.array([(10, 10), (20, 10), (20, 20), (10, 20)], float)
GROUND = Ground("square", Field("square", LocalFrame(53.0, 0.0), SQUARE, (POND,)), None, (5.0, 5.0))
STATUS = MissionStatus(
    now_s=0.0, phase=Phase.TRAVELLING, reason="going", target=None, planned_dwell_s=0.0, dwell_s=0.0, progress=0.0,
    time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0, failures=0,
    blacklisted=(), estimated_end_s=None,
)  # fmt: skip
PAUSED = replace(STATUS, phase=Phase.PAUSED, reason="paused")
COUNTING = replace(STATUS, phase=Phase.COUNTING)
CANCELLING = replace(STATUS, phase=Phase.CANCELLING, reason="stopping")


@pytest.fixture
def judge():
    judge = Judge(GROUND, 600.0)
    judge.resumes(0.0, lambda: True)
    return judge


def kinds(judge):
    return [violation.kind for violation in judge.violations]


def visit(**changes):
    made = Visit("a", 5.0, 5.0, 0.0, 60.0, 100, "", stop_x_m=5.0, stop_y_m=5.0)
    return replace(made, ended=VisitEnd.ENOUGH, outcome="60 s", **changes)


def samples(*counts):
    return as_samples([(1.0, 1.0)] * len(counts) or np.empty((0, 2)), counts, [10.0] * len(counts))


RECORDS = [CountRecord(10.0 * number, 1.0, 2.0, 0.0, 40 + number, 10.0, 10.0) for number in range(4)]
HERE, THERE, HOME = Stop("a", 5.0, 5.0), Stop("b", 5.0, 12.0), Stop("home", 26.0, 5.0)
WORKED = {
    "true ways": [
        ("drove", (1.0, (5, 5), [(35, 5), (35, 35)], STATUS), []),
        ("drove", (1.0, (9.9, 15), [(10.1, 15)], STATUS), []),
        ("drove", (1.0, (5, 15), [(25, 15)], STATUS), [Kind.NO_GO]),
        ("drove", (1.0, (5, 5), [(5, -1)], STATUS), [Kind.OUTSIDE]),
    ],
    "motion while it is said to stand": [
        ("drove", (1.0, (5, 5), [], PAUSED), []),
        ("drove", (2.0, (5, 5), [(5.3, 5)], PAUSED), []),
        ("drove", (3.0, (5.3, 5), [(6, 5)], PAUSED), [Kind.MOVED_STANDING]),
    ],
    "a wrong place must be noticed": [
        ("said", (10.0, STATUS, 100.0), []),
        ("said", (20.0, STATUS, 100.0), []),
        ("said", (21.0, replace(STATUS, needs_operator=True), 100.0), []),
        ("said", (30.0, STATUS, 100.0), []),
        ("said", (46.0, STATUS, 100.0), [Kind.WRONG_PLACE]),
    ],
    "motion and goals after a stop": [
        ("stopped", (10.0, "emergency"), []),
        ("drove", (12.0, (5, 5), [(7, 5)], STATUS), []),  # it brakes
        ("drove", (20.0, (7, 5), [], STATUS), []),
        ("drove", (21.0, (7, 5), [(8, 5)], STATUS), [Kind.MOVED_STOPPED]),
        ("sent", (21.0, (5, 5), "a"), [Kind.GOAL_STOPPED]),
    ],
    "a robot that does not obey is stopped when the mission says so": [
        ("stopped", (10.0, "pause"), []),
        ("drove", (30.0, (5, 5), [(9, 5)], STATUS, False), []),
        ("drove", (31.0, (9, 5), [(15, 5)], STATUS, False), []),
        ("drove", (32.0, (15, 5), [], PAUSED, False), []),
        ("drove", (33.0, (15, 5), [(16, 5)], STATUS, False), [Kind.MOVED_STOPPED]),
    ],
    "an operator ends a stop, and a refused resume does not": [
        ("stopped", (10.0, "emergency"), []),
        ("resumes", (20.0, lambda: True), []),
        ("sent", (21.0, (5, 5), "a"), []),
        ("stopped", (30.0, "emergency"), []),
        ("resumes", (31.0, lambda: False), []),
        ("sent", (32.0, (5, 5), "a"), [Kind.GOAL_STOPPED]),
    ],
    "counting at a wrong place": [
        ("drove", (1.0, (5, 5), [], COUNTING), []),
        ("visited", (60.0, visit()), []),
        ("drove", (61.0, (5, 12), [], COUNTING), []),
        ("visited", (120.0, visit()), [Kind.WRONG_VISIT]),
        ("visited", (130.0, replace(visit(), outcome="")), [Kind.NO_REASON]),
    ],
    "places of a visit that was never published are not those of the next": [
        ("drove", (1.0, (5, 12), [], replace(COUNTING, target=THERE)), []),
        ("drove", (61.0, (5, 5), [], replace(COUNTING, target=HERE)), []),
        ("visited", (120.0, visit()), []),
        ("drove", (121.0, (5, 12), [], replace(COUNTING, target=HERE)), []),
        ("visited", (180.0, visit()), [Kind.WRONG_VISIT]),
    ],
    "a standstill that is confirmed while it moves": [
        *(
            ("drove", (10.0 + n, (5 + 0.3 * n, 5), [(5.3 + 0.3 * n, 5)], CANCELLING, True, True), [])
            for n in range(3)
        ),
        ("drove", (13.0, (5.9, 5), [(6.2, 5)], PAUSED, True, True), [Kind.CONFIRMED]),
    ],
    "goals": [
        ("sent", (1.0, (5, 5), "a"), []),
        ("sent", (1.0, (-9, 5), "home", (-9, 5)), []),
        ("sent", (2.0, (15, 15), "pond"), [Kind.GOAL_OUTSIDE]),
        ("replaced", (3.0, "b"), [Kind.TWO_GOALS]),
        ("overridden", (4.0, "goal sent"), [Kind.OVERRIDDEN]),
    ],
    "time": [
        ("said", (1.0, replace(STATUS, time_used_s=700.0), 0.0), [Kind.OVER_BUDGET]),
        ("said", (1000.0, STATUS, 0.0), [Kind.DEAD]),
    ],
    "a low battery": [
        ("home_by", (300.0, (5.0, 5.0), HERE), []),
        ("home_by", (300.0, (5.0, 5.0), None), []),
        ("home_by", (300.0, (5.0, 5.0), HOME), [Kind.NOT_HOME]),
    ],
    "a stop that drives away": [
        ("stop_sent", (1.0, (5.0, 5.0), (6.0, 5.0)), []),
        ("stop_sent", (1.0, (1984.8, 25.4), (6.0, 5.0)), [Kind.STOP_AWAY]),
    ],
    "the end": [
        ("finished", (100.0, Finish("no time", MissionEnd.TIME_UP)), [Kind.EARLY]),
        ("mapped", (100.0, samples(10), samples(10)), []),
        ("mapped", (100.0, samples(10), samples(20)), [Kind.MAP_DIFFERS]),
    ],
    "a map that is missing": [
        ("mapped", (1.0, None, samples()), []),
        ("mapped", (1.0, None, samples(10)), [Kind.MAP_DIFFERS]),
    ],
    "records that are lost or invented": [
        ("kept", (50.0, RECORDS[:3], RECORDS, "the log"), []),
        ("known", (50.0, RECORDS[:3], RECORDS, "the log"), []),
        ("kept", (50.0, RECORDS, RECORDS[:3], "the log"), [Kind.LOST]),
        ("known", (60.0, [*RECORDS, RECORDS[0]], RECORDS, "the bag"), [Kind.INVENTED]),
    ],
    "a mission ends or says why it waits": [
        ("ended", (1.0, replace(STATUS, phase=Phase.FINISHED)), []),
        ("ended", (1.0, replace(PAUSED, needs_operator=True, reason="no fix")), []),
        ("ended", (1.0, STATUS), [Kind.UNENDED]),
    ],
    "a pause has a reason": [
        ("said", (1.0, PAUSED, 0.0), []),
        ("said", (2.0, replace(PAUSED, reason=" "), 0.0), [Kind.NO_REASON]),
    ],
}
"""Events, and the violations that the judge finds in them."""


@pytest.mark.parametrize("events", WORKED.values(), ids=WORKED)
def test_it_finds_what_must_not_happen_and_nothing_else(judge, events):
    found = []
    for what, given, more in events:
        getattr(judge, what)(*given)
        found += more
        assert kinds(judge) == found


def test_a_refused_resume_sends_nothing(judge):
    judge.stopped(10.0, "emergency")
    judge.resumes(31.0, lambda: judge.sent(31.0, (5, 5), "a") or False)
    assert kinds(judge) == [Kind.GOAL_STOPPED]


def test_a_robot_that_was_led_into_a_pond_may_leave_it_but_not_go_deeper(judge):
    for x in range(8, 12):  # to 2 m
        judge.drove(10.0 + x, (float(x), 15.0), [(x + 1.0, 15.0)], STATUS, led=True)
    judge.drove(30.0, (12.0, 15.0), [(11.0, 15.0)], STATUS)
    assert kinds(judge) == []
    judge.drove(31.0, (11.0, 15.0), [(12.0, 15.0)], STATUS)
    assert kinds(judge) == [Kind.NO_GO]


def test_places_of_records(judge):
    records = [replace(record, raw_counts=40) for record in RECORDS[:3]]
    truth = {(0.0, 40): (1.0, 4.9), (10.0, 40): (1.0, 5.1), (20.0, 40): (9.0, 9.0)}
    judge.placed(2.0, [records[0], replace(records[2], quarantine="place_jump")], truth)
    assert kinds(judge) == []
    judge.placed(3.0, records, truth)
    assert [str(one) for one in judge.violations] == [
        "record mapped at a wrong place at 3 s: 2 of 3 records, the worst 10.6 m off"
    ]
