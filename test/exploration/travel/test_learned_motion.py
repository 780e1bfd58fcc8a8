# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Learned motion: the truth is found, obstacles are not learned, and equal parameters stay as they are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.travel.learned_motion import LearnedMotion, Leg
from soilmoist_ros.exploration.travel.travel import RobotMotion

PRIOR = RobotMotion(0.6, 12.0, 1.0, stop_cost_s=5.0)


def drive(learned, truth, legs, rng, late_s=0.0, noise_s=1.0):
    """Legs of 5 to 80 m, every fourth one with an obstacle."""
    for number in range(legs):
        length, turn = rng.uniform(5.0, 80.0), rng.uniform(0.0, 3.0)
        time_s = float(truth.travel_s(length, turn)) + rng.normal(0.0, noise_s)
        learned.add(Leg(length, turn, time_s + (late_s if number % 4 == 3 else 0.0)))
    return learned


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    speed=st.floats(0.3, 1.2), overhead=st.floats(2.0, 40.0), turn=st.floats(0.3, 3.0), seed=st.integers(0, 100)
)
def test_the_truth_is_found(speed, overhead, turn, seed):
    truth = RobotMotion(speed, overhead, turn)
    learned = drive(LearnedMotion(PRIOR), truth, 40, np.random.default_rng(seed)).motion
    for length, turned in ((10.0, 0.0), (40.0, 1.0), (80.0, 3.0)):
        assert float(learned.travel_s(length, turned)) == pytest.approx(
            float(truth.travel_s(length, turned)), rel=0.08, abs=3.0
        )
    assert learned.stop_cost_s == PRIOR.stop_cost_s


def test_a_leg_with_an_obstacle_is_hardly_learned_from():
    truth = RobotMotion(0.5, 15.0, 1.0)
    learned = drive(LearnedMotion(PRIOR), truth, 40, np.random.default_rng(1), late_s=200.0).motion
    assert float(learned.travel_s(40.0, 1.0)) == pytest.approx(float(truth.travel_s(40.0, 1.0)), rel=0.06)


def test_parameters_that_are_true_stay_as_they_are():
    learned = drive(LearnedMotion(PRIOR), PRIOR, 30, np.random.default_rng(2), noise_s=0.0)
    assert learned.motion is PRIOR
    assert "as set" in str(learned)


def test_limits_are_never_shorter_than_with_the_parameters():
    rng = np.random.default_rng(3)
    fast = drive(LearnedMotion(PRIOR), RobotMotion(1.2, 5.0, 0.5), 30, rng)
    assert fast.cautious == PRIOR
    slow = drive(LearnedMotion(PRIOR), RobotMotion(0.3, 30.0, 2.0), 30, rng)
    assert slow.cautious == slow.motion


@pytest.mark.parametrize(("near_s", "counted"), [(0, 0.4), (10, 1.0)])
def test_overhead_counts_only_as_far_as_it_is_counted_at_the_stop(near_s, counted):
    learned, way = LearnedMotion(PRIOR), np.array([[0.0, 0.0], [30.0, 0.0]])
    for leg in range(40):
        learned.set_off(100.0 * leg, way)
        learned.count((10.0, 0.0), 10.0)
        for _ in range(near_s // 10):
            learned.count((29.5, 0.0), 10.0)
        learned.arrive(100.0 * leg + 62.0)
        learned.count((30.0, 0.0), 10.0)
        learned.count((30.0, 0.0), 10.0)
    assert learned.motion.overhead_counted == pytest.approx(counted, abs=0.15)
    assert learned.motion.stop_overhead_s == PRIOR.stop_overhead_s


def test_only_a_leg_that_ends_at_its_stop_counts():
    learned, way = LearnedMotion(PRIOR), np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 10.0]])
    assert not learned.arrive(5.0)
    learned.set_off(10.0, way)
    learned.give_up()
    assert not learned.arrive(90.0)
    learned.set_off(100.0, way)
    assert learned.arrive(250.0)
    assert not learned.arrive(300.0), "counting again after a pause is no arrival"
    assert list(learned.legs) == [Leg(40.0, np.pi / 2, 150.0)]
    assert "learned from 1 legs" in str(learned)
