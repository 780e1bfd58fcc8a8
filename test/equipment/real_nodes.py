# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real nodes on a simulated field, watched by the judge of the rehearsals.

The robot's computer is made unreliable by a library that its processes preload (unreliable.c): its clock
is set, and its disk fills. What the nodes publish is noted with its simulated time. The simulator itself writes
down where the robot truly drives, and which goals reach its navigation.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import struct
import subprocess
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from soilmoist_msgs.msg import Visit as VisitMessage
from soilmoist_msgs.srv import Command

from msg_adapters.counts import counts_from_message, samples_from_message
from msg_adapters.mission import mission_from_message
from msg_adapters.point_cloud import to_seconds
from msg_adapters.soilmoist_types import reply_from_message, request_to_message, visit_from_message
from soilmoist_ros.exploration import OperatorRequest
from soilmoist_ros.nodes.demo import DemoSettings, write_configuration
from soilmoist_ros.nodes.process_group import ProcessGroup, loopback_environment
from soilmoist_ros.nodes.topics import CLOCK, LATCHED, RECORDS, VISITS
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.simulation import surrogate_field

HERE = Path(__file__).resolve().parent
ON_ROBOT = ("recorder", "mapper", "planner", "sensor_driver")
"""Nodes on the robot's computer, in the order of their start; the simulator is another computer."""
ALL = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
UNLIMITED = -1
START = datetime(2026, 6, 1, 6, tzinfo=UTC)
WAIT_LIMIT_S = 5.0
"""Longest time for which simulated time waits for what a fault may have swallowed [s of the wall clock]."""
SETTLE_S = 60.0  # longest wait for the map of what the driver has stored [s]; machines that rehearse are busy


class RealNodes:
    """The nodes of a mission as processes. Use as a context manager.

    :param ros: the system that hears them
    :param mission: field, seed, strategy and hours
    :param time_factor: simulated time per real time
    :param scenario: faults of links, receiver, sensor and navigation, as in a file of config/scenarios
    """

    def __init__(self, ros, mission, time_factor, scenario=None):
        self.out = ros.folder / "run"
        self._ros, self._mission, self._time_factor = ros, mission, time_factor
        self._scenario = scenario or {"title": "nothing goes wrong"}
        self._control, self._witness = self.out / "unreliable", self.out / "witness.jsonl"
        self.session, self.configuration = self.out / "records", self.out / CONFIGURATION
        self.now_s = 0.0  # since the start of the simulation [s], as are all times
        self.statuses, self.visits = [], []  # each with its time
        self.records, self.quarantined, self.samples = [], [], None
        self._stack = contextlib.ExitStack()

    def __enter__(self):
        self.out.mkdir()
        self.field = surrogate_field(self._mission.field_name)
        self.spoil(step_s=0.0, left_bytes=UNLIMITED)
        library = self.out / "unreliable.so"
        command = ["cc", "-O1", "-shared", "-fPIC", "-o", str(library), str(HERE / "unreliable.c"), "-ldl"]
        subprocess.run(command, check=True)
        loopback = loopback_environment(self._ros.domain)
        witness = {"SOILMOIST_WITNESS": str(self._witness)}
        preloaded = {"LD_PRELOAD": str(library), "SOILMOIST_UNRELIABLE": str(self._control)}
        self._world = self._stack.enter_context(ProcessGroup({**loopback, **witness}, self.out / "log"))
        self._robot = self._stack.enter_context(ProcessGroup({**loopback, **preloaded}, self.out / "log"))
        self._files = self._configure()
        self._listen()
        for name in ON_ROBOT[:3]:
            self.start(name)
        simulator = [str(HERE / "witnessed_simulator.py")]
        self._world.start("field_simulator", self._files["field_simulator"], program=simulator)
        self.start(ON_ROBOT[3])
        return self

    def __exit__(self, *exception):
        self.spoil(left_bytes=UNLIMITED)
        self._stack.close()

    def _configure(self):
        scenario = self.out / "scenario.yaml"
        scenario.write_text(yaml.safe_dump(self._scenario))
        demo = DemoSettings(
            self.out, self._mission, self._time_factor, "goto_node", str(scenario), exit_when_finished=False
        )
        files = write_configuration(demo, self.field, self.out)
        ports = {device: self._port() for device in ("logger", "gnss")}
        more = {
            "recorder": {"out": str(self.out / "bags"), "name": "run"},
            "mapper": {"record_dir": str(self.session), "max_stamp_age_s": 0.0},
            "planner": {"journal_dir": str(self.out / "journal"), "respawn_limit_s": 86_400.0, "resume": "ask"},
            "field_simulator": {
                "wait_limit_s": WAIT_LIMIT_S,
                "start_time": START.isoformat(),
                **{f"{device}_port": port for device, port in ports.items()},
            },
            "sensor_driver": {
                "record_dir": str(self.session),
                **{f"{device}_uri": f"tcp://127.0.0.1:{port}" for device, port in ports.items()},
            },
        }
        for name, path in files.items():
            (content,) = yaml.safe_load(path.read_text()).values()
            files[name] = write_parameters(self.out, name, content["ros__parameters"] | more.get(name, {}))
        return files

    def _port(self):
        """A port that is held, so that it is given to nobody but a server that asks for it."""
        held = self._stack.enter_context(socket.socket())
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])

    # What is heard and seen ----------------------------------------------------------------------------------

    def _listen(self):
        for kind, topic, take, qos in (
            (Clock, "/clock", self._on_clock, CLOCK),
            (DiagnosticStatus, "mission", self._on_mission, ALL),
            (PointCloud2, "counts", lambda message: self.records.extend(counts_from_message(message)), RECORDS),
            (PointCloud2, "quarantined_counts",
             lambda message: self.quarantined.extend(counts_from_message(message)), RECORDS),
            (PointCloud2, "samples", self._on_samples, LATCHED),
            (VisitMessage, "visits", self._on_visit, VISITS),
        ):  # fmt: skip
            self._ros.node.create_subscription(kind, topic, take, qos)

    def _on_clock(self, message):
        self.now_s = to_seconds(message.clock) - START.timestamp()

    def _on_mission(self, message):
        status = mission_from_message(message)
        alarms = json.loads({pair.key: pair.value for pair in message.values}.get("alarms", "{}"))
        if alarms:  # the message does not say which of them stop the robot
            status = replace(status, needs_operator=True)
        knows = math.isfinite(status.now_s)  # a planner that has just started has not heard the clock yet
        self.statuses.append((status.now_s - START.timestamp() if knows else self.now_s, status))

    def _on_samples(self, message):
        self.samples = samples_from_message(message)

    def _on_visit(self, message):
        visit = visit_from_message(message)
        self.visits.append((visit.end_stamp_s - START.timestamp(), visit))

    @property
    def status(self):
        return self.statuses[-1][1] if self.statuses else None

    @property
    def bags(self):
        return sorted(path for path in (self.out / "bags").glob("*") if path.is_dir())

    def witnessed(self):
        """Where the robot was, and what its navigation was asked for: times, places [m], names of goals."""
        lines = [json.loads(line) for line in self._witness.read_text().splitlines()]
        places = [(at_s, (x_m, y_m)) for at_s, x_m, y_m, *name in lines if not name]
        return places, [(at_s, (x_m, y_m), *name) for at_s, x_m, y_m, *name in lines if name]

    # What is done to them ------------------------------------------------------------------------------------

    def ask(self, verb):
        """Ask the planner; whether it accepts."""
        answer = self._ros.call(Command, "planner/command", request_to_message(OperatorRequest(verb)))
        return reply_from_message(answer).accepted

    def start(self, name):
        self._robot.start(name, self._files[name])

    def kill(self, name):
        self._robot.kill(name)

    def ended(self):
        return self._robot.ended() | self._world.ended()

    def stop(self):
        """Stop the simulator, wait until the map has all that the driver has stored, and stop the others."""
        self.spoil(left_bytes=UNLIMITED)
        self._world.stop()
        until_s, last, now = time.monotonic() + SETTLE_S, -1.0, None
        while now != last and time.monotonic() < until_s:
            time.sleep(2.0)
            last, now = now, None if self.samples is None else float(self.samples.exposure_s.sum())
        self._robot.stop()

    def spoil(self, step_s=None, left_bytes=None):
        """Set the clock of the robot's computer [s], or the space that is left on its disk."""
        step_ns, left = 0, UNLIMITED
        if self._control.exists():
            step_ns, left = struct.unpack("<qq", self._control.read_bytes())
        step_ns = step_ns if step_s is None else int(step_s * 1e9)
        left = left if left_bytes is None else left_bytes
        with self._control.open("r+b" if self._control.exists() else "wb") as file:  # others have mapped it
            file.write(struct.pack("<qq", step_ns, left))
