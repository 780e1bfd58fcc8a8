# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exports by name, of any run folder: registry.py and source.py."""

from __future__ import annotations

import json
import shutil

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.exports import registry
from soilmoist_ros.reporting.exports.registry import EXPORTS, Export, export_run

WITH_DOSE = ["dose", "isoxml", "sheet"]
"""Exports of runs with a dose."""


def test_each_export_has_its_traits():
    assert EXPORTS.names() == ["qgis", "gpkg", "zones", *WITH_DOSE, "prior"]
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
        export_run(other, ["zones"], tmp_path / "file")


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

    def refuse(source, folder, settings):
        (folder / "map.nc").write_text("half")
        raise InputError("there is no dose", "give one")

    monkeypatch.setitem(EXPORTS._objects(), "bad", Export(refuse, "bad", "a test", ".nc"))
    refused = []
    paths = export_run(exported.folder, ["bad", "zones"], tmp_path, refused=refused)
    assert [path.name for path in paths] == ["zones.zip", "zones_salt.zip"]
    assert {path.name for path in tmp_path.iterdir()} == {"map.nc", "zones.zip", "zones_salt.zip"}
    assert ((tmp_path / "map.nc").read_text(), refused) == ("whole", ["bad: there is no dose -> give one"])
    with pytest.raises(InputError) as error:
        export_run(exported.folder, ["dose", "isoxml"], tmp_path / "none", refused=[])
    assert len(error.value.mistakes) == 2
    assert not list((tmp_path / "none").iterdir())


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
        export_run(tmp_path, ["zones"])


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
