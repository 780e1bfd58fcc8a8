# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.optimize import approx_fprime, minimize
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.variogram import reml
from soilmoist_ros.mapping.variogram.correlation import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.reml import (
    Prior,
    RestrictedLikelihood,
    maximise_reml,
    mode_of,
    spatial_blocks,
)


def some_samples(n=40, seed=0):
    rng = np.random.default_rng(seed)
    exposure_s = rng.uniform(60, 600, n)
    return Samples(rng.uniform(0, 200, (n, 2)), rng.poisson(3 * exposure_s), exposure_s)


def simulated(truth, n, side, exposure_s, seed, mean=4.0):
    """Counts from a Gaussian random field of rates."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (n, 2))
    rate = mean + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
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


def test_composite_of_one_block_is_the_full_likelihood():
    samples = some_samples()
    at = np.log([0.3, 40, 0.02])
    full = RestrictedLikelihood(samples, "matern32").expand(at)[:2]
    one = RestrictedLikelihood(samples, "matern32", spatial_blocks(samples.xy)).expand(at)[:2]
    assert one[0] == full[0]
    np.testing.assert_array_equal(one[1], full[1])
    shuffled = [np.random.default_rng(0).permutation(40)]
    assert RestrictedLikelihood(samples, "matern32", shuffled).value(at) == pytest.approx(full[0], rel=1e-12)


def test_blocks_are_a_compact_partition():
    xy = np.random.default_rng(0).uniform(0, 100, (3000, 2)) * [3, 1]
    blocks = spatial_blocks(xy)
    np.testing.assert_array_equal(np.sort(np.concatenate(blocks)), np.arange(3000))
    assert max(map(len, blocks)) <= 500
    assert min(map(len, blocks)) >= 250
    assert max(np.ptp(xy[block], axis=0).max() for block in blocks) < 120
    assert len(spatial_blocks(xy[:1000])) == 1


def test_the_mode_has_no_slope():
    samples = some_samples()
    prior = Prior.of(samples, "matern32", 200.0)
    likelihood = RestrictedLikelihood(samples, "matern32")
    fitted = maximise_reml(samples, "matern32", 200.0)
    variogram = fitted.mode
    mode = np.log([variogram.structured_sill, variogram.range_m, variogram.nugget])

    def log_posterior(at):
        return likelihood.value(at) - 0.5 * np.sum(((at - prior.log_median) / prior.log_sd) ** 2)

    np.testing.assert_allclose(approx_fprime(mode, log_posterior, 1e-6), 0, atol=1e-3)
    assert fitted.log_likelihood == pytest.approx(likelihood.value(mode), rel=1e-9)
    assert fitted.converged


@pytest.mark.parametrize("seed", range(4))
def test_the_search_stops_within_a_hundredth_of_the_uncertainty(seed, monkeypatch):
    samples = simulated(Variogram("matern32", 0.02, 20.0, 0.3), 25 * (seed + 1), 60.0, 60.0, seed)
    found = maximise_reml(samples, "matern32", 60.0)
    monkeypatch.setattr(reml, "_TOLERANCE", 1e-7)
    monkeypatch.setattr(reml, "_ROUGH", 1e-7)
    expected = maximise_reml(samples, "matern32", 60.0)
    for one, other in ((found.mode, expected.mode), (found.variogram, expected.variogram)):
        factors = [
            one.structured_sill / other.structured_sill,
            one.range_m / other.range_m,
            one.nugget / other.nugget,
        ]
        assert (np.abs(np.log(factors)) < 0.01 * np.array(expected.log_sd)).all()
    assert found.variogram.anisotropy == pytest.approx(expected.variogram.anisotropy, rel=1e-3)


def test_a_search_from_the_last_mode_is_shorter_than_from_posterior_means(monkeypatch):
    samples = simulated(Variogram("matern32", 0.02, 20.0, 0.3), 60, 60.0, 60.0, 1)
    before = maximise_reml(samples, "matern32", 60.0)
    mode = mode_of(before.variogram, before.log_sd)
    assert mode.sill == pytest.approx(before.mode.sill, rel=1e-12)
    assert mode.nugget == pytest.approx(before.mode.nugget, rel=1e-12)
    more = Samples(samples.xy, samples.counts + 50, samples.exposure_s + 12.0)
    expand, calls = RestrictedLikelihood.expand, []
    monkeypatch.setattr(RestrictedLikelihood, "expand", lambda self, at: calls.append(at) or expand(self, at))
    assert maximise_reml(more, "matern32", 60.0, like=mode).converged
    of_mode = len(calls)
    assert maximise_reml(more, "matern32", 60.0, like=before.variogram).converged
    assert of_mode < len(calls) - of_mode
    assert of_mode <= 3 + 7  # three are the second derivatives at the mode


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


@pytest.mark.slow
def test_the_prior_fades_as_samples_come_in():
    truth = Variogram("matern32", 0.02, 40.0, 0.3)
    samples = simulated(truth, 300, 300.0, 600.0, seed=5)
    shares = []
    for n in (3, 30, 300):
        first = Samples(samples.xy[:n], samples.counts[:n], samples.exposure_s[:n])
        shares.append(maximise_reml(first, "matern32", 300.0).prior_share)
    assert (np.diff(shares, axis=0) < 0).all()
    assert shares[0][1] > 0.6
    assert max(shares[2]) < 0.3


@pytest.mark.slow
def test_intervals_of_the_latent_rate_cover_what_they_promise():
    """95 % intervals of kriging, for the rate itself, micro-scale variation included."""
    truth = Variogram("matern32", 0.02, 45.0, 0.35)
    covered = np.empty((100, 2))
    for seed in range(100):
        rng = np.random.default_rng(seed)
        xy = rng.uniform([0, 0], [210, 330], (72 + 150, 2))
        rate = 4 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(len(xy))
        assert rate.min() > 0
        exposure_s = rng.choice([60.0, 120.0, 300.0], 72)
        samples = Samples(xy[:72], rng.poisson(rate[:72] * exposure_s), exposure_s)
        for column, variogram in enumerate([truth, maximise_reml(samples, "matern32", 330.0).variogram]):
            kriging = PoissonKriging(variogram).fit(samples.xy, samples.counts, samples.exposure_s)
            estimate, variance = kriging.predict(xy[72:])
            covered[seed, column] = np.mean(np.abs(rate[72:] - estimate) < 1.96 * np.sqrt(variance))
    of_truth, of_fit = covered.mean(axis=0)
    assert 0.94 < of_truth < 0.96
    assert 0.93 < of_fit < 0.97
    assert (covered.std(axis=0) / 10 < 0.005).all()  # so the figures above mean something


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
@pytest.mark.parametrize("seed", range(25))
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
    mode = np.log([found.mode.structured_sill, found.mode.range_m, found.mode.nugget])
    at = (mode - prior.log_median) / prior.log_sd
    assert cost(at)[0] == pytest.approx(0.5 * at @ at - found.log_likelihood, abs=1e-6)
    assert cost(at)[0] < min(each.fun for each in plain) + (0.2 if model == "spherical" else 1e-4)
