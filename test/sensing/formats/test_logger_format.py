# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError, config_folder
from soilmoist_ros.sensing import FORMAT_NAME, TUBES, Kind, LoggerRecord, format_header, format_record
from soilmoist_ros.sensing.formats.logger_format import LOGGERS, load_logger_format, logger_names
from soilmoist_ros.sensing.formats.logger_reader import RecordParser, detect_format, read_log

MINIMAL = """
title: mine
source: here
header: {}
time: {columns: [t], formats: [iso8601]}
counts: {columns: ["c{tube}"]}
record_period: {default_s: 60}
"""


@pytest.fixture
def plug_ins(install_plug_ins, monkeypatch, tmp_path):
    """An installed package with two formats as paths, one as a function, and one without a file."""
    mine = tmp_path / "mine.yaml"
    mine.write_text(MINIMAL.replace('"c{tube}"', "my_counts").replace("[t]", "[my_time]"))
    code = f"from pathlib import Path\ntext = {str(mine)!r}\npath = Path(text)\nnothing = text + '.gone'\n"
    names = {f"my_{name}": name for name in ("text", "path", "function", "nothing")}
    install_plug_ins("soilmoist_ros.loggers", "my_loggers", code + "def function(): return path\n", **names)
    LOGGERS.refresh()
    yield
    monkeypatch.undo()
    LOGGERS.refresh()


@pytest.mark.usefixtures("plug_ins")
def test_an_installed_package_adds_a_format(tmp_path, caplog) -> None:
    assert {"my_text", "my_path", "my_function"} <= set(logger_names())
    assert "'my_nothing'" in caplog.text
    for name in ("my_text", "my_path", "my_function"):
        assert load_logger_format(name).title == "mine"
    with pytest.raises(InputError, match="did you mean 'my_function'"):
        load_logger_format("my_funktion")
    log = tmp_path / "some.log"
    log.write_text("my_time,my_counts\n2024-05-01T10:00:00Z,7\n")
    assert detect_format(log).title == "mine"
    assert read_log(log, "my_path").records[0].tube_counts == (7,)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("iso8601", "iso8610", "'iso8610' is not iso8601"),
        ("iso8601", "'%Q'", "is not iso8601"),
        ("record_period: {default_s: 60}", "", "nothing says how long a record counts"),
        ("title: mine", "titel: mine", "did you mean 'title'"),
        ("header: {}", "header: {}\nchecksum: crc", "'nmea'"),
        ("counts: {", "counts: {rounding_tolerance: 0.3, ", "less than or equal to 0.1, but it is 0.3"),
        ("header: {}", "header: {}\npressure: {sensors: [{column: p, unit: atm}]}", "'hPa'"),
        ("header: {}", "header: {}\npressure: {range: [5, 1], sensors: [{column: p, unit: hPa}]}", "lower limit"),
    ],
)
def test_mistakes_in_a_format_file_are_named(tmp_path, old, new, expected) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(MINIMAL.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_logger_format(path)
    assert expected in str(caught.value)


def test_columns_of_the_robot_are_those_of_its_format_file() -> None:
    from soilmoist_ros.sensing.formats.robot_logger import COLUMNS, FORMAT_NAME

    assert load_logger_format(FORMAT_NAME).header.columns == COLUMNS
    assert ",".join(COLUMNS[:6]) in (config_folder() / "loggers" / f"{FORMAT_NAME}.yaml").read_text()


@pytest.mark.parametrize(
    ("name", "clock", "text"),
    [
        ("toa5", None, "UTC is assumed where stamps name no zone (else logger_utc_offset_hours of the site)"),
        ("toa5", 0.0, "UTC"),
        ("toa5", -6.0, "UTC-6 h"),
        ("toa5", "Europe/Berlin", "Europe/Berlin"),
        ("hydroinnova_rover", None, "UTC"),  # its header says so
        ("styx", None, "UTC"),  # seconds since 1970
    ],
)
def test_a_clock_that_nobody_states_is_shown_as_an_assumption(name, clock, text):
    assert load_logger_format(name).on_clock(clock).time.clock_text == text


# The robot's logger --------------------------------------------------------------------------------------------

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
