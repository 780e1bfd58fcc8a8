# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals that are only poses: arrival and standstill from positions, and stops only at plausible places."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import ANYBODYS, FORGOTTEN, Stop, way_points
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.navigation.pose_client import (
    KEPT_S,
    MAX_AGE_S,
    SPACING_S,
    CancelAll,
    PoseClient,
    RobotTrack,
    SendPose,
)

GOAL = Stop("goal", 10.0, 0.0)
TO_GOAL = way_points([(0.0, 0.0), (10.0, 0.0)], GOAL)
FAR = (1984.8, 25.4)


def make(settle_s=5.0):
    return PoseClient(3.0, settle_s, 0.6)


def drive(client, places, start_s=0.0):
    return [
        request for number, place in enumerate(places) for request in client.moved(place, start_s + number, 0.02)
    ]


def going():
    """A client whose robot drives to the goal, 2 m from where it began."""
    client = make()
    client.go(1, TO_GOAL)
    drive(client, [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])
    return client


def test_arrives_when_it_has_stood_there():
    client = make()
    assert client.go(1, TO_GOAL) == (SendPose(10.0, 0.0, 0.0),)
    assert drive(client, [(float(x), 0.0) for x in range(11)]) == [], "still driving"
    assert drive(client, [(10.0, 0.0)] * 3, 11.0) == [], "not for long enough"
    (end,) = drive(client, [(10.0, 0.0)] * 2, 14.0)
    assert (end.goal_id, end.outcome) == (1, Outcome.SUCCEEDED)
    assert drive(client, [(10.0, 0.0)] * 20, 16.0) == []


def test_already_there_needs_no_pose():
    client = make()
    drive(client, [(9.5, 0.2)] * 8)
    assert client.go(1, TO_GOAL) == (Ended(1, Outcome.SUCCEEDED, "already at goal"),)
    drive(client, [(9.5 - x, 0.2) for x in range(4)], 8.0)
    assert client.go(2, TO_GOAL) == (SendPose(10.0, 0.0, 0.0),), "it moved"


def test_a_robot_that_is_told_to_stay_is_not_sent_to_where_positions_leap():
    client = make()
    client.go(1, TO_GOAL)
    drive(client, [(x / 2, 0.0) for x in range(10)])
    assert client.cancel(1) == (SendPose(4.5, 0.0, 0.0),)
    assert drive(client, [(18.0, 12.0)] * 20, 20.0)[:-1] == [], "no pose after a gap of positions"


def test_a_stop_after_a_gap_is_no_pose_where_the_robot_cannot_be():
    client = make()
    client.go(1, TO_GOAL)
    drive(client, [(x / 2, 0.0) for x in range(10)])
    client.tick(False, 18.0)
    assert client.cancel(1) == ()
    assert drive(client, [(18.0, 12.0)] * 3, 20.0) == []
    assert "is not asked to stop" in client.caution


def test_way_points_one_after_the_other_facing_along_the_way():
    client = make()
    way = [(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (10.0, 0.0)]
    assert client.go(1, way_points(way, GOAL)) == (SendPose(0.0, 10.0, math.pi / 2),)
    assert drive(client, [(0.0, float(y)) for y in range(9)]) == []
    assert drive(client, [(0.0, 9.8)], 9.0) == [SendPose(10.0, 10.0, 0.0)], "passed closely"
    assert drive(client, [(float(x), 10.0) for x in range(8)], 10.0) == []
    assert drive(client, [(8.0, 10.0)] * 6, 18.0) == [SendPose(10.0, 0.0, -math.pi / 2)], "or when it stands near"


def test_cancelling_stays_where_the_robot_is_and_ends_when_it_stands():
    client = going()
    assert client.cancel(1) == (SendPose(2.0, 0.0, 0.0),)
    assert client.cancel(1) == (), "it has just been asked"
    assert drive(client, [(2.5, 0.0), (3.0, 0.0)], 3.0) == []
    assert [end.outcome for end in drive(client, [(3.0, 0.0)] * 10, 5.0)] == [Outcome.CANCELED]


def test_a_robot_that_drives_on_is_stopped_again_where_it_is_then():
    client = going()
    client.cancel(1)
    assert drive(client, [(2.0 + x, 0.0) for x in range(1, 5)], 3.0) == [SendPose(6.0, 0.0, 0.0)]


def test_without_a_plausible_place_nothing_is_published_until_there_is_one():
    client = going()
    drive(client, [FAR] * 20, 3.0)
    assert client.cancel(1) == ()
    assert "do not agree on a place" in client.caution
    assert client.tick(False, 23.0) == ()
    assert drive(client, [(9.0, 0.0)] * 2, 24.0) == []
    assert drive(client, [(9.0, 0.0)], 26.0) == [SendPose(9.0, 0.0, 0.0)]
    assert client.caution == ""


def test_a_navigation_with_an_action_is_stopped_by_cancelling_its_goals():
    client = make()
    client.go(1, TO_GOAL)
    drive(client, [(0.0, 0.0), FAR])
    client.tick(True, 2.0)
    assert client.cancel(1) == (CancelAll(),)
    assert client.caution == ""
    assert client.tick(True, 3.0) == ()
    assert client.tick(True, 4.5) == (CancelAll(),), "it does not stand yet"
    requests = drive(client, [(1.0, 0.0)] * 20, 5.0)
    assert requests[-1] == Ended(1, Outcome.CANCELED, "cancelled; the robot stands")
    assert all(isinstance(each, CancelAll) for each in requests[:-1])


def test_cancelling_before_the_first_position_and_of_an_earlier_process():
    client = make(settle_s=2.0)
    assert client.cancel(7) == ()
    assert drive(client, [(4.0, 4.0)] * 2) == []
    assert drive(client, [(4.0, 4.0)], 2.0) == [SendPose(4.0, 4.0, 0.0)]
    assert [end.goal_id for end in drive(client, [(4.0, 4.0)] * 5, 3.0)] == [7]


@given(st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), max_size=40), st.integers(0, 10))
def test_no_arrival_without_a_place_near_the_goal(places, stay):
    client = make()
    client.go(1, TO_GOAL)
    for now_s, place in enumerate([*places, *places[-1:] * stay]):
        if client.moved(place, float(now_s)):
            assert math.dist(place, (10.0, 0.0)) <= 3.0


BAD = st.tuples(st.floats(-5000, 5000), st.floats(-5000, 5000))


@given(
    st.lists(st.one_of(st.none(), BAD, st.floats(0, 5)), min_size=5, max_size=40),
    st.integers(0, 39),
    st.floats(0.1, 1.5),
)
def test_whatever_is_wrong_with_fixes_a_stop_is_never_further_away_than_the_robot_could_have_come(bad, at, speed):
    """Fixes jump (a place) or drift away (a number of metres a fix) at any time, also several in a row."""
    client, drifted_m = make(), 0.0
    client.go(1, TO_GOAL)
    drive(client, [(0.0, 0.0)] * 3)
    for number, fix in enumerate(bad):
        now_s, truth = 3.0 + number, (speed * (number + 1), 0.0)
        drifted_m += fix if isinstance(fix, float) else 0.0
        seen = (truth[0] + drifted_m, 0.0) if fix is None or isinstance(fix, float) else fix
        requests = [*client.moved(seen, now_s), *(client.cancel(1) if number >= at else ())]
        for request in requests:
            if isinstance(request, SendPose):
                assert math.hypot(request.x_m, request.y_m) <= 1.8 * (now_s - 2.0) + 3.0


@pytest.mark.parametrize(("cancels", "requests"), [(True, (CancelAll(),)), (False, ())])
def test_what_somebody_else_drives_gets_no_pose(cancels, requests):
    client = PoseClient(2.0, 2.0, 1.0)
    for second in range(20):
        client.tick(cancels, float(second))
        client.moved((0.5 * second, 0.0), float(second))
    assert client.cancel(ANYBODYS) == requests
    assert client.moved((10.0, 0.0), 20.0) == client.tick(cancels, 20.5) == ()
    assert client.cancel(FORGOTTEN) != ()


def test_somebody_elses_pose_is_left_alone_until_the_robot_stands():
    client = going()
    assert [end.outcome for end in client.heard_other()] == [Outcome.SUPERSEDED]
    assert client.cancel(2) == (Ended(2, Outcome.CANCELED, "cancelled; another client drives the robot"),)
    assert [end.outcome for end in client.go(3, TO_GOAL)] == [Outcome.SUPERSEDED]
    assert drive(client, [(2.0, float(y)) for y in range(1, 6)], 3.0) == []
    assert client.other_client
    drive(client, [(2.0, 5.0)] * 7, 8.0)
    assert not client.other_client
    assert client.go(4, TO_GOAL) == (SendPose(GOAL.x_m, GOAL.y_m, 0.0),)


def test_somebody_elses_pose_does_not_matter_if_the_operator_says_so():
    client = make()
    client.go(1, TO_GOAL)
    assert client.heard_other(yields=False) == ()
    assert client.other_client, "it is shown"
    assert client.cancel(1) == ()


def track(*places, start_s=0.0):
    made = RobotTrack(0.6, 3.0)
    for number, place in enumerate(places):
        made.moved(place, start_s + number, 0.01)
    return made


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
