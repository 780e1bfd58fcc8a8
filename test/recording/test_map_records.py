# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Doubts about the places of several robots, and the records of logs, which do not say whose they are."""

import pytest

from soilmoist_ros.recording import START, TEAM_S, MapRecords
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


def record(robot, number):
    return CountRecord(BEGIN_S + 10 * number + 0.1 * robot, float(robot), float(number), 0.0, 40, 10.0, 10.0)


@pytest.mark.parametrize("source", ["/records/robot_1", START])
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
    """As those of the log of another robot's driver, and those of its own when it starts again."""
    records = MapRecords(Map(), TEAM_S)
    there = (1.0, 15.0) if outcome is DoubtOutcome.CONFIRMED else (7.0, 7.0)
    doubt = Doubt(BEGIN_S + 100.0, BEGIN_S + 200.0, outcome, *there)
    if doubt_first:
        records.doubt(doubt, "/robot_2")
    records.take(source, [record(1, number) for number in (0, 15)])
    records.doubt(doubt, "/robot_2")
    found = sorted(records.map.added, key=lambda each: each.stamp_s)
    assert [each.quarantine for each in found] == ["", "place_doubt" * doubted]
    assert [each.x_m for each in found] == [1.0, 1.0], "the place of another robot is not known"
