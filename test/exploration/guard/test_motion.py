# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion and standstill in the noise of receivers of each kind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rehearsal.cases import Noise
from rehearsal.world import Receiver
from soilmoist_ros.exploration.guard.motion import KEPT_S, MEAN_S, Motion


def seen(noise, speed_mps, hz, seconds, seed=0, still_s=60.0):
    """Time and what is known after each second of a robot that stands at first, and then moves east."""
    receiver, motion = Receiver(noise, 1 / hz, np.random.default_rng(seed)), Motion()
    for number in range(int(seconds * hz)):
        at_s = number / hz
        motion.take(at_s, receiver.measure((speed_mps * max(0.0, at_s - still_s), 0.0)), noise.sd_m)
        if number % max(1, round(hz)) == 0:
            yield at_s, motion


def noise(wander_m, white_m, wander_s=60.0, **more):
    return Noise(white_sd_m=white_m, wander_sd_m=wander_m, wander_s=wander_s, **more)


RTK, POOR_RTK = noise(0.01, 0.01), noise(0.03, 0.04)
FLOAT, STANDALONE, WHITE = noise(0.3, 0.03), noise(1.5, 0.2), noise(0.0, 1.5)
HOLDING = noise(1.5, 0.1, holds=True)
RATES = st.sampled_from([0.5, 1.0, 5.0, 20.0])


@pytest.mark.slow
@pytest.mark.parametrize("receiver", [RTK, POOR_RTK, FLOAT, STANDALONE, noise(3.0, 0.3, 120.0), WHITE, HOLDING])
@pytest.mark.parametrize("hz", [0.5, 1.0, 5.0])
def test_no_noise_is_certain_motion_and_standstill_shows(receiver, hz):
    known = [
        (motion.moved(20.0).certain_m, motion.standing(4.0).for_s, motion.driven_m())
        for at_s, motion in seen(receiver, 0.0, hz, 900.0)
        if at_s > 30
    ]
    assert max(certain_m for certain_m, *_ in known) < 0.3
    assert np.mean([for_s > 0 for _, for_s, _ in known]) > 0.85
    assert sum(driven_m for *_, driven_m in known) < 5.0 * receiver.wander_sd_m + 0.1, "noise is no way"


@pytest.mark.slow
@settings(max_examples=20)
@given(st.sampled_from([RTK, POOR_RTK]), RATES, st.floats(0.05, 2.0), st.integers(0, 99))
def test_a_creeping_robot_with_rtk_never_stands_and_is_found(receiver, hz, speed_mps, seed):
    moving = [
        (at_s, motion.standing(4.0), motion.moved(30.0))
        for at_s, motion in seen(receiver, speed_mps, hz, 100, seed)
        if at_s > 75
    ]
    assert all(standing.for_s == 0 for _, standing, _ in moving)
    late_s = 90 if speed_mps < 0.1 else 80
    assert all(shift.certain_m > 0.5 for at_s, _, shift in moving if at_s > late_s)


@pytest.mark.parametrize(
    ("receiver", "speed_mps", "within_s"),
    [(RTK, 0.8, 3), (FLOAT, 0.3, 8), (FLOAT, 0.1, 40), (STANDALONE, 0.8, 25), (STANDALONE, 0.05, 500)],
)
def test_motion_is_found_in_the_noise_in_the_end(receiver, speed_mps, within_s):
    found = (at_s for at_s, motion in seen(receiver, speed_mps, 1.0, 700) if motion.moved(20.0).certain_m > 0.5)
    assert 60 <= next(found) <= 60 + within_s


@pytest.mark.parametrize(("receiver", "unseen_mps"), [(RTK, 0.0), (FLOAT, 0.1), (STANDALONE, 0.5), (HOLDING, 1.1)])
def test_it_is_said_which_motion_the_noise_hides(receiver, unseen_mps):
    *_, (_, motion) = seen(receiver, 0.0, 1.0, 100.0)
    assert motion.standing(4.0).unseen_mps == pytest.approx(unseen_mps, abs=0.1)


def test_a_change_of_the_receivers_quality_is_no_motion():
    """A place that was 2 m off by its own account becomes exact, and worse again."""
    motion = Motion()
    for second in range(180):
        rough = 60 <= second < 120
        motion.take(float(second), (2.0, 1.0) if rough else (0.01 * (second % 3), 0.0), 1.5 if rough else 0.02)
        assert motion.moved(10.0).certain_m < 0.5


def test_standing_takes_as_long_as_asked_for_and_places_after_a_time():
    motion = Motion()
    assert motion.standing(4.0).for_s == 0
    for second in range(10):
        motion.take(float(second), (max(0.0, 5.0 - second), 0.0), 0.01)
        assert (motion.standing(4.0).for_s > 0) == (second >= 9)
    assert motion.standing(4.0, since_s=5.0).for_s == 4.0
    assert motion.standing(4.0, since_s=6.0).for_s == 0
    for second in range(10, 100):
        motion.take(float(second), (0.0, 0.0), 3.0)
    assert motion.standing(30.0).for_s == motion.standing(200.0).for_s == 60.0, "no longer are places kept"


def test_places_are_kept_thinned_in_order_and_a_clock_that_goes_back_begins_anew():
    motion = Motion()
    for number in range(4000):
        motion.take(0.05 * number, (1.0, 1.0), 0.01)
    assert len(motion._means) <= KEPT_S / MEAN_S + 2
    motion.take(100.0, (50.0, 0.0), 0.01)
    assert motion.moved(0.0).length_m < 1e-6, "it was held up"
    motion.take(5.0, (50.0, 0.0), 0.01)
    assert motion.shift(4.0) is None
