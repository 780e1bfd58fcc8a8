# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When the counts of a sensor can be trusted."""

import pytest

from soilmoist_ros.exploration.guard.signals import CountTrust


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


def test_a_sensor_that_falls_silent_is_no_longer_judged():
    found = CountTrust(60.0)
    for number in range(9):
        found.take(10.0 * number, "noisy_tube")
    assert found.fault(80.0 + 180.0)
    assert found.fault(80.0 + 181.0) == ""
