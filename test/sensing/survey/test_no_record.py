# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A logger that sends bytes but no valid record is an error that says why and what to do (driver_health too)."""

from dataclasses import replace

import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.health import Level
from soilmoist_ros.sensing.formats.robot_logger import format_header, format_record
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.sensing.survey.driver_health import NO_RECORD_S, records_health
from soilmoist_ros.sensing.survey.logger_fault import logger_fault
from soilmoist_ros.sensing.survey.stream import SensorStream
from soilmoist_ros.simulation.robot.virtual_devices import sentences_without_fix

T0 = 1.78e9
HEADER = [text.encode() for text in format_header("CRS-0007").splitlines()]
ROVER = b"//RecordNum, Date Time(UTC), P1_mb, T1_C, RH1, N1Cts, N1ET(sec), LatDec, LongDec"


def line(number, **values):
    weather = {"pressure_hpa": 1000.0, "temperature_degc": 20.0, "relative_humidity": 0.5}
    record = LoggerRecord(T0 + 10 * number, (5.0,) * 12, (10.0,) * 12, record_number=number, **(weather | values))
    return format_record(record).encode()


def health(lines, heard_s=2 * NO_RECORD_S, site=None, logger="thorvald_crs", n_bytes=400):
    stream = SensorStream(site or Site(), LocalFrame(50.0, 10.0), logger)
    for one in lines:
        stream.take_logger_line(one, 0.0)
    stream.take_ready(1e9)
    return records_health(stream, T0 + 20.0, n_bytes, heard_s)


WRONG_SUM = [line(number)[:-2] + b"00" for number in range(5)]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (WRONG_SUM, "wrong checksum (5) in 5 lines; check the connection"),
        ([b"\xf8\x80\x07\x98\xfe" * 9] * 4, "baud rate"),
        ([], "no line has an end: compare the baud rate"),
        (HEADER, "only lines of a header"),
        ([text.encode() for text in sentences_without_fix(T0)] * 3, "exchange logger_uri and gnss_uri"),
        ([ROVER, b"1,2024/05/01 10:00:00,1000,20,50,400,60,39.1,-97.5"], "look like hydroinnova_rover"),
        ([*HEADER, line(1, pressure_hpa=float("nan"))], "cannot be corrected"),
    ],
)
def test_a_logger_without_one_valid_record_is_an_error_with_a_remedy(lines, said):
    part = health(lines)
    assert part.level is Level.ERROR
    assert "has not sent one valid record" in part.message
    assert said in part.message


def test_lines_without_a_checksum_show_that_the_format_is_another_one():
    part = health([b"12,34,56", b"12,34,57"])
    assert "no checksum, unlike those of" in part.message
    assert part.values["last line with: wrong checksum"] == "12,34,57"


def test_a_logger_that_has_just_begun_is_no_error_yet():
    assert health(HEADER, heard_s=5.0).level is Level.STALE
    assert health(WRONG_SUM, heard_s=5.0).level is Level.WARN
    assert health([], n_bytes=0).level is Level.STALE


def test_one_valid_record_ends_the_error():
    assert health([*WRONG_SUM, *HEADER, line(1)]).level in (Level.OK, Level.WARN)


def test_a_logger_that_falls_silent_after_bad_lines_says_what_was_wrong_with_them():
    stream = SensorStream(Site(), LocalFrame(50.0, 10.0), "thorvald_crs")
    for one in [*HEADER, line(1)]:
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
