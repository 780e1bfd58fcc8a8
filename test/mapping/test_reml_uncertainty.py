# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map's intervals hold what they promise, also while samples are few and lie along a way."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.variogram.reml import Prior, RestrictedLikelihood, maximise_reml

SIDE_M = 60.0
CELLS = np.array(list(product(np.arange(3.0, SIDE_M, 6.0), repeat=2)))


def along_a_way(n, rng):
    """Places and exposures of a robot that stops at random and counts on the way."""
    stops = rng.uniform(0, SIDE_M, (-(-n // 4) + 1, 2))
    share = np.arange(n) % 4 / 4
    first = np.arange(n) // 4
    xy = stops[first] + share[:, None] * (stops[first + 1] - stops[first])
    return xy, np.where(share == 0, 100.0, 15.0)


def gaussian_field(model, range_m):
    def rates(xy, rng):
        covariance = Variogram(model, 0.0, range_m, 1.0).covariance(cdist(xy, xy)) + 1e-9 * np.eye(len(xy))
        return np.linalg.cholesky(covariance) @ rng.standard_normal(len(xy))

    return rates


def patches(xy, rng):
    return np.sign(gaussian_field("matern52", SIDE_M / 8)(xy, rng))


def across(xy, rng):
    """Distances from a line through the field in a random direction, in units of its side."""
    angle = rng.uniform(0, 2 * np.pi)
    return (xy / SIDE_M - 0.5) @ [np.cos(angle), np.sin(angle)] - rng.uniform(-0.2, 0.2)


FAMILIES = {
    "gaussian, short": gaussian_field("gaussian", SIDE_M / 8),
    "gaussian, long": gaussian_field("gaussian", SIDE_M / 2),
    "matern32": gaussian_field("matern32", SIDE_M / 4),
    "exponential, short": gaussian_field("exponential", SIDE_M / 8),
    "exponential, long": gaussian_field("exponential", SIDE_M / 2),
    "patches": patches,
    "ridge": lambda xy, rng: 3 * np.exp(-((across(xy, rng) * 10) ** 2)) - 1,
    "half wet": lambda xy, rng: 1.5 * np.tanh(across(xy, rng) * 20),
}


def share_covered(family, n, fields=40):
    """Share of the cells whose true rate lies in the 95 % interval, over a number of fields."""
    covered = []
    for seed in range(fields):
        rng = np.random.default_rng([seed, n])
        xy, exposure_s = along_a_way(n, rng)
        rate = np.maximum(3.5 + 0.45 * FAMILIES[family](np.concatenate([xy, CELLS]), rng), 0.3)
        samples = Samples(xy, rng.poisson(rate[:n] * exposure_s), exposure_s)
        variogram = maximise_reml(samples, "matern32", SIDE_M).variogram
        estimate, variance = PoissonKriging(variogram).fit(samples.xy, samples.counts, exposure_s).predict(CELLS)
        covered.append(np.mean(np.abs(rate[n:] - estimate) <= 1.96 * np.sqrt(variance)))
    return np.mean(covered)


@pytest.mark.slow
@pytest.mark.parametrize("n", [20, 60])
@pytest.mark.parametrize("family", FAMILIES)
def test_intervals_cover_on_every_kind_of_field(family, n):
    assert 0.915 < share_covered(family, n) < 0.99


@pytest.mark.slow
def test_intervals_of_ten_samples_cover_over_all_kinds_of_fields():
    covered = [share_covered(family, 10, fields=20) for family in FAMILIES]
    assert 0.93 < np.mean(covered) < 0.97
    assert min(covered) > 0.85


@pytest.mark.parametrize("n", [1, 2, 5, 30])
@pytest.mark.parametrize("model", ["exponential", "matern32", "gaussian"])
def test_no_variance_is_below_that_of_the_mode(model, n):
    """A larger covariance leaves no smaller error, whatever the samples."""
    rng = np.random.default_rng(n)
    xy, exposure_s = along_a_way(n, rng)
    samples = Samples(xy, rng.poisson(3 * exposure_s), exposure_s)
    fitted = maximise_reml(samples, model, SIDE_M)
    of_mean, of_mode = (
        PoissonKriging(variogram).fit(xy, samples.counts, exposure_s).predict(CELLS)[1]
        for variogram in (fitted.variogram, fitted.mode)
    )
    assert (of_mean > of_mode).all()


def test_variances_are_means_of_log_normal_variables():
    rng = np.random.default_rng(0)
    xy, exposure_s = along_a_way(25, rng)
    fitted = maximise_reml(Samples(xy, rng.poisson(3 * exposure_s), exposure_s), "matern32", SIDE_M)
    structured, _, nugget = np.exp(np.array(fitted.log_sd) ** 2 / 2)
    assert fitted.variogram.structured_sill == pytest.approx(structured * fitted.mode.structured_sill, rel=1e-12)
    assert fitted.variogram.nugget == pytest.approx(nugget * fitted.mode.nugget, rel=1e-12)
    assert fitted.variogram.range_m == fitted.mode.range_m


@pytest.mark.slow
def test_a_sharp_posterior_is_its_mode():
    truth = Variogram("exponential", 0.3, 5.0, 0.9)
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 160, (500, 2))
    rate = np.maximum(6 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(500), 0.1)
    fitted = maximise_reml(Samples(xy, rng.poisson(rate * 3600), np.full(500, 3600.0)), "exponential", 200.0)
    assert fitted.variogram.sill == pytest.approx(fitted.mode.sill, rel=0.05)


def log_posterior(samples):
    likelihood, prior = RestrictedLikelihood(samples, "matern32"), Prior.of(samples, "matern32", SIDE_M)
    return lambda at: likelihood.value(at) - 0.5 * np.sum(((at - prior.log_median) / prior.log_sd) ** 2), prior


@pytest.mark.slow
def test_variance_is_that_averaged_over_the_posterior():
    """Against the law of total variance, with the posterior on a grid of the three parameters."""
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        xy, exposure_s = along_a_way(12, rng)
        rate = 3.5 + 0.45 * FAMILIES["matern32"](xy, rng)
        samples = Samples(xy, rng.poisson(rate * exposure_s), exposure_s)
        posterior, prior = log_posterior(samples)
        log_weights, rates, variances = [], [], []
        for u in product(np.linspace(-3, 3, 7), repeat=3):
            at = prior.log_median + prior.log_sd * np.array(u)
            log_weights.append(posterior(at))
            structured, range_m, nugget = np.exp(at)
            kriging = PoissonKriging(Variogram("matern32", nugget, range_m, structured + nugget))
            estimate, variance = kriging.fit(xy, samples.counts, exposure_s).predict(CELLS[::3])
            rates.append(estimate)
            variances.append(variance)
        weights = np.exp(np.array(log_weights) - max(log_weights))
        weights /= weights.sum()
        mean = weights @ np.array(rates)
        averaged = weights @ (np.array(variances) + (np.array(rates) - mean) ** 2)
        fitted = maximise_reml(samples, "matern32", SIDE_M)
        for variogram in (fitted.mode, fitted.variogram):
            variance = PoissonKriging(variogram).fit(xy, samples.counts, exposure_s).predict(CELLS[::3])[1]
            ratios.append(variance.mean() / averaged.mean())
    of_mode, of_mean = np.reshape(ratios, (-1, 2)).mean(axis=0)
    assert 0.95 < of_mean < 1.25  # Laplace's approximation errs on the safe side
    assert of_mode < 0.9
