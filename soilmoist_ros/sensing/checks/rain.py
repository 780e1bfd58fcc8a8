# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Signs of rain in the weather that a logger records. They are told, and change no record."""

from __future__ import annotations

import math
from collections import deque

from soilmoist_ros.sensing.records import LoggerRecord

SATURATED = 0.95
"""Mean relative humidity of :data:`HUMID_S` from which the air is nearly saturated [-]."""
HUMID_S = 600.0
"""Time over which the humidity is averaged [s]."""
FALL_HPA = 2.0
"""Fall of the pressure within :data:`FALL_S` ahead of a front or a thunderstorm [hPa]."""
FALL_S = 3600.0
"""Time over which the pressure is compared [s]."""
MOIST = 0.85
"""Relative humidity from which a fall of the pressure is a sign of rain [-]."""


class RainSigns:
    """Humidity and pressure of the last hour."""

    def __init__(self) -> None:
        self._last: deque[tuple[float, float, float]] = deque()  # time, pressure, humidity

    def add(self, record: LoggerRecord) -> None:
        """Add a record, in order of time; missing values are skipped."""
        self._last.append((record.stamp_s, record.pressure_hpa, record.relative_humidity))
        while record.stamp_s - self._last[0][0] > FALL_S:
            self._last.popleft()

    @property
    def text(self) -> str:
        """Why rain is possible; empty if the weather does not say so."""
        if not self._last:
            return ""
        now_s = self._last[-1][0]
        recent = [one[2] for one in self._last if now_s - one[0] <= HUMID_S and math.isfinite(one[2])]
        humidity = sum(recent) / len(recent) if recent else math.nan
        if humidity >= SATURATED:
            return f"rain or fog is possible: the relative humidity is {100 * humidity:.0f} %"
        pressures = [one[1] for one in self._last if math.isfinite(one[1])]
        fall_hpa = pressures[0] - pressures[-1] if pressures else 0.0
        if fall_hpa >= FALL_HPA and humidity >= MOIST:
            return (
                f"rain is possible: the pressure fell by {fall_hpa:.1f} hPa within an hour, and the relative "
                f"humidity is {100 * humidity:.0f} %"
            )
        return ""
