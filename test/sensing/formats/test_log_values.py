# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    nmea_checksum,
    rate_of,
    read_coordinate,
    read_number,
    read_time,
    strip_checksum,
)
from soilmoist_ros.sensing.lines import split_lines

FORMATS = ["iso8601", "%Y/%m/%d %H:%M:%S", "unix_s", "unix_ms"]


@pytest.mark.parametrize(
    ("text", "value"), [(" 962.84", 962.84), ("-.5", -0.5), ("1e3", 1000), ("007", 7), ("3.", 3)]
)
def test_numbers(text, value) -> None:
    assert read_number(text) == value


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "1e999", "1_000", "0x1f", "12 13", "1,5", "٣", "--1", "1" * 50]
)
def test_what_is_no_number(text) -> None:
    assert read_number(text) is None


@pytest.mark.parametrize(
    ("text", "stamp_s"),
    [
        ("2018-05-01T14:14:08Z", 1525184048.0),
        ("2018-05-01 14:14:08.25", 1525184048.25),
        ("2018-05-01T16:14:08+02:00", 1525184048.0),
        ("2018-05-01T09:44:08-0430", 1525184048.0),
        ("2016-12-31T23:59:60Z", 1483228800.0),  # a leap second
        ("2018/05/01 14:14:08", 1525184048.0),
        ("1525184048", 1525184048.0),
    ],
)
def test_times(text, stamp_s) -> None:
    assert read_time(text, FORMATS) == stamp_s


def test_time_zone_of_the_clock_is_taken_off_unless_the_stamp_has_one() -> None:
    assert read_time("2018-05-01T16:14:08", ["iso8601"], 2) == 1525184048.0
    assert read_time("2018-05-01T14:14:08Z", ["iso8601"], 2) == 1525184048.0
    assert read_time("2018/05/01 16:14:08", ["%Y/%m/%d %H:%M:%S"], 2) == 1525184048.0


@pytest.mark.parametrize("text", ["", "2018-13-01T00:00:00Z", "2018-02-30T00:00:00Z", "yesterday", "2018" * 30])
def test_what_is_no_time(text) -> None:
    assert read_time(text, FORMATS) is None


def test_lines_of_all_encodings() -> None:
    assert split_lines(b"a\r\nb\nc") == ([b"a", b"b", b"c"], False)
    assert split_lines("ä\nb\n".encode("utf-16")) == (["ä".encode(), b"b"], True)
    assert decode_line("T(°C)".encode("latin-1")) == decode_line("T(°C)".encode()) == "T(°C)"
    assert decode_line(b"\xef\xbb\xbfx") == "x"


def test_checksum_of_a_known_sentence() -> None:
    assert nmea_checksum(b"GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,") == 0x47
    assert strip_checksum(b"ab*03") == b"ab"
    assert strip_checksum(b"ab*04") is None
    assert strip_checksum(b"ab") is None


@pytest.mark.parametrize(
    ("text", "formats", "stamp_s"),
    [
        ("2018-05-01 14:14:08 UTC", ["iso8601"], 1525184048.0),
        ("2018/05/01 14:14:08 UTC", ["%Y/%m/%d %H:%M:%S"], 1525184048.0),
        ("01.05.2018 14:14:08Z", ["%d.%m.%Y %H:%M:%S"], 1525184048.0),
        ("01.05.2018 16:14:08+02:00", ["%d.%m.%Y %H:%M:%S"], 1525184048.0),
        ("2018-04-30 24:00:00", ["iso8601"], 1525132800.0 - 10800),
        ("30/04/18 24:00", ["%d/%m/%y %H:%M"], 1525132800.0 - 10800),
        ("2018-05-01 14:24:00 GMT", ["iso8601"], 1525184640.0),
        ("5/1/2018 2:14:08 PM", ["%m/%d/%Y %I:%M:%S %p"], 1525184048.0 - 10800),
        ("43221.5", ["excel_days"], 1525176000.0 - 10800),
        ("1525184048000", ["unix_ms"], 1525184048.0),
    ],
)
def test_zones_in_stamps_midnights_and_serial_dates(text, formats, stamp_s) -> None:
    assert read_time(text, formats, 3.0) == stamp_s


@settings(deadline=None)
@given(st.floats(-89.99, 89.99), st.booleans())
def test_coordinates_of_receivers_and_of_maps_agree(value, lettered) -> None:
    minutes = round((abs(value) % 1) * 60, 4)
    degrees = int(abs(value)) + (minutes >= 60)
    text = f"{degrees:02d}{minutes % 60:07.4f}"
    text = f"{text} {'S' if value < 0 else 'N'}" if lettered else f"{'-' if value < 0 else ''}{text}"
    assert read_coordinate(text, packed=True) == pytest.approx(value, abs=1e-5)


# Units -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("texts", "unit"),
    [
        (["Zählrate [1/h]", "cph", "N_per_hour", "n1 [h^-1]", "Imp./Stunde"], "counts_per_hour"),
        (["CPM", "neutrons_cpm_avg", "counts/min", "per minute", "min⁻¹"], "counts_per_minute"),
        (["neutrons_cps", "counts/s", "Hz", "1/sec"], "counts_per_second"),
        (["N1Cts", "NeutronCount_Epithermal_Cum1h", "counts/15min", "n_per_sample", "MOD"], ""),
    ],
)  # fmt: skip
def test_units_of_rates(texts, unit):
    assert [rate_of(text) for text in texts] == [unit] * len(texts)
