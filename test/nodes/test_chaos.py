# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real nodes under faults, by ``chaos.py`` and ``soak_nodes.py``, and what their judge must find."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
import chaos
import soak_nodes
from diagnostic_msgs.msg import DiagnosticStatus
from disturbed_nodes import OF_THE_WORLD, ON_NODES, Disturber, Timeline, scenario_of
from real_nodes import START_S, Operator
from rosgraph_msgs.msg import Clock

from msg_adapters.mission import mission_to_message
from msg_adapters.point_cloud import to_seconds, to_time
from rehearsal.cases import Fault, Faults, Span
from rehearsal.judge import Kind
from soilmoist_ros.exploration.control.operator_request import Reply, ReplyCode
from soilmoist_ros.exploration.mission.types import MissionStatus, Phase
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.nodes.topics import CLOCK, LATCHED
from soilmoist_ros.recording.map_sources import RecordTail
from soilmoist_ros.simulation.robot.scenario import Scenario

TIME_FACTOR = 20.0
COUNTING = MissionStatus(
    now_s=0.0, phase=Phase.COUNTING, reason="counting", target=None, planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0,
    raw_counts=0, failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip


SPANS = (
    Span(Fault.CLOCK_FORWARD, 30.0, 1.0, 0.5), Span(Fault.KILL_MAPPER, 40.0, 1.0, 0.0),
    Span(Fault.LINK_GARBAGE, 60.0, 60.0, 0.0), Span(Fault.DISK_FULL, 90.0, 60.0, 0.0),
    Span(Fault.KILL_DRIVER, 200.0, 1.0, 0.0), Span(Fault.PAUSE, 280.0, 20.0, 0.0),
    Span(Fault.KILL_PLANNER, 350.0, 1.0, 0.0), Span(Fault.CLOCK_BACK, 480.0, 1.0, 0.5),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.process
def test_no_record_is_lost_and_nobody_is_disobeyed(tmp_path, monkeypatch):
    """Seen by a judge that finds what is wrong with the same evidence when it is spoiled."""
    honest, kept, witnessed = chaos.judged, RecordTail.read, chaos.RealNodes.witnessed
    spoiled = []

    def forgetful(self):
        found = kept(self)
        return found._replace(records=found.records[:5] + found.records[6:])

    def moved(self):
        found = witnessed(self)
        found.places[:] = [(at_s, (x_m + 500.0, y_m)) for at_s, (x_m, y_m) in found.places]
        found.goals[:] = [(at_s, (x_m + 500.0, y_m), name) for at_s, (x_m, y_m), name in found.goals]
        return found

    def twice(*run):
        with monkeypatch.context() as patch:
            patch.setattr(RecordTail, "read", forgetful)
            patch.setattr(chaos.RealNodes, "witnessed", moved)
            spoiled.extend(honest(*run))
        return honest(*run)

    monkeypatch.setattr(chaos, "judged", twice)
    monkeypatch.setattr(chaos, "BUDGET_S", 900.0)  # a killed node is back after minutes of simulated time
    case = chaos.Chaos("patches", "greedy", "goto_node", Faults(SPANS))
    violations, figures = chaos.run(case, 1, tmp_path / "run", TIME_FACTOR)
    assert violations == []
    assert figures["records"] > 10
    assert figures["goals"] >= 1
    assert figures["kills"] == 3
    assert {Kind.LOST, Kind.MAP_DIFFERS, Kind.OUTSIDE, Kind.GOAL_OUTSIDE} <= {one.kind for one in spoiled}


def test_states_that_a_starved_listener_missed_are_not_made_up():
    here, there = Stop("a", 0.0, 0.0), Stop("b", 4.3, 0.0)
    said = [(float(at_s), replace(COUNTING, target=here)) for at_s in range(20)]
    said += [(at_s, replace(COUNTING, target=there)) for at_s in (42.0, 43.0)]
    timeline = Timeline(said, late_s=10.0)
    assert timeline.at(-11.0) is None
    assert timeline.at(5.0) == said[0][1]
    assert timeline.at(30.0).phase is Phase.PLANNING, "it has driven from a to b, which nobody heard"
    assert timeline.at(60.0) == said[-1][1]


def test_a_state_without_a_time_is_from_when_it_was_heard(ros):
    operator = Operator(ros.domain, start_s=1000.0)
    try:
        publisher = ros.node.create_publisher(DiagnosticStatus, "mission", LATCHED)
        for heard, now_s in enumerate((1005.0, math.nan), 1):
            publisher.publish(mission_to_message(replace(COUNTING, now_s=now_s)))
            ros.wait_for(lambda heard=heard: len(operator.heard.statuses) == heard)
        assert [at_s for at_s, _ in operator.heard.statuses] == [5.0, 0.0], "no clock has been heard: it begins"
    finally:
        operator.close()


def test_a_goal_in_the_moment_of_the_resume_comes_after_it(ros, monkeypatch):
    operator = Operator(ros.domain, START_S)
    monkeypatch.setattr(operator, "ask", lambda request: Reply(ReplyCode.ACCEPTED, "resumed"))
    disturber = Disturber(SimpleNamespace(operator=operator), (), 300.0)
    clock = ros.node.create_publisher(Clock, "/clock", CLOCK)
    late_s = []
    try:
        for goal_s in (20.0, 40.39923024177551, 170.41072670006542):
            stamp = to_time(START_S + goal_s)
            heard_s = to_seconds(stamp) - START_S
            ros.wait_for(lambda s=stamp, h=heard_s: clock.publish(Clock(clock=s)) or operator.now_s == h)
            late_s.append(operator.now_s - goal_s)
            assert disturber.start()
            assert goal_s - 0.001 < disturber.acts.done[-1][0] <= goal_s
    finally:
        operator.close()
    assert max(late_s) > 0.0, "none of these times is heard as later than it was"


def test_seed_and_number_make_a_run():
    assert str(chaos.make_chaos(1, 3)) == str(chaos.make_chaos(1, 3)) != str(chaos.make_chaos(2, 3))
    firsts = {span.fault for number in range(60) for span in chaos.make_chaos(1, number).faults.spans}
    assert firsts == set(ON_NODES), "each fault has its turn"


def test_every_fault_of_the_world_makes_a_scenario():
    nothing = Scenario.model_validate(scenario_of([]))
    for fault in OF_THE_WORLD:
        made = Scenario.model_validate(scenario_of([Span(fault, 100.0, 60.0, 0.3)]))
        assert made != nothing, fault
    late = scenario_of([Span(Fault.LINK_CUT, 100.0, 60.0, 0.3)], begin_s=130.0)
    assert late["logger"]["outages"] == [{"at_s": 0.0, "for_s": 30.0, "kind": "cut"}]
    assert scenario_of([Span(Fault.LINK_CUT, 100.0, 60.0, 0.3)], begin_s=170.0)["logger"]["outages"] == []


@pytest.mark.parametrize(("index", "what"), [(1, "memory"), (2, "handles"), (3, "threads"), (4, "processor time")])
def test_growth_of_a_node_is_a_fault(index, what):
    def sample(number, grown):
        figures = [100, 150.0, 20, 16, 1.0 * number]
        figures[index] += grown**2 if index == 4 else grown
        return soak_nodes.Sample(0, 60.0 * number, 20.0 * number, {"mapper": tuple(figures)}, 20.0, 1.0, 1.0, 1.0)

    flat = [sample(number, 0) for number in range(40)]
    assert soak_nodes.grown(flat) == []
    (fault,) = soak_nodes.grown([sample(number, number) for number in range(40)])
    assert what in fault


def test_a_day_has_every_fault_and_ends_with_processes_that_last():
    spans = soak_nodes.day_of_faults(24.0, 1)
    assert {*soak_nodes.PERIODS_S, *soak_nodes.OF_GOALS, *soak_nodes.KILLS} <= {span.fault for span in spans}
    kills = [span.at_s for span in spans if span.fault in soak_nodes.KILLS]
    assert max(kills) < 0.3 * 86_400
    assert spans == soak_nodes.day_of_faults(24.0, 1)
