# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weather at records with missing values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.sensing.survey.correction import MAX_WEATHER_GAP_S, WeatherSeries

NAN = math.nan


def record(stamp_s: float, pressure_hpa: float = 1000.0) -> LoggerRecord:
    return LoggerRecord(stamp_s, (5.0,), (10.0,), pressure_hpa, 20.0, 0.5)


def series_of(records) -> WeatherSeries:
    series = WeatherSeries()
    for one in records:
        series.add(one)
    return series


def pressure(series: WeatherSeries, stamp_s: float) -> float:
    return series.filled(record(stamp_s, NAN)).pressure_hpa


def test_a_short_gap_is_interpolated_and_a_long_one_is_not() -> None:
    assert pressure(series_of([record(0.0), record(1200.0, 1010.0)]), 600.0) == pytest.approx(1005.0)
    assert math.isnan(pressure(series_of([record(0.0), record(10_000.0, 1010.0)]), 5000.0))
    assert math.isnan(pressure(series_of([record(0.0, NAN), record(20.0, NAN)]), 10.0))


def test_gaps_of_a_logger_that_writes_every_hour_are_some_records_long() -> None:
    def hourly(hour: float, pressure_hpa: float = NAN) -> LoggerRecord:
        return LoggerRecord(3600 * hour, (700.0,), (3600.0,), pressure_hpa, 20.0, 0.5)

    series = series_of([hourly(0, 1000.0), hourly(4, 1004.0), hourly(9, 1010.0)])
    assert [series.filled(hourly(hour)).pressure_hpa for hour in (1, 2, 3)] == pytest.approx([1001, 1002, 1003])
    assert series.filled(hourly(6)).pressure_hpa == pytest.approx(1004 + 6 * 2 / 5)
    series = series_of([hourly(0, 1000.0), hourly(9, 1010.0)])
    assert math.isnan(series.filled(hourly(4)).pressure_hpa)


def test_a_value_of_the_record_itself_is_used() -> None:
    assert series_of([record(0.0), record(20.0)]).filled(record(10.0, 990.0)).pressure_hpa == 990.0


def test_at_the_end_the_last_value_serves_for_half_the_gap() -> None:
    series = series_of([record(0.0)])
    assert pressure(series, MAX_WEATHER_GAP_S / 2) == 1000.0
    assert math.isnan(pressure(series, MAX_WEATHER_GAP_S / 2 + 1))


def test_values_of_a_clock_that_was_set_back_are_forgotten() -> None:
    series = series_of([record(0.0, 990.0), record(5000.0, 1010.0), record(100.0, 995.0)])
    assert pressure(series, 110.0) == 995.0


def test_only_the_latest_values_are_remembered() -> None:
    series = WeatherSeries(max_values=3)
    for second in range(100):
        series.add(record(float(second), 1000.0 + second))
    assert pressure(series, 99.5) == 1099.0
    assert pressure(series, 0.0) > 1090.0


@given(
    st.lists(
        st.tuples(st.integers(0, 400), st.floats(900, 1100)), min_size=2, max_size=12, unique_by=lambda p: p[0]
    ),
    st.integers(0, 400),
)
def test_between_values_it_is_the_interpolation_of_numpy(points, stamp_s) -> None:
    points.sort()
    stamps, values = zip(*points, strict=True)
    series = series_of(record(float(at), value) for at, value in zip(stamps, values, strict=True))
    assert pressure(series, float(stamp_s)) == np.interp(stamp_s, stamps, values)
