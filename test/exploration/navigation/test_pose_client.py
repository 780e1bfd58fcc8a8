"""Goals that are only poses: arrival and standstill from positions."""

import math

from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.navigation.pose_client import PoseClient, SendPose
from soilmoist_ros.exploration.travel.stop import Stop

GOAL = Stop("goal", 10.0, 0.0)


def drive(client, places, start_s=0.0):
    """One position a second; what is reported."""
    return [request for number, place in enumerate(places) for request in client.moved(place, start_s + number)]


def test_arrives_when_it_has_stood_there():
    client = PoseClient(3.0, 5.0)
    assert client.go(1, GOAL) == (SendPose(10.0, 0.0),)
    assert drive(client, [(float(x), 0.0) for x in range(11)]) == [], "still driving"
    assert drive(client, [(10.0, 0.0)] * 3, 11.0) == [], "not for long enough"
    (end,) = drive(client, [(10.0, 0.0)], 14.0)
    assert (end.goal_id, end.outcome) == (1, Outcome.SUCCEEDED)
    assert drive(client, [(10.0, 0.0)] * 20, 15.0) == []


def test_standing_elsewhere_is_no_arrival():
    client = PoseClient(3.0, 5.0)
    client.go(1, GOAL)
    assert drive(client, [(6.0, 0.0)] * 60) == []


def test_cancelling_stays_where_the_robot_is_and_ends_when_it_stands():
    client = PoseClient(3.0, 5.0)
    client.go(1, GOAL)
    drive(client, [(0.0, 0.0), (1.0, 0.0)])
    assert client.cancel(1) == (SendPose(1.0, 0.0),)
    assert drive(client, [(1.5, 0.0), (3.0, 0.0)], 2.0) == []
    assert [end.outcome for end in drive(client, [(3.0, 0.0)] * 10, 4.0)] == [Outcome.CANCELED]


def test_cancelling_before_the_first_position_and_of_an_earlier_process():
    client = PoseClient(3.0, 2.0)
    assert client.cancel(7) == ()
    assert drive(client, [(4.0, 4.0)]) == [SendPose(4.0, 4.0)]
    assert [end.goal_id for end in drive(client, [(4.0, 4.0)] * 5, 1.0)] == [7]


def test_a_new_goal_ends_the_one_before():
    client = PoseClient(3.0, 5.0)
    client.go(1, GOAL)
    assert client.go(2, GOAL) == (Ended(1, Outcome.CANCELED, "replaced by another goal"), SendPose(10.0, 0.0))


@given(st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), max_size=40), st.integers(0, 10))
def test_no_arrival_without_a_place_near_the_goal(places, stay):
    client = PoseClient(3.0, 5.0)
    client.go(1, GOAL)
    for now_s, place in enumerate([*places, *places[-1:] * stay]):
        if client.moved(place, float(now_s)):
            assert math.dist(place, (10.0, 0.0)) <= 3.0
