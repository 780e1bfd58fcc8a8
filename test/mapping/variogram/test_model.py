# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import mpmath
import numpy as np
import pytest

from soilmoist_ros.mapping import Variogram
from soilmoist_ros.mapping.variogram.correlation import BUILT_IN as MODELS

EXACT = {
    "gaussian": lambda u: mpmath.exp(-(u**2)),
    "exponential": lambda u: mpmath.exp(-u),
    "spherical": lambda u: 1 - mpmath.mpf(3) / 2 * u + u**3 / 2 if u < 1 else mpmath.mpf(0),
    "matern32": lambda u: (1 + mpmath.sqrt(3) * u) * mpmath.exp(-mpmath.sqrt(3) * u),
    "matern52": lambda u: (1 + mpmath.sqrt(5) * u + 5 * u**2 / 3) * mpmath.exp(-mpmath.sqrt(5) * u),
}


@pytest.mark.parametrize("model", EXACT)
def test_correlation_against_forty_digits(model):
    h = [0.0, 1e-9, 0.3, 7.0, 39.99, 40.0, 55.5, 400.0]
    with mpmath.workdps(40):
        expected = [float(EXACT[model](mpmath.mpf(distance) / 40)) for distance in h]
    np.testing.assert_allclose(Variogram(model, 0.1, 40, 1.0).correlation(h), expected, rtol=2e-14, atol=1e-15)


@pytest.mark.parametrize("model", EXACT)
def test_slope_is_the_derivative_by_log_range(model):
    with mpmath.workdps(40):
        for u in (0.0, 0.2, 0.7, 1.5, 3.0):
            expected = mpmath.diff(lambda log_range, u=u: EXACT[model](u / mpmath.exp(log_range)), 0, h=1e-12)
            slope = MODELS[model].with_slope(np.array([u**2]))[1]
            assert slope[0] == pytest.approx(float(expected), abs=1e-9)


@pytest.mark.parametrize("model", EXACT)
def test_semivariance_and_covariance_fit_together(model):
    variogram = Variogram(model, 0.02, 40, 0.3)
    h = np.array([[0.0, 1e-6], [20.0, 1e6]])
    gamma = variogram.semivariance(h)
    assert gamma.shape == (2, 2)
    assert gamma[0, 0] == 0
    assert gamma[0, 1] == pytest.approx(0.02, abs=1e-6)
    assert gamma[1, 1] == pytest.approx(0.3)
    np.testing.assert_allclose(variogram.covariance(h), 0.3 - gamma, atol=1e-15)
    np.testing.assert_array_equal(variogram(h), gamma)
    assert variogram.structured_sill == pytest.approx(0.28)
    assert variogram.semivariance(3.0).shape == ()


@pytest.mark.parametrize("model", sorted(set(EXACT) - {"spherical"}))
def test_practical_range_is_where_five_per_cent_correlation_is_left(model):
    variogram = Variogram(model, 0.02, 40, 0.3)
    assert variogram.correlation(variogram.practical_range_m) == pytest.approx(0.05, rel=1e-9)


def test_the_models_do_not_change_their_argument():
    h = np.array([1.0, 2.0])
    for model in EXACT:
        Variogram(model, 0, 1, 1).semivariance(h)
    np.testing.assert_array_equal(h, [1, 2])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("cubic", 0, 1, 1),
            "there is no variogram model 'cubic' -> use one of: gaussian, exponential, spherical",
        ),
        (("gaussian", -0.1, 1, 1), "nugget must be >= 0, got -0.1"),
        (("gaussian", 0, 0, 1), "range_m must be > 0, got 0.0"),
        (("gaussian", 0.5, 1, 0.4), "sill is the total sill and must be >= nugget"),
        (("gaussian", 0, np.inf, 1), "range_m must be finite, got inf"),
        (("gaussian", 0, 1, np.nan), "sill must be finite, got nan"),
        (("gaussian", 0, 1, 1, 0.5), "must be >= 1, got 0.5; turn angle_deg by 90 and give its inverse"),
        (("gaussian", 0, 1, 1, np.inf), "anisotropy must be finite, got inf"),
        (("gaussian", 0, 1, 1, 2, np.nan), "angle_deg must be finite, got nan"),
    ],
)
def test_variogram_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        Variogram(*arguments)
