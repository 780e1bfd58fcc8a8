# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameter files agree with the tables of the nodes: parameter_tables.py, planner_parameters.py."""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy")
from rclpy.node import Node
from ros_system import ros_in_this_process

from soilmoist_ros.nodes.parameters import Parameter, Parameters, check_values

ROOT = Path(__file__).resolve().parent.parent.parent
SCRIPT = ROOT / "scripts" / "parameter_tables"
NODES = ("sensor_driver", "mapper", "planner", "recorder", "field_simulator", "console", "watchdog")


@pytest.fixture(scope="module")
def tables(load_script):
    return load_script("parameter_tables")


def table(node):
    return importlib.import_module(f"soilmoist_ros.nodes.{node}").PARAMETERS


def test_files_and_document_say_what_the_nodes_say():
    run = subprocess.run([sys.executable, SCRIPT, "--check"], capture_output=True, text=True, timeout=100)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout == ""


@pytest.mark.parametrize("node", NODES)
def test_every_file_gives_every_default_to_a_real_node(node, tmp_path):
    path = ROOT / "config" / f"{node}.yaml"
    defaults = {row.name: row.default for row in table(node)}
    with ros_in_this_process(["--ros-args", "--params-file", str(path)], tmp_path):
        example = Node(node)
        assert Parameters(example, table(node)).as_dict() == defaults
        types = {name: type(parameter.value) for name, parameter in example._parameter_overrides.items()}
        assert types == {name: type(value) for name, value in defaults.items() if value != []}
        example.destroy_node()


@pytest.mark.parametrize("node", NODES)
def test_defaults_are_allowed_and_every_row_is_explained(node):
    rows = {row.name: row for row in table(node)}
    assert len(rows) == len(table(node)), "a name is used twice"
    _, mistakes = check_values(rows, {row.name: row.default for row in rows.values() if row.default != ""})
    assert not [str(mistake) for mistake in mistakes]
    for row in rows.values():
        assert len(row.description) > 5


ROWS = (
    Parameter(name="radius_m", default=2.0, description="radius", unit="m", low=0.0),
    Parameter(name="fit", default="reml", description="how it is | fitted", choices=("reml", "")),
    Parameter(name="topics", default=[], description="topics"),
)


def test_the_file_explains_each_parameter(tables):
    text = tables.yaml_file("example", "shows.", ROWS)
    assert text.startswith("# example: shows.\n")
    assert "    # Radius [m]. At least 0.\n    radius_m: 2.0\n" in text
    assert '    # How it is | fitted. One of: reml, (empty).\n    fit: "reml"\n' in text
    assert "    # Topics.\n    # topics: []\n" in text
    assert yaml.safe_load(text) == {"/**": {"ros__parameters": {"radius_m": 2.0, "fit": "reml"}}}
