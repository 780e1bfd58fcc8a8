from __future__ import annotations

import json
import subprocess
import sys

import pytest
import rasterio

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting import outputs, write_outputs

NAMES = ["summary.json", "map.tif", "samples.geojson", "report.html"]


@pytest.mark.slow
def test_all_four_and_nothing_else(make_run, tmp_path):
    paths = write_outputs(tmp_path / "a" / "b", make_run(simulated=True), crs="EPSG:27700")
    assert [path.name for path in paths] == NAMES
    assert sorted(path.name for path in (tmp_path / "a" / "b").iterdir()) == sorted(NAMES)
    found = json.loads(paths[0].read_text(encoding="utf-8"))
    assert found["outputs"] == NAMES
    assert found["crs"] == "EPSG:27700"
    with rasterio.open(paths[1]) as raster:
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"


def test_a_failure_leaves_the_old_files(make_run, tmp_path, monkeypatch):
    for name in NAMES:
        (tmp_path / name).write_text("old")

    def fail(*_):
        raise RuntimeError("no space left")

    monkeypatch.setattr(outputs, "write_report", fail)
    with pytest.raises(RuntimeError, match="no space"):
        write_outputs(tmp_path, make_run())
    assert {path.read_text() for path in tmp_path.iterdir()} == {"old"}
    assert len(list(tmp_path.iterdir())) == 4


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
