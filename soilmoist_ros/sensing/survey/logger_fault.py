# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a driver reports about its logger, for nodes that need no survey."""

from __future__ import annotations

from collections.abc import Iterable

from soilmoist_ros.foundation import Health, Level


def logger_fault(parts: Iterable[Health], namespace: str) -> str | None:
    """What a driver reports about its logger, as one line; empty if nothing is wrong.

    :param parts: states of health with the full names of their nodes
    :param namespace: namespace of the driver
    :returns: ``None`` if no part is of a driver in this namespace
    """
    wanted = [
        part
        for part in parts
        if part.name.endswith((": records", ": logger link"))
        and (part.name.rpartition(": ")[0].rpartition("/")[0] or "/") == namespace
    ]
    if not wanted:
        return None
    worst_part = max(wanted, key=lambda part: (part.level is Level.ERROR, part.level))
    return worst_part.message if worst_part.level is not Level.OK else ""
