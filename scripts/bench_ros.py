# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cost of the nodes on this machine: delay from record to map, CPU and memory.

* time from a published record to the map with it, on 3,000 and on 70,000 cells
* CPU share and memory of the robot's nodes while it drives and counts, in real time: a record every 10 s, 10 fixes
  per second, strategy gcb, dwell optimal; with simulated time (a clock of 50 Hz) and without
* time from a request to abort to its answer, while stops are chosen and large maps computed and published

``--maps`` instead: public topological maps, which are read, and which are refused and why. The folder has a folder
``OWNER+NAME`` for each repository, below which lie its map files, whatever their folders.

usage: .venv/bin/python scripts/bench_ros.py [--only PART] [--maps FOLDER] [--save]
"""

from __future__ import annotations

import compileall
import contextlib
import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

# Set as in the other scripts, before numpy is imported; the nodes inherit it.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
import psutil
import results

import msg_adapters
import soilmoist_ros
from soilmoist_ros.exploration import read_topological_map
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.demo import DemoSettings, write_configuration
from soilmoist_ros.nodes.process_group import ProcessGroup, free_domain, loopback_environment
from soilmoist_ros.recording.run_folder import write_parameters
from soilmoist_ros.sensing.records import CountRecord

Row = dict[str, object]

LIMIT_S = 60.0
RECORDS, RECORDS_PER_STOP = 240, 4
LOAD_S = 120.0
"""Time during which the processor time of the nodes counts, from the first record on [s]."""
ABORTS = 40
FIELDS_M = {"3,000 cells": (60.0, 50.0), "70,000 cells": (280.0, 250.0)}
"""Width and height; cells are 1 m wide."""
BARE_NODE = "import rclpy; rclpy.init(); rclpy.spin(rclpy.create_node('bare'))"
NODES = ("recorder", "mapper", "planner", "sensor_driver")
"""Nodes of the robot, in the order of their start."""


class Observer:
    """A node of this process, spun in a thread. Use as a context manager.

    :param domain: its ROS domain
    """

    def __init__(self, domain: int) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor

        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("bench", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def __enter__(self) -> Observer:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ending.set()
        self._thread.join(2.0)
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _spin(self) -> None:
        while not self._ending.is_set():
            self._executor.spin_once(timeout_sec=0.1)


@contextlib.contextmanager
def ros_domain() -> Iterator[tuple[int, dict[str, str]]]:
    """A free domain and the environment of its processes; also sets the domain of this process."""
    with free_domain() as domain:
        environment = loopback_environment(domain)
        os.environ.update(environment)
        yield domain, environment


def wait_for(condition: Callable[[], object], what: str, limit_s: float = LIMIT_S) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > deadline:
            raise SystemExit(f"waited {limit_s:g} s for {what}")
        time.sleep(0.002)


# Record to map ---------------------------------------------------------------------------------------------------


def stops(width_m: float, height_m: float) -> Iterator[CountRecord]:
    """Records of a survey with stops at random positions, of the last hour: the mapper skips old ones."""
    rng = np.random.default_rng(5)
    begin_s = math.floor(time.time()) - 3600.0
    place = (0.0, 0.0)
    for number in range(RECORDS):
        if number % RECORDS_PER_STOP == 0:
            place = (float(rng.uniform(1, width_m - 1)), float(rng.uniform(1, height_m - 1)))
        rate = 3.75 + 1.25 * math.tanh((place[0] - width_m / 2) / 15)
        x_m, y_m = (float(value + rng.normal(0, 0.02)) for value in place)
        yield CountRecord(begin_s + 10 * number, x_m, y_m, math.nan, int(rng.poisson(10 * rate)), 10.0, 10.0)


def record_to_map(name: str, folder: Path) -> Row:
    """Time from the publication of each record until a subscriber has the map that includes it."""
    width_m, height_m = FIELDS_M[name]
    folder.mkdir()
    field = folder / "field.yaml"
    field.write_text(
        "name: Bench\ndatum: {latitude_deg: 53.0, longitude_deg: 0.0}\ncell_m: 1\n"
        f"polygon: [[0, 0], [{width_m}, 0], [{width_m}, {height_m}], [0, {height_m}]]\n"
    )
    with ros_domain() as (domain, environment):
        from sensor_msgs.msg import PointCloud2

        from msg_adapters.counts import counts_to_message
        from msg_adapters.point_cloud import to_seconds
        from soilmoist_ros.nodes.topics import LATCHED, RECORDS

        arrivals: dict[float, float] = {}

        def note(message: PointCloud2) -> None:
            arrivals.setdefault(to_seconds(message.header.stamp), time.perf_counter())

        with ProcessGroup(environment, folder / "log") as group, Observer(domain) as observer:
            group.start("mapper", write_parameters(folder, "mapper", {"field": str(field), "site": "example"}))
            publisher = observer.node.create_publisher(PointCloud2, "counts", RECORDS)
            subscription = observer.node.create_subscription(PointCloud2, "soil_map", note, LATCHED)
            wait_for(publisher.get_subscription_count, "the mapper")
            wait_for(lambda: observer.node.count_publishers(subscription.topic_name), "the mapper's map")
            delays_s = []
            for record in stops(width_m, height_m):
                message = counts_to_message([record])
                sent = time.perf_counter()
                publisher.publish(message)
                wait_for(lambda stamp_s=record.stamp_s: stamp_s in arrivals, "a map")
                delays_s.append(arrivals[record.stamp_s] - sent)
    # The first records have no map: a variogram needs more samples.
    delays_s = delays_s[3 * RECORDS_PER_STOP :]
    return {
        "field": name,
        "records": len(delays_s),
        "samples": RECORDS // RECORDS_PER_STOP,
        "p50_ms": 1e3 * float(np.percentile(delays_s, 50)),
        "p99_ms": 1e3 * float(np.percentile(delays_s, 99)),
        "longest_ms": 1e3 * max(delays_s),
    }


# The robot's nodes -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Setting:
    """What runs: the nodes of the robot, and the simulator that they talk to.

    :param what: its name in the tables
    :param simulated_time: whether the nodes use ``/clock``
    :param speed: simulated time per real time
    :param field: name or file of the field; the default of missions if empty
    :param fix_hz: fixes per second of simulated time
    """

    what: str
    simulated_time: bool = True
    speed: float = 1.0
    field: str = ""
    fix_hz: float = 10.0


LOADS = (Setting("simulated time"), Setting("real time", simulated_time=False))
BIG_FIELD = """name: Big
datum: {latitude_deg: 53.0, longitude_deg: 0.0}
polygon: [[0, 0], [280, 0], [280, 250], [0, 250]]
cell_m: 1
truth:
  formula: {family: exponential, mean: 4.0, sd: 0.5, range_m: 12, seed: 1}
"""


@dataclass
class Robot:
    """The nodes of a robot on a mission.

    :param observer: node of this process
    :param processes: processes of the nodes
    :param status: newest status of the mission, and phases in which it was
    """

    observer: Observer
    processes: dict[str, psutil.Process]
    status: list[Any]

    @property
    def phase(self) -> str:
        """What the mission does; empty before its first status."""
        return str(self.status[-1].phase) if self.status else ""


@contextlib.contextmanager
def robot(setting: Setting, folder: Path, autostart: bool = True) -> Iterator[Robot]:
    """A robot and its simulator, each node a process."""
    from soilmoist_ros.simulation.mission.channel import mission_fields
    from soilmoist_ros.simulation.mission.settings import MissionSettings

    mission = MissionSettings(strategy="gcb", dwell="optimal", hours=4.0)
    if setting.field:
        mission = replace(mission, field=setting.field)
    settings = DemoSettings(folder, mission, setting.speed, autostart=autostart, exit_when_finished=False)
    files = write_configuration(settings, mission_fields(mission)[0], folder)
    with files["field_simulator"].open("a") as file:
        file.write(f"    gnss_period_s: {1 / setting.fix_hz}\n")
        if not setting.simulated_time:
            file.write(f"    start_time: '{datetime.now(UTC).isoformat()}'\n    start_when_connected: false\n")
    if not setting.simulated_time:
        for path in files.values():
            path.write_text(path.read_text().replace("use_sim_time: true", "use_sim_time: false"))
    with ros_domain() as (domain, environment):
        from diagnostic_msgs.msg import DiagnosticStatus

        from msg_adapters.mission import mission_from_message
        from soilmoist_ros.nodes.topics import LATCHED

        with ProcessGroup(environment, folder / "log") as group, Observer(domain) as observer:
            for name in ("field_simulator", *NODES):
                if name == "sensor_driver":
                    wait_for((folder / "log" / "ports.json").is_file, "the simulator")
                    ports = json.loads((folder / "log" / "ports.json").read_text())
                    with files[name].open("a") as file:
                        for device in ("logger", "gnss"):
                            file.write("    {}_uri: tcp://{host}:{port}\n".format(device, **ports[device]))
                group.start(name, files[name])
            status: list[Any] = []
            observer.node.create_subscription(
                DiagnosticStatus, "mission", lambda message: status.append(mission_from_message(message)), LATCHED
            )

            def nodes() -> dict[str, psutil.Process]:
                return {node_of(child): child for child in psutil.Process().children()}

            wait_for(lambda: set(NODES) <= set(nodes()), "all nodes")
            yield Robot(observer, {name: nodes()[name] for name in NODES}, status)
            if group.ended():
                raise SystemExit(f"ended too early: {group.ended()}, see the logs")


def node_of(process: psutil.Process) -> str:
    """Name of the node of a process; empty for other processes."""
    with contextlib.suppress(psutil.Error):
        for word in process.cmdline():
            if word.startswith("soilmoist_ros.nodes."):
                return word.rpartition(".")[2]
    return ""


def load(setting: Setting, folder: Path) -> list[Row]:
    """CPU share and memory of each node while the robot drives and counts, and of a node that does nothing."""
    with robot(setting, folder) as its:
        wait_for(lambda: its.status and its.status[-1].raw_counts > 0, "the first counts", 120)
        first = its.status[-1]
        began, before = time.perf_counter(), {name: cpu_s(process) for name, process in its.processes.items()}
        memory: dict[str, tuple[float, float]] = {}
        while time.perf_counter() < began + LOAD_S:
            time.sleep(10.0)
            for name, process in its.processes.items():
                memory[name] = tuple(map(max, memory.get(name, (0.0, 0.0)), memory_mb(process)))
        elapsed_s = time.perf_counter() - began
        used_s = {name: cpu_s(process) - before[name] for name, process in its.processes.items()}
        last = its.status[-1]
        bare: Row = {"what": setting.what, "node": "bare"} | bare_load(20.0)
    if last.distance_m <= first.distance_m or last.counting_s <= first.counting_s:
        raise SystemExit(f"{setting.what}: the robot did not drive and count: {first} {last}")
    rows: list[Row] = [
        {"what": setting.what, "node": name, "cpu_percent": 100 * used_s[name] / elapsed_s}
        | dict(zip(("rss_mb", "pss_mb"), memory[name], strict=True))
        for name in NODES
    ]
    total: Row = {"what": setting.what, "node": "all four"}
    for column in ("cpu_percent", "rss_mb", "pss_mb"):
        total[column] = sum(float(str(row[column])) for row in rows)
    return [*rows, total, bare]


def bare_load(seconds: float) -> Row:
    """CPU share and memory of a node that does nothing, beside the nodes that run."""
    process = subprocess.Popen([sys.executable, "-c", BARE_NODE])
    try:
        time.sleep(5.0)
        watched = psutil.Process(process.pid)
        began, before = time.perf_counter(), cpu_s(watched)
        time.sleep(seconds)
        used = (cpu_s(watched) - before) / (time.perf_counter() - began)
        rss_mb, pss_mb = memory_mb(watched)
        return {"cpu_percent": 100 * used, "rss_mb": rss_mb, "pss_mb": pss_mb}
    finally:
        process.kill()
        process.wait()


def aborts(folder: Path) -> list[Row]:
    """Time from a request to abort to its answer, at random moments of missions on 70,000 cells, 60 times as fast.

    At this speed the mapper maps all the time. Every other request comes while a stop is being chosen.
    """
    rng = np.random.default_rng(3)
    folder.mkdir()
    (folder / "field.yaml").write_text(BIG_FIELD)
    setting = Setting("70,000 cells", speed=60.0, field=str(folder / "field.yaml"), fix_hz=1.0)
    with robot(setting, folder, autostart=False) as its:
        from std_srvs.srv import Trigger

        clients = {
            verb: its.observer.node.create_client(Trigger, f"planner/{verb}") for verb in ("start", "abort")
        }

        def ask(verb: str) -> tuple[bool, float]:
            came = threading.Event()
            began = time.perf_counter()
            answer = clients[verb].call_async(Trigger.Request())
            answer.add_done_callback(lambda _: came.set())
            if not came.wait(LIMIT_S):
                raise SystemExit(f"no answer to {verb}")
            return answer.result().success, time.perf_counter() - began

        wait_for(lambda: all(client.service_is_ready() for client in clients.values()), "the planner")
        wait_for(lambda: ask("start")[0], "the mission to start")
        wait_for(lambda: its.status[-1].samples >= 10, "ten samples", 600)
        delays_ms: dict[bool, list[float]] = {True: [], False: []}
        while sum(map(len, delays_ms.values())) < ABORTS:
            planning = len(delays_ms[True]) <= len(delays_ms[False])
            if planning:
                wait_for(lambda: its.phase == Phase.PLANNING, "a plan", 600)
            else:
                wait_for(
                    lambda: its.phase in (Phase.TRAVELLING, Phase.COUNTING), "the robot to drive or count", 600
                )
            time.sleep(rng.uniform(0.0, 0.05 if planning else 1.0))
            delays_ms[its.phase == Phase.PLANNING].append(1e3 * ask("abort")[1])
            wait_for(lambda: ask("start")[0], "the mission to start again")
    both = [delay for delays in delays_ms.values() for delay in delays]
    return [
        {"asked": what, "tries": len(delays), "median_ms": statistics.median(delays), "longest_ms": max(delays)}
        for what, delays in (("while planning", delays_ms[True]), ("else", delays_ms[False]), ("all", both))
        if delays
    ]


def memory_mb(process: psutil.Process) -> tuple[float, float]:
    """Resident memory of a process, and its share of it: pages that several processes use count in part."""
    used = process.memory_full_info()
    return used.rss / 1e6, used.pss / 1e6


def cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def map_outcome(path: Path) -> tuple[str, int, int]:
    """Why a topological map is refused, empty if it is read; its nodes and edges."""
    try:
        graph = read_topological_map(path).graph
    except InputError as error:
        return re.sub(r"^:\d+: |^: ", "", str(error).removeprefix(str(path))).partition(" -> ")[0][:70], 0, 0
    return "", len(graph.names), len(graph.edges)


def read_maps(folder: Path, save: bool) -> None:
    """Read all topological maps of a folder; a row for each repository and outcome."""
    found = defaultdict(list)
    for path in sorted(one for one in folder.glob("*/**/*") if one.is_file()):
        repository, branch, *_, name = path.relative_to(folder).parts
        reason, nodes, edges = map_outcome(path)
        name = branch if name.startswith(("network", ".network", "poi")) else name
        found[repository.replace("+", "/"), re.sub(r"^node \d+", "node 1", reason)].append((name, nodes, edges))
    rows = []
    for (repository, reason), maps in sorted(found.items()):
        counts = [[one[column] for one in maps] for column in (1, 2)]
        nodes, edges = (f"{min(each)} to {max(each)}" if max(each) else "" for each in counts)
        names = ", ".join(dict.fromkeys(name for name, *_ in maps))
        rows.append((repository, len(maps), names, nodes, edges, reason or "read"))
    settings = f"{sum(map(len, found.values()))} files with different contents, of all branches and requests"
    columns = ("repository", "files", "maps", "nodes", "edges", "read, or why not")
    results.publish("maps", columns, rows, settings, save)


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--only", choices=("latency", "load", "abort"), help="one part")
    parser.add_argument("--maps", type=Path, metavar="FOLDER", help="read topological maps instead")
    given = parser.parse_args()
    if given.maps:
        read_maps(given.maps, given.save)
        return
    # An installed package has compiled modules; compiling takes time and memory.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    for package in (soilmoist_ros, msg_adapters):
        compileall.compile_dir(Path(package.__file__).parent, quiet=1)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if given.only in (None, "latency"):
            rows = [record_to_map(name, folder / name.split(",")[0]) for name in FIELDS_M]
            settings = "from a record to the map with it, fit included"
            results.publish("ros_latency", *results.columns_and_rows(rows), settings, given.save)
        if given.only in (None, "load"):
            rows = [row for each in LOADS for row in load(each, folder / each.what.partition(" ")[0])]
            settings = (
                "a record every 10 s, 10 fixes per second, clock of 50 Hz in simulated time, gcb with optimal, "
                f"over {LOAD_S:g} s; 100 % is one core; rss: resident memory, pss: proportional share of it; "
                "bare: a node that does nothing"
            )
            results.publish("ros_load", *results.columns_and_rows(rows), settings, given.save)
        if given.only in (None, "abort"):
            rows = aborts(folder / "abort")
            settings = "from a request to abort to its answer, 70,000 cells, 60 times as fast as real time"
            results.publish("ros_abort", *results.columns_and_rows(rows), settings, given.save)


if __name__ == "__main__":
    main()
