# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The weather of a simulated day and its effect on the counts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from soilmoist_ros.sensing import Corrections


@dataclass(frozen=True, slots=True)
class Weather:
    """Weather as a logger records it.

    :param pressure_hpa: air pressure [hPa]
    :param temperature_degc: air temperature [degC]
    :param relative_humidity: relative humidity [0..1]
    """

    pressure_hpa: float
    temperature_degc: float
    relative_humidity: float

    def factors(self, corrections: Corrections) -> tuple[float, float]:
        """Correction factors for pressure and humidity [-]."""
        return (
            corrections.f_pressure(self.pressure_hpa),
            corrections.f_humidity(self.temperature_degc, self.relative_humidity),
        )


def warming_morning(elapsed_s: float) -> Weather:
    """Weather of a warming, drying morning with slowly varying pressure, rounded as in the log."""
    hours = elapsed_s / 3600
    return Weather(
        pressure_hpa=round(1009.0 + 2.5 * math.sin(0.8 * hours), 1),
        temperature_degc=round(14.0 + 3.0 * min(hours, 5.0), 1),
        relative_humidity=round(0.75 - 0.08 * min(hours, 5.0), 3),
    )


@lru_cache(maxsize=10_000)
def morning_factors(elapsed_s: float) -> tuple[float, float]:
    """Correction factors of :func:`warming_morning` for pressure and humidity by the default corrections [-].

    The cache is effective because the records of all missions of a campaign end at the same times.
    """
    return warming_morning(elapsed_s).factors(Corrections())


def neutral_weather(elapsed_s: float) -> Weather:
    """Constant weather for which the default corrections are 1: reference pressure, dry air."""
    return Weather(pressure_hpa=1013.25, temperature_degc=15.0, relative_humidity=0.0)
