# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time at a factor, and its waits for planners: simulated_time.py."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import MAX_POSITIONS, Phase
from soilmoist_ros.foundation.errors import InputError, Level
from soilmoist_ros.simulation import RobotProgress, SimulatedTime, WaitingClock, end_to_react_to, read_start_time
from soilmoist_ros.simulation.robot.simulated_time import LIMITS_S, SHORT_S, Awaited, awaited


def test_simulated_time_follows_the_wall_clock_at_its_speed():
    time = SimulatedTime(speed=60, longest_step_s=0.1)
    assert [time.step_s(wall_s) for wall_s in (5.0, 5.05, 5.1, 5.15)] == pytest.approx([0, 3, 3, 3])


@given(st.lists(st.floats(-1, 100), max_size=20), st.floats(0.01, 10_000), st.floats(0.001, 1))
def test_pauses_of_the_machine_cause_no_jumps(pauses, speed, longest_s):
    time = SimulatedTime(speed, longest_s)
    wall_s = 0.0
    time.step_s(wall_s)
    for pause_s in pauses:
        wall_s += pause_s
        assert 0 <= time.step_s(wall_s) <= longest_s * speed * (1 + 1e-9)


def test_start_times():
    assert read_start_time("1970-01-02T00:00:00Z") == 86_400
    assert read_start_time("1970-01-02 01:00:00+01:00") == 86_400
    assert read_start_time("1970-01-02") == 86_400
    for bad in ("soon", "", "1969-12-31T00:00:00Z"):
        with pytest.raises(InputError, match="start time"):
            read_start_time(bad)


COUNTING = RobotProgress(Phase.COUNTING, sent_s=100.0, handled_s=100.0)
TRAVELLING = RobotProgress(Phase.TRAVELLING, sent_s=100.0, handled_s=50.0)
PLAN = {"robot_1": RobotProgress(Phase.PLANNING)}
RECORD = {"robot_2": replace(COUNTING, handled_s=90.0)}
ARRIVAL = {"robot_1": replace(TRAVELLING, goal_ended_s=107.0)}


class Clock(WaitingClock):
    """A clock with receivers of one epoch a second."""

    def __init__(self):
        super().__init__(epoch_s=1.0)

    def stands(self, wall_s, *waits):
        """Whether time stands still; the robots that are given are the ones that do not run."""
        robots = {"robot_1": TRAVELLING, "robot_2": COUNTING}
        for one in waits:
            robots |= one
        return self.may_run_to(wall_s, robots) < math.inf


@pytest.mark.parametrize(
    ("progress", "expected"),
    [
        (RobotProgress(Phase.PLANNING), Awaited.PLAN),
        (RobotProgress(Phase.FINISHED), Awaited.SAVE),
        (COUNTING, None),
        (replace(COUNTING, handled_s=90.0), Awaited.RECORD),
        (replace(COUNTING, handled_s=100.0 - 1e-6), None),  # stamps have been through messages
        (replace(COUNTING, handled_s=math.nan), None),
        (TRAVELLING, None),
        (replace(TRAVELLING, fixed_s=105.0, placed_s=100.0), Awaited.POSITION),
        (replace(COUNTING, fixed_s=105.0, placed_s=100.0), Awaited.POSITION),
        (replace(TRAVELLING, fixed_s=105.0, placed_s=math.nan), None),
        (replace(TRAVELLING, goal_ended_s=107.0), Awaited.ARRIVAL),
        (replace(TRAVELLING, waits_for_goal=True), Awaited.DEPARTURE),
    ],
)
def test_what_is_awaited(progress, expected):
    assert awaited(progress) is expected


def test_time_stands_still_until_all_is_there():
    clock = Clock()
    assert not clock.stands(0.0)
    assert clock.stands(1.0, PLAN, RECORD)
    assert clock.stands(5.0, PLAN)
    assert not clock.stands(9.0)
    assert clock.waited_s == 8.0
    assert not clock.stands(20.0)
    assert clock.waited_s == 8.0


def test_what_does_not_come_is_not_waited_for_again_until_it_comes_in_time():
    clock = Clock()
    limit_s = LIMITS_S[Awaited.RECORD]
    assert clock.stands(0.0, RECORD)
    assert clock.stands(limit_s - 0.1, RECORD)
    assert not clock.stands(limit_s, RECORD)
    assert not clock.stands(limit_s + 100, RECORD), "it stays excused"
    assert not clock.stands(200.0)
    assert clock.stands(201.0, RECORD), "the next time it has a short limit"
    assert not clock.stands(201.0 + SHORT_S, RECORD)
    assert not clock.stands(202.0)
    assert clock.stands(203.0, RECORD)
    assert not clock.stands(203.0 + SHORT_S / 2), "it came in time"
    assert clock.stands(204.0, RECORD)
    assert clock.stands(204.0 + limit_s - 0.1, RECORD), "the long limit applies again"


def test_a_long_wait_is_reported_by_its_cause():
    clock = Clock()
    clock.stands(0.0, RECORD)
    clock.stands(3.0, RECORD, PLAN)
    assert clock.long_wait is None
    assert (clock.health.level, clock.health.values["waits_for"]) == (Level.OK, "")
    clock.stands(6.0, RECORD, PLAN)
    assert clock.long_wait == ("robot_2", Awaited.RECORD)
    assert clock.health.level is Level.WARN
    assert clock.health.values == {"waits_for": "the last record of robot_2", "waited_s": "6.0"}
    clock.stands(9.0, PLAN)
    assert clock.long_wait == ("robot_1", Awaited.PLAN)
    clock.stands(10.0)
    assert clock.long_wait is None


def test_time_crawls_after_a_goal_because_the_planner_needs_positions():
    clock = WaitingClock(epoch_s=1.0)
    ends_s = [clock.may_run_to(wall_s, ARRIVAL) - 107.0 for wall_s in (5.0, 5.1, 5.3, 5.7, 6.5, 8.1, 11.3)]
    assert ends_s == pytest.approx([0, 1, 2, 3, 4, 5, 6])
    assert clock.may_run_to(12.0, ARRIVAL | RECORD) == -math.inf
    assert clock.may_run_to(12.1, {"robot_1": TRAVELLING}) == math.inf


PROGRESS = st.builds(
    RobotProgress, st.sampled_from([None, *Phase]), st.sampled_from([-math.inf, 90.0, 100.0]),
    st.sampled_from([-math.inf, math.nan, 90.0, 100.0]), st.sampled_from([math.nan, 95.0]), st.booleans(),
    st.sampled_from([-math.inf, 90.0, 100.0]), st.sampled_from([-math.inf, math.nan, 90.0, 100.0]),
)  # fmt: skip
ROBOTS = st.fixed_dictionaries({"robot_1": PROGRESS, "robot_2": PROGRESS})


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(0.01, 10), ROBOTS), max_size=30), ROBOTS)
def test_time_never_stands_forever(history, forever):
    clock = WaitingClock(epoch_s=1.0)
    wall_s = 0.0
    for step_s, robots in history:
        wall_s += step_s
        clock.may_run_to(wall_s, robots)
    clock.may_run_to(wall_s, forever)
    assert clock.may_run_to(wall_s + max(LIMITS_S.values()) + 0.1, forever) == math.inf


def test_an_untrue_arrival_does_not_stop_time_for_the_limit_of_the_client():
    """The client doubts an arrival after ten positions, or after 30 s of the computer's clock."""
    clock = Clock()
    untrue = {"robot_1": replace(ARRIVAL["robot_1"], goal_untrue=True)}
    assert clock.may_run_to(0.0, ARRIVAL) == 107.0
    assert clock.may_run_to(0.0, untrue) == 107.0 + MAX_POSITIONS
    assert MAX_POSITIONS < clock.may_run_to(1.0, untrue) - 107.0 < MAX_POSITIONS + 5, "then it crawls"


@pytest.mark.parametrize(
    ("now_s", "fixed_s", "waited_for"),
    [(101.0, 99.0, True), (102.5, 100.5, True), (102.5, 99.0, False), (102.5, -math.inf, False)],
)
def test_an_arrival_without_positions_is_not_waited_for(now_s, fixed_s, waited_for):
    assert (end_to_react_to(100.0, now_s, fixed_s, 1.0) == 100.0) is waited_for
    assert math.isnan(end_to_react_to(math.nan, now_s, fixed_s, 1.0))
