# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real nodes on a simulated field, with faults of every kind, watched by the judge of the rehearsals.

The robot's computer is made unreliable by a library that its processes preload (unreliable.c): its clock
is set, and its disk fills. What the nodes publish is noted with its simulated time, and judged afterwards. The
simulator itself writes down where the robot truly drives, and which goals reach its navigation.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from soilmoist_msgs.msg import Visit as VisitMessage
from soilmoist_msgs.srv import Command

from msg_adapters.counts import counts_from_message, samples_from_message
from msg_adapters.mission import mission_from_message
from msg_adapters.point_cloud import to_seconds
from msg_adapters.soilmoist_types import reply_from_message, request_to_message, visit_from_message
from soilmoist_ros.exploration import MissionStatus, OperatorRequest, Reply, Visit
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.nodes.demo import DemoSettings, write_configuration
from soilmoist_ros.nodes.process_group import ProcessGroup, loopback_environment
from soilmoist_ros.nodes.topics import CLOCK, LATCHED, RECORDS, VISITS
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation import MissionSettings, surrogate_field

Place = tuple[float, float]

HERE = Path(__file__).resolve().parent
ON_ROBOT = ("recorder", "mapper", "planner", "sensor_driver")
"""Nodes on the robot's computer, in the order of their start; the simulator is another computer."""
ALL = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
UNLIMITED = -1
WITNESS = "witness.jsonl"
WAIT_LIMIT_S = 5.0
"""Longest time for which simulated time waits for what a fault may have swallowed [s of the wall clock]."""
LIMIT_S = 60.0
"""Longest wait for an answer [s]; machines that rehearse are busy."""


@dataclass
class Heard:
    """What was published, each with its time since the start of the simulation [s]."""

    statuses: list[tuple[float, MissionStatus]] = field(default_factory=list)
    visits: list[tuple[float, Visit]] = field(default_factory=list)
    records: list[CountRecord] = field(default_factory=list)
    quarantined: list[CountRecord] = field(default_factory=list)
    samples: Samples | None = None


@dataclass
class Witnessed:
    """What the robot truly did, each with its time since the start of the simulation [s].

    :param places: where it was [m]
    :param goals: what its navigation was asked for: place [m] and name
    """

    places: list[tuple[float, Place]] = field(default_factory=list)
    goals: list[tuple[float, Place, str]] = field(default_factory=list)


class Operator:
    """A computer that hears all nodes, and from which people steer.

    :param domain: ROS domain
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    """

    def __init__(self, domain: int, start_s: float) -> None:
        self.heard, self.now_s = Heard(), 0.0
        self._start_s = start_s
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = node = Node("operator", context=self._context)
        self._command = node.create_client(Command, "planner/command")
        for kind, topic, take, qos in (
            (Clock, "/clock", self._on_clock, CLOCK),
            (DiagnosticStatus, "mission", self._on_mission, ALL),
            (PointCloud2, "counts", partial(self._on_counts, self.heard.records), RECORDS),
            (PointCloud2, "quarantined_counts", partial(self._on_counts, self.heard.quarantined), RECORDS),
            (PointCloud2, "samples", self._on_samples, LATCHED),
            (VisitMessage, "visits", self._on_visit, VISITS),
        ):
            node.create_subscription(kind, topic, take, qos)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        self._thread.join(5.0)
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _spin(self) -> None:
        while not self._ending.is_set():
            self._executor.spin_once(timeout_sec=0.2)

    @property
    def status(self) -> MissionStatus | None:
        return self.heard.statuses[-1][1] if self.heard.statuses else None

    def ask(self, request: OperatorRequest) -> Reply | None:
        """Send a request to the planner; ``None`` if there is none, or no answer."""
        if not self._command.wait_for_service(LIMIT_S / 6):
            return None
        answer = self._command.call_async(request_to_message(request))
        until_s = time.monotonic() + LIMIT_S / 2
        while not answer.done() and time.monotonic() < until_s:
            time.sleep(0.005)
        return reply_from_message(answer.result()) if answer.done() else None

    def _on_clock(self, message: Clock) -> None:
        self.now_s = to_seconds(message.clock) - self._start_s

    def _on_mission(self, message: DiagnosticStatus) -> None:
        status = mission_from_message(message)
        alarms = json.loads({pair.key: pair.value for pair in message.values}.get("alarms", "{}"))
        if alarms:  # the message does not say which of them stop the robot
            status = replace(status, needs_operator=True)
        knows = math.isfinite(status.now_s)  # a planner that has just started has not heard the clock yet
        self.heard.statuses.append((status.now_s - self._start_s if knows else self.now_s, status))

    def _on_counts(self, kept: list[CountRecord], message: PointCloud2) -> None:
        kept += counts_from_message(message)

    def _on_samples(self, message: PointCloud2) -> None:
        self.heard.samples = samples_from_message(message)

    def _on_visit(self, message: VisitMessage) -> None:
        visit = visit_from_message(message)
        self.heard.visits.append((visit.end_stamp_s - self._start_s, visit))


@dataclass(frozen=True, kw_only=True)
class NodesSettings:
    """What runs.

    :param out: folder of the run
    :param mission: field, seed, strategy and hours
    :param time_factor: simulated time per real time
    :param scenario: faults of links, receiver, sensor and navigation, as in a file of config/scenarios
    """

    out: Path
    mission: MissionSettings
    time_factor: float = 30.0
    scenario: Mapping[str, Any] = field(default_factory=dict)


START = datetime(2026, 6, 1, 6, tzinfo=UTC)


class RealNodes:
    """The nodes of a mission as processes. Use as a context manager.

    :param settings: what runs
    :param domain: a ROS domain that nobody else uses
    """

    def __init__(self, settings: NodesSettings, domain: int) -> None:
        self.settings = settings
        self._out, self._domain = settings.out.absolute(), domain
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> RealNodes:
        out, settings = self._out, self.settings
        out.mkdir(parents=True, exist_ok=True)
        self.field = surrogate_field(settings.mission.field_name)
        self._control = out / "unreliable"
        self.spoil(step_s=0.0, left_bytes=UNLIMITED)
        loopback = loopback_environment(self._domain)
        os.environ.update(loopback)
        witness = {"SOILMOIST_WITNESS": str(out / WITNESS)}
        preloaded = {"LD_PRELOAD": str(_library(out)), "SOILMOIST_UNRELIABLE": str(self._control)}
        self._world = self._stack.enter_context(ProcessGroup({**loopback, **witness}, out / "log"))
        self._robot = self._stack.enter_context(ProcessGroup({**loopback, **preloaded}, out / "log"))
        self._files = self._configure()
        self.operator = Operator(self._domain, START.timestamp())
        self._stack.callback(self.operator.close)
        for name in ON_ROBOT[:3]:
            self.start(name)
        simulator = [str(HERE / "witnessed_simulator.py")]
        self._world.start("field_simulator", self._files["field_simulator"], program=simulator)
        self.start(ON_ROBOT[3])
        return self

    def __exit__(self, *exception: object) -> None:
        self.spoil(left_bytes=UNLIMITED)
        self._stack.close()

    def _configure(self) -> dict[str, Path]:
        settings, out = self.settings, self._out
        scenario = out / "scenario.yaml"
        scenario.write_text(yaml.safe_dump(dict(settings.scenario) or {"title": "nothing goes wrong"}))
        demo = DemoSettings(
            out, settings.mission, settings.time_factor, "goto_node", str(scenario), exit_when_finished=False
        )  # fmt: skip
        files = write_configuration(demo, self.field, out)
        ports = {device: self._port() for device in ("logger", "gnss")}
        more: dict[str, dict[str, Any]] = {
            "recorder": {"out": str(out / "bags"), "name": "run"},
            "mapper": {"record_dir": str(self.session), "max_stamp_age_s": 0.0},
            "planner": {"journal_dir": str(out / "journal"), "respawn_limit_s": 86_400.0, "resume": "ask"},
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
            files[name] = write_parameters(out, name, content["ros__parameters"] | more.get(name, {}))
        return files

    def _port(self) -> int:
        """A port that is held, so that it is given to nobody but a server that asks for it."""
        held = self._stack.enter_context(socket.socket())
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])

    @property
    def session(self) -> Path:
        return self._out / "records"

    @property
    def configuration(self) -> Path:
        return self._out / CONFIGURATION

    @property
    def bags(self) -> list[Path]:
        return sorted(path for path in (self._out / "bags").glob("*") if path.is_dir())

    def witnessed(self) -> Witnessed:
        found = Witnessed()
        for line in (self._out / WITNESS).read_text().splitlines():
            at_s, x_m, y_m, *name = json.loads(line)
            if name:
                found.goals.append((at_s, (x_m, y_m), name[0]))
            else:
                found.places.append((at_s, (x_m, y_m)))
        return found

    def start(self, name: str) -> None:
        self._robot.start(name, self._files[name])

    def kill(self, name: str) -> None:
        self._robot.kill(name)

    def settle(self, limit_s: float = LIMIT_S) -> None:
        """Wait until the map has all that the driver has stored, with the simulator at rest."""
        self.spoil(left_bytes=UNLIMITED)
        self._world.stop()
        until_s, last = time.monotonic() + limit_s, -1.0
        while time.monotonic() < until_s:
            time.sleep(2.0)
            samples = self.operator.heard.samples
            now = -1.0 if samples is None else float(samples.exposure_s.sum())
            if now == last:
                return
            last = now

    def stop(self) -> None:
        self._robot.stop()
        self._world.stop()

    def ended(self) -> dict[str, int]:
        return self._robot.ended() | self._world.ended()

    def spoil(self, step_s: float | None = None, left_bytes: int | None = None) -> None:
        """Set the clock of the robot's computer [s], or the space that is left on its disk."""
        step_ns, left = 0, UNLIMITED
        if self._control.exists():
            step_ns, left = struct.unpack("<qq", self._control.read_bytes())
        step_ns = step_ns if step_s is None else int(step_s * 1e9)
        left = left if left_bytes is None else left_bytes
        with self._control.open("r+b" if self._control.exists() else "wb") as file:  # others have mapped it
            file.write(struct.pack("<qq", step_ns, left))


def _library(folder: Path) -> Path:
    path = folder / "unreliable.so"
    command = ["cc", "-O1", "-shared", "-fPIC", "-o", str(path), str(HERE / "unreliable.c"), "-ldl"]
    subprocess.run(command, check=True)
    return path
