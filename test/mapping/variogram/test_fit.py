# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fit of a variogram, and the prior of a field (field_prior.py)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import Variogram, estimate_variogram, fit_variogram
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

METHODS = ["reml", "soft_l1"]


def simulated(n=72, seed=0, side=210.0):
    truth = Variogram("matern32", 0.01, 40.0, 0.3)
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (n, 2))
    rate = 4 + np.linalg.cholesky(truth.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
    return xy, rng.poisson(rate * 600.0), np.full(n, 600.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", MODELS)
def test_every_model_is_fitted_by_every_method(model, method):
    fit = estimate_variogram(*simulated(), model, method)
    assert fit.variogram.model == model
    assert fit.method == method
    assert fit.n_samples == 72
    assert fit.mean_rate == pytest.approx(4, rel=0.2)
    assert 0.1 < fit.variogram.sill < 0.9
    assert 40 < fit.variogram.practical_range_m < 300
    assert fit.converged
    assert len(fit.edges_m) == len(fit.lag_m) + 1 == len(fit.gamma) + 1 == len(fit.weight) + 1
    assert (fit.log_sd is None) == (method == "soft_l1")
    assert not fit.prior_mattered


@pytest.mark.parametrize("method", METHODS)
def test_a_fit_depends_on_no_order_shift_unit_of_time_or_split_of_the_records(method):
    xy, counts, exposure_s = simulated()
    expected = fit_variogram(xy, counts, exposure_s, method=method)
    assert fit_variogram(xy, counts, exposure_s, method=method) == expected
    order, half = np.random.default_rng(1).permutation(72), counts // 2
    moved = fit_variogram(xy[order] + [1000, -500], counts[order], exposure_s[order], method=method)
    assert (moved.range_m, moved.sill) == pytest.approx((expected.range_m, expected.sill), rel=1e-3)
    tens = fit_variogram(xy, counts, exposure_s / 10, method=method)
    assert (tens.range_m, tens.sill) == pytest.approx((expected.range_m, expected.sill * 100), rel=1e-4)
    assert tens.nugget == pytest.approx(expected.nugget * 100, rel=1e-3, abs=1e-6)
    split = np.vstack([xy, xy]), np.concatenate([half, counts - half]), np.tile(exposure_s / 2, 2)
    assert fit_variogram(*split, method=method) == expected


DEGENERATE = {
    "three places": ([[0, 0], [40, 5], [9, 60]], [1900, 2100, 1700], [600, 600, 600]),
    "two places": ([[0, 0], [40, 5]], [1900, 2100], [600, 600]),
    "equal values": ([[0, 0], [40, 5], [9, 60]], [1900, 1900, 1900], [600, 600, 600]),
    "zero counts": ([[0, 0], [40, 5], [9, 60]], [0, 0, 0], [10, 10, 10]),
    "collinear": (np.column_stack([np.arange(9.0) * 10, np.zeros(9)]), np.arange(9) + 20, np.full(9, 10.0)),
    "duplicates": ([[0, 0], [0, 0], [9, 60]], [19, 25, 32], [10, 10, 10]),
    "one short, one long": ([[0, 0], [40, 5]], [0, 10**7], [1e-3, 1e7]),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("case", DEGENERATE)
def test_degenerate_samples_give_a_usable_variogram(case, model, method):
    fit = estimate_variogram(*DEGENERATE[case], model, method)
    assert fit.variogram.structured_sill > 0
    assert 1e-3 < fit.variogram.range_m < 1e4
    assert np.isfinite(fit.objective)


@pytest.mark.parametrize(
    ("xy", "counts"), [([[7, 7]], [2000]), ([[7, 7]] * 4, [480, 520, 490, 510])], ids=["one sample", "one place"]
)
def test_one_place_gives_what_the_prior_says(xy, counts):
    exposure_s = np.full(len(xy), 600.0 / len(xy))
    fit = estimate_variogram(xy, counts, exposure_s, extent_m=200.0)
    rate = 2000 / 600
    assert fit.variogram.practical_range_m == pytest.approx(200.0 / 3)
    # Means of log-normal variables: the logarithms have standard deviations of 1 and 1.5.
    assert fit.variogram.structured_sill == pytest.approx(np.exp(1 / 2) * (0.15 * rate) ** 2)
    assert fit.variogram.nugget == pytest.approx(np.exp(1.5**2 / 2) * 0.05 * (0.15 * rate) ** 2)
    assert fit.prior_share == pytest.approx((1, 1, 1))
    assert fit.prior_mattered
    assert len(fit.lag_m) == 0


def test_the_extent_of_the_field_sets_the_range_of_few_samples():
    data = DEGENERATE["three places"]
    assert fit_variogram(*data, extent_m=600.0).range_m > 3 * fit_variogram(*data).range_m


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (([], [], []), {}, "needs at least one sample"),
        (([[0, 0]], [3], [10]), {"method": "soft_l1"}, "two distinct places.*or use method reml"),
        (([[0, 0]], [3], [10]), {"model": "linear"}, "there is no variogram model 'linear'"),
        (([[0, 0]], [3], [10]), {"method": "ml"}, "unknown method 'ml'; known are reml, soft_l1"),
        (([[0, 0]], [3], [10]), {"extent_m": 0.0}, "extent_m must be positive"),
        (([[0, 0]], [-3], [10]), {}, "counts must be whole numbers"),
    ],
)
def test_fit_variogram_refuses(data, options, message):
    with pytest.raises(ValueError, match=message):
        fit_variogram(*data, **options)


# Prior of a field ------------------------------------------------------------------------------------------------


def prior():
    return FieldPrior(
        lambda xy: np.column_stack([xy[:, 0], xy[:, 0] * xy[:, 1]]), np.array([1.0, 2.0]),
        np.array([[-0.3, 0.1], [0.1, 0.5]]), np.array([1.0, -0.5]),
    )  # fmt: skip


def test_mean_and_covariance_are_those_of_the_features():
    xy = np.random.default_rng(0).uniform(-1, 1, (6, 2))
    one = prior()
    features = np.column_stack([xy[:, 0], 2 * xy[:, 0] * xy[:, 1]])
    at = one.at(xy)
    np.testing.assert_allclose(one.mean(at), features @ [1.0, -0.5])
    np.testing.assert_allclose(one.covariance(at, at), features @ one.matrix @ features.T)
    np.testing.assert_allclose(one.variance(at), np.diag(one.covariance(at, at)))
    np.testing.assert_allclose(one.covariance(at[:2], at), one.covariance(at, at[:2]).T)


@given(length_m=st.floats(2.0, 40.0), x=st.floats(-50, 50), y=st.floats(-50, 50))
def test_features_are_averaged_over_the_path_of_a_sample(length_m, x, y):
    spread = np.array([[0.0, 0.0, length_m**2 / 12]])  # along y; both features are linear in y
    place = np.array([[x, y]])
    np.testing.assert_allclose(prior().at(place, spread), prior().at(place), rtol=1e-9, atol=1e-9)
