# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a mission."""

import csv
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.plain_values import csv_text, text_of_csv
from soilmoist_ros.reporting.files.mission_tables import write_visits
from soilmoist_ros.reporting.opened_run import OpenedRun


def test_times_of_day_keep_their_milliseconds(tmp_path):
    stamp_s = 1_780_293_679.685
    visit = Visit("a", 1.0, 2.0, 79.685, 60.0, 262, "middle", arrival_stamp_s=stamp_s)
    path = write_visits(tmp_path / "visits.csv", SimpleNamespace(visits=[visit]))
    (row,) = csv.DictReader(path.read_text().splitlines())
    assert float(row["arrival_stamp_s"]) == stamp_s
    assert row["end_stamp_s"] == ""
    assert (row["arrived_s"], row["dwell_s"]) == ("79.685", "60")


@given(st.text(max_size=8), st.sampled_from("=+-@\t'＝"))
def test_no_text_is_a_formula_of_a_spreadsheet_and_every_text_comes_back(text, first):
    for name in (text, first + text, f'{first}HYPERLINK("http://x","y")'):
        cell = csv_text(name)
        assert not cell.startswith(("=", "+", "-", "@", "\t", "\r", "＝"))
        assert text_of_csv(cell) == name


def test_numbers_stay_numbers_beside_a_formula(tmp_path):
    visit = Visit("=1+2", -1.5, -2.0, 0.0, 60.0, 262, "@SUM(A1)")
    path = write_visits(tmp_path / "visits.csv", SimpleNamespace(visits=[visit]))
    (row,) = csv.DictReader(path.read_text().splitlines())
    assert (row["name"], row["reason"], row["x_m"], row["y_m"]) == ("'=1+2", "'@SUM(A1)", "-1.5", "-2")
    (tmp_path / "summary.json").write_text("{}")
    (again,) = OpenedRun(tmp_path).visits
    assert (again.name, again.reason, again.x_m) == ("=1+2", "@SUM(A1)", -1.5)
