# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trust in the time of day: clock_watch.py."""

import pytest

from soilmoist_ros.recording.bag.retention import ClockWatch, is_synchronised

NOW_S = 1_780_000_000.0


@pytest.fixture
def watch():
    """A watch that has seen a synchronised clock for an hour."""
    seen = ClockWatch()
    for minute in range(61):
        seen.look(NOW_S + 60 * minute, 60.0 * minute, synchronised=minute == 0)
    return seen


def test_a_clock_that_nobody_keeps_is_not_trusted():
    watch = ClockWatch()
    for minute in range(100):
        watch.look(NOW_S + 60 * minute, 60.0 * minute, synchronised=False)
        assert (watch.right, watch.settled) == (False, False)


def test_a_clock_is_settled_after_an_hour_and_needs_no_network_then(watch):
    assert (watch.right, watch.settled) == (True, True)
    watch.look(NOW_S + 3661.0, 3660.0, synchronised=False)  # it has drifted
    assert (watch.right, watch.settled) == (True, True)


@pytest.mark.parametrize("step_s", [366 * 86_400.0, -86_400.0])
def test_a_clock_that_was_set_is_not_settled(watch, step_s):
    watch.look(NOW_S + 3660.0 + step_s, 3660.0, synchronised=False)
    assert (watch.right, watch.settled) == (False, False)
    watch.look(NOW_S + 3720.0, 3720.0, synchronised=True)  # and back again
    assert (watch.right, watch.settled) == (True, False)


def test_the_kernel_is_asked():
    assert is_synchronised() in (True, False)
