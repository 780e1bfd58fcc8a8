# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Links and processing together, with recordings and a server."""

import contextlib
import itertools
import math
import socket
import threading
import time
from datetime import UTC, datetime

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.health import Level
from soilmoist_ros.sensing.moisture.site import Site, load_site
from soilmoist_ros.sensing.records import Position
from soilmoist_ros.sensing.survey.driver import Driver, DriverSettings
from soilmoist_ros.simulation.robot.virtual_devices import nmea_sentences
from virtual_survey import START_S, write_survey

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


def records(batches):
    return [record for batch in batches for record in batch.records]


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0, 300])
def test_recordings_of_logger_and_receiver_are_played_in_step(speed, tmp_path):
    field = write_survey(tmp_path, 3, spacing_m=40.0, dwell_s=60.0)
    uris = [f"{(tmp_path / name).as_uri()}?speed={speed}" for name in ("survey.log", "survey.nmea")]
    settings = DriverSettings(uris[0], FORMAT, uris[1], fix_wait_s=60.0)
    driver = Driver(settings, load_site(tmp_path / "site.yaml"), field.frame)
    log = (tmp_path / "survey.log").read_bytes().splitlines()
    number = sum(not text.startswith(b"#") for text in log)
    with started(driver):
        batches = until(driver, lambda batches: len(records(batches)) == number)
        assert {part.name: part.level for part in driver.health(0.0)}["logger link"] is Level.OK
    assert [text for batch in batches for text in batch.logger_lines] == log
    assert sum(len(batch.readings) for batch in batches) == number
    assert sum(len(batch.fixes) for batch in batches) > 9 * number
    assert not [one for one in records(batches) if math.isnan(one.x_m)]


def test_a_receiver_without_a_date_follows_the_clock_that_is_set_after_the_start(tmp_path):
    (tmp_path / "gga.nmea").write_text(
        "".join(nmea_sentences(START_S + k, Position(50.0, 10.0, 30.0, 0.02))[1] + "\n" for k in range(9))
    )
    (tmp_path / "empty.log").write_text("# no record\n")
    uris = [f"{(tmp_path / name).as_uri()}?speed=0" for name in ("empty.log", "gga.nmea")]
    driver = Driver(DriverSettings(uris[0], FORMAT, uris[1]), Site(), LocalFrame(50.0, 10.0), START_S - 3 * 86400)
    fixes = []
    with started(driver):
        deadline = time.monotonic() + LIMIT_S
        while len(fixes) < 8 and time.monotonic() < deadline:
            fixes += driver.step(START_S + 3600).fixes
    assert [one.stamp_s - START_S for one in fixes] == list(range(8))


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
    assert [part.level for part in driver.health(0.0)] == [Level.STALE]


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


FINAPP = (
    b"Datetime (UTC),neutrons,muons,gamma,integration_time(s),V_in(Volt),temperature_in(C),temperature_ext(C),"
    b"ur(%),pressure(hPa)"
)
TOA5 = [b'"TOA5","farm","CR1000","10277"', b'"TIMESTAMP","RECORD","N1Cts_Tot","N1ET_Tot"']


@pytest.mark.parametrize(
    ("logger", "header", "row", "gaps_s", "limit_s"),
    [
        ("finapp", [FINAPP], "{},15,90,1,30,12.5,20.0,18.0,50.0,1000.0", [30] * 9, 105.0),  # nominal: an hour
        ("toa5", TOA5, '"{}",{},15,10', [10] * 9 + [3600, 10], 35.0),  # a break
        ("toa5", TOA5, '"{}",{},15,10', [60] * 9 + [86400 * 700, -3600, 60], 210.0),
        ("toa5", TOA5, '"{}",{},15,10', [300, 7200], 1050.0),
        ("finapp", [FINAPP], "{},15,90,1,30,12.5,20.0,18.0,50.0,1000.0", [8, -60], 12600.0),  # a clock set back
    ],
)
def test_a_stuck_link_is_left_after_some_periods_of_the_records_that_came(logger, header, row, gaps_s, limit_s):
    driver = Driver(DriverSettings("tcp://127.0.0.1:1", logger), Site(), LocalFrame(50, 10))
    for line in header:
        driver.stream.take_logger_line(line, 0.0)
    for number, elapsed_s in enumerate(itertools.accumulate(gaps_s, initial=0)):
        stamp = datetime.fromtimestamp(START_S + elapsed_s, UTC).strftime("%Y-%m-%d %H:%M:%S")
        assert driver.stream.take_logger_line(row.format(stamp, number).encode(), 0.0)
    with started(driver):
        parts = {part.name: part.values.get("silence limit [s]") for part in driver.health(0.0)}
    assert parts["logger link"] == f"{limit_s:.1f}"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"logger_uri": "file:///no/such.log"}, "no such file"),
        ({"gnss_uri": "tpc://host:1"}, "write it like tcp://"),
        ({"logger_format": "thorvald"}, "thorvald_crs"),
    ],
)
def test_bad_settings_are_refused_at_once(changes, said):
    values = {"logger_uri": "tcp://127.0.0.1:1", "logger_format": FORMAT, **changes}
    with pytest.raises(InputError, match=said):
        Driver(DriverSettings(**values), Site(), LocalFrame(50, 10))
