# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Health of the parts of the system: reported by the core, shown by the diagnostic tools of ROS."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


class Level(enum.IntEnum):
    """Severity, numbered as in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    """Works, but needs attention."""
    ERROR = 2
    """Does not work."""
    STALE = 3
    """State unknown or out of date."""


@dataclass(frozen=True)
class Health:
    """State of one part.

    :param name: name of the part, such as ``logger link``
    :param level: severity
    :param message: one line for the operator, with the remedy if there is one
    :param values: details by name, with units in the names
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def worst(parts: Iterable[Health]) -> Level:
    """The most severe level of several parts; OK without parts."""
    return max((part.level for part in parts), default=Level.OK)
