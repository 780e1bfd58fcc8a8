# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The judge finds each kind of violation: ``judge.py``."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rehearsal.cases import Ground
from rehearsal.judge import Judge, Kind
from soilmoist_ros.exploration.mission.events import Finish
from soilmoist_ros.exploration.mission.types import Alarm, MissionEnd, MissionStatus, Phase, Response
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
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
ALARMED = replace(STATUS, alarms=(Alarm(1.0, "in_no_go", Response.PAUSE, "in the pond"),))


@pytest.fixture
def judge():
    judge = Judge(GROUND, 600.0)
    judge.resumes(0.0, lambda: True)
    return judge


def kinds(judge):
    return [violation.kind for violation in judge.violations]


@pytest.mark.parametrize(
    ("way", "found"),
    [
        ([(5, 5), (35, 5), (35, 35)], []),
        ([(5, 15), (25, 15)], [Kind.NO_GO]),
        ([(9.9, 15), (10.1, 15)], []),
        ([(5, 5), (5, -1)], [Kind.OUTSIDE]),
        ([(5, 15), (45, 15)], [Kind.NO_GO, Kind.OUTSIDE]),
    ],
)
def test_true_ways(judge, way, found):
    judge.drove(1.0, way[0], way[1:], STATUS)
    assert kinds(judge) == found


def test_motion_while_it_is_said_to_stand(judge):
    judge.drove(1.0, (5, 5), [], PAUSED)
    judge.drove(2.0, (5, 5), [(5.3, 5)], PAUSED)
    assert kinds(judge) == []
    judge.drove(3.0, (5.3, 5), [(6, 5)], PAUSED)
    assert kinds(judge) == [Kind.MOVED_STANDING]


def test_motion_and_goals_after_a_stop(judge):
    judge.stopped(10.0, "emergency")
    judge.drove(12.0, (5, 5), [(7, 5)], STATUS)  # it brakes
    judge.drove(20.0, (7, 5), [], STATUS)
    assert kinds(judge) == []
    judge.drove(21.0, (7, 5), [(8, 5)], STATUS)
    judge.sent(21.0, (5, 5), "a")
    assert kinds(judge) == [Kind.MOVED_STOPPED, Kind.GOAL_STOPPED]


def test_a_robot_that_does_not_obey_is_stopped_when_the_mission_says_so(judge):
    judge.stopped(10.0, "pause")
    judge.drove(30.0, (5, 5), [(9, 5)], STATUS, obeys=False)
    judge.drove(31.0, (9, 5), [(15, 5)], STATUS, obeys=False)
    assert kinds(judge) == []
    judge.drove(32.0, (15, 5), [], PAUSED, obeys=False)
    judge.drove(33.0, (15, 5), [(16, 5)], STATUS, obeys=False)
    assert kinds(judge) == [Kind.MOVED_STOPPED]


def test_an_operator_ends_a_stop(judge):
    judge.stopped(10.0, "emergency")
    judge.resumes(30.0, lambda: True)
    judge.sent(31.0, (5, 5), "a")
    judge.drove(40.0, (5, 5), [(8, 5)], STATUS)
    assert kinds(judge) == []


def test_a_refused_resume_sends_nothing(judge):
    judge.stopped(10.0, "emergency")
    judge.resumes(30.0, lambda: False)
    assert kinds(judge) == []
    judge.resumes(31.0, lambda: judge.sent(31.0, (5, 5), "a") or False)
    assert kinds(judge) == [Kind.GOAL_STOPPED]


def test_a_wrong_place_must_be_noticed(judge):
    judge.said(10.0, STATUS, 100.0)
    judge.said(20.0, STATUS, 100.0)
    judge.said(21.0, replace(STATUS, needs_operator=True), 100.0)
    judge.said(30.0, STATUS, 100.0)
    assert kinds(judge) == []
    judge.said(46.0, STATUS, 100.0)
    assert kinds(judge) == [Kind.WRONG_PLACE]


def test_counting_at_a_wrong_place(judge):
    visit = Visit(
        "a", 5.0, 5.0, 0.0, 60.0, 100, "", stop_x_m=5.0, stop_y_m=5.0, ended=VisitEnd.ENOUGH, outcome="60 s"
    )
    judge.drove(1.0, (5, 5), [], COUNTING)
    judge.visited(60.0, visit)
    assert kinds(judge) == []
    judge.drove(61.0, (5, 12), [], COUNTING)
    judge.visited(120.0, visit)
    assert kinds(judge) == [Kind.WRONG_VISIT]
    judge.visited(130.0, replace(visit, outcome=""))
    assert kinds(judge) == [Kind.WRONG_VISIT, Kind.NO_REASON]


def test_places_of_a_visit_that_was_never_published_are_not_those_of_the_next(judge):
    here, there = Stop("a", 5.0, 5.0), Stop("b", 5.0, 12.0)
    judge.drove(1.0, (5, 12), [], replace(COUNTING, target=there))
    judge.drove(61.0, (5, 5), [], replace(COUNTING, target=here))
    visit = Visit(
        "a", 5.0, 5.0, 60.0, 120.0, 100, "", stop_x_m=5.0, stop_y_m=5.0, ended=VisitEnd.ENOUGH, outcome="60 s"
    )
    judge.visited(120.0, visit)
    assert kinds(judge) == []
    judge.drove(121.0, (5, 12), [], replace(COUNTING, target=here))
    judge.visited(180.0, visit)
    assert kinds(judge) == [Kind.WRONG_VISIT]


def test_goals(judge):
    judge.sent(1.0, (5, 5), "a")
    judge.sent(1.0, (-9, 5), "home", allowed=(-9, 5))
    assert kinds(judge) == []
    judge.sent(2.0, (15, 15), "pond")
    judge.replaced(3.0, "b")
    assert kinds(judge) == [Kind.GOAL_OUTSIDE, Kind.TWO_GOALS]


def test_time(judge):
    judge.said(1.0, replace(STATUS, time_used_s=700.0), 0.0)
    assert kinds(judge) == [Kind.OVER_BUDGET]
    judge.said(1000.0, STATUS, 0.0)
    assert kinds(judge) == [Kind.OVER_BUDGET, Kind.DEAD]


def test_a_low_battery(judge):
    judge.home_by(300.0, (5.0, 5.0), Stop("home", 6.0, 5.0))
    judge.home_by(300.0, (5.0, 5.0), None)
    assert kinds(judge) == []
    judge.home_by(300.0, (5.0, 5.0), Stop("home", 26.0, 5.0))
    assert kinds(judge) == [Kind.NOT_HOME]


def test_a_stop_that_drives_away(judge):
    judge.stop_sent(1.0, (5.0, 5.0), (6.0, 5.0))
    assert kinds(judge) == []
    judge.stop_sent(1.0, (1984.8, 25.4), (6.0, 5.0))
    assert kinds(judge) == [Kind.STOP_AWAY]


def test_the_end(judge):
    judge.finished(100.0, Finish("no time", MissionEnd.TIME_UP))
    assert kinds(judge) == [Kind.NO_SAVE, Kind.EARLY]
    one, two = (as_samples([(1.0, 1.0)], [count], [10.0]) for count in (10, 20))
    judge.mapped(100.0, one, one)
    assert len(judge.violations) == 2
    judge.mapped(100.0, one, two)
    assert kinds(judge)[-1] is Kind.MAP_DIFFERS
    assert math.isfinite(judge.violations[-1].at_s)


def test_a_map_that_is_missing(judge):
    one = as_samples([(1.0, 1.0)], [10], [10.0])
    judge.mapped(1.0, None, as_samples(np.empty((0, 2)), [], []))
    assert kinds(judge) == []
    judge.mapped(1.0, None, one)
    assert kinds(judge) == [Kind.MAP_DIFFERS]


def test_records_that_are_lost_or_invented(judge):
    records = [CountRecord(10.0 * number, 1.0, 2.0, 0.0, 40 + number, 10.0, 10.0) for number in range(4)]
    judge.kept(50.0, records[:3], records, "the log")
    judge.known(50.0, records[:3], records, "the log")
    assert kinds(judge) == []
    judge.kept(50.0, records, records[:3], "the log")
    judge.known(60.0, [*records, records[0]], records, "the bag")
    assert kinds(judge) == [Kind.LOST, Kind.INVENTED]
    assert "1 not in the log, the first of 30.0 s" in judge.violations[0].what


@pytest.mark.parametrize("phase", [Phase.PAUSED, Phase.CANCELLING, Phase.WAITING, Phase.FINISHED])
def test_a_stop_has_a_reason(judge, phase):
    judge.said(1.0, replace(STATUS, phase=phase, reason="paused by Ada"), 0.0)
    assert kinds(judge) == []
    judge.said(2.0, replace(STATUS, phase=phase, reason=" "), 0.0)
    assert kinds(judge) == [Kind.NO_REASON]


def test_a_mission_ends_or_says_why_it_waits(judge):
    judge.ended(1.0, replace(STATUS, phase=Phase.FINISHED))
    judge.ended(1.0, replace(STATUS, phase=Phase.PAUSED, needs_operator=True, reason="no fix"))
    assert kinds(judge) == []
    judge.ended(1.0, replace(STATUS, phase=Phase.TRAVELLING))
    assert kinds(judge) == [Kind.UNENDED]


def drive(judge, ways, status, **how):
    """Drive from place to place, one a second."""
    for second, (before, place) in enumerate(pairwise(ways)):
        judge.drove(10.0 + second, before, [place] if place != before else [], status, led=True, **how)


INTO_THE_POND = [(8.0 + second, 15.0) for second in range(9)]
OUT_OF_THE_FIELD = [(38.0 + 2 * second, 30.0) for second in range(9)]


@pytest.mark.parametrize(
    ("way", "status", "people", "found"),
    [
        (INTO_THE_POND[:7], STATUS, False, []),  # 3 s are allowed
        (INTO_THE_POND, STATUS, False, [Kind.IN_NO_GO]),
        (INTO_THE_POND, ALARMED, False, []),
        (INTO_THE_POND, CANCELLING, False, []),
        (INTO_THE_POND, STATUS, True, []),  # people may
        (OUT_OF_THE_FIELD, STATUS, False, [Kind.AWAY]),
    ],
)
def test_a_robot_that_is_led_astray_is_stopped_in_time(judge, way, status, people, found):
    drive(judge, way, status, people=people)
    assert kinds(judge) == found


def test_a_robot_that_was_led_into_a_pond_may_leave_it_but_not_go_deeper(judge):
    drive(judge, INTO_THE_POND[:5], STATUS)  # to 2 m
    judge.drove(20.0, (12.0, 15.0), [(11.0, 15.0)], STATUS)
    assert kinds(judge) == []
    judge.drove(21.0, (11.0, 15.0), [(12.0, 15.0)], STATUS)
    assert kinds(judge) == [Kind.NO_GO]


@pytest.mark.parametrize(("off_m", "found"), [(10.0, []), (12.0, [Kind.OFF_ROUTE])])
def test_a_robot_that_is_led_off_its_route_is_stopped_in_time(judge, off_m, found):
    drive(judge, [(5.0 + second, 25.0 + off_m) for second in range(6)], STATUS, right=[(5.0, 25.0), (35.0, 25.0)])
    assert kinds(judge) == found


@pytest.mark.parametrize(("step_m", "found"), [(0.0, []), (0.06, [Kind.CONFIRMED]), (0.3, [Kind.CONFIRMED])])
def test_nobody_confirms_a_stop_of_a_robot_that_moves(judge, step_m, found):
    places = [(5.0 + step_m * second, 5.0) for second in range(5)]
    drive(judge, places[:4], CANCELLING)
    drive(judge, places[3:], PAUSED)
    assert kinds(judge) == found


@pytest.mark.parametrize("status", [PAUSED, COUNTING, replace(STATUS, phase=Phase.IDLE)])
def test_a_robot_that_creeps_is_noticed(judge, status):
    places = [(5.0 + 0.2 * second, 5.0) for second in range(12)]
    warned = replace(status, alarms=(Alarm(1.0, "moving", Response.WARN, "it moves"),))
    drive(judge, places[:9], status)
    drive(judge, places[8:], warned)
    assert kinds(judge) == []
    drive(judge, [(x + 2.2, y) for x, y in places], status)
    assert kinds(judge) == [Kind.UNNOTICED]


@pytest.mark.parametrize(("away_m", "found"), [(1.5, []), (2.5, [Kind.NOT_REACHED])])
def test_a_stop_is_not_reached_at_the_next_node(away_m, found):
    stops = [Stop("a", 5.0, 5.0), Stop("b", 7.5, 5.0)]
    graph = TravelGraph.from_edges(stops, [("a", "b"), ("b", "a")])
    judge = Judge(replace(GROUND, graph=graph), 600.0)
    judge.drove(1.0, (5.0 + away_m, 5.0), [], replace(COUNTING, target=stops[0]))
    assert kinds(judge) == found


def test_goals_of_others_and_places_of_records(judge):
    judge.overridden(1.0, "goal sent")
    records = [CountRecord(10.0 * number, 1.0, 2.0, 0.0, 40, 10.0, 10.0) for number in range(3)]
    truth = {(0.0, 40): (1.0, 4.9), (10.0, 40): (1.0, 5.1), (20.0, 40): (9.0, 9.0)}
    judge.placed(2.0, [records[0], replace(records[2], quarantine="place_jump")], truth)
    assert kinds(judge) == [Kind.OVERRIDDEN]
    judge.placed(3.0, records, truth)
    assert kinds(judge) == [Kind.OVERRIDDEN, Kind.MISPLACED]
    assert "2 of 3 records, the worst 10.6 m off" in judge.violations[1].what
