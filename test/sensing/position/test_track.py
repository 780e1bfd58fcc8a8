# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions and the heading over time, and jumps of place."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing import Fix, FixStatus, LoggerRecord, Position, Site
from soilmoist_ros.sensing.position.track import CheckedTrack, Course, Track, base_from_antenna
from soilmoist_ros.sensing.survey.survey import Survey


def fix(stamp_s, latitude=52.0, longitude=13.0, altitude=30.0, sd=0.02) -> Fix:
    return Fix(stamp_s, Position(latitude, longitude, altitude, sd), FixStatus.RTK)


LINE = [fix(0.0, 52.0, 13.0, 30.0, 0.02), fix(10.0, 52.2, 13.1, 40.0, 0.05)]


def test_linear_between_two_fixes() -> None:
    wanted = Position(*map(pytest.approx, (52.05, 13.025, 32.5)), 0.05)
    assert Track(LINE).at(2.5, 10.0) == wanted


def test_across_180_degrees() -> None:
    track = Track([fix(0.0, longitude=179.8), fix(10.0, longitude=-179.8)])
    assert track.at(2.5, 10).longitude_deg == pytest.approx(179.9)
    assert track.at(7.5, 10).longitude_deg == pytest.approx(-179.9)


@settings(deadline=None)
@given(st.floats(allow_nan=True), st.floats(0, 100), st.lists(st.floats(0, 100), max_size=6))
def test_never_raises_and_stays_within_its_neighbours(stamp_s, gap_s, stamps) -> None:
    track = Track([fix(one, 50 + one / 100) for one in stamps])
    position = track.at(stamp_s, gap_s)
    assert position is None or 50 <= position.latitude_deg <= 51


def test_a_growing_track_starts_again_when_the_receiver_corrects_its_clock() -> None:
    track = Track()
    track.add(1e9, LINE[0].position)
    track.add(5.0, LINE[1].position)
    assert (len(track), track.fixed_s) == (1, 5.0)


# Heading ---------------------------------------------------------------------------------------------------------

FRAME = LocalFrame(52.0, 13.0)


def position(x_m, y_m, sd_m=0.02):
    latitude, longitude = FRAME.to_geographic([(x_m, y_m)])[0].tolist()
    return Position(latitude, longitude, 30.0, sd_m)


@given(st.floats(-math.pi, math.pi), st.complex_numbers(max_magnitude=9))
def test_the_base_is_the_turned_offset_away_from_the_antenna(heading, antenna):
    east_m, north_m = base_from_antenna((antenna.real, antenna.imag), heading)
    assert complex(east_m, north_m) == pytest.approx(-antenna * np.exp(1j * heading), abs=1e-9)


def test_the_heading_is_kept_while_the_robot_stands_in_the_noise_of_its_fixes():
    course, rng = Course(), np.random.default_rng(3)
    assert math.isnan(course.at(0.0))
    for second in range(10):
        course.add(float(second), position(0.0, 1.1 * second))
    for second in range(10, 500):
        x, y = rng.normal(0, 0.02, 2)
        course.add(float(second), position(x, 9.9 + y))
    assert course.at(499.0) == pytest.approx(math.pi / 2, abs=0.05)
    assert course.at(1.0) == pytest.approx(math.pi / 2, abs=1e-3)
    assert math.isnan(course.at(0.5))
    course.add(490.0, position(-50.0, 9.9))  # too late
    assert course.at(499.0) == pytest.approx(math.pi / 2, abs=0.05)
    course.add(5.0, position(-50.0, 9.9))  # the clock was corrected
    assert math.isnan(course.at(499.0))


# Checked track ---------------------------------------------------------------------------------------------------

T0 = 1.7e9


def driven(x_m, period_s=1.0, sd_m=0.02):
    track = CheckedTrack()
    for number, x in enumerate(x_m):
        track.add(T0 + period_s * number, position(x, 0.0, sd_m))
    return track


def test_a_jump_out_and_back_is_left_out():
    x_m = np.arange(100) * 0.6
    x_m[40:45] += 40.0
    track = driven(x_m)
    assert (len(track), len(track.jumped)) == (95, 5)
    assert track.at(T0 + 42, 20.0).longitude_deg == pytest.approx(position(0.6 * 42, 0.0).longitude_deg, abs=1e-9)
    assert track.reached_s == T0 + 99


@pytest.mark.parametrize(
    ("x_m", "period_s", "sd_m"),
    [
        (np.cumsum(np.minimum(np.arange(60) * 3.0, 30.0)), 1.0, 0.02),  # a car that gathers speed
        (np.arange(50) * 1500.0, 60.0, math.nan),  # a rover on a motorway, one place a minute
        (np.random.default_rng(1).normal(0.0, 4.0, 500), 1.0, 4.0),  # a standing receiver without corrections
        (np.concatenate([np.zeros(30), np.full(30, 4.0)]), 1.0, 0.02),  # corrections come back
        (np.concatenate([np.zeros(30), np.full(30, 12.0)]), 1.0, math.nan),  # of a receiver that states no error
    ],
)
def test_vehicles_and_noise_are_no_jumps(x_m, period_s, sd_m):
    assert len(driven(x_m, period_s, sd_m).jumped) == 0


@pytest.mark.parametrize("shift_s", [10, 40])
def test_a_record_at_a_jump_has_the_place_between_or_is_quarantined(shift_s):
    survey = Survey(Site(corrections={"pressure": None, "humidity": None}), FRAME)
    records = []
    for second in range(200):
        x_m = 0.5 * second + (2000.0 if 61 <= second < 61 + shift_s else 0.0)
        survey.take_fix(Fix(T0 + second, position(x_m, 0.0), FixStatus.RTK))
        if second and second % 10 == 0:
            survey.take_record(LoggerRecord(T0 + second, (40.0 + second % 7,), (10.0,)))
            records += survey.take_ready()
    records += survey.take_ready()
    good = [record for record in records if not record.quarantine]
    assert len(records) == 19
    for record in good:
        assert record.x_m == pytest.approx(0.5 * (record.stamp_s - 5 - T0), abs=3.0)
    bad = [record for record in records if record.quarantine]
    assert {record.quarantine for record in bad} == ({"place_jump"} if shift_s == 40 else set())
    assert all(record.x_m > 1900 for record in bad)
