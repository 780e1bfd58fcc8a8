# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole system with SROS 2 enforced: it works as without, and strangers neither read nor command.

Runs where ``ros2 security`` is installed and Fast DDS has security, as in ROS 2 from apt.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
if shutil.which("ros2") is None:
    pytest.skip("there is no command ros2, which makes keystores", allow_module_level=True)
from ros_system import ENCLAVES, LIMIT_S, NodeProcess, RosSystem, security_environment
from test_system import Robot

from msg_adapters.mission import mission_from_message
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.pipeline import ReplaySettings, replay_bag

# rclpy warns when nodes of the system disappear during an answer.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]

ROOT = Path(__file__).resolve().parents[2]
DENIED = "topic not found in allow rule"
"""What Fast DDS prints when the permissions of an enclave lack a topic."""
STRANGER = """
import json, sys, time, rclpy
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from soilmoist_ros.nodes.topics import LATCHED, RECORDS
found = {"counts": 0, "answered": False, "refused": ""}
try:
    rclpy.init()
    node = Node("stranger")
    def heard(message): found["counts"] += 1
    node.create_subscription(PointCloud2, "counts", heard, RECORDS)
    stop = node.create_publisher(Bool, "emergency_stop", LATCHED)
    skip = node.create_client(Trigger, "planner/skip")
    stop.publish(Bool(data=True))
    asked = None
    end = time.monotonic() + float(sys.argv[1])
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
        if asked is None and skip.service_is_ready(): asked = skip.call_async(Trigger.Request())
    found["answered"] = asked is not None and asked.done()
except Exception as error:
    found["refused"] = str(error)
print(json.dumps(found))
"""
"""Reads counts, presses the emergency stop and calls a service for some seconds, and prints what came of it."""
STRANGER_S = 6.0


def keystore(folder, domain):
    command = [sys.executable, str(ROOT / "scripts" / "keystore"), str(folder), "--rehearsal"]
    made = subprocess.run(
        command, env={**os.environ, "ROS_DOMAIN_ID": str(domain)}, capture_output=True, text=True, check=False
    )
    if "No module named 'sros2'" in made.stderr or "invalid choice: 'security'" in made.stderr:
        pytest.skip("ros2 security is not installed")
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


@pytest.fixture
def secured(tmp_path):
    """A function that starts an isolated ROS system with security enforced."""
    with contextlib.ExitStack() as systems:

        def start():
            system = RosSystem(tmp_path, lambda domain: keystore(tmp_path / "keystore", domain))
            try:
                return systems.enter_context(system)
            except Exception as error:
                if "security libraries" in str(error):
                    pytest.skip("Fast DDS was built without security")
                raise

        yield start


def denied(ros):
    """Lines of Fast DDS about topics that the permissions lack."""
    return [line for process in ros.processes for line in process.output().splitlines() if DENIED in line]


def test_a_mission_is_the_same_with_every_message_encrypted(secured, tmp_path):
    ros = secured()
    robot = Robot(
        ros, tmp_path, simulator={"speed": 60.0, "seed": 1},
        strategy="random", dwell="fmi:30", hours=0.15, min_dwell_s=20.0, return_margin_s=0.0,
    )  # fmt: skip
    robot.start("console", field=str(tmp_path / "configuration" / "field.yaml"), port=0)
    console = robot.processes["console"]
    address = ros.wait_for(lambda: re.search(r"console: (http://\S+)", console.output()), message="the page")[1]
    status = robot.wait_finished()
    with urllib.request.urlopen(f"{address}map/rate.png", timeout=10) as picture:
        assert picture.read(4) == b"\x89PNG", "the console has received the map"
    robot.stop()
    assert denied(ros) == []
    assert status.samples >= 3, robot.processes["planner"].output()
    replay = replay_bag(tmp_path / "bag", ReplaySettings(truths={"": "synthetic-high"}))
    assert replay.comparisons == ["equals the robot's last one, bit for bit"]
    assert "the parameters of mapper are stored" in robot.processes["recorder"].output()


@pytest.mark.parametrize("who", ["nobody", "of another keystore", "the mapper", "the operator"])
def test_only_the_operator_reads_stops_and_commands(secured, tmp_path, who):
    ros = secured()
    robot = Robot(ros, tmp_path, simulator={"speed": 5.0}, strategy="random", dwell="fmi:600")
    last = lambda: mission_from_message(robot.missions[-1])  # noqa: E731
    ros.wait_for(lambda: robot.missions and last().phase is Phase.TRAVELLING, LIMIT_S, "a goal")
    enclave = f"{ENCLAVES}/{'mapper' if who == 'the mapper' else 'operator'}"
    environment = dict(ros.environment)
    if who == "nobody":
        environment["ROS_SECURITY_ENABLE"] = "false"
    if who == "of another keystore":
        environment |= security_environment(keystore(tmp_path / "other", ros.domain))
    command = [sys.executable, "-c", STRANGER, str(STRANGER_S), "--ros-args", "--enclave", enclave]
    stranger = NodeProcess(command, environment, tmp_path / "stranger.txt")
    ros.processes.append(stranger)
    assert stranger.wait() == 0, stranger.output()
    found = json.loads(stranger.output().splitlines()[-1])
    if who == "the operator":  # so that the others would have, too
        assert (found["counts"] > 0, found["answered"], found["refused"]) == (True, True, "")
        assert last().emergency
        return
    assert (found["counts"], found["answered"]) == (0, False)
    assert (found["refused"] != "") == (who == "the mapper"), found
    assert not last().emergency
    assert robot.alive()
    assert "skip" not in robot.processes["planner"].output()


def test_a_topic_without_permission_is_named(secured):
    ros = secured()
    devices = {"logger_uri": "tcp://127.0.0.1:9", "gnss_uri": "tcp://127.0.0.1:9"}
    driver = ros.start("sensor_driver", params={"field": "smooth", **devices}, remaps=["counts:=monitor"])
    assert driver.wait() == 2
    assert "rt/monitor topic not found in allow rule" in driver.output()
    assert "the permissions of this node's enclave lack it" in driver.output()
    assert "Traceback" not in driver.output()
