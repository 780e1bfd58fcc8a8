"""How well a part of the system works, for diagnostics: said by the core, shown by ROS tools."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


class Level(enum.IntEnum):
    """Severity; the numbers are those of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    """Works, but somebody should look at it."""
    ERROR = 2
    """Does not do what it is there for."""
    STALE = 3
    """Nothing is known, or no longer."""


@dataclass(frozen=True)
class Health:
    """State of one part.

    :param name: the part, such as ``logger link``
    :param level: how well it works
    :param message: one line for the operator; says what to do if something is to be done
    :param values: details by name, with units in the names
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def worst(parts: Iterable[Health]) -> Level:
    """The most severe level of several parts, OK without any."""
    return max((part.level for part in parts), default=Level.OK)
