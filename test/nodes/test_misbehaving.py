# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Real nodes before a navigation that misbehaves: scenarios of ``scripts/misbehaving``, and its judge."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
pytest.importorskip("nav2_msgs")
from soilmoist_ros.exploration import MissionStatus, Phase, Stop
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.sensing.records import CountRecord

NAMES = ("pond", "other_goal_driving", "jump_8m")  # rehearsals have more, and scripts/misbehaving all


@pytest.fixture(scope="module")
def misbehaving(load_script):
    return load_script("misbehaving")


@pytest.fixture(scope="module")
def results(misbehaving, tmp_path_factory):
    """Results by name; three scenarios run at once."""
    found = misbehaving.results(NAMES, tmp_path_factory.mktemp("misbehaving"), 3)
    return {result["name"]: result for result in found}


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("name", NAMES)
def test_the_nodes_answer_a_misbehaving_navigation(results, name):
    assert results[name]["faults"] == [], results[name]


@pytest.fixture
def judged(misbehaving, tmp_path):
    """A function that shows the judge a robot at (20, 20); returns the violations."""

    def judge(said=(), records=(), samples=None, goals=(), shift_m=0.0, **values):
        scenario = misbehaving.Scenario("made up", "driving", [], ["0"], [], values.pop("must", ""))
        robot = misbehaving.MisbehavingRobot(scenario, tmp_path)
        robot.track = [(0.1 * n, 20.0 + min(shift_m * n / 100, shift_m), 20.0) for n in range(200)]
        robot.begun_s = robot.seen_s = 0.0
        robot.goals, robot.graph = list(goals), SimpleNamespace(xy=np.array([(20.0, 20.0), (22.0, 20.0)]))
        robot.panel = SimpleNamespace(
            said=list(said), foreign=set(), heard=SimpleNamespace(records=records, samples=samples, visits=[])
        )
        for name, value in values.items():
            setattr(robot, name, value)
        return robot._judged()["faults"]

    return judge


STATUS = MissionStatus(
    now_s=0.0, phase=Phase.CANCELLING, reason="", target=Stop("a", 22.0, 20.0), planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0,
    failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip
PAUSED = [(5.0, STATUS, []), (8.0, replace(STATUS, phase=Phase.PAUSED), ["jump"])]


def test_the_judge_finds_what_must_not_happen(judged):
    record = CountRecord(12.0, 28.0, 20.0, math.nan, 40, 2.0, 2.0)
    mapped = Samples([(28.0, 20.0)], [40], [2.0])
    assert judged(PAUSED, [record], Samples([(20.0, 20.0)], [40], [2.0])) == []
    assert judged(PAUSED, shift_m=2.0) == ["paused of a robot that moves 0.60 m in 3 s"]
    assert judged(PAUSED, must="quiet") == ["an alarm without need"]
    assert judged([(5.0, replace(STATUS, phase=Phase.COUNTING), [])]) == ["counts at a from 2.0 m away"]
    assert judged(records=[record], samples=mapped) == ["1 records farther than 3 m from the truth are mapped"]
    assert judged(goals=[(9.0, b"")], foreign_s=5.0) == ["a goal against another client after 4.0 s"]
    assert judged(shift_m=9.0, must="stop") == ["no standstill in 3 s"]
    assert judged(must="ask") == ["no stop asked for in 3 s"]
