# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.mapping.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.knowledge import EarlierSurvey
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.soil_map import make_soil_map
from soilmoist_ros.pipeline.earlier_runs import run_change
from soilmoist_ros.pipeline.run import EarlierRun, NoteCode
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.reporting.page.report import earlier_part, render_report
from soilmoist_ros.reporting.page.viewer import viewer_data
from soilmoist_ros.reporting.page.wording import notes
from soilmoist_ros.reporting.run_summary import summary

NOW_S = 1.77e9


def earlier(soil, name: str, days: float, drop: float = 0.0, scatter_seed: int = 1) -> EarlierRun:
    """A survey at the places of a map, where the rate was higher by ``drop``."""
    rng = np.random.default_rng(scatter_seed)
    exposure_s = np.full(len(soil.samples), 2000.0)
    samples = Samples(soil.samples.xy, rng.poisson((soil.samples.rate_cps + drop) * exposure_s), exposure_s)
    survey = EarlierSurvey(name, NOW_S - 86400 * days, samples)
    return EarlierRun(survey, Path(name), survey.stamp_s - 3600, [], remarks=("A remark.",))


@pytest.fixture(scope="module")
def changed(make_run, the_map):
    runs = [earlier(the_map, "april", 30.0), earlier(the_map, "may", 7.0, 1.0)]
    return make_run(earlier=runs, change=run_change(the_map, NOW_S, runs))


def test_the_change_is_since_the_latest_earlier_survey(changed):
    assert changed.change.since.survey.name == "may"
    low, high = changed.change.change.mean_rate.interval95
    assert low < -1.0 < high
    assert changed.change.change.shares[1] > 0.5
    assert changed.change.means.keys() == {"april", "may"}
    assert changed.change.sd < changed.change.sd_alone


def test_the_change_is_less_certain_after_a_drift(the_map):
    runs, samples = [earlier(the_map, "may", 7.0)], the_map.samples
    timed = TimedSamples(samples, np.linspace(0, 3600, len(samples)))
    change = Change(Drift(0.99, False, (0.0, 3600.0), (0.0, 0.0), ((0.1, 0.1),)))
    still = make_soil_map(samples, the_map.grid, the_map.variogram)
    drifted = make_soil_map(samples, the_map.grid, the_map.variogram, changing=Changing(timed, change, 3600.0))
    certain, found = (run_change(one, NOW_S, runs) for one in (still, drifted))
    added = 0.1 * still.mean_rate  # all rates may be too high alike
    assert found.means["may"].value == pytest.approx(certain.means["may"].value)
    for one, other in (
        (found.means["may"].sd, certain.means["may"].sd),
        (found.change.mean_rate.sd, certain.change.mean_rate.sd),
        (found.sd, certain.sd),
        (found.sd_alone, certain.sd_alone),
    ):
        assert np.sqrt(one**2 - other**2) == pytest.approx(added, rel=0.01)
    wider = np.sqrt(found.change.rate_sd**2 - certain.change.rate_sd**2)[the_map.grid.mask]
    np.testing.assert_allclose(wider, added, rtol=0.01)


def test_the_report_names_surveys_and_change(changed):
    part = earlier_part(changed)
    assert [row.name for row in part.rows] == ["april", "may"]
    assert "wetter significantly" not in part.change
    assert "Since the survey may of 2026-01-26" in part.change
    assert "by volume" in part.change
    page = render_report(changed)
    assert "Earlier surveys, and what has changed" in page
    assert "A remark." in page
    layer = next(one for one in viewer_data(changed, irrigation(changed))["layers"] if one["key"] == "change")
    assert (layer["title"], layer["unit"]) == ("Change", "% by volume")


def test_files_have_the_change(changed, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    assert tmp_path / "change.tif" in write_outputs(tmp_path, changed)
    with rasterio.open(tmp_path / "change.tif") as file:
        bands = dict(zip(file.descriptions, file.read(), strict=True))
        assert file.tags()["SOILMOIST_CHANGE_SINCE"] == "may"
    assert list(bands) == ["vwc_change", "vwc_change_sd", "rate_change", "rate_change_sd", "significant"]
    change = changed.change.change
    assert np.nanmean(bands["rate_change"]) == pytest.approx(np.nanmean(change.rate), abs=0.02)
    assert set(np.unique(bands["significant"][np.isfinite(bands["significant"])])) <= {-1.0, 0.0, 1.0}
    about = summary(changed)
    assert [one["name"] for one in about["earlier"]] == ["april", "may"]
    assert about["change"]["since"] == "may"
    assert about["change"]["mean_rate_cps"]["value"] == pytest.approx(change.mean_rate.value)


def test_a_comparison_with_a_later_survey_says_so(make_run, the_map):
    runs = [earlier(the_map, "june", -20.0)]
    part = earlier_part(make_run(earlier=runs, change=run_change(the_map, NOW_S, runs)))
    assert part.change.startswith("Compared with the later survey june of 2026-")


@pytest.mark.parametrize(
    ("days", "factor", "said"),
    [
        (-9e4, 1.0, "is dated 2272-07-02, in the future: check the clock"),
        (4000.0, 1.0, "lies 11 years from this one"),
        (30.0, 0.1, "has 0.1 times the count rate of this one"),
        (30.0, 10.0, "has 10 times the count rate of this one"),
        (30.0, 0.7, ""),
    ],
)
def test_doubtful_earlier_surveys_are_noted(make_run, the_map, days, factor, said):
    one = earlier(the_map, "april", days)
    samples = replace(one.survey.samples, exposure_s=one.survey.samples.exposure_s / factor)
    run = make_run(earlier=[replace(one, survey=replace(one.survey, samples=samples))])
    run = replace(run, track=[replace(record, stamp_s=NOW_S) for record in run.track])
    found = [note.message for note in notes(run) if note.code is NoteCode.DOUBTFUL_EARLIER]
    assert len(found) == bool(said)
    assert said in "".join(found)
