# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a node's parameter table, and the check of values against the table."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from soilmoist_ros.foundation import Mistake, did_you_mean
from soilmoist_ros.simulation import PRESETS, SETTINGS

Value = bool | int | float | str | list[str]

_HIGHEST = 1e300
_MAX_WHOLE = 2**62
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", list: "a list of texts"}


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A row of a node's parameter table.

    :param name: name; dots separate groups
    :param default: default; its type is the parameter's type
    :param description: what the parameter sets, without the unit
    :param unit: unit, empty without one
    :param low: smallest value allowed
    :param high: largest value allowed
    :param choices: texts allowed, any if empty
    :param old_names: earlier names, accepted for one release with a warning
    :param live: whether ``ros2 param set`` may change it while the node runs
    """

    name: str
    default: Value
    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    old_names: tuple[str, ...] = ()
    live: bool = False

    @property
    def kind(self) -> str:
        """Name of the ROS type."""
        names = {bool: "bool", int: "integer", float: "double", str: "string", list: "string_array"}
        return names[type(self.default)]

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
        """The value, converted to the parameter's type.

        :raises ValueError: if the type or the value is not allowed; the message names what is allowed
        """
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


def of_setting(name: str, **changes: Any) -> Parameter:
    """Row of a setting that nodes share with simulated missions.

    :param name: name of the setting, see :data:`SETTINGS`
    :param changes: fields of the row that differ on a robot
    """
    setting = SETTINGS[name]
    about: dict[str, Any] = {
        "default": PRESETS["recommended"].get(name, setting.default),
        "description": (setting.help[:1].lower() + setting.help[1:]).rstrip("."),
        "unit": setting.unit,
        "low": setting.low,
        "choices": tuple(setting.registered()) if setting.registered else setting.choices,
    }
    return Parameter(name=name, **(about | changes))


def current_names(
    table: Mapping[str, Parameter], given: Mapping[str, Any]
) -> tuple[dict[str, Any], list[str], list[Mistake]]:
    """Rename values from old to current parameter names.

    A text becomes the only item of a parameter that is now a list.

    :param table: rows by name
    :param given: values by current or old names
    :returns: the values, a warning for each old name, and a mistake for each parameter that is set twice
    """
    names = {old: row.name for row in table.values() for old in row.old_names}
    warnings, mistakes = [], []
    values = {name: value for name, value in given.items() if name not in names}
    for old in given.keys() & names.keys():
        new = names[old]
        if new in given:
            mistakes.append(
                Mistake(f"parameter {old} is the old name of {new}, and both are given", f"leave out {old}")
            )
            continue
        listed = isinstance(table[new].default, list) and isinstance(given[old], str)
        values[new] = [given[old]] * bool(given[old]) if listed else given[old]
        warnings.append(f"parameter {old} is called {new} now; the old name is read in this release only")
    return values, sorted(warnings), mistakes


def check_values(
    table: Mapping[str, Parameter], given: Mapping[str, Any], known: Collection[str] = ()
) -> tuple[dict[str, Value], list[Mistake]]:
    """Values of all parameters of a table; a given value replaces the default.

    :param table: rows by name
    :param given: values by current names, from the command line and from files
    :param known: names of parameters that the node has in addition to the table
    :returns: the values, and the mistakes in the given values
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
            remedy = f"there are: {', '.join(table)}{did_you_mean(name, table)}"
            mistakes.append(Mistake(f"there is no parameter {name!r}", remedy))
    return values, mistakes


EARLIER: Final = Parameter(
    name="earlier",
    default=[],
    description="earlier runs of the field whose counts inform map and plan: output folders, recordings, or "
    "folders of such; mapper and planner need the same ones",
    live=True,
)
COVARIATES: Final = Parameter(
    name="covariates",
    default=[],
    description="files that may explain the map, as FILE or FILE:BAND, in addition to those of the field file: "
    "rasters, what is derived from elevations, polygons; mapper and planner need the same ones",
    live=True,
)
