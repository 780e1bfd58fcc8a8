"""The whole system in simulation: all nodes as processes on a domain of their own, a live view, and the report."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from soilmoist_ros.foundation.errors import InputError, SoilmoistError
from soilmoist_ros.nodes.runtime.loopback import free_domain, loopback_environment
from soilmoist_ros.nodes.system.process_group import ProcessGroup
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.replay import Replay, ReplaySettings, replay_bag
from soilmoist_ros.reporting.live.live_mission import LiveMap, LiveMission
from soilmoist_ros.simulation.fields.field_files import write_field_file, write_site_file
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.settings import MissionSettings, PropertySettings

if TYPE_CHECKING:
    from rclpy.context import Context

Show = Callable[[LiveMission], None]

_START_LIMIT_S = 60.0
_POLL_S = 0.2


class DemoError(SoilmoistError):
    """A node did not do its part; the message says which, and where its log is."""


@dataclass(frozen=True)
class DemoSettings:
    """What is demonstrated.

    :param out: folder of the run; must not hold a run yet
    :param field: surrogate field: a built-in name, or a field file with a truth
    :param strategy: strategy
    :param dwell: dwell rule
    :param hours: simulated time of the mission [h]
    :param speed: simulated time per wall time
    :param seed: seed of all randomness
    :param navigator: ``goto_node`` (Thorvald's navigation) or ``goal_pose``
    :param scenario: what goes wrong in navigation and links: a name or a file; empty for nothing
    :param properties: further properties that are counted and mapped
    """

    out: Path
    field: str = "synthetic-high"
    strategy: str = "gcb"
    dwell: str = "optimal"
    hours: float = 1.0
    speed: float = 60.0
    seed: int = 1
    navigator: str = "goto_node"
    scenario: str = ""
    properties: tuple[PropertySettings, ...] = ()


def run_demo(settings: DemoSettings, show: Show) -> Replay:
    """Explore a surrogate field with all nodes, and map the recording.

    The folder then holds ``bag/``, ``configuration/``, ``log/`` and ``map/`` (what the mapper saved).

    :param settings: what is demonstrated
    :param show: called a few times per second while the mission is under way
    :raises InputError: if the settings cannot be used
    :raises DemoError: if a node ends before the mission does
    :raises KeyboardInterrupt: if interrupted; everything has been closed and the recording is complete
    """
    out = settings.out.absolute()
    if (out / "bag").exists():
        raise InputError("holds a run already", "choose another folder: recordings are not overwritten", out)
    field, *others = mission_fields(MissionSettings(field=settings.field, properties=settings.properties))
    parameters = _configure(settings, field, out)
    grid = field.field.grid()
    truths = [grid.to_raster(one.rate_at(grid.cells)) for one in (field, *others)]
    names = ("", *(one.name for one in settings.properties))
    live = LiveMission(
        f" soilmoist demo: {field.title}, {settings.strategy}, {settings.dwell}, {settings.speed:g} x real time ",
        [LiveMap(name, truth) for name, truth in zip(names, truths, strict=True)],
    )
    with free_domain() as domain:
        environment = loopback_environment(domain)
        os.environ.update(environment)  # before ROS is loaded here
        with ProcessGroup(environment, out / "log") as group, _monitored(live, field, domain):
            for name, path in parameters.items():
                if name == "sensor_driver":
                    path = _with_ports(path, out, group)
                group.start(name, path)
            _watch(group, live, show)
    fields: dict[str | int, str] = {0: settings.field, **{one.name: one.field for one in settings.properties}}
    return replay_bag(out / "bag", ReplaySettings(truths=fields))


def _configure(settings: DemoSettings, field: SurrogateField, out: Path) -> dict[str, Path]:
    """Write the configuration; gives the parameter files of the nodes in the order of their start."""
    configuration = out / CONFIGURATION
    write_field_file(field, configuration / "field.yaml")
    write_site_file(field, configuration / "site.yaml")
    files = {"field": str(configuration / "field.yaml"), "site": str(configuration / "site.yaml")}
    simulated = {"use_sim_time": True}
    mappers: dict[str, dict[str, object]] = {
        f"{wanted.name}/mapper": {
            "field": files["field"], "simulated": True, "save_dir": str(out / f"map_{wanted.name}"), **simulated
        }
        for wanted in settings.properties
    }  # fmt: skip
    nodes: dict[str, dict[str, object]] = {
        # First, so that nothing is missed; and last to end.
        "recorder": {"out": str(out), "name": "bag"},
        "mapper": {**files, "simulated": True, "save_dir": str(out / "map"), **simulated},
        **mappers,
        "planner": {
            "field": files["field"],
            "strategy": settings.strategy,
            "dwell": settings.dwell,
            "hours": settings.hours,
            "seed": settings.seed,
            "navigator": settings.navigator,
            "autostart": True,
            "exit_when_finished": True,
            **({"properties": [f"{one.name}:{one.weight}" for one in settings.properties]} if mappers else {}),
            **simulated,
        },
        "field_simulator": {
            "field": _absolute(settings.field),
            **({"properties": [_absolute(one.field) for one in settings.properties]} if mappers else {}),
            "seed": settings.seed,
            "speed": settings.speed,
            "scenario": settings.scenario,
            "logger_port": 0,
            "gnss_port": 0,
            "ports_file": str(out / "log" / "ports.json"),
        },
        "sensor_driver": {**files, **simulated},
    }
    return {name: write_parameters(out, name, values) for name, values in nodes.items()}


def _absolute(field: str) -> str:
    """The name of a field, or the whole path of its file."""
    return str(Path(field).absolute()) if Path(field).is_file() else field


def _with_ports(path: Path, out: Path, group: ProcessGroup) -> Path:
    """Complete the driver's parameters with where the simulator serves its devices."""
    ports = out / "log" / "ports.json"
    deadline = time.monotonic() + _START_LIMIT_S
    while not ports.is_file():
        _require_all(group)
        if time.monotonic() > deadline:
            raise DemoError(
                f"field_simulator did not start in {_START_LIMIT_S:g} s; see {group.log('field_simulator')}"
            )
        time.sleep(_POLL_S / 4)
    uris = {
        name: "tcp://{host}:{port}".format(**address) for name, address in json.loads(ports.read_text()).items()
    }
    with path.open("a", encoding="utf-8") as file:
        file.write(f"    logger_uri: {uris['logger']}\n    gnss_uri: {uris['gnss']}\n")
    return path


def _watch(group: ProcessGroup, live: LiveMission, show: Show) -> None:
    """Wait for the planner to have finished the mission."""
    while "planner" not in group.ended():
        _require_all(group)
        show(live)
        time.sleep(_POLL_S)
    show(live)
    _require_all(group)


def _require_all(group: ProcessGroup) -> None:
    """See that every node runs, or has finished well."""
    for name, code in group.ended().items():
        if name != "planner" or code != 0:
            said = group.log(name).read_text(errors="replace").strip().splitlines()
            last = said[-1] if said else "it said nothing"
            raise DemoError(f"{name} ended with code {code}: {last}\nits log: {group.log(name)}")


@contextlib.contextmanager
def _monitored(live: LiveMission, field: SurrogateField, domain: int) -> Iterator[None]:
    """Listen to the mission in a thread."""
    import rclpy
    from rclpy.context import Context as RclContext
    from rclpy.executors import SingleThreadedExecutor

    from soilmoist_ros.nodes.system.monitor import Monitor

    context: Context = RclContext()
    rclpy.init(context=context, domain_id=domain)
    executor = SingleThreadedExecutor(context=context)
    monitor = Monitor(live, field.frame, context)
    executor.add_node(monitor)
    ending = threading.Event()

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.2)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join(2.0)
        executor.shutdown()
        monitor.destroy_node()
        context.try_shutdown()
