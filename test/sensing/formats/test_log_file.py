# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.sensing.formats.logger_format import load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import Kind, detect_format, read_log
from soilmoist_ros.sensing.formats.robot_logger import format_header

THORVALD = load_logger_format("thorvald_crs")
CRS1000 = load_logger_format("hydroinnova_crs1000")
ROVER_HEADER = b"""\
//Hydroinnova CRS Probe Filename: 1.KSU
//Logger SerialNum=4711

//Recordperiod = 1 minutes.
//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N2Cts, N1ETsec ,
//GpsUTC, LatDec, LongDec, Alt, Qual, HDOP
"""


def line(number: int = 7, time: str = "10:00:00", n1: str = "40") -> bytes:
    gps = "0" + time.replace(":", "")
    return f"{number}, 2024/05/01 {time}, 980.5, 20.0, 50.0, {n1}, 44, 60, {gps}, 52.5, 13.4, 35, 1, 0.9".encode()


def kinds(problems) -> list[Kind]:
    return [problem.kind for problem in problems]


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


def test_missing_file_and_folder(tmp_path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        read_log(tmp_path / "none.log", "thorvald_crs")
    with pytest.raises(InputError, match="is a folder"):
        read_log(tmp_path, "thorvald_crs")


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


def test_header_alone_is_an_empty_log(tmp_path) -> None:
    assert read_log(write(tmp_path, ROVER_HEADER), "hydroinnova_rover", "west").records == ()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(tmp_path, encoding, end) -> None:
    text = (ROVER_HEADER + line() + b"\n").decode().replace("Filename", "Weiß").replace("\n", end)
    log = read_log(write(tmp_path, text.encode(encoding)), "hydroinnova_rover", "east")
    assert (len(log.records), log.problems, log.serial) == (1, (), "4711")


@pytest.mark.slow
def test_lines_of_both_encodings(tmp_path) -> None:
    data = "//Ort: Gießen\n".encode("latin-1") + "//Straße: x\n".encode() + ROVER_HEADER + line() + b"\n"
    log = read_log(write(tmp_path, data), "hydroinnova_rover", "east")
    assert (log.metadata["Ort"], log.metadata["Straße"]) == ("Gießen", "x")


@pytest.mark.parametrize("kept", [20, 60, 70])
def test_truncated_last_line(tmp_path, kept) -> None:
    second = line(8, "10:01:00")[:kept]
    log = read_log(write(tmp_path, ROVER_HEADER + line() + b"\n" + second), "hydroinnova_rover", "east")
    assert len(log.records) == 1
    assert kinds(log.problems) == [Kind.TRUNCATED]
    assert log.records_lost == 1


def test_last_line_without_an_end_is_kept_if_nothing_of_use_can_be_cut(tmp_path) -> None:
    log = read_log(write(tmp_path, ROVER_HEADER + line()), "hydroinnova_rover", "east")
    assert len(log.records) == 1


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


@pytest.mark.slow
@settings(deadline=None)
@given(st.binary(max_size=300))
def test_any_file_is_read_or_refused(tmp_path_factory, data) -> None:
    path = tmp_path_factory.mktemp("any") / "x.log"
    path.write_bytes(data)
    mistakes: tuple[Mistake, ...] = ()
    try:
        read_log(path, THORVALD)
    except InputError as error:
        mistakes = error.mistakes
    assert all(mistake.path == path and mistake.remedy for mistake in mistakes)
