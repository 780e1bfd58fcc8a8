# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import rasterio

from reporting.packed import unpack, unpack_bits
from soilmoist_ros.reporting import estimate_text, write_season
from soilmoist_ros.reporting.season_outputs import NAMES, mean_chart, render_season, season_data

pytestmark = pytest.mark.slow  # the season that all use takes long to make


def test_the_folder_has_all_files_and_the_table_all_surveys(season, tmp_path):
    names = [*NAMES, "survey_1.tif", "survey_2.tif", "survey_3.tif"]
    assert [path.name for path in write_season(tmp_path / "out", season)] == names
    rows = list(csv.DictReader((tmp_path / "out" / "season.csv").read_text().splitlines()))
    about = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [row["survey"] for row in rows] == ["survey_2", "survey_1", "run"]
    assert rows[0]["change_rate_cps"] == ""
    for row, survey in zip(rows, about["surveys"], strict=True):
        assert float(row["mean_vwc"]) == pytest.approx(survey["mean_vwc"], rel=1e-7)
        assert survey["mean_vwc_low95"] < survey["mean_vwc"] < survey["mean_vwc_high95"]
    assert (about["simulated"], about["outputs"]) == (True, names)
    assert 0 <= about["pattern_correlation"] <= 1


def test_each_survey_has_a_map_and_says_that_a_calibration_is_a_guess(season, tmp_path):
    write_season(tmp_path, replace(season, illustrative=True))
    for number, survey in enumerate(season.surveys, 1):
        with rasterio.open(tmp_path / f"survey_{number}.tif") as raster:
            bands, tags = dict(zip(raster.descriptions, raster.read(), strict=True)), raster.tags()
            assert "illustrative" in raster.tags(1)["long_name"]
        assert tags["SOILMOIST_SURVEY"] == survey.run.survey.name
        assert tags["SOILMOIST_CALIBRATION"] == "illustrative"
        known = set(bands["vwc"][np.isfinite(bands["vwc"])].tolist())
        cells = set(survey.bands.vwc[season.grid.mask].astype("float32").tolist())
        assert known <= cells
        assert len(known) > 0.95 * len(cells)
        assert ("rate_change" in bands) is (number > 1)
    assert json.loads((tmp_path / "summary.json").read_text())["calibration"] == "illustrative"
    rows = csv.DictReader((tmp_path / "season.csv").read_text().splitlines())
    assert {row["calibration"] for row in rows} == {"illustrative"}


def test_layers_have_a_map_of_every_survey_in_one_scale(season):
    data = season_data(season)
    assert [layer["key"] for layer in data["layers"]] == ["vwc", "rate", "change", "vwc_sd", "rate_sd"]
    shape = (data["grids"][0]["ny"], data["grids"][0]["nx"])
    for layer in data["layers"]:
        assert len(layer["maps"]) == 3
        assert "title" not in layer or layer["from"] < layer["to"]
    vwc, _, change, *_ = (layer["maps"] for layer in data["layers"])
    np.testing.assert_allclose(unpack(vwc[1], shape), 100 * season.surveys[1].bands.vwc, atol=0.01)
    assert np.isnan(unpack(change[0], shape)).all()
    assert ((unpack_bits(change[1]["hatch"], shape) > 0) == (season.surveys[1].change.significant == 0)).all()


def test_without_a_calibration_there_are_rates_only(season, tmp_path):
    bare = replace(season, curve=None, surveys=[one._replace(mean_vwc=None) for one in season.surveys])
    assert [layer["key"] for layer in season_data(bare)["layers"]] == ["rate", "change", "rate_sd"]
    assert "mean rate" in mean_chart(bare).y_label
    write_season(tmp_path, bare)
    assert "counts/s" in (tmp_path / "report.html").read_text()
    with rasterio.open(tmp_path / "survey_2.tif") as raster:
        assert raster.descriptions == ("rate", "rate_sd", "rate_change", "rate_change_sd", "significant")
    assert "counts/s" in estimate_text(bare.surveys[1])
    assert "% by volume" in estimate_text(season.surveys[1])


def test_moisture_has_its_rate_in_brackets_and_the_map_comes_first(season):
    page = render_season(season)
    assert f"[{season.surveys[0].mean_rate.value:.3f} counts/s]" in page
    assert page.index('id="map"') < page.index('class="lead"') < page.index('id="surveys"')
    assert str(season.surveys[0].run.path.parent) not in page


def test_surveys_have_their_end_in_utc_and_in_the_time_of_the_field(season):
    def dated(one):
        survey = replace(one.run.survey, stamp_s=one.run.survey.stamp_s + 1.75e9)  # 15:06:40 UTC and the mission
        return one._replace(run=replace(one.run, survey=survey))

    there = replace(season, surveys=[dated(one) for one in season.surveys], time_zone="Australia/Sydney")
    page = render_season(there)
    assert re.search(r"<td>15:\d\d UTC, 2025-06-1\d 01:\d\d Australia/Sydney</td>", page)
    assert re.search(r"<td>15:\d\d UTC</td>", render_season(replace(there, time_zone="")))
    assert "UTC</td>" not in render_season(season)
