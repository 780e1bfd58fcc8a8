# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole system: a simulated robot and its devices, driver, mapper, planner and recorder as processes."""

from __future__ import annotations

import json
import os
import signal
import time

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

from msg_adapters.counts import counts_from_message, samples_from_message
from msg_adapters.environment import diagnostics_from_message
from msg_adapters.mission import mission_from_message
from msg_adapters.point_cloud import to_seconds
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.foundation.configuration import config_folder
from soilmoist_ros.mapping.records import Skip
from soilmoist_ros.nodes.topics import CLOCK, LATCHED, RECORDS
from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import write_field_file, write_site_file
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

# rclpy warns when nodes of the system disappear during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

HELD = f"skipped: {Skip.UNEXPECTED.value}"
LIMIT_S = 600.0
"""Longest wait for the end of a mission that takes some 20 s on an idle machine."""


class Robot:
    """A simulated robot with all its nodes, and its messages."""

    SHARED = ("clock", "topological_map_2")
    """Topics without a namespace, which are private to each robot here."""

    def __init__(self, ros, folder, namespace="", *, field="synthetic-high", simulator=(), record=True, **mission):
        self.ros, self.folder, self.namespace = ros, folder, namespace
        self.field = surrogate_field(field)
        files = {name: str(folder / CONFIGURATION / f"{name}.yaml") for name in ("field", "site")}
        write_field_file(self.field, folder / CONFIGURATION / "field.yaml")
        write_site_file(self.field, folder / CONFIGURATION / "site.yaml")
        self.missions = ros.collect(DiagnosticStatus, f"{namespace}/mission", LATCHED)
        self.counts = ros.collect(PointCloud2, f"{namespace}/counts", RECORDS)
        self.samples = ros.collect(PointCloud2, f"{namespace}/samples", LATCHED)
        self.diagnostics = ros.collect(DiagnosticArray, "/diagnostics", RECORDS)
        self.processes = {}
        time = {"use_sim_time": True}
        if record:
            self.start("recorder", out=str(folder), name="bag")
        model = {"noise": "local", "local": "auto", "drift_model": "auto"}
        self.start("mapper", **files, save_dir=str(folder / "map"), **model, simulated=True, **time)
        self.start("planner", field=files["field"], autostart=True, exit_when_finished=True, **time, **mission)
        ports = folder / "ports.json"
        simulator = {"field": field, "logger_port": 0, "gnss_port": 0, "ports_file": str(ports), **dict(simulator)}
        self.start("field_simulator", **simulator)
        ros.wait_for(lambda: self.alive() and ports.exists(), message="the simulator's ports")
        uris = {
            f"{name}_uri": "tcp://{host}:{port}".format(**address)
            for name, address in json.loads(ports.read_text()).items()
        }
        self.start("sensor_driver", **files, **uris, **time)

    def start(self, name, /, **params):
        """Start a node."""
        write_parameters(self.folder, name, params)
        remaps = [f"/{topic}:={self.namespace}/{topic}" for topic in self.SHARED if self.namespace]
        self.processes[name] = self.ros.start(name, params=params, namespace=self.namespace, remaps=remaps)

    def alive(self):
        """Whether all nodes run, except a planner that has finished."""
        for name, process in self.processes.items():
            code = process.process.poll()
            assert code is None or (name, code) == ("planner", 0), f"{name}: {code}\n{process.output()}"
        return True

    def wait_finished(self):
        """Wait for the end of the mission, and return the status."""
        planner = self.processes["planner"]
        self.ros.wait_for(lambda: self.alive() and not planner.running, LIMIT_S, "the end of the mission")
        status = lambda: mission_from_message(self.missions[-1])  # noqa: E731
        # The last message may come after the end of its sender.
        self.ros.wait_for(lambda: status().phase is Phase.FINISHED, message="the last message of the mission")
        return status()

    def records(self):
        """All records published so far."""
        return [record for message in list(self.counts) for record in counts_from_message(message)]

    def mapped(self):
        """Records in the last published map: records with a place, up to the map's stamp."""
        stamp = self.samples[-1].header.stamp
        stamp_s = stamp.sec + 1e-9 * stamp.nanosec
        return [one for one in self.records() if one.stamp_s <= stamp_s + 1e-6 and np.isfinite(one.x_m)]

    def held(self):
        """How many records the mapper holds back, as chance wants it in one of some thousands."""
        said = [part for message in self.diagnostics for part in diagnostics_from_message(message)]
        its = [part.values for part in said if part.name.startswith(f"{self.namespace}/mapper")]
        return next((int(one[HELD]) for one in reversed(its) if HELD in one), 0)

    def check_samples(self):
        """Check that the samples hold the received records, and at most a few from before the subscription."""
        received = [record.raw_counts for record in self.mapped()]
        assert (
            sum(received) - self.held() * max(received)
            <= samples_from_message(self.samples[-1]).counts.sum()
            <= sum(received) + 3 * max(received)
        )

    def stop(self):
        """End all nodes, the last started first, and check that no process is left."""
        for name, process in reversed(self.processes.items()):
            assert process.stop() == 0, f"{name}\n{process.output()}"
        for process in self.processes.values():
            with pytest.raises(ProcessLookupError):
                os.killpg(process.process.pid, 0)


def test_a_mission_maps_the_field_as_it_does_without_ros(ros, tmp_path):
    """Simulated time waits for a planner that is slow: nothing of it shows in the map."""
    choices = {"strategy": "ivr", "dwell": "optimal", "hours": 0.4, "seed": 1}
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

    replay = replay_bag(tmp_path / "bag", ReplaySettings(truths={0: "synthetic-high"}))
    assert replay.comparisons[0].same is True
    mission = replay.run.mission
    assert mission is not None
    assert mission.settings.strategy == "ivr"
    simulated = simulate_mission(
        MissionSettings(map_from="records", travel="graph", model="matern32", fit="reml", **choices)
    )
    # The robot waits while the nodes compute, so it visits fewer stops on a busy machine. A map of the mean rate,
    # which needs the least knowledge of the field, is twenty times as bad as the simulated one.
    known = np.var(simulated.truth_rate[np.isfinite(simulated.truth_rate)])
    assert 4 * simulated.series[-1].mse < known / 4
    assert mission.series[-1].mse < 4 * simulated.series[-1].mse
    assert mission.series[-1].coverage95 > 0.7


@pytest.mark.parametrize(
    ("scenarios", "navigator", "hours"),
    [(("thorvald", "bad_link"), "goto_node", 0.2), (("nav2",), "navigate_to_pose", 0.35)],
)
def test_a_mission_survives_what_goes_wrong(ros, tmp_path, scenarios, navigator, hours):
    wrong = {}
    for name in scenarios:
        wrong |= yaml.safe_load((config_folder() / "scenarios" / f"{name}.yaml").read_text())
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(wrong))
    robot = Robot(
        ros, tmp_path, simulator={"speed": 90.0, "scenario": str(tmp_path / "scenario.yaml")}, record=False,
        strategy="random", dwell="fmi:30", hours=hours, min_dwell_s=20.0, return_margin_s=0.0, navigator=navigator,
    )  # fmt: skip
    status = robot.wait_finished()
    robot.stop()
    assert status.samples >= 3, robot.processes["planner"].output()
    stamps = [record.stamp_s for record in robot.records()]
    assert len(stamps) > 20
    assert np.diff(stamps).min() > 5.0, "an interval was counted twice"
    robot.check_samples()
