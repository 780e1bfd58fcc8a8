# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Battery, counts and emergency stop: what their messages show, whatever each of them leaves out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.signals import QUIET_S, Battery, BatteryLimit, CountTrust, EmergencyTopic


def faults(messages):
    limit, found = BatteryLimit(0.25, 0.0), []
    for charge, voltage_v in messages:
        limit.take(charge, voltage_v)
        found.append(limit.fault)
    return found


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 3))))
def test_messages_without_a_charge_change_nothing(sent):
    whole = faults([(charge, math.nan) for charge, _ in sent])
    mixed = [one for charge, between in sent for one in [(charge, math.nan), *[(math.nan, 48.0)] * between]]
    expected = [fault for fault, (_, between) in zip(whole, sent, strict=True) for _ in range(1 + between)]
    assert faults(mixed) == expected


def test_charges_of_a_silent_battery():
    battery = Battery()
    assert not battery.take(0.0, math.nan, math.nan)
    assert all(math.isnan(charge) for charge in battery.charges(1.0, 1.0))
    battery.take(0.0, 0.7, math.nan)
    battery.take(1000.0, 0.6, math.nan)
    now, later = battery.charges(3000.0, 2500.0)
    assert math.isclose(now, 0.4)
    assert math.isclose(later, 0.15)
    assert battery.charges(30_000.0, 1.0) == (0.0, 0.0)


# When the counts of a sensor can be trusted ---------------------------------------------------------------------


def trust(reasons, every_s=10.0, last_s=60.0):
    found = CountTrust(last_s)
    for number, reason in enumerate(reasons):
        found.take(number * every_s, reason)
    return found.fault((len(reasons) - 1) * every_s)


@pytest.mark.parametrize(
    ("reasons", "trusted"),
    [
        ([""] * 9, True),
        (["noisy_tube"] * 2, True),  # too few to judge
        (["noisy_tube"] * 3, False),
        (["noisy_tube", ""] * 9, True),
        (["noisy_tube", "noisy_tube", ""] * 9, False),
        (["noisy_tube"] * 9 + [""] * 3, False),
        (["noisy_tube"] * 9 + [""] * 4, True),
        (["place_jump"] * 9, True),  # the places are bad, and the guard of places answers
        (["clock_drift"] * 9 + ["stuck_tube"] * 3, False),
    ],
)
def test_more_than_half_of_the_last_records_must_be_good(reasons, trusted):
    assert (trust(reasons) == "") is trusted


def test_a_slow_sensor_is_judged_by_its_last_three_records():
    assert (
        trust(["dead_tube"] * 3, every_s=60.0)
        == "3 of the last 3 records are quarantined (tube counts too little)"
    )
    assert trust(["dead_tube", "", ""], every_s=60.0) == ""


# Presses and releases of an emergency stop on one topic ---------------------------------------------------------


def test_a_press_counts_once_and_a_release_of_the_only_publisher_at_once():
    topic = EmergencyTopic()
    heard = [topic.hear(pressed, 1, 0.0) for pressed in (True, True, False, False, True)]
    assert heard == [True, None, False, None, True]


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
