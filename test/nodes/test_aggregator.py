# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The groups of diagnostic_aggregator: each name that the nodes publish belongs to one of them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent.parent
PUBLISHED_BY = {
    "sensing/survey/driver.py": "sensor_driver",
    "mapping/map_worker.py": "mapper",
    "nodes/mapper.py": "mapper",
    "nodes/planner.py": "planner",
    "pipeline/field_survey.py": "mapper",
    "exploration/control/mission_control.py": "planner",
    "exploration/control/team.py": "planner",
    "exploration/guard/watch.py": "planner",
    "exploration/guard/robot_frames.py": "planner",
    "recording/bag/recorder.py": "recorder",
    "simulation/robot/simulated_time.py": "field_simulator",
}
ELSEWHERE = {"nodes/console.py", "exploration/mission/types.py"}
"""Files that make states of health of what they received, or for other topics than /diagnostics."""
VARIABLES = {
    ("sensing/survey/driver.py", "name"): {"logger link", "GNSS link"},
    ("exploration/control/mission_control.py", "name"): {"position", "records"},
    ("nodes/mapper.py", "name"): {"records", "field", "messages", "others"},
}
"""Parts whose name is an argument."""


@cache
def published_names() -> set[str]:
    """Names on /diagnostics without namespace, from the source: every state of health that a file makes."""
    found = set()
    for path in sorted((ROOT / "soilmoist_ros").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "Health(" not in text:
            continue
        tree = ast.parse(text)
        inside = str(path.relative_to(ROOT / "soilmoist_ros"))
        texts = {
            target.id: node.value.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Constant)
            for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
            if isinstance(target, ast.Name)
        }
        for node in ast.walk(tree):
            made = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Health"
            if not made or inside in ELSEWHERE:
                continue
            first = node.args[0]
            if isinstance(first, ast.Constant):
                parts = {first.value}
            else:
                name = getattr(first, "id", None) or getattr(first, "attr", None)  # PART or worker.PART
                assert name, f"{inside}:{node.lineno}: a name that the test cannot read"
                parts = VARIABLES.get((inside, name)) or {texts[name]}
            found |= {f"{PUBLISHED_BY[inside]}: {part}" for part in parts}
    return found


def analyzers() -> dict[str, list[str]]:
    (settings,) = yaml.safe_load((ROOT / "config" / "diagnostics" / "aggregator.yaml").read_text()).values()
    groups = {name: value for name, value in settings["ros__parameters"].items() if isinstance(value, dict)}
    assert {group["type"] for group in groups.values()} == {"diagnostic_aggregator/GenericAnalyzer"}
    return {name: group["contains"] for name, group in groups.items()}


@pytest.mark.slow
def test_each_published_name_belongs_to_one_group_and_no_group_waits_for_what_nobody_publishes():
    names, found = published_names(), analyzers()
    assert len(names) > 15
    for full in sorted(namespace + name for name in names for namespace in ("/", "/robot_1/", "/robot_1/salt/")):
        groups = [group for group, texts in found.items() if any(text in full for text in texts)]
        assert len(groups) == 1, f"{full} belongs to {groups or 'no group'}"
    for group, texts in found.items():
        for text in texts:
            assert any(text in name for name in names), f"{group}: {text}"
