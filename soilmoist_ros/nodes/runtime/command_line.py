# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command line of a node: its help, and arguments that ROS would ignore."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from importlib import import_module
from itertools import takewhile
from xml.etree import ElementTree

from soilmoist_ros.foundation import InputError, config_folder

HELP = ("-h", "--help")
_WIDTH = 100
_KINDS = {
    ("topics", "publish"): "publishes",
    ("topics", "subscribe"): "subscribes to",
    ("services", "reply"): "services",
    ("services", "request"): "calls services",
    ("actions", "execute"): "actions",
    ("actions", "call"): "calls actions",
}
_OF_EVERY_NODE = (
    "_parameters",
    "_parameter_types",
    "_parameters_atomically",
    "_type_description",
    "/rosout",
    "_events",
)


def check_arguments(arguments: Sequence[str], node: str) -> None:
    """Refuse arguments before ``--ros-args``, which ROS ignores, or takes for old rules of names.

    :param arguments: command line, the program first
    :param node: name of the node
    :raises InputError: if there is one, other than an old rule
    """
    names = {row.name for row in import_module(f"soilmoist_ros.nodes.parameters.{node}").PARAMETERS}
    for word in takewhile(lambda word: word != "--ros-args", arguments[1:]):
        if ":=" in word and word.partition(":=")[0] not in names:
            continue
        example = f"-p {word}" if ":=" in word else "-p NAME:=VALUE"
        raise InputError(
            f"{node} has no argument {word!r}",
            f"a parameter is given as: {node} --ros-args {example}; {node} --help lists them",
        )


def help_of(node: str, about: str) -> str:
    """Names, topics and parameters of a node, for a terminal.

    :param node: name of the node
    :param about: its purpose
    """
    lines = [
        f"{node}: {about}",
        "",
        f"usage: ros2 run soilmoist_ros {node} --ros-args [-p NAME:=VALUE] [--params-file FILE] [-r __ns:=/ROBOT]",
        "",
        f"Names (with {node}/ for ~/; relative names follow the namespace; docs/topics.md has types and contents)",
    ]
    for what, names in _interfaces(node).items():
        lines += _wrapped(f"{what}: {', '.join(sorted(names))}", "  ", "      ")
    lines += ["", "Parameters (also use_sim_time, as every node; docs/parameters.md has the same)"]
    for row in import_module(f"soilmoist_ros.nodes.parameters.{node}").PARAMETERS:
        values = row.limits.replace("..", "to")
        default = f"default {json.dumps(row.default, ensure_ascii=False)}"
        facts = filter(
            None, [row.kind, default, row.unit and f"in {row.unit}", values, "live" if row.live else ""]
        )
        lines += _wrapped(f"{row.name} ({', '.join(facts)})", "  ", "        ")
        lines += _wrapped(row.description, "      ", "      ")
    return "\n".join([*lines, "", "live: may be set while the node runs (ros2 param set)"])


def _interfaces(node: str) -> dict[str, set[str]]:
    """Names of topics, services and actions by what the node does with them, as its permissions list them."""
    found: dict[str, set[str]] = {}
    policy = ElementTree.parse(config_folder() / "security" / "policy.xml")
    for profile in policy.iter("profile"):
        if profile.get("node", "").split("_listener")[0].split("_tf")[0] != node:
            continue
        for rule in profile:
            names = {(one.text or "").replace("~", node) for one in rule}
            for verb in rule.attrib:
                found.setdefault(_KINDS[rule.tag, verb], set()).update(names)
    own = {
        what: {name for name in found.get(what, ()) if not name.endswith(_OF_EVERY_NODE)}
        for what in _KINDS.values()
    }
    return {what: names for what, names in own.items() if names}


def _wrapped(text: str, first: str, further: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=further, break_on_hyphens=False)
