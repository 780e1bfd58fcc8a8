# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.kriging.system import Points
from soilmoist_ros.mapping.samples import MIN_SPREAD_M2, footprint_spread, path_spread, without_noise
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.reml import RestrictedLikelihood
from soilmoist_ros.mapping.variogram.support import SupportCorrelation, Supports, near_share
from soilmoist_ros.sensing.moisture.footprint import Footprint

EVERY = slice(None)
vectors = st.tuples(st.floats(-20, 20), st.floats(-20, 20))
radii = st.sampled_from([0.0, 5.0, 10.0])


def survey(n=25, radius_m=0.0):
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 60, (n, 2))
    spread = path_spread(rng.uniform(-8.0, 8.0, (n, 2))) + footprint_spread(radius_m)
    return xy, rng.poisson(300, n), rng.uniform(60, 140, n), spread


def way(along_m, steps=400):
    """Many points evenly along a way about the origin."""
    return (np.arange(steps)[:, None] + 0.5 - steps / 2) / steps * np.asarray(along_m)


def footprint(radius_m):
    """Many points of a footprint, with equal shares of the counts."""
    radius = Footprint.shielded(radius_m).rings(40)
    angle = (np.arange(24) + 0.5) / 24 * 2 * math.pi
    return np.stack([np.outer(radius, f(angle)).ravel() for f in (np.cos, np.sin)], axis=1)


# -- spreads -------------------------------------------------------------------------------------------


@given(vectors)
def test_the_spread_of_a_way_is_the_covariance_of_its_points(along):
    xx, xy, yy, radius_m = path_spread(along)
    assert radius_m == 0
    np.testing.assert_allclose([[xx, xy], [xy, yy]], np.cov(way(along).T, bias=True), rtol=1e-4, atol=1e-9)


def test_the_footprint_has_86_percent_within_its_radius():
    assert np.mean(np.hypot(*footprint(10.0).T) <= 10.0) == pytest.approx(0.86, abs=0.02)
    np.testing.assert_array_equal(footprint_spread(10.0), [0, 0, 0, 10])
    assert not footprint_spread(0.0).any()
    for radius_m in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="radius of a footprint"):
            footprint_spread(radius_m)


def test_spreads_that_noise_may_have_made_count_as_none():
    low, high = 0.49 * MIN_SPREAD_M2, 0.5 * MIN_SPREAD_M2
    found = without_noise(np.array([[low, 0, low], [high, 0, high], [0, 0, 1.0]]))
    np.testing.assert_array_equal(found, [[0, 0, 0], [high, 0, high], [0, 0, 1]])


@given(st.lists(st.tuples(vectors, vectors, radii), min_size=1, max_size=5))
def test_the_points_of_a_support_have_its_mean_and_second_moments(many):
    xy = np.array([place for place, _, _ in many])
    spread = np.array([path_spread(along) + footprint_spread(radius) for _, along, radius in many])
    supports = Supports(xy, spread)
    np.testing.assert_allclose(supports.average(lambda p: np.ones((1, len(p)))), 1.0)
    np.testing.assert_allclose(supports.average_rows(lambda p: p), xy, atol=1e-9)

    def squares(p):
        return np.stack([p[:, 0] ** 2, p[:, 0] * p[:, 1], p[:, 1] ** 2])

    ring = (1 - near_share(spread[:, 3])) * (0.82 * spread[:, 3]) ** 2 / 2
    expected = spread.T[:3] + np.outer([1, 0, 1], ring)
    np.testing.assert_allclose(supports.average(squares) - squares(xy), expected, atol=MIN_SPREAD_M2 / 2)


# -- covariances ---------------------------------------------------------------------------------------

# Largest error of a correlation: the published models that are rough at the origin are the hardest.
TOLERANCE = {"gaussian": 0.006, "matern52": 0.006, "matern32": 0.008, "spherical": 0.03, "exponential": 0.04}
FOOTPRINT_TOLERANCE = 0.09


@pytest.mark.parametrize("model", MODELS)
def test_covariances_agree_with_brute_force_integration(model):
    """Practical range 40 m, ways up to 12 m, a footprint of 10 m: samples with targets, and among each other."""
    variogram = Variogram(model, 0.0, 40 / MODELS[model].practical, 1.0)
    targets = np.array([[0.0, 0], [3, 1], [0, 8], [-15, 5], [30, -20]])
    supports = {
        "way": (path_spread([9.0, -7.0]), way([9.0, -7.0])),
        "footprint": (footprint_spread(10.0), footprint(10.0)),
        "small footprint": (footprint_spread(4.4), footprint(4.4)),
        "large footprint": (footprint_spread(20.0), footprint(20.0)),
    }
    for name, (spread, points) in supports.items():
        tolerance = TOLERANCE[model] if name == "way" else FOOTPRINT_TOLERANCE
        found = Points(variogram, np.zeros((1, 2)), targets, spread[None]).correlation(EVERY)[:, 0]
        exact = Points(variogram, points, targets).correlation(EVERY).mean(axis=1)
        assert np.abs(found - exact).max() < tolerance
        itself = SupportCorrelation(MODELS[model], np.zeros((1, 2)), spread[None]).at(variogram.range_m)[0].item()
        within = Points(variogram, points, points).correlation(EVERY).mean()
        assert abs(itself - within) < tolerance


@pytest.mark.parametrize("model", MODELS)
def test_correlations_between_ranges_are_interpolated_closely_with_their_slope(model):
    xy, _, _, spread = survey(20, radius_m=10.0)
    known = SupportCorrelation(MODELS[model], xy, spread)
    step = 1e-5
    for range_m in (7.0, 23.0, 60.0):
        value, slope = known.at(range_m)
        closely = 6e-3 if model == "spherical" else 3e-3
        assert np.abs(value - known._averaged(range_m)[0]).max() < closely
        difference = known.at(range_m * math.exp(step))[0] - known.at(range_m * math.exp(-step))[0]
        np.testing.assert_allclose(slope, difference / (2 * step), atol=1e-6)


# -- kriging -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_no_spread_is_kriging_of_points_bit_for_bit(model):
    xy, counts, exposure_s, _ = survey()
    variogram = Variogram(model, 0.01, 20.0, 0.3)
    axis = np.linspace(0, 60, 40)
    plain = PoissonKriging(variogram).fit(xy, counts, exposure_s)
    zero = PoissonKriging(variogram).fit(xy, counts, exposure_s, np.zeros((len(xy), 3)))
    for one, other in zip(plain.predict_grid(axis, axis), zero.predict_grid(axis, axis), strict=True):
        np.testing.assert_array_equal(one, other)
    fits = [estimate_variogram(xy, counts, exposure_s, model, spread=spread) for spread in (None, np.zeros(3))]
    assert fits[0].variogram == fits[1].variogram


@pytest.mark.parametrize("model", MODELS)
def test_kriging_with_supports_is_block_kriging(model):
    """Against many points per sample, which share its counts: their mean is the sample's rate."""
    xy, counts, exposure_s, _ = survey(8)
    rng = np.random.default_rng(1)
    along = rng.uniform(-10, 10, (8, 2))
    variogram = Variogram(model, 0.0, 40 / MODELS[model].practical, 0.3)
    targets = np.random.default_rng(2).uniform(0, 60, (30, 2))
    kriging = PoissonKriging(variogram, mean_rate=3.0).fit(xy, counts, exposure_s, path_spread(along))
    points = np.concatenate([place + way(vector, 60) for place, vector in zip(xy, along, strict=True)])
    share = np.kron(np.eye(8), np.full((1, 60), 1 / 60))
    blocks = share @ Points(variogram, points, points).correlation(EVERY) @ share.T * 0.3
    to_targets = share @ Points(variogram, points, targets).correlation(EVERY).T * 0.3
    system = np.block([[blocks + np.diag(3.0 / exposure_s), np.ones((8, 1))], [np.ones((1, 8)), np.zeros((1, 1))]])
    solved = np.linalg.solve(system, np.vstack([to_targets, np.ones(30)]))
    expected = counts / exposure_s @ solved[:8], 0.3 - (solved[:8] * to_targets).sum(axis=0) - solved[8]
    plain = PoissonKriging(variogram, mean_rate=3.0).fit(xy, counts, exposure_s)
    smooth = model not in ("exponential", "spherical")
    for found, exact, point, unit in zip(
        kriging.predict(targets), expected, plain.predict(targets), (math.sqrt(0.3), 0.3), strict=True
    ):
        error = np.abs(found - exact).max()
        assert error < (0.02 if smooth else 0.12) * unit
        assert error < (0.25 if smooth else 0.7) * np.abs(point - exact).max()
    np.testing.assert_allclose(np.diag(kriging.covariance(targets)), kriging.predict(targets)[1], atol=1e-12)
    weights, _ = kriging.weights(targets)
    np.testing.assert_allclose(counts / exposure_s @ weights, kriging.predict(targets)[0])


def test_the_likelihood_of_supports_has_the_slope_that_it_claims():
    likelihood = RestrictedLikelihood(Samples(*survey(radius_m=10.0)), "matern32")
    at = np.log([0.3, 21.0, 0.01])
    slopes = likelihood.expand(at)[1]
    for k, step in enumerate(1e-5 * np.eye(3)):
        difference = (likelihood.value(at + step) - likelihood.value(at - step)) / 2e-5
        assert slopes[k] == pytest.approx(difference, rel=1e-4, abs=1e-5)


def test_deconvolution_finds_the_field_that_a_footprint_blurs():
    """Stripes 60 m long and a footprint of 20 m, as the published weights of distance see them."""
    rng = np.random.default_rng(3)
    at = np.stack(np.meshgrid(np.arange(0, 121, 10.0), np.arange(0, 61, 10.0)), axis=-1).reshape(-1, 2)
    wave = 2 * math.pi / 60

    def truth(xy):
        return 4 + np.sin(wave * xy[:, 0])

    seen = truth((at[:, None] + footprint(20.0)).reshape(-1, 2)).reshape(len(at), -1).mean(axis=1)
    exposure_s = np.full(len(at), 1200.0)
    counts = rng.poisson(seen * exposure_s)
    targets = rng.uniform(0, 1, (400, 2)) * [120, 60]
    errors, coverage = [], []
    for spread in (None, footprint_spread(20.0)):
        fit = estimate_variogram(at, counts, exposure_s, extent_m=120.0, spread=spread)
        rate, variance = PoissonKriging(fit.variogram).fit(at, counts, exposure_s, spread).predict(targets)
        error = rate - truth(targets)
        errors.append(np.mean(error**2))
        coverage.append(np.mean(np.abs(error) < 1.96 * np.sqrt(variance)))
    assert errors[1] < 0.5 * errors[0]
    assert coverage[0] < 0.8 < 0.9 < coverage[1]
