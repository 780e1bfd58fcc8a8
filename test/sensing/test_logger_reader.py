import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.errors import InputError
from soilmoist_ros.sensing.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.logger_reader import Kind, RecordParser, Severity, detect_format, read_log
from soilmoist_ros.sensing.robot_logger import format_header, format_record
from soilmoist_ros.sensing.tubes import combine_tubes, tube_shares

FORMATS = {
    name: load_logger_format(name)
    for name in ("hydroinnova_rover", "hydroinnova_crs1000", "thorvald_crs", "finapp", "styx")
}
ROVER_HEADER = b"""\
//Hydroinnova CRS Probe Filename: 1.KSU
//Logger SerialNum=4711

//Recordperiod = 1 minutes.
//RecordNum,Date Time(UTC),P4_mb,P1_mb,T1_C,RH1,N1Cts,N2Cts, N1ETsec ,
//GpsUTC, LatDec, LongDec, Alt, Qual, HDOP
"""
FIELDS = {
    "number": "7",
    "time": "2024/05/01 10:00:00",
    "p4": "980.5",
    "p1": "979.9",
    "t": "20.0",
    "rh": "50.0",
    "n1": "40",
    "n2": "44",
    "live": "60",
    "gps": "0100000",
    "lat": "52.5",
    "lon": "13.4",
    "alt": "35",
    "quality": "1",
    "hdop": "0.9",
}


def line(**changes: str) -> bytes:
    return ", ".join({**FIELDS, **changes}.values()).encode()


def rover(*lines: bytes, longitude="east") -> tuple[list, list]:
    parser = RecordParser(FORMATS["hydroinnova_rover"], longitude)
    found = [parser.feed(one) for one in [*ROVER_HEADER.splitlines(), *lines]]
    return [record for record in found if record is not None], parser.problems


def kinds(problems) -> list[Kind]:
    return [problem.kind for problem in problems]


def rover_log(shared_data: Path, longitude="west"):
    return read_log(shared_data / "rover_gypsum_transect_2018-05-01.KSU", "hydroinnova_rover", longitude)


# ---------------------------------------------------------------- real log


def test_real_rover_log(shared_data) -> None:
    log = rover_log(shared_data)
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


def test_tube_sums_of_the_real_log(shared_data) -> None:
    path = shared_data / "rover_gypsum_transect_2018-05-01.KSU"
    rows = [row.split(",") for row in path.read_text().splitlines()[20:]]
    expected = np.array([[int(text) for text in row[10:18]] for row in rows])
    records = rover_log(shared_data).records
    assert np.array_equal([record.tube_counts for record in records], expected)
    shares = tube_shares(records)
    np.testing.assert_allclose(shares, expected.sum(axis=0) / expected.sum(), rtol=1e-6)
    raw, exposure = np.array([combine_tubes(record, shares) for record in records]).T
    assert raw.sum() == expected.sum()
    assert exposure.sum() == 39 + 52 + 199 * 60


def test_problems_of_the_real_log(shared_data) -> None:
    log = rover_log(shared_data)
    found = [(problem.kind, problem.mistake.line) for problem in log.problems]
    assert found == [
        (Kind.SHORT_LIVE_TIME, 21),
        (Kind.NO_FIX, 21),
        (Kind.SHORT_LIVE_TIME, 22),
        (Kind.CLOCK_OFFSET, 22),
    ]
    assert log.records_lost == 0
    assert log.clock_offset_s == pytest.approx(206, abs=2)


def test_a_log_without_signs_needs_a_side(shared_data) -> None:
    with pytest.raises(InputError, match="'longitude: west'"):
        rover_log(shared_data, "signed")
    assert rover_log(shared_data, "east").records[-1].position.longitude_deg == 97.43415


def test_format_of_the_real_log_is_detected(shared_data) -> None:
    assert detect_format(shared_data / "rover_gypsum_transect_2018-05-01.KSU") == FORMATS["hydroinnova_rover"]


@given(st.data())
def test_damaged_real_lines_never_raise(data) -> None:
    good = [*ROVER_HEADER.splitlines(), line(), line(time="2024/05/01 10:01:00", number="8")]
    damaged = []
    for one in good:
        text = bytearray(one)
        for _ in range(data.draw(st.integers(0, 3))):
            place = data.draw(st.integers(0, len(text)))
            text[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
        damaged.append(bytes(text))
    parser = RecordParser(FORMATS["hydroinnova_rover"], "west")
    for one in damaged:
        check_record(parser.feed(one, complete=data.draw(st.booleans())))


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


@pytest.mark.parametrize("name", sorted(FORMATS))
@given(
    st.lists(st.one_of(st.binary(max_size=80), st.text(",;\t*#/0123456789.-nN+: T", max_size=80).map(str.encode)))
)
def test_any_bytes_never_raise(name, lines) -> None:
    parser = RecordParser(FORMATS[name], "west")
    for one in lines:
        check_record(parser.feed(one))


@given(
    st.lists(
        st.lists(st.sampled_from(["1", "", "-1", "1e300", "nan", "0", "9e9", "x", "1714557610"]), max_size=25)
    )
)
def test_any_fields_never_raise(rows) -> None:
    for name, delimiter in (("styx", "\t"), ("finapp", ",")):
        parser = RecordParser(FORMATS[name])
        parser.feed(b"DateTimeUTC,neutrons,integration_time,pressure,latitude,longitude")
        for row in rows:
            check_record(parser.feed(delimiter.join(row).encode()))


@given(st.binary(max_size=300))
def test_any_file_is_read_or_refused(tmp_path_factory, data) -> None:
    path = tmp_path_factory.mktemp("any") / "x.log"
    path.write_bytes(data)
    try:
        read_log(path, FORMATS["thorvald_crs"])
    except InputError as error:
        assert str(path) in str(error)
        assert all(mistake.remedy for mistake in error.mistakes)


# ---------------------------------------------------------------- one test per kind of problem


def test_good_lines_have_no_problems() -> None:
    records, problems = rover(line(), line(time="2024/05/01 10:01:00", number="8"))
    assert (len(records), problems) == (2, [])


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
def test_damage_that_costs_a_record_and_only_that(damaged, kind) -> None:
    records, problems = rover(damaged, line())
    assert len(records) == 1
    lost = [problem for problem in problems if problem.lost]
    assert kinds(lost) == [kind]
    assert lost[0].severity is Severity.ERROR
    assert lost[0].mistake.line == 7


@pytest.mark.parametrize(
    ("odd", "expected"),
    [
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
        (line(lat="95"), [Kind.OUT_OF_RANGE, Kind.NO_FIX]),
        (line(lon="-13.4"), [Kind.OUT_OF_RANGE]),
        (line(gps="0094500"), [Kind.CLOCK_OFFSET]),
        (line(number="x"), [Kind.NOT_A_NUMBER]),
    ],
)
def test_oddities_that_are_reported_and_kept(odd, expected) -> None:
    records, problems = rover(odd)
    assert len(records) == 1
    assert kinds(problems) == expected
    assert not any(problem.lost for problem in problems)


def test_next_sensor_stands_in() -> None:
    records, _ = rover(line(p4="1098.5"), line(p4="-99", number="8"), line(p4="", p1="", number="9"))
    assert [record.pressure_hpa for record in records[:2]] == [979.9, 979.9]
    assert math.isnan(records[2].pressure_hpa)


def test_short_record_keeps_its_live_time() -> None:
    records, _ = rover(line(live="39"))
    assert records[0].tube_live_s == (39, 39)


def test_missing_tube_is_nan_in_counts_and_live_time() -> None:
    record = rover(line(n1=""))[0][0]
    assert math.isnan(record.tube_counts[0])
    assert math.isnan(record.tube_live_s[0])
    assert combine_tubes(record, [0.5, 0.5]) == (44, 30.0)


def test_western_longitudes() -> None:
    assert rover(line(), longitude="west")[0][0].position.longitude_deg == -13.4
    assert rover(line(lon="-13.4"), longitude="west")[0][0].position.longitude_deg == -13.4


def test_duplicates_are_dropped() -> None:
    records, problems = rover(line(), line(time="2024/05/01 10:01:00", number="8"), line())
    assert len(records) == 2
    assert kinds(problems) == [Kind.DUPLICATE]
    assert problems[0].severity is Severity.NOTE


def test_same_time_and_other_counts_are_kept() -> None:
    records, problems = rover(line(), line(n1="41"))
    assert len(records) == 2
    assert kinds(problems) == [Kind.SAME_TIME]


def test_clock_backwards_is_kept() -> None:
    records, problems = rover(line(), line(time="2024/05/01 09:00:00", number="8", gps="0090000"))
    assert len(records) == 2
    assert kinds(problems) == [Kind.CLOCK_BACKWARDS]


def test_gap_in_the_numbers() -> None:
    _, problems = rover(line(), line(time="2024/05/01 10:03:00", number="10", gps="0100300"))
    assert kinds(problems) == [Kind.GAP]
    assert "2 record(s)" in str(problems[0])


def test_lines_before_a_header() -> None:
    parser = RecordParser(FORMATS["hydroinnova_rover"], "east")
    assert parser.feed(line()) is None
    assert kinds(parser.problems) == [Kind.NO_HEADER]


def test_header_without_the_columns_needed() -> None:
    parser = RecordParser(FORMATS["hydroinnova_rover"], "east")
    parser.feed(b"//RecordNum,Date Time(UTC),P4_mb")
    assert parser.feed(b"1,2024/05/01 10:00:00,980") is None
    assert kinds(parser.problems) == [Kind.BAD_HEADER, Kind.NO_HEADER]


def test_column_of_a_quantity_is_missing() -> None:
    parser = RecordParser(FORMATS["hydroinnova_crs1000"])
    parser.feed(b"//RecordNum,Date Time(UTC),T1_C,RH1,N1Cts,N1ET_sec,")
    assert parser.feed(b"38, 2023/05/31 23:39:00, 9.1, 47.6, 1225, 1200") is not None
    assert kinds(parser.problems) == [Kind.MISSING_COLUMN]


def test_checksum() -> None:
    parser = RecordParser(FORMATS["thorvald_crs"])
    assert parser.feed(b"2024-05-01T10:00:10.000Z,1,10,1013,18,55,3,5,2,4,3,3,6,2,4,3,1,5*00") is None
    assert kinds(parser.problems) == [Kind.CHECKSUM]


def test_problems_may_go_to_a_callback() -> None:
    heard: list = []
    parser = RecordParser(FORMATS["hydroinnova_rover"], "east", on_problem=heard.append)
    parser.feed(line())
    assert (kinds(heard), parser.problems) == ([Kind.NO_HEADER], [])


# ---------------------------------------------------------------- files


def write(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "some.log"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("data", "message", "remedy"),
    [
        (b"", "is empty", "copied as a whole"),
        (b"\n \n", "is empty", "copied as a whole"),
        (b"\x00" * 500, "is empty", "copied as a whole"),
        (bytes(range(1, 256)), "is not a text file", "the text file"),
        (b"PK\x03\x04abc", "is a ZIP archive or a spreadsheet", "export it as text"),
        (b"hello\nworld\n", "no header line", "the shipped formats are finapp, hydroinnova_crs1000"),
        (ROVER_HEADER[:80], "no header line", "the shipped formats are"),
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
    assert detect_format(path) == FORMATS["hydroinnova_crs1000"]
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


def test_lines_of_both_encodings(tmp_path) -> None:
    data = "//Ort: Gießen\n".encode("latin-1") + "//Straße: x\n".encode() + ROVER_HEADER + line() + b"\n"
    log = read_log(write(tmp_path, data), "hydroinnova_rover", "east")
    assert (log.metadata["Ort"], log.metadata["Straße"]) == ("Gießen", "x")


@pytest.mark.parametrize("kept", [20, 60, 70])
def test_truncated_last_line(tmp_path, kept) -> None:
    second = line(time="2024/05/01 10:01:00", number="8")[:kept]
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


# ---------------------------------------------------------------- other loggers


def test_stationary_probe_leaves_out_the_bare_tube_and_faulty_sensors(tmp_path) -> None:
    header = b"//RecordNum,Date Time(UTC),P1_mb,P3_mb,P4_mb,T1_C,T2_C,RH1,RH2,N1Cts,N2Cts,N1ET_sec,N2ET_sec,D1,\n"
    row = b"18, 2021/09/09 05:45:00, 987.0, 989.7, 991.05, 15.9, 128.9, 75.2,119.0, 160, 122, 900, 900, 0\n"
    log = read_log(write(tmp_path, header + row), "hydroinnova_crs1000")
    (record,) = log.records
    assert record.tube_counts[0] == 160
    assert math.isnan(record.tube_counts[1])
    assert (record.temperature_degc, record.relative_humidity) == (15.9, 0.752)
    assert kinds(log.problems) == [Kind.OUT_OF_RANGE, Kind.OUT_OF_RANGE]


def test_finapp_integration_time(tmp_path) -> None:
    header = "DateTimeUTC,neutrons,muons,integration_time(s),V_in(V),temperature_in(°C),temperature_ext(°C),ur(%),"
    data = f"{header}pressure(hPa)\n2024-05-01 10:00:00,2280,9000,3595,12.6,25,-99,61.5,1001.2\n"
    path = write(tmp_path, data.encode("latin-1"))
    assert detect_format(path) == FORMATS["finapp"]
    log = read_log(path, "finapp")
    (record,) = log.records
    assert (record.tube_counts, record.tube_live_s) == ((2280,), (3595,))
    assert (record.temperature_degc, record.relative_humidity, record.pressure_hpa) == (25, 0.615, 1001.2)
    assert kinds(log.problems) == [Kind.SENTINEL]


def styx_row(stamp: int, cps: float, internal: str = "100100.5", external: str = "*") -> str:
    probes = "\t".join(["15000.00", "4.00", "5.50", "21.00"] * 3)
    return f"900\t{stamp}\t13.4\t30.1\t{internal}\t31.0\t21.5\t{external}\t55.0\t{probes}\t{cps:.4f}\t05/01/2024\t10:00:00\t"


def test_styx_counts_are_recovered_from_rate_and_stamps(tmp_path) -> None:
    stamps = [1714557600, 1714558494, 1714559389, 1714560283]
    counts = [230, 241, 223]
    rows = [styx_row(stamps[0], 231.4 / 900)]
    rows += [styx_row(b, n / (b - a)) for a, b, n in zip(stamps, stamps[1:], counts, strict=False)]
    path = write(tmp_path, "".join(row + "\r\n" for row in rows).encode())
    assert detect_format(path) == FORMATS["styx"]
    log = read_log(path, "styx")
    assert [record.tube_counts[0] for record in log.records[1:]] == counts
    assert [record.tube_live_s[0] for record in log.records] == [900, 894, 895, 894]
    assert kinds(log.problems) == [Kind.ASSUMED_LIVE_TIME, Kind.ROUNDED_COUNT]
    assert log.records[0].pressure_hpa == pytest.approx(1001.005)


def test_styx_external_pressure_is_in_hpa(tmp_path) -> None:
    path = write(tmp_path, (styx_row(1714557600, 0.25, external="1003.4") + "\n").encode())
    assert read_log(path, "styx").records[0].pressure_hpa == 1003.4


def test_rate_is_not_multiplied_over_a_lost_line(tmp_path) -> None:
    rows = [styx_row(1714557600, 0.25), "broken", styx_row(1714557600 + 1800, 0.25)]
    log = read_log(write(tmp_path, "\n".join(rows).encode() + b"\n"), "styx")
    assert [record.tube_live_s[0] for record in log.records] == [900, 900]


def mine(**changes) -> LoggerFormat:
    settings = {
        "title": "mine",
        "source": "a test",
        "delimiter": "semicolon",
        "header": {},
        "time": {
            "columns": ["Day + Clock"],
            "formats": ["%d.%m.%Y %H:%M"],
            "marks": "start",
            "utc_offset_hours": 2,
        },
        "counts": {"columns": ["c{tube}"]},
        "record_period": {"default_s": 600},
        "pressure": {"sensors": [{"column": "p", "unit": "kPa"}]},
        "temperature": {"sensors": [{"column": "t", "unit": "degF"}]},
        "humidity": {"sensors": [{"column": "h", "unit": "fraction"}]},
    }
    return LoggerFormat.model_validate({**settings, **changes})


def test_a_format_of_ones_own() -> None:
    parser = RecordParser(mine())
    parser.feed(b"Day;Clock;c1;c2;p;t;h")
    record = parser.feed(b"01.05.2018;16:04;7;8;98.1;68;0.5")
    assert record is not None
    assert record.stamp_s == 1525184040.0  # end of the interval, UTC
    assert record.tube_live_s == (600, 600)
    assert record.pressure_hpa == pytest.approx(981)
    assert record.temperature_degc == pytest.approx(20)
    assert record.relative_humidity == 0.5
    assert parser.problems == []


def test_blanks_as_delimiter_and_kelvin() -> None:
    logger = mine(
        delimiter="whitespace",
        time={"columns": ["time"], "formats": ["unix_s"]},
        temperature={"sensors": [{"column": "t", "unit": "K"}]},
    )
    parser = RecordParser(logger)
    parser.feed(b" time   c1    t")
    record = parser.feed(b" 1525184048   7 293.15 ")
    assert record is not None
    assert record.temperature_degc == pytest.approx(20)


def test_no_live_time_at_all() -> None:
    logger = mine(record_period={"header_key": "period"})
    parser = RecordParser(logger)
    parser.feed(b"Day;Clock;c1;p;t;h")
    assert parser.feed(b"01.05.2018;16:04;7;98.1;68;0.5") is None
    assert kinds(parser.problems) == [Kind.NO_LIVE_TIME]


def test_a_log_of_the_robot(tmp_path) -> None:
    from soilmoist_ros.sensing.records import LoggerRecord

    records = [
        LoggerRecord(1714557600.0 + 10 * i, (float(i % 5),) * 12, (10.0,) * 12, 1e3, 20.0, 0.5) for i in range(50)
    ]
    text = "\n".join([format_header("A1"), *(format_record(record) for record in records)]) + "\n"
    path = write(tmp_path, text.encode())
    log = read_log(path, "thorvald_crs")
    assert [record.tube_counts for record in log.records] == [record.tube_counts for record in records]
    assert (log.problems, log.serial, log.period_s) == ((), "A1", 10)
    assert detect_format(path) == FORMATS["thorvald_crs"]


def test_unknown_side_of_greenwich() -> None:
    with pytest.raises(InputError, match="use signed, east or west"):
        RecordParser("thorvald_crs", "left")  # type: ignore[arg-type]


def test_nothing_fits(tmp_path) -> None:
    with pytest.raises(InputError, match="not of any shipped logger format"):
        detect_format(write(tmp_path, b"a,b\n1,2\n"))
