# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exports by name, of any run folder: registry.py and source.py."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pyogrio
import pytest
import rasterio

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.exports import registry
from soilmoist_ros.reporting.exports.registry import EXPORTS, Export, export_run
from soilmoist_ros.reporting.exports.source import RATE

WITH_DOSE = ["dose", "isoxml", "sheet"]
"""Exports of runs with a dose."""


def test_each_export_has_its_traits():
    assert EXPORTS.names() == ["qgis", "gpkg", "zones", *WITH_DOSE, "kmz", "prior"]
    for name in EXPORTS.names():
        kind = EXPORTS.get(name)
        assert kind.label
        assert kind.description
        assert kind.suffix.startswith(".")
    with pytest.raises(InputError, match=r"there is no export 'zone' -> .*did you mean 'zones'"):
        EXPORTS.get("zone")


@pytest.mark.slow
def test_another_run_is_not_overwritten(exported, tmp_path):
    other = shutil.copytree(exported.folder, tmp_path / "run")
    with pytest.raises(InputError, match="holds another run"):
        export_run(exported.folder, ["qgis"], other)
    before = (other / "map.tif").read_bytes()
    assert len(export_run(other, ["qgis"], other)) == 4
    assert (other / "map.tif").read_bytes() == before
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        export_run(other, ["kmz"], tmp_path / "file")


@pytest.mark.slow
def test_a_failure_leaves_earlier_files(exported, tmp_path, monkeypatch):
    def fail(source, folder, settings):
        (folder / "map.nc").write_text("half")
        raise RuntimeError("no space left")

    (tmp_path / "map.nc").write_text("whole")
    monkeypatch.setitem(EXPORTS._objects(), "bad", Export(fail, "bad", "a test", ".nc"))
    with pytest.raises(RuntimeError):
        export_run(exported.folder, ["bad"], tmp_path)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("map.nc", "whole")]


def older(folder):
    for path in folder.glob("records*.csv"):
        path.unlink()
    for path in folder.glob("samples*.geojson"):
        content = json.loads(path.read_text())
        content["features"] = [one for one in content["features"] if one["properties"]["kind"] != "no_go"]
        for feature in content["features"]:
            for key in ("n_records", "first_stamp_s", "last_stamp_s", "vwc_p05", "vwc_p95"):
                if feature["properties"]["kind"] == "sample":
                    del feature["properties"][key]
        path.write_text(json.dumps(content))
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("irrigation", "survey_start_utc", "survey_end_utc", "properties"):
        summary.pop(key, None)
    (folder / "summary.json").write_text(json.dumps(summary))
    names = ["rate", "rate_sd", "vwc", "vwc_sd"]
    for path in folder.glob("map*.tif"):
        with rasterio.open(path) as raster:
            profile, bands = raster.profile, dict(zip(raster.descriptions, raster.read(), strict=True))
        nothing = np.full_like(bands["rate"], np.nan)
        with rasterio.open(path, "w", **{**profile, "count": 4}) as raster:
            for number, name in enumerate(names, start=1):
                raster.write(bands.get(name, nothing), number)
                raster.set_band_description(number, name)


@pytest.mark.slow
def test_folders_of_earlier_releases_export_what_they_have(exported, tmp_path):
    folder = shutil.copytree(exported.folder, tmp_path / "run")
    older(folder)
    notes = []
    every = [name for name in EXPORTS.names() if name not in (*WITH_DOSE, "prior")]
    written = export_run(folder, every, note=notes.append)
    assert len(written) == 4 + 2 * 2
    assert any("has no records.csv" in text for text in notes)
    assert any("no-go areas" in text for text in notes)
    layers = {name for name, _ in pyogrio.list_layers(folder / "export" / "soilmoist.gpkg")}
    assert {"no_go", "samples", "track", "zones"} < layers
    assert "records" not in layers
    salt = registry.open_source(registry.open_run(folder)).properties[1]
    assert salt.quantity is RATE, "a band of moisture without values does not count"


@pytest.mark.parametrize(
    ("summary", "message"),
    [
        ({"map": {}, "outputs": ["summary.json"]}, "has no map, so there is nothing to export -> report.html"),
        (
            {"map": {"rate": {}}, "outputs": ["summary.json", "samples.geojson"]},
            r"made without the extra .*, which writes map\.tif -> pip install 'soilmoist_ros\[reports\]', then",
        ),
        (
            {"map": {"rate": {}}, "outputs": ["map.tif"]},
            r"map\.tif is missing: it was there when the run was made",
        ),
    ],
)
def test_the_reason_for_a_missing_map_is_named(summary, message, tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match=message):
        export_run(tmp_path, ["kmz"])


@pytest.mark.slow
def test_another_package_adds_an_export(exported, tmp_path, monkeypatch):
    def write(source, folder, settings):
        path = folder / "points.txt"
        path.write_text(str(len(source.properties[0].samples["raw_counts"])))
        return [path]

    monkeypatch.setitem(EXPORTS._objects(), "points", Export(write, "points", "a test", ".txt"))
    (path,) = export_run(exported.folder, ["points"], tmp_path)
    assert path.read_text() == "12"
    monkeypatch.setitem(EXPORTS._objects(), "points", Export(lambda *_: "points.txt", "points", "a test", ".txt"))
    with pytest.raises(InputError, match="write must return a list of the paths written; it returned"):
        export_run(exported.folder, ["points"], tmp_path)
    with pytest.raises(TypeError, match="must be a"):
        registry._checked(write)
