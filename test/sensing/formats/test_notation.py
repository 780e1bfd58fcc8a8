# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Notations that a file decides once: dates, decimals, coordinates, separators, time zones."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Kind, LogFile, LoggerFormat, read_log
from soilmoist_ros.sensing.formats.logger_reader import RecordParser

FINAPP = "Datetime,neutrons,integration_time(s),temperature_ext(C),ur(%),pressure(hPa)"
ROVER = """\
//Recordperiod = 1 minutes.
//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N1ETsec,
//GpsUTC, LatDec,{} LongDec,{} Alt, Qual
"""


def table(**changes) -> LoggerFormat:
    """A format of a table with day, counts N and pressure p in hours."""
    settings = {
        "title": "table", "source": "a test", "header": {},
        "time": {"columns": ["day"], "formats": ["%Y-%m-%d %H:%M"]}, "counts": {"columns": ["N"]},
        "record_period": {"default_s": 3600}, "pressure": {"sensors": [{"column": "p", "unit": "hPa"}]},
    }  # fmt: skip
    return LoggerFormat.model_validate({**settings, **changes})


def read(tmp_path: Path, text: str | bytes, logger=None, **options) -> LogFile:
    path = tmp_path / "some.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_log(path, logger, **options)


def days(log: LogFile) -> list[str]:
    return sorted({f"{datetime.fromtimestamp(one.stamp_s, UTC):%Y-%m-%d}" for one in log.records})


def hourly(form: str, begin: datetime, hours: int) -> str:
    rows = [f"{begin + timedelta(hours=hour):{form}},1700,3600,15,60,1000" for hour in range(hours)]
    return "\n".join([FINAPP, *rows]) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "n_days", "why"),
    [
        ("%m/%d/%Y %H:%M:%S", 10, "'05/02/2024 00:00:00' in line 26 would else lie a month or more"),
        ("%m/%d/%Y %H:%M:%S", 20, "'05/13/2024 00:00:00' in line 290 has no other reading"),
        ("%d/%m/%Y %H:%M:%S", 10, "'02/05/2024 00:00:00' in line 26 would else"),
        ("%d/%m/%Y %H:%M", 20, "'13/05/2024 00:00' in line 290"),
        ("%m/%d/%Y %I:%M:%S %p", 20, "'05/13/2024 12:00:00 AM' in line 290"),
    ],
)
def test_the_order_of_day_and_month_is_decided_once_for_a_file(tmp_path, form, n_days, why) -> None:
    log = read(tmp_path, hourly(form, datetime(2024, 5, 1), 24 * n_days))
    assert len(log.records) == 24 * n_days
    assert days(log) == [f"2024-05-{day:02d}" for day in range(1, n_days + 1)]
    assert why in log.choices[0]


def test_a_file_that_does_not_decide_is_refused_with_both_readings(tmp_path) -> None:
    text = hourly("%m/%d/%Y %H:%M:%S", datetime(2024, 5, 1), 20)
    message = r"some.csv:2: .* is 5 January 2024 .* or 1 May 2024 .* -> write 'date_order: day_first'"
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_a_file_with_dates_in_both_orders_is_refused(tmp_path) -> None:
    text = hourly("%d/%m/%Y %H:%M", datetime(2024, 5, 1), 24 * 12)
    text += hourly("%m/%d/%Y %H:%M", datetime(2024, 5, 13), 24 * 8).partition("\n")[2]
    with pytest.raises(
        InputError, match=r"dates are in both orders: day before month in line 26 and month .* 290"
    ):
        read(tmp_path, text)


def test_the_format_decides_where_the_file_does_not(tmp_path) -> None:
    time = {"columns": ["day"], "formats": ["%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M"]}
    text = "day,N,p\n05/01/2024 10:00,1700,1000\n"
    for order, day in (("day_first", "2024-01-05"), ("month_first", "2024-05-01")):
        assert days(read(tmp_path, text, table(time={**time, "date_order": order}))) == [day]


def test_a_stream_needs_the_order_in_its_format() -> None:
    time = {"columns": ["day"], "formats": ["%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M", "iso8601"]}
    parser = RecordParser(table(time=time))
    stamps = (b"05/01/2024 10:00", b"2024-05-13 10:00", b"05/13/2024 10:00")
    found = [parser.feed(line) for line in (b"day,N,p", *(stamp + b",9,1000" for stamp in stamps))]
    assert [one is not None for one in found] == [False, False, True, False]
    assert [problem.kind for problem in parser.problems] == [Kind.BAD_TIME] * 2
    assert "write 'date_order: day_first' or" in parser.problems[0].mistake.remedy


@pytest.mark.parametrize(
    ("delimiter", "rows", "counts", "pressures", "choice"),
    [
        (";", ["1700;985,0", "1721;985,1"], [1700, 1721], [985.0, 985.1], "decimal commas"),
        ("\t", ["1.700\t985,25", "1721\t985,1"], [1700, 1721], [985.25, 985.1], "decimal commas"),
        (";", ["1\u00a0700;1\u202f001,0", "1\u202f721;985,1"], [1700, 1721], [1001.0, 985.1], "decimal commas"),
        (",", ['"1,700",985.0', '"1,721",1013.5'], [1700, 1721], [985.0, 1013.5], "commas separate thousands"),
        (",", ['"1,700","1,013.25"', '985,"1,013"'], [1700, 985], [1013.25, 1013.0], "commas separate thousands"),
    ],
)
def test_decimal_commas_and_thousands(tmp_path, delimiter, rows, counts, pressures, choice) -> None:
    lines = [f"2024-05-01 {hour:02d}:00{delimiter}{row}" for hour, row in enumerate(rows)]
    log = read(tmp_path, "\n".join([delimiter.join(("day", "N", "p")), *lines]) + "\n", table())
    assert [one.tube_counts[0] for one in log.records] == counts
    assert [one.pressure_hpa for one in log.records] == pressures
    assert any(choice in one for one in log.choices)


def test_a_number_that_can_be_of_both_kinds_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match=r"csv:2 \[p\]: '1,013' can be 1013 or 1.013.*'decimal: comma'"):
        read(tmp_path, "day;N;p\n2024-05-01 00:00;170;1,013\n", table())
    log = read(tmp_path, "day;N;p\n2024-05-01 00:00;170;1,013\n", table(decimal="point"))
    assert log.records[0].pressure_hpa == 1013


@pytest.mark.parametrize(
    ("names", "latitude", "longitude"),
    [
        (("", ""), "5121.0000,N", "01225.8000,E"),
        ((" NS,", " EW,"), "5121.0000,N", "01225.8000,E"),
        (("", ""), "5121.0000N", "01225.8000E"),
        (("", ""), "51 21.000 N", "12 25.800 E"),
        (("", ""), "51.35", "12.43"),
        ((" NS,", " EW,"), "51.35,N", "12.43,E"),
        (("", ""), "N51°21.0'", "E12°25'48\""),
    ],
)
def test_notations_of_coordinates(tmp_path, names, latitude, longitude) -> None:
    rows = [
        f"{n}, 2016/08/01 09:{n:02d}:30, 1002, 24, 44, 145, 60, 00900{n:02d}, {latitude},{longitude},112,1\n"
        for n in range(1, 5)
    ]
    log = read(tmp_path, ROVER.format(*names) + "".join(rows), "hydroinnova_rover", longitude="east")
    assert len(log.records) == 4
    for record in log.records:
        assert record.position is not None
        assert (record.position.latitude_deg, record.position.longitude_deg) == pytest.approx((51.35, 12.43))
        assert record.position.altitude_m == 112


def test_southern_letters_and_longitudes_to_360(tmp_path) -> None:
    rows = [f"2024-05-01 10:0{n}:00,900,60,18,50,1000,{n + 43}.6 S,262.4" for n in range(3)]
    log = read(tmp_path, "\n".join([FINAPP + ",latitude,longitude", *rows]) + "\n")
    places = [(one.position.latitude_deg, one.position.longitude_deg) for one in log.records if one.position]
    assert places == [pytest.approx((-43.6 - n, -97.6)) for n in range(3)]
    assert "longitudes count from 0 to 360, as in line 2: '262.4' is -97.60000 degrees" in log.choices
    assert "letters N, S, E or W follow the coordinates and give their sign" in log.choices


def test_one_odd_coordinate_is_named_with_its_value_and_line(tmp_path) -> None:
    rows = [f"2024-05-01 10:0{n}:00,900,60,18,50,1000,{'5121.0' if n == 2 else '51.35'},12.4" for n in range(4)]
    log = read(tmp_path, "\n".join([FINAPP + ",latitude,longitude", *rows]) + "\n")
    assert [record.position is None for record in log.records] == [False, False, True, False]
    (problem,) = log.problems
    assert problem.kind is Kind.BAD_POSITION
    assert (problem.mistake.line, problem.mistake.column) == (4, "latitude")
    assert "'5121.0' is no latitude" in problem.mistake.message
    assert "as degrees_minutes it is 51.35000" in problem.mistake.remedy


def test_a_time_zone_by_name_in_autumn_and_in_spring(tmp_path) -> None:
    times = ["2023-10-29 01:00", "2023-10-29 02:00", "2023-10-29 02:00", "2023-10-29 03:00", "2024-03-31 02:30"]
    text = "\n".join([FINAPP, *(f"{time}:00,17{n}0,3600,15,60,1000" for n, time in enumerate(times))]) + "\n"
    log = read(tmp_path, text, utc_offset_hours="Europe/Berlin")
    assert [f"{datetime.fromtimestamp(one.stamp_s, UTC):%d %H:%M}" for one in log.records[:4]] == [
        "28 23:00", "29 00:00", "29 01:00", "29 02:00",
    ]  # fmt: skip
    doubts = [problem.mistake.message for problem in log.problems if problem.kind is Kind.LOCAL_TIME]
    assert [text.partition(": ")[2] for text in doubts] == [
        "read as the first", "read as the second", "this clock does not change to summer time as its zone does",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "value", "counts"),
    [("counts_per_hour", "1648.779197", 1649), ("counts_per_minute", "27.5", 1650), ("counts", "1,650", 1650)],
)
def test_rates_and_empty_columns_at_the_end(tmp_path, unit, value, counts) -> None:
    quoted = f'"{value}"' if "," in value else value
    rows = [f"2019-05-31 {hour:02d}:00,{quoted},,," for hour in range(20)]
    log = read(tmp_path, "\n".join(["day,N,,,", *rows]) + "\n", table(counts={"columns": ["N"], "unit": unit}))
    assert [one.tube_counts[0] for one in log.records] == [counts] * 20


def test_zero_bytes_of_a_power_cut_cost_the_damaged_lines_only(tmp_path) -> None:
    rows = [f"2024-05-01 {hour:02d}:00,170{hour},1000\n".encode() for hour in range(6)]
    rows[2] = rows[2][:9] + bytes(70_000)
    log = read(tmp_path, b"day,N,p\n" + b"".join(rows), table())
    assert [one.tube_counts[0] for one in log.records] == [1700, 1701, 1703, 1704, 1705]
    assert [problem.kind for problem in log.problems] == [Kind.TRUNCATED]
    start = read(tmp_path, bytes(9_000) + b"day,N,p\n" + rows[0], table())
    assert len(start.records) == 1
