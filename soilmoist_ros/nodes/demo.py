# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole system in simulation: all nodes as processes on a private ROS domain, a live view, and the report."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.foundation import InputError, SoilmoistError
from soilmoist_ros.mapping import FIT_SETTINGS, CovariateSource
from soilmoist_ros.nodes.process_group import ProcessGroup, free_domain, loopback_environment
from soilmoist_ros.pipeline import ReplaySettings
from soilmoist_ros.recording import CONFIGURATION, write_parameters
from soilmoist_ros.reporting import LiveMission
from soilmoist_ros.sensing import Irrigation
from soilmoist_ros.simulation import (
    MissionSettings,
    SurrogateField,
    mission_fields,
    robot_namespaces,
    write_field_file,
    write_site_file,
)

_OF_MAPPER = ("samples", "model", "mapper/save")
__all__ = ["DemoError", "DemoSettings", "run_demo"]
Show = Callable[[LiveMission], None]
_START_LIMIT_S = 60.0
_POLL_S = 0.2


@dataclass(frozen=True)
class DemoSettings:
    """Settings of a demo.

    :param scenario: name or file with faults of navigation and links; empty for none
    :param autostart: whether the missions start as soon as they can
    :param exit_when_finished: whether the planners end with their missions
    :param console_port: port of the operator's page on this machine; 0 for no page
    :param irrigation: irrigation keys of the site instead of the default ones
    """

    out: Path
    mission: MissionSettings
    time_factor: float = 60.0
    navigator: str = "goto_node"
    scenario: str = ""
    autostart: bool = True
    exit_when_finished: bool = True
    earlier: tuple[Path, ...] = ()
    covariates: tuple[CovariateSource, ...] = ()
    console_port: int = 0
    irrigation: Irrigation | None = None


def write_configuration(settings: DemoSettings, field: SurrogateField, out: Path) -> dict[str, Path]:
    """Write field, site and parameter files of the nodes; returns these in the order of the start."""
    mission, configuration = settings.mission, out / CONFIGURATION
    files = {name: str(configuration / f"{name}.yaml") for name in ("field", "site")}
    write_field_file(field, Path(files["field"]))
    write_site_file(field, Path(files["site"]), irrigation=settings.irrigation)

    def of_mission(*names: str) -> dict[str, object]:
        return {name: value for name in names if (value := getattr(mission, name)) is not None}

    simulated = {"use_sim_time": True}
    fitted = {**of_mission(*FIT_SETTINGS), "simulated": True, **simulated}
    explained = _given(covariates=[str(one.absolute) for one in settings.covariates])
    known = _given(earlier=[str(path.absolute()) for path in settings.earlier]) | explained
    robots = robot_namespaces(mission.robots)
    several = [f"/{robot}" for robot in robots] if len(robots) > 1 else []
    trips = of_mission("stop_overhead_s")
    nodes: dict[str, dict[str, object]] = {
        "recorder": {"out": str(out), "name": "bag"},  # starts first and ends last, to record everything
        "mapper": {**files, "save_dir": str(out / "map"), **_given(others=several), **known, **fitted},
    }
    for one in mission.properties:
        nodes[f"{one.name}/mapper"] = {
            "field": files["field"], "save_dir": str(out / f"map_{one.name}"), **explained,
            **_given(others=[f"{robot}/{one.name}" for robot in several]), **fitted,
        }  # fmt: skip
    for number, robot in enumerate(robots):
        nodes[node_name(robot, "planner")] = {
            "field": files["field"],
            **of_mission("strategy", "dwell", "hours", "until", "until_sd", "until_gain", "certify", "preset"),
            **of_mission("target", "threshold", "metre_cost_s", "min_dwell_s"), **trips, **known,
            **({"site": files["site"]} if mission.until or mission.target != "rate" else {}),
            "seed": mission.seed + number, "navigator": settings.navigator, "autostart": settings.autostart,
            "exit_when_finished": settings.exit_when_finished,
            **_given(others=several, properties=[f"{one.name}:{one.weight}" for one in mission.properties]),
            **simulated,
        }  # fmt: skip
        nodes[node_name(robot, "watchdog")] = {"silent_s": 10.0}
    nodes["field_simulator"] = {
        "field": _absolute(mission.field_name),
        **_given(properties=[_absolute(one.field_name) for one in mission.properties]),
        **of_mission("seed", "robots"), **trips, "speed": settings.time_factor, "scenario": settings.scenario,
        "logger_port": 0, "gnss_port": 0, "ports_file": str(out / "log" / "ports.json"),
    }  # fmt: skip
    nodes |= {node_name(robot, "sensor_driver"): {**files, **simulated} for robot in robots}
    if settings.console_port:
        page = {"field": files["field"], "port": settings.console_port, "runs": str(out.parent)}
        nodes = {"console": {**page, "field_dir": str(out / "fields"), **_given(robots=several)}, **nodes}
    return {name: write_parameters(out, name, values) for name, values in nodes.items()}


def _given(**lists: list[str]) -> dict[str, object]:
    """Lists that have items: to ROS an empty list has no type."""
    return {name: items for name, items in lists.items() if items}


def node_name(namespace: str, node: str) -> str:
    """Name of a node with its namespace.

    >>> node_name("robot_1", "planner"), node_name("", "planner")
    ('robot_1/planner', 'planner')
    """
    return f"{namespace}/{node}".lstrip("/")


def shared_mapper(node: str, properties: Iterable[str] = ()) -> dict[str, str]:
    """Names by which a planner in the namespace of a robot reaches the mappers that several robots share.

    >>> shared_mapper("robot_1/planner")
    {'samples': '/samples', 'model': '/model', 'mapper/save': '/mapper/save'}
    """
    if not node.endswith("/planner"):
        return {}
    names = [f"{name}/{topic}".lstrip("/") for name in ("", *properties) for topic in _OF_MAPPER]
    return {name: f"/{name}" for name in names}


def _absolute(field: str) -> str:
    return str(Path(field).absolute()) if Path(field).is_file() else field


# Simulates the whole system: all nodes as processes on a private ROS domain, a live view, and the report --------


class DemoError(SoilmoistError):
    """A node ended too early; the message names the node and its log."""


@contextlib.contextmanager
def run_demo(
    settings: DemoSettings, show: Show, started: Callable[[], object] = lambda: None
) -> Iterator[ReplaySettings]:
    """Explore a surrogate field with all nodes. The operator's page lasts with the context.

    The context begins when the mission has ended and the recording is complete, and gives the settings to map it.

    The folder receives ``bag/``, ``configuration/``, ``log/``, ``map/``, and ``map_NAME/`` for each
    further property.
    """
    out, mission = settings.out.absolute(), settings.mission
    if (out / "bag").exists():
        raise InputError("holds a run already", "choose another folder: recordings are not overwritten", out)
    field = mission_fields(mission)[0]
    parameters = write_configuration(settings, field, out)
    live = LiveMission(
        f" soilmoist demo: {field.title}, {mission.strategy}, {mission.dwell}, "
        f"{settings.time_factor:g} x real time ",
        robot_namespaces(mission.robots),
    )
    with free_domain() as domain:
        environment = loopback_environment(domain)
        os.environ.update(environment)  # before ROS is loaded here
        from soilmoist_ros.nodes.command_nodes import monitored

        with ProcessGroup(environment, out / "log") as page:
            if settings.console_port:
                page.start("console", parameters.pop("console"))
                _wait(page, "console", lambda: _answers(settings.console_port))
                started()
            with ProcessGroup(environment, out / "log") as group, monitored(live, domain):
                for name, path in parameters.items():
                    namespace, _, node = name.rpartition("/")
                    if node == "sensor_driver":
                        path = _with_ports(path, namespace, out, group)
                    group.start(name, path, shared_mapper(name, [one.name for one in mission.properties]))
                _watch(group, live, show)
            fields: dict[str, str] = {one.name: one.field_name for one in mission.properties}
            yield ReplaySettings(truths={"": mission.field_name, **fields})


def _wait(group: ProcessGroup, name: str, is_there: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _START_LIMIT_S
    while not is_there():
        _require_all(group)
        if time.monotonic() > deadline:
            raise DemoError(f"{name} did not start in {_START_LIMIT_S:g} s; see {group.log(name)}")
        time.sleep(_POLL_S / 4)


def _answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
        return True
    return False


def _with_ports(path: Path, namespace: str, out: Path, group: ProcessGroup) -> Path:
    ports = out / "log" / "ports.json"
    _wait(group, "field_simulator", ports.is_file)
    addresses = json.loads(ports.read_text())
    with path.open("a", encoding="utf-8") as file:
        for device in ("logger", "gnss"):
            address = addresses[node_name(namespace, device)]
            file.write("    {}_uri: tcp://{host}:{port}\n".format(device, **address))
    return path


def _watch(group: ProcessGroup, live: LiveMission, show: Show) -> None:
    planners = {node_name(robot.namespace, "planner") for robot in live.robots}
    while not planners <= group.ended().keys():
        _require_all(group)
        show(live)
        time.sleep(_POLL_S)
    show(live)
    _require_all(group)


def _require_all(group: ProcessGroup) -> None:
    for name, code in group.ended().items():
        if code < 0:
            killed = f"signal {-code}, {signal.strsignal(-code)}"
            raise DemoError(f"{name} was killed ({killed})\nits log: {group.log(name)}")
        if name.rpartition("/")[2] != "planner" or code != 0:
            lines = group.log(name).read_text(errors="replace").strip().splitlines()
            last = lines[-1] if lines else "without a message"
            raise DemoError(f"{name} ended with code {code}: {last}\nits log: {group.log(name)}")
