# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.soil_map import possible_moisture
from soilmoist_ros.reporting import SeasonSettings, make_season
from soilmoist_ros.reporting import season as module
from soilmoist_ros.reporting.season_outputs import render_season, summary
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve
from soilmoist_ros.simulation import surrogate_field

pytestmark = pytest.mark.slow  # the season that all use takes long to make

FIELDS = Path(__file__).parents[2] / "config" / "fields"
GOLDEN = Path(__file__).parents[1] / "golden"


def test_surveys_are_in_order_of_time_with_their_means_and_changes(season):
    assert [one.run.survey.name for one in season.surveys] == ["survey_2", "survey_1", "run"]
    assert season.labels[0] == "day 0"
    assert season.days == pytest.approx([0.0, 7.0, 14.0], abs=0.1)
    first, second, third = season.surveys
    assert first.change is None
    for before, now in ((first, second), (second, third)):
        assert now.change.mean_rate.value == pytest.approx(now.mean_rate.value - before.mean_rate.value, abs=1e-6)
        assert now.change.mean_vwc.value == pytest.approx(now.mean_vwc.value - before.mean_vwc.value, abs=0.01)
    assert season.simulated
    field = surrogate_field("synthetic-low").field.grid(6.0)
    np.testing.assert_allclose(np.ptp(season.grid.polygon, axis=0), np.ptp(field.polygon, axis=0), atol=0.2)


def test_very_many_samples_are_mapped_with_the_surveys_nearest_in_time(runs, season, monkeypatch):
    monkeypatch.setattr(module, "MAX_SAMPLES", 210)
    some = make_season([runs, runs / "earlier"], SeasonSettings())
    assert [one.change is not None for one in some.surveys] == [False, True, True]
    np.testing.assert_allclose(some.surveys[0].bands.rate, season.surveys[0].bands.rate, atol=0.3)


@pytest.mark.parametrize("curve", [CalibrationCurve(6.0, 1.3, 0.02), UniversalCurve(9.0, 1.3, humidity_gm3=8.0)])
def test_the_calibration_is_that_of_the_last_run(runs, tmp_path, curve):
    shutil.copytree(runs, tmp_path / "run")
    for path in tmp_path.rglob("summary.json"):
        about = json.loads(path.read_text())
        path.write_text(json.dumps({**about, "calibration": {**curve.parameters, "n0_sd_cps": None}}))
    season = make_season([tmp_path / "run", tmp_path / "run" / "earlier"], SeasonSettings())
    assert season.curve == curve
    last = season.surveys[-1]
    np.testing.assert_allclose(last.bands.vwc, possible_moisture(curve, last.bands.rate))


def test_recordings_alone_do_not_know_field_and_calibration():
    with pytest.raises(InputError, match=r"make one a run: soilmoist replay .*drive_and_stop"):
        make_season([GOLDEN / "one_stop", GOLDEN / "drive_and_stop"], SeasonSettings())


def test_one_survey_is_no_season(runs):
    with pytest.raises(InputError, match="needs two surveys, but there is one"):
        make_season([runs], SeasonSettings())


def test_a_run_without_a_boundary_needs_a_field_file(runs, tmp_path):
    for name in ("survey_1", "survey_2"):
        shutil.copytree(runs / "earlier" / name, tmp_path / name)
        (tmp_path / name / "samples.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    with pytest.raises(InputError, match="has no field"):
        make_season([tmp_path], SeasonSettings())
    assert len(make_season([tmp_path], SeasonSettings(field=FIELDS / "smooth.yaml", cell_m=8.0)).surveys) == 2


def test_doubtful_surveys_and_covariates_that_are_left_out_are_named(runs, tmp_path):
    copy = tmp_path / "tenth"
    shutil.copytree(runs, copy)
    header, *rows = (row.split(",") for row in (copy / "records.csv").read_text().splitlines())
    column = header.index("raw_counts")
    for row in rows:
        row[column] = str(int(row[column]) // 10)
    (copy / "records.csv").write_text("".join(",".join(row) + "\n" for row in (header, *rows)))
    about = json.loads((copy / "summary.json").read_text())
    (copy / "summary.json").write_text(json.dumps({**about, "covariates": [{"name": "relief"}]}))
    season = make_season([copy, runs / "earlier"], SeasonSettings())
    low, covariates = season.notes
    assert low.startswith("The survey tenth has 0.087 times")
    assert "times the count rate of the others, more than soil moisture can change" in low
    assert covariates.startswith("Covariates inform the maps of tenth, but not those of the season")
    assert summary(season, ())["warnings"] == [low, covariates]
    assert "<strong>Please note</strong>" in render_season(season)


def test_far_too_many_cells_are_refused(runs):
    with pytest.raises(InputError, match=r"would have \d+ cells of 0.05 m each -> give larger cells with --cell"):
        make_season([runs, runs / "earlier"], SeasonSettings(cell_m=0.05))
