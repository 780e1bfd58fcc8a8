# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values of a line (log_values.py) and records of lines (log_record.py)."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing import LoggerFormat, load_logger_format, split_lines
from soilmoist_ros.sensing.formats.log_layout import build_layout
from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    nmea_checksum,
    rate_of,
    read_coordinate,
    read_number,
    read_time,
    strip_checksum,
)
from soilmoist_ros.sensing.formats.logger_reader import RecordParser

FORMATS = ["iso8601", "%Y/%m/%d %H:%M:%S", "unix_s", "unix_ms"]


def test_numbers() -> None:
    numbers = {" 962.84": 962.84, "-.5": -0.5, "1e3": 1000, "007": 7, "3.": 3}
    none = ("", "nan", "inf", "1e999", "1_000", "0x1f", "12 13", "1,5", "٣", "--1", "1" * 50)
    wanted = numbers | dict.fromkeys(none)
    assert {text: read_number(text) for text in wanted} == wanted


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
        *((none, None) for none in ("", "2018-13-01T00:00:00Z", "2018-02-30T00:00:00Z", "yesterday", "2018" * 30)),
    ],
)
def test_times(text, stamp_s) -> None:
    assert read_time(text, FORMATS) == stamp_s


def test_lines_of_all_encodings() -> None:
    assert split_lines(b"a\r\nb\nc") == ([b"a", b"b", b"c"], False)
    for encoding, text in (("utf-16", "ä\nb\n"), ("utf-16-le", "$GPGGA\nb\n"), ("utf-16-be", "$GPGGA\nb\n")):
        assert split_lines(text.encode(encoding)) == ([line.encode() for line in text.split()], True)
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
        ("2018-05-01T17:14:08", ["iso8601"], 1525184048.0),
        ("2018/05/01 17:14:08", ["%Y/%m/%d %H:%M:%S"], 1525184048.0),
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


# Records -------------------------------------------------------------------------------------------------------

FORMAT = LoggerFormat.model_validate(
    {
        "title": "mine",
        "source": "a test",
        "header": {},
        "time": {"columns": ["time"], "formats": ["unix_s"], "marks": "start"},
        "record_number": ["number"],
        "counts": {"columns": ["n{tube}"], "sentinels": [-1], "range": [0, 1000]},
        "live_time": {"columns": ["live{tube}"], "unit": "ms"},
        "record_period": {"default_s": 60},
        "humidity": {"sensors": [{"column": "rh", "unit": "percent"}], "sentinels": [-99]},
        "position": {
            "latitude": ["lat"], "longitude": ["lon"], "longitude_signed": False, "time_of_day": ["clock"],
        },
    }
)  # fmt: skip
NAMES = ("time", "number", "n1", "n2", "live1", "live2", "rh", "lat", "lon", "clock")
FIELDS = {
    "time": "1714557600", "number": "7", "n1": "40", "n2": "44", "live1": "59000", "live2": "60000",
    "rh": "50", "lat": "38.7", "lon": "97.4", "clock": "100055",
}  # fmt: skip


def read(**changes):
    parser = RecordParser(FORMAT, "west")
    assert parser.feed(",".join(NAMES).encode()) is None
    return parser.feed(",".join({**FIELDS, **changes}.values()).encode()), parser.problems


def test_units_side_and_end_of_the_interval():
    record, problems = read()
    assert (record.tube_counts, record.tube_live_s) == ((40, 44), (59, 60))
    assert (record.relative_humidity, record.record_number, record.line) == (0.5, 7, 2)
    assert (record.position.latitude_deg, record.position.longitude_deg) == (38.7, -97.4)
    assert record.stamp_s == 1714557660  # the stamp marks the start, the period is 60 s
    assert record.clock_ahead_s == 5.0
    assert problems == []


def test_a_missing_tube_is_nan_and_a_value_slightly_above_saturation_is_saturation():
    record, _ = read(n2="-1", rh="103")
    assert math.isnan(record.tube_counts[1])
    assert math.isnan(record.tube_live_s[1])
    assert record.relative_humidity == 1.0


def test_live_time_of_a_pair_of_tubes():
    rover = load_logger_format("hydroinnova_rover")
    names = ["RecordNum", "Date Time(UTC)", *(f"N{i}Cts" for i in range(1, 5)), "N1ETsec", "N3ETsec"]
    layout = build_layout(rover, [*names, "LatDec", "LongDec"])
    assert [source.name for source in layout.live if source] == ["N1ETsec", "N1ETsec", "N3ETsec", "N3ETsec"]
    own = build_layout(rover, ["Date Time(UTC)", "N1Cts", "N2Cts", "N1ETsec", "N2ETsec", "LatDec", "LongDec"])
    assert [source.name for source in own.live if source] == ["N1ETsec", "N2ETsec"]
