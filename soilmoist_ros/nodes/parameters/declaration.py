"""Parameters of a node: one table says all about them, and nothing else is accepted."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.validate_namespace import validate_namespace

from soilmoist_ros.foundation.errors import InputError, Mistake

Value = bool | int | float | str | list[str]

_HIGHEST = 1e300
_MAX_WHOLE = 2**62
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", list: "a list of texts"}


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A row of a node's parameter table.

    :param name: name; dots group
    :param default: default; its type is the parameter's type
    :param description: what it is, without its unit
    :param unit: unit, empty without one
    :param low: smallest value allowed
    :param high: largest value allowed
    :param choices: texts allowed, any if empty
    :param changeable: whether it may be changed while the node runs
    """

    name: str
    default: Value
    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    changeable: bool = False

    @property
    def kind(self) -> str:
        """Name of the type, as ROS has it."""
        names = {bool: "bool", int: "integer", float: "double", str: "string", list: "string_array"}
        return names[type(self.default)]

    @property
    def limits(self) -> str:
        """Values allowed, for tables and messages; empty if all of the type are."""
        if self.choices:
            return " | ".join(self.choices)
        if self.low is not None and self.high is not None:
            return f"{self.low:g} .. {self.high:g}"
        if self.low is not None:
            return f">= {self.low:g}"
        return f"<= {self.high:g}" if self.high is not None else ""

    def checked(self, value: Any) -> Value:
        """The value in the parameter's own type.

        :raises ValueError: if it is of another type or not allowed; says what is
        """
        wanted: Any = type(self.default)
        if wanted is float and type(value) is int:
            value = float(value)
        if wanted is list and isinstance(value, Iterable) and not isinstance(value, str | bytes):
            value = list(value)
        if type(value) is not wanted or (wanted is list and not all(isinstance(item, str) for item in value)):
            raise ValueError(f"must be {_KINDS[wanted]}, got {value!r}")
        if wanted is float and not math.isfinite(value):
            raise ValueError(f"must be finite, got {value!r}")
        if self.choices and value not in self.choices:
            raise ValueError(
                f"must be one of: {', '.join(self.choices)}; got {value!r}{_near(value, self.choices)}"
            )
        outside = isinstance(value, int | float) and (
            (self.low is not None and value < self.low) or (self.high is not None and value > self.high)
        )
        if outside:
            unit = f" {self.unit}" if self.unit else ""
            raise ValueError(f"must be {self.limits}{unit}, got {value:g}")
        checked: Value = value
        return checked

    def descriptor(self) -> ParameterDescriptor:
        """What tools such as ``ros2 param describe`` show."""
        unit = f" [{self.unit}]" if self.unit else ""
        descriptor = ParameterDescriptor(
            name=self.name, description=f"{self.description}{unit}", read_only=not self.changeable
        )
        if self.choices:
            descriptor.additional_constraints = f"one of: {', '.join(self.choices)}"
        limited = self.low is not None or self.high is not None
        if limited and isinstance(self.default, float):
            low = -_HIGHEST if self.low is None else float(self.low)
            high = _HIGHEST if self.high is None else float(self.high)
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
        elif limited and isinstance(self.default, int):
            low_whole = -_MAX_WHOLE if self.low is None else int(self.low)
            high_whole = _MAX_WHOLE if self.high is None else int(self.high)
            descriptor.integer_range = [IntegerRange(from_value=low_whole, to_value=high_whole, step=1)]
        return descriptor


def other_namespaces(node: Node, namespaces: Iterable[str]) -> list[str]:
    """Namespaces of other robots, written as ROS does; the node's own, which may be among them, is left out.

    :raises InputError: if one is not a namespace
    """
    plain = dict.fromkeys(f"/{name.strip('/')}" for name in namespaces)
    for name in plain:
        try:
            validate_namespace(name)
        except InvalidNamespaceException as error:
            raise InputError(f"others: {name!r} is not a namespace ({error})", "give such as /robot_2") from None
    return [name for name in plain if name != node.get_namespace()]


class Parameters:
    """The parameters of a node: declared, checked, and read by type.

    :param node: the node; nothing of the table may be declared yet
    :param table: its parameters
    :raises InputError: with every name that does not exist and every value that is not allowed
    """

    def __init__(self, node: Node, table: Sequence[Parameter]) -> None:
        self._node = node
        self._table = {row.name: row for row in table}
        self._callbacks: list[Callable[[frozenset[str]], None]] = []
        given = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
        values, mistakes = check_values(self._table, given, known=tuple(node._parameters))
        if mistakes:
            raise InputError(mistakes)
        for name, value in values.items():
            node.declare_parameter(name, value, self._table[name].descriptor(), ignore_override=True)
        node.add_on_set_parameters_callback(self._refuse_bad)
        node.add_post_set_parameters_callback(self._tell)

    def text(self, name: str) -> str:
        """Value of a text parameter."""
        value = self._node.get_parameter(name).value
        assert isinstance(value, str)
        return value

    def number(self, name: str) -> float:
        """Value of a number parameter."""
        value = self._node.get_parameter(name).value
        assert isinstance(value, float)
        return value

    def whole(self, name: str) -> int:
        """Value of a whole-number parameter."""
        value = self._node.get_parameter(name).value
        assert isinstance(value, int)
        return value

    def flag(self, name: str) -> bool:
        """Value of a true-or-false parameter."""
        value = self._node.get_parameter(name).value
        assert isinstance(value, bool)
        return value

    def texts(self, name: str) -> list[str]:
        """Value of a parameter that is a list of texts."""
        return [str(value) for value in self._node.get_parameter(name).value]

    def as_dict(self) -> dict[str, Value]:
        """All values by name."""
        return {name: self._node.get_parameter(name).value for name in self._table}

    def on_change(self, callback: Callable[[frozenset[str]], None]) -> None:
        """Call back with the names of parameters that have been changed."""
        self._callbacks.append(callback)

    def _refuse_bad(self, parameters: list[RosParameter]) -> SetParametersResult:
        for parameter in parameters:
            row = self._table.get(parameter.name)
            try:
                if row is not None:
                    row.checked(parameter.value)
            except ValueError as error:
                return SetParametersResult(successful=False, reason=f"{parameter.name} {error}")
        return SetParametersResult(successful=True)

    def _tell(self, parameters: list[RosParameter]) -> None:
        changed = frozenset(parameter.name for parameter in parameters) & self._table.keys()
        for callback in self._callbacks if changed else ():
            callback(frozenset(changed))


def check_values(
    table: Mapping[str, Parameter], given: Mapping[str, Any], known: Sequence[str] = ()
) -> tuple[dict[str, Value], list[Mistake]]:
    """Values of all parameters of a table, the given ones instead of the defaults.

    :param table: rows by name
    :param given: values from the command line and from files
    :param known: names of further parameters that the node has anyway
    :returns: the values, and what is wrong with the given ones
    """
    values = {name: row.default for name, row in table.items()}
    mistakes = []
    for name, value in given.items():
        if name in table:
            try:
                values[name] = table[name].checked(value)
            except ValueError as error:
                mistakes.append(Mistake(f"parameter {name} {error}", table[name].description))
        elif name not in known and not name.startswith("qos_overrides."):
            remedy = f"there are: {', '.join(table)}{_near(name, table)}"
            mistakes.append(Mistake(f"there is no parameter {name!r}", remedy))
    return values, mistakes


def _near(name: object, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(str(name), list(known), 1)
    return f" (did you mean {close[0]!r}?)" if close else ""
