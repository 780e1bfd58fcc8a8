# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.formats.logger_format import load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME, TUBES, format_header, format_record
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord

FORMAT = load_logger_format(FORMAT_NAME)
NAN = math.nan
RECORD = LoggerRecord(1714557610.0, (3.0,) * TUBES, (10.0,) * TUBES, 1013.25, 18.4, 0.5520, None, 1, 1)


def hundredths(low: int, high: int):
    return st.one_of(st.just(NAN), st.integers(low * 100, high * 100).map(lambda value: value / 100))


@st.composite
def records(draw) -> LoggerRecord:
    counts = draw(st.lists(st.one_of(st.just(NAN), st.integers(0, 99_999).map(float)), min_size=12, max_size=12))
    counts[draw(st.integers(0, 11))] = 5.0
    live_s = draw(st.integers(1, 12_000)) / 1000
    return LoggerRecord(
        stamp_s=draw(st.integers(700_000_000_000, 4_000_000_000_000)) / 1000, tube_counts=tuple(counts),
        tube_live_s=tuple(NAN if math.isnan(count) else live_s for count in counts),
        pressure_hpa=draw(hundredths(300, 1085)), temperature_degc=draw(hundredths(-60, 65)),
        relative_humidity=draw(hundredths(0, 1)), line=1, record_number=draw(st.integers(-1, 10**9)),
    )  # fmt: skip


@pytest.mark.slow
@settings(deadline=None)
@given(records())
def test_what_is_written_is_read(record) -> None:
    parser = RecordParser(FORMAT)
    read = parser.feed(format_record(record).encode() + b"\r\n")
    assert read is not None
    assert read.tube_counts == pytest.approx(record.tube_counts, nan_ok=True)
    assert read.tube_live_s == pytest.approx(record.tube_live_s, nan_ok=True, rel=1e-12)
    assert (read.record_number, read.position) == (record.record_number, None)
    for name in ("stamp_s", "pressure_hpa", "temperature_degc", "relative_humidity"):
        assert getattr(read, name) == pytest.approx(getattr(record, name), nan_ok=True, rel=1e-12), name


def test_the_header_has_serial_number_and_period() -> None:
    parser = RecordParser(FORMAT)
    for line in format_header("CRS-0007", 5).split("\n"):
        assert parser.feed(line.encode()) is None
    assert parser.serial == "CRS-0007"
    assert parser.period_s == 5
    assert parser.metadata["logger"] == "thorvald_crs/1"
    assert not parser.problems


@settings(deadline=None)
@given(st.integers(0, 60), st.integers(1, 255))
def test_one_changed_byte_is_always_found(place, change) -> None:
    line = bytearray(format_record(RECORD).encode())
    line[place] ^= change
    parser = RecordParser(FORMAT)
    assert parser.feed(bytes(line)) is None
    # If the first byte becomes #, the line is a remark and is not reported.
    assert [problem.kind for problem in parser.problems] == [Kind.CHECKSUM] or line.startswith(b"#")


@pytest.mark.parametrize("text", [b"www.usr.cn", b"\xff\x00hello\x07", b"12", b"#hb;", b"2024-05-01T10:00:00Z,"])
def test_text_of_a_serial_server_before_a_record_costs_no_record(text) -> None:
    parser = RecordParser(FORMAT)
    record = parser.feed(text + format_record(RECORD).encode())
    assert record is not None
    assert record.tube_counts == RECORD.tube_counts
    (problem,) = parser.problems
    assert (problem.kind, problem.lost) == (Kind.FOREIGN_TEXT, False)
    assert repr(text.decode("ascii", "backslashreplace")) in problem.mistake.message
    assert "heartbeat" in problem.mistake.remedy
    header = format_header(serial="A7").splitlines()
    for line in header:
        parser.feed(text + line.encode())
    assert parser.serial == "A7"
