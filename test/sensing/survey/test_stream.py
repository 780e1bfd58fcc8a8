# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A live stream has the records of the files, and no record is lost."""

import itertools
import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import logger_fault
from soilmoist_ros.foundation import Level, LocalFrame
from soilmoist_ros.sensing import Fix, FixStatus, Kind, Track, format_header, format_record, process_logs, read_log
from soilmoist_ros.sensing.moisture.site import Site, load_site
from soilmoist_ros.sensing.position.track_file import read_positions
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.driver import NO_RECORD_S, records_health
from soilmoist_ros.sensing.survey.stream import SensorStream
from soilmoist_ros.sensing.survey.survey import LINE_DELAY_S, MAX_EDGE_TOLERANCE_S, Survey
from soilmoist_ros.simulation.robot.virtual_devices import sentences_without_fix
from virtual_survey import START_S, write_survey

NAN = math.nan
T0 = datetime(2024, 5, 1, 12, tzinfo=UTC).timestamp()
FRAME = LocalFrame(50.0, 10.0)
UNCORRECTED = Site(corrections={"pressure": None, "humidity": None})
FORMAT = "thorvald_crs"


def record(number, **values):
    weather = {"pressure_hpa": 1000.0, "temperature_degc": 20.0, "relative_humidity": 0.5}
    values = {
        "tube_counts": (5.0,) * 12, "tube_live_s": (10.0,) * 12, "record_number": number, **weather, **values,
    }  # fmt: skip
    return LoggerRecord(T0 + 10.0 * number, **values)


def line(one):
    return format_record(one).encode()


def fix(elapsed_s, x_m=0.0, status=FixStatus.RTK):
    latitude, longitude = FRAME.to_geographic((x_m, 0.0))[0].tolist()
    place = Position(latitude, longitude, 30.0) if status is not FixStatus.NO_FIX else Position(NAN, NAN)
    return Fix(T0 + elapsed_s, place, status)


def survey():
    return SensorStream(UNCORRECTED, FRAME, FORMAT)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A simulated survey: its log, its fixes, its site, and its lines in order of time."""
    folder = tmp_path_factory.mktemp("survey")
    field = write_survey(folder, 1, spacing_m=20.0, dwell_s=60.0)
    logger = [(name.strip(), 1) for name in (folder / "survey.log").read_bytes().splitlines()]
    ends = itertools.count(1)
    lines = [
        (START_S + (0 if text.startswith(b"#") else 10 * next(ends)), source, text) for text, source in logger
    ]
    nmea = (folder / "survey.nmea").read_bytes().splitlines()
    lines += [(START_S + index // 3, 0, text) for index, text in enumerate(nmea)]
    log = read_log(folder / "survey.log", FORMAT)
    fixes, _ = read_positions(folder / "survey.nmea")
    return field.frame, load_site(folder / "site.yaml"), log, fixes, sorted(lines, key=lambda entry: entry[:2])


def statistics(one):
    return (one.stamp_s, one.raw_counts, one.exposure_s, one.effective_exposure_s,
            one.f_pressure, one.f_humidity, one.f_intensity)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.0, 4.0, 6.5, 30.0])
def test_the_same_records_as_from_the_files_however_late_the_fixes_are(simulated, late_s):
    frame, site, log, fixes, lines = simulated
    wanted = process_logs([log], site, frame, Track(fixes)).records
    live = SensorStream(site, frame, FORMAT, fix_wait_s=60.0)
    found = []
    for stamp_s, source, text in sorted(lines, key=lambda entry: entry[0] + late_s * (entry[1] == 0)):
        if source:
            live.take_logger_line(text, stamp_s)
        else:
            live.take_nmea_line(text)
        found += live.take_ready(stamp_s)
    found += live.take_ready(math.inf)
    assert [statistics(one) for one in found] == [statistics(one) for one in wanted]
    np.testing.assert_allclose(
        [(one.x_m, one.y_m, one.z_m) for one in found], [(one.x_m, one.y_m, one.z_m) for one in wanted], atol=1e-9
    )
    assert live.logger_problems.noted[Kind.NO_POSITION] == 0


def test_a_record_waits_for_the_first_fix_after_its_middle():
    live = survey()
    live.take_fix(fix(1.0, 1.0))
    live.take_logger_line(line(record(1)), 100.0)
    assert (live.take_ready(100.0), live.survey.waiting) == ([], 1)
    live.take_fix(fix(4.9, 4.9))
    assert live.take_ready(101.0) == []
    live.take_fix(fix(6.0, 6.0))
    [one] = live.take_ready(101.0)
    assert one.x_m == pytest.approx(5.0, abs=1e-6)
    assert one.raw_counts == 60


def test_after_the_waiting_time_a_fix_from_within_the_interval_serves():
    live = survey()
    live.take_fix(fix(1.0, 1.0))
    live.take_logger_line(line(record(1)), 100.0)
    assert live.take_ready(101.99) == []
    assert live.take_ready(102.0)[0].x_m == pytest.approx(1.0, abs=1e-6)
    live.take_logger_line(line(record(2)), 110.0)
    assert math.isnan(live.take_ready(112.0)[0].x_m)  # that fix is of the interval before


def test_a_later_record_or_epoch_ends_the_waiting_as_the_clock_does():
    live = survey()
    live.take_logger_line(line(record(1)), 0.0)
    assert live.take_ready(0.0) == []
    live.take_logger_line(line(record(2)), 0.0)
    assert live.take_ready(LINE_DELAY_S - 0.01) == []  # its fixes may be on their way
    assert [one.stamp_s - T0 for one in live.take_ready(LINE_DELAY_S)] == [10.0]
    live.take_fix(fix(21.9, status=FixStatus.NO_FIX))
    assert live.take_ready(0.0) == []
    live.take_fix(fix(22.0, status=FixStatus.NO_FIX))
    [one] = live.take_ready(0.0)
    assert math.isnan(one.x_m)
    assert math.isnan(one.y_m)
    assert one.raw_counts == 60
    assert live.logger_problems.noted[Kind.NO_POSITION] == 2
    assert not live.logger_problems.lost


@pytest.mark.slow
@given(st.data())
def test_no_record_is_lost_and_their_order_remains_whatever_comes_when(data):
    live = survey()
    found, now_s, number, epoch_s = [], 0.0, 0, 0.0
    for event in data.draw(st.lists(st.sampled_from(["record", "fix", "no fix", "jump", "wait"]), max_size=40)):
        if event == "record":
            number += 1
            live.take_logger_line(line(record(number)), now_s)
        elif event == "wait":
            now_s += data.draw(st.floats(0, 5))
        elif event == "jump":
            epoch_s += data.draw(st.floats(-1e6, 1e6))
        else:
            epoch_s += data.draw(st.floats(0, 20))
            status = FixStatus.FIX if event == "fix" else FixStatus.NO_FIX
            live.take_fix(fix(epoch_s, data.draw(st.floats(-50, 50)), status))
        found += live.take_ready(now_s)
    found += live.take_ready(now_s + 2.0)
    assert [one.stamp_s for one in found] == [T0 + 10.0 * k for k in range(1, number + 1)]
    assert all(math.isnan(one.x_m) or abs(one.x_m) <= 50.001 for one in found)
    assert live.survey.waiting == 0


# No record -------------------------------------------------------------------------------------------------------

HEADER = [text.encode() for text in format_header("CRS-0007").splitlines()]
ROVER = b"//RecordNum, Date Time(UTC), P1_mb, T1_C, RH1, N1Cts, N1ET(sec), LatDec, LongDec"


def health(lines):
    stream = SensorStream(Site(), LocalFrame(50.0, 10.0), "thorvald_crs")
    for one in lines:
        stream.take_logger_line(one, 0.0)
    stream.take_ready(1e9)
    return records_health(stream, T0 + 20.0, 400, 2 * NO_RECORD_S)


WRONG_SUM = [line(record(number))[:-2] + b"00" for number in range(5)]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (WRONG_SUM, "wrong checksum (5) in 5 lines; check the connection"),
        ([b"\xf8\x80\x07\x98\xfe" * 9] * 4, "baud rate"),
        ([], "no line has an end: compare the baud rate"),
        (HEADER, "only lines of a header"),
        ([text.encode() for text in sentences_without_fix(T0)] * 3, "exchange logger_uri and gnss_uri"),
        ([ROVER, b"1,2024/05/01 10:00:00,1000,20,50,400,60,39.1,-97.5"], "look like hydroinnova_rover"),
        ([*HEADER, line(record(1, pressure_hpa=NAN))], "cannot be corrected"),
    ],
)
def test_a_logger_without_one_valid_record_is_an_error_with_a_remedy(lines, said):
    part = health(lines)
    assert part.level is Level.ERROR
    assert "has not sent one valid record" in part.message
    assert said in part.message


def test_a_logger_that_falls_silent_after_bad_lines_says_what_was_wrong_with_them():
    stream = SensorStream(Site(), LocalFrame(50.0, 10.0), "thorvald_crs")
    for one in [*HEADER, line(record(1))]:
        stream.take_logger_line(one, 0.0)
    stream.take_ready(1e9)
    for one in WRONG_SUM:
        stream.take_logger_line(one, 0.0)
    part = records_health(stream, T0 + 70.0)
    assert part.level is Level.ERROR
    assert part.message.startswith("no record for 60 s: wrong checksum (5) in 5 lines;")


@pytest.mark.parametrize(("node", "heard"), [("/a/driver", True), ("/driver", False), ("/a/b/driver", False)])
def test_a_planner_reads_the_fault_of_the_driver_in_its_namespace(node, heard):
    part = health(WRONG_SUM)
    link = replace(part, name=f"{node}: logger link", level=Level.OK, message="connected")
    said = logger_fault([link, replace(part, name=f"{node}: records")], "/a")
    assert said == (part.message if heard else None)
    assert logger_fault([link], "/a") == ("" if heard else None)


# Places of a survey (survey.py) ----------------------------------------------------------------------------------


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
        place, counts = fix(10.0 * number, 10.0 * number).position, (5.0 + number % 2,) * 12
        survey.take_record(
            replace(record(number, position=place, tube_counts=counts), stamp_s=T0 + 10.0 * number + ahead_s),
            10.0 * number,
        )
        x_m += [one.x_m for one in survey.take_ready(10.0 * number + 5.0)]
    assert np.abs(np.array(x_m) - (10.0 * np.arange(1, 121) - 5.0)).max() < 10.0


def test_a_record_of_a_logger_whose_clock_is_behind_waits_for_its_fix():
    survey = Survey(UNCORRECTED, FRAME, fix_wait_s=30.0)
    for second in range(50):
        survey.take_fix(fix(float(second), float(second)))
    survey.take_record(record(3, clock_ahead_s=-40.0), 0.0)
    assert survey.take_ready(0.0) == []
    for second in range(50, 80):
        survey.take_fix(fix(float(second), float(second)))
    (found,) = survey.take_ready(0.0)
    assert found.x_m == pytest.approx(65.0, abs=1e-6)
