# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State of links, records and fixes in the diagnostics."""

import math

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.corrections.latest_intensity import LatestIntensity
from soilmoist_ros.sensing.formats.log_header import Header
from soilmoist_ros.sensing.formats.robot_logger import format_record
from soilmoist_ros.sensing.gnss import Fix, FixStatus, NoPlace
from soilmoist_ros.sensing.links.line_source import LinkState, LinkStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.heard import utc_text
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.driver_health import fix_health, link_health, records_health
from soilmoist_ros.sensing.survey.stream import SensorStream

T0 = 1.78e9
NAN = math.nan


@pytest.fixture
def survey():
    site = Site(corrections={"pressure": None, "humidity": None})
    return SensorStream(site, LocalFrame(50.0, 10.0), "thorvald_crs")


def counted(number):
    return tuple(np.random.default_rng(number).poisson(5.0, 12).astype(float))


def count(survey, number, late_s=0.0):
    record = LoggerRecord(T0 + 10 * number, counted(number), (10.0,) * 12, record_number=number)
    survey.take_logger_line(format_record(record).encode(), 0.0)
    survey.compare_clocks(record.stamp_s, record.stamp_s + late_s)


@pytest.mark.parametrize(
    ("state", "level"),
    [
        (LinkState.CONNECTED, Level.OK), (LinkState.ENDED, Level.OK), (LinkState.CONNECTING, Level.ERROR),
        (LinkState.SILENT, Level.ERROR), (LinkState.CLOSED, Level.STALE),
    ],
)  # fmt: skip
def test_every_state_of_a_link_has_its_level(state, level):
    part = link_health("logger link", LinkStatus("tcp://h:1", state, attempts=3, last_error="refused"))
    assert (part.level, part.name) == (level, "logger link")
    assert ("refused" in part.message) == (level is Level.ERROR)
    assert part.values["failed attempts"] == "3"


def test_an_intensity_that_does_not_come_or_is_old_is_a_warning_with_its_age():
    corrections = {"pressure": None, "humidity": None, "intensity": {"reference": 150, "constant": 150}}
    survey = SensorStream(Site(corrections=corrections), LocalFrame(50.0, 10.0), "thorvald_crs")
    latest, said = LatestIntensity(), []
    for number, now_h in enumerate((0.0, 0.0, 2.0, 4.0, 7.0), 1):
        record = LoggerRecord(T0 + 10 * number, counted(number), (10.0,) * 12, record_number=number)
        survey.take_logger_line(format_record(record).encode(), 3600 * now_h)
        if number == 1:
            assert records_health(survey, record.stamp_s).level is Level.OK, "no topic"
            survey.survey.latest_intensity = latest
        else:
            part = records_health(survey, record.stamp_s)
            said.append((part.level, part.message.partition(";")[0], part.values["age of the intensity [s]"]))
        if number == 2:
            latest.take(160.0, 0.0)
    assert said == [
        (Level.WARN, "no incoming intensity has come: that of the site file is used", "inf"),
        (Level.OK, "counting", "7200"),
        (Level.WARN, "the incoming intensity is 4.0 h old, of at most 6.0 h", "14400"),
        (Level.WARN, "the incoming intensity is 7.0 h old: that of the site file is used", "25200"),
    ]


def test_an_intensity_that_does_not_fit_its_reference_is_a_warning():
    corrections = {"pressure": None, "humidity": None, "intensity": {"reference": 150, "constant": 150}}
    survey = SensorStream(Site(corrections=corrections), LocalFrame(50.0, 10.0), "thorvald_crs")
    survey.survey.latest_intensity = LatestIntensity()
    for rate, level in ((160.0, Level.OK), (1600.0, Level.WARN)):
        survey.survey.latest_intensity.take(rate, 0.0)
        count(survey, 1)
        part = records_health(survey, T0 + 10)
        assert part.level is level
    assert part.message.startswith(
        "the factor of the incoming neutrons is 0.09 to 0.09: are monitor and 'reference'"
    )


def test_an_old_intensity_that_is_used_as_the_site_has_none_is_a_warning(tmp_path):
    (tmp_path / "monitor.csv").write_text("2024-04-30 00:00:00;75\n2024-04-30 01:00:00;75\n")
    intensity = {"reference": 150, "file": str(tmp_path / "monitor.csv")}
    corrections = {"pressure": None, "humidity": None, "intensity": intensity}
    survey = SensorStream(Site(corrections=corrections), LocalFrame(50.0, 10.0), "thorvald_crs")
    survey.survey.latest_intensity = LatestIntensity()
    survey.survey.latest_intensity.take(160.0, -7 * 3600.0)
    count(survey, 1)
    part = records_health(survey, T0 + 10)
    assert (part.level, part.message.partition(";")[0]) == (
        Level.WARN, "the incoming intensity is 7.0 h old, and used: the site file has none"
    )  # fmt: skip


@pytest.mark.parametrize(("stored_s", "date"), [(T0 - 86400, " of 2026-05-27 20:26 UTC"), (NAN, "")])
def test_columns_of_a_stored_header_are_a_warning_until_the_logger_sends_its_own(stored_s, date):
    survey = SensorStream(Site(corrections={"pressure": None, "humidity": None}), LocalFrame(50.0, 10.0), "toa5")
    names = ("TIMESTAMP", "RECORD", "N1Cts_Tot", "N1ET_Tot")
    survey.parser.use_header(Header(names, stored_s=stored_s))
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
    record = LoggerRecord(T0 + 10 * number, counts, (10.0,) * 12, record_number=number)
    survey.take_logger_line(format_record(record).encode(), 0.0)
    survey.compare_clocks(record.stamp_s, record.stamp_s)
    survey.take_ready(math.inf)


def test_a_difference_of_the_clocks_is_a_warning_and_not_silence(survey):
    count(survey, 1, late_s=100.0)
    part = records_health(survey, T0 + 110)
    assert part.level is Level.WARN
    assert "differs by -100 s from ours" in part.message


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


def test_positions_without_a_date_are_said_with_what_is_missing(survey):
    for _ in range(3):
        survey.take_fix(Fix(NAN, Position(50.0, 10.0), FixStatus.FIX))
    message = fix_health(survey, T0).message
    assert message.startswith("the receiver has 3 positions, but no date: neither RMC nor ZDA, nor stamps; let")


def test_what_came_instead_of_a_fix_is_said(survey):
    survey.survey.heard.other_type = "the topic fix has gps_msgs/msg/GPSFix, not sensor_msgs/msg/NavSatFix"
    assert fix_health(survey, T0).message == f"no fix yet: {survey.survey.heard.other_type}"
    survey.take_fix(Fix.without_place(T0, NoPlace.STATUS_UNKNOWN, "status -2"))
    part = fix_health(survey, T0)
    assert part.level is Level.ERROR
    assert "unknown whether there is a fix (status -2): records are not placed; the driver" in part.message
    for stamp_s, words in (
        (T0 - 1024 * 604_800, "exactly 1024 weeks earlier: the receiver's date has rolled over"),
        (12.0, "simulated time"),
        (T0 - 7200.0, "-2 h: local time instead of UTC"),
    ):
        survey.take_fix(Fix(stamp_s, Position(50.0, 10.0), FixStatus.FIX))
        message = fix_health(survey, T0).message
        assert words in message
        assert f"by this computer {utc_text(T0)} (UTC)" in message


def test_sentences_without_a_position_are_counted(survey):
    survey.take_nmea_line(b"$GPGSV,1,1,00*79")
    part = fix_health(survey, T0)
    assert part.level is Level.WARN
    assert part.message == "no fix yet: 1 sentences, none with a position (GGA, GNS, RMC or GLL)"
