# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A robot installs every import of the product: package.xml by rosdep, requirements-robot.txt by pip."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OWN = {"soilmoist_ros", "msg_adapters"}
ROSDEP = (
    "aiohttp click jinja2 matplotlib numpy pynmea2 pyproj rasterio rich scipy segno serial shapely ruamel.yaml"
)
"""Imports for which Ubuntu has a recent enough package; ROS packages have the name of their import."""
ROSDEP_KEYS = {name: f"python3-{name}" for name in ROSDEP.split()}
COMES_WITH = {
    "contourpy": "matplotlib", "markupsafe": "jinja2", "pydantic_core": "pydantic", "ruamel": "ruamel.yaml",
}  # fmt: skip
OPTIONAL = {
    "pandas": "campaigns, on a laptop",
    "soilmoist_msgs": "interfaces/; without it the planner publishes no visits",
    "nav2_msgs": "robots with Nav2 have it; without it the planner sends no goals to Nav2",
    "topological_navigation_msgs": "the robot's own workspace has it",
}


@functools.cache
def imported(root: Path = ROOT) -> dict[str, list[str]]:
    """Files by the third-party package that they import anywhere in the file."""
    found: dict[str, list[str]] = {}
    for folder in ("soilmoist_ros", "msg_adapters", "launch"):
        for path in sorted((root / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = []
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names = [node.module or ""]
                elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "optional_module":
                    names = [text.value for text in node.args[:1] if isinstance(text, ast.Constant)]
                for name in {name.split(".")[0] for name in names} - OWN - sys.stdlib_module_names:
                    found.setdefault(name, []).append(str(path.relative_to(root)))
    return found


def rosdep_keys() -> set[str]:
    return {element.text or "" for element in ET.parse(ROOT / "package.xml").getroot().iter("exec_depend")}


def pip_names() -> set[str]:
    lines = (ROOT / "requirements-robot.txt").read_text(encoding="utf-8").splitlines()
    return {re.split(r"[<>=\[ ]", line)[0] for line in lines if line and not line.startswith("#")}


@pytest.mark.slow
def test_a_robot_has_what_the_product_imports():
    by_rosdep, by_pip = rosdep_keys(), pip_names()
    missing = {}
    for name, files in imported().items():
        package = COMES_WITH.get(name, name)
        installed = ROSDEP_KEYS.get(package, package) in by_rosdep or package in by_pip
        if name not in OPTIONAL and not installed:
            missing[name] = files[0]
    assert not missing, "package.xml or requirements-robot.txt must have these imports"


@pytest.mark.slow
def test_nothing_is_installed_in_vain():
    needed = {COMES_WITH.get(name, name) for name in imported()}
    assert pip_names() - needed - {"numpy"} == set()
    assert {key for key in rosdep_keys() if key.startswith("python3-")} <= {
        ROSDEP_KEYS.get(name, f"python3-{name}") for name in needed
    }


WITHOUT_A_KEY = "pykrige pyvrp pyogrio mcap rosbags lz4 zstandard pandas"
"""Imports that rosdep cannot install: pip does on a robot, and the nodes but the recorder do without."""
WITHOUT = f"""
import importlib, sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {WITHOUT_A_KEY.split()}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
for node in ("sensor_driver", "mapper", "planner", "field_simulator", "console", "watchdog"):
    importlib.import_module(f"soilmoist_ros.nodes.{{node}}")
from soilmoist_ros.cli.main import main
main(["simulate", "--field", "patches", "--hours", "0.3", "--out", sys.argv[1]], standalone_mode=False)
import soilmoist_ros.nodes.recorder
"""


@pytest.mark.slow
@pytest.mark.process
def test_nodes_and_a_mission_do_without_what_rosdep_cannot_install(tmp_path):
    pytest.importorskip("rclpy")
    said = subprocess.run([sys.executable, "-c", WITHOUT, tmp_path], capture_output=True, text=True)
    assert said.returncode == 1, "the recorder, the last one"
    assert re.search(r"^recorder: (mcap|rosbags) is not installed -> .*\[bags\]", said.stderr, re.MULTILINE), (
        said.stderr
    )
    assert (tmp_path / "summary.json").is_file()


@pytest.mark.slow
def test_every_dependency_is_a_key_of_rosdep_or_can_be_left_out():
    """Keys of rosdep and names in Jazzy, Kilted and Lyrical: ros/rosdistro of August 2026."""
    keys = set((ROOT / "test/data/rosdep_keys.txt").read_text(encoding="utf-8").split())
    files = (ROOT / "package.xml", ROOT / "interfaces/soilmoist_msgs/package.xml")
    asked = {one.text for file in files for one in ET.parse(file).getroot() if one.tag.endswith("depend")}
    assert asked - keys == set()
    by_pip = {name.lower() for name in pip_names()} - {"numpy", "pydantic", "shapely"}  # newer ones than Ubuntu's
    assert by_pip <= set(WITHOUT_A_KEY.split())
