# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import netcdf_file

from soilmoist_ros.reporting.season.season_files import FILL, NAMES, estimate_text, write_season

pytestmark = pytest.mark.slow  # the season that all use takes long to make


def test_the_folder_has_all_files_and_the_table_all_surveys(season, tmp_path):
    assert [path.name for path in write_season(tmp_path / "out", season)] == list(NAMES)
    with (tmp_path / "out" / "season.csv").open() as file:
        rows = list(csv.DictReader(file))
    about = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [row["survey"] for row in rows] == ["survey_2", "survey_1", "run"]
    assert rows[0]["change_rate_cps"] == ""
    for row, survey in zip(rows, about["surveys"], strict=True):
        assert float(row["mean_vwc"]) == survey["mean_vwc"]
        assert survey["mean_vwc_low95"] < survey["mean_vwc"] < survey["mean_vwc_high95"]
    assert about["simulated"] is True
    assert 0 <= about["pattern_correlation"] <= 1


def test_the_stack_has_every_map(season, tmp_path):
    write_season(tmp_path, season)
    with netcdf_file(tmp_path / "season.nc", mmap=False) as file:
        assert file.dimensions["time"] == 3
        vwc = file.variables["vwc"]
        assert vwc.dimensions == ("time", "y", "x")
        for stored, survey in zip(vwc[:], season.surveys, strict=True):
            inside = season.grid.mask
            np.testing.assert_allclose(stored[inside], survey.bands.vwc[inside], rtol=1e-6)
            assert (stored[~inside] == FILL).all()
        assert (file.variables["rate_change"][0] == FILL).all()
        assert (file.variables["rate_change"][1][season.grid.mask] != FILL).all()
        lat = file.variables["lat"][:]
        assert abs(lat.mean() - season.frame.latitude_deg) < 1e-3


def test_every_file_says_that_a_calibration_is_a_guess(season, tmp_path):
    write_season(tmp_path, replace(season, illustrative=True))
    assert json.loads((tmp_path / "summary.json").read_text())["calibration"] == "illustrative"
    with (tmp_path / "season.csv").open() as file:
        assert {row["calibration"] for row in csv.DictReader(file)} == {"illustrative"}
    with netcdf_file(tmp_path / "season.nc", mmap=False) as file:
        assert file.calibration == b"illustrative"
        assert b"illustrative" in file.variables["vwc"].long_name


def test_without_a_calibration_there_is_no_moisture(season, tmp_path):
    surveys = [replace(one, mean_vwc=None) for one in season.surveys]
    bare = replace(season, curve=None, surveys=surveys)
    write_season(tmp_path, bare)
    with netcdf_file(tmp_path / "season.nc", mmap=False) as file:
        assert "vwc" not in file.variables
        assert "rate" in file.variables
    assert "counts/s" in estimate_text(surveys[1])
    assert "% by volume" in estimate_text(season.surveys[1])
