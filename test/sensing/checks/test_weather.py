# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Impossible weather, and jumps of the pressure."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.sensing.checks.weather import WeatherChecks, pressure_limits_hpa
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord, Position

GOOD = LoggerRecord(1.7e9, (40.0,), (10.0,), 1005.0, 12.0, 0.6, Position(50.0, 10.0, 100.0))


def series(pressures, period_s):
    return [
        replace(GOOD, stamp_s=1.7e9 + period_s * n, pressure_hpa=float(p), temperature_degc=12.0, position=None)
        for n, p in enumerate(pressures)
    ]


def kinds(records, altitude_m=math.nan):
    checks = WeatherChecks()
    return {n: f[0].kind for n, record in enumerate(records) if (f := checks.check(record, altitude_m)[1])}


def test_weather_that_the_air_cannot_have_is_left_out():
    bad = replace(GOOD, pressure_hpa=300.0, temperature_degc=128.9, relative_humidity=1.19)
    record, findings = WeatherChecks().check(bad)
    assert [finding.kind for finding in findings] == [Kind.IMPOSSIBLE_WEATHER] * 3
    assert all(math.isnan(v) for v in (record.pressure_hpa, record.temperature_degc, record.relative_humidity))
    assert WeatherChecks().check(GOOD) == (GOOD, [])


@pytest.mark.parametrize(
    ("altitude_m", "pressure_hpa", "possible"),
    [(5000.0, 540.0, True), (100.0, 540.0, False), (math.nan, 540.0, True), (2500.0, 750.0, True),
     (2500.0, 1013.0, False), (-400.0, 1060.0, True), (9500.0, 290.0, True)],
)  # fmt: skip
def test_the_altitude_decides_which_pressure_is_possible(altitude_m, pressure_hpa, possible):
    low, high = pressure_limits_hpa(altitude_m)
    assert (low <= pressure_hpa <= high) is possible


def test_a_jump_of_the_pressure_is_left_out_until_it_stays():
    jump = series([1005.0, 1004.8, 950.0, 1004.9, 1005.1], 10.0)
    assert kinds(jump) == {2: Kind.IMPOSSIBLE_WEATHER}
    moved = series([1005.0, *[950.0 + 0.1 * n for n in range(12)]], 10.0)
    assert list(kinds(moved)) == [1, 2, 3, 4, 5]


def test_a_wrong_pressure_is_not_believed_because_it_lasts():
    pressure = np.full(400, 1005.0)
    pressure[200:290] = 965.0
    assert list(kinds(series(pressure, 10.0), altitude_m=30.0)) == list(range(200, 290))


def test_fronts_and_mountain_roads_are_no_jumps():
    front = 1013 - np.cumsum(np.full(24, 6.0))  # 6 hPa an hour, the fastest drops of storms
    assert kinds(series(front, 3600.0), 100.0) == {}
    climb = 1013 - np.cumsum(np.full(30, 12.0))  # 100 m a minute
    assert kinds(series(climb, 60.0)) == {}
