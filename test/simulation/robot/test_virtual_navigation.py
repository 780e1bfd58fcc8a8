# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import FreeTravel, GraphTravel, RobotMotion, Stop, TravelGraph, polyline_length_m
from soilmoist_ros.foundation import InputError
from soilmoist_ros.simulation import MissionSettings, simulate_mission
from soilmoist_ros.simulation.robot.scenario import NavigationFaults
from soilmoist_ros.simulation.robot.virtual_navigation import (
    PAUSE_S,
    GoalEnded,
    GoalOutcome,
    Habits,
    OnRoute,
    Remaining,
    ServerPresent,
    VirtualNavigation,
    VirtualPerson,
    VirtualRobot,
)

MOTION = RobotMotion(speed_mps=1.0, stop_overhead_s=5.0)
# A road of nodes 10 m apart: A at 0 m to E at 40 m.
NODES = [Stop(name, 10.0 * number, 0.0) for number, name in enumerate("ABCDE")]
ROADS = [(a.name, b.name) for a, b in pairwise(NODES)]
GRAPH = TravelGraph.from_edges(NODES, [*ROADS, *((end, start) for start, end in ROADS)])


class Drive:
    """A navigation with its events and their times."""

    def __init__(self, at=(0.0, 0.0), **faults):
        self.robot = VirtualRobot(MOTION, at)
        self.navigation = VirtualNavigation(
            GraphTravel(GRAPH, MOTION), self.robot, NavigationFaults.model_validate(faults),
            np.random.default_rng(3),
        )  # fmt: skip
        self.events = []
        self.now_s = 0.0

    def until(self, end_s, look_every_s=None):
        next_look_s = self.now_s
        while True:
            due_s = min(self.navigation.next_s, next_look_s if look_every_s else math.inf)
            if due_s > end_s:
                break
            self.now_s = max(due_s, self.now_s)
            if look_every_s and next_look_s <= self.now_s:
                self.navigation.look(self.now_s)
                next_look_s += look_every_s
            self.events += [(self.now_s, event) for event in self.navigation.happened(self.now_s)]
        self.now_s = end_s
        return self

    def go(self, target):
        return self.navigation.accept(self.now_s, target)

    def cancel(self, goal_id):
        return self.navigation.cancel(self.now_s, goal_id)

    def of(self, kind):
        return [(time_s, event) for time_s, event in self.events if isinstance(event, kind)]

    @property
    def ends(self):
        return self.of(GoalEnded)

    @property
    def place(self):
        return pytest.approx(self.robot.at(self.now_s))


def test_a_goal_ends_after_the_travel_time_at_its_target():
    drive = Drive(at=(0.0, 3.0))
    goal = drive.go("D")
    drive.until(100)
    assert drive.ends == [(3 + 30 + 5, GoalEnded(goal, GoalOutcome.SUCCEEDED, True))]
    assert drive.place == (30.0, 0.0)
    assert drive.of(OnRoute) == [(3.0 + 10 * n, OnRoute(goal, name)) for n, name in enumerate("ABCD")]


@pytest.mark.parametrize(
    ("fault", "outcome", "end_s", "place_m"),
    [
        ({"kind": "no_motion"}, (GoalOutcome.SUCCEEDED, True, 0, True), 1.0, 0.0),
        ({"kind": "fails", "share_of_way": 0.3}, (GoalOutcome.ABORTED, False), 12.0, 12.0),
        ({"kind": "fails", "error_code": 106}, (GoalOutcome.ABORTED, False), 20.0, 20.0),
    ],
)
def test_a_goal_fails_on_the_way_or_succeeds_without_motion(fault, outcome, end_s, place_m):
    drive = Drive(goals=[{**fault, "nth": 1}])
    goal = drive.go("E")
    assert drive.until(100).ends == [(end_s, GoalEnded(goal, *outcome))]
    assert drive.place == (place_m, 0.0)
    drive.go("E")
    assert drive.until(200).ends[-1][1].outcome is GoalOutcome.SUCCEEDED, "only the first"


@pytest.mark.parametrize(
    ("fault", "confirmed", "outcome", "place_m"),
    [
        ({}, True, GoalOutcome.CANCELED, 12.0),
        ({"cancel": "looks_rejected"}, False, GoalOutcome.ABORTED, 12.0),
        ({"coast_s": 3.0}, True, GoalOutcome.CANCELED, 15.0),
    ],
)
def test_cancelling_stops_the_robot(fault, confirmed, outcome, place_m):
    drive = Drive(**fault)
    goal = drive.go("E")
    drive.until(12)
    assert drive.cancel(goal) == confirmed
    assert drive.until(100).ends == [(12, GoalEnded(goal, outcome, False))]
    assert drive.place == (place_m, 0.0)
    assert not drive.cancel(goal)


def test_a_lost_server_sends_no_result_and_the_robot_stops():
    drive = Drive(absent=[{"at_s": 0, "for_s": 5}, {"at_s": 20, "for_s": 10}])
    assert not drive.navigation.present
    drive.until(4)
    assert drive.go("E") is None
    drive.until(6)
    goal = drive.go("E")
    drive.until(100)
    assert drive.of(ServerPresent) == [
        (5, ServerPresent(True)), (20, ServerPresent(False)), (30, ServerPresent(True)),
    ]  # fmt: skip
    assert drive.ends == []
    assert drive.place == (14.0, 0.0)
    assert not drive.cancel(goal)
    assert drive.go("A") == 2


def test_the_robot_can_drive_to_a_position_off_the_graph():
    drive = Drive()
    field = FreeTravel(MOTION, [[(-5, -5), (45, -5), (45, 5), (-5, 5)]])
    first = drive.go("E")
    drive.until(10)
    assert drive.navigation.drive(10, (10.0, 4.0), field) == 10 + 4 + 5
    assert drive.navigation.drive(10, (10.0, 99.0), field) is None
    assert drive.until(100).ends == [(10, GoalEnded(first, GoalOutcome.ABORTED, False))]
    assert drive.place == (10.0, 4.0)


action = st.one_of(st.sampled_from("ABCDEZ").map(lambda name: ("go", name)), st.just(("cancel", "")))
fault = st.fixed_dictionaries(
    {"nth": st.integers(1, 5), "kind": st.sampled_from(["no_motion", "fails"]), "share_of_way": st.floats(0, 1)}
)


@settings(deadline=None)
@given(
    st.lists(st.tuples(action, st.floats(0, 60)), max_size=12),
    st.lists(fault, max_size=3),
    st.sampled_from(["accepted", "looks_rejected"]),
    st.sampled_from(["aborted", "success"]),
    st.sampled_from(["rejected", "aborted"]),
)
def test_every_accepted_goal_ends_once_and_in_order(steps, faults, cancel, superseded, unknown):
    drive = Drive(goals=faults, cancel=cancel, superseded=superseded, unknown_target=unknown)
    accepted = []
    for (verb, target), pause_s in steps:
        if verb == "go":
            goal = drive.go(target)
            accepted += [goal] if goal is not None else []
        elif accepted:
            drive.cancel(accepted[-1])
        drive.until(drive.now_s + pause_s)
    drive.until(drive.now_s + 1000)
    assert [event.goal_id for _, event in drive.ends] == accepted
    ended = {event.goal_id: time_s for time_s, event in drive.ends}
    assert all(time_s <= ended[event.goal_id] for time_s, event in drive.of(OnRoute))


FIELD = FreeTravel(MOTION, [[(-50.0, -50.0), (90.0, -50.0), (90.0, 50.0), (-50.0, 50.0)]])


def pose(drive, xy=(20.0, 0.0)):
    return drive.navigation.accept_pose(drive.now_s, xy, FIELD)


def test_a_pose_is_a_goal_with_the_distance_that_remains():
    drive = Drive()
    goal = pose(drive)
    drive.until(100, look_every_s=10.0)
    assert drive.ends == [(25.0, GoalEnded(goal, GoalOutcome.SUCCEEDED, True))]
    assert drive.of(Remaining)[:3] == [(10.0 * n, Remaining(goal, 20.0 - 10 * n)) for n in range(3)]


def test_poses_fail_with_an_error_code_and_are_rejected():
    drive = Drive(goals=[{"nth": 1, "kind": "fails", "error_code": 106}, {"nth": 2, "kind": "rejects"}])
    first = pose(drive)
    drive.until(50)
    assert drive.ends == [(10.0, GoalEnded(first, GoalOutcome.ABORTED, False, 106))]
    assert drive.place == (10.0, 0.0)
    assert pose(drive) is None
    assert pose(drive) is not None


def test_a_cancellation_that_is_ignored_for_a_while():
    drive = Drive(cancel_ignored_s=5.0)
    goal = pose(drive)
    drive.until(2)
    assert not drive.cancel(goal)
    drive.until(6.5)
    assert not drive.cancel(goal)
    drive.until(7)
    assert drive.cancel(goal)
    assert drive.until(50).ends == [(7, GoalEnded(goal, GoalOutcome.CANCELED, False))]
    assert drive.place == (7.0, 0.0)


# Persons: a seed gives the same mission, and advice is taken as the habits say

LATTICE = [Stop(f"{x} {y}", float(x), float(y)) for x in range(0, 100, 20) for y in range(0, 100, 20)]
WALK = RobotMotion(speed_mps=1.2, stop_overhead_s=0.0)


def trips(habits, count=30, seed=1):
    """Trips between corners: time, and length walked; and where each ended."""
    person = VirtualPerson(WALK, (0.0, 0.0), Habits(*habits), LATTICE, 0.1, np.random.default_rng(seed))
    travel, now_s, found = FreeTravel(WALK), 0.0, []
    for number in range(count):
        stop, before_m = LATTICE[(0, 4, 20, 24)[number % 4]], person.distance_m(now_s)
        seen_s = person.walk(now_s, travel, stop)
        person.stop(seen_s)
        found.append(
            (
                seen_s - now_s, person.distance_m(seen_s) - before_m,
                np.hypot(*(person.at(seen_s) - np.array(stop.xy))),
            )
        )  # fmt: skip
        now_s = seen_s
    return np.array(found)


def test_a_person_pauses_turns_wrong_and_stands_elsewhere_as_their_habits_say():
    obedient, slow, lost, own = map(trips, ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    time_s, walked_m, away_m = obedient.T
    assert away_m.max() < 5
    speed = walked_m[1:] / (time_s[1:] - 4.0)  # seen to stand after 4 s
    assert 1.0 < np.median(speed) < 1.35
    assert speed.std() > 0.03, "each trip has its own pace"
    assert 0.4 < (slow[:, 2] > 5).mean() < 1, (
        "a pause of more than 20 s is a stop of their own, a shorter one is not"
    )
    assert lost[:, 1].sum() > walked_m.sum() + 30 * 2
    assert lost[:, 2].max() < 5
    assert own[:, 2].min() > 5
    np.testing.assert_array_equal(obedient, trips((0, 0, 0)))
    assert polyline_length_m(np.array([(0.0, 0.0), (0.0, 80.0)])) > own[:, 1].min(), "one of the nearest stops"


@pytest.mark.slow
def test_the_same_seed_gives_the_same_mission_of_a_person():
    def mission(person, seed=3):
        return simulate_mission(
            MissionSettings("patches", hours=0.2, cell_m=4.0, seed=seed, person=person, speed_mps=1.2)
        )

    one, again, obedient, robot = mission("usual"), mission("0.1,0.1,0.1"), mission("obedient"), mission(None)
    assert one.log == again.log
    np.testing.assert_array_equal(one.soil_map.rate, again.soil_map.rate)
    assert one.log != mission("usual", 4).log
    assert len(obedient.visits) > 0.8 * len(robot.visits)
    own = [visit for visit in mission("0,0,0.6").visits if visit.name.startswith("x")]
    assert own, "stops of their own are measured"
    assert not [visit for visit in obedient.visits if visit.name.startswith("x")]


@pytest.mark.parametrize("text", ["tired", "0.1,0.2", "0.1,0.1,2", ""])
def test_other_people_are_refused_with_those_that_there_are(text):
    with pytest.raises(InputError, match="obedient, usual, or three probabilities"):
        Habits.parse(text)
    assert str(Habits.parse("0.1,0.1,0.1")) == "usual"
    assert PAUSE_S > 20
