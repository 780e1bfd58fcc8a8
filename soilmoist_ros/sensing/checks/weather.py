# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weather that the air cannot have, pressures that jump, and units that a whole log makes doubtful."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

from soilmoist_ros.sensing.corrections.factors import SEA_LEVEL_HPA as STANDARD_HPA
from soilmoist_ros.sensing.corrections.factors import standard_pressure_hpa
from soilmoist_ros.sensing.formats.log_values import Quantity, remedy_of_unit
from soilmoist_ros.sensing.problems import Finding, Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord

SEA_LEVEL_HPA = (870.0, 1085.0)
"""Lowest and highest air pressures ever observed, reduced to sea level [hPa] (World Meteorological Organization,
World Weather and Climate Extremes Archive)."""
ALTITUDES_M = (-430.0, 5500.0)
"""Range of altitudes if that of the site is unknown: shore of the Dead Sea to the highest fields [m]."""
ALTITUDE_TOLERANCE_M = 100.0  # altitudes of receivers and site files may be wrong by this much [m]
AIR: dict[str, tuple[float, float, str, float, Quantity]] = {
    "temperature_degc": (-70.0, 60.0, "degC", 1.0, "temperature"),
    "relative_humidity": (0.0, 1.05, "%", 100.0, "humidity"),  # sensors read up to 5 % too high in fog
}
"""Lowest and highest values near inhabited ground, with some margin; unit and scale in messages, and quantity."""
JUMP_HPA = 15.0  # change of pressure at once that no front or thunderstorm causes [hPa]
WEATHER_HPA_PER_S = 10.0 / 3600  # highest change of pressure by weather over longer times [hPa/s]
HPA_PER_M = 0.13  # highest change of pressure with altitude [hPa/m]
CLIMB_HPA_PER_S = 0.4  # highest change of pressure of a vehicle on a road: 28 m/s on a slope of 12 % [hPa/s]
JUMPS_TO_BELIEVE = 5, 100
"""Number of successive jumps from which the new pressure counts as true: as many as the good values before, within
these limits."""
MIN_RECORDS = 10  # number of records from which the units of a log can be doubted
MAX_FRACTION = 0.0101  # humidity that no air stays below; fractions that were read as per cent do [-]
MIN_MEDIAN_HUMIDITY = 0.2  # median humidity that hardly any survey has; dry housings have it [-]
MAX_MEDIAN_DEGC = 42.0  # median temperature that no survey exceeds; temperatures in Fahrenheit do [degC]
_REMEDY = "check the sensor; without a value the nearest records give it"


def pressure_limits_hpa(altitude_m: float) -> tuple[float, float]:
    """Lowest and highest possible air pressure [hPa]."""
    low_m, high_m = ALTITUDES_M
    if math.isfinite(altitude_m):
        low_m, high_m = altitude_m - ALTITUDE_TOLERANCE_M, altitude_m + ALTITUDE_TOLERANCE_M
    low, high = SEA_LEVEL_HPA
    lowest, highest = (standard_pressure_hpa(45.0, min(max(each, -500.0), 9000.0)) for each in (high_m, low_m))
    return low / STANDARD_HPA * lowest, high / STANDARD_HPA * highest


def unlikely_weather(records: Sequence[LoggerRecord]) -> list[Finding]:
    """Doubts about the units of a whole log, whose values are possible one by one."""
    humidity = [record.relative_humidity for record in records if math.isfinite(record.relative_humidity)]
    warmth = [record.temperature_degc for record in records if math.isfinite(record.temperature_degc)]
    found = []
    if len(humidity) >= MIN_RECORDS:
        low, middle, high = min(humidity), statistics.median(humidity), max(humidity)
        if 0 < high <= MAX_FRACTION:
            remedy = "if it is a fraction, write 'unit: fraction' into the logger format"
            found.append((f"the relative humidity is {100 * low:.2f} to {100 * high:.2f} %", remedy))
        elif MAX_FRACTION < middle < MIN_MEDIAN_HUMIDITY:
            remedy = "if it is absolute humidity [g/m3], or of the air in a housing, leave its column out"
            found.append((f"the relative humidity is {100 * middle:.0f} % in the middle of the records", remedy))
    if len(warmth) >= MIN_RECORDS and statistics.median(warmth) > MAX_MEDIAN_DEGC:
        message = f"the air temperature is {statistics.median(warmth):.0f} degC in the middle of the records"
        found.append((message, "if it is in Fahrenheit, write 'unit: degF' into the logger format"))
    return [Finding(Kind.IMPOSSIBLE_WEATHER, *each) for each in found]


class WeatherChecks:
    """Checks the weather of one probe, record by record."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float] | None = None  # time, pressure and altitude
        self._jumps = self._believed = 0

    def check(self, record: LoggerRecord, altitude_m: float = NAN) -> tuple[LoggerRecord, list[Finding]]:
        """The record without impossible values, which become NaN, and its faults."""
        wrong: dict[str, tuple[str, str]] = {}
        limits = AIR | {"pressure_hpa": (*pressure_limits_hpa(altitude_m), "hPa", 1.0, "pressure")}
        for name, (low, high, unit, scale, quantity) in limits.items():
            value = float(getattr(record, name))
            if not (math.isnan(value) or low <= value <= high):
                what = name.removesuffix("_hpa").removesuffix("_degc").replace("_", " ")
                span = f"{low * scale:.0f}..{high * scale:.0f} {unit}"
                message = f"the {what} {value * scale:.1f} {unit} is impossible here ({span})"
                wrong[name] = message, remedy_of_unit(quantity, value, low, high, _REMEDY)
        if "pressure_hpa" not in wrong and (jump_hpa := self._jump_hpa(record, altitude_m)):
            wrong["pressure_hpa"] = (
                f"the pressure {record.pressure_hpa:.1f} hPa is a jump of {jump_hpa:+.1f} hPa",
                _REMEDY,
            )
        if wrong:
            record = replace(record, **dict.fromkeys(wrong, NAN))  # type: ignore[arg-type]
        return record, [Finding(Kind.IMPOSSIBLE_WEATHER, *each) for each in wrong.values()]

    def _jump_hpa(self, record: LoggerRecord, altitude_m: float) -> float:
        """Change since the last believed pressure if it is impossible, else 0 [hPa]."""
        if math.isnan(record.pressure_hpa):
            return 0.0
        if self._last is not None:
            since_s, change_hpa = abs(record.stamp_s - self._last[0]), record.pressure_hpa - self._last[1]
            climbed_hpa = HPA_PER_M * abs(altitude_m - self._last[2])
            if math.isnan(climbed_hpa):  # unknown altitude
                climbed_hpa = CLIMB_HPA_PER_S * since_s
            least, most = JUMPS_TO_BELIEVE
            if abs(change_hpa) > JUMP_HPA + WEATHER_HPA_PER_S * since_s + climbed_hpa:
                if self._jumps < min(max(self._believed, least), most):
                    self._jumps += 1
                    return change_hpa
                self._believed = 0
        self._last, self._jumps = (record.stamp_s, record.pressure_hpa, altitude_m), 0
        self._believed += 1
        return 0.0
