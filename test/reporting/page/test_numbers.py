# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math

import pytest

from soilmoist_ros.reporting.page.numbers import area, duration, length, number, percent, volume, with_sd


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.00"), (1234.5, "1\u202f234"), (12.345, "12.3"), (0.012345, "0.0123"), (-0.5, "−0.500"),
        (1e-7, "1.00e-07"), (math.nan, "–"), (None, "–"),
    ],
)  # fmt: skip
def test_number(value, text):
    assert number(value) == text


def test_with_sd_shows_the_digits_that_are_meant():
    assert with_sd(7.0, 0.1234) == "7.00 ± 0.12"
    assert with_sd(1234.5, 45.0) == "1234 ± 45"
    assert with_sd(7.0, None) == "7.00"


@pytest.mark.parametrize(
    ("share", "text"),
    [(0, "0 %"), (0.004, "< 1 %"), (0.5, "50 %"), (0.996, "> 99 %"), (1, "100 %"), (math.nan, "–")],
)
def test_percent_is_never_a_false_0_or_100(share, text):
    assert percent(share) == text


def test_volume_in_percent():
    assert volume(0.12345) == "12.3"
    assert volume(None) == "–"
    assert volume(7e9) == "> 100"


def test_units_fit_the_size():
    assert area(3000) == ("0.30", "ha")
    assert area(70_000) == ("7.00", "ha")
    assert area(80e6) == ("80.0", "km²")
    assert area(120) == ("120", "m²")
    assert length(369.4) == ("369", "m")
    assert length(12_900) == ("12.9", "km")
    assert [duration(s) for s in (50, 600, 7200, 7380, 950400)] == [
        "50 s",
        "10 min",
        "2 h 00 min",
        "2 h 03 min",
        "11.0 days",
    ]
