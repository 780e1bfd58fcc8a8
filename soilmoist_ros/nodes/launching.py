# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts the arguments of a launch file, which are texts, to parameters of nodes and names of topics."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation import InputError, Mistake, did_you_mean, parse_yaml
from soilmoist_ros.nodes.parameters import Value, check_values

TOPICS: Final = {
    "fix_topic": ("fix", "fixes of the robot (sensor_msgs/NavSatFix), such as /gps/fix"),
    "battery_topic": ("battery_state", "state of the battery (sensor_msgs/BatteryState)"),
    "emergency_stop_topic": ("emergency_stop", "emergency stop of the robot (std_msgs/Bool), such as /e_stop"),
    "goal_pose_topic": ("goal_pose", "goals of navigator:=goal_pose (geometry_msgs/PoseStamped)"),
}
"""Launch arguments that name a topic of the robot: our name of the topic, and what is on it."""
BAD_INPUT: Final = 2
"""Exit code of a node with bad input, or with a port or a journal that another process uses."""
SIMULATED_SILENT_S: Final = 10.0
"""Longest silence of the planner in simulations [s]: they run faster than time, and load the computer."""
OF_LAUNCH: Final = ("emulate_tty", "launch-prefix", "launch-prefix-filter", "sigkill_timeout", "sigterm_timeout")
"""Arguments that ROS's launch itself reads."""
_MAX_WORDS: Final = 4000
"""Number of characters of a node's messages that are remembered."""
_LOG_LINE: Final = re.compile(r"\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[")
_NAME: Final = re.compile(r"~?/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*")


def refuse_unknown(file: str, descriptions: Iterable[Any]) -> None:
    """Refuse arguments of ``ros2 launch`` that a launch file does not have; launch itself ignores them."""
    known = [argument.name for one in descriptions for argument in one.get_launch_arguments()]
    words, names = [Path(word).name for word in sys.argv], {*known, *OF_LAUNCH}
    if Path(file).name not in words:
        return
    given = [word.partition(":=")[0] for word in sys.argv[words.index(Path(file).name) + 1 :] if ":=" in word]
    unknown = [name for name in given if name not in names]
    if unknown:
        listed = ", ".join(f"{name!r}{did_you_mean(name, names)}" for name in unknown)
        raise InputError(f"there is no launch argument {listed}", f"there are: {', '.join(sorted(known))}")


def parameter_files(text: str) -> list[str]:
    """The argument ``params_file`` as a list; launch itself goes on without a file that does not exist."""
    if text and not Path(text).is_file():
        raise InputError(f"params_file: there is no file {text!r}", "give the path of a YAML file")
    return [text] if text else []


def with_empty_lists(values: Mapping[str, object]) -> dict[str, Any]:
    """Parameters as launch accepts them: it refuses a bare empty list."""
    from launch_ros.parameter_descriptions import ParameterValue

    return {
        name: ParameterValue([], value_type=list[str]) if value == [] else value for name, value in values.items()
    }


class LastWords:
    """Ends a launch when a node cannot start, and says which and why.

    A node that has crashed starts again. One with :data:`BAD_INPUT` would only end again.
    """

    def __init__(self) -> None:
        self._written: dict[int, str] = {}

    def hear(self, event: Any) -> None:
        """A process has written to stderr."""
        written = self._written.get(event.pid, "") + event.text.decode(errors="replace")
        self._written[event.pid] = written[-_MAX_WORDS:]

    def on_exit(
        self, name: str, then: Callable[[int], list[Any]] | None = None
    ) -> Callable[[Any, Any], list[Any]]:
        """Actions after the end of a node, as launch takes them."""

        def ended(event: Any, context: Any) -> list[Any]:
            written = self._written.pop(event.pid, "")
            if context.is_shutdown:
                return []
            if event.returncode != BAD_INPUT:
                return then(event.returncode) if then is not None else []
            lines: list[str] = []
            for line in filter(None, map(str.strip, written.splitlines())):
                lines = [] if _LOG_LINE.match(line) else [*lines, line]
            why = "\n".join(lines) or f"it ended with exit code {BAD_INPUT}"
            if name.rpartition("/")[2] != "console":
                raise InputError(f"the node {name} is missing, and the launch ends: {why}")
            from launch.actions import EmitEvent, LogInfo
            from launch.events.process import ShutdownProcess

            never_again = ShutdownProcess(process_matcher=lambda one: one is event.action)
            message = f"the node {name} is missing, the others go on: {why}"
            return [LogInfo(msg=message), EmitEvent(event=never_again)]

        return ended


def parameters_from(node: str, arguments: Mapping[str, str]) -> dict[str, Value]:
    """Arguments that are parameters of a node, converted to their types; empty texts are left out."""
    table = {row.name: row for row in importlib.import_module(f"soilmoist_ros.nodes.{node}").PARAMETERS}
    given = {
        name: text if isinstance(table[name].default, str) else _value(text)
        for name, text in arguments.items()
        if text and name in table
    }
    values, mistakes = check_values(table, given)
    if mistakes:
        raise InputError([Mistake(f"{node}: {mistake.message}", mistake.remedy) for mistake in mistakes])
    return {name: values[name] for name in given}


def property_argument(given: str) -> list[str]:
    """Items of the argument ``property``: ``NAME[:WEIGHT]``, separated by commas.

    >>> property_argument("compaction:2, salt")
    ['compaction:2', 'salt']
    """
    return [item.strip() for item in given.strip("[] ").split(",") if item.strip()]


def remappings(topics: Mapping[str, str], further: str = "") -> list[tuple[str, str]]:
    """Rules that give topics of the nodes other names.

    >>> remappings({"fix_topic": "/gps/fix", "battery_topic": ""}, "/tf:=tf, /tf_static:=tf_static")
    [('fix', '/gps/fix'), ('/tf', 'tf'), ('/tf_static', 'tf_static')]

    :param topics: names of topics by the arguments in :data:`TOPICS`; an empty text leaves a topic unchanged
    """
    rules = [(TOPICS[argument][0], name.strip()) for argument, name in topics.items() if name.strip()]
    for item in filter(None, map(str.strip, further.split(","))):
        old, arrow, new = (part.strip() for part in item.partition(":="))
        if not arrow:
            raise InputError(f"remap: {item!r} is no rule", "rules look like /tf:=tf,counts:=/crns/counts")
        rules.append((old, new))
    for name in (name for rule in rules for name in rule):
        if not _NAME.fullmatch(name):
            raise InputError(f"{name!r} is not the name of a topic", "names look like /gps/fix or gps/fix")
    return rules


def enclave(prefix: str, namespace: str, node: str) -> list[str]:
    """ROS arguments that name a node's enclave, as ``scripts/keystore`` makes it; none for an empty prefix."""
    return (
        ["--enclave", "/".join(filter(None, [prefix.rstrip("/"), namespace.strip("/"), node]))] if prefix else []
    )


def _value(text: str) -> Any:
    try:
        return parse_yaml(text)
    except InputError:
        return text
