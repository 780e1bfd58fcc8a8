# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation.robot.simulated_time import SimulatedTime, read_start_time


def test_simulated_time_follows_the_wall_clock_at_its_speed():
    time = SimulatedTime(speed=60, longest_step_s=0.1)
    assert [time.step_s(wall_s) for wall_s in (5.0, 5.05, 5.1, 5.15)] == pytest.approx([0, 3, 3, 3])


def test_simulated_time_starts_with_the_first_call():
    time = SimulatedTime(speed=10, longest_step_s=0.1)
    assert time.step_s(100.0) == 0.0
    assert time.step_s(100.05) == pytest.approx(0.5)


@given(st.lists(st.floats(-1, 100), max_size=20), st.floats(0.01, 10_000), st.floats(0.001, 1))
def test_pauses_of_the_machine_cause_no_jumps(pauses, speed, longest_s):
    time = SimulatedTime(speed, longest_s)
    wall_s = 0.0
    time.step_s(wall_s)
    for pause_s in pauses:
        wall_s += pause_s
        assert 0 <= time.step_s(wall_s) <= longest_s * speed * (1 + 1e-9)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_an_invalid_speed_is_rejected(bad):
    with pytest.raises(ValueError, match="speed must be > 0"):
        SimulatedTime(bad, 0.1)


def test_start_times():
    assert read_start_time("1970-01-02T00:00:00Z") == 86_400
    assert read_start_time("1970-01-02 01:00:00+01:00") == 86_400
    assert read_start_time("1970-01-02") == 86_400
    for bad in ("soon", "", "1969-12-31T00:00:00Z"):
        with pytest.raises(InputError, match="start time"):
            read_start_time(bad)
