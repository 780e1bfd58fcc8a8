# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole system: a simulated robot and its devices, driver, mapper, planner and recorder as processes."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "console"))
from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock
from simulated_person import SimulatedPerson

from msg_adapters import mission_from_message, to_seconds
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.nodes.topics import CLOCK, LATCHED
from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.simulation import MissionSettings, surrogate_field, write_field_file, write_site_file
from soilmoist_ros.simulation.mission.simulator import simulate_mission

# rclpy warns when nodes of the system disappear during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

LIMIT_S = 600.0
"""Longest wait for the end of a mission that takes some 20 s on an idle machine."""


class Robot:
    """A simulated robot with all its nodes, and its messages."""

    def __init__(self, ros, folder, simulator, **mission):
        self.ros, self.folder = ros, folder
        field = surrogate_field("synthetic-high")
        files = {name: str(folder / CONFIGURATION / f"{name}.yaml") for name in ("field", "site")}
        write_field_file(field, folder / CONFIGURATION / "field.yaml")
        write_site_file(field, folder / CONFIGURATION / "site.yaml")
        self.missions = ros.collect(DiagnosticStatus, "mission", LATCHED)
        self.processes = {}
        time = {"use_sim_time": True}
        self.start("recorder", out=str(folder), name="bag")
        model = {"noise": "local", "drift_model": "auto"}
        self.start("mapper", **files, save_dir=str(folder / "map"), **model, simulated=True, **time)
        self.start("planner", field=files["field"], autostart=True, exit_when_finished=True, **time, **mission)
        ports = folder / "ports.json"
        simulator = {
            "field": "synthetic-high", "logger_port": 0, "gnss_port": 0, "ports_file": str(ports), **simulator,
        }  # fmt: skip
        self.start("field_simulator", **simulator)
        ros.wait_for(lambda: self.alive() and ports.exists(), message="the simulator's ports")
        uris = {
            f"{name}_uri": "tcp://{host}:{port}".format(**address)
            for name, address in json.loads(ports.read_text()).items()
        }
        self.start("sensor_driver", **files, **uris, **time)

    def start(self, name, /, **params):
        write_parameters(self.folder, name, params)
        self.processes[name] = self.ros.start(name, params=params)

    def alive(self):
        """Whether all nodes run, except a planner that has finished."""
        for name, process in self.processes.items():
            code = process.process.poll()
            assert code is None or (name, code) == ("planner", 0), f"{name}: {code}\n{process.output()}"
        return True

    def wait_finished(self):
        planner = self.processes["planner"]
        self.ros.wait_for(lambda: self.alive() and not planner.running, LIMIT_S, "the end of the mission")
        status = lambda: mission_from_message(self.missions[-1])  # noqa: E731
        # The last message may come after the end of its sender.
        self.ros.wait_for(lambda: status().phase is Phase.FINISHED, message="the last message of the mission")
        return status()

    def stop(self):
        """End all nodes, the last started first, and check that no process is left."""
        for name, process in reversed(self.processes.items()):
            assert process.stop() == 0, f"{name}\n{process.output()}"
        for process in self.processes.values():
            with pytest.raises(ProcessLookupError):
                os.killpg(process.process.pid, 0)


def test_a_mission_maps_the_field_as_it_does_without_ros(ros, tmp_path):
    """Simulated time waits for a planner that is slow: nothing of it shows in the map."""
    choices = {"strategy": "gcb", "dwell": "optimal", "hours": 0.4, "seed": 1}
    clock = ros.collect(Clock, "/clock", CLOCK)
    robot = Robot(ros, tmp_path, simulator={"speed": 75.0, "seed": 1}, **choices)
    planner = robot.processes["planner"].process
    counting = lambda: robot.missions and mission_from_message(robot.missions[-1]).phase is Phase.COUNTING  # noqa: E731
    ros.wait_for(counting, LIMIT_S, "a visit")
    planner.send_signal(signal.SIGSTOP)
    heard = len(clock)
    ros.wait_for(lambda: len(clock) > heard + 2, message="times that are not from before")
    before_s = to_seconds(clock[-1].clock)
    time.sleep(3.0)  # in which 225 s pass if the time does not wait
    passed_s = to_seconds(clock[-1].clock) - before_s
    planner.send_signal(signal.SIGCONT)
    assert passed_s <= 30.0
    status = robot.wait_finished()
    robot.stop()
    assert status.samples >= 3, robot.processes["planner"].output()
    names = {path.name for path in (tmp_path / "map").iterdir()}
    assert names == {"map.tif", "samples.geojson", "report.html", "summary.json", "records.csv", "soilmoist.qgs"}

    replay = replay_bag(tmp_path / "bag", ReplaySettings(truths={"": "synthetic-high"}))
    assert replay.comparisons == ["equals the robot's last one, bit for bit"]
    mission = replay.run.mission
    assert mission is not None
    assert mission.settings.strategy == "gcb"
    simulated = simulate_mission(
        MissionSettings(map_from="records", travel="graph", model="matern32", fit="reml", **choices)
    )
    # The robot waits while the nodes compute, so it visits fewer stops on a busy machine. A map of the mean rate,
    # which needs the least knowledge of the field, is twenty times as bad as the simulated one.
    known = np.var(simulated.truth_rate[np.isfinite(simulated.truth_rate)])
    assert 4 * simulated.series[-1].mse < known / 4
    assert mission.series[-1].mse < 4 * simulated.series[-1].mse
    assert mission.series[-1].coverage95 > 0.7


def test_a_person_is_guided_to_the_end_of_a_mission(ros, tmp_path):
    """Real time, real sockets."""
    names = {"field": "patches", "dwell": "fmi:3.0", "hours": 0.015, "seed": 3}
    missions = ros.collect(DiagnosticStatus, "mission", LATCHED)

    def advice():
        status = mission_from_message(missions[-1]) if missions else None
        travels = status is not None and status.phase is Phase.TRAVELLING and status.target is not None
        return (status.target.x_m, status.target.y_m) if travels else None

    settings = MissionSettings(
        "patches", speed_mps=6.0, stop_overhead_s=0.5, cadence_s=1.0, position_sd_m=0.05, seed=3
    )
    with SimulatedPerson(settings, advice, wrong_turn=1) as person:
        write_parameters(tmp_path, "mapper", {"field": "patches"})
        processes = [
            ros.start("recorder", params={"out": str(tmp_path), "name": "bag"}),
            ros.start("mapper", params={"field": "patches", "save_dir": str(tmp_path / "map")}),
            ros.start("planner", params={
                **names, "navigator": "person", "graph": "free", "autostart": True, "exit_when_finished": True,
                "min_dwell_s": 1.0, "speed_mps": 6.0, "stop_overhead_s": 1.0,
            }),
        ]  # fmt: skip
        planner = processes[-1]
        ros.wait_for(lambda: missions and any((tmp_path / "bag").glob("*.mcap")), message="all nodes")
        uris = {"logger_uri": person.uri("logger"), "gnss_uri": person.uri("gnss")}
        processes.append(ros.start("sensor_driver", params={"field": "patches", **uris}))
        ros.wait_for(lambda: not planner.running, LIMIT_S, "the end of the mission")
        assert planner.process.returncode == 0, planner.output()
        ros.wait_for(lambda: mission_from_message(missions[-1]).phase is Phase.FINISHED)
        assert all(process.stop() == 0 for process in reversed(processes) if process is not planner)
    assert mission_from_message(missions[-1]).samples >= 2
    replay = replay_bag(tmp_path / "bag", ReplaySettings())
    assert replay.comparisons == ["equals the robot's last one, bit for bit"]
    assert (tmp_path / "map" / "report.html").is_file()
