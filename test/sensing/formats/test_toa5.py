# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of Campbell Scientific loggers (TOA5): quotes, four header lines, restarts; also log_header and units."""

import math
from pathlib import Path

import pytest

from soilmoist_ros.sensing.formats import log_values as units
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import Kind, LogFile, detect_format, read_log

HEADER = """\
"TOA5","farm, south","CR300","10277","CR300.Std.10.04","CPU:probe.CR300","37658","Table1"
"TIMESTAMP","RECORD","station","latitude","longitude","altitude","counts_1_Tot","counts_2_Tot","air_temperature_Avg",\
"barometric_pressure_Avg","relative_humidity_Avg"
"TS","RN","name","decdegrees","decdegrees","m","counts","counts","celsius","mbar","%"
"","","Smp","Smp","Smp","Smp","Tot","Tot","Avg","Avg","Avg"
"""


def row(clock: str, number: int, counts: tuple[object, object] = (755, 870), air: str = "22.9,972,32.63") -> str:
    return f'"2021-09-22 {clock}",{number},"KS,003",38.23461,-97.57095,455,{counts[0]},{counts[1]},{air}\n'


def read(tmp_path: Path, text: str, logger: str | None = None) -> LogFile:
    path = tmp_path / "table.dat"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    return read_log(path, logger)


def kinds(log: LogFile) -> list[Kind]:
    return [problem.kind for problem in log.problems]


def test_a_table_is_recognised_and_read(tmp_path) -> None:
    rows = row("12:00:00", 0) + row("13:00:00", 1, (760, '"NAN"')) + row("14:00:00.5", 2, air='"NAN",971,"NAN"')
    log = read(tmp_path, HEADER + rows)
    assert detect_format(tmp_path / "table.dat").title == "Campbell Scientific table (TOA5)"
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
    assert kinds(log) == [Kind.NO_LIVE_TIME, Kind.MISSING_TUBE, Kind.MISSING_VALUE, Kind.MISSING_VALUE]


def test_how_long_a_record_counted_after_starts_gaps_and_standstills(tmp_path) -> None:
    rows = [row("00:00:00", 5), row("01:00:00", 6), row("02:00:00", 7)]
    rows += [row("05:00:00", 10)]  # records 8 and 9 are missing: an hour
    rows += [row("09:00:00", 11)]  # the next record, four hours later: the logger stood still
    rows += [row("10:00:00", 12)]
    rows += [HEADER, row("10:40:00", 0), row("10:55:00", 1), row("11:10:00", 2)]  # a new program
    log = read(tmp_path, HEADER + "".join(rows))
    assert [(record.record_number, record.tube_live_s[0]) for record in log.records] == [
        (6, 3600),
        (7, 3600),
        (10, 3600),
        (12, 3600),
        (1, 900),
        (2, 900),
    ]
    lost = [problem.mistake.message for problem in log.problems if problem.lost]
    assert [message.partition(":")[0] for message in lost] == [
        "the logger has just started",
        "the logger stood still",
        "the logger has just started",
    ]
    assert Kind.ASSUMED_LIVE_TIME in kinds(log)


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
    assert (Kind.OTHER_UNIT in kinds(log)) == (kind is not None)


def test_a_header_returns_without_harm_and_without_its_last_lines(tmp_path) -> None:
    torn = "".join(HEADER.splitlines(keepends=True)[:2])
    log = read(tmp_path, HEADER + row("00:00:00", 0) + row("01:00:00", 1) + torn + row("02:00:00", 2))
    assert [record.record_number for record in log.records] == [1, 2]


def test_the_clock_of_the_site_has_priority() -> None:
    logger = load_logger_format("toa5")
    assert logger.on_clock(None) is logger
    assert logger.on_clock(-6.0).time.utc_offset_hours == -6.0
    assert logger.time.utc_offset_hours == 0.0


def test_a_quoted_csv_of_another_logger(tmp_path) -> None:
    logger = LoggerFormat.model_validate(
        {
            "title": "mine",
            "source": "a test",
            "delimiter": "semicolon",
            "header": {},
            "time": {"columns": ["time"], "formats": ["iso8601"]},
            "counts": {"columns": ["n"]},
            "record_period": {"default_s": 600},
        }
    )
    path = tmp_path / "a.csv"
    path.write_text('"time";"note; free";"n"\n"2021-09-22 12:00";"rain; ""heavy""";"7"\n')
    (record,) = read_log(path, logger).records
    assert record.tube_counts == (7,)


def test_units_are_known_by_their_spellings() -> None:
    assert [units.canonical(text) for text in ("°C", "[hPa]", "millibar", "%", "kPa", "bogus")] == [
        "degC",
        "hPa",
        "mbar",
        "percent",
        "kPa",
        "",
    ]


def test_one_live_time_holds_for_all_tubes(tmp_path) -> None:
    path = tmp_path / "table.dat"
    head = [
        '"TOA5","a","b","1","os","p","s","t"',
        '"TIMESTAMP","N1Cts","N2Cts","N1ET_sec"',
        '"TS","","",""',
        '"","Tot","Tot",""',
    ]
    path.write_text("\n".join([*head, *(f'"2024-05-01 0{hour}:00:00",900,880,3598' for hour in range(3))]) + "\n")
    assert [record.tube_live_s for record in read_log(path).records] == [(3598.0, 3598.0)] * 3
