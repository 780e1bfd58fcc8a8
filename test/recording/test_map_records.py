# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Mappers that list what they have and send what others lack end with the same records, each once."""

import json
import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping.expected_counts import UNEXPECTED
from soilmoist_ros.recording import LIST_S, MAX_RECORDS, RECEIVED, START, TEAM, TEAM_S, MapRecords, RecordExchange
from soilmoist_ros.sensing.position.place_doubt import Doubt, DoubtOutcome
from soilmoist_ros.sensing.records import CountRecord

BEGIN_S = 1.78e9


class Map:
    """Counts what is added; the records of a map are not mapped here."""

    def __init__(self):
        self.added, self.skipped = [], {}

    def add(self, record):
        self.added.append(record)

    def reset(self):
        self.added, self.skipped = [], {}


class Robot:
    def __init__(self):
        self.records = MapRecords(Map(), TEAM_S)
        self.exchange = RecordExchange(self.records)
        self.sent = 0

    @property
    def held(self):
        return sorted(record.stamp_s for record in self.records.map.added)


def record(robot, number):
    return CountRecord(BEGIN_S + 10 * number + 0.1 * robot, float(robot), float(number), 0.0, 40, 10.0, 10.0)


def rounds(robots, now_s, count=3, heard=lambda robot, other: True):
    """Let everybody list what it has; with the texts of the lists, and messages that reach all in reach."""
    for _ in range(count):
        now_s += LIST_S
        for name, robot in robots.items():
            robot.exchange.update(now_s)
            text = json.dumps(robot.exchange.held())
            for other_name, other in robots.items():
                if other is robot or not heard(name, other_name):
                    continue
                other.exchange.update(now_s)
                found = other.exchange.missed(name, json.loads(text), now_s)
                other.sent += len(found)
                for third_name, third in robots.items():
                    if third is not other and heard(third_name, other_name):
                        third.records.read_anew(TEAM, found)
    return now_s


def team(*names):
    return {name: Robot() for name in names}


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    robots=st.integers(2, 4), records=st.integers(1, 700), lost=st.floats(0.0, 0.9), seed=st.integers(0, 10_000)
)
def test_all_maps_have_all_records_once_whatever_the_network_has_lost(robots, records, lost, seed):
    rng = random.Random(seed)
    members = team(*(f"/robot_{number}" for number in range(robots)))
    for number in range(records):
        for own in range(robots):
            for number_of, robot in enumerate(members.values()):
                if number_of == own or rng.random() >= lost:
                    robot.records.take(RECEIVED, [record(own, number)])
    now_s = rounds(members, 1000.0, 2)
    for _ in range(10):
        now_s = rounds(members, now_s + 30.0, 1)
    wanted = sorted(record(own, number).stamp_s for own in range(robots) for number in range(records))
    for robot in members.values():
        assert robot.held == wanted
    sent = [robot.sent for robot in members.values()]
    rounds(members, now_s + 7200.0)
    assert [robot.sent for robot in members.values()] == sent, "nobody sends what all have"


@pytest.mark.slow
def test_a_day_comes_in_parts_of_bounded_size():
    one, two = (members := team("/robot_1", "/robot_2")).values()
    one.records.take(RECEIVED, [record(1, number) for number in range(8640)])
    one.exchange.update(0.0)
    held = two.exchange.held()
    assert len(json.dumps(one.exchange.held())) < 6000
    assert MAX_RECORDS <= len(one.exchange.missed("/robot_2", held, 60.0)) < MAX_RECORDS + 360
    rounds(members, 1000.0)
    assert len(two.held) == 8640


def test_records_reach_a_robot_through_another_one_when_their_own_is_gone():
    members = team("/robot_1", "/robot_2", "/robot_3")
    one, two, three = members.values()
    for robot in (one, two):
        robot.records.take(RECEIVED, [record(1, number) for number in range(100)])
    rounds({"/robot_2": two, "/robot_3": three}, 1000.0)
    assert three.held == one.held
    # robot 3 hears them live as well, and starts again from its own log
    three.records.take(RECEIVED, [record(1, number) for number in range(100)])
    assert three.held == one.held
    again = Robot()
    again.records.take(RECEIVED, three.records.map.added)
    rounds({"/robot_1": one, "/robot_2": two, "/robot_3": again}, 2000.0)
    assert again.held == one.held


def test_what_is_bad_void_or_of_an_earlier_survey_is_not_sent():
    members = team("/robot_1", "/robot_2")
    one, two = members.values()
    bad, doubted = replace(record(1, 1), quarantine="stuck_tube"), replace(record(1, 2), quarantine=UNEXPECTED)
    one.records.take(RECEIVED, [record(1, 0), bad, doubted, replace(record(1, 3), stamp_s=math.nan)])
    one.records.take(START, [record(9, 0)])
    rounds(members, 1000.0)
    assert [each.stamp_s for each in two.records.map.added] == [record(1, 0).stamp_s, doubted.stamp_s]
    two.records.reset()
    one.records.take(RECEIVED, [record(1, 500)])
    rounds(members, 2000.0)
    assert two.held == [record(1, 500).stamp_s], "the operator has removed the others there"


@pytest.mark.parametrize("source", [TEAM, START])
@pytest.mark.parametrize("doubt_first", [True, False])
@pytest.mark.parametrize(
    ("outcome", "doubted"),
    [
        (DoubtOutcome.OPEN, True),
        (DoubtOutcome.LOST, True),
        (DoubtOutcome.RETURNED, True),
        (DoubtOutcome.CONFIRMED, False),
    ],
)
def test_records_of_which_nobody_says_whose_they_are_are_doubted_with_any_robot(
    source, doubt_first, outcome, doubted
):
    """As those that a mapper has missed, and those of its log when it starts again."""
    records = Robot().records
    there = (1.0, 15.0) if outcome is DoubtOutcome.CONFIRMED else (7.0, 7.0)
    doubt = Doubt(BEGIN_S + 100.0, BEGIN_S + 200.0, outcome, *there)
    if doubt_first:
        records.doubt(doubt, "/robot_2")
    records.take(source, [record(1, number) for number in (0, 15)])
    records.doubt(doubt, "/robot_2")
    found = sorted(records.map.added, key=lambda each: each.stamp_s)
    assert [each.quarantine for each in found] == ["", "place_doubt" * doubted]
    assert [each.x_m for each in found] == [1.0, 1.0], "the place of another robot is not known"
