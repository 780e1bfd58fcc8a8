# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Jumps of place are left out of a track, and believed when they stay."""

import math

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import CheckedTrack
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.survey import Survey

FRAME = LocalFrame(53.0, -0.5)
T0 = 1.7e9


def place(x_m, y_m=0.0, sd_m=0.02):
    latitude, longitude = FRAME.to_geographic((x_m, y_m))[0].tolist()
    return Position(latitude, longitude, 30.0, sd_m)


def driven(x_m, period_s=1.0, sd_m=0.02):
    track = CheckedTrack()
    for number, x in enumerate(x_m):
        track.add(T0 + period_s * number, place(x, sd_m=sd_m))
    return track


def test_a_jump_out_and_back_is_left_out():
    x_m = np.arange(100) * 0.6
    x_m[40:45] += 40.0
    track = driven(x_m)
    assert (len(track), len(track.jumped)) == (95, 5)
    assert track.at(T0 + 42, 20.0).longitude_deg == pytest.approx(place(0.6 * 42).longitude_deg, abs=1e-9)
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


def test_a_new_place_that_stays_is_believed():
    x_m = np.concatenate([np.zeros(20), 5000.0 + 0.6 * np.arange(100)])
    track = driven(x_m)
    assert 55 <= len(track.jumped) <= 65
    assert track.at(T0 + 119, 1.0).longitude_deg == pytest.approx(place(x_m[-1]).longitude_deg, abs=1e-9)


@pytest.mark.parametrize("shift_s", [10, 40])
def test_a_record_at_a_jump_has_the_place_between_or_is_quarantined(shift_s):
    survey = Survey(Site(corrections={"pressure": None, "humidity": None}), FRAME)
    records = []
    for second in range(200):
        x_m = 0.5 * second + (2000.0 if 61 <= second < 61 + shift_s else 0.0)
        survey.take_fix(Fix(T0 + second, place(x_m), FixStatus.RTK))
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
