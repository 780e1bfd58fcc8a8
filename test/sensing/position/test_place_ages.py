# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Ages of places by their stamps, whatever the clock that makes them shows."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.position.place_judge import COMPARED, PlaceAges


def used(stamp_less_now_s=0.0, seconds=40):
    """Ages after some seconds of places that come at once; the next one comes at ``seconds``."""
    ages = PlaceAges()
    for second in range(seconds):
        ages.age_s(float(second), second + stamp_less_now_s)
    return ages


@pytest.mark.parametrize("ahead_s", [0.0, -3600.0, 1e9])
def test_what_a_stalled_connection_held_back_has_its_age_whatever_the_clock_shows(ahead_s):
    ages = used(ahead_s, 10)
    came = [ages.age_s(100.0, stamp_s + ahead_s) for stamp_s in range(10, 101)]
    assert came == [100.0 - stamp_s for stamp_s in range(10, 101)]
    assert ages.age_s(101.0, 101.0 + ahead_s) == 0.0


def test_a_process_that_starts_in_a_stall_does_not_know_until_the_next_second():
    ages = PlaceAges()
    assert {ages.age_s(50.0, stamp_s) for stamp_s in range(51)} == {math.inf}
    assert ages.age_s(51.0, 51.0) == 0.0


def test_what_comes_late_all_the_time_is_a_clock_that_is_wrong():
    ages = used()
    late = [ages.age_s(40.0 + second, second - 20.0) for second in range(COMPARED + 1)]
    assert late[0] == 60.0
    assert late[-1] == 0.0


def test_a_clock_that_was_set_and_a_time_that_begins_anew():
    ages = used()
    ages.clear()
    assert ages.age_s(41.0, -3559.0) == math.inf
    assert ages.age_s(42.0, -3558.0) == 0.0
    assert ages.age_s(1.0, 1.0) == math.inf


def test_without_a_stamp_a_place_is_new():
    assert PlaceAges().age_s(5.0, math.nan) == 0.0


@given(st.lists(st.floats(0.0, 200.0), min_size=1, max_size=60), st.floats(-1e9, 1e9))
def test_no_age_is_negative_nor_more_than_the_delay(delays_s, ahead_s):
    ages = used(ahead_s, 2)
    for number, delay_s in enumerate(delays_s):
        now_s = 2.0 + number
        assert 0.0 <= ages.age_s(now_s, now_s - delay_s + ahead_s) <= delay_s + 1e-6
