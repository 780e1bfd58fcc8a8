# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Signs of rain in the weather of a logger."""

import math

import pytest

from soilmoist_ros.sensing.checks.rain import RainSigns
from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.simulation.robot.virtual_devices import warming_morning


def signs(weather):
    """What is said after records of (time, pressure, humidity)."""
    rain = RainSigns()
    for stamp_s, pressure_hpa, humidity in weather:
        rain.add(LoggerRecord(stamp_s, (30.0,), (60.0,), pressure_hpa, 15.0, humidity))
    return rain.text


@pytest.mark.parametrize(
    ("fall_hpa", "humidity", "said"),
    [
        (0.0, 0.97, "rain or fog is possible: the relative humidity is 97 %"),
        (
            3.0,
            0.88,
            "rain is possible: the pressure fell by 3.0 hPa within an hour, and the relative humidity is 88 %",
        ),
        (3.0, 0.6, ""),
        (1.0, 0.9, ""),
        (-3.0, 0.9, ""),
        (3.0, math.nan, ""),
    ],
)
def test_what_is_said(fall_hpa, humidity, said):
    assert signs((60.0 * n, 1010.0 - fall_hpa * n / 60, humidity) for n in range(61)) == said


def test_one_wet_record_and_a_slow_fall_say_nothing():
    assert signs([]) == ""
    assert signs([*((60.0 * n, 1010.0, 0.8) for n in range(10)), (600.0, math.nan, 1.0)]) == ""
    assert signs((60.0 * n, 1010.0 - n / 60, 0.9) for n in range(600)) == ""


def test_a_warming_morning_says_nothing():
    morning = [(10.0 * n, warming_morning(10.0 * n)) for n in range(2880)]
    assert all(
        signs((s, w.pressure_hpa, w.relative_humidity) for s, w in morning[:n]) == "" for n in (360, 1440, 2880)
    )
