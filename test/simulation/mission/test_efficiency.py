# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.simulation import MissionSettings, mission_efficiency, simulate_mission
from soilmoist_ros.simulation.mission.efficiency import CLOSE, least_variance


def mission(**changes):
    usual = {
        "hours": 0.6, "model": "matern32", "fit": "reml", "cell_m": 3.0, "strategy": "gcb", "dwell": "optimal",
    }  # fmt: skip
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
def test_without_a_truth_it_is_that_of_the_map(published):
    unknown = replace(published.properties[0], truth_rate=np.full(published.truth_rate.shape, np.nan))
    found = mission_efficiency(replace(published, properties=[unknown]))
    assert not found.of_truth
    assert found.reached != mission_efficiency(published).reached


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


def test_a_target_without_a_calibration_is_refused(tmp_path):
    field = tmp_path / "bare.yaml"
    field.write_text(
        "name: bare\ndatum: {latitude_deg: 53.2, longitude_deg: -0.5}\n"
        "polygon: [[0, 0], [40, 0], [40, 30], [0, 30]]\ntruth: {formula: {family: gradient, low: 3, high: 5}}\n"
    )
    with pytest.raises(InputError, match="no calibration"):
        simulate_mission(MissionSettings(field=str(field), target="vwc", hours=0.2))


# The bound: no design leaves less

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(2.0, 40.0, 4.0), np.arange(2.0, 30.0, 4.0)))
CELLS = np.column_stack([X, Y])
EVEN = np.full(len(CELLS), 1 / len(CELLS))
VARIOGRAM = Variogram("matern32", 0.0, 12.0, 1.0)


def integrated_variance(xy, exposure_s, rate_cps=4.0, weight=EVEN, variogram=VARIOGRAM):
    """Variance that kriging leaves; the mean rate alone makes the noise."""
    kriging = PoissonKriging(variogram, False, mean_rate=rate_cps)
    kriging.fit(xy, np.rint(rate_cps * exposure_s), exposure_s)
    return float(weight @ kriging.predict(CELLS)[1])


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 40), weighted=st.booleans())
@pytest.mark.slow
def test_no_design_leaves_less(seed, count, weighted):
    rng = np.random.default_rng(seed)
    weight = rng.dirichlet(np.ones(len(CELLS))) if weighted else EVEN
    time_s = float(rng.uniform(100, 10_000))
    xy = CELLS[rng.choice(len(CELLS), count, replace=False)]
    exposure_s = np.maximum(time_s * rng.dirichlet(np.ones(count)), 1e-6)
    least, _, gap = least_variance(VARIOGRAM, CELLS, weight, np.full(len(CELLS), 4.0), time_s)
    # kriging does not know the mean at all, the bound knows a little: it is the lower one
    assert least * (1 - gap) <= integrated_variance(xy, exposure_s, weight=weight)


def test_the_design_it_finds_leaves_what_it_says():
    least, dwell_s, gap = least_variance(VARIOGRAM, CELLS, EVEN, np.full(len(CELLS), 4.0), 3600.0)
    assert gap <= 2 * CLOSE
    assert dwell_s.sum() == pytest.approx(3600.0)
    used = dwell_s > 1e-3
    assert least == pytest.approx(integrated_variance(CELLS[used], dwell_s[used]), rel=0.01)
