# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drafts of logger formats: each loads, and reads its file."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing import draft_format, load_logger_format, read_log


def table(names, row, *, rows=30, separator=",", head=""):
    lines = [separator.join(names)] if names else []
    lines += [row.format(n=n, day=1 + n // 24, hour=n % 24, count=1600 + 7 * n % 50) for n in range(rows)]
    return head + "\n".join(lines) + "\n"


SPREADSHEET = table(
    ("Datum", "Zeit", "Neutronen", "Messzeit_min", "Luftdruck_hPa", "Temperatur_C", "Feuchte"),
    "{day:02d}.05.2024;{hour:02d}:00:00;{count};60;985,{n};12,5;60,0", separator=";",
)  # fmt: skip
CAMPBELL = table(
    (),
    '"2024-05-{day:02d} {hour:02d}:00:00",{n},13.1,{count},{count},98.5,21.5,55',
    head='"TOA5","KS1","CR300","1","OS","CPU:a","2","Hours"\n"TIMESTAMP","REC","Batt_V","MOD_1_Tot",'
    '"MOD_2_Tot","BP_Avg","AirTC_Avg","RH"\n"TS","RN","V","","","kPa","Deg C","%"\n'
    '"","","Min","Tot","Tot","Avg","Avg","Smp"\n',
)
EPOCH = "stamp\tcounts_bare\tcounts_moderated\tlive_s\tlat\tlon\tp_Pa\n" + "".join(
    f"{1714557600 + 600 * n}\t800\t{1600 + n}\t599\t-33.5\t-70.6\t98500\n" for n in range(30)
)


def read(tmp_path, text, **options):
    path = tmp_path / "some.txt"
    path.write_text(text, encoding="utf-8")
    draft = tmp_path / "draft.yaml"
    draft.write_text(draft_format(path, **options), encoding="utf-8")
    return draft.read_text(encoding="utf-8"), read_log(path, load_logger_format(draft), "east")


@pytest.mark.parametrize(
    ("text", "counts", "live_s", "pressure", "temperature", "stamp", "said"),
    [
        (SPREADSHEET, (1600,), 3600, 985.0, 12.5, datetime(2024, 5, 1, tzinfo=UTC), "Datum + Zeit"),
        (CAMPBELL, (1600, 1600), 3600, 985.0, 21.5, datetime(2024, 5, 1, tzinfo=UTC), "left_out: [2]"),
        (EPOCH, (1600,), 599, 985.0, None, datetime(2024, 5, 1, 10, tzinfo=UTC), "Not used: counts_bare"),
    ],
)  # fmt: skip
def test_drafts_read_their_files(tmp_path, text, counts, live_s, pressure, temperature, stamp, said):
    draft, log = read(tmp_path, text)
    first = log.records[0]
    assert (len(log.records), first.tube_counts, first.tube_live_s[0]) == (30, counts, live_s)
    assert first.pressure_hpa == pressure
    assert temperature is None or first.temperature_degc == temperature
    assert datetime.fromtimestamp(first.stamp_s, UTC) == stamp
    assert said in draft
    if text is EPOCH:
        assert first.position is not None
        assert (first.position.latitude_deg, first.position.longitude_deg) == (-33.5, -70.6)


def test_either_order_of_day_and_month_stays_a_question(tmp_path):
    text = table(("time", "neutrons"), "05/01/2024 {hour:02d}:00,{count}", rows=20)
    with pytest.raises(InputError, match=r"5 January 2024 .* or 1 May 2024"):
        read(tmp_path, text)
    assert "QUESTION: day_first or month_first?" in (tmp_path / "draft.yaml").read_text()


def test_tubes_that_share_live_times_and_detectors_that_are_left_out(tmp_path):
    names = ("time", "n1", "n2", "n3", "n4", "n1et_sec", "n3et_sec")
    stamp = "2024-05-{day:02d} {hour:02d}:00:00"
    _, log = read(tmp_path, table(names, f"{stamp},{{count}},800,{{count}},800,3500,3400"))
    assert log.records[0].tube_live_s == (3500, 3500, 3400, 3400)
    names = ("time", "unmoderated_counts", "thermal_counts", "epithermal_counts", "top_counts")
    draft, log = read(tmp_path, table(names, f"{stamp},700,800,{{count}},900"))
    assert log.records[0].tube_counts == (1600,)
    assert "QUESTION: only epithermal_counts is read, not top_counts?" in draft


def test_a_real_station_counts_no_lightning_and_measures_the_air():
    draft = yaml.safe_load(draft_format(Path(__file__).parents[3] / "examples" / "station_kansas_2021-10.dat"))
    assert draft["counts"]["columns"] == ["counts_{tube}_Tot"]
    assert [sensor["column"] for sensor in draft["humidity"]["sensors"]] == ["relative_humidity_Avg"]
    assert draft["temperature"]["sensors"][0]["column"] == "air_temperature_Avg"


@pytest.mark.parametrize(("longitude", "found"), [("262.400", -97.6), ("97.6W", -97.6), ("-97.6", -97.6)])
def test_outdoor_sensors_come_first_and_longitudes_have_their_sign(tmp_path, longitude, found):
    names = ("time", "neutrons", "temperature_in(C)", "temperature_ext(C)", "ur(%)", "latitude", "longitude")
    row = f"2024-05-{{day:02d}} {{hour:02d}}:00:00,{{count}},20,15,60,43.6,{longitude}"
    first = read(tmp_path, table(names, row))[1].records[0]
    assert (first.temperature_degc, first.relative_humidity) == (15.0, 0.6)
    assert first.position is not None
    assert first.position.longitude_deg == pytest.approx(found)


def test_what_must_be_answered_first(tmp_path):
    text = table((), "2024-05-{day:02d} {hour:02d}:00,983.{n},{count},700")
    with pytest.raises(InputError, match=r"no column that is .* raw counts .* --neutrons NAME.*column3 \(1600\)"):
        read(tmp_path, text)
    _, log = read(tmp_path, text, counts=["column3"])
    assert log.records[0].tube_counts == (1600,)
    with pytest.raises(InputError, match=r"no column that is .* raw counts"):
        read(tmp_path, table(("time", "neutrons_corrected"), "2024-05-{day:02d} {hour:02d}:00,{count}.5"))
    with pytest.raises(InputError, match=r"no column that is read as a time.*--time DATE --time TIME"):
        read(tmp_path, table(("a", "neutrons"), "x{n},{count}"))
    with pytest.raises(InputError, match=r"there is no column 'c' with values -> the columns are a, neutrons"):
        read(tmp_path, table(("a", "neutrons"), "{n},{count}"), time=("c",))


def test_the_command_writes_a_draft_that_check_reads(tmp_path):
    log, draft = tmp_path / "log.csv", tmp_path / "draft.yaml"
    log.write_text(SPREADSHEET)
    result = CliRunner().invoke(main, ["logger", str(log), "--out", str(draft)])
    assert result.exit_code == 0, result.output
    assert "questions in it; then: soilmoist check --log" in result.output
    assert CliRunner().invoke(main, ["logger", str(log), "--out", str(draft)]).exit_code == 2
    result = CliRunner().invoke(main, ["check", "--log", str(log), "--logger", str(draft)])
    assert "2024-05-01 00:00:00 UTC; 1600 counts in 3600 s; 985.0 hPa; 12.5 degC; 60%" in result.output


@pytest.mark.parametrize(
    ("names", "unit_row"),
    [
        (("neutrons [1/h]", "P (inHg)", "Temp (F)", "RH"), ""),
        (("n_counts", "pressure", "temp", "RH"), "UTC,1/h,inHg,°F,%\n"),
    ],
)
def test_units_of_the_header_decide_and_rates_are_no_counts(tmp_path, names, unit_row):
    row = "2024-05-{day:02d} {hour:02d}:00:00,{count},29.53,50.0,55"
    draft, log = read(tmp_path, table(("time", *names), row).replace("RH\n", f"RH\n{unit_row}"))
    first = log.records[0]
    assert all(f"unit: {unit}" in draft for unit in ("counts_per_hour", "inHg", "degF"))
    assert (first.tube_counts, first.tube_live_s) == ((1600,), (3600,))
    assert first.pressure_hpa == pytest.approx(1000.0, abs=0.1)
    assert first.temperature_degc == pytest.approx(10.0)


def test_a_unit_that_fits_nothing_is_a_question(tmp_path):
    text = table(
        ("time_utc", "neutrons", "P (psi)", "RH", "T"), "2024-05-{day:02d} {hour:02d}:00:00,{count},14.5,55,12"
    )
    draft, log = read(tmp_path, text)
    assert "QUESTION: which unit? The header says psi, the median is 14.5" in draft
    assert log.records[0].pressure_hpa != log.records[0].pressure_hpa


def test_names_in_two_comment_lines_are_one_header():
    path = Path(__file__).parents[3] / "examples" / "rover_gypsum_transect_2018-05-01.KSU"
    draft = yaml.safe_load(draft_format(path))
    assert draft["header"] == {"comment": "//", "continued_by": ["GpsUTC"]}
    assert draft["counts"]["columns"] == ["N{tube}Cts"]
    assert draft["position"]["latitude"] == ["LatDec"]
