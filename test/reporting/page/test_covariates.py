# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the covariates of a map explain."""

from __future__ import annotations

import json

import numpy as np
import pytest

from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.covariates import Covariates
from soilmoist_ros.mapping.knowledge.knowledge import Knowledge
from soilmoist_ros.mapping.samples.samples import as_samples
from soilmoist_ros.pipeline.run import NoteCode
from soilmoist_ros.reporting.files.summary import summary
from soilmoist_ros.reporting.page.covariates import covariate_importance
from soilmoist_ros.reporting.page.notes import notes
from soilmoist_ros.reporting.page.report import render_report
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

GRID = FieldGrid.from_polygon([(0, 0), (100, 0), (100, 80), (0, 80)], cell_m=4.0)
EFFECT_CPS = 0.5


@pytest.fixture(scope="module")
def explained():
    """Covariates and a map whose rate rises by :data:`EFFECT_CPS` per standard deviation of the relief."""
    rng = np.random.default_rng(3)
    east, north = np.meshgrid(GRID.x_m, GRID.y_m)
    relief = np.sin(east / 14) * np.cos(north / 11)
    gaps = np.where(east < 70, np.cos(east / 9 + north / 17), np.nan)
    covariates = Covariates.over(GRID, ["useless", "relief"], [gaps, relief])
    xy = rng.uniform((0, 0), (100, 80), (80, 2))
    rate = 5 + EFFECT_CPS * covariates.at(xy)[:, 1] + 0.15 * np.sin(xy[:, 1] / 20)
    exposure_s = np.full(80, 300.0)
    curve = CalibrationCurve(8.0, 1.4)
    field_map = FieldMap(GRID, FieldMapSettings(curve=curve), Knowledge(covariates=covariates))
    field_map.set_samples(as_samples(xy, rng.poisson(rate * exposure_s), exposure_s))
    return field_map.update(), covariates


def test_the_covariate_that_matters_comes_first_with_its_effect(explained, make_run):
    soil_map, covariates = explained
    relief, useless = covariate_importance(make_run(soil_map=soil_map, covariates=covariates))
    assert relief.name == "relief"
    assert relief.rate_cps.p025 < EFFECT_CPS < relief.rate_cps.p975
    assert relief.rate_cps.value == pytest.approx(EFFECT_CPS, abs=0.06)
    assert relief.vwc.p025 < relief.vwc.value < relief.vwc.p975 < 0  # more counts are less water
    low, high = relief.variance_share[1:]
    assert 0.7 < low <= relief.variance_share.value <= high <= 1
    assert useless.variance_share.value < 0.05
    assert useless.variance_share.p025 == 0
    assert (relief.covered_share, useless.covered_share) == (1, pytest.approx(0.7, abs=0.03))


def test_summary_report_and_notes_state_it(explained, make_run):
    soil_map, covariates = explained
    run = make_run(soil_map=soil_map, covariates=covariates)
    told = json.loads(json.dumps(summary(run)))["covariates"]
    assert [one["name"] for one in told] == ["relief", "useless"]
    assert told[0]["rate_cps_per_sd"]["p025"] > 0
    assert set(told[0]) == {"name", "rate_cps_per_sd", "vwc_per_sd", "variance_share", "covered_share"}
    assert "What explains the map" in render_report(run)
    (note,) = [note for note in notes(run) if note.code is NoteCode.COVARIATE_GAPS]
    assert "useless (68" in note.message
    assert "relief" not in note.message


def test_without_covariates_nothing_is_said(make_run):
    run = make_run()
    assert summary(run)["covariates"] == []
    assert "What explains the map" not in render_report(run)
