# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Seconds since 1970 UTC <-> builtin_interfaces/Time."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time

_LAST_SECOND = 2**31 - 1


def to_time(stamp_s: float) -> Time:
    """Message of a time. A time that the message cannot represent becomes zero, which means unknown in ROS.

    :param stamp_s: seconds since 1970 UTC; NaN if unknown
    """
    if not (math.isfinite(stamp_s) and 0 <= stamp_s < _LAST_SECOND):
        return Time()
    second = math.floor(stamp_s)
    nanosecond = round((stamp_s - second) * 1e9)  # only the fraction, so that to_seconds restores stamp_s
    return Time(sec=second + nanosecond // 1_000_000_000, nanosec=nanosecond % 1_000_000_000)


def to_seconds(stamp: Time) -> float:
    """Seconds since 1970 UTC of a message."""
    return float(stamp.sec + stamp.nanosec * 1e-9)
