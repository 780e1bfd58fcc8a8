# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Declares the parameters of a node from its table, reads them by type, and rejects all others."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from difflib import get_close_matches
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.validate_namespace import validate_namespace

from soilmoist_ros.foundation import InputError, listing, read_yaml
from soilmoist_ros.nodes.parameters.parameter import Parameter, Value, check_values, current_names


def other_namespaces(node: Node, namespaces: Iterable[str]) -> list[str]:
    """Absolute namespaces of other robots, without the namespace of this node.

    :raises InputError: if a namespace is invalid
    """
    plain = dict.fromkeys(f"/{name.strip('/')}" for name in namespaces)
    if "/" in plain:
        raise InputError("others: a robot has no namespace", "give each robot one of its own, such as /robot_2")
    for name in plain:
        try:
            validate_namespace(name)
        except InvalidNamespaceException as error:
            raise InputError(f"others: {name!r} is not a namespace ({error})", "an example is /robot_2") from None
    return [name for name in plain if name != node.get_namespace()]


NODES = ("console", "field_simulator", "mapper", "planner", "recorder", "sensor_driver")
"""Modules with the tables of the nodes, of which a file for all nodes may have parameters."""
MISSPELT = 0.85
"""Similarity to a parameter of the node, from 0 to 1, from which a name under ``/**`` is a misspelt one."""


def names_for_all(arguments: Sequence[str], node: str) -> set[str]:
    """Names of parameters that parameter files give to all nodes, as under ``/**``, and not to one by its name.

    :param arguments: command line of a process, with ``--params-file FILE`` and ``-p NAME:=VALUE``
    :param node: name of the node
    """
    for_all, own = set[str](), set[str]()
    for option, value in pairwise(arguments):
        if option in ("-p", "--param"):
            own.add(value.partition(":=")[0].rpartition(":")[2])
        if option != "--params-file":
            continue
        try:
            blocks = list(_blocks(read_yaml(Path(value))))
        except InputError:
            continue  # the reader of ROS has accepted it; names that are not found here are refused
        for place, names in blocks:
            last = place.rstrip("/").rpartition("/")[2]
            (for_all if "*" in last else own if last == node else set[str]()).update(names)
    return for_all - own


def _is_misspelt(name: str, rows: Mapping[str, Parameter]) -> bool:
    """Whether a name is nearly that of a parameter of this node, and of no other node of the package."""
    if not get_close_matches(name, rows, 1, MISSPELT):
        return False
    tables = (import_module(f"soilmoist_ros.nodes.parameters.{node}").PARAMETERS for node in NODES)
    return all(name != row.name for table in tables for row in table)


def _blocks(content: Any, place: str = "") -> Iterator[tuple[str, list[str]]]:
    """Name of the node, and names of parameters, of each block of a parameter file."""
    for key, value in content.items() if isinstance(content, Mapping) else ():
        if key == "ros__parameters":
            yield place, list(_names(value))
        else:
            yield from _blocks(value, f"{place}/{key}")


def _names(content: Any, above: str = "") -> Iterator[str]:
    for key, value in content.items() if isinstance(content, Mapping) else ():
        if isinstance(value, Mapping):
            yield from _names(value, f"{above}{key}.")
        else:
            yield f"{above}{key}"


class Parameters:
    """The checked and declared parameters of a node, read by type, as they were at the start.

    Only live ones can change while the node runs, see :meth:`watch`.

    :param node: the node; no parameter of the table may be declared yet
    :param table: rows of the parameters
    :param arguments: command line with the parameter files; by default that of the process
    :raises InputError: with every unknown name and every invalid value. Names under ``/**`` are meant for all
        nodes of a robot: unknown ones are ignored with a line in the log, unless they are misspelt
    """

    def __init__(self, node: Node, table: Sequence[Parameter], arguments: Sequence[str] | None = None) -> None:
        rows = self._rows = {row.name: row for row in table}
        self._node = node
        overrides = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
        given, warnings, twice = current_names(rows, overrides)
        known = {*rows, *node._parameters}
        foreign = [name for name in given if name not in known and not name.startswith("qos_overrides.")]
        if foreign:
            for_all = names_for_all(sys.argv if arguments is None else arguments, node.get_name())
            # Launch files, too, write what they set under /**: a misspelt name is rather one of this node.
            foreign = [name for name in foreign if name in for_all and not _is_misspelt(name, rows)]
        self._values, mistakes = check_values(rows, given, known={*node._parameters, *foreign})
        if twice or mistakes:
            raise InputError([*twice, *mistakes])
        if foreign:
            names = listing(sorted(foreign))
            warnings.append(f"parameters of /** that this node does not have are ignored: {names}")
        for warning in warnings:
            node.get_logger().warning(warning)
        for name, value in self._values.items():
            node.declare_parameter(name, value, rows[name].descriptor(), ignore_override=True)

    def changed(self, values: Mapping[str, Value]) -> Parameters:
        """The same with other values; what the node shows stays as it is."""
        other = copy(self)
        other._values = {**self._values, **values}
        return other

    def watch(self, change: Callable[[Mapping[str, Value]], str]) -> None:
        """Let live parameters be set from now on.

        :param change: called with new values that are allowed; returns why they are refused, or an empty text
        """

        def on_set(given: Sequence[RosParameter]) -> SetParametersResult:
            values = {}
            for parameter in given:
                row = self._rows.get(parameter.name)
                if row is None or not row.live:
                    continue
                try:
                    values[row.name] = row.checked(parameter.value)
                except ValueError as error:
                    return SetParametersResult(successful=False, reason=f"{row.name} {error}")
            reason = change(values) if values else ""
            return SetParametersResult(successful=not reason, reason=reason)

        self._node.add_on_set_parameters_callback(on_set)

    def show(self, values: Mapping[str, Value]) -> None:
        """Show the present values of live parameters; :meth:`watch` passes those that differ to its function."""
        shown = {name: self._node.get_parameter(name).value for name in values}
        new = [RosParameter(name, value=value) for name, value in values.items() if value != shown[name]]
        self._node.set_parameters(new)

    def text(self, name: str) -> str:
        """Value of a text parameter."""
        value = self._values[name]
        assert isinstance(value, str)
        return value

    def number(self, name: str) -> float:
        """Value of a number parameter."""
        value = self._values[name]
        assert isinstance(value, float)
        return value

    def whole(self, name: str) -> int:
        """Value of a whole-number parameter."""
        value = self._values[name]
        assert isinstance(value, int)
        return value

    def flag(self, name: str) -> bool:
        """Value of a true-or-false parameter."""
        value = self._values[name]
        assert isinstance(value, bool)
        return value

    def texts(self, name: str) -> list[str]:
        """Value of a parameter that is a list of texts."""
        value = self._values[name]
        assert isinstance(value, list)
        return list(value)

    def as_dict(self) -> dict[str, Value]:
        """All values by name."""
        return dict(self._values)
