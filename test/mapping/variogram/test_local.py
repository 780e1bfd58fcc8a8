# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What differs from place to place: the rate in the noise, and the amplitude of the rate."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples, noise_rate
from soilmoist_ros.mapping.variogram import local as local_fit
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.mapping.variogram.local import MAX_POOLS, MIN_EVIDENCE, MIN_PLACES, LocalRate, fit_amplitude
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.reml import Prior, RestrictedLikelihood
from soilmoist_ros.simulation.fields.formulas import formula
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent

VARIOGRAM = Variogram("matern32", 0.01, 15.0, 1.0)
TURNED = Variogram("exponential", 0.0, 20.0, 0.8, 4.0, 30.0)


def survey(n):
    """Counts on a field of 60 x 50 m, 2.5 counts/s in the west and 5 in the east."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, (60, 50), (n, 2))
    rate = np.where(xy[:, 0] < 30, 2.5, 5.0)
    return Samples(xy, rng.poisson(rate * 60.0), np.full(n, 60.0)), rate


@pytest.mark.parametrize("n", [60, 129, 1000])
def test_the_noise_is_that_of_the_place(n):
    """With the mean rate it is 50 % too large on grass and 25 % too small on concrete."""
    samples, rate = survey(n)
    away = np.abs(samples.xy[:, 0] - 30) > 10
    local = LocalRate.of(samples, VARIOGRAM)
    np.testing.assert_allclose(local(samples.xy)[away], rate[away], rtol=0.2)
    assert (
        np.abs(local(samples.xy) / rate - 1).mean() < 0.08 < 0.3 < np.abs(samples.mean_rate_cps / rate - 1).mean()
    )
    assert len(local.pools_xy) <= MAX_POOLS


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.integers(1, 300), st.integers(1, 40), st.sampled_from([VARIOGRAM, TURNED]), st.randoms())
def test_the_rate_at_a_place_does_not_depend_on_the_others(n, places, variogram, random):
    local = LocalRate.of(survey(n)[0], variogram)
    xy = np.array([(random.uniform(-10, 70), random.uniform(-10, 60)) for _ in range(places)])
    together = local(xy)
    alone = np.concatenate([local(xy[i : i + 1]) for i in range(places)])
    np.testing.assert_array_equal(together, alone)
    assert (together >= local.least).all()
    assert local.least > 0


def test_nothing_counted_leaves_the_noise_of_half_a_count():
    samples = Samples([(0, 0), (9, 0)], [0, 0], [10.0, 10.0])
    local = LocalRate.of(samples, VARIOGRAM)
    np.testing.assert_array_equal(local(np.array([(0.0, 0.0), (4.0, 4.0)])), noise_rate(samples))


GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], 2.0)
EXTENT = GridExtent.of(np.array([[0.0, 0.0], [60.0, 50.0]]), 2.0)
MODE = Variogram("matern32", 0.02, 11.0, 0.35, 2.0, 40.0)
UNEVEN = {"family": "halves", "mean": 4.0, "sd": 0.9, "flat_sd": 0.12, "range_m": 8.0, "angle_deg": 0.0}
EVEN = {"family": "exponential", "mean": 4.0, "sd": 0.6, "range_m": 12.0}


def rough_survey(parameters, seed, n=200):
    """Samples at random places of a drawn field, and its true rate."""
    rng = np.random.default_rng(seed)
    parameters = dict(parameters)
    truth = formula(parameters.pop("family"), **parameters).function(EXTENT, rng)
    xy = rng.uniform((0, 0), (60, 50), (n, 2))
    return Samples(xy, rng.poisson(truth(xy) * 40.0).astype(float), np.full(n, 40.0)), truth


def estimate(samples, box=GRID.box):
    return estimate_variogram(
        samples.xy, samples.counts, samples.exposure_s, extent_m=60.0, spread=samples.spread, local_noise=True,
        box=box,
    )  # fmt: skip


def likelihood(samples, mode=MODE, rate=4.0):
    return local_fit._Likelihood(samples, mode, rate, GRID.box, Prior.of(samples, mode.model, 60.0))


@pytest.mark.parametrize("driven", [False, True])
def test_the_gradient_is_that_of_the_value(driven):
    samples, _ = rough_survey(UNEVEN, 1, 60)
    if driven:
        samples = replace(samples, spread=np.tile([3.0, 1.0, 0.5], (60, 1)))
    problem = likelihood(samples)
    at = problem.start + np.random.default_rng(0).normal(0, 0.2, len(problem.start))
    gradient = problem.expand(at)[1]
    for number in (0, 1, 2, 3, 11, len(at) - 1):
        step = np.zeros(len(at))
        step[number] = 1e-5
        difference = (problem.expand(at + step)[0] - problem.expand(at - step)[0]) / 2e-5
        assert gradient[number] == pytest.approx(difference, rel=1e-4, abs=1e-5)


def test_without_an_amplitude_the_likelihood_is_the_stationary_one():
    samples, _ = rough_survey(EVEN, 2, 50)
    mode = replace(MODE, anisotropy=1.0)
    problem = likelihood(samples, mode, samples.mean_rate_cps)
    value = 0.5 * problem.start @ problem.start - problem.expand(problem.start)[0]
    log = np.log([mode.structured_sill, mode.range_m, mode.nugget])
    assert value == pytest.approx(RestrictedLikelihood(samples, "matern32").value(log), rel=1e-9)


@pytest.mark.slow
def test_stationary_fields_keep_their_variogram_bit_for_bit():
    used = 0
    for seed in range(6):
        samples, _ = rough_survey(EVEN, seed)
        plain, tested = estimate(samples, None), estimate(samples)
        assert tested.local is not None
        assert tested.stationary == plain.variogram
        used += tested.variogram != plain.variogram
        assert (tested.variogram.amplitude is None) == (tested.local.evidence < MIN_EVIDENCE)
    assert used <= 1


@pytest.mark.slow
def test_an_uneven_field_has_an_amplitude_that_follows_it():
    fits = [estimate(rough_survey(UNEVEN, seed)[0]) for seed in range(4)]
    local = [fit.variogram for fit in fits if fit.variogram.amplitude is not None]
    assert len(local) >= 3
    flat, rough = np.array([[10.0, y] for y in range(5, 50, 5)]), np.array([[50.0, y] for y in range(5, 50, 5)])
    ratio = [np.mean(one.amplitude(rough)) / np.mean(one.amplitude(flat)) for one in local]
    assert np.mean(ratio) > 2
    assert "differs from place to place" in next(fit for fit in fits if fit.variogram.amplitude).local_text
    for one in local:  # the sill is the mean variance
        assert np.mean(one.amplitude(GRID.cells) ** 2) == pytest.approx(1.0, abs=0.2)


def test_too_few_samples_or_a_flat_box_are_not_tested():
    samples, _ = rough_survey(UNEVEN, 0, MIN_PLACES - 1)
    assert estimate(samples).local is None
    assert estimate(samples).local_text == "not tested"
    more, _ = rough_survey(UNEVEN, 0, 40)
    assert estimate(more, ((0, 0), (0, 50))).local is None
    assert fit_amplitude(more, MODE, replace(MODE, nugget=0.0), 4.0, GRID.box, 60.0) is None


def quarters(truth):
    """Quarter of each cell, 0 to 3, by the standard deviation of the truth within 10 x 10 m."""
    x, y = GRID.cells.T
    windows = (np.abs(x - x[:, None]) <= 5) & (np.abs(y - y[:, None]) <= 5)
    rate = truth(GRID.cells)
    spread = np.array([rate[window].std() for window in windows])
    return np.searchsorted(np.quantile(spread, [0.25, 0.5, 0.75]), spread)


@pytest.mark.slow
def test_intervals_cover_the_truth_in_each_quarter_by_local_variability():
    """Stationary intervals are too narrow where the field is rough, and wider than they need to be elsewhere."""
    inside, error, width = ({"local": [], "stationary": []} for _ in range(3))
    for seed in range(20, 32):
        samples, truth = rough_survey(UNEVEN, seed)
        quarter = quarters(truth)
        fit = estimate(samples)
        for name, variogram in (("local", fit.variogram), ("stationary", fit.stationary)):
            kriging = PoissonKriging(variogram, True, fit.noise_rate)
            rate, variance = kriging.fit(samples.xy, samples.counts, samples.exposure_s).predict(GRID.cells)
            miss = rate - truth(GRID.cells)
            covered = np.abs(miss) < 1.96 * np.sqrt(variance)
            inside[name].append([covered[quarter == k].mean() for k in range(4)])
            width[name].append(np.sqrt(variance)[quarter == 0].mean())
            error[name].append(np.mean(miss**2))
    local, stationary = (np.mean(inside[name], axis=0) for name in ("local", "stationary"))
    assert stationary[3] < 0.92
    assert local[3] > stationary[3] + 0.02
    assert local.min() >= 0.90
    assert np.mean(width["local"]) < 0.85 * np.mean(width["stationary"])
    assert np.mean(error["local"]) < 0.95 * np.mean(error["stationary"])
