# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixes to NavSatFix, and weather <-> FluidPressure, Temperature and RelativeHumidity of sensor_msgs."""

from __future__ import annotations

import math

from sensor_msgs.msg import FluidPressure, NavSatFix, NavSatStatus, RelativeHumidity, Temperature
from std_msgs.msg import Header

from msg_adapters.stamps import to_time
from soilmoist_ros.sensing import CovarianceKind, Fix, LoggerRecord

_PA_PER_HPA = 100.0


def fix_to_message(fix: Fix, frame_id: str) -> NavSatFix:
    """Message of a fix. Without a fix, the place is NaN and the covariance unknown.

    The altitude is above the ellipsoid, NaN if the receiver does not send the geoid separation.

    :param fix: the fix
    :param frame_id: frame of the antenna
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


def weather_to_messages(
    record: LoggerRecord, frame_id: str
) -> dict[str, FluidPressure | Temperature | RelativeHumidity]:
    """Messages of the weather in a record, by the names of their topics.

    Their variances are zero, which means unknown.

    :param record: record with the weather
    :param frame_id: frame of the sensors
    """
    header = Header(stamp=to_time(record.stamp_s), frame_id=frame_id)
    pressure_pa = float(record.pressure_hpa * _PA_PER_HPA)
    temperature_degc, humidity = float(record.temperature_degc), float(record.relative_humidity)
    messages: dict[str, FluidPressure | Temperature | RelativeHumidity] = {}
    if math.isfinite(pressure_pa):
        messages["pressure"] = FluidPressure(header=header, fluid_pressure=pressure_pa)
    if math.isfinite(temperature_degc):
        messages["temperature"] = Temperature(header=header, temperature=temperature_degc)
    if math.isfinite(humidity):
        messages["relative_humidity"] = RelativeHumidity(header=header, relative_humidity=humidity)
    return messages


def weather_from_message(message: FluidPressure | Temperature | RelativeHumidity) -> float:
    """Value of a weather message in the units of this package: hPa, degC or 0..1."""
    if isinstance(message, FluidPressure):
        return float(message.fluid_pressure) / _PA_PER_HPA
    return float(message.temperature if isinstance(message, Temperature) else message.relative_humidity)
