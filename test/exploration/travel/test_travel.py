# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Travel times and ways, and stops (stop.py)."""

import math
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import Stop, TravelGraph, way_points
from soilmoist_ros.exploration.travel.travel import (
    FreeTravel,
    GraphTravel,
    LearnedMotion,
    Leg,
    RobotMotion,
    along,
    polyline_length_m,
)

SQUARE = np.array([[0, 0], [10, 0], [10, 10], [0, 10]], float)
BLOCK = np.array([[4, 2], [6, 2], [6, 8], [4, 8]], float)
STILL = RobotMotion(1.0, 0.0)
MIDDLES = (np.arange(4) + 0.5) / 4


def stops(*places):
    return tuple(Stop(f"s{i}", x, y) for i, (x, y) in enumerate(places))


@pytest.mark.parametrize("wrong", [{"speed_mps": 0}, {"stop_overhead_s": -1}, {"metre_cost_s": -1.0}])
def test_published_motion(wrong):
    assert RobotMotion().travel_s(6.0) == pytest.approx(22.0)
    with pytest.raises(ValueError, match=next(iter(wrong))):
        RobotMotion(**wrong)


def test_the_way_bends_around_a_no_go_area():
    travel = FreeTravel(STILL, [SQUARE], [BLOCK])
    way = travel.route((1, 5), Stop("s", 9, 6))
    np.testing.assert_allclose(way, [[1, 5], [4, 8], [6, 8], [9, 6]])
    expected = np.sqrt(18) + 2 + np.sqrt(13)
    assert travel.lengths_m(np.array((1, 5)), [Stop("s", 9, 6)])[0] == pytest.approx(expected)
    np.testing.assert_allclose(travel.travel_s((1, 5), stops((9, 6), (1, 9))), [expected, 4])


def test_places_inside_a_no_go_area_outside_or_in_another_part_cannot_be_reached():
    places = stops((5, 5), (12, 5), (25, 5), (2, 2))
    travel = FreeTravel(STILL, [SQUARE, np.add(SQUARE, [20, 0])], [BLOCK])
    np.testing.assert_array_equal(np.isfinite(travel.travel_s((1, 1), places)), [False, False, False, True])
    with pytest.raises(ValueError, match="s0 cannot be reached"):
        travel.route((1, 1), places[0])
    assert travel.lengths_m(np.array((1, 1)), [places[1]])[0] == np.inf
    assert FreeTravel(STILL, [SQUARE]).lengths_m(np.array((1, 1)), [places[1]])[0] == np.inf


def test_a_robot_outside_enters_at_the_nearest_place():
    travel = FreeTravel(STILL, [SQUARE], [BLOCK])
    np.testing.assert_allclose(travel.route((-2, 3), Stop("s", 3, 7)), [[-2, 3], [0, 3], [3, 7]])
    assert travel.lengths_m(np.array((-2, 3)), [Stop("s", 3, 7)])[0] == pytest.approx(7)
    assert travel.lengths_m(np.array((4.5, 5)), [Stop("s", 3, 5)])[0] == pytest.approx(1.5)


def test_time_and_length_are_those_of_the_route():
    motion = RobotMotion(0.5, 3.0)
    nodes = stops((0, 0), (5, 0), (5, 5), (0, 5))
    edges = [(a.name, b.name) for a, b in pairwise(nodes)]
    graph = TravelGraph.from_edges(nodes, edges + [(b, a) for a, b in edges])
    assert len(GraphTravel(graph, motion).route((-1.0, 0.0), nodes[2])) == 4, "to the nearest node, and on"
    for travel in (FreeTravel(motion, [SQUARE], [BLOCK]), GraphTravel(graph, motion)):
        for place in ((1.0, 1.0), (-3.0, 4.0), (0.0, 0.0)):
            times = travel.travel_s(place, nodes[:2] + nodes[3:])
            for stop, time in zip(nodes[:2] + nodes[3:], times, strict=True):
                way = travel.route(place, stop)
                assert time == pytest.approx(motion.travel_s(polyline_length_m(way)))
                assert travel.lengths_m(np.array(place), [stop])[0] == pytest.approx(polyline_length_m(way))


@pytest.mark.parametrize("no_go", [[], [BLOCK]])
def test_times_of_tours_are_those_of_single_trips(no_go):
    motion = RobotMotion(1.0, 3.0)
    places = stops((1, 1), (9, 9), (1, 9), (9, 2), (3, 5), (12, 5))
    edges = [("s0", "s2"), ("s2", "s4"), ("s4", "s1"), ("s1", "s3")]
    graph = TravelGraph.from_edges(places, edges + [(b, a) for a, b in edges])
    route = np.array([4, 0, 3, 1, 5])  # the last one is out of reach
    chosen = [places[index] for index in route]
    for travel in (FreeTravel(motion, [SQUARE], no_go), GraphTravel(graph, motion)):
        single = np.array([travel.travel_s((stop.x_m, stop.y_m), chosen) for stop in chosen])
        np.testing.assert_allclose(travel.legs_s(places, route), single.diagonal(1))
        np.fill_diagonal(single, 0.0)
        np.testing.assert_allclose(travel.between_s(places, route)[:4], single[:4])


@pytest.mark.parametrize("start", [(1.0, 5.0), (1.3, 8.8), (5.0, 1.0)])
def test_places_along_many_ways_are_those_of_each_route(start):
    places = stops((1, 9), (9, 5), (1, 1), (9, 9), (5, 1))
    edges = [("s0", "s2"), ("s2", "s4"), ("s4", "s1"), ("s1", "s3")]
    graph = TravelGraph.from_edges(places, edges + [(b, a) for a, b in edges])
    shares = np.tile(MIDDLES, (len(places), 1))
    for travel in (FreeTravel(STILL), FreeTravel(STILL, [SQUARE], [BLOCK]), GraphTravel(graph, STILL)):
        found = travel.along(start, places, shares)
        expected = [along(travel.route(start, place), MIDDLES) for place in places]
        np.testing.assert_allclose(found, expected, atol=1e-9)


PRIOR = RobotMotion(0.6, 12.0, 5.0)


def drive(learned, truth, legs, rng, late_s=0.0, noise_s=1.0):
    for number in range(legs):
        length = rng.uniform(5.0, 80.0)
        time_s = float(truth.travel_s(length)) + rng.normal(0.0, noise_s)
        learned.add(Leg(length, time_s + (late_s if number % 4 == 3 else 0.0)))
    return learned


@given(speed=st.floats(0.3, 1.2), overhead=st.floats(2.0, 40.0), late_s=st.sampled_from([0.0, 200.0]))
@settings(max_examples=30, deadline=None)
def test_the_truth_is_found_and_a_leg_with_an_obstacle_is_hardly_learned_from(speed, overhead, late_s):
    truth, rng = RobotMotion(speed, overhead), np.random.default_rng(1)
    learned = drive(LearnedMotion(PRIOR), truth, 40, rng, late_s).motion
    for length in (10.0, 40.0, 80.0):
        assert float(learned.travel_s(length)) == pytest.approx(float(truth.travel_s(length)), rel=0.08, abs=3.0)
    assert learned.metre_cost_s == PRIOR.metre_cost_s


def test_true_parameters_stay_and_limits_are_never_shorter_than_with_them():
    rng = np.random.default_rng(3)
    same = drive(LearnedMotion(PRIOR), PRIOR, 30, rng, noise_s=0.0)
    assert same.motion is PRIOR
    assert "as set" in str(same)
    fast = drive(LearnedMotion(PRIOR), RobotMotion(1.2, 5.0), 30, rng)
    assert fast.cautious == PRIOR
    slow = drive(LearnedMotion(PRIOR), RobotMotion(0.3, 30.0), 30, rng)
    assert slow.cautious == slow.motion


def test_only_a_leg_that_ends_at_its_stop_counts():
    learned, way = LearnedMotion(PRIOR), np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 10.0]])
    assert not learned.arrive(5.0)
    learned.set_off(10.0, way)
    learned.give_up()
    assert not learned.arrive(90.0)
    learned.set_off(100.0, way, slower_m=3.0)
    assert learned.arrive(250.0)
    assert not learned.arrive(300.0), "counting again after a pause is no arrival"
    assert list(learned.legs) == [Leg(43.0, 150.0)]
    assert "learned from 1 legs" in str(learned)


# Stops -----------------------------------------------------------------------------------------------------------

STOP = Stop("s", 10.0, 0.0)


@pytest.mark.parametrize(
    ("way", "goals"),
    [
        ([(10, -5), (10, 0)], [(10, 0, 90)]),
        ([(0, 5), (0, 0), (0, 0)], [(0, 0, -90), (10, 0, 0)]),  # the stop is no corner of the way
        ([(10, 0)], [(10, 0, 0)]),
        ([(10, 0), (10, 0)], [(10, 0, 0)]),
        ([(0, 0), (4, 4), (4, 0), (10, 0)], [(4, 4, 45), (4, 0, -90), (10, 0, 0)]),
        ([(0, 0), (2, 0), (4, 0), (10, 0)], [(10, 0, 0)]),  # nodes on a straight line are no goals
        ([(0, 0), (12, 0), (10, 0)], [(12, 0, 0), (10, 0, 180)]),  # a way back is kept
    ],
)
def test_goals_are_the_bends_of_a_way_and_its_stop_and_face_along_it(way, goals):
    found = way_points(way, STOP)
    assert [(one.stop.x_m, one.stop.y_m, round(math.degrees(one.heading_rad))) for one in found] == goals
    assert found[-1].stop == STOP
    assert all("s" in one.stop.name for one in found)


ASK_AT_ONCE = """
from threading import Thread
import numpy as np
from soilmoist_ros.exploration.travel.stop import DrivableArea

outline, pond = [(0, 0), (50, 0), (50, 50), (0, 50)], [(20, 20), (30, 20), (30, 30), (20, 30)]

def ask(area, seed):
    rng = np.random.default_rng(seed)
    for _ in range(100):
        start, end = rng.uniform(0, 50, (2, 20, 2))
        area.contains(start)
        area.allows(start, end)

for _ in range(30):
    area = DrivableArea([outline], [pond], 0.5)
    threads = [Thread(target=ask, args=(area, seed)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
"""


@pytest.mark.slow
def test_planning_and_guard_may_ask_at_once():
    """In a process that may crash: two threads that use one prepared geometry crash it."""
    assert subprocess.run([sys.executable, "-c", ASK_AT_ONCE], check=False).returncode == 0
