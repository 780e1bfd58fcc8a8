# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Links and processing together, with servers."""

import contextlib
import math
import socket
import threading
import time

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError, Level, LocalFrame
from soilmoist_ros.sensing import PHONE, LogHeader, PhoneReceiver, Site, format_record
from soilmoist_ros.sensing.gnss import Fix, FixStatus, NoPlace
from soilmoist_ros.sensing.records import LoggerRecord, Position, utc_text
from soilmoist_ros.sensing.survey.driver import Driver, DriverSettings, fix_health, records_health
from soilmoist_ros.sensing.survey.stream import SensorStream

LIMIT_S = 20.0
FORMAT = "thorvald_crs"


@contextlib.contextmanager
def started(driver, wake=lambda: None):
    driver.start(wake)
    try:
        yield driver
    finally:
        driver.stop()


def until(driver, done):
    """Step until a condition on all batches holds; returns the batches."""
    batches = []
    deadline = time.monotonic() + LIMIT_S
    while not done(batches):
        assert time.monotonic() < deadline, driver.health(0.0)
        batches.append(driver.step(0.0))
    return batches


def test_it_is_woken_when_lines_arrive_and_not_for_every_line(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        host, port = server.getsockname()
        woken = threading.Semaphore(0)
        driver = Driver(DriverSettings(f"tcp://{host}:{port}", FORMAT), Site(), LocalFrame(50, 10))
        with started(driver, woken.release), server.accept()[0] as client:
            client.sendall(b"a\n" * 700)
            assert woken.acquire(timeout=LIMIT_S)
            batches = until(driver, lambda batches: sum(len(b.logger_lines) for b in batches) == 700)
            assert all(len(batch.logger_lines) <= 500 for batch in batches)
            [records] = [part for part in driver.health(0.0) if part.name == "records"]
            assert (records.level, "700 lines" in records.message) == (Level.WARN, True)
            client.sendall(b"b\n")
            deadline = time.monotonic() + LIMIT_S
            while not (lines := driver.step(0.0).logger_lines):
                assert time.monotonic() < deadline
                woken.acquire(timeout=0.1)
            assert lines == [b"b"]


ROVER = b"""\
//Recordperiod = 5 minutes.
//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N1ETsec
1,2024/05/01 10:00:00,980.5,20.0,50.0,40,300
"""
STATION = b"""\
"TOA5","farm","CR1000","10277"
"TIMESTAMP","RECORD","BP_mbar_Avg","N1Cts_Tot"
"TS","RN","mbar","counts"
"","","Avg","Tot"
"2024-05-01 10:00:00",1,980.5,400
"2024-05-01 10:15:00",2,980.5,410
"2024-05-01 10:30:00",3,980.5,420
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("logger", "lines", "limit_s"),
    [
        (FORMAT, b"#hello\n", 35.0),
        ("styx", b"hello\n", 3150.0),
        ("hydroinnova_rover", b"//hello\n", 35.0),  # the period is in the header
        ("hydroinnova_rover", ROVER, 1050.0),
        ("toa5", STATION, 3150.0),  # it has no nominal period
    ],
)
def test_the_link_of_a_logger_waits_as_long_as_its_records_are_apart(logger, lines, limit_s):
    with socket.create_server(("127.0.0.1", 0)) as server:
        host, port = server.getsockname()
        uri = f"tcp://{host}:{port}"
        driver = Driver(DriverSettings(uri, logger, uri), Site(longitude="east"), LocalFrame(50, 10))
        with started(driver), server.accept()[0] as one, server.accept()[0] as other:
            for client in (one, other):  # either is the logger
                client.sendall(lines)
            until(driver, lambda batches: sum(len(b.logger_lines) for b in batches) == lines.count(b"\n"))
            parts = {part.name: part.values.get("silence limit [s]") for part in driver.health(0.0)}
    assert (parts["logger link"], parts["GNSS link"]) == (f"{limit_s:.1f}", "35.0")


# Driver health ---------------------------------------------------------------------------------------------------

T0 = 1.78e9
NAN = math.nan


@pytest.fixture
def survey():
    site = Site(corrections={"pressure": None, "humidity": None})
    return SensorStream(site, LocalFrame(50.0, 10.0), "thorvald_crs")


def counted(number):
    return tuple(np.random.default_rng(number).poisson(5.0, 12).astype(float))


def count(survey, number, counts=None):
    record = LoggerRecord(T0 + 10 * number, counts or counted(number), (10.0,) * 12, record_number=number)
    survey.take_logger_line(format_record(record).encode(), 0.0)
    survey.compare_clocks(record.stamp_s, record.stamp_s)


@pytest.mark.parametrize(("stored_s", "date"), [(T0 - 86400, " of 2026-05-27 20:26 UTC"), (NAN, "")])
def test_columns_of_a_stored_header_are_a_warning_until_the_logger_sends_its_own(stored_s, date):
    survey = SensorStream(Site(corrections={"pressure": None, "humidity": None}), LocalFrame(50.0, 10.0), "toa5")
    names = ("TIMESTAMP", "RECORD", "N1Cts_Tot", "N1ET_Tot")
    survey.parser.use_header(LogHeader(names, stored_s=stored_s))
    survey.take_logger_line(b'"2026-05-28 20:26:40",1,50,10', 0.0)
    part = records_health(survey, T0)
    assert part.level is Level.WARN
    assert part.message.startswith(f"the columns are those of a stored header{date}: if the logger")
    survey.take_logger_line(",".join(f'"{name}"' for name in names).encode(), 0.0)
    survey.take_logger_line(b'"2026-05-28 20:26:50",2,51,10', 0.0)
    assert records_health(survey, T0 + 10).level is Level.OK


def test_missing_records_are_an_error(survey):
    assert records_health(survey, T0).level is Level.STALE
    count(survey, 1)
    count(survey, 2)
    part = records_health(survey, T0 + 25)
    assert (part.level, part.values["records per minute"]) == (Level.OK, "6.00")
    part = records_health(survey, T0 + 60)
    assert (part.level, part.message) == (Level.ERROR, "no record for 40 s: check the logger")


def test_damaged_lines_are_counted_by_kind_and_the_warning_ends(survey):
    for _ in range(2):
        count(survey, 1)
        survey.take_logger_line(b"2024-05-01T10:00:10.000Z,1,10.000*00", 0.0)
    part = records_health(survey, T0 + 10)
    assert part.level is Level.WARN
    assert "2 of the last 20 records are lost (the checksum" in part.message
    assert part.values["dropped: wrong checksum"] == "2"
    for number in range(2, 30):
        count(survey, number)
        survey.take_ready(math.inf)
    assert records_health(survey, T0 + 290).level is Level.OK


def test_quarantined_records_and_masked_tubes_are_named(survey):
    for number in range(1, 60):
        first = () if number < 40 else (9000.0 + number,)
        take(survey, number, (*first, *counted(number)[len(first) :]))
    part = records_health(survey, T0 + 590)
    assert (part.level, part.values["masked tubes"]) == (Level.WARN, "tube 1 (tube counts too much)")
    assert part.message.startswith("not used: tube 1 (tube counts too much)")
    take(survey, 60, (90_000.0,) * 12)
    part = records_health(survey, T0 + 600)
    assert part.level is Level.WARN
    assert "1 of the last 20 records are quarantined (line" in part.message
    assert part.values["quarantined: impossible count"] == part.values["records quarantined"] == "1"
    for number in range(61, 75):
        take(survey, number, (90_000.0,) * 12)
    part = records_health(survey, T0 + 740)
    assert part.level is Level.ERROR
    assert part.message.startswith("the counts cannot be trusted: 15 of the last 20 records are quarantined")


def take(survey, number, counts):
    count(survey, number, counts)
    survey.take_ready(math.inf)


def test_fixes_have_a_quality_and_an_age(survey):
    assert fix_health(survey, T0).level is Level.STALE
    survey.take_fix(Fix(T0, Position(50.0, 10.0, 30.0, 0.02), FixStatus.RTK, satellites=18, hdop=0.7))
    part = fix_health(survey, T0 + 1)
    assert part.level is Level.OK
    assert (part.values["status"], part.values["satellites"], part.values["hdop"]) == ("rtk", "18", "0.7")
    assert part.values["standard deviation [m]"] == "0.020"
    assert fix_health(survey, T0 + 20).message == "the last fix is 20 s old"
    survey.take_fix(Fix(T0 + 21, Position(NAN, NAN), FixStatus.NO_FIX))
    assert fix_health(survey, T0 + 21).level is Level.ERROR
    survey.take_fix(Fix(NAN, Position(50.0, 10.0), FixStatus.FIX))
    assert fix_health(survey, T0 + 21).message == "the last fix has no time"


def test_what_came_instead_of_a_fix_is_said(survey):
    survey.survey.heard.other_type = "the topic fix has gps_msgs/msg/GPSFix, not sensor_msgs/msg/NavSatFix"
    assert fix_health(survey, T0).message == f"no fix yet: {survey.survey.heard.other_type}"
    survey.take_fix(Fix.without_place(T0, NoPlace.STATUS_UNKNOWN, "status -2"))
    part = fix_health(survey, T0)
    assert part.level is Level.ERROR
    assert "unknown whether there is a fix (status -2): records are not placed; set the driver" in part.message
    for stamp_s, words in (
        (T0 - 1024 * 604_800, "exactly 1024 weeks earlier: the receiver's date has rolled over"),
        (12.0, "simulated time"),
        (T0 - 7200.0, "-2 h: local time instead of UTC"),
    ):
        survey.take_fix(Fix(stamp_s, Position(50.0, 10.0), FixStatus.FIX))
        message = fix_health(survey, T0).message
        assert words in message
        assert f"by this computer {utc_text(T0)} (UTC)" in message


HERE = {"latitude": -52.1, "longitude": 13.2, "accuracy": 5.0, "age_s": 0.5, "altitude": None, "speed": 1.2}


def test_a_phone_is_a_receiver_whose_old_and_coarse_positions_are_refused():
    phone = PhoneReceiver()
    driver = Driver(DriverSettings("tcp://127.0.0.1:1", FORMAT, PHONE), Site(), LocalFrame(-52.1, 13.2), phone)
    with started(driver):
        link = next(part for part in driver.health(0.0) if part.name == "GNSS link")
        assert (link.level, "keep the page open" in link.message) == (Level.ERROR, True)
        for wrong, said in (
            ({"accuracy": 65.0}, "within 65 m only"), ({"age_s": 30.0}, "30 s old"), ({"latitude": ""}, "sent no"),
            ({"accuracy": 0.0}, "sent no"), ({"age_s": None}, "sent no"), ({"longitude": 1e9}, "sent no"),
        ):  # fmt: skip
            with pytest.raises(InputError, match=said):
                phone.take(HERE | wrong, 1.8e9)
        for second in range(3):
            phone.take(HERE, 1.8e9 + second)
        fixes = [
            fix for batch in until(driver, lambda all: sum(len(b.fixes) for b in all) > 1) for fix in batch.fixes
        ]
        assert next(part for part in driver.health(0.0) if part.name == "GNSS link").level is Level.OK
    assert [fix.stamp_s for fix in fixes[:2]] == [1.8e9 - 0.5, 1.8e9 + 0.5]
    place = fixes[0].position
    assert (place.latitude_deg, place.longitude_deg) == pytest.approx((-52.1, 13.2), abs=1e-9)
    assert place.horizontal_sd_m == pytest.approx(5.0 / math.sqrt(2), abs=1e-3)
    assert fixes[0].speed_mps == pytest.approx(1.2, abs=1e-3)
