# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The steps from a raw record to a corrected, geo-tagged record; missing weather comes from other records."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.sensing.checks.tubes import combine_tubes
from soilmoist_ros.sensing.corrections.factors import effective_exposure, standard_pressure_hpa
from soilmoist_ros.sensing.corrections.intensity import NeutronMonitor, read_neutron_monitor
from soilmoist_ros.sensing.corrections.settings import CorrectionSettings
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.problems import Kind, LostRecordError
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord, Position

USUAL_FACTORS = {"f_humidity": (0.85, 1.25), "f_intensity": (0.8, 1.25)}
"""Factors within which humid air and the solar cycle stay, for usual references [-]."""
MAX_FROM_ALTITUDE_HPA = 40.0
"""Distance of the mean pressure from that of the altitude beyond which one of them is doubted [hPa]."""
MAX_WEATHER_GAP_S = 1800.0
"""Maximum gap over which missing values are interpolated in time [s]; longer for long records."""
MAX_GAP_RECORDS = 4.0
"""This gap in counting intervals: three records of a logger that writes every hour may lack a value."""
QUANTITIES = ("pressure_hpa", "temperature_degc", "relative_humidity")


class WeatherSeries:
    """The weather of all records of a file, or of the records so far.

    A missing value is interpolated in time. It stays NaN if the gap is longer than :data:`MAX_WEATHER_GAP_S` and
    :data:`MAX_GAP_RECORDS` counting intervals, and the nearest value is further away than half of the longer one.

    :param max_values: minimum number of latest values to keep; all if ``None``
    """

    def __init__(self, max_values: int | None = None) -> None:
        self._max_values = max_values
        self._stamps: dict[str, list[float]] = {name: [] for name in QUANTITIES}
        self._values: dict[str, list[float]] = {name: [] for name in QUANTITIES}

    def add(self, record: LoggerRecord) -> None:
        """Add the values of a record; later values are deleted, because the clock was set back."""
        for name in QUANTITIES:
            value = getattr(record, name)
            if not math.isfinite(value):
                continue
            stamps, values = self._stamps[name], self._values[name]
            if stamps and record.stamp_s < stamps[-1]:
                later = bisect_left(stamps, record.stamp_s)
                del stamps[later:], values[later:]
            stamps.append(record.stamp_s)
            values.append(value)
            limit = self._max_values
            if limit is not None and len(stamps) > 2 * limit:
                del stamps[:-limit], values[:-limit]

    def filled(self, record: LoggerRecord) -> LoggerRecord:
        """A record whose missing values come from other records."""
        limit_s = max(MAX_WEATHER_GAP_S, MAX_GAP_RECORDS * live_time_s(record))
        pressure, temperature, humidity = (
            value if math.isfinite(value := getattr(record, name)) else self._filled(name, record.stamp_s, limit_s)
            for name in QUANTITIES
        )
        return replace(record, pressure_hpa=pressure, temperature_degc=temperature, relative_humidity=humidity)

    def _filled(self, name: str, stamp_s: float, limit_s: float) -> float:
        stamps, values = self._stamps[name], self._values[name]
        after = bisect_right(stamps, stamp_s)
        near = [index for index in (after - 1, after) if 0 <= index < len(stamps)]
        if not near:
            return NAN
        first, last = near[0], near[-1]
        nearest_s = min(abs(stamps[index] - stamp_s) for index in near)
        gap_s = stamps[last] - stamps[first]
        if nearest_s > limit_s / 2 and not (first < last and gap_s <= limit_s):
            return NAN
        if first == last or stamp_s == stamps[first]:
            return values[first]
        slope = (values[last] - values[first]) / gap_s
        return slope * (stamp_s - stamps[first]) + values[first]


def intensity_source(settings: CorrectionSettings) -> NeutronMonitor | float | None:
    """Source of the incoming intensity, ``None`` without intensity correction.

    :raises InputError: if the neutron-monitor file is invalid
    """
    intensity = settings.intensity
    if intensity is None or intensity.file is None:
        return None if intensity is None else intensity.constant
    return read_neutron_monitor(intensity.file, intensity.monitor or "", intensity.max_gap_hours * 3600)


def unusual_factors(factors: Mapping[str, tuple[float, float]]) -> list[str]:
    """Doubts about factors of corrections that are far from 1: least and greatest factor by name.

    >>> unusual_factors({"f_intensity": (9.8, 10.1)})[0].split(":")[0]
    'the factor of the incoming neutrons is 9.80 to 10.10'
    """
    reasons = {
        "f_humidity": ("humidity", "check the units of temperature and humidity, and reference_gm3"),
        "f_intensity": ("incoming neutrons", "are monitor and 'reference' of one station, in one unit?"),
    }
    found = []
    for name, (what, reason) in reasons.items():
        (least, most), (low, high) = factors.get(name, (1.0, 1.0)), USUAL_FACTORS[name]
        if least < low or most > high:
            found.append(f"the factor of the {what} is {least:.2f} to {most:.2f}: {reason}")
    return found


def unusual_pressure(pressure_hpa: float, site: Site) -> str:
    """Doubt about a mean air pressure [hPa] that does not fit the altitude of the site; empty for a usual one."""
    place = site.corrections.place or site.location
    if place is None or place.altitude_m is None:
        return ""
    usual_hpa = standard_pressure_hpa(place.latitude_deg, place.altitude_m)
    if not abs(pressure_hpa - usual_hpa) > MAX_FROM_ALTITUDE_HPA:
        return ""
    return (
        f"the air pressure is {pressure_hpa:.0f} hPa on average, but {usual_hpa:.0f} hPa are usual at "
        f"{place.altitude_m:g} m: is it reduced to sea level, or the altitude in feet?"
    )


def correct_record(
    record: LoggerRecord, site: Site, intensity: NeutronMonitor | float | None, shares: NDArray[np.float64]
) -> CountRecord:
    """Correct a record without placing it.

    :param record: the raw record, with the weather at its time
    :param intensity: incoming intensity: from a monitor or constant, ``None`` if unknown
    :param shares: share of each tube in the whole rate [-]
    :raises LostRecordError: if no tube counted, or a value that a correction needs is missing
    """
    try:
        raw_counts, exposure_s = combine_tubes(record, shares)
    except ValueError as error:
        raise LostRecordError(Kind.NO_COUNTS, str(error), remedy="check the detector") from None
    if isinstance(intensity, NeutronMonitor):
        rate = intensity.at(record.stamp_s)
        if rate is None:
            inside = intensity.stamp_s[0] < record.stamp_s < intensity.stamp_s[-1]
            remedy = "export the whole time of the survey"
            remedy += ", or raise 'max_gap_hours' under 'intensity'" if inside else ""
            message = f"cannot be corrected: {intensity.coverage} has no rate at this time"
            raise LostRecordError(Kind.NO_CORRECTION, message, remedy=remedy)
        intensity = rate
    settings, parameters = site.corrections, site.corrections_parameters
    air = {"air temperature": record.temperature_degc, "relative humidity": record.relative_humidity}
    needed = {"air pressure": record.pressure_hpa} if settings.pressure else {}
    needed |= air if settings.humidity else {}
    if lacking := [name for name, value in needed.items() if math.isnan(value)]:
        remedy = "complete the data; write null for a correction only if N0 was calibrated without it"
        message = f"cannot be corrected: there is no {' and no '.join(lacking)}"
        raise LostRecordError(Kind.NO_CORRECTION, message, remedy=remedy)
    try:
        rate = math.nan if intensity is None else intensity
        factors = (
            1.0 if settings.pressure is None else parameters.f_pressure(record.pressure_hpa),
            1.0 if settings.humidity is None else parameters.f_humidity(*air.values()),
            1.0 if settings.intensity is None else parameters.f_intensity(rate),
        )
        effective_s = effective_exposure(exposure_s, math.prod(factors) * parameters.f_surroundings)
    except ValueError as error:
        remedy = "correct the value, or the corrections in the site file"
        raise LostRecordError(Kind.NO_CORRECTION, f"cannot be corrected: {error}", remedy=remedy) from None
    return CountRecord(record.stamp_s, NAN, NAN, NAN, raw_counts, exposure_s, effective_s, *factors)


def uncorrected_record(record: LoggerRecord, shares: NDArray[np.float64], quarantine: str) -> CountRecord:
    """A record that nobody can correct, with neutral factors and the code of the reason for its quarantine."""
    counts, exposure_s = combine_tubes(record, shares)
    return CountRecord(record.stamp_s, NAN, NAN, NAN, counts, exposure_s, exposure_s, quarantine=quarantine)


def place_record(record: CountRecord, position: Position | None, frame: LocalFrame | None) -> CountRecord:
    """Add the coordinates of a record.

    :raises LostRecordError: if there is no position, or it is beyond the datum's hemisphere
    """
    if position is None or frame is None:
        remedy = "give the GNSS log with --nmea, or the location of a stationary probe in the site file"
        raise LostRecordError(Kind.NO_POSITION, "there is no position for this record", remedy=remedy)
    x, y = frame.to_local(position.latitude_deg, position.longitude_deg)[0]
    if not math.isfinite(x + y):
        raise LostRecordError(
            Kind.NO_POSITION, "the position is on the far side of the earth", remedy="check the datum"
        )
    return replace(record, x_m=float(x), y_m=float(y), z_m=position.altitude_m)


def live_time_s(record: LoggerRecord) -> float:
    """Longest live time of a tube [s]; 0 without one."""
    return max((time_s for time_s in record.tube_live_s if math.isfinite(time_s)), default=0.0)


def counting_interval_s(record: LoggerRecord, previous: LoggerRecord | None) -> float:
    """Duration of the counting interval [s]: since the previous record, or the live time after a gap."""
    live_s = live_time_s(record)
    since_s = record.stamp_s - previous.stamp_s if previous is not None else math.inf
    return since_s if live_s <= since_s <= 1.5 * live_s else live_s


def position_gap_s(interval_s: float) -> float:
    """Maximum time between two fixes for interpolating the position of a record [s]."""
    return max(3.0 * interval_s, 5.0)
