# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A file and a live stream of one survey produce equal records."""

import math

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing import Fix, FixStatus, LoggerRecord, Position, Site, Track, read_log
from soilmoist_ros.sensing.formats.robot_logger import format_header, format_record
from soilmoist_ros.sensing.survey.logs import process_logs
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


def from_file(tmp_path, records, fixes, site):
    path = tmp_path / "survey.log"
    path.write_text("\n".join([format_header("a"), *map(format_record, records)]) + "\n")
    return process_logs([read_log(path, "thorvald_crs")], site, FRAME, Track(fixes))


def one_by_one(records, fixes, site):
    """Records and fixes in order of time, none known in advance."""
    problems = []
    survey = Survey(site, FRAME, fix_wait_s=30.0, keep_unplaced=False, on_problem=problems.append)
    found = []
    for _, one in sorted([(one.stamp_s, one) for one in [*records, *fixes]], key=lambda entry: entry[0]):
        if isinstance(one, Fix):
            survey.take_fix(one)
        else:
            survey.take_record(one, one.stamp_s)
        found += survey.take_ready(one.stamp_s)
    return found + survey.take_ready(), problems


SITES = {
    "gap in the fixes": (
        [record(10.0 * k) for k in range(1, 12)], [fix(float(s)) for s in (*range(22), *range(70, 115))],
        UNCORRECTED,
    ),
    "last fix within the interval": (
        [record(10.0 * k) for k in range(1, 4)], [fix(float(s)) for s in range(22)], UNCORRECTED,
    ),
    "no pressure for 20 minutes": (
        [record(10.0), record(1210.0, pressure_hpa=NAN)], [fix(float(s)) for s in range(0, 1300, 5)], Site(),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SITES)
def test_a_file_and_the_same_data_one_by_one_have_the_same_records(case, tmp_path):
    records, fixes, site = SITES[case]
    wanted = from_file(tmp_path, records, fixes, site)
    found, problems = one_by_one(records, fixes, site)
    assert found == list(wanted.records)
    assert [p.kind for p in problems] == [p.kind for p in wanted.problems if p.lost]


def test_a_single_fix_gives_the_place_within_the_interval_and_within_five_seconds():
    def placed(interval_s, elapsed_s):
        survey = Survey(UNCORRECTED, FRAME, keep_unplaced=False, track=Track([fix(elapsed_s)]))
        survey.take_record(LoggerRecord(T0 + 1000.0, (5.0,), (interval_s,)))
        return bool(survey.take_ready())

    assert placed(10.0, 995.0 - 4.9)
    assert not placed(10.0, 995.0 - 5.1)
    assert placed(60.0, 970.0 - MAX_EDGE_TOLERANCE_S)
    assert not placed(60.0, 970.0 - MAX_EDGE_TOLERANCE_S - 0.1)


def test_the_middle_of_the_interval_is_joined_by_gnss_time():
    survey = Survey(UNCORRECTED, FRAME, track=Track([fix(float(s)) for s in range(100)]))
    survey.take_record(record(50.0, clock_ahead_s=20.0))
    assert survey.take_ready()[0].x_m == pytest.approx(25.0, abs=1e-6)
    # the interval starts at the previous record up to 1.5 live times ago; after a longer gap it is the live time
    survey.take_record(record(64.9))
    assert survey.take_ready()[0].x_m == pytest.approx(57.45, abs=1e-6)
    survey.take_record(record(80.0))
    assert survey.take_ready()[0].x_m == pytest.approx(75.0, abs=1e-6)


@pytest.mark.parametrize("back_s", [12.0, 33.0, 55.0])
def test_own_positions_from_before_the_clock_was_set_back_are_not_used(back_s):
    survey, x_m = Survey(UNCORRECTED, FRAME, tubes=12), []
    for number in range(1, 121):
        ahead_s = back_s if number <= 60 else 0.0
        place = fix(10.0 * number).position
        survey.take_record(record(10.0 * number + ahead_s, position=place, record_number=number), 10.0 * number)
        x_m += [one.x_m for one in survey.take_ready(10.0 * number + 5.0)]
    assert np.abs(np.array(x_m) - (10.0 * np.arange(1, 121) - 5.0)).max() < 10.0
