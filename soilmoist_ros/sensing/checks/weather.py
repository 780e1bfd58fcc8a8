"""Impossible weather: values that the air cannot have at the altitude of the site."""

from __future__ import annotations

import math
from dataclasses import replace

from soilmoist_ros.sensing.checks.finding import Finding
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord

SEA_LEVEL_HPA = (870.0, 1085.0)
"""Lowest and highest air pressures ever observed, reduced to sea level [hPa] (World Meteorological Organization,
World Weather and Climate Extremes Archive)."""
ALTITUDES_M = (-430.0, 5500.0)
"""Range of altitudes if that of the site is unknown: shore of the Dead Sea to the highest fields [m]."""
ALTITUDE_TOLERANCE_M = 100.0
"""Altitudes of receivers and site files may be wrong by this much [m]."""
TEMPERATURES_DEGC = (-70.0, 60.0)
"""Lowest and highest temperatures of the air near inhabited ground, and some margin [degC]."""
HUMIDITIES = (0.0, 1.05)
"""Range of relative humidities; sensors read up to 5 % too high in fog [-]."""
_REMEDY = "check the sensor; without a value the nearest records give it"


def standard_pressure_hpa(altitude_m: float) -> float:
    """Pressure of the standard atmosphere [hPa] (ICAO 1993, Doc 7488, troposphere).

    :param altitude_m: altitude above mean sea level [m], below 11 km
    """
    return float(1013.25 * (1 - 2.25577e-5 * altitude_m) ** 5.25588)


def pressure_limits_hpa(altitude_m: float) -> tuple[float, float]:
    """Lowest and highest possible air pressure [hPa].

    :param altitude_m: altitude above mean sea level [m], NaN if unknown
    """
    low_m, high_m = ALTITUDES_M
    if math.isfinite(altitude_m):
        low_m, high_m = altitude_m - ALTITUDE_TOLERANCE_M, altitude_m + ALTITUDE_TOLERANCE_M
    low, high = SEA_LEVEL_HPA
    return low / 1013.25 * standard_pressure_hpa(high_m), high / 1013.25 * standard_pressure_hpa(low_m)


def check_weather(record: LoggerRecord, altitude_m: float = NAN) -> tuple[LoggerRecord, list[Finding]]:
    """The record without impossible values, which become NaN, and a finding for each of them.

    :param altitude_m: altitude of the site if the record has none [m], NaN if unknown
    """
    own_m = record.position.altitude_m if record.position is not None else NAN
    limits = {
        "pressure_hpa": (pressure_limits_hpa(own_m if math.isfinite(own_m) else altitude_m), "hPa", 1.0),
        "temperature_degc": (TEMPERATURES_DEGC, "degC", 1.0),
        "relative_humidity": (HUMIDITIES, "%", 100.0),
    }
    findings: list[Finding] = []
    impossible: set[str] = set()
    for name, ((low, high), unit, scale) in limits.items():
        value = getattr(record, name)
        if math.isnan(value) or low <= value <= high:
            continue
        what = name.rsplit("_", 1)[0] if unit != "%" else "relative humidity"
        span = f"{low * scale:.0f}..{high * scale:.0f} {unit}"
        message = f"the {what} {value * scale:.1f} {unit} is impossible here ({span})"
        findings.append(Finding(Kind.IMPOSSIBLE_WEATHER, message, _REMEDY))
        impossible.add(name)
    if not impossible:
        return record, []
    kept = {name: NAN if name in impossible else float(getattr(record, name)) for name in limits}
    return replace(
        record,
        pressure_hpa=kept["pressure_hpa"],
        temperature_degc=kept["temperature_degc"],
        relative_humidity=kept["relative_humidity"],
    ), findings
