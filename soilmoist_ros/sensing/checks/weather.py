# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weather that the air cannot have, pressures that jump, and a pressure sensor that never changes."""

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
TEMPERATURES_DEGC = (-70.0, 60.0)
"""Lowest and highest temperatures of the air near inhabited ground, and some margin [degC]."""
HUMIDITIES = (0.0, 1.05)  # range of relative humidities; sensors read up to 5 % too high in fog [-]

JUMP_HPA = 15.0  # change of pressure at once that no front or thunderstorm causes [hPa]
WEATHER_HPA_PER_S = 10.0 / 3600  # highest change of pressure by weather over longer times [hPa/s]
HPA_PER_M = 0.13  # highest change of pressure with altitude [hPa/m]
CLIMB_HPA_PER_S = 0.4  # highest change of pressure of a vehicle on a road: 28 m/s on a slope of 12 % [hPa/s]
JUMPS_TO_BELIEVE = 5, 100
"""Number of successive jumps from which the new pressure counts as true: as many as the good values before, within
these limits."""
FROZEN_HOURS_PER_HPA = 30.0
"""Hours for which a pressure stays the same by chance, for each hPa of the sensor's resolution."""
FROZEN_S = (3600.0, 43200.0)  # shortest and longest time from which a pressure can count as frozen [s]
FROZEN_KELVIN = 3.0  # change of temperature while the pressure stays the same [K]
FROZEN_RECORDS = 10
_REMEDY = "check the sensor; without a value the nearest records give it"
MAX_FRACTION = 0.0101
"""Relative humidity that no air near the ground stays below; fractions that were read as per cent do [-]."""
MIN_MEDIAN_HUMIDITY = 0.2
"""Median relative humidity that the air of hardly any survey has; dry housings have it [-]."""
MAX_MEDIAN_DEGC = 42.0  # median temperature that no survey exceeds; temperatures in Fahrenheit do [degC]


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
    found = []
    humidity = [record.relative_humidity for record in records if math.isfinite(record.relative_humidity)]
    if len(humidity) >= FROZEN_RECORDS and 0 < max(humidity) <= MAX_FRACTION:
        message = f"the relative humidity is {100 * min(humidity):.2f} to {100 * max(humidity):.2f} %"
        remedy = "if it is a fraction, write 'unit: fraction' into the logger format"
        found.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, remedy))
    if len(humidity) >= FROZEN_RECORDS and MAX_FRACTION < statistics.median(humidity) < MIN_MEDIAN_HUMIDITY:
        message = (
            f"the relative humidity is {100 * statistics.median(humidity):.0f} % in the middle of the records"
        )
        remedy = "if it is absolute humidity [g/m3], or of the air in a housing, leave its column out"
        found.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, remedy))
    warmth = [record.temperature_degc for record in records if math.isfinite(record.temperature_degc)]
    if len(warmth) >= FROZEN_RECORDS and statistics.median(warmth) > MAX_MEDIAN_DEGC:
        message = f"the air temperature is {statistics.median(warmth):.0f} degC in the middle of the records"
        remedy = "if it is in Fahrenheit, write 'unit: degF' into the logger format"
        found.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, remedy))
    return found


class WeatherChecks:
    """Checks the weather of one probe, record by record."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float] | None = None  # time, pressure and altitude
        self._jumps = self._believed = 0
        self._frozen = _FrozenPressure()

    def check(self, record: LoggerRecord, altitude_m: float = NAN) -> tuple[LoggerRecord, list[Finding]]:
        """The record without impossible values, which become NaN, and its faults."""
        limits: dict[str, tuple[tuple[float, float], str, float, Quantity]] = {
            "pressure_hpa": (pressure_limits_hpa(altitude_m), "hPa", 1.0, "pressure"),
            "temperature_degc": (TEMPERATURES_DEGC, "degC", 1.0, "temperature"),
            "relative_humidity": (HUMIDITIES, "%", 100.0, "humidity"),
        }
        kept: dict[str, float] = {}
        findings: list[Finding] = []
        for name, ((low, high), unit, scale, quantity) in limits.items():
            value = float(getattr(record, name))
            kept[name] = value
            if not (math.isnan(value) or low <= value <= high):
                what = name.rsplit("_", 1)[0] if unit != "%" else "relative humidity"
                span = f"{low * scale:.0f}..{high * scale:.0f} {unit}"
                message = f"the {what} {value * scale:.1f} {unit} is impossible here ({span})"
                remedy = remedy_of_unit(quantity, value, low, high, _REMEDY)
                findings.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, remedy))
                kept[name] = NAN
        jump_hpa = self._jump_hpa(record.stamp_s, kept["pressure_hpa"], altitude_m)
        if jump_hpa:
            message = f"the pressure {kept['pressure_hpa']:.1f} hPa is a jump of {jump_hpa:+.1f} hPa"
            findings.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, _REMEDY))
            kept["pressure_hpa"] = NAN
        if any(math.isnan(value) and not math.isnan(getattr(record, name)) for name, value in kept.items()):
            record = replace(
                record,
                pressure_hpa=kept["pressure_hpa"],
                temperature_degc=kept["temperature_degc"],
                relative_humidity=kept["relative_humidity"],
            )
        hours = self._frozen.add(record)
        if hours:
            message = (
                f"the pressure has been {record.pressure_hpa:g} hPa for {hours:.1f} h while temperatures changed"
            )
            remedy = "check the barometer; a constant pressure biases the counts by 0.8 % for each hPa"
            findings.append(Finding(Kind.FROZEN_PRESSURE, message, remedy))
        return record, findings

    def _jump_hpa(self, stamp_s: float, pressure_hpa: float, altitude_m: float) -> float:
        """Change since the last believed pressure if it is impossible, else 0 [hPa]."""
        if math.isnan(pressure_hpa):
            return 0.0
        if self._last is not None:
            since_s, change_hpa = abs(stamp_s - self._last[0]), pressure_hpa - self._last[1]
            climbed_hpa = HPA_PER_M * abs(altitude_m - self._last[2])
            if math.isnan(climbed_hpa):  # unknown altitude
                climbed_hpa = CLIMB_HPA_PER_S * since_s
            least, most = JUMPS_TO_BELIEVE
            if abs(change_hpa) > JUMP_HPA + WEATHER_HPA_PER_S * since_s + climbed_hpa:
                if self._jumps < min(max(self._believed, least), most):
                    self._jumps += 1
                    return change_hpa
                self._believed = 0
        self._last, self._jumps = (stamp_s, pressure_hpa, altitude_m), 0
        self._believed += 1
        return 0.0


class _FrozenPressure:
    """Time for which the pressure has had one value while the temperature changed."""

    def __init__(self) -> None:
        self._value, self._begin_s, self._records = NAN, NAN, 0
        self._coldest, self._warmest = math.inf, -math.inf
        self._step_hpa = math.inf

    def add(self, record: LoggerRecord) -> float:
        """Continue with a record; returns the hours for which the pressure has been frozen, 0 if it is not."""
        value, temperature = record.pressure_hpa, record.temperature_degc
        if math.isnan(value):
            return 0.0
        if value != self._value:
            if not math.isnan(self._value):
                self._step_hpa = min(self._step_hpa, abs(value - self._value))
            self._value, self._begin_s, self._records = value, record.stamp_s, 0
            self._coldest, self._warmest = math.inf, -math.inf
        self._records += 1
        if not math.isnan(temperature):
            self._coldest, self._warmest = min(self._coldest, temperature), max(self._warmest, temperature)
        # Without a change so far, the digits show the resolution.
        step_hpa = self._step_hpa if math.isfinite(self._step_hpa) else 10.0 ** -_digits(value)
        min_s = min(max(FROZEN_HOURS_PER_HPA * 3600 * step_hpa, FROZEN_S[0]), FROZEN_S[1])
        spent_s = record.stamp_s - self._begin_s
        changed = self._warmest - self._coldest >= FROZEN_KELVIN
        frozen = spent_s >= min_s and changed and self._records >= FROZEN_RECORDS
        return spent_s / 3600 if frozen else 0.0


def _digits(value: float) -> int:
    """Number of decimals of a value, at most 2."""
    return next((digits for digits in (0, 1) if abs(value - round(value, digits)) < 1e-9), 2)
