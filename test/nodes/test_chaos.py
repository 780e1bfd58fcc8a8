# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real nodes under faults, by ``chaos.py``, and what its judge must find."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
import chaos
from disturbed_nodes import OF_THE_WORLD, scenario_of

from rehearsal.cases import Fault, Faults, Span
from rehearsal.judge import Kind
from soilmoist_ros.recording.map_sources import RecordTail
from soilmoist_ros.simulation.robot.scenario import Scenario

TIME_FACTOR = 20.0


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


def test_every_fault_of_the_world_makes_a_scenario():
    nothing = Scenario.model_validate(scenario_of([]))
    for fault in OF_THE_WORLD:
        made = Scenario.model_validate(scenario_of([Span(fault, 100.0, 60.0, 0.3)]))
        assert made != nothing, fault
