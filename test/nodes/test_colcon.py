# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``ros2 run`` after a build with colcon: finds the package by the index, and starts a file of the package."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NODES = {"sensor_driver", "mapper", "planner", "recorder", "field_simulator", "console", "watchdog"}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A colcon workspace in which the package is built from the files that git would commit."""
    workspace = tmp_path_factory.mktemp("colcon")
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    for name in names:
        if name and not name.startswith("test/") and (ROOT / name).is_file():
            copy = workspace / "src" / "soilmoist_ros" / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy)
    build = subprocess.run(
        [sys.executable, "-m", "colcon", "--log-base", "log", "build"],
        cwd=workspace, capture_output=True, text=True,
    )  # fmt: skip
    assert build.returncode == 0, build.stdout + build.stderr
    return workspace


@pytest.fixture(scope="module")
def sourced(workspace):
    """Environment variables after sourcing the workspace, on top of the wheels of ROS."""
    base = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    base |= {"AMENT_PREFIX_PATH": sys.prefix}
    shown = subprocess.run(
        ["sh", "-c", ". install/local_setup.sh && env -0"],
        cwd=workspace, env=base, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    variables = dict(line.split("=", 1) for line in shown.split("\0") if line)
    return {name: value for name, value in variables.items() if os.environ.get(name) != value}


def answer(code, sourced, folder):
    command = [sys.executable, "-c", code]
    environment = {**os.environ, **sourced}
    run = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True)
    return run.stdout.strip()


@pytest.fixture(scope="module")
def executables(workspace, sourced, tmp_path_factory):
    """The folder in which ``ros2 run soilmoist_ros`` looks for executables."""
    pytest.importorskip("ament_index_python")
    code = "from ament_index_python.packages import get_package_prefix as p; print(p('soilmoist_ros'))"
    prefix = Path(answer(code, sourced, tmp_path_factory.mktemp("elsewhere")))
    assert prefix == workspace / "install" / "soilmoist_ros"
    return prefix / "lib" / "soilmoist_ros"


def test_the_installation_is_complete_without_ros(workspace, sourced, tmp_path):
    prefix = workspace / "install" / "soilmoist_ros"
    assert (prefix / "share" / "ament_index" / "resource_index" / "packages" / "soilmoist_ros").is_file()
    assert (prefix / "share" / "soilmoist_ros" / "package.xml").is_file()
    assert (prefix / "share" / "soilmoist_ros" / "launch" / "simulation.launch.py").is_file()
    for module in ("soilmoist_ros", "msg_adapters"):
        assert answer(f"import {module}; print({module}.__file__)", sourced, tmp_path).startswith(str(workspace))
    checked = subprocess.run(
        [prefix / "lib" / "soilmoist_ros" / "soilmoist", "check", "--logger", "finapp", "--site", "example"],
        env={**os.environ, **sourced}, cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    verdicts = [line for line in checked.stdout.splitlines() if not line.startswith(" ")]
    assert verdicts == ["ok: finapp", "ok: example"], checked.stderr


def test_every_node_starts_from_there_and_refuses_bad_input(ros, executables, sourced):
    found = {path.name for path in executables.iterdir() if path.is_file() and os.access(path, os.X_OK)}
    assert found == NODES | {"soilmoist"}
    ros.environment |= sourced
    bad = {name: ["-p", "field:=nonsense"] for name in NODES}
    bad |= {"recorder": ["-p", "name:=nonsense/b"], "watchdog": ["-p", "heartbeats:=['the nonsense']"]}
    processes = {name: ros.start(str(executables / name), extra=words) for name, words in bad.items()}
    for name, process in processes.items():
        assert process.wait() == 2, process.output()
        assert "nonsense" in process.output(), name
        assert "Traceback" not in process.output()
