# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Restricted likelihood: derivatives, priors, blocks, its highest peak and its uncertainty."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import approx_fprime, minimize
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal

from soilmoist_ros.mapping import PoissonKriging, Prior, Samples, Variogram
from soilmoist_ros.mapping.samples import spatial_blocks
from soilmoist_ros.mapping.variogram import reml
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.model import mode_of
from soilmoist_ros.mapping.variogram.reml import RestrictedLikelihood, maximise_reml, minimise


def some_samples(n=40):
    rng = np.random.default_rng(0)
    exposure_s = rng.uniform(60, 600, n)
    return Samples(rng.uniform(0, 200, (n, 2)), rng.poisson(3 * exposure_s), exposure_s)


def simulated(truth, n, side, exposure_s, seed):
    """Counts from a Gaussian random field of rates."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (n, 2))
    rate = 4.0 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
    assert rate.min() > 0
    return Samples(xy, rng.poisson(rate * exposure_s), np.full(n, exposure_s))


def test_likelihood_is_that_of_contrasts():
    """REML by its definition: the Gaussian density of n - 1 orthonormal contrasts of the rates."""
    samples = some_samples(12)
    n = len(samples)
    contrasts = np.linalg.svd(np.ones((1, n)))[2][1:]
    variogram = Variogram("matern52", 0.02, 30.0, 0.3)
    noise = samples.mean_rate_cps / samples.exposure_s
    covariance = contrasts @ (variogram.covariance(cdist(samples.xy, samples.xy)) + np.diag(noise)) @ contrasts.T
    expected = multivariate_normal(np.zeros(n - 1), covariance).logpdf(contrasts @ samples.rate_cps)
    found = RestrictedLikelihood(samples, "matern52").value(np.log([0.28, 30.0, 0.02]))
    # The restricted likelihood is usually written without the constant log(n)/2 of the contrasts' scale.
    assert found == pytest.approx(expected - 0.5 * np.log(n), rel=1e-10)


@pytest.mark.parametrize("blocks", [None, [np.arange(15), np.arange(15, 40)]], ids=["full", "composite"])
@pytest.mark.parametrize("model", MODELS)
def test_gradient_is_the_derivative(model, blocks):
    likelihood = RestrictedLikelihood(some_samples(), model, blocks)
    for parameters in ([0.3, 40, 0.02], [0.01, 15, 0.3], [2.0, 150, 1e-3]):
        at = np.log(parameters)
        value, gradient = likelihood.expand(at)[:2]
        assert value == pytest.approx(likelihood.value(at), rel=1e-13)
        numeric = [(likelihood.value(at + step) - likelihood.value(at - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
        np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6 * np.abs(gradient).max())


def test_blocks_are_a_compact_partition():
    xy = np.random.default_rng(0).uniform(0, 100, (3000, 2)) * [3, 1]
    blocks = spatial_blocks(xy, 1000, 500)
    np.testing.assert_array_equal(np.sort(np.concatenate(blocks)), np.arange(3000))
    assert max(map(len, blocks)) <= 500
    assert min(map(len, blocks)) >= 250
    assert max(np.ptp(xy[block], axis=0).max() for block in blocks) < 120
    assert len(spatial_blocks(xy[:1000], 1000, 500)) == 1


def test_a_variance_that_chance_explains_hardly_moves_the_prior():
    """360 counts cannot show that a field varies by less than the guess; 36,000 can."""
    rng = np.random.default_rng(0)
    xy, exposure_s = rng.uniform(0, 60, (300, 2)), np.full(300, 24.0)
    shares = []
    for rate in (0.05, 5.0):
        prior = Prior.of(Samples(xy, rng.poisson(rate * exposure_s), exposure_s), "matern32", 60.0)
        shares.append(np.exp(prior.log_median[0]) / (Prior.GUESSED_VARIATION * rate) ** 2)
    assert shares[0] > 0.5
    assert shares[1] < 0.1


def test_the_mode_has_no_slope():
    samples = some_samples()
    prior = Prior.of(samples, "matern32", 200.0)
    likelihood = RestrictedLikelihood(samples, "matern32")
    fitted = maximise_reml(samples, "matern32", 200.0)
    variogram = mode_of(fitted.variogram, fitted.log_sd)
    mode = np.log([variogram.structured_sill, variogram.range_m, variogram.nugget])

    def log_posterior(at):
        return likelihood.value(at) - 0.5 * np.sum(((at - prior.log_median) / prior.log_sd) ** 2)

    np.testing.assert_allclose(approx_fprime(mode, log_posterior, 1e-6), 0, atol=1e-3)
    assert fitted.log_likelihood == pytest.approx(likelihood.value(mode), rel=1e-9)
    assert fitted.converged


def test_a_search_that_does_not_come_to_rest_says_so(monkeypatch):
    monkeypatch.setattr(reml, "_MAX_STEPS", 1)
    assert not maximise_reml(some_samples(), "matern32", 200.0).converged


@pytest.mark.parametrize("seed", range(2))
def test_the_search_stops_within_a_hundredth_of_the_uncertainty(seed, monkeypatch):
    samples = simulated(Variogram("matern32", 0.02, 20.0, 0.3), 25 * (seed + 1), 60.0, 60.0, seed)
    found = maximise_reml(samples, "matern32", 60.0)
    monkeypatch.setattr(reml, "_TOLERANCE", 1e-7)
    monkeypatch.setattr(reml, "_ROUGH", 1e-7)
    expected = maximise_reml(samples, "matern32", 60.0)
    one, other = found.variogram, expected.variogram
    factors = one.structured_sill / other.structured_sill, one.range_m / other.range_m, one.nugget / other.nugget
    assert (np.abs(np.log(factors)) < 0.01 * np.array(expected.log_sd)).all()
    assert found.variogram.anisotropy == pytest.approx(expected.variogram.anisotropy, rel=1e-3)


@pytest.mark.slow
def test_the_truth_is_recovered_from_much_data():
    truth = Variogram("matern32", 0.05, 25.0, 0.45)
    fitted = maximise_reml(simulated(truth, 900, 300.0, 600.0, seed=3), "matern32", 300.0)
    found = fitted.variogram
    errors = np.log([found.structured_sill / 0.4, found.range_m / 25.0, found.nugget / 0.05])
    assert (np.abs(errors) < 2.5 * np.array(fitted.log_sd)).all()
    assert max(fitted.log_sd) < 0.35
    assert max(fitted.prior_share) < 0.1


@pytest.mark.slow
def test_the_composite_likelihood_recovers_the_truth_too():
    truth = Variogram("exponential", 0.05, 20.0, 0.45)
    found = maximise_reml(simulated(truth, 1500, 400.0, 600.0, seed=4), "exponential", 400.0).variogram
    assert found.range_m == pytest.approx(20, rel=0.35)
    assert found.structured_sill == pytest.approx(0.4, rel=0.35)


@pytest.mark.parametrize("model", MODELS)
def test_information_is_as_defined(model):
    """q' dK_i P dK_j q / 2 with P = K^-1 - K^-1 1 1' K^-1 / (1' K^-1 1) and q = P rate, by whole matrices."""
    samples, (structured, range_m, nugget) = some_samples(20), (0.35, 40.0, 0.05)
    variogram = Variogram(model, nugget, range_m, structured + nugget)
    h = cdist(samples.xy, samples.xy)
    K = variogram.covariance(h) + np.diag(samples.mean_rate_cps / samples.exposure_s)
    b = np.linalg.solve(K, np.ones(20))
    P = np.linalg.inv(K) - np.outer(b, b) / b.sum()
    slopes = [
        structured * variogram.correlation(h),
        structured * MODELS[model].with_slope((h / range_m) ** 2)[1],
        nugget * np.eye(20),
    ]
    moved = np.column_stack([slope @ P @ samples.rate_cps for slope in slopes])
    found = RestrictedLikelihood(samples, model).expand(np.log([structured, range_m, nugget]))[2]
    np.testing.assert_allclose(found, moved.T @ P @ moved / 2, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_no_climb_from_elsewhere_finds_a_higher_peak(seed):
    """Against plain L-BFGS-B from many starts; the spherical model has many small peaks close together."""
    model = list(MODELS)[seed % 5]
    rng = np.random.default_rng(seed)
    n, side = int(rng.choice([2, 3, 6, 12, 25, 50])), rng.choice([60.0, 280.0])
    exposure_s = rng.choice([20.0, 120.0, 600.0], n)
    xy = rng.uniform(0, side, (n, 2))
    truth = Variogram("matern32", rng.choice([0.0, 0.02, 0.2]), 10 ** rng.uniform(0.5, 2.2), 0.3)
    rate = 4 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
    radius_m2 = rng.choice([0.0, 25.0])
    samples = Samples(xy, rng.poisson(np.maximum(rate, 0.1) * exposure_s), exposure_s, [radius_m2, 0, radius_m2])
    prior, likelihood = Prior.of(samples, model, side), RestrictedLikelihood(samples, model)

    def cost(u):
        value, gradient = likelihood.expand(prior.log_median + prior.log_sd * u)[:2]
        return 0.5 * u @ u - value, u - prior.log_sd * gradient

    starts = [(sill, range_, nugget) for sill in (-1, 1) for range_ in (-1.5, 0, 1.5) for nugget in (-1, 1)]
    plain = [minimize(cost, start, jac=True, method="L-BFGS-B", bounds=[(-5, 5)] * 3) for start in starts]
    found = maximise_reml(samples, model, side, anisotropy=False)
    mode = mode_of(found.variogram, found.log_sd)
    mode = np.log([mode.structured_sill, mode.range_m, mode.nugget])
    at = (mode - prior.log_median) / prior.log_sd
    assert cost(at)[0] == pytest.approx(0.5 * at @ at - found.log_likelihood, abs=1e-6)
    assert cost(at)[0] < min(each.fun for each in plain) + (0.2 if model == "spherical" else 1e-4)


def test_bounds_hold_and_the_others_go_on():
    curvature, lowest = np.array([[3.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]]), np.array([9.0, -2.0, 0.5])

    def expand(x):
        return 0.5 * (x - lowest) @ curvature @ (x - lowest), curvature @ (x - lowest), curvature

    found = minimise(expand, np.zeros(3), 5.0, 1e-8)
    at_bound = [5.0, *np.linalg.solve(curvature[1:, 1:], curvature[1:, 1:] @ [-2.0, 0.5] + 4.0 * curvature[1:, 0])]
    np.testing.assert_allclose(found.at, at_bound, atol=1e-7)
    assert found.converged


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


def share_covered(family, n):
    """Share of the cells whose true rate lies in the 95 % interval, over 40 fields."""
    covered = []
    for seed in range(40):
        rng = np.random.default_rng([seed, n])
        xy, exposure_s = along_a_way(n, rng)
        rate = np.maximum(3.5 + 0.45 * FAMILIES[family](np.concatenate([xy, CELLS]), rng), 0.3)
        samples = Samples(xy, rng.poisson(rate[:n] * exposure_s), exposure_s)
        variogram = maximise_reml(samples, "matern32", SIDE_M).variogram
        estimate, variance = PoissonKriging(variogram).fit(samples.xy, samples.counts, exposure_s).predict(CELLS)
        covered.append(np.mean(np.abs(rate[n:] - estimate) <= 1.96 * np.sqrt(variance)))
    return np.mean(covered)


@pytest.mark.slow
@pytest.mark.parametrize("n", [20])
@pytest.mark.parametrize("family", FAMILIES)
def test_intervals_cover_on_every_kind_of_field(family, n):
    assert 0.915 < share_covered(family, n) < 0.99


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
        for variogram in (mode_of(fitted.variogram, fitted.log_sd), fitted.variogram):
            variance = PoissonKriging(variogram).fit(xy, samples.counts, exposure_s).predict(CELLS[::3])[1]
            ratios.append(variance.mean() / averaged.mean())
    of_mode, of_mean = np.reshape(ratios, (-1, 2)).mean(axis=0)
    assert 0.95 < of_mean < 1.25  # Laplace's approximation errs on the safe side
    assert of_mode < 0.9
