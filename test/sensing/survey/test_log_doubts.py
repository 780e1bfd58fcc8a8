# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from soilmoist_ros.sensing.checks.weather import unlikely_weather
from soilmoist_ros.sensing.formats.logger_format import load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import read_log
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.survey.logs import log_doubts

FINAPP = "Datetime,neutrons,integration_time(s),pressure(hPa)\n"
CRS1000 = "//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N2Cts,N1ET_sec,N2ET_sec\n"


def doubts(tmp_path, text, **options):
    path = tmp_path / "some.csv"
    path.write_text(text)
    return [(one.kind, str(one)) for one in log_doubts([read_log(path, **options)])]


def night(hours):
    return FINAPP + "".join(f"2023-10-{stamp}:00:00,17{n:02d},3600,1000\n" for n, stamp in enumerate(hours))


def test_more_hours_of_counts_than_of_time(tmp_path):
    hours = [f"28 {hour:02d}" for hour in range(14, 24)] + [f"29 {hour:02d}" for hour in (0, 1, 2, 2, 3, 4, 5)]
    (found,) = doubts(tmp_path, night(hours), utc_offset_hours=2.0)
    assert found[0] is Kind.OVERLAP
    assert "17 h were counted in the 16 h from 2023-10-28 12:00 UTC to 2023-10-29 03:00 UTC" in found[1]
    assert "logger_time_zone: Europe/Berlin" in found[1]
    assert doubts(tmp_path, night(hours), utc_offset_hours="Europe/Berlin") == []


def test_live_times_in_another_unit(tmp_path):
    text = FINAPP + "".join(f"2023-10-28 {hour:02d}:00:00,1700,60,1000\n" for hour in range(9))
    (found,) = doubts(tmp_path, text)
    assert "records count 60 s, 1/60 of the time between them: the live time may be in minutes" in found[1]
    text = FINAPP + "".join(f"2023-10-28 {hour:02d}:00:00,1700,36000,1000\n" for hour in range(9))
    (found,) = doubts(tmp_path, text)
    assert "check live_time and record_period of the logger format" in found[1]


def test_days_that_jump_by_months(tmp_path):
    text = FINAPP + "".join(f"2024-{month:02d}-05 {hour:02d}:00:00,1700,3600,1000\n"
                            for month in range(1, 8) for hour in range(9))  # fmt: skip
    (found,) = doubts(tmp_path, text)
    assert found[0] is Kind.MONTHS_APART
    assert "lie on 7 days, 6 times a month or more apart, as 2024-01-05 and 2024-02-05" in found[1]


@pytest.mark.parametrize(("second", "n_doubts"), [(178, 1), (77, 0)])
def test_the_tube_that_is_left_out_counts_more(tmp_path, second, n_doubts):
    rows = "".join(f"{n}, 2018/01/08 {n:02d}:03:00, 1000, 9, 80, 91, {second}, 900, 900\n" for n in range(8))
    found = doubts(tmp_path, CRS1000 + rows)
    assert len(found) == n_doubts
    assert all("tube 2, which the format leaves out, counts 1.96 times what tube 1" in one for _, one in found)


def test_a_repeated_record_counts_once_in_the_tube_that_is_left_out(tmp_path):
    rows = "".join(f"{n}, 2018/01/08 {n:02d}:03:00, 1000, 9, 80, 91, 178, 900, 900\n" for n in range(8))
    (found,) = doubts(tmp_path, CRS1000 + rows + rows)
    assert "tube 2, which the format leaves out, counts 1.96 times what tube 1" in found[1]


@pytest.mark.parametrize(
    ("name", "factor", "why"),
    [("neutrons", 60, "all are multiples of 60"), ("neutrons/h", 1, "so the header says"), ("neutrons", 1, "")],
)
def test_counts_that_are_a_rate(tmp_path, name, factor, why):
    form = load_logger_format("finapp")
    counts = form.counts.model_copy(update={"columns": [name]})
    rows = "".join(f"2024-05-01 00:{n:02d}:00,{factor * (230 + n * n % 31)},60,1000\n" for n in range(25))
    text = FINAPP.replace("neutrons", name) + rows
    found = doubts(tmp_path, text, logger=form.model_copy(update={"counts": counts}))
    assert [kind for kind, _ in found] == [Kind.NOT_COUNTS] * bool(why)
    assert all(why in text and "write 'unit: counts_per_hour' below 'counts'" in text for _, text in found)


def test_corrected_counts_are_doubted_though_they_are_whole(tmp_path):
    form = load_logger_format("finapp")
    form = form.model_copy(update={"counts": form.counts.model_copy(update={"columns": ["CTS_MOD_CORR"]})})
    text = night(f"28 {hour:02d}" for hour in range(9)).replace("neutrons", "CTS_MOD_CORR")
    (found,) = doubts(tmp_path, text, logger=form)
    assert "by their name, CTS_MOD_CORR are corrected or smoothed: they would be corrected twice" in found[1]


@pytest.mark.parametrize(("humidity", "doubt"), [(9.7, "if it is absolute humidity"), (55, "")])
def test_air_that_is_too_dry_for_a_survey(tmp_path, humidity, doubt):
    path = tmp_path / "some.csv"
    rows = "".join(f"2023-10-28 {hour:02d}:00:00,1700,3600,1000,{humidity}\n" for hour in range(12))
    path.write_text(FINAPP.replace(")\n", "),ur(%)\n") + rows)
    found = unlikely_weather(read_log(path).records)
    assert [doubt in one.remedy for one in found] == [True] * bool(doubt)
