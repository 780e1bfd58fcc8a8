# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drafts of logger formats: each loads, and reads its file."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.formats.draft import draft_format
from soilmoist_ros.sensing.formats.logger_format import load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import read_log


def table(names, row, *, rows=30, separator=",", head=""):
    lines = [separator.join(names)] if names else []
    lines += [row.format(n=n, day=1 + n // 24, hour=n % 24, count=1600 + 7 * n % 50) for n in range(rows)]
    return head + "\n".join(lines) + "\n"


SPREADSHEET = table(
    ("Datum", "Zeit", "Neutronen", "Messzeit_min", "Luftdruck_hPa", "Temperatur_C", "Feuchte"),
    "{day:02d}.05.2024;{hour:02d}:00:00;{count};60;985,{n};12,5;60,0",
    separator=";",
)
CAMPBELL = table(
    (),
    '"2024-05-{day:02d} {hour:02d}:00:00",{n},13.1,{count},{count},98.5,21.5,55',
    head='"TOA5","KS1","CR300","1","OS","CPU:a","2","Hours"\n"TIMESTAMP","REC","Batt_V","MOD_1_Tot",'
    '"MOD_2_Tot","BP_Avg","AirTC_Avg","RH"\n"TS","RN","V","","","kPa","Deg C","%"\n'
    '"","","Min","Tot","Tot","Avg","Avg","Smp"\n',
)
ROVER = table(
    (),
    "{n}, 2024/05/{day:02d} {hour:02d}:00:00, 1002.0, 24.1, 44, {count}, 800, {count}, 800, 3600, 3600, 0120000,"
    " 5121.0, N, 01225.8, E, 112, 1",
    head="//Logger\n//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N2Cts,N3Cts,N4Cts,N1ETsec,N3ETsec,\n"
    "//GpsUTC, LatDec, NS, LongDec, EW, Alt, Qual\n",
)


def read(tmp_path, text, **options):
    path = tmp_path / "some.txt"
    path.write_text(text, encoding="utf-8")
    draft = tmp_path / "draft.yaml"
    draft.write_text(draft_format(path, **options), encoding="utf-8")
    return draft.read_text(encoding="utf-8"), read_log(path, load_logger_format(draft), "east")


def test_a_spreadsheet_with_decimal_commas(tmp_path):
    draft, log = read(tmp_path, SPREADSHEET)
    first = log.records[0]
    assert (len(log.records), first.tube_counts, first.tube_live_s) == (30, (1600,), (3600,))
    assert (first.pressure_hpa, first.temperature_degc, first.relative_humidity) == (985.0, 12.5, 0.6)
    assert datetime.fromtimestamp(first.stamp_s, UTC) == datetime(2024, 5, 1, tzinfo=UTC)
    assert 'columns: ["Datum + Zeit"]' in draft
    assert "QUESTION: UTC?" in draft


def test_a_table_of_campbell(tmp_path):
    draft, log = read(tmp_path, CAMPBELL)
    first = log.records[0]
    assert (first.tube_counts, first.pressure_hpa, first.temperature_degc) == ((1600, 1600), 985.0, 21.5)
    assert "QUESTION: is one of the tubes bare" in draft


def test_a_rover_with_two_header_lines_letters_and_shared_live_times(tmp_path):
    draft, log = read(tmp_path, ROVER)
    first = log.records[0]
    assert (first.tube_counts, first.tube_live_s) == ((1600, 800, 1600, 800), (3600,) * 4)
    assert first.position is not None
    assert (first.position.latitude_deg, first.position.longitude_deg) == pytest.approx((51.35, 12.43))
    assert "covers: 2" in draft


def test_epoch_times_a_bare_detector_and_pascal(tmp_path):
    rows = [f"{1714557600 + 600 * n}\t800\t{1600 + n}\t599\t-33.5\t-70.6\t98500" for n in range(30)]
    text = "stamp\tcounts_bare\tcounts_moderated\tlive_s\tlat\tlon\tp_Pa\n" + "\n".join(rows) + "\n"
    draft, log = read(tmp_path, text)
    first = log.records[0]
    assert (first.stamp_s, first.tube_counts, first.tube_live_s) == (1714557600.0, (1600,), (599,))
    assert first.pressure_hpa == 985.0
    assert first.position is not None
    assert first.position.longitude_deg == -70.6
    assert "Not added, as bare (thermal): counts_bare." in draft


def test_either_order_of_day_and_month_stays_a_question(tmp_path):
    text = table(("time", "neutrons"), "05/01/2024 {hour:02d}:00,{count}", rows=20)
    path = tmp_path / "some.csv"
    path.write_text(text)
    assert "QUESTION: day_first or month_first?" in draft_format(path)
    with pytest.raises(InputError, match=r"5 January 2024 .* or 1 May 2024"):
        read(tmp_path, text)


def test_what_must_be_answered_first(tmp_path):
    text = table((), "2024-05-{day:02d} {hour:02d}:00,983.{n},{count},700")
    with pytest.raises(InputError, match=r"no column that is .* raw counts .* --neutrons NAME.*column3 \(1600\)"):
        read(tmp_path, text)
    draft, log = read(tmp_path, text, counts=("column3", "column4"))
    assert log.records[0].tube_counts == (1600, 700)
    assert "QUESTION: the file does not name its columns" in draft
    with pytest.raises(InputError, match=r"only corrected or smoothed ones \(neutrons_corrected\)"):
        read(tmp_path, table(("time", "neutrons_corrected"), "2024-05-{day:02d} {hour:02d}:00,{count}.5"))
    with pytest.raises(InputError, match=r"no column that is read as a time.*--time DATE --time TIME"):
        read(tmp_path, table(("a", "neutrons"), "x{n},{count}"))
    with pytest.raises(InputError, match=r"there is no column 'c' -> the columns are a, neutrons"):
        read(tmp_path, table(("a", "neutrons"), "{n},{count}"), time=("c",))


def test_the_command_writes_a_draft_that_check_reads(tmp_path):
    log, draft = tmp_path / "log.csv", tmp_path / "draft.yaml"
    log.write_text(SPREADSHEET)
    result = CliRunner().invoke(main, ["logger", str(log), "--out", str(draft)])
    assert result.exit_code == 0, result.output
    assert "questions in it; then: soilmoist check --log" in result.output
    assert CliRunner().invoke(main, ["logger", str(log), "--out", str(draft)]).exit_code == 2
    result = CliRunner().invoke(main, ["check", "--log", str(log), "--logger", str(draft)])
    assert (
        "record      line 2: 2024-05-01 00:00:00 UTC; 1600 counts in 3600 s; 985.0 hPa; 12.5 degC; 60%"
        in result.output
    )


@pytest.mark.parametrize(
    ("names", "unit_row", "expected"),
    [
        (("neutrons [1/h]", "P (inHg)", "Temp (F)", "RH"), "", ("counts_per_hour", "inHg", "degF")),
        (("neutron_counts_per_hour", "press", "temp", "RH"), "", ("counts_per_hour", "inHg", "degF")),
        (("n_counts", "pressure", "temp", "RH"), "UTC,1/h,inHg,°F,%", ("counts_per_hour", "inHg", "degF")),
    ],
)
def test_units_of_the_header_decide_and_rates_are_no_counts(tmp_path, names, unit_row, expected):
    row = "2024-05-{day:02d} {hour:02d}:00:00,{count},29.53,50.0,55"
    draft, log = read(
        tmp_path,
        table(("time", *names), row, head="").replace("RH\n", f"RH\n{unit_row}\n" if unit_row else "RH\n"),
    )
    first = log.records[0]
    assert all(f"unit: {unit}" in draft for unit in expected)
    assert (first.tube_counts, first.tube_live_s) == ((1600,), (3600,))
    assert first.pressure_hpa == pytest.approx(1000.0, abs=0.1)
    assert first.temperature_degc == pytest.approx(10.0)


def test_a_draft_doubts_corrected_counts_dry_air_and_units_that_fit_nothing(tmp_path):
    names = ("time_utc", "CTS_MOD_CORR", "P (psi)", "RH", "T")
    draft, _ = read(
        tmp_path, table(names, "2024-05-{day:02d} {hour:02d}:00:00,{count},14.5,9.7,12"), counts=["CTS_MOD_CORR"]
    )
    assert "QUESTION: raw counts? By its name they are corrected" in draft
    assert "QUESTION: relative humidity of the outside air? Its median, 9.7 %, is low" in draft
    assert "QUESTION: which unit? No unit of the pressure fits the median of P (psi) (14.5)" in draft
    assert "switched off" not in draft
