# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates the whole system: all nodes as processes on a private ROS domain, a live view, and the report."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from soilmoist_ros.foundation import InputError, SoilmoistError
from soilmoist_ros.nodes.runtime.loopback import free_domain, loopback_environment
from soilmoist_ros.nodes.system.demo_configuration import (
    DemoSettings,
    node_name,
    shared_mapper,
    write_configuration,
)
from soilmoist_ros.nodes.system.process_group import ProcessGroup
from soilmoist_ros.pipeline import ReplaySettings
from soilmoist_ros.reporting import LiveMap, LiveMission
from soilmoist_ros.simulation import mission_fields, robot_namespaces

__all__ = ["DemoError", "DemoSettings", "run_demo"]

Show = Callable[[LiveMission], None]

_START_LIMIT_S = 60.0
_POLL_S = 0.2


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

    :param settings: the mission and its folder
    :param show: called a few times per second while the mission runs
    :param started: called when the operator's page can be opened, if there is one
    :raises InputError: if the settings cannot be used
    :raises DemoError: if a node ends before the mission does
    :raises KeyboardInterrupt: if interrupted, after the nodes have ended and the recording is complete
    """
    out, mission = settings.out.absolute(), settings.mission
    if (out / "bag").exists():
        raise InputError("holds a run already", "choose another folder: recordings are not overwritten", out)
    field, *others = mission_fields(mission)
    parameters = write_configuration(settings, field, out)
    grid = field.field.grid()
    truths = [grid.to_raster(one.rate_at(grid.cells)) for one in (field, *others)]
    names = ("", *(one.name for one in mission.properties))
    live = LiveMission(
        f" soilmoist demo: {field.title}, {mission.strategy}, {mission.dwell}, "
        f"{settings.time_factor:g} x real time ",
        [LiveMap(name, truth) for name, truth in zip(names, truths, strict=True)],
        robot_namespaces(mission.robots),
    )
    with free_domain() as domain:
        environment = loopback_environment(domain)
        os.environ.update(environment)  # before ROS is loaded here
        from soilmoist_ros.nodes.system.monitor import monitored

        with ProcessGroup(environment, out / "log") as page:
            if settings.console_port:
                page.start("console", parameters.pop("console"))
                _wait_for_page(page, settings.console_port)
                started()
            with ProcessGroup(environment, out / "log") as group, monitored(live, field.frame, domain):
                for name, path in parameters.items():
                    namespace, _, node = name.rpartition("/")
                    if node == "sensor_driver":
                        path = _with_ports(path, namespace, out, group)
                    group.start(name, path, shared_mapper(name, names[1:]))
                _watch(group, live, show)
            fields: dict[str | int, str] = {
                0: mission.field_name,
                **{one.name: one.field_name for one in mission.properties},
            }
            yield ReplaySettings(truths=fields)


def _wait_for_page(group: ProcessGroup, port: int) -> None:
    deadline = time.monotonic() + _START_LIMIT_S
    while True:
        _require_all(group)
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        if time.monotonic() > deadline:
            raise DemoError(f"console did not start in {_START_LIMIT_S:g} s; see {group.log('console')}")
        time.sleep(_POLL_S / 4)


def _with_ports(path: Path, namespace: str, out: Path, group: ProcessGroup) -> Path:
    """Add the addresses of the simulated devices to the parameters of a robot's driver."""
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
        for device in ("logger", "gnss"):
            file.write(f"    {device}_uri: {uris[node_name(namespace, device)]}\n")
    return path


def _watch(group: ProcessGroup, live: LiveMission, show: Show) -> None:
    """Wait until the planners have finished their missions."""
    planners = {node_name(robot.namespace, "planner") for robot in live.robots}
    while not planners <= group.ended().keys():
        _require_all(group)
        show(live)
        time.sleep(_POLL_S)
    show(live)
    _require_all(group)


def _require_all(group: ProcessGroup) -> None:
    """Check that every node runs, or has ended as planned."""
    for name, code in group.ended().items():
        if name.rpartition("/")[2] != "planner" or code != 0:
            lines = group.log(name).read_text(errors="replace").strip().splitlines()
            last = lines[-1] if lines else "without a message"
            raise DemoError(f"{name} ended with code {code}: {last}\nits log: {group.log(name)}")
