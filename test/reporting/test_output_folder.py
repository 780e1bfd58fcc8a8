# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an output folder has before the work, and what may be replaced there."""

from __future__ import annotations

import json
import sys

import pytest

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.pipeline.field_survey import require_crs
from soilmoist_ros.reporting import earlier_outputs, remove_earlier, require_free
from soilmoist_ros.reporting.output_folder import writable

OURS = {"software": "soilmoist_ros", "title": "A map", "field": "north", "created_utc": "2026-05-01T10:00:00Z"}
KANSAS = LocalFrame(38.7, -97.4)


def a_run(folder, **about):
    folder.mkdir(exist_ok=True)
    (folder / "summary.json").write_text(json.dumps({**OURS, **about}))
    (folder / "map.tif").write_text("old")
    return folder


def test_results_are_replaced_only_if_the_user_says_so(tmp_path):
    folder = a_run(tmp_path / "run")
    held = r"has the results of a run \(A map, north, made 2026-05-01 10:00:00 UTC\) -> .* --overwrite"
    with pytest.raises(InputError, match=held):
        require_free(folder)
    require_free(folder, overwrite=True)


@pytest.mark.parametrize("name", ["report.html", "map_rough.tif", "series.csv"])
def test_files_of_others_are_never_replaced(tmp_path, name):
    (tmp_path / name).write_text("mine")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="not of a run of soilmoist"):
            require_free(tmp_path, overwrite)
    (tmp_path / "summary.json").write_text('{"software": "other"}')
    with pytest.raises(InputError, match="not of a run of soilmoist"):
        require_free(tmp_path, overwrite=True)


@pytest.mark.parametrize("below", ["", "deeper"])
def test_a_file_is_no_folder(tmp_path, below):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file, not a folder"):
        require_free(tmp_path / "file" / below)


def test_results_that_a_new_run_has_not_are_removed_and_nothing_else(tmp_path):
    folder = a_run(
        tmp_path / "run", outputs=["summary.json", "map.tif", "map_rough.tif", "../outside", "notes.txt"]
    )
    for name in ("map_rough.tif", "notes.txt", "map_mine.tif", "../outside"):
        (folder / name).write_text("x")
    remove_earlier(folder, earlier_outputs(folder), ["summary.json", "map.tif"])
    assert {path.name for path in folder.iterdir()} == {"summary.json", "map.tif", "notes.txt", "map_mine.tif"}
    assert (tmp_path / "outside").exists()


@pytest.mark.parametrize("crs", [None, "EPSG:32614", "EPSG:32615", "EPSG:3857", "EPSG:4326", "EPSG:5070"])
def test_reference_systems_of_the_region(crs):
    require_crs(crs, KANSAS)
    require_crs(crs)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("EPSG:27700", "is for United Kingdom .UK., 88 deg from the field"),
        ("EPSG:32633", "deg from the field"),
        ("EPSG:32714", "39 deg from"),
        ("EPSG:4978", "is not a projection"),
        ("bogus", "is not a coordinate reference system"),
    ],
)
def test_other_reference_systems_are_refused(crs, message):
    with pytest.raises(InputError, match=message):
        require_crs(crs, KANSAS)


def test_the_area_of_a_reference_system_may_cross_the_antimeridian():
    """NZGD2000 / New Zealand Continental Shelf: 160.6 E to 171.2 W."""
    require_crs("EPSG:3851", LocalFrame(-43.9, -176.5))
    require_crs("EPSG:3851", LocalFrame(-43.5, 172.6))
    with pytest.raises(InputError, match="deg from"):
        require_crs("EPSG:3851", LocalFrame(-43.5, -120.0))


def test_files_that_no_installed_extra_writes_are_named_and_left_out(monkeypatch, caplog):
    assert writable(("summary.json", "map.tif", "report.html")) == ("summary.json", "map.tif", "report.html")
    assert caplog.messages == []
    monkeypatch.setitem(sys.modules, "rasterio", None)
    assert writable(("summary.json", "map.tif", "report.html")) == ("summary.json", "report.html")
    assert caplog.messages == ["map.tif not written: pip install 'soilmoist_ros[reports]'"]
