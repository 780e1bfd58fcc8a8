# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals that are only poses: arrival and standstill from positions, and stops only at plausible places."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import ANYBODYS, FORGOTTEN, Stop, way_points
from soilmoist_ros.exploration.navigation.navigator import Ended
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
AROUND = way_points([(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (10.0, 0.0)], GOAL)
FAR = (1984.8, 25.4)


def make(settle_s=5.0):
    return PoseClient(3.0, settle_s, 0.6)


def drive(client, places, start_s=0.0):
    return [
        request for number, place in enumerate(places) for request in client.moved(place, start_s + number, 0.02)
    ]


def said(request):
    match request:
        case SendPose(x_m=x_m, y_m=y_m, heading_rad=heading_rad):
            return f"pose {x_m:g} {y_m:g} facing {math.degrees(heading_rad):.0f}"
        case CancelAll():
            return "cancel all"
        case Ended(goal_id=goal_id, outcome=outcome):
            return f"{outcome} {goal_id}"


def east(begin, end, step=1.0):
    return [(begin + step * number, 0.0) for number in range(round((end - begin) / step) + 1)]


GOING = (("go", 1, TO_GOAL), "pose 10 0 facing 0"), (("drive", east(0, 2), 0.0), "")
SEEN = (("go", 1, TO_GOAL), "pose 10 0 facing 0"), (("drive", east(0, 4.5, 0.5), 0.0), "")
UNKNOWN = "the robot is not asked to stop: its recent positions do not agree on a place"
COURSES = {
    "arrives when it has stood there": (
        GOING[0], (("drive", east(0, 10), 0.0), ""), (("drive", [(10.0, 0.0)] * 3, 11.0), ""),
        (("drive", [(10.0, 0.0)] * 2, 14.0), "succeeded 1"), (("drive", [(10.0, 0.0)] * 20, 16.0), "")),
    "already there needs no pose, unless it moved": (
        (("drive", [(9.5, 0.2)] * 8, 0.0), ""), (("go", 1, TO_GOAL), "succeeded 1"),
        (("drive", [(9.5 - x, 0.2) for x in range(4)], 8.0), ""), (("go", 2, TO_GOAL), "pose 10 0 facing 0")),
    "one that is told to stay is not sent to where positions leap": (
        *SEEN, (("cancel", 1), "pose 4.5 0 facing 0"), (("drive", [(18.0, 12.0)] * 20, 20.0), "canceled 1")),
    "nor to where it is seen after a gap of positions": (
        *SEEN, (("cancel", 1), "pose 4.5 0 facing 0"), (("drive", [(8.0, 0.0)] * 4, 20.0), "")),
    "a stop after a gap of positions is no pose where the robot cannot be": (
        *SEEN, (("tick", False, 18.0), ""), (("cancel", 1), ""), (("drive", [(18.0, 12.0)] * 3, 20.0), ""),
        UNKNOWN),
    "way points one after the other, passed closely or when it stands near, facing along the way": (
        (("go", 1, AROUND), "pose 0 10 facing 90"), (("drive", [(0.0, float(y)) for y in range(9)], 0.0), ""),
        (("drive", [(0.0, 9.8)], 9.0), "pose 10 10 facing 0"),
        (("drive", [(float(x), 10.0) for x in range(8)], 10.0), ""),
        (("drive", [(8.0, 10.0)] * 6, 18.0), "pose 10 0 facing -90")),
    "a cancelled goal stays where the robot is, and ends when it stands": (
        *GOING, (("cancel", 1), "pose 2 0 facing 0"), (("cancel", 1), ""), (("drive", east(2.5, 3, 0.5), 3.0), ""),
        (("drive", [(3.0, 0.0)] * 10, 5.0), "canceled 1")),
    "a robot that drives on is stopped again where it is then": (
        *GOING, (("cancel", 1), "pose 2 0 facing 0"), (("drive", east(3, 6), 3.0), "pose 6 0 facing 0")),
    "without a plausible place nothing is published until there is one": (
        *GOING, (("drive", [FAR] * 20, 3.0), ""), (("cancel", 1), ""), (("tick", False, 23.0), ""),
        (("drive", [(9.0, 0.0)] * 2, 24.0), ""), UNKNOWN,
        (("drive", [(9.0, 0.0)], 26.0), "pose 9 0 facing 0"), ""),
    "a navigation with an action is stopped by cancelling its goals until the robot stands": (
        GOING[0], (("drive", [(0.0, 0.0), FAR], 0.0), ""), (("tick", True, 2.0), ""),
        (("cancel", 1), "cancel all"), "", (("tick", True, 3.0), ""), (("tick", True, 4.5), "cancel all"),
        (("drive", [(1.0, 0.0)] * 20, 5.0), "cancel all, cancel all, canceled 1")),
    "cancelling before the first position, of an earlier process": (
        (("cancel", 7), ""), (("drive", [(4.0, 4.0)] * 2, 0.0), ""),
        (("drive", [(4.0, 4.0)], 2.0), "pose 4 4 facing 0"), (("drive", [(4.0, 4.0)] * 8, 3.0), "canceled 7")),
    "somebody else's pose is left alone until the robot stands": (
        *GOING, (("heard_other",), "superseded 1"), (("cancel", 2), "canceled 2"),
        (("go", 3, TO_GOAL), "superseded 3"),
        (("drive", [(2.0, float(y)) for y in range(1, 6)], 3.0), ""), (("drive", [(2.0, 5.0)] * 7, 8.0), ""),
        (("go", 4, TO_GOAL), "pose 10 0 facing 0")),
    "somebody else's pose does not matter if the operator says so": (
        GOING[0], (("heard_other", False), ""), (("cancel", 1), "")),
}  # fmt: skip
"""What is told to a client and what it does then, or the caution that it shows."""


@pytest.mark.parametrize("name", COURSES)
def test_what_a_client_makes_of_positions(name):
    client = make()
    for step in COURSES[name]:
        if isinstance(step, str):
            assert client.caution == step
            continue
        (kind, *values), expected = step
        requests = drive(client, *values) if kind == "drive" else getattr(client, kind)(*values)
        assert ", ".join(map(said, requests)) == expected, (kind, values)
        assert client.other_client or kind != "heard_other", "it is shown"


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
