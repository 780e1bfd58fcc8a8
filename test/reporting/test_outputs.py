# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import subprocess
import sys

import pytest
import rasterio

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import read_records
from soilmoist_ros.reporting import outputs, write_outputs

NAMES = ["summary.json", "map.tif", "samples.geojson", "report.html", "records.csv", "soilmoist.qgs"]


@pytest.mark.slow
def test_all_files_and_nothing_else(make_run, tmp_path):
    paths = write_outputs(tmp_path / "a" / "b", make_run(simulated=True), crs="EPSG:27700")
    assert [path.name for path in paths] == NAMES
    assert sorted(path.name for path in (tmp_path / "a" / "b").iterdir()) == sorted(NAMES)
    found = json.loads(paths[0].read_text(encoding="utf-8"))
    assert found["outputs"] == NAMES
    assert found["crs"] == "EPSG:27700"
    with rasterio.open(paths[1]) as raster:
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"
        assert raster.tags()["TIFFTAG_DATETIME"] == "2023:11:14 22:07:37"
        assert raster.tags()["SOILMOIST_SURVEY_START_UTC"] == "2023-11-14T22:07:37Z"
        assert raster.tags()["SOILMOIST_SURVEY_END_UTC"] == "2026-02-02T02:40:00Z"
    assert [record.stamp_s for record in read_records(paths[4])] == [record.stamp_s for record in make_run().track]


def test_a_failure_leaves_the_old_files(make_run, tmp_path, monkeypatch):
    for name in NAMES:
        (tmp_path / name).write_text("old")

    def fail(*_):
        raise RuntimeError("no space left")

    monkeypatch.setattr(outputs, "write_report", fail)
    with pytest.raises(RuntimeError, match="no space"):
        write_outputs(tmp_path, make_run())
    assert {path.read_text() for path in tmp_path.iterdir()} == {"old"}
    assert len(list(tmp_path.iterdir())) == len(NAMES)


def test_folder_that_is_a_file(make_run, tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_outputs(tmp_path / "out", make_run())


@pytest.mark.process
def test_import_is_light():
    code = (
        "import sys, soilmoist_ros.reporting; "
        "print([m for m in ('matplotlib', 'rasterio', 'jinja2', 'rclpy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
