# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each shipped logger format, and user formats."""

import math
from pathlib import Path

import pytest

from soilmoist_ros.sensing import Kind, LogFile, detect_format, load_logger_format, read_log


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


def styx_row(stamp: int, cps: float) -> str:
    probes = "\t".join(["15000.00", "4.00", "5.50", "21.00"] * 3)
    air = "13.4\t30.1\t100100.5\t31.0\t21.5\t*\t55.0"
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


@pytest.mark.parametrize(("since_s", "live_s"), [(1349, 1349), (1350, 900), (1351, 900)])
def test_the_time_between_stamps_counts_up_to_one_and_a_half_periods(tmp_path, since_s, live_s) -> None:
    rows = [styx_row(1714557600, 0.25), styx_row(1714557600 + since_s, 0.25)]
    log = read_log(write(tmp_path, "\n".join(rows).encode() + b"\n"), "styx")
    assert log.records[1].tube_live_s == (live_s,)


# Toa5 ------------------------------------------------------------------------------------------------------------

HEADER = """\
"TOA5","farm, south","CR300","10277","CR300.Std.10.04","CPU:probe.CR300","37658","Table1"
"TIMESTAMP","RECORD","station","latitude","longitude","altitude","counts_1_Tot","counts_2_Tot","air_temperature_Avg",\
"barometric_pressure_Avg","relative_humidity_Avg"
"TS","RN","name","decdegrees","decdegrees","m","counts","counts","celsius","mbar","%"
"","","Smp","Smp","Smp","Smp","Tot","Tot","Avg","Avg","Avg"
"""


def row(clock: str, number: int, counts: tuple[object, object] = (755, 870), air: str = "22.9,972,32.63") -> str:
    return f'"2021-09-22 {clock}",{number},"KS,003",38.23461,-97.57095,455,{counts[0]},{counts[1]},{air}\n'


def read(tmp_path: Path, text: str) -> LogFile:
    return read_log(write(tmp_path, text.replace("\n", "\r\n").encode()))


def test_a_table_is_recognised_and_read(tmp_path) -> None:
    rows = row("12:00:00", 0) + row("13:00:00", 1, (760, '"NAN"')) + row("14:00:00.5", 2, air='"NAN",971,"NAN"')
    log = read(tmp_path, HEADER + rows)
    assert detect_format(log.path).title == "Campbell Scientific table (TOA5)"
    assert (log.serial, log.metadata["station_name"], log.metadata["table"]) == ("10277", "farm, south", "Table1")
    second, third = log.records
    assert second.stamp_s == 1632315600.0
    assert second.tube_counts[0] == 760
    assert math.isnan(second.tube_counts[1])
    assert second.tube_live_s[0] == 3600
    assert (second.pressure_hpa, second.temperature_degc) == (972, 22.9)
    assert second.relative_humidity == pytest.approx(0.3263)
    assert (second.position.latitude_deg, second.position.longitude_deg) == (38.23461, -97.57095)
    assert third.tube_live_s == (3600.5, 3600.5)
    assert math.isnan(third.temperature_degc)
    assert kinds(log.problems) == [Kind.NO_LIVE_TIME, Kind.MISSING_TUBE, Kind.MISSING_VALUE, Kind.MISSING_VALUE]


def test_how_long_a_record_counted_after_starts_gaps_and_standstills(tmp_path) -> None:
    rows = [row("00:00:00", 5), row("01:00:00", 6), row("02:00:00", 7)]
    rows += [row("05:00:00", 10)]  # records 8 and 9 are missing: an hour
    rows += [row("09:00:00", 11)]  # the next record, four hours later: the logger stood still
    rows += [row("10:00:00", 12)]
    rows += [HEADER, row("10:40:00", 0), row("10:55:00", 1), row("11:10:00", 2)]  # a new program
    log = read(tmp_path, HEADER + "".join(rows))
    assert [(record.record_number, record.tube_live_s[0]) for record in log.records] == [
        (6, 3600), (7, 3600), (10, 3600), (12, 3600), (1, 900), (2, 900),
    ]  # fmt: skip
    lost = [problem.mistake.message for problem in log.problems if problem.lost]
    assert [message.partition(":")[0] for message in lost] == [
        "the logger has just started",
        "the logger stood still",
        "the logger has just started",
    ]
    assert Kind.ASSUMED_LIVE_TIME in kinds(log.problems)


def test_a_longer_interval_that_returns_is_accepted(tmp_path) -> None:
    clocks = ["00:00:00", "00:15:00", "00:30:00", "01:30:00", "02:30:00", "03:30:00"]
    log = read(tmp_path, HEADER + "".join(row(clock, number) for number, clock in enumerate(clocks)))
    assert [record.tube_live_s[0] for record in log.records] == [900, 900, 3600, 3600]


@pytest.mark.parametrize(
    ("unit", "written", "read_hpa", "kind"),
    [
        ("mBar", "972", 972.0, None),
        ("kPa", "97.2", 972.0, Kind.OTHER_UNIT),
        ("Pa", "97200", 972.0, Kind.OTHER_UNIT),
        ("", "972", 972.0, None),
        ("inches", "972", 972.0, Kind.OTHER_UNIT),
        ("Deg C", "972", math.nan, Kind.OTHER_UNIT),
    ],
)
def test_the_unit_in_the_header_has_priority(tmp_path, unit, written, read_hpa, kind) -> None:
    header = HEADER.replace('"mbar"', f'"{unit}"')
    rows = "".join(row(clock, n, air=f"22.9,{written},50") for n, clock in enumerate(["00:00:00", "01:00:00"]))
    log = read(tmp_path, header + rows)
    assert log.records[0].pressure_hpa == pytest.approx(read_hpa, nan_ok=True)
    assert (Kind.OTHER_UNIT in kinds(log.problems)) == (kind is not None)


def test_a_header_returns_without_harm_and_without_its_last_lines(tmp_path) -> None:
    torn = "".join(HEADER.splitlines(keepends=True)[:2])
    log = read(tmp_path, HEADER + row("00:00:00", 0) + row("01:00:00", 1) + torn + row("02:00:00", 2))
    assert [record.record_number for record in log.records] == [1, 2]
