# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixes, weather, battery and states of health <-> messages of sensor_msgs and diagnostic_msgs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import BatteryState, FluidPressure, NavSatFix, NavSatStatus, RelativeHumidity, Temperature
from std_msgs.msg import Header

from msg_adapters.point_cloud import to_time
from soilmoist_ros.foundation import Health, Level, foreign_text
from soilmoist_ros.sensing import CovarianceKind, Fix, LoggerRecord

_PA_PER_HPA = 100.0
_PERCENT = 100.0


def fix_to_message(fix: Fix, frame_id: str) -> NavSatFix:
    """Message of a fix. Without a fix, the place is NaN and the covariance unknown.

    The altitude is above the ellipsoid, NaN if the receiver does not send the geoid separation.
    """
    message = NavSatFix(
        header=Header(stamp=to_time(fix.stamp_s), frame_id=frame_id),
        status=NavSatStatus(status=int(fix.status), service=NavSatStatus.SERVICE_GPS),
        latitude=float(fix.position.latitude_deg),
        longitude=float(fix.position.longitude_deg),
        altitude=float(fix.position.altitude_m + fix.geoid_separation_m),
    )
    if fix.covariance_kind is not CovarianceKind.UNKNOWN:
        message.position_covariance = [float(value) for row in fix.covariance_m2 for value in row]
        message.position_covariance_type = int(fix.covariance_kind)
    return message


def weather_to_messages(record: LoggerRecord, frame_id: str) -> dict[str, Any]:
    """Messages of the weather in a record, by the names of their topics.

    Their variances are zero, which means unknown.
    """
    header = Header(stamp=to_time(record.stamp_s), frame_id=frame_id)
    kinds = {
        "pressure": (FluidPressure, "fluid_pressure", record.pressure_hpa * _PA_PER_HPA),
        "temperature": (Temperature, "temperature", record.temperature_degc),
        "relative_humidity": (RelativeHumidity, "relative_humidity", record.relative_humidity),
    }
    return {
        topic: kind(header=header, **{name: float(value)})
        for topic, (kind, name, value) in kinds.items()
        if math.isfinite(value)
    }


# State of the battery, of sensor_msgs/BatteryState --------------------------------------------------------------


def battery_from_message(message: BatteryState) -> tuple[float, float] | None:
    """Charge [0..1] and voltage [V] of a message, NaN if unknown; ``None`` without a battery.

    Percent are accepted as well. A charge and a voltage of zero together mean that neither is known.
    """
    charge, voltage_v = float(message.percentage), float(message.voltage)
    if not message.present or (charge == 0 and not voltage_v > 0):
        return None
    charge = charge if 0 <= charge <= _PERCENT else math.nan
    voltage_v = voltage_v if voltage_v > 0 else math.nan
    return (charge / _PERCENT if charge > 1 else charge), voltage_v


# States of health <-> diagnostic_msgs ---------------------------------------------------------------------------


def diagnostics_to_message(
    parts: Iterable[Health], stamp_s: float, node: str, hardware_id: str = ""
) -> DiagnosticArray:
    """Message for ``/diagnostics``; ``hardware_id`` is the serial number of the device."""
    message = DiagnosticArray()
    message.header.stamp = to_time(stamp_s)
    message.status = [health_to_status(part, node, hardware_id) for part in parts]
    return message


def diagnostics_from_message(message: DiagnosticArray) -> list[Health]:
    """States of health of a message, with their full names."""
    return [health_from_status(status) for status in message.status]


def health_to_status(health: Health, node: str = "", hardware_id: str = "") -> DiagnosticStatus:
    """One state of health as a message; the name of the node, if given, stands before the name of the part."""
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
