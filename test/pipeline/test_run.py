# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A run, and its results (results.py)."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.pipeline.results import curve_of, read_features, read_summary, shape_of
from soilmoist_ros.pipeline.run import FailedRun, InputFile, LossRow, Trouble
from soilmoist_ros.recording.stored_records import read_records
from soilmoist_ros.reporting.outputs import write_failed
from soilmoist_ros.reporting.page.report import render_failed
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve
from soilmoist_ros.sensing.records import NAN, CountRecord
from soilmoist_ros.simulation import MissionResult, MissionSettings

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
RECORD = CountRecord(1.77e9, 1.0, 2.0, NAN, 40, 10.0, 9.0)
TRACK = [
    RECORD, replace(RECORD, stamp_s=1.77e9 + 10, x_m=NAN, raw_counts=30),
    replace(RECORD, stamp_s=1.77e9 + 20, quarantine="noisy_tube", raw_counts=9000),
]  # fmt: skip
FAILED = FailedRun(
    why="All 2 records lie 70 km west of the field 'north <1>'.", todo=("Correct the sign.", "Map again."),
    created_utc=NOW, track=TRACK, field_name="north <1>",
    inputs=[InputFile("bag_0.mcap", size_bytes=7, sha256="ab")],
    losses=[LossRow("outside the field", 1, "at x = 5 m", "lost", "check the field file")],
    troubles=[Trouble("sensor_driver: logger", "records have a wrong checksum", 12, error=True)],
)  # fmt: skip


def test_the_folder_has_the_report_the_summary_and_the_records(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "map.tif").write_text("old")
    (tmp_path / "summary.json").write_text('{"software": "soilmoist_ros", "outputs": ["summary.json", "map.tif"]}')
    paths = write_failed(tmp_path, FAILED)
    assert [path.name for path in paths] == ["summary.json", "report.html", "records.csv"]
    assert {path.name for path in tmp_path.iterdir()} == {*(path.name for path in paths), "notes.txt"}
    about = json.loads(paths[0].read_text())
    assert about["map"] is None
    assert about["failure"]["what_to_do"] == ["Correct the sign.", "Map again."]
    assert about["failure"]["troubles"][0]["message"] == "records have a wrong checksum"
    assert (about["n_records"], about["n_placed_records"], about["raw_counts"]) == (2, 1, 70)
    assert about["n_quarantined"] == {"noisy_tube": 1}
    assert about["n_lost"] == {"outside the field": 1}
    assert about["warning_codes"] == ["no_map"]
    assert about["survey_start_utc"] == "2026-02-02T02:39:50Z"
    assert [record.raw_counts for record in read_records(paths[2])] == [40, 30, 9000]


def test_the_page_says_why_first_and_escapes_names():
    html = render_failed(FAILED)
    shown = ["There is no map.", "north &lt;1&gt;", "Correct the sign.", "What was counted", "outside the field",
             "records have a wrong checksum", "bag_0.mcap"]  # fmt: skip
    places = [html.index(text) for text in shown]
    assert places[2:] == sorted(places[2:])
    assert "<1>" not in html
    assert "2 February 2026" in html
    assert "70 counts in 2 records, of which 1 has a place; further records in quarantine: 1." in html
    assert "0 counts in 0 records, of which 0 have a place." in render_failed(replace(FAILED, track=()))
    assert "The mission" not in html
    visit = Visit("s17", 1.0, 2.0, 60.0, 30.0, 90, "lowers the variance most", outcome="no record came")
    settings = MissionSettings(field="smooth")
    mission = MissionResult(settings, [], [visit], [], [], LocalFrame(52.0, 5.0), "aborted", log=["0 s  start"])
    html = render_failed(replace(FAILED, mission=mission))
    assert [text in html for text in ("s17", "no record came", "lowers the variance")] == [True, True, False]
    html = render_failed(replace(FAILED, mission=replace(mission, visits=[])))
    assert ("Stops in order" in html, "0 s  start" in html) == (False, True)


# Results ---------------------------------------------------------------------------------------------------------

GOOD = {
    "datum": {"latitude_deg": 52.0, "longitude_deg": 5}, "survey_start_utc": "2026-05-01T08:00:00Z",
    "first_stamp_s": 0.0, "properties": [{"name": "moisture", "label": None}], "calibration": None,
    "a key of another version": [1],
}  # fmt: skip


def test_a_summary_comes_back_as_it_was_written(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(GOOD))
    assert read_summary(tmp_path) == GOOD


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("datum", {"latitude_deg": 52.0}),
        ("datum", {"latitude_deg": "52", "longitude_deg": 5.0}),
        ("datum", {"latitude_deg": float("nan"), "longitude_deg": 5.0}),
        ("datum", {"latitude_deg": 90.1, "longitude_deg": 5.0}),
        ("last_stamp_s", 1e300),
        ("survey_start_utc", "yesterday"),
        ("mission", [1]),
        ("properties", ["moisture"]),
        ("corrections", [{"parameters": {}}]),
        ("cell_m", 0),
        ("irrigation", {"zone_limits_vwc": 0.3}),
    ],
)
def test_a_part_of_another_kind_is_named(tmp_path, key, value):
    (tmp_path / "summary.json").write_text(json.dumps({**GOOD, key: value}))
    with pytest.raises(InputError, match=rf"summary.json \[{key}.*-> restore the file"):
        read_summary(tmp_path)


@pytest.mark.parametrize(
    "curve", [CalibrationCurve(7.0, 1.4, 0.02), UniversalCurve(7.0, 1.4, 0.02, 0.01, 0.1, 0.0, 8.0, "uranos_thl")]
)
def test_a_calibration_comes_back_as_it_was_written(tmp_path, curve):
    more = {"n0_sd_cps": curve.n0_sd_cps or None, "lowest_rate_cps": curve.lowest_rate_cps, "source": "6 cores"}
    (tmp_path / "summary.json").write_text(json.dumps({**GOOD, "calibration": {**curve.parameters, **more}}))
    assert curve_of(read_summary(tmp_path), tmp_path) == curve
    assert curve_of(GOOD, tmp_path) is None


@pytest.mark.parametrize("key", ["curve", "n0_cps", "bulk_density_gcm3"])
def test_a_calibration_with_a_part_missing_is_refused(tmp_path, key):
    calibration = {**CalibrationCurve(7.0, 1.4).parameters, key: None}
    with pytest.raises(InputError, match=rf"summary\.json.*calibration.*{key}.*-> restore the file"):
        curve_of({"calibration": calibration}, tmp_path)


@pytest.mark.parametrize("feature", [5, {}, {"properties": {}}, {"properties": {}, "geometry": None}])
def test_a_feature_has_a_geometry_and_properties(tmp_path, feature):
    path = tmp_path / "samples.geojson"
    path.write_text(json.dumps({"features": [feature]}))
    with pytest.raises(InputError, match=r"features\.0"):
        read_features(path)


@pytest.mark.parametrize(
    "geometry", [{}, {"type": "Polygon"}, {"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]}, {"type": "Cube"}]
)
def test_a_damaged_geometry_is_refused(tmp_path, geometry):
    with pytest.raises(InputError, match="damaged geometry"):
        shape_of({"geometry": geometry}, tmp_path / "samples.geojson")
