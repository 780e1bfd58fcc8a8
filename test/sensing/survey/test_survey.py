# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places of records by single fixes, and after the clock was set back."""

import math

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing import Fix, FixStatus, LoggerRecord, Position, Site, Track
from soilmoist_ros.sensing.survey.survey import MAX_EDGE_TOLERANCE_S, Survey

NAN = math.nan
T0 = 1_714_557_600.0
FRAME = LocalFrame(50.0, 10.0)
UNCORRECTED = Site(corrections={"pressure": None, "humidity": None})


def record(elapsed_s: float, **values) -> LoggerRecord:
    weather = {"pressure_hpa": 1000.0, "temperature_degc": 20.0, "relative_humidity": 0.5}
    number = round(elapsed_s / 10)
    values = {"tube_counts": (5.0 + number % 2,) * 12, "record_number": number, **weather, **values}
    return LoggerRecord(T0 + elapsed_s, tube_live_s=(10.0,) * 12, line=number, **values)


def fix(elapsed_s: float, status: FixStatus = FixStatus.RTK) -> Fix:
    latitude, longitude = FRAME.to_geographic((elapsed_s, 0.0))[0].tolist()
    return Fix(T0 + elapsed_s, Position(latitude, longitude, 30.0), status)


def test_a_single_fix_gives_the_place_within_the_interval_and_within_five_seconds():
    def placed(interval_s, elapsed_s):
        survey = Survey(UNCORRECTED, FRAME, keep_unplaced=False, track=Track([fix(elapsed_s)]))
        survey.take_record(LoggerRecord(T0 + 1000.0, (5.0,), (interval_s,)))
        return bool(survey.take_ready())

    assert placed(10.0, 995.0 - 4.9)
    assert not placed(10.0, 995.0 - 5.1)
    assert placed(60.0, 970.0 - MAX_EDGE_TOLERANCE_S)
    assert not placed(60.0, 970.0 - MAX_EDGE_TOLERANCE_S - 0.1)


@pytest.mark.parametrize("back_s", [12.0, 33.0, 55.0])
def test_own_positions_from_before_the_clock_was_set_back_are_not_used(back_s):
    survey, x_m = Survey(UNCORRECTED, FRAME), []
    for number in range(1, 121):
        ahead_s = back_s if number <= 60 else 0.0
        place = fix(10.0 * number).position
        survey.take_record(record(10.0 * number + ahead_s, position=place, record_number=number), 10.0 * number)
        x_m += [one.x_m for one in survey.take_ready(10.0 * number + 5.0)]
    assert np.abs(np.array(x_m) - (10.0 * np.arange(1, 121) - 5.0)).max() < 10.0


def test_a_record_of_a_logger_whose_clock_is_behind_waits_for_its_fix():
    survey = Survey(UNCORRECTED, FRAME, fix_wait_s=30.0)
    for second in range(50):
        survey.take_fix(fix(float(second)))
    survey.take_record(record(30.0, clock_ahead_s=-40.0), 0.0)
    assert survey.take_ready(0.0) == []
    for second in range(50, 80):
        survey.take_fix(fix(float(second)))
    (found,) = survey.take_ready(0.0)
    assert found.x_m == pytest.approx(65.0, abs=1e-6)
