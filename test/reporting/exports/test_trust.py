# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What exports say about the calibration of a map and about the certainty of its zones."""

from __future__ import annotations

import dataclasses
import json
import zipfile

import numpy as np
import pyogrio
import pytest
import rasterio

from soilmoist_ros.foundation import InputError
from soilmoist_ros.pipeline.run import CalibrationInfo
from soilmoist_ros.reporting import EXPORTS, ExportSettings, export_run, open_run, write_outputs
from soilmoist_ros.reporting.one_place import moisture_of_all
from soilmoist_ros.reporting.page.field_dose import field_dose
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.sensing import Irrigation

pytestmark = pytest.mark.slow  # runs are written and exported

LIMITS = Irrigation(root_depth_mm=500.0, wilting_point=0.12, field_capacity=0.30)
GUESS = CalibrationInfo(7.0, 1.4, illustrative=True)


def columns(path, layer=None):
    about, _, _, values = pyogrio.raw.read(path, layer=layer, read_geometry=False)
    return dict(zip(about["fields"], values, strict=True))


def texts(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name).decode("utf-8", "replace") for name in archive.namelist()}


@pytest.fixture(scope="module")
def guessed(make_run, tmp_path_factory):
    """Run folder and all exports of a map whose calibration is a guess."""
    folder = tmp_path_factory.mktemp("guessed")
    write_outputs(folder, make_run(calibration=GUESS, irrigation=LIMITS))
    export_run(folder, [name for name in EXPORTS.names() if name not in ("dose", "isoxml", "sheet", "prior")])
    return folder


@pytest.mark.parametrize("name", ["map.tif", "export/map.tif"])
def test_geotiffs_say_that_the_calibration_is_a_guess(guessed, name):
    with rasterio.open(guessed / name) as raster:
        assert raster.tags()["SOILMOIST_CALIBRATION"] == "illustrative"
        assert "calibration: illustrative" in raster.tags()["TIFFTAG_IMAGEDESCRIPTION"]
        assert raster.tags()["SOILMOIST_INTERVAL"].startswith("level not known (illustrative N0)")
        assert "illustrative" in raster.tags(1)["long_name"] + raster.tags(1)["units"]


def test_features_and_layers_say_that_the_calibration_is_a_guess(guessed):
    for feature in json.loads((guessed / "samples.geojson").read_text())["features"]:
        if feature["properties"]["kind"] in ("field", "sample"):
            assert feature["properties"]["calibrated"] == "illustrative"
    export = guessed / "export"
    for found in (columns(export / "zones.zip"), columns(export / "soilmoist.gpkg", "zones")):
        assert set(found["CALIBRATED"]) == {"illustrative"}
        assert not {"WATER_MM", "MISS_MM", "ROOT_MM"} & set(found)
    for layer in ("samples", "field"):
        assert set(columns(export / "soilmoist.gpkg", layer)["calibrated"]) == {"illustrative"}


def test_titles_and_legends_say_that_the_calibration_is_a_guess(guessed):
    title = "Soil moisture [% by volume, illustrative]"
    in_export = texts(guessed / "export" / "soilmoist.qgz")["soilmoist.qgs"]
    for project in (in_export, (guessed / "soilmoist.qgs").read_text()):
        assert f"<layername>{title}</layername>" in project
        assert "<layername>samples (illustrative)</layername>" in project
    assert "<layername>zones (illustrative)</layername>" in in_export
    assert "% by volume, illustrative, 0.0" in in_export, "the legend of the zones"
    report = (guessed / "report.html").read_text()
    assert report.index("Illustrative: the calibration is a guess") < report.index("The map: choose a layer")
    assert "% by volume, illustrative" in report


def test_a_folder_of_an_earlier_release_is_exported_as_illustrative_too(guessed, tmp_path):
    about = json.loads((guessed / "summary.json").read_text())
    del about["calibration"]["illustrative"]
    (tmp_path / "summary.json").write_text(json.dumps(about))
    with rasterio.open(guessed / "map.tif") as raster:
        profile, bands, names = raster.profile, raster.read(), raster.descriptions
    with rasterio.open(tmp_path / "map.tif", "w", **profile) as raster:
        raster.write(bands)
        raster.descriptions = names
    (tmp_path / "samples.geojson").write_bytes((guessed / "samples.geojson").read_bytes())
    (path,) = export_run(tmp_path, ["zones"])
    assert set(columns(path)["CALIBRATED"]) == {"illustrative"}


@pytest.mark.parametrize(
    "limits", [LIMITS, Irrigation(root_depth_mm=500.0, texture="loam")], ids=["known", "loam"]
)
def test_zones_state_what_the_report_states(make_run, the_map, tmp_path, limits):
    """One class on the whole field: polygon, report and dose have the same cells, so the same figures."""
    vwc = np.where(the_map.grid.mask, 0.16, np.nan)
    soil = dataclasses.replace(
        the_map, rate=the_map.curve.rate_cps(vwc), variance=np.where(the_map.grid.mask, 0.02**2, np.nan)
    )
    run = make_run(soil_map=soil, irrigation=limits)
    write_outputs(tmp_path, run)
    with rasterio.open(tmp_path / "map.tif", "r+", IGNORE_COG_LAYOUT_BREAK="YES") as raster:  # give it the map
        for number, name in enumerate(raster.descriptions, 1):
            inside, band = np.isfinite(raster.read(number)), getattr(soil.bands, name)
            raster.write(np.where(inside, np.nanmax(band), np.nan).astype("float32"), number)
    (path,) = export_run(tmp_path, ["zones"])
    table, dry = columns(path), irrigation(run).zones[0]
    assert dry.share == 1.0
    assert (table["ZONE"].tolist(), table["NAME"].tolist()) == ([1], ["too dry"])
    assert table["CERTAIN"].tolist() == [int(dry.certainty.certain)] == [1]
    dose = field_dose(run)
    assert dry.certainty.expected == pytest.approx(dose.dose.needed.mean()), "one certainty for one ground"
    assert dry.certainty.sure == pytest.approx(dose.sure)
    assert dry.certainty.certain == dose.certain
    assert dry.missing_mm == pytest.approx(dose.missing_mm[0], abs=0.05)
    assert table["SURE_PCT"][0] == 100 * dry.certainty.sure
    figures = ("missing_mm", "missing_mm_p05", "missing_mm_p95")
    missing = [table[name][0] for name in ("MISS_MM", "MISS_P05", "MISS_P95")]
    assert missing == pytest.approx([getattr(dry, name) for name in figures], abs=0.06)
    assert missing[0] == pytest.approx((limits.field_capacity - 0.16) * 500, abs=5)
    assert table["WATER_MM"][0] == pytest.approx(80.0, abs=0.05)
    assert set(table["CALIBRATED"]) == {"own"}


def test_a_zone_of_the_advice_is_not_merged_away_without_a_word(make_run, tmp_path):
    """A limit that cuts off the driest cells: too small for a polygon, but named with its area."""
    run = make_run()
    driest = float(np.nanquantile(run.soil_map.vwc, 0.02))
    run = make_run(irrigation=Irrigation(dry_below=driest, moist_above=0.45))
    write_outputs(tmp_path, run)
    notes = []
    (path,) = export_run(tmp_path, ["zones"], note=notes.append)
    table = columns(path)
    assert set(table["ZONE"]) == {2}
    told = irrigation(run).zones[1].certainty
    assert (table["CERTAIN"][0], table["SURE_PCT"][0]) == (told.certain, pytest.approx(100 * told.sure, abs=0.06))
    (note,) = notes
    assert note.startswith("zone 1 (dry): 0.00")
    assert "0 ha in the file of zones" in note
    assert table["OTHER_PCT"][0] == pytest.approx(2.0, abs=1.5), "the file says it, too"
    notes.clear()
    settings = ExportSettings(min_zone_ha=0.0)
    (path,) = export_run(tmp_path, ["zones"], settings=settings, note=notes.append)
    assert 1 in columns(path)["ZONE"]
    assert open_run(tmp_path).summary["irrigation"]["zones"][0]["name"] == "dry"


def test_a_run_of_one_place_has_no_zones(make_run, map_of, tmp_path):
    run = make_run(soil_map=map_of(n=1), irrigation=LIMITS)
    write_outputs(tmp_path, run)
    for name, reason in (("zones", "no zones: all records are of one place"), ("dose", "all records are of one")):
        with pytest.raises(InputError, match=reason):
            export_run(tmp_path, [name])
    (path,) = export_run(tmp_path, ["gpkg"])
    assert not [name for name, _ in pyogrio.list_layers(path) if name.startswith("zones")]
    mean, told = moisture_of_all(run.track, run.soil_map.curve), open_run(tmp_path).summary["map"]["mean_vwc"]
    assert list(told.values()) == [float(mean.vwc), float(mean.vwc_p05), float(mean.vwc_p95)]
