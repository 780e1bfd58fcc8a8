# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from soilmoist_ros.mapping.variogram.correlation import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.soft_l1 import MAX_NUGGET, MAX_SILL, OUTLIER, RANGES, fit_soft_l1

LOWER = np.array([0.0, RANGES[0]])
UPPER = np.array([MAX_NUGGET, RANGES[1]])


def cost(parameters, lag, gamma, model):
    nugget, range_, structured = parameters
    residual = nugget + structured * (1 - MODELS[model].correlation((lag / range_) ** 2)) - gamma
    return OUTLIER**2 * np.sum(np.sqrt(1 + (residual / OUTLIER) ** 2) - 1)


def best_of_scipy(lag, gamma, model, least_sill):
    """The lowest of three starts of scipy's trust-region fit with the same loss and bounds."""

    def residuals(parameters):
        nugget, range_, structured = parameters
        return nugget + structured * (1 - MODELS[model].correlation((lag / range_) ** 2)) - gamma

    bounds = np.append(LOWER, least_sill), np.append(UPPER, max(MAX_SILL, 2 * least_sill))
    starts = [np.clip([0.1, reach / MODELS[model].practical, 1.0], *bounds) for reach in (0.3, 0.6, 1.2)]
    return min(
        (least_squares(residuals, start, bounds=bounds, loss="soft_l1", f_scale=OUTLIER) for start in starts),
        key=lambda result: result.cost,
    )


def semivariogram(seed, model):
    """Classes as they come: of a model with noise, of a trend, without structure, or of chance alone."""
    rng = np.random.default_rng(seed)
    lag = np.sort(rng.uniform(0.02, 1, rng.integers(1, 16)))
    lag /= lag[-1]
    rising = 1 - MODELS[model].correlation((lag / 10 ** rng.uniform(-1.5, 0.5)) ** 2)
    gamma = [
        rng.uniform(0, 0.5) + rng.uniform(0.2, 2) * rising + rng.normal(0, 10 ** rng.uniform(-3, 0), len(lag)),
        rng.uniform(0.5, 3) * lag + 0.3 * rng.standard_t(2, len(lag)),
        1 + rng.normal(0, 0.05, len(lag)),
        rng.normal(0.5, 1, len(lag)),
    ][seed % 4]
    return lag, gamma / np.abs(gamma).mean()


@pytest.mark.slow
@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(list(MODELS)), st.floats(1e-6, 1.0))
def test_no_worse_than_scipy(seed, model, least_sill):
    lag, gamma = semivariogram(seed, model)
    found = fit_soft_l1(lag, gamma, model, least_sill)
    parameters = np.array([found.nugget, found.range_, found.structured])
    assert found.cost == pytest.approx(cost(parameters, lag, gamma, model), rel=1e-9, abs=1e-12)
    assert found.cost <= 1.001 * best_of_scipy(lag, gamma, model, least_sill).cost + 1e-4
    assert (parameters >= np.append(LOWER, least_sill) * (1 - 1e-9)).all()
    assert (parameters <= np.append(UPPER, max(MAX_SILL, 2 * least_sill)) * (1 + 1e-9)).all()


@pytest.mark.parametrize("model", MODELS)
def test_the_optimum_is_that_of_scipy(model):
    """Where the classes determine them, the parameters agree as well."""
    lag = np.linspace(1 / 12, 1, 12)
    rng = np.random.default_rng(1)
    practical = MODELS[model].practical
    for _ in range(5):
        gamma = 0.1 + 0.9 * (1 - MODELS[model].correlation((lag * practical / rng.uniform(0.4, 0.8)) ** 2))
        gamma = gamma + rng.normal(0, 0.02, 12)
        found, expected = fit_soft_l1(lag, gamma, model, 1e-3), best_of_scipy(lag, gamma, model, 1e-3)
        if found.cost > expected.cost * (1 - 1e-6):  # otherwise scipy has missed the minimum
            np.testing.assert_allclose(found[:3], expected.x, rtol=1e-3, atol=1e-4)
        assert found.converged


@pytest.mark.parametrize("model", MODELS)
def test_an_exact_semivariogram_is_found(model):
    lag = np.linspace(0.05, 1, 15)
    truth = 0.2, 0.5 / MODELS[model].practical, 1.1
    gamma = truth[0] + truth[2] * (1 - MODELS[model].correlation((lag / truth[1]) ** 2))
    np.testing.assert_allclose(fit_soft_l1(lag, gamma, model, 1e-3)[:3], truth, rtol=1e-4)


def test_one_outlier_pulls_little():
    lag = np.linspace(0.05, 1, 15)
    gamma = 0.1 + 0.9 * (1 - np.exp(-((lag / 0.4) ** 2)))
    gamma[7] += 5
    found = fit_soft_l1(lag, gamma, "gaussian", 1e-3)
    assert found.nugget + found.structured == pytest.approx(1.0, rel=0.05)


def test_what_the_classes_leave_open_stays_near_the_usual():
    """One class holds the semivariance at one lag, and nothing else."""
    found = fit_soft_l1(np.ones(1), np.ones(1), "matern32", 1e-3)
    assert found.cost == pytest.approx(0, abs=1e-9)
    assert 0.2 < found.range_ * MODELS["matern32"].practical < 1.5
    assert found.nugget < 0.3 < found.structured < 1.5
