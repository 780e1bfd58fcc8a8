# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Mistakes in parameters are refused with a suggestion, by each node; test_colcon.py has the processes."""

import re
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest
import yaml

pytest.importorskip("rclpy")
from ros_system import construct

from soilmoist_ros.foundation.errors import InputError

CLASSES = {
    "planner": "Planner", "mapper": "Mapper", "sensor_driver": "SensorDriver", "recorder": "Recorder",
    "field_simulator": "FieldSimulator",
}  # fmt: skip
USUAL = {"planner": {"field": "smooth"}, "mapper": {"field": "example"}, "sensor_driver": {"field": "example"}}


@pytest.fixture(scope="module")
def processes() -> Iterator[ProcessPoolExecutor]:
    """A process for each node: one that fails keeps its participant, and two in a process may wait without end."""
    context = get_context("forkserver")
    context.set_forkserver_preload([f"soilmoist_ros.nodes.{node}" for node in CLASSES])
    with ProcessPoolExecutor(1, context, max_tasks_per_child=1) as executor:
        yield executor


POSES = {"navigator": "goal_pose", "graph": "free"}


@pytest.mark.parametrize(
    ("node", "given", "said"),
    [
        ("planner", {"strategy": "gredy"}, "did you mean 'greedy'"),
        ("planner", {"dwel": "fmi:20"}, "did you mean 'dwell'"),
        ("planner", {"dwell": "fim:20"}, "did you mean 'fmi'"),
        ("planner", {"field": "patchs"}, "did you mean 'patches'"),
        ("planner", {"action_type": "topological_navigation_msgs/action/GotoNod"}, "has no action 'GotoNod'"),
        ("planner", {"graph": "no_such_map.yaml"}, "cannot be read"),
        ("planner", {"graph": "free"}, "graph is free"),
        ("planner", {"others": ["robot 2"]}, "'/robot 2' is not a namespace"),
        ("planner", {"properties": ["/compaction:-1"]}, "'/compaction:-1' is not a namespace with a weight"),
        ("planner", {**POSES, "home": "r0c"}, "did you mean 'r0"),
        ("mapper", {"field": ""}, "no field is given"),
        ("mapper", {"model": "matern3"}, "did you mean 'matern32'?"),
        ("mapper", {"merge_radius_m": -1.0}, "merge_radius_m must be 0 .. 1000 m, got -1"),
        ("mapper", {"cell_m": 500.0}, "change the cell size"),
        ("mapper", {"site": "exampl"}, "did you mean 'example'?"),
        ("mapper", {"start_from": "/nowhere"}, "there is no such bag"),
        ("mapper", {"earlier": ["/nowhere"]}, "/nowhere: does not exist"),
        ("sensor_driver", {"loger_uri": "x"}, "did you mean 'logger_uri'?"),
        ("sensor_driver", {"logger_format": "thorvald"}, "thorvald_crs"),
        ("sensor_driver", {"logger_uri": "tpc://host:1"}, "write it like tcp://"),
        ("sensor_driver", {"logger_uri": "file:///no/such.log"}, "is of a file, not of a device"),
        ("sensor_driver", {"gnss_uri": "tcp://host"}, "lacks the port"),
        ("recorder", {"include": "*"}, "not a regular expression"),
        ("recorder", {"name": "../x"}, "not a valid name"),
        ("field_simulator", {"field": "synthetic-hihg"}, "did you mean 'synthetic-high'"),
        ("field_simulator", {"start_time": "soon"}, "the start time 'soon' is no ISO 8601 time"),
        ("field_simulator", {"scenario": "torvald"}, "did you mean 'thorvald'"),
        ("field_simulator", {"host": "192.0.2.1", "logger_port": 0}, "cannot listen on 192.0.2.1:0"),
    ],
)
def test_mistakes_are_named_with_a_suggestion(node, given, said, tmp_path, processes):
    path = tmp_path / "given.yaml"
    path.write_text(yaml.safe_dump({node: {"ros__parameters": {**USUAL.get(node, {}), **given}}}))
    module, name = f"soilmoist_ros.nodes.{node}", CLASSES[node]
    with pytest.raises(InputError, match=re.escape(said)):
        processes.submit(construct, module, name, path, tmp_path).result(60)
