# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for the parts of ``launch`` and ``launch_ros`` that the launch files use; neither package has wheels.

Each stand-in accepts the arguments of the real part, and refuses others.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field, make_dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml


@dataclass
class LaunchContext:
    """Texts of all arguments by name."""

    launch_configurations: dict[str, str] = field(default_factory=dict)
    is_shutdown: bool = False


@dataclass
class LaunchDescription:
    entities: list[Any]

    def get_launch_arguments(self) -> list[DeclareLaunchArgument]:
        return list(arguments_of(self).values())


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str | None = None
    description: str | None = None


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context: LaunchContext) -> str:
        return context.launch_configurations[self.name]


@dataclass
class IfCondition:
    predicate: LaunchConfiguration

    def evaluate(self, context: LaunchContext) -> bool:
        text = self.predicate.perform(context).lower()
        if text not in {"true", "1", "false", "0"}:
            raise ValueError(f"{text!r} is not a condition")
        return text in {"true", "1"}


def part(name: str, *fields: Any) -> type:
    """A stand-in that only holds what it is given by keywords."""
    return make_dataclass(name, fields, kw_only=True)


OpaqueFunction = part("OpaqueFunction", "function")
Shutdown = part("Shutdown", "reason")
LogInfo = part("LogInfo", "msg")
EmitEvent = part("EmitEvent", "event")
ShutdownProcess = part("ShutdownProcess", "process_matcher")
OnProcessIO = part("OnProcessIO", "on_stderr")
ProcessIO = part("ProcessIO", "text", ("pid", int, 1))
ProcessExited = part("ProcessExited", "returncode", ("pid", int, 1), ("action", Any, None))
RegisterEventHandler = make_dataclass("RegisterEventHandler", ["event_handler"])
ParameterValue = make_dataclass("ParameterValue", ["value", ("value_type", Any, None)])
"""A value that may be an empty list, which launch refuses elsewhere."""


@dataclass
class PythonLaunchDescriptionSource:
    launch_file_path: str

    def get_launch_description(self, _context: LaunchContext) -> LaunchDescription:
        return load(Path(self.launch_file_path), None)


@dataclass
class IncludeLaunchDescription:
    launch_description_source: PythonLaunchDescriptionSource
    launch_arguments: Iterable[tuple[str, str]] = ()


@dataclass(kw_only=True)
class Node:
    package: str
    executable: str
    name: str
    namespace: str
    parameters: list[Any]
    output: str
    on_exit: Any = None
    respawn: bool = False
    respawn_delay: float | None = None
    sigterm_timeout: str = "5"
    sigkill_timeout: str = "5"
    remappings: list[tuple[str, str]] | None = None
    ros_arguments: Iterable[str] = ()

    def command_line(self, folder: Path) -> list[str]:
        """Command line that ``launch_ros`` would make; parameters are written to files in a folder."""
        namespace = f"/{self.namespace.strip('/')}".rstrip("/")
        arguments = ["--ros-args", *self.ros_arguments, "-r", f"__node:={self.name}"]
        arguments += ["-r", f"__ns:={namespace or '/'}"]
        for old, new in self.remappings or ():
            arguments += ["-r", f"{old}:={new}"]
        for number, given in enumerate(self.parameters):
            if isinstance(given, dict):
                assert [] not in given.values(), "launch refuses an empty list"
                given = {
                    name: one.value if isinstance(one, ParameterValue) else one for name, one in given.items()
                }
                path = folder / f"launch_params_{self.name}_{number}.yaml"
                path.write_text(yaml.dump({f"{namespace}/{self.name}": {"ros__parameters": given}}))
                given = str(path)
            arguments += ["--params-file", given]
        return arguments


MODULES = {
    "launch": (LaunchContext, LaunchDescription),
    "launch.actions": (
        DeclareLaunchArgument, EmitEvent, IncludeLaunchDescription, LogInfo, OpaqueFunction, RegisterEventHandler,
        Shutdown,
    ),
    "launch.conditions": (IfCondition,),
    "launch.events": (),
    "launch.event_handlers": (OnProcessIO,),
    "launch.events.process": (ShutdownProcess,),
    "launch.launch_description_entity": (type("LaunchDescriptionEntity", (), {}),),
    "launch.launch_description_sources": (PythonLaunchDescriptionSource,),
    "launch.substitutions": (LaunchConfiguration,),
    "launch_ros": (),
    "launch_ros.actions": (Node,),
    "launch_ros.parameter_descriptions": (ParameterValue,),
}  # fmt: skip


def load(path: Path, monkeypatch: Any) -> LaunchDescription:
    """Description that a launch file generates; ``monkeypatch`` is ``None`` if launch is replaced already."""
    for name, classes in MODULES.items() if monkeypatch is not None else ():
        module = ModuleType(name)
        for one in classes:
            setattr(module, one.__name__, one)
        monkeypatch.setitem(sys.modules, name, module)
    if monkeypatch is not None:
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
    name = path.name.partition(".")[0]
    loader = SourceFileLoader(name, str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    description = module.generate_launch_description()
    assert isinstance(description, LaunchDescription)
    return description


def arguments_of(description: LaunchDescription) -> dict[str, DeclareLaunchArgument]:
    return {one.name: one for one in description.entities if isinstance(one, DeclareLaunchArgument)}


def start(
    path: Path,
    monkeypatch: Any,
    given: dict[str, str],
    context: LaunchContext | None = None,
    heard: list[Any] | None = None,
) -> list[Any]:
    """Everything that a launch file and its included files start; ``heard`` gets what listens to stderr."""
    heard = [] if heard is None else heard
    context = context or LaunchContext()
    context.launch_configurations.update(given)
    started: list[Any] = []

    def visit(entities: Iterable[Any]) -> None:
        for one in entities:
            if isinstance(one, DeclareLaunchArgument):
                if one.name not in context.launch_configurations:
                    assert one.default_value is not None, f"{one.name} is required"
                    context.launch_configurations[one.name] = one.default_value
            elif isinstance(one, RegisterEventHandler):
                heard.append(one.event_handler.on_stderr)
            elif isinstance(one, OpaqueFunction):
                visit(one.function(context))
            elif isinstance(one, IncludeLaunchDescription):
                source = Path(one.launch_description_source.launch_file_path)
                known = arguments_of(load(source, monkeypatch))
                arguments = dict(one.launch_arguments)
                assert arguments.keys() <= known.keys(), arguments.keys() - known.keys()
                started.extend(start(source, monkeypatch, arguments, context, heard))
            else:
                started.append(one)

    visit(load(path, monkeypatch).entities)
    return started
