# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surveys of other fields as prior of a variogram: draws from the model, files, and fields that are unlike."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import FarmPrior, FarmSurvey, FieldMap, Samples, Variogram, estimate_variogram
from soilmoist_ros.mapping.field_map import FieldMapSettings

USUAL, USUAL_SD = np.log([0.15, 40.0, 0.05]), np.array([0.5, 1.0, 1.5])


def farm(range_m, variation=0.1, sd=0.15, count=4):
    values = tuple(np.log([variation, range_m, 0.05]).tolist())
    return FarmPrior(tuple(FarmSurvey(f"field {k}", values, (sd, sd, math.inf)) for k in range(count)))


def samples(practical_range_m, seed, n=60, side=100.0, exposure_s=60.0):
    """Counts from a Gaussian field of rates that varies by 10 % of its mean."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (n, 2))
    truth = Variogram("matern32", 0.008, practical_range_m / 2.74, 0.168)
    rate = 4.0 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
    return Samples(xy, rng.poisson(rate * exposure_s), np.full(n, exposure_s))


def fitted(one, farm=None):
    return estimate_variogram(one.xy, one.counts, one.exposure_s, extent_m=100.0, anisotropy=False, farm=farm)


@pytest.mark.parametrize("count", [2, 5, 12])
def test_intervals_hold_fields_drawn_from_a_farm(count):
    """Farms with any mean and spread: the 90 % interval of the next field's range holds it in 90 %."""
    rng = np.random.default_rng(count)
    inside, draws = 0, 400
    for _ in range(draws):
        mean, tau = rng.normal(USUAL[1], 0.7), min(abs(rng.standard_cauchy()) * 0.5, 1.5)
        errors = rng.uniform(0.1, 0.6, count)
        values = mean + tau * rng.standard_normal(count) + errors * rng.standard_normal(count)
        surveys = (
            FarmSurvey("", (0.0, float(value), 0.0), (math.inf, float(error), math.inf))
            for value, error in zip(values, errors, strict=True)
        )
        expected, sd = FarmPrior(tuple(surveys)).expected(USUAL, np.full(3, 9.0))
        inside += abs(mean + tau * rng.standard_normal() - expected[1]) < 1.645 * sd[1]
    assert 0.86 <= inside / draws <= 0.95


def test_surveys_that_say_nothing_leave_the_usual_prior():
    nothing = FarmPrior((FarmSurvey("", (0.0, 0.0, 0.0), (math.inf,) * 3),))
    np.testing.assert_allclose(nothing.expected(USUAL, USUAL_SD), (USUAL, USUAL_SD))


def test_like_fields_sharpen_the_range_and_unlike_ones_change_nothing():
    usual, by_farm = [], []
    for seed in range(12):
        one = samples(60.0, seed, n=15)
        usual.append(math.log(fitted(one).variogram.range_m * 2.74 / 60))
        by_farm.append(math.log(fitted(one, farm(60.0)).variogram.range_m * 2.74 / 60))
    assert np.mean(np.square(by_farm)) < 0.75 * np.mean(np.square(usual))
    for seed in range(4):
        one = samples(70.0, seed, n=120)
        assert fitted(one, farm(5.0, 0.4)).variogram == fitted(one).variogram


def test_a_table_and_runs_are_read_as_they_were_written(tmp_path):
    fit = fitted(samples(60.0, 1))
    survey = FarmSurvey.of("home", fit.mode, fit.mean_rate, fit.log_sd, fit.prior_share)
    names = ("structured_sill", "range", "nugget")
    about = {
        "fit": {
            "method": "reml", "log_sd": dict(zip(names, fit.log_sd, strict=True)),
            "prior_share": dict(zip(names, fit.prior_share, strict=True)),
        },
        "variogram": {
            "model": "matern32", "nugget_cps2": fit.variogram.nugget, "range_m": fit.variogram.range_m,
            "sill_cps2": fit.variogram.sill, "mean_rate_cps": fit.mean_rate,
        },
    }  # fmt: skip
    (tmp_path / "runs" / "home").mkdir(parents=True)
    (tmp_path / "runs" / "home" / "summary.json").write_text(json.dumps(about))
    (tmp_path / "runs" / "other.csv").write_text("name,what\na,b\n")
    (of_run,) = FarmPrior.read(tmp_path / "runs").surveys
    assert of_run.name == "home"
    np.testing.assert_allclose((of_run.log_values, of_run.log_sds), (survey.log_values, survey.log_sds))
    assert FarmPrior.read(tmp_path / "runs" / "home").surveys == (of_run,)
    table = tmp_path / "runs" / "farm.csv"
    table.write_text(FarmPrior((survey, *farm(30.0).surveys)).table())
    (of_table, neighbour) = FarmPrior.read(table).surveys  # one of four that are equal
    np.testing.assert_allclose(of_table.log_values, survey.log_values, rtol=1e-4)
    assert neighbour.log_sds[2] == math.inf
    with pytest.raises(InputError, match="soft_l1 has no prior"):
        FieldMap(None, FieldMapSettings(fit="soft_l1", prior=str(table)))
    head, first, *_ = table.read_text().splitlines()
    turned = [";".join([*reversed(line.split(","))]).replace(".", ",") for line in (head, first)]
    table.write_text("\ufeff" + "\n".join(turned))  # as a German spreadsheet saves it
    assert FarmPrior.read(table).surveys == (of_table,)


def test_the_survey_itself_is_no_other_field():
    day, mine = (replace(farm(60.0).surveys[0], times_s=times) for times in ((1e9, 1.0001e9), (2e9, 2.0001e9)))
    known = FarmPrior((day, mine))
    assert known.besides(2.00005e9) == FarmPrior((day,), 1)
    assert "1 left out that is this survey itself" in known.besides(2e9).text
    assert FarmPrior((mine,)).besides(2e9) is None
    assert known.besides(3e9).surveys == known.surveys


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is not a table of surveys"),
        ("survey,range\na,3\n", "has no column 'variation'"),
        ("HEAD", "lists no survey"),
        ("HEADa,0.1,1.2,30,1.3\n", "nugget_share is ''"),
        ("HEADa,0.1,1.2,30,1.3,0.05,2\nb,0.1,0.9,30,1.3,0.05,2\n", ":3: variation_factor is '0.9'"),
        ("HEADa,0.1,1.2,-30,1.3,0.05,2\n", "range_m is '-30'"),
        ("HEADa,0.1,1.2,nan,1.3,0.05,2\n", "range_m is 'nan'"),
        ("HEADa,30,1.2,30,1.3,0.05,2\n", "write 0.30 for 30 %"),
    ],
)
def test_other_tables_are_refused(text, why, tmp_path):
    path = tmp_path / "farm.csv"
    path.write_text(text.replace("HEAD", FarmPrior(()).table()))
    with pytest.raises(InputError, match=why):
        FarmPrior.read(path)


def test_a_folder_without_surveys_is_refused(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "summary.json").write_text('{"fit": {"method": "soft_l1"}, "variogram": {}}')
    with pytest.raises(InputError, match="neither a run"):
        FarmPrior.read(tmp_path)
    (tmp_path / "run" / "summary.json").write_text('{"fit": {"method": "reml"')
    with pytest.raises(InputError, match="summary of a run"):
        FarmPrior.read(tmp_path)
