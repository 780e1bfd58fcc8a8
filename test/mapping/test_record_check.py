# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps that a record can have."""

import math

import pytest

from soilmoist_ros.mapping.record_check import Skip, StampLimits

HOUR_S, DAY_S = 3600.0, 86400.0
NOW_S = 1.78e9


@pytest.mark.parametrize(
    ("stamp_s", "clock_s", "fault"),
    [
        (NOW_S, NOW_S, ""),
        (NOW_S + HOUR_S, NOW_S, ""),
        (NOW_S + HOUR_S + 1, NOW_S, "a record stamped 3601 s ahead of the clock"),
        (NOW_S - DAY_S, NOW_S, ""),
        (NOW_S - DAY_S - 1, NOW_S, "a record stamped 86401 s behind the clock"),
        (NOW_S, 0.0, ""),
        (math.nan, NOW_S, "a record without a stamp"),
        (0.0, 10.0, "a record without a stamp"),
        (math.inf, 0.0, "a record without a stamp"),
    ],
)
def test_stamps(stamp_s, clock_s, fault):
    assert StampLimits().fault(stamp_s, clock_s) == fault


def test_a_limit_of_zero_is_none():
    limits = StampLimits(0.0, 0.0)
    assert limits.fault(1.0, NOW_S) == limits.fault(2 * NOW_S, NOW_S) == ""


@pytest.mark.parametrize("reason", Skip)
def test_each_reason_has_a_remedy(reason):
    assert reason.remedy
