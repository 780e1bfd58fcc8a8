# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Mission time under clocks that are set."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.control.mission_feed import MissionClock, boot_id
from soilmoist_ros.exploration.mission.events import ClockStarted, ClockStepped, Moved
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import MissionRules
from soilmoist_ros.exploration.planning.dwell import parse_dwell

RULES = MissionRules(budget_s=900.0, dwell=parse_dwell("fmi:30"))
NOW_S = 1.7e9


@dataclass
class Computer:
    """The clocks of a computer."""

    ros_s: float = NOW_S
    steady_s: float = 100.0

    def pass_time(self, time_s, step_s=0.0):
        self.steady_s += time_s
        self.ros_s += time_s + step_s

    def clock(self, boot="first", simulated=False):
        return MissionClock(lambda: self.ros_s, None if simulated else lambda: self.steady_s, boot)


def give(mission, clock):
    events = clock.events(mission.state)
    for event in events:
        mission.step(event)
    return events


@given(st.lists(st.tuples(st.floats(0, 1e4), st.sampled_from([0.0, 0.0, -3600.0, 21600.0, 1.5])), max_size=20))
@pytest.mark.slow
def test_time_runs_evenly_and_each_step_is_noted_once(course):
    computer, mission = Computer(), Mission(RULES)
    clock = computer.clock()
    assert clock.now_s() == NOW_S
    give(mission, clock)
    passed_s = 0.0
    for time_s, step_s in course:
        computer.pass_time(time_s, step_s)
        passed_s += time_s
        steps = [event.step_s for event in give(mission, clock)]
        assert steps == ([pytest.approx(step_s, abs=1e-5)] if step_s else [])
        assert clock.now_s() == pytest.approx(NOW_S + passed_s, abs=1e-5)
        assert clock.now_s() + mission.state.stamp_offset_s == pytest.approx(computer.ros_s, abs=1e-5)
        assert give(mission, clock) == []


def test_another_process_goes_on_in_the_same_time():
    computer, mission = Computer(), Mission(RULES)
    clock = computer.clock()
    give(mission, clock)
    computer.pass_time(50.0)
    mission.step(Moved(clock.now_s(), 0.0, 0.0))
    computer.pass_time(20.0, step_s=-3600.0)  # while no process runs
    again = computer.clock()
    again.go_on_from(mission.state)
    assert again.now_s() == pytest.approx(NOW_S + 70.0)
    assert give(mission, again) == [ClockStepped(pytest.approx(NOW_S + 70.0), pytest.approx(-3600.0))]


@pytest.mark.parametrize(("since_s", "expected_s"), [(500.0, 500.0), (-1e9, 50.0)])
def test_after_a_start_of_the_computer_ros_time_decides_but_never_backwards(since_s, expected_s):
    computer, mission = Computer(), Mission(RULES)
    give(mission, computer.clock())
    mission.step(Moved(NOW_S + 50.0, 0.0, 0.0))
    booted = Computer(ros_s=NOW_S + since_s, steady_s=3.0)
    clock = booted.clock("second")
    clock.go_on_from(mission.state)
    assert clock.now_s() == pytest.approx(NOW_S + expected_s)
    started, *steps = give(mission, clock)
    assert isinstance(started, ClockStarted)
    assert [event.step_s for event in steps] == ([] if since_s > 0 else [pytest.approx(since_s - 50.0)])
    assert clock.now_s() + mission.state.stamp_offset_s == pytest.approx(booted.ros_s)


def test_simulated_time_is_mission_time():
    computer = Computer(ros_s=0.0)
    clock = computer.clock(simulated=True)
    assert clock.now_s() == 0.0
    computer.ros_s = 12.0
    assert clock.now_s() == 12.0
    assert clock.events(Mission(RULES).state) == []


def test_the_computer_names_its_start():
    assert boot_id() == boot_id() != ""
