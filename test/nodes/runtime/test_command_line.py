# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Help of the nodes, and arguments that ROS would ignore."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.parameters.declaration import NODES
from soilmoist_ros.nodes.run import check_arguments, help_of

SHOWN = {
    "console": ["subscribes to: /diagnostics,", "port (integer, default 8050, 0 to 65535"],
    "field_simulator": ["actions: navigate_to_pose, topological_navigation", "speed (double, default"],
    "mapper": ["services: mapper/reset, mapper/save", "merge_radius_m (double, default 0.0, in m, 0 to 1000"],
    "planner": ["calls actions: navigate_to_pose,", 'strategy (string, default "gcb", greedy | monte_carlo'],
    "recorder": ["subscribes to: /*", "keep_days (double, default 0.0, in d, >= 0)"],
    "sensor_driver": ["publishes: /diagnostics, counts, fix,", "silence_limit_s (double, default 35.0, in s,"],
}


@pytest.mark.parametrize("node", NODES)
def test_help_names_topics_and_every_parameter(node):
    text = help_of(node, "about it")
    lines = text.splitlines()
    assert lines[0] == f"{node}: about it"
    assert max(map(len, lines)) <= 115
    for row in importlib.import_module(f"soilmoist_ros.nodes.parameters.{node}").PARAMETERS:
        assert f"\n  {row.name} ({row.kind}, default " in text
        assert " ".join(row.description.split()) in " ".join(text.split())
    for words in SHOWN[node]:
        assert words in " ".join(text.split())
    assert "rosout" not in text
    assert "get_parameters" not in text.replace("mapper/get_parameters", "")


@pytest.mark.process
def test_a_node_shows_its_help_without_starting():
    shown = subprocess.run(
        [sys.executable, "-m", "soilmoist_ros.nodes.mapper", "--help"], capture_output=True, text=True
    )
    assert (shown.returncode, shown.stderr) == (0, "")
    assert shown.stdout.startswith("mapper: Merges records to samples")


def test_arguments_that_ros_ignores_are_refused():
    check_arguments(["mapper", "old_name:=new_name", "__ns:=/r1", "--ros-args", "-p", "field:=x"], "mapper")
    for word, remedy in (("field:=x", "-p field:=x"), ("--params", "-p NAME:=VALUE"), ("x.yaml", "--help lists")):
        with pytest.raises(InputError, match=f"mapper has no argument '{word}' -> .*{remedy}"):
            check_arguments(["mapper", word, "--ros-args", "-p", "site:=y"], "mapper")
