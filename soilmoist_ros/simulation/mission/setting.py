# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The declaration of a setting: its type, limits and help, and how a value is checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from soilmoist_ros.foundation import InputError, did_you_mean


@dataclass(frozen=True)
class Setting:
    """The declaration of a setting.

    :param name: name, with the unit where it is not obvious
    :param kind: type of a value; ``tuple`` for a list of properties
    :param default: default; ``None`` if the preset or the field chooses it
    :param help: what it sets, and what happens at its limits
    :param unit: unit for tables and help
    :param low: smallest value
    :param above: whether a value must be greater than ``low``
    :param choices: permitted values; any if empty
    :param registered: function that returns the registered names; called when a value is checked
    :param check: function that returns a value in its plain form, or raises :class:`InputError`
    :param method: in Python, objects with this method are permitted instead of a name; empty for names only
    """

    name: str
    kind: type
    default: Any
    help: str
    unit: str = ""
    low: float | None = None
    above: bool = False
    choices: tuple[str, ...] = ()
    registered: Callable[[], Sequence[str]] | None = None
    check: Callable[[Any], Any] | None = None
    method: str = ""

    @property
    def option(self) -> str:
        """Command-line option: the name without its unit."""
        if self.kind is tuple:
            return "--property"
        stem = next((self.name.removesuffix(end) for end in _UNITS if self.name.endswith(end)), self.name)
        return "--" + stem.replace("_", "-")

    @property
    def limits(self) -> str:
        """Permitted values as text for help; empty if the type is the only limit."""
        if self.choices:
            return "|".join(self.choices)
        if self.low is None:
            return ""
        return f"{'>' if self.above else '>='} {self.low:g}"

    def checked(self, given: Any) -> Any:
        """Check a value and return it in its plain form.

        >>> from soilmoist_ros.simulation.mission.settings import SETTINGS
        >>> SETTINGS["hours"].checked(2)
        2.0
        >>> SETTINGS["dwell"].checked("ami:3%")
        'ami:0.03'
        >>> SETTINGS["robots"].checked(0)
        Traceback (most recent call last):
        ...
        ValueError: must be >= 1, but it is 0

        :raises ValueError: if it is of another type or not permitted
        """
        value: Any = given
        if value is None and self.default is None:
            return None
        if self.method and callable(getattr(value, self.method, None)):
            return value
        if self.kind is float and _is_of(value, int):  # a YAML parser may give an int of its own
            try:
                value = float(value)
            except OverflowError:
                value = math.inf if value > 0 else -math.inf
        if self.kind is not tuple and not _is_of(value, self.kind):
            raise ValueError(f"must be {_KINDS[self.kind]}, but it is {given!r}")
        names = self.choices if self.registered is None else self.registered()
        if names and value not in names:
            raise ValueError(
                f"there is no {self.name} {value!r} -> use one of: {', '.join(names)}{did_you_mean(value, names)}"
            )
        if self.kind is float and not math.isfinite(value):
            raise ValueError(f"must be finite, but it is {value!r}")
        if self.low is not None and not (value > self.low or (value == self.low and not self.above)):
            raise ValueError(f"must be {self.limits}, but it is {value!r}")
        if self.kind is str and not value:
            raise ValueError("must not be empty")
        if self.check is None:
            return value
        try:
            return self.check(value)
        except InputError as error:
            raise ValueError(str(error)) from None

    def parsed(self, text: str) -> Any:
        """Read a value from the text of a command-line option.

        :raises ValueError: if it is not permitted
        """
        if self.kind in (int, float):
            try:
                return self.checked(self.kind(text))
            except ValueError as error:
                if str(error).startswith("must"):
                    raise
                point = f" -> write {text.replace(',', '.')}" if text.replace(",", "", 1).isdecimal() else ""
                raise ValueError(f"must be {_KINDS[self.kind]}, but it is {text!r}{point}") from None
        return self.checked(text)


_UNITS = ("_s_per_rad", "_mps", "_m", "_s")
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}


def _is_of(value: object, kind: type) -> bool:
    """Whether a value has a type; truth values do not count as numbers, texts of an enumeration count as texts."""
    return isinstance(value, kind) and isinstance(value, bool) == (kind is bool)
