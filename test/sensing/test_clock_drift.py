# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drift of the logger's clock (clock.py)."""

import numpy as np
import pytest

from soilmoist_ros.sensing.clock_drift import ClockDrift


def drift(offsets):
    clock = ClockDrift()
    for number, offset_s in enumerate(offsets):
        clock.add(1.7e9 + 60.0 * number, float(offset_s))
    return clock


def test_a_drift_is_found_among_late_lines_and_taken_off():
    rng = np.random.default_rng(1)
    true = 4.0 + np.arange(1440) * 60.0 * 2e-4  # 0.72 s/h
    late = rng.exponential(0.5, 1440)
    late[::50] += 40.0
    clock = drift(true + late)
    assert clock.is_clear
    assert clock.slope == pytest.approx(2e-4, rel=0.05)
    assert clock.ahead_s(1.7e9 + 86400) == pytest.approx(4.0 + 17.28 + 0.35, abs=0.4)
    assert "drifts by +0.7" in clock.message


def test_a_clock_that_is_set_begins_anew_after_three_comparisons_and_late_lines_do_not():
    late = [*[3600.0] * 6, 3640.0, 3600.0, 3700.0, 3760.0, 3820.0] * 200
    clock = drift([*late, *[3600.0] * 3])
    assert (clock.n_steps, clock.ahead_s(1.8e9)) == (0, 3600.0)
    for number, offset_s in enumerate((0.0, 1.0, 0.0, 1.0, 0.0)):
        assert clock.ahead_s(1.8e9) == (3600.0 if number < 3 else pytest.approx(0.5, abs=0.5))
        clock.add(1.8e9 + number, offset_s)
    before, since = clock.segments
    assert (before.median_s, since.median_s, len(since)) == (3600.0, 0.0, 5)
    assert list(clock.steps) == ["the logger's clock was set: +3600 s off GNSS time, now +0 s"]


def test_first_lines_that_are_late_are_no_clock_that_was_set():
    clock = drift([40.0, *[0.0] * 9])
    assert (clock.n_steps, clock.ahead_s(1.7e9)) == (0, 0.0)
