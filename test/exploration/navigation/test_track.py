# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plausible places: agreeing, recent, and within the reach of the robot."""

import math

from soilmoist_ros.exploration.navigation.track import KEPT_S, MAX_AGE_S, SPACING_S, RobotTrack
from soilmoist_ros.exploration.travel.stop import Stop


def track(*places, start_s=0.0):
    made = RobotTrack(0.6, 3.0)
    for number, place in enumerate(places):
        made.moved(place, start_s + number, 0.01)
    return made


def test_one_or_two_positions_are_no_place():
    assert track().place is None
    assert track((1.0, 1.0), (1.0, 1.0)).place is None
    assert track((1.0, 1.0), (1.0, 1.0), (1.2, 1.0)).place == (1.2, 1.0)


def test_a_jump_is_left_out_however_often_it_is_repeated():
    far = [(2000.0, 0.0)] * 10
    made = track((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), *far)
    assert made.place is None, "the last plausible place is too old by now"
    assert track((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), far[0]).place == (0.0, 0.0)


def test_a_robot_that_was_carried_away_is_believed_in_the_end():
    made = track((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    for number in range(60):
        made.moved((60.0, 0.0), 10.0 + number)
    assert made.place == (60.0, 0.0)


def test_age():
    made = track((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    made.tick(2.0 + MAX_AGE_S)
    assert made.place == (0.0, 0.0)
    made.tick(2.1 + MAX_AGE_S)
    assert made.place is None


def test_a_clock_that_goes_back_starts_anew():
    made = track((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), start_s=1000.0)
    made.tick(0.0)
    assert made.place is None


def test_standing_and_heading():
    made = track(*[(0.0, 2.0 * y) for y in range(4)])
    assert made.heading_rad == math.pi / 2
    assert not made.stands(2.0)
    for number in range(4):
        made.moved((0.0, 6.0), 4.0 + number, 0.01)
    assert made.stands(3.0)
    assert not made.stands(3.0, since_s=6.0)
    assert made.standing_at(Stop("a", 0.0, 7.0), 1.0)
    assert not made.standing_at(Stop("a", 0.0, 8.0), 1.0)


def test_a_fast_receiver_gives_the_same_place_and_is_kept_thinned():
    made = RobotTrack(0.6, 3.0)
    for number in range(1200):
        assert made.moved((0.06 * number, 0.0), 0.1 * number) is (number >= 2)
    assert made.place == (0.06 * 1199, 0.0)
    assert made.heading_rad == 0.0
    assert not made.stands(2.0)
    assert not made.moved((500.0, 0.0), 120.0)
    assert len(made._places) <= KEPT_S / SPACING_S + 3
