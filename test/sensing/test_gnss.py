# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The error of a fix from the quality figures of the receiver."""

import math
import re

import numpy as np
import pytest

from soilmoist_ros.sensing import Fix, FixStatus, Heard, Position, clock_words
from soilmoist_ros.sensing.gnss import DEFAULT_UERE_M, STATUS_OF_QUALITY, NoPlace, covariance_of_ellipse


def test_error_ellipse_at_an_angle_has_its_axes() -> None:
    matrix = np.array(covariance_of_ellipse(3.0, 1.0, 30.0, 2.0))
    direction = np.array([math.sin(math.radians(30)), math.cos(math.radians(30)), 0])
    np.testing.assert_allclose(matrix @ direction, 9 * direction)
    np.testing.assert_allclose(np.linalg.eigvalsh(matrix), [1, 4, 9])


def test_every_quality_with_a_fix_has_a_range_error() -> None:
    assert STATUS_OF_QUALITY.keys() == DEFAULT_UERE_M.keys()
    assert FixStatus.NO_FIX not in STATUS_OF_QUALITY.values()


# Heard -----------------------------------------------------------------------------------------------------------

T0 = 1_778_749_200.0  # 2026-05-14 09:00 UTC
HOUR, DAY, WEEK = 3600.0, 86_400.0, 604_800.0
PLACE = Position(53.268, -0.5245)


def heard(first_s, last_s):
    found = Heard()
    for stamp_s in (first_s, (first_s + last_s) / 2, last_s):
        found.add(Fix(stamp_s, PLACE, FixStatus.FIX, quality=1))
    return found


def test_without_a_position_the_reasons_are_counted():
    found = Heard()
    assert "no epoch" in found.why_none().message
    for why, said, count in ((NoPlace.STATUS_UNKNOWN, "status -2", 3), (NoPlace.NO_FIX, "status -1", 1)):
        for _ in range(count):
            found.add(Fix.without_place(T0, why, said))
    assert found.why_none().message == (
        "has no position in 4 epochs: status -2: unknown whether there is a fix (3), status -1: no fix (1)"
    )
    assert "--nmea" in found.why_none().remedy
    found.add(Fix(math.nan, PLACE, FixStatus.RTK))
    assert found.why_none().message.startswith("has 1 positions, but no date")
    found.add(Fix(T0, PLACE, FixStatus.RTK, quality=8))
    assert found.why_none() is None
    assert found.odd == "1 are of a simulator (GGA 8)"


@pytest.mark.parametrize(
    ("shift_s", "message", "remedy"),
    [
        (0.0, None, ""),
        (30.0, None, ""),
        (-1024 * WEEK, "exactly 1024 weeks earlier: the receiver's date has rolled over", "--gnss-shift 1024w"),
        (-1024 * WEEK - 300.0, "exactly 1024 weeks earlier", "--gnss-shift 1024w"),
        (-T0, "simulated time", "--gnss-shift"),
        (
            -2 * HOUR,
            "local time, UTC +2 h, or the positions have local time, UTC -2 h",
            "_hours: 2'; .* --gnss-shift 2h",
        ),
        (5.5 * HOUR, "local time, UTC -5.5 h", "logger_utc_offset_hours: -5.5'; .* --gnss-shift -330min"),
        (18.0 - 315_964_800.0, "seconds of GPS time, which begins in 1980", "--gnss-shift 315964782s"),
        (-30 * DAY, "30 days apart, at the same time of day", "--gnss-shift 30d"),
        (-30 * DAY - 7 * HOUR, "they do not overlap", "same survey"),
    ],
)
def test_another_time_base_is_named_with_both_times(shift_s, message, remedy):
    why = heard(T0 + shift_s, T0 + HOUR + shift_s).why_not_at(T0, T0 + HOUR)
    if message is None:
        assert why is None
        return
    assert message in why.message
    assert "the records from 2026-05-14 09:00:00 to 2026-05-14 10:00:00 (UTC)" in why.message
    assert re.search(remedy, why.remedy)


def test_local_time_that_overlaps_is_asked_for_unless_the_clock_is_known():
    shifted = heard(T0 - 2 * HOUR, T0 + 3 * HOUR)
    why = shifted.why_not_at(T0, T0 + 5 * HOUR)
    assert "the same survey, 2 h later by the logger's clock, or two surveys" in why.message
    assert "'logger_utc_offset_hours: 2', or 0 for UTC; if the positions are in local time: --gnss" in why.remedy
    assert shifted.why_not_at(T0, T0 + 5 * HOUR, clock_known=True) is None
    assert shifted.why_not_at(T0, T0 + 3.3 * HOUR) is None  # the receiver was on before the logger


@pytest.mark.parametrize(
    ("ahead_s", "words"),
    [(-1024 * WEEK + 3, "1024 weeks"), (18.2, "leap seconds"), (-7200.4, "-2 h: local time"), (44.0, "")],
)
def test_differences_of_clocks_are_recognised(ahead_s, words):
    assert words in clock_words(ahead_s)
    assert bool(words) == bool(clock_words(ahead_s))
