# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Budget of the walk: files that one record enters until it is in the map, and a plan until the robot is sent."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
import walk
from real_nodes import RealNodes

from soilmoist_ros.simulation.mission.settings import MissionSettings

ROOT = Path(__file__).resolve().parents[2]


class WatchedNodes(RealNodes):
    """Nodes whose driver, mapper and planner note the files that they enter."""

    def start(self, name):
        program = [walk.__file__, name, str(self.out.parent)] if name in walk.NODES else ()
        self._robot.start(name, self._files[name], program=program)


@pytest.mark.slow
@pytest.mark.process
def test_a_record_and_a_plan_enter_few_files(ros, tmp_path):
    found = re.search(r"enter at most (\d+) files with ([\d,]+) lines", (ROOT / "CONTRIBUTING.md").read_text())
    files, lines = int(found[1]), int(found[2].replace(",", ""))
    mission = MissionSettings(field="rough", strategy="gcb", hours=0.5, seed=1)
    with WatchedNodes(ros, mission, 20.0) as nodes:

        def next_stop():
            visits, samples = len(nodes.visits), nodes.samples
            ros.wait_for(lambda: len(nodes.visits) > visits and nodes.samples is not samples)

        ros.wait_for(lambda: len(nodes.visits) > 3)
        entered = walk.entered_files(nodes, tmp_path, next_stop)
    names = sorted(entered)
    length = sum(len((ROOT / name).read_text().splitlines()) for name in names)
    assert any(name.startswith("soilmoist_ros/exploration/strategies/") for name in names), "a plan was made"
    assert any(name.startswith("soilmoist_ros/mapping/kriging/") for name in names), "a map was made"
    assert any(name.startswith("soilmoist_ros/sensing/") for name in names), "a record came"
    assert (len(names) <= files, length <= lines) == (True, True), f"{len(names)} files, {length} lines: {names}"
