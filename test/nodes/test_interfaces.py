# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ROS types below interfaces/, built next to the wheels of ROS 2."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from soilmoist_ros.recording.bag.metadata import find_definition

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGES = sorted(folder for folder in (ROOT / "interfaces").iterdir() if folder.is_dir())
TYPE_HASHES = {
    "topological_navigation_msgs/action/GotoNode":
        "RIHS01_97efcb9cbd4eed92186f675fe1a7417bc263a0737bc1b503107614ae3ebf88c2",
    "nav2_msgs/action/ComputeAndTrackRoute":
        "RIHS01_eb358f9e4b7f7db475c3340bebf11c650f0641a8577da6eb3f9faa0a20805857",
    "nav2_msgs/action/FollowPath":
        "RIHS01_9d95513552fb578cfb933d7e0160273911269cbdf4b348f1acb87d8a903b13cf",
    "nav2_msgs/action/NavigateToPose":
        "RIHS01_a56dba8a3234a1215e610180dc703ae25bbf406dded8b54887891c9732857eab",
    "nav2_msgs/msg/CostmapFilterInfo":
        "RIHS01_61ce391bf7690f76a331c01c9d5ce8ca71e6c99273b9fb75e48380f05c6dfdc8",
}  # fmt: skip
"""Type hashes of the robot's packages, nav2_msgs being that of Jazzy; nodes communicate only if they are equal."""
OWN = "soilmoist_msgs"
"""The package that belongs into the workspace of a robot."""


@pytest.fixture
def goto_node():
    """The action type; missing only on machines that cannot build it."""
    if not shutil.which(os.environ.get("CXX", "c++")):
        pytest.skip("GotoNode is not built: there is no C++ compiler")
    pytest.importorskip("rclpy")
    from topological_navigation_msgs.action import GotoNode  # scripts/build_interfaces builds it

    return GotoNode


@pytest.mark.parametrize("name", TYPE_HASHES)
def test_the_type_is_the_one_of_the_robot(goto_node, name):
    package, folder, kind = name.split("/")
    module = Path(importlib.import_module(package).__file__)
    shares = [prefix / "share" / package for prefix in module.parents]
    share = next(folder for folder in shares if folder.is_dir())
    hashes = json.loads((share / folder / f"{kind}.json").read_text())["type_hashes"]
    assert {"type_name": name, "hash_string": TYPE_HASHES[name]} in hashes


def test_packages_that_a_robot_has_from_elsewhere_stay_out_of_its_workspace():
    """One in the workspace would hide the whole package of the robot."""
    assert {package.name for package in PACKAGES if not (package / "COLCON_IGNORE").is_file()} == {OWN}
    for package in PACKAGES:
        root = ET.parse(package / "package.xml").getroot()
        assert root.findtext("name") == package.name
        assert root.findtext("member_of_group") == "rosidl_interface_packages"
        assert root.find("export").findtext("build_type") == "ament_cmake"


def test_every_package_is_built_into_the_environment(goto_node):
    assert {package.name for package in PACKAGES} == {OWN, "nav2_msgs", "tf2_msgs", "topological_navigation_msgs"}
    for package in PACKAGES:
        for file in (*package.glob("msg/*.msg"), *package.glob("srv/*.srv"), *package.glob("action/*.action")):
            kind = getattr(importlib.import_module(f"{package.name}.{file.parent.name}"), file.stem)
            share = Path(sys.prefix) / "share" / package.name / file.parent.name / file.name
            assert share.read_text() == file.read_text(), f"{kind} is not of today: scripts/build_interfaces"


@pytest.mark.parametrize(("name", "part"), [("Visit", "geometry_msgs/Point"), ("Mission", "soilmoist_msgs/Alarm")])
def test_the_recorder_finds_the_definitions_of_this_project(goto_node, name, part):
    found = find_definition(f"soilmoist_msgs/msg/{name}")
    assert found.type_hash.startswith("RIHS01_")
    assert f"MSG: {part}" in found.text


@pytest.fixture
def project(tmp_path):
    """A copy of the files that scripts/build_interfaces uses, with a fake ROS environment."""
    for name in ("scripts/build_interfaces", "requirements-ros.txt", "requirements-interfaces.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(ROOT / "interfaces", tmp_path / "interfaces")
    (tmp_path / ".venv" / "share" / "rclpy").mkdir(parents=True)
    return tmp_path


def build(project, **environment):
    return subprocess.run(
        [project / "scripts" / "build_interfaces"], env={**os.environ, **environment},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def test_without_a_compiler_or_ros_the_script_says_so_and_goes_on(project):
    run = build(project, CXX="no-such-compiler")
    assert run.returncode == 0, run.stderr
    assert "there is no C++ compiler (no-such-compiler" in run.stdout
    assert "the planner uses goal_pose and publishes no visits" in run.stdout
    assert not (project / ".venv" / "interfaces.stamp").exists()
    (project / ".venv" / "share" / "rclpy").rmdir()
    run = build(project)
    assert run.returncode == 0, run.stderr
    assert "requirements-ros.txt" in run.stdout
