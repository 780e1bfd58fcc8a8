# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import math
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Kind, Severity, format_header, load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import RecordParser, detect_format, parse_log, read_log

FORMATS = {
    name: load_logger_format(name)
    for name in ("hydroinnova_rover", "hydroinnova_crs1000", "thorvald_crs", "finapp", "styx", "toa5")
}
ROVER_HEADER = b"""\
//Hydroinnova CRS Probe Filename: 1.KSU
//Logger SerialNum=4711

//Recordperiod = 1 minutes.
//RecordNum,Date Time(UTC),P4_mb,P1_mb,T1_C,RH1,N1Cts,N2Cts, N1ETsec ,
//GpsUTC, LatDec, LongDec, Alt, Qual, HDOP
"""
FIELDS = {
    "number": "7", "time": "2024/05/01 10:00:00", "p4": "980.5", "p1": "979.9", "t": "20.0", "rh": "50.0",
    "n1": "40", "n2": "44", "live": "60", "gps": "0100000", "lat": "52.5", "lon": "13.4", "alt": "35",
    "quality": "1", "hdop": "0.9",
}  # fmt: skip


def line(**changes: str) -> bytes:
    return ", ".join({**FIELDS, **changes}.values()).encode()


def rover(*lines: bytes, longitude="east") -> tuple[list, list]:
    parser = RecordParser(FORMATS["hydroinnova_rover"], longitude)
    found = [parser.feed(one) for one in [*ROVER_HEADER.splitlines(), *lines]]
    return [record for record in found if record is not None], parser.problems


def kinds(problems) -> list[Kind]:
    return [problem.kind for problem in problems]


def rover_log(roving_record: Path, longitude="west"):
    return read_log(roving_record, "hydroinnova_rover", longitude)


# ---------------------------------------------------------------- real log


def test_real_rover_log(roving_record) -> None:
    log = rover_log(roving_record)
    assert (len(log.records), log.n_lines, log.serial, log.period_s) == (201, 221, "16100724", 60)
    assert log.metadata["DataSelect"].startswith("r1p4p1")
    first, last = log.records[0], log.records[-1]
    assert first.tube_counts == (24, 25, 14, 22, 16, 17, 24, 17)
    assert first.tube_live_s == (39,) * 8
    assert first.position is None
    assert (first.pressure_hpa, first.temperature_degc, first.line) == (962.84, 20.8, 21)
    assert first.relative_humidity == pytest.approx(0.726)
    assert (last.record_number, last.stamp_s) == (201, 1525196040)
    assert last.position is not None
    assert (last.position.latitude_deg, last.position.longitude_deg) == (38.72526, -97.43415)
    assert last.position.altitude_m == 371.5


def test_problems_of_the_real_log(roving_record) -> None:
    log = rover_log(roving_record)
    found = [(problem.kind, problem.mistake.line) for problem in log.problems]
    assert found == [
        (Kind.SHORT_LIVE_TIME, 21),
        (Kind.NO_FIX, 21),
        (Kind.SHORT_LIVE_TIME, 22),
        (Kind.CLOCK_OFFSET, 22),
    ]
    assert log.records_lost == 0
    assert {one.clock_ahead_s for one in log.records} == {204, 206}


def test_a_log_without_signs_needs_a_side(roving_record) -> None:
    with pytest.raises(InputError, match="'longitude: west'"):
        rover_log(roving_record, "signed")
    assert rover_log(roving_record, "east").records[-1].position.longitude_deg == 97.43415


# ---------------------------------------------------------------- arbitrary bytes


def check_record(record) -> None:
    if record is None:
        return
    assert math.isfinite(record.stamp_s)
    present = [count for count in record.tube_counts if not math.isnan(count)]
    assert present
    assert all(count >= 0 and count == int(count) for count in present)
    for count, live_s in zip(record.tube_counts, record.tube_live_s, strict=True):
        assert math.isnan(live_s) if math.isnan(count) else live_s > 0
    assert not record.relative_humidity > 1
    if record.position:
        assert abs(record.position.latitude_deg) <= 90
        assert abs(record.position.longitude_deg) <= 180


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FORMATS))
@settings(deadline=None)
@given(
    st.lists(st.one_of(st.binary(max_size=80), st.text(",;\t*#/0123456789.-nN+: T", max_size=80).map(str.encode)))
)
def test_any_bytes_never_raise(name, lines) -> None:
    parser = RecordParser(FORMATS[name], "west")
    for one in lines:
        check_record(parser.feed(one))


# ---------------------------------------------------------------- one test per kind of problem


@pytest.mark.parametrize(
    ("damaged", "kind"),
    [
        (line() + b", 5", Kind.WRONG_FIELDS),
        (line()[:40], Kind.WRONG_FIELDS),
        (line(time="2024/05/41 10:00:00"), Kind.BAD_TIME),
        (line(time="1980/01/06 00:00:12"), Kind.BAD_TIME),
        (line(n1="4O"), Kind.NOT_A_NUMBER),
        (line(live="6O"), Kind.NOT_A_NUMBER),
        (line(n1="-3"), Kind.NEGATIVE_COUNT),
        (line(n1="40.5"), Kind.NOT_WHOLE),
        (line(n1="99999999"), Kind.OUT_OF_RANGE),
        (line(live="-60"), Kind.OUT_OF_RANGE),
        (line(n1="", n2="nan"), Kind.NO_COUNTS),
        (line(live="0"), Kind.NO_COUNTS),
        (line(n1="4\x000"), Kind.UNREADABLE),
        (line() + b" " * 2_000_000, Kind.TOO_LONG),
    ],
)
def test_damage_loses_one_record_only(damaged, kind) -> None:
    records, problems = rover(damaged, line())
    assert len(records) == 1
    lost = [problem for problem in problems if problem.lost]
    assert kinds(lost) == [kind]
    assert lost[0].severity is Severity.ERROR
    assert lost[0].mistake.line == 7


@pytest.mark.parametrize(
    ("odd", "expected"),
    [
        (line() + b"\n" + line(time="2024/05/01 09:00:00", number="8", gps="0090000"), [Kind.CLOCK_BACKWARDS]),
        (line() + b"\n" + line(time="2024/05/01 10:03:00", number="10", gps="0100300"), [Kind.GAP]),
        (line(p4="n/a", p1=""), [Kind.MISSING_VALUE]),
        (line(p4="98O.5"), [Kind.NOT_A_NUMBER]),
        (line(p4="1098.5"), [Kind.OUT_OF_RANGE]),
        (line(p4="-99.0"), [Kind.SENTINEL]),
        (line(n1=""), [Kind.MISSING_TUBE]),
        (line(live="39"), [Kind.SHORT_LIVE_TIME]),
        (line(live=""), [Kind.ASSUMED_LIVE_TIME, Kind.ASSUMED_LIVE_TIME]),
        (line(lat="0.00000", lon="0.00000"), [Kind.NO_FIX]),
        (line(quality="!w"), [Kind.NO_FIX]),
        (line(lat="", lon=""), [Kind.NO_FIX]),
        (line(lat="95"), [Kind.BAD_POSITION]),
        (line(lon="-13.4"), [Kind.BAD_POSITION]),
        (line(gps="0094500"), [Kind.CLOCK_OFFSET]),
        (line(number="x"), [Kind.NOT_A_NUMBER]),
    ],
)
def test_oddities_that_are_reported_and_kept(odd, expected) -> None:
    lines = odd.split(b"\n")
    records, problems = rover(*lines)
    assert len(records) == len(lines)
    assert kinds(problems) == expected
    assert not any(problem.lost for problem in problems)


@pytest.mark.parametrize("again", [slice(2, 4), slice(1, 2), slice(0, 4)])
def test_repeated_lines_of_a_logger_that_sends_rates_are_dropped(again) -> None:
    names = load_logger_format("styx").header.columns
    values = {"timestamp": "{}", "neutrons_cps": "{:.4f}", "external_pressure": "980.0"}
    row = "\t".join(values.get(name, "*") for name in names)
    lines = [row.format(1714557600 + 894 * n, (500 + n) / 894).encode() for n in range(5)]  # nominally 900 s
    log = parse_log([*lines[:4], *lines[again], *lines[4:]], "styx", "signed", Path("x"))
    whole = parse_log(lines, "styx", "signed", Path("x"))
    assert [record.stamp_s for record in log.records] == [record.stamp_s for record in whole.records]
    assert sum(problem.kind is Kind.DUPLICATE for problem in log.problems) == len(lines[again])


def test_the_next_sensor_replaces_a_faulty_one() -> None:
    records, _ = rover(line(p4="1098.5"), line(p4="-99", number="8"), line(p4="", p1="", number="9"))
    assert [record.pressure_hpa for record in records] == pytest.approx([979.9, 979.9, math.nan], nan_ok=True)


def minutes(ahead_s) -> list[bytes]:
    """A record a minute of a logger whose clock is ahead of the receiver's by these times."""
    clocks = [(datetime(2024, 5, 1, 10, n), timedelta(seconds=ahead)) for n, ahead in enumerate(ahead_s)]
    return [
        line(number=str(n), n1=str(40 + n), time=f"{at + ahead:%Y/%m/%d %H:%M:%S}", gps=f"0{at:%H%M%S}")
        for n, (at, ahead) in enumerate(clocks)
    ]


def test_the_offset_of_a_clock_that_drifts_and_is_set_is_known_for_each_record() -> None:
    true = [200 + n // 4 for n in range(20)] + [0] * 20
    written = [40 if n in (7, 30) else ahead for n, ahead in enumerate(true)]  # two wrong comparisons
    lines = [*ROVER_HEADER.splitlines(), line(number="90", lat="", gps=""), *minutes(written)]
    log = parse_log(lines, "hydroinnova_rover", "east", Path("x"))
    known = [one.clock_ahead_s for one in log.records]
    assert known[0] == 200, "nothing was compared yet"
    assert known[1:] == pytest.approx([*true[:20], 204, 204, *true[22:]], abs=1)
    found = [problem.mistake.message for problem in log.problems if problem.kind is Kind.CLOCK_OFFSET]
    assert [text.partition(" is ")[2] or text for text in found] == [
        "+200 s off GNSS time",
        "the logger's clock was set: +204 s off GNSS time, now +0 s",
    ]


def test_lines_before_a_header() -> None:
    parser = RecordParser(FORMATS["hydroinnova_rover"], "east")
    assert parser.feed(line()) is None
    assert kinds(parser.problems) == [Kind.NO_HEADER]


def after_a_restart() -> tuple[RecordParser, RecordParser]:
    """A parser that has read a header and a record, and one that knows only the header of the first."""
    first, later = (RecordParser(FORMATS["hydroinnova_rover"], "east") for _ in range(2))
    for one in ROVER_HEADER.splitlines():
        first.feed(one)
        assert first.header is None  # the second line of names may be on its way
    assert first.feed(line()) is not None
    assert first.header is not None
    later.use_header(first.header)
    return first, later


def test_an_earlier_header_is_used_until_the_logger_sends_one() -> None:
    first, later = after_a_restart()
    again = line(number="8", time="2024/05/01 10:01:00", gps="0100100")
    assert later.feed(again) == replace(first.feed(again), line=1)
    assert (later.period_s, later.serial, later.header) == (60.0, "4711", None)
    assert later.earlier_header == first.header
    assert later.feed(again + b", 5") is None  # it does not fit
    assert kinds(problem for problem in later.problems if problem.lost) == [Kind.WRONG_FIELDS]
    for one in (
        b"//hello",
        b"//Recordperiod = 5 minutes.",
        b"//RecordNum,Date Time(UTC),N1Cts,N1ETsec",
        b"//GpsUTC,LatDec,LongDec",
    ):
        later.feed(one)
    record = later.feed(b"9,2024/05/01 10:02:00,41,60,0100200,52.5,13.4")
    assert (record.tube_counts, record.record_number, later.period_s) == ((41,), 9, 300.0)
    assert later.earlier_header is None
    assert later.header.names == ("RecordNum", "Date Time(UTC)", "N1Cts", "N1ETsec", "GpsUTC", "LatDec", "LongDec")


# Log file --------------------------------------------------------------------------------------------------------

CRS1000 = load_logger_format("hydroinnova_crs1000")


def write(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "some.log"
    path.write_bytes(data)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "message", "remedy"),
    [
        (b"", "is empty", "copied as a whole"),
        (b"\n \n", "is empty", "copied as a whole"),
        (b"\x00" * 500, "is empty", "copied as a whole"),
        (bytes(range(1, 256)), "is not a text file", "the text file"),
        (b"PK\x03\x04abc", "is a ZIP archive or a spreadsheet", "export it as text"),
        (b"hello\nworld\n", "no header line", "the known formats are cosmos_europe, finapp, hydroinnova_crs1000"),
        (ROVER_HEADER[:80], "no header line", "the known formats are"),
        (b"$GNGGA,080000.00,,,,,0,00,99.9,,M,,M,,*74\n", "no header line", "pass it with --nmea"),
    ],
)
def test_unreadable_files(tmp_path, data, message, remedy) -> None:
    path = write(tmp_path, data)
    with pytest.raises(InputError) as caught:
        read_log(path, "hydroinnova_rover", "west")
    (mistake,) = caught.value.mistakes
    assert message in mistake.message
    assert remedy in mistake.remedy
    assert mistake.path == path


def test_wrong_format_names_the_columns_and_the_right_format(tmp_path) -> None:
    header = b"//Hydroinnova CRS-1000 Data\n\n//RecordNum,Date Time(UTC),P1_mb,P4_mb,T1_C,RH1,N1Cts,N1ET_sec,\n"
    path = write(tmp_path, header + b"\n38, 2023/05/31 23:39:00, 970.7, 974.2, 9.1, 47.6, 1225, 1200\n")
    with pytest.raises(InputError) as caught:
        read_log(path, "hydroinnova_rover", "west")
    (mistake,) = caught.value.mistakes
    assert "no column of the position ('LatDec' or 'LongDec'); it has RecordNum, Date Time(UTC)" in mistake.message
    assert mistake.line == 3
    assert mistake.remedy == "this looks like hydroinnova_crs1000: pass --logger hydroinnova_crs1000"
    assert detect_format(path) == CRS1000
    (record,) = read_log(path, "hydroinnova_crs1000").records
    assert (record.tube_counts, record.pressure_hpa) == ((1225,), 974.2)


def test_no_record_usable(tmp_path) -> None:
    path = write(tmp_path, ROVER_HEADER + line(n1="x") + b"\n" + line(n1="y") + b"\n")
    with pytest.raises(InputError, match=r"some.log:7 \[N1Cts\]: .*none of the 2 records is usable.*'x' is not a"):
        read_log(path, "hydroinnova_rover", "west")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(tmp_path, encoding, end) -> None:
    text = (ROVER_HEADER + line() + b"\n").decode().replace("Filename", "Weiß").replace("\n", end)
    log = read_log(write(tmp_path, text.encode(encoding)), "hydroinnova_rover", "east")
    assert (len(log.records), log.problems, log.serial) == (1, (), "4711")


def test_last_line_without_an_end_is_dropped_if_its_last_number_may_be_cut(tmp_path) -> None:
    header = b"//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N1ET_sec\n"
    rows = b"1, 2023/05/31 23:39:00, 974.2, 9, 47, 1225, 1200\n2, 2023/05/31 23:59:00, 974.2, 9, 47, 1225, 120"
    log = read_log(write(tmp_path, header + rows), "hydroinnova_crs1000")
    assert len(log.records) == 1
    assert kinds(log.problems) == [Kind.TRUNCATED]


def test_remarks_and_end_marks_are_no_problem(tmp_path) -> None:
    parser_lines = [b"# written by a test", *format_header().encode().splitlines(), b"\x1a"]
    path = write(tmp_path, b"\n".join(parser_lines) + b"\n")
    assert read_log(path, "thorvald_crs").problems == ()
