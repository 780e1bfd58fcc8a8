# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""States of health <-> diagnostic_msgs."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters.stamps import to_time
from soilmoist_ros.foundation import Health, Level, foreign_text


def diagnostics_to_message(
    parts: Iterable[Health], stamp_s: float, node: str, hardware_id: str = ""
) -> DiagnosticArray:
    """Message for ``/diagnostics``.

    :param parts: states of health
    :param stamp_s: now, ROS time [s]
    :param node: name of the node; viewers show ``node: part``
    :param hardware_id: serial number of the device, empty if there is none
    """
    message = DiagnosticArray()
    message.header.stamp = to_time(stamp_s)
    message.status = [health_to_status(part, node, hardware_id) for part in parts]
    return message


def diagnostics_from_message(message: DiagnosticArray) -> list[Health]:
    """States of health of a message, with their full names."""
    return [health_from_status(status) for status in message.status]


def health_to_status(health: Health, node: str = "", hardware_id: str = "") -> DiagnosticStatus:
    """One state of health as a message.

    :param health: the state
    :param node: name of the node, put before the name of the part unless empty
    :param hardware_id: serial number of the device, empty if there is none
    """
    return DiagnosticStatus(
        level=bytes([int(health.level)]),
        name=f"{node}: {health.name}" if node else str(health.name),
        message=str(health.message),
        hardware_id=str(hardware_id),
        values=[KeyValue(key=str(key), value=str(value)) for key, value in health.values.items()],
    )


def health_from_status(status: DiagnosticStatus) -> Health:
    """State of health of a message; an unknown level becomes an error."""
    number = status.level[0] if isinstance(status.level, bytes) and status.level else int(Level.ERROR)
    level = Level(number) if number in list(Level) else Level.ERROR
    values = {foreign_text(pair.key): foreign_text(pair.value) for pair in status.values}
    return Health(foreign_text(status.name), level, foreign_text(status.message), values)
