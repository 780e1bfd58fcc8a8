# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each shipped logger format, and user formats."""

import math
from pathlib import Path

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import Kind, RecordParser, detect_format, read_log
from soilmoist_ros.sensing.formats.robot_logger import format_header, format_record
from soilmoist_ros.sensing.records import LoggerRecord


def write(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "some.log"
    path.write_bytes(data)
    return path


def kinds(problems) -> list[Kind]:
    return [problem.kind for problem in problems]


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
    assert detect_format(path) == load_logger_format("finapp")
    log = read_log(path, "finapp")
    (record,) = log.records
    assert (record.tube_counts, record.tube_live_s) == ((2280,), (3595,))
    assert (record.temperature_degc, record.relative_humidity, record.pressure_hpa) == (25, 0.615, 1001.2)
    assert kinds(log.problems) == [Kind.SENTINEL]


def test_hourly_table_of_a_network(tmp_path) -> None:
    header = (
        "DateTime_utc,NeutronCount_Epithermal_Cum1h,NeutronCount_Slow_Cum1h,AirTemperature,AirHumidity_Relative,"
    )
    header += "AirPressure,Precipitation,AirTemperature_Sensor2,AirHumidity_Relative_Sensor2\n"
    rows = "2014-01-09 11:00:00+00:00,655.0,431.0,9.5,,996.2,,8.9,93.9\n"
    rows += "2014-01-09 12:00:00+00:00,,,,,994.3,,,\n"
    path = write(tmp_path, (header + rows).encode())
    assert detect_format(path) == load_logger_format("cosmos_europe")
    log = read_log(path)
    (record,) = log.records
    assert (record.stamp_s, record.tube_counts, record.tube_live_s) == (1389265200.0, (655,), (3600,))
    assert (record.temperature_degc, record.pressure_hpa) == (8.9, 996.2)
    assert kinds(log.problems) == [Kind.NO_COUNTS]


def styx_row(stamp: int, cps: float, internal: str = "100100.5", external: str = "*") -> str:
    probes = "\t".join(["15000.00", "4.00", "5.50", "21.00"] * 3)
    air = f"13.4\t30.1\t{internal}\t31.0\t21.5\t{external}\t55.0"
    return f"900\t{stamp}\t{air}\t{probes}\t{cps:.4f}\t05/01/2024\t10:00:00\t"


def test_styx_counts_are_recovered_from_rate_and_stamps(tmp_path) -> None:
    stamps = [1714557600, 1714558494, 1714559389, 1714560283]
    counts = [230, 241, 223]
    rows = [styx_row(stamps[0], 231.4 / 900)]
    rows += [styx_row(b, n / (b - a)) for a, b, n in zip(stamps, stamps[1:], counts, strict=False)]
    path = write(tmp_path, "".join(row + "\r\n" for row in rows).encode())
    assert detect_format(path) == load_logger_format("styx")
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


@pytest.mark.parametrize(("since_s", "live_s"), [(1349, 1349), (1350, 900), (1351, 900)])
def test_the_time_between_stamps_counts_up_to_one_and_a_half_periods(tmp_path, since_s, live_s) -> None:
    rows = [styx_row(1714557600, 0.25), styx_row(1714557600 + since_s, 0.25)]
    log = read_log(write(tmp_path, "\n".join(rows).encode() + b"\n"), "styx")
    assert log.records[1].tube_live_s == (live_s,)


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


def test_a_user_format() -> None:
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
    records = [
        LoggerRecord(1714557600.0 + 10 * i, (float(i % 5),) * 12, (10.0,) * 12, 1e3, 20.0, 0.5) for i in range(50)
    ]
    text = "\n".join([format_header("A1"), *(format_record(record) for record in records)]) + "\n"
    path = write(tmp_path, text.encode())
    log = read_log(path, "thorvald_crs")
    assert [record.tube_counts for record in log.records] == [record.tube_counts for record in records]
    assert (log.problems, log.serial, log.period_s) == ((), "A1", 10)
    assert detect_format(path) == load_logger_format("thorvald_crs")


def test_nothing_fits(tmp_path) -> None:
    with pytest.raises(InputError, match="has no known logger format"):
        detect_format(write(tmp_path, b"a,b\n1,2\n"))
