# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weather at the records: missing values are interpolated from neighbouring records."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from soilmoist_ros.sensing.records import NAN, LoggerRecord

MAX_WEATHER_GAP_S = 1800.0
"""Maximum gap over which missing values are interpolated in time [s]; longer for long records."""
MAX_GAP_RECORDS = 4.0
"""This gap in counting intervals: three records of a logger that writes every hour may lack a value."""
QUANTITIES = ("pressure_hpa", "temperature_degc", "relative_humidity")


@dataclass(frozen=True)
class Weather:
    """Air pressure [hPa], temperature [degC] and relative humidity [0..1] at one record; NaN if unknown."""

    pressure_hpa: float
    temperature_degc: float
    relative_humidity: float


class WeatherSeries:
    """The weather of all records of a file, or of the records so far.

    A missing value is interpolated in time. It stays NaN if the gap is longer than :data:`MAX_WEATHER_GAP_S` and
    :data:`MAX_GAP_RECORDS` counting intervals, and the nearest value is further away than half of the longer one.

    :param records: records in order of time
    :param max_values: minimum number of latest values to keep; all if ``None``
    """

    def __init__(self, records: Iterable[LoggerRecord] = (), max_values: int | None = None) -> None:
        self._max_values = max_values
        self._stamps: dict[str, list[float]] = {name: [] for name in QUANTITIES}
        self._values: dict[str, list[float]] = {name: [] for name in QUANTITIES}
        for record in records:
            self.add(record)

    def __repr__(self) -> str:
        return f"WeatherSeries({', '.join(f'{len(self._values[name])} {name}' for name in QUANTITIES)})"

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

    def at(self, record: LoggerRecord) -> Weather:
        """The weather of a record; missing values come from other records."""
        own = {name: getattr(record, name) for name in QUANTITIES}
        live_s = max((time for time in record.tube_live_s if math.isfinite(time)), default=0.0)
        limit_s = max(MAX_WEATHER_GAP_S, MAX_GAP_RECORDS * live_s)
        return Weather(
            **{
                name: value if math.isfinite(value) else self._filled(name, record.stamp_s, limit_s)
                for name, value in own.items()
            }
        )

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
