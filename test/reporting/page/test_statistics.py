# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import dataclasses
import json
import math
import re

import numpy as np
import pytest

from soilmoist_ros.cli.answer import print_knowledge
from soilmoist_ros.mapping import Covariates, FieldMap, FieldMapSettings, PoissonKriging, Samples, make_soil_map
from soilmoist_ros.mapping.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge import Knowledge
from soilmoist_ros.mapping.samples import as_samples, footprint_spread
from soilmoist_ros.mapping.soil_map import possible_moisture
from soilmoist_ros.pipeline.run import NoteCode
from soilmoist_ros.reporting import mean_moisture, notes, summary, truth_score
from soilmoist_ros.reporting.page.report import render_report
from soilmoist_ros.reporting.page.statistics import (
    calibration_sd,
    covariate_importance,
    explained_share,
    leave_one_out,
    mean_sd,
    resolution_m,
)
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.robot.virtual_devices import VirtualSensor


def test_leave_one_out_is_what_kriging_without_the_sample_says(the_map):
    samples, loo = the_map.samples, leave_one_out(the_map)
    for i in (0, 5):
        rest = np.arange(len(samples)) != i
        kriging = PoissonKriging(the_map.variogram, mean_rate=the_map.mean_rate)
        kriging.fit(samples.xy[rest], samples.counts[rest], samples.exposure_s[rest])
        rate, variance = kriging.predict(samples.xy[i : i + 1])
        assert loo.observed[i] == pytest.approx(samples.rate_cps[i])
        assert loo.predicted[i] == pytest.approx(rate[0])
        assert loo.sd[i] ** 2 == pytest.approx(variance[0] + the_map.mean_rate / samples.exposure_s[i])


def test_mean_sd_of_one_cell_is_that_of_the_cell(map_of, the_map):
    cell = [(6.0, 6.0), (8.0, 6.0), (8.0, 8.0), (6.0, 8.0)]
    one = map_of(vertices=cell, holes=())
    assert np.count_nonzero(one.grid.mask) == 1
    assert mean_sd(one, moisture=False) == pytest.approx(np.nanmean(one.rate_sd), rel=1e-6)
    assert mean_sd(the_map, moisture=False) < np.nanmean(the_map.rate_sd)


def test_without_a_standard_deviation_of_n0_that_of_the_calibration_is_unknown(the_map):
    unknown = dataclasses.replace(the_map, curve=dataclasses.replace(the_map.curve, n0_sd_cps=0.0))
    assert calibration_sd(unknown) is None
    assert calibration_sd(the_map) > 0


def test_truth_score(the_map):
    score = truth_score(the_map, the_map.rate + 0.01)
    assert score.rmse == pytest.approx(0.01)
    assert score.bias == pytest.approx(-0.01)
    assert score.coverage95 == 1
    with pytest.raises(ValueError, match="shape"):
        truth_score(the_map, np.zeros((2, 2)))


def test_the_mean_of_the_field_is_less_certain_after_a_drift(the_map):
    samples = the_map.samples
    timed = TimedSamples(samples, np.linspace(0, 3600, len(samples)))
    drift = Drift(0.99, False, (0.0, 3600.0), (0.0, 0.0), ((0.1, 0.1),))
    drifted = make_soil_map(
        samples, the_map.grid, the_map.variogram, the_map.curve, changing=Changing(timed, Change(drift), 3600.0)
    )
    still = make_soil_map(samples, the_map.grid, the_map.variogram, the_map.curve)
    added = math.sqrt(mean_sd(drifted, moisture=False) ** 2 - mean_sd(still, moisture=False) ** 2)
    assert added == pytest.approx(0.1 * still.mean_rate, rel=0.01), "all rates may be too high alike"
    moist, still_moist = (mean_sd(one, moisture=True) for one in (drifted, still))
    of_drift = 0.1 * still.mean_rate * float(np.mean(np.abs(still.curve.slope(still.rate[still.grid.mask]))))
    assert math.sqrt(moist**2 - still_moist**2) == pytest.approx(of_drift, rel=0.25), "and the moisture, once"


def survey_of(name, seed, footprint_m, settings):
    """A map of two rounds of a lattice of 48 stops of 60 s each, and the true mean moisture of the field."""
    rng = np.random.default_rng([seed, 11])
    field = surrogate_field(name, rng)
    curve = field.curve or CalibrationCurve(6.0, 1.4)
    grid = field.field.grid(3.0)
    (west, south), (east, north) = grid.box
    x, y = np.meshgrid(np.linspace(west, east, 17)[1::2], np.linspace(south, north, 13)[1::2])
    places = np.column_stack([x.ravel(), y.ravel()])
    rate = VirtualSensor(field, rng, footprint_m=footprint_m).rate_at(places)
    spread = footprint_spread(settings.sample_radius_m)
    field_map = FieldMap(grid, dataclasses.replace(settings, curve=curve))
    field_map.set_samples(Samples(places, rng.poisson(120 * rate), np.full(len(places), 120.0), spread))
    return field_map.update(), float(possible_moisture(curve, field.rate_at(grid.cells)).mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("footprint_m", "settings"),
    [
        (0.0, FieldMapSettings()),
        (10.0, FieldMapSettings(footprint_radius_m=10.0, deconvolve=False)),
        (10.0, FieldMapSettings(footprint_radius_m=10.0)),
    ],
    ids=["point", "means over a footprint", "de-convolved"],
)
def test_the_interval_of_the_mean_moisture_holds_the_true_mean(footprint_m, settings):
    """On patchy and rough fields and one with steep borders: about 9 in 10, without a bias towards dry soil."""
    scores = []
    for name in ("rough", "patches", "synthetic-high", "strips"):
        for seed in range(4):
            soil_map, truth = survey_of(name, seed, footprint_m, settings)
            found = mean_moisture(soil_map)
            scores.append(((found.value - truth) / found.between_sd, found.p05 <= truth <= found.p95))
    errors, covered = np.array(scores).T
    assert covered.sum() >= 13
    assert abs(errors.mean()) < 0.6
    assert 0.5 < np.sqrt(np.mean(errors**2)) < 1.4


def test_a_map_of_few_counts_explains_little_and_resolves_little(map_of, the_map):
    few = map_of(n=4)
    assert explained_share(few) < explained_share(the_map) < 1
    assert resolution_m(few, 0.0) > resolution_m(the_map, 0.0) >= the_map.grid.cell_m
    assert resolution_m(the_map, 40.0) == 40


# What the covariates of a map explain ---------------------------------------------------------------------------

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


def test_summary_report_notes_and_command_state_it(explained, make_run, capsys):
    soil_map, covariates = explained
    run = make_run(soil_map=soil_map, covariates=covariates)
    told = json.loads(json.dumps(summary(run)))["covariates"]
    assert [one["name"] for one in told] == ["relief", "useless"]
    assert told[0]["rate_cps_per_sd"]["p025"] > 0
    assert set(told[0]) == {"name", "rate_cps_per_sd", "vwc_per_sd", "variance_share", "covered_share"}
    assert '<td class="n">left out</td><td class="n">none found</td>' in render_report(run)
    print_knowledge(run)
    first, second = re.findall("^covariate  (.*)$", capsys.readouterr().out, re.MULTILINE)
    assert re.fullmatch(
        r"relief: -\S+ \(-\S+ to -\S+\) % by volume per standard deviation, .* of the variance", first
    )
    assert second == "useless: left out"
    (note,) = [note for note in notes(run) if note.code is NoteCode.COVARIATE_GAPS]
    assert "useless (68" in note.message
    assert "relief" not in note.message
