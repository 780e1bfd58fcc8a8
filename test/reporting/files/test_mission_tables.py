"""The tables of a mission."""

import csv
from types import SimpleNamespace

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.reporting.files.mission_tables import write_visits


def test_times_of_day_keep_their_milliseconds(tmp_path):
    stamp_s = 1_780_293_679.685
    visit = Visit("a", 1.0, 2.0, 79.685, 60.0, 262, "middle", arrival_stamp_s=stamp_s)
    path = write_visits(tmp_path / "visits.csv", SimpleNamespace(visits=[visit]))
    (row,) = csv.DictReader(path.read_text().splitlines())
    assert float(row["arrival_stamp_s"]) == stamp_s
    assert row["end_stamp_s"] == ""
    assert (row["arrived_s"], row["dwell_s"]) == ("79.685", "60")
