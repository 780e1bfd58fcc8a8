# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import Variogram
from soilmoist_ros.simulation.mission.efficiency import _variance_left, mission_efficiency
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission


def mission(**changes):
    usual = {
        "hours": 0.6,
        "model": "matern32",
        "fit": "reml",
        "cell_m": 3.0,
        "strategy": "ivr",
        "dwell": "optimal",
    }
    return simulate_mission(MissionSettings(**{**usual, "dwell": "optimal", "map_from": "records", **changes}))


@pytest.fixture(scope="module")
def published():
    return mission(strategy="greedy", dwell="fmi:300", map_from="stops")


@pytest.mark.slow
def test_a_plan_that_weighs_time_reaches_more_than_the_published_one(published):
    best, other = mission_efficiency(mission()), mission_efficiency(published)
    assert 0.8 < best.reached <= 1
    assert 0.05 < other.reached < 0.5 * best.reached
    assert best.reached == pytest.approx(best.least / best.left)
    assert best.least == other.least
    assert best.of_truth
    assert not best.moisture


@pytest.mark.slow
def test_the_variogram_that_a_mission_fits_does_not_change_its_efficiency(published):
    """It did: with a long range little variance is left, whatever was measured."""
    mapped, found = published.properties[0], mission_efficiency(published)
    for variogram in (Variogram("matern32", 0.0, 200.0, 0.01), Variogram("exponential", 0.3, 2.0, 3.0)):
        other = replace(mapped, soil_map=replace(mapped.soil_map, variogram=variogram))
        assert mission_efficiency(replace(published, properties=[other])) == found


@pytest.mark.slow
def test_without_a_truth_it_is_that_of_the_map(published):
    unknown = replace(published.properties[0], truth_rate=np.full(published.truth_rate.shape, np.nan))
    found = mission_efficiency(replace(published, properties=[unknown]))
    assert not found.of_truth
    assert found.reached != mission_efficiency(published).reached


@pytest.mark.slow
def test_the_variance_left_is_that_of_kriging_with_the_noise_of_the_true_rate(published):
    samples = published.soil_map.samples
    cells, variogram = published.soil_map.grid.cells[::7], Variogram("matern32", 0.0, 20.0, 0.5)
    rate = np.linspace(2.5, 5.0, len(samples))
    live = replace(samples, exposure_s=samples.exposure_s / 1.1)
    smooth = variogram.covariance
    ones = np.linalg.inv(smooth(cdist(live.xy, live.xy)) + np.diag(rate / live.exposure_s))
    towards = smooth(cdist(live.xy, cells))
    expected = variogram.sill - np.einsum("ig,ij,jg->g", towards, ones, towards)
    expected += (1 - (ones @ towards).sum(axis=0)) ** 2 / ones.sum()
    np.testing.assert_allclose(_variance_left(variogram, live, cells, rate), expected, rtol=1e-8)


@pytest.mark.slow
def test_it_allows_for_what_is_known():
    series = mission(earlier_surveys=2, hours=0.3)
    found, fit = mission_efficiency(series), series.soil_map.fit
    assert 0.5 < found.reached <= 1
    assert not found.of_truth
    unaware = replace(series.soil_map, fit=replace(fit, prior=None))
    nothing = replace(series.properties[0], soil_map=unaware, truth_rate=np.full_like(series.truth_rate, np.nan))
    assert found.left < 0.9 * mission_efficiency(replace(series, properties=[nothing])).left


def test_without_a_map_there_is_no_figure():
    short = mission(hours=0.05, strategy="greedy", dwell="fmi:600")
    assert mission_efficiency(replace(short, properties=[replace(short.properties[0], soil_map=None)])) is None


@pytest.mark.slow
def test_the_target_changes_where_the_time_goes():
    rate, moisture = mission(field="synthetic-high"), mission(field="synthetic-high", target="vwc")
    plan = mission_efficiency(moisture)
    assert plan.moisture
    assert 0.3 < plan.reached <= 1
    wet = [sum(row.exposure_s for row in run.records if row.x_m < 30) for run in (rate, moisture)]
    assert moisture.records != rate.records
    # the wet side has fewer counts
    west = run_mean(moisture, lambda x: x < 30)
    east = run_mean(moisture, lambda x: x > 30)
    assert (wet[1] > wet[0]) == (west < east)


def run_mean(run, side):
    here = [row for row in run.records if side(row.x_m)]
    return sum(row.raw_counts for row in here) / sum(row.effective_exposure_s for row in here)


def test_a_target_without_a_calibration_is_refused(tmp_path):
    field = tmp_path / "bare.yaml"
    field.write_text(
        "name: bare\ndatum: {latitude_deg: 53.2, longitude_deg: -0.5}\n"
        "polygon: [[0, 0], [40, 0], [40, 30], [0, 30]]\ntruth: {formula: {family: gradient, low: 3, high: 5}}\n"
    )
    with pytest.raises(InputError, match="no calibration"):
        simulate_mission(MissionSettings(field=str(field), target="vwc", hours=0.2))
