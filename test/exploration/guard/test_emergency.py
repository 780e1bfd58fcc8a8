# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Presses and releases of an emergency stop on one topic."""

from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.signals import QUIET_S, EmergencyTopic


def test_a_press_counts_once_and_a_release_of_the_only_publisher_at_once():
    topic = EmergencyTopic()
    heard = [topic.hear(pressed, 1, 0.0) for pressed in (True, True, False, False, True)]
    assert heard == [True, None, False, None, True]


def test_the_first_release_counts_as_a_restored_mission_may_still_be_stopped():
    assert EmergencyTopic().hear(False, 1, 0.0) is False


def test_a_second_publisher_that_repeats_released_does_not_outvote_the_first():
    topic = EmergencyTopic()
    assert topic.hear(True, 2, 0.0) is True
    for tenth in range(1, 100):
        assert topic.hear(tenth % 2 == 1, 2, tenth / 10) is None
        assert topic.tick(tenth / 10) is None
    assert topic.hear(False, 2, 10.0) is None
    assert topic.tick(9.9 + QUIET_S - 0.01) is None
    assert topic.tick(9.9 + QUIET_S) is False
    assert topic.tick(99.0) is None


messages = st.lists(st.tuples(st.booleans(), st.integers(1, 3), st.floats(0, 3)), min_size=1, max_size=30)


@given(messages)
def test_a_press_always_stops_and_only_a_release_after_it_ends_that(messages):
    topic, stopped, now_s, released = EmergencyTopic(), False, 0.0, False
    for pressed, publishers, wait_s in messages:
        now_s += wait_s
        change = topic.tick(now_s)
        assert change is None or (change is False and released)
        stopped = stopped if change is None else change
        change = topic.hear(pressed, publishers, now_s)
        released = not pressed
        stopped = stopped if change is None else change
        assert stopped or not pressed
