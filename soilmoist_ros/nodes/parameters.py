# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node: rows of its table, check of values, and declaration; all others are refused."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.validate_namespace import validate_namespace

from soilmoist_ros.foundation import InputError, Mistake, did_you_mean, listing, read_yaml

Value = bool | int | float | str | list[str]
Some = TypeVar("Some")

_HIGHEST = 1e300
_MAX_WHOLE = 2**62
_AT_ANTENNA: Final = "records lie where the antenna is: the sensor counts far around it"
REMOVED: Final = {
    "agree_fixes": "10 fixes must agree to replace those that they contradict",
    "also": "set properties",
    "antenna_x_m": _AT_ANTENNA,
    "antenna_y_m": _AT_ANTENNA,
    "autostart": "the node starts with its process",
    "background": "the page shows no photo below the map",
    "backoff_s": "the wait after the first failure is 2 s",
    "battery_silent_s": "a battery that was heard is missed after 60 s",
    "beyond_m": "nodes and edges of the map up to 0.1 m outside the field belong to it",
    "blacklist_s": "a stop that failed or was skipped is ruled out for 900 s",
    "cancel_limit_s": "a robot that is not known to stand is asked again to stop after 10 s",
    "clear_s": "an alarm ends when its cause has been over for 10 s",
    "covariate_dir": "covariates are named in the field file, or by the parameter of mapper and planner",
    "counts_bad_s": "the records of 60 s are judged",
    "datum_service": "no service is asked: give the datum, or drive 20 m by hand",
    "delete_oldest": "the recorder deletes nothing",
    "edge_actions": "the actions of the usual navigations are known, and those that the map describes",
    "failures_to_pause": "the operator is asked after 5 failures in a row",
    "feedback_topic": "the feedback of the action is shown",
    "field_file": "field names the field, or a file with a truth",
    "file_mb": "a bag is one file",
    "file_min": "a bag is one file",
    "first_fixes": "3 fixes must agree on the first place",
    "flush_period_s": "messages are on the disk within 0.5 s",
    "foxglove_port": "foxglove_bridge serves the viewer Foxglove (docs/topics.md)",
    "frame_limit_m": "the places by TF and by fixes may be 2 m apart",
    "full_soon_h": "the recorder warns an hour before the disk is full",
    "goal_time_factor": "a trip may take 3 times the expected time, and 60 s more",
    "goal_time_margin_s": "a trip may take 3 times the expected time, and 60 s more",
    "intensity_topic": "the incoming neutrons are those of the site file ('intensity' under 'corrections')",
    "keep_apart_m": "robots keep 2 m apart, or 1 m more than twice robot_radius_m",
    "keep_days": "the recorder deletes nothing: delete old recordings by hand",
    "keep_gb": "the recorder deletes nothing, and warns below 500 MB of free space",
    "keepout_resolution_m": "a cell is 0.2 m, or half of robot_radius_m if that is less; more in fields of 16 ha",
    "learn_travel": "travel times are learned from the legs driven",
    "local": "the variance of the rate is alike everywhere (docs/benchmarks.md says what it gained otherwise)",
    "longest_dwell_s": "the longest time at a stop is 3600 s; fmi:SECONDS sets the time itself",
    "low_disk_mb": "the recorder warns below 500 MB of free space",
    "map_wait_s": "the planner waits for the mapper for 20 s",
    "max_jump_m": "a fix may be 3 m from where the robot can have driven",
    "max_stamp_age_s": "records stamped up to a day in the past are used",
    "max_stamp_ahead_s": "records stamped up to an hour in the future are used",
    "merge_from": "a map has the records of its driver's log, and those that the mapper has received",
    "moving_m": "a robot that moves by 0.5 m without a goal is stopped again",
    "navigation_wait_s": "the planner waits for the navigation for 30 s",
    "other_silent_s": "a robot that was not heard for 30 s is lost",
    "plan_limit_s": "choosing a stop may take 120 s",
    "pose_observers": "nodes that record or show poses are known",
    "queue_mb": "64 MB of messages wait for a slow disk",
    "retries": "a goal that failed is sent once more",
    "sensor_x_m": _AT_ANTENNA,
    "sensor_y_m": _AT_ANTENNA,
    "settle_s": "a robot has arrived at a goal_pose when it stands for 5 s",
    "silence_limit_s": "a stop without a record for records_old_s is silent",
    "site_file": "field has the site of a simulation",
    "standstill_s": "a robot stands when it has not moved for 4 s",
    "stop_cost_s": "min_dwell_s makes stops longer and fewer, metre_cost_s ways shorter",
    "truth_file": "field takes a file with a truth",
    "turn_s_per_rad": "turns are part of what is learned from the legs driven",
}
"""Parameters of earlier releases that a file may still set: what holds instead."""
OF_OTHERS: Final = ("max_stamp_age_s", "max_stamp_ahead_s", "silence_limit_s")
"""Removed parameters of the planner that mapper or driver still have: only the planner warns of them."""
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", list: "a list of texts"}
_ROS_KINDS = {bool: "bool", int: "integer", float: "double", str: "string", list: "string_array"}
NODES = ("console", "field_simulator", "mapper", "planner", "recorder", "sensor_driver", "watchdog")
"""Modules with the tables of the nodes, of which a file for all nodes may have parameters."""
SILENCE_S: Final = 60.0
"""Time without a record at a stop that counts as silence, where records_old_s is 0 [s]: six usual records."""
MISSPELT = 0.85
"""Similarity to a parameter of the node, from 0 to 1, from which a name under ``/**`` is a misspelt one."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A row of a node's parameter table.

    :param default: default; its type is the parameter's type
    :param unit: unit, empty without one
    :param choices: texts allowed, any if empty
    :param live: whether ``ros2 param set`` may change it while the node runs
    """

    name: str
    default: Value
    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False

    @property
    def kind(self) -> str:
        """Name of the ROS type."""
        return _ROS_KINDS[type(self.default)]

    @property
    def limits(self) -> str:
        """Values allowed, for tables and messages; empty if every value of the type is allowed."""
        if self.choices:
            return " | ".join(self.choices)
        if self.low is not None and self.high is not None:
            return f"{self.low:g} .. {self.high:g}"
        if self.low is not None:
            return f">= {self.low:g}"
        return f"<= {self.high:g}" if self.high is not None else ""

    def checked(self, value: Any) -> Value:
        """The value, converted to the parameter's type."""
        wanted: Any = type(self.default)
        if wanted is float and type(value) is int:
            value = float(value)
        if wanted is list and value is None:  # an empty list has no type in ROS
            value = []
        if wanted is list and isinstance(value, Iterable) and not isinstance(value, str | bytes):
            value = [item for item in value if item != ""]  # [""] is how people write an empty list for ROS
        if type(value) is not wanted or (wanted is list and not all(isinstance(item, str) for item in value)):
            quoted = wanted is str and isinstance(value, bool)
            hint = ": YAML reads on, off, yes and no as such; write it in quotes" if quoted else ""
            raise ValueError(f"must be {_KINDS[wanted]}, got {value!r}{hint}")
        if wanted is float and not math.isfinite(value):
            raise ValueError(f"must be finite, got {value!r}")
        if self.choices and value not in self.choices:
            guess = did_you_mean(str(value), self.choices)
            raise ValueError(f"must be one of: {', '.join(self.choices)}; got {str(value)!r}{guess}")
        outside = isinstance(value, int | float) and (
            (self.low is not None and value < self.low) or (self.high is not None and value > self.high)
        )
        if outside:
            unit = f" {self.unit}" if self.unit else ""
            raise ValueError(f"must be {self.limits}{unit}, got {value:g}")
        checked: Value = value
        return checked

    def descriptor(self) -> ParameterDescriptor:
        """Descriptor for tools such as ``ros2 param describe``."""
        unit = f" [{self.unit}]" if self.unit else ""
        descriptor = ParameterDescriptor(
            name=self.name,
            description=f"{self.description}{unit}",
            read_only=not self.live,
            dynamic_typing=self.live and isinstance(self.default, list),  # to ROS an empty list is one of bytes
        )
        if self.choices:
            descriptor.additional_constraints = f"one of: {', '.join(self.choices)}"
        if self.low is None and self.high is None:
            return descriptor
        low, high = (-_HIGHEST if self.low is None else self.low), (_HIGHEST if self.high is None else self.high)
        if isinstance(self.default, float):
            limits = FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
            descriptor.floating_point_range = [limits]
        elif isinstance(self.default, int):
            first, last = int(max(low, -_MAX_WHOLE)), int(min(high, _MAX_WHOLE))
            descriptor.integer_range = [IntegerRange(from_value=first, to_value=last, step=1)]
        return descriptor


def current_names(table: Mapping[str, Parameter], given: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Values by present names without removed parameters, and a warning for each of them."""
    values, warnings = dict(given), []
    if "failsafes" in table and (single := sorted(name for name in given if name.startswith("failsafe."))):
        responses = [f"{name.partition('.')[2]}:{values.pop(name)}" for name in single]
        values["failsafes"] = [*responses, *(given.get("failsafes") or [])]
        warnings.append(f"failsafe.CAUSE is read in this release only: set failsafes: [{', '.join(responses)}]")
    if "field_dir" in table and values.pop("address", ""):  # without it, a proxy's visitors would look local
        raise InputError("the page is not served behind a proxy", "leave address out; use an SSH tunnel or a VPN")
    of_planner = "strategy" in table
    if of_planner and (silent := values.pop("on_silence", None)) is not None:
        remedy = "leave it out"
        if silent not in ("wait", "pause", "abort"):
            raise InputError(f"parameter on_silence must be wait, pause or abort; got {silent!r}", remedy)
        if silent != "wait":
            values["failsafes"] = [f"records_old:{silent}", *(values.get("failsafes") or [])]
            remedy = f"set failsafes: [records_old:{silent}]"
            if values.get("records_old_s") == 0:  # it did not rule the silence at a stop
                values["records_old_s"] = SILENCE_S
                remedy += f" and records_old_s: {SILENCE_S:g}, which is used instead of 0"
        warnings.append(f"on_silence is read in this release only: {remedy}")
    if of_planner and values.get("strategy") == "ivr":
        values["strategy"] = "gcb"
        warnings.append("strategy ivr is gone: gcb, which replaces it, is used; set strategy: gcb")
    for name in sorted(given.keys() & REMOVED.keys() - table.keys()):
        if of_planner or name not in OF_OTHERS:
            del values[name]
            warnings.append(f"parameter {name} is not used any more: {REMOVED[name]}")
    return values, sorted(warnings)


def check_values(
    table: Mapping[str, Parameter], given: Mapping[str, Any], known: Collection[str] = ()
) -> tuple[dict[str, Value], list[Mistake]]:
    """Values of all parameters of a table, given ones instead of defaults, and the mistakes in them."""
    values = {name: row.default for name, row in table.items()}
    mistakes = []
    for name, value in given.items():
        if name in table:
            try:
                values[name] = table[name].checked(value)
            except ValueError as error:
                mistakes.append(Mistake(f"parameter {name} {error}", table[name].description))
        elif name not in known and not name.startswith("qos_overrides."):
            remedy = f"there are: {', '.join(table)}{did_you_mean(name, table)}"
            mistakes.append(Mistake(f"there is no parameter {name!r}", remedy))
    return values, mistakes


# A node's parameters --------------------------------------------------------------------------------------------


def other_namespaces(node: Node, namespaces: Iterable[str]) -> list[str]:
    """Absolute namespaces of other robots, without the namespace of this node."""
    plain = dict.fromkeys(f"/{name.strip('/')}" for name in namespaces)
    if "/" in plain:
        raise InputError("others: a robot has no namespace", "give each robot one of its own, such as /robot_2")
    for name in plain:
        try:
            validate_namespace(name)
        except InvalidNamespaceException as error:
            raise InputError(f"others: {name!r} is not a namespace ({error})", "an example is /robot_2") from None
    return [name for name in plain if name != node.get_namespace()]


def names_for_all(arguments: Sequence[str], node: str) -> set[str]:
    """Names of parameters that parameter files give to all nodes, as under ``/**``, and not to one by its name."""
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
    """True if a name is nearly that of a parameter of this node, and of no other node of the package."""
    if not get_close_matches(name, rows, 1, MISSPELT):
        return False
    table_of = import_module("soilmoist_ros.nodes.parameter_tables").table_of
    return all(name != row.name for node in NODES for row in table_of(node))


def _blocks(content: Any, place: str = "") -> Iterator[tuple[str, list[str]]]:
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


def _given(node: Node, names: Iterable[str]) -> dict[str, Any]:
    """Parameters that the node was started with.

    The public part of rclpy has no list of them. Where its own is gone, these names are asked for; others pass
    unseen, as ROS has it, and an empty list is the default.
    """
    listed = getattr(node, "_parameter_overrides", None)
    if listed is not None:
        return {name: parameter.value for name, parameter in listed.items()}
    found = {}
    for name in names:
        value = node.declare_parameter(name, descriptor=ParameterDescriptor(dynamic_typing=True)).value
        node.undeclare_parameter(name)
        if value is not None:
            found[name] = value
    return found


class Parameters:
    """The checked and declared parameters of a node, read by type, as they were at the start.

    Only live ones can change while the node runs, see :meth:`watch`. Unknown names and invalid values are refused.
    Names under ``/**`` are meant for all nodes of a robot: unknown ones are ignored with a line in the log, unless
    they are misspelt.

    :param arguments: command line with the parameter files; by default that of the process
    """

    def __init__(self, node: Node, table: Sequence[Parameter], arguments: Sequence[str] | None = None) -> None:
        rows = self._rows = {row.name: row for row in table}
        self._node = node
        given, warnings = current_names(rows, _given(node, (*rows, *REMOVED, "on_silence")))
        known = {*rows, *filter(node.has_parameter, given)}
        foreign = [name for name in given if name not in known and not name.startswith("qos_overrides.")]
        if foreign:
            for_all = names_for_all(sys.argv if arguments is None else arguments, node.get_name())
            # Launch files, too, write what they set under /**: a misspelt name is rather one of this node.
            foreign = [name for name in foreign if name in for_all and not _is_misspelt(name, rows)]
        self._values, mistakes = check_values(rows, given, known={*known, *foreign})
        if mistakes:
            raise InputError(mistakes)
        if foreign:
            names = listing(sorted(foreign))
            warnings.append(f"parameters of /** that this node does not have are ignored: {names}")
        for warning in warnings:
            node.get_logger().warning(warning)
        for name, value in self._values.items():
            node.declare_parameter(name, value, rows[name].descriptor(), ignore_override=True)

    def changed(self, values: Mapping[str, Value]) -> Parameters:
        """Copy of these parameters with other values; the parameters that the node shows stay as they are."""
        other = copy(self)
        other._values = {**self._values, **values}
        return other

    def watch(self, change: Callable[[Mapping[str, Value]], str]) -> None:
        """Let live parameters be set from now on; ``change`` returns why values are refused, or an empty text."""

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
        return self._value(name, str)

    def number(self, name: str) -> float:
        """Value of a number parameter."""
        return self._value(name, float)

    def whole(self, name: str) -> int:
        """Value of a whole-number parameter."""
        return self._value(name, int)

    def flag(self, name: str) -> bool:
        """Value of a true-or-false parameter."""
        return self._value(name, bool)

    def texts(self, name: str) -> list[str]:
        """Value of a parameter that is a list of texts."""
        return list(self._value(name, list))

    def _value(self, name: str, kind: type[Some]) -> Some:
        value = self._values[name]
        assert isinstance(value, kind)
        return value

    def as_dict(self) -> dict[str, Value]:
        """All values by name."""
        return dict(self._values)
