# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import mpmath
import numpy as np
import pytest
from crnpy import crnpy
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

CURVE = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4, lattice_water=0.03, organic_water=0.01)


def test_vwc_agrees_with_an_independent_implementation():
    rate = np.linspace(2.4, 6.0, 50)
    expected = crnpy.counts_to_vwc(rate, N0=6.0, Wlat=0.03, Wsoc=0.01, bulk_density=1.4)
    np.testing.assert_allclose(CURVE.vwc(rate), expected, rtol=1e-12)


@given(st.floats(0.0, 0.9))
def test_vwc_and_rate_are_inverse(vwc):
    assert CURVE.vwc(CURVE.rate_cps(vwc)) == pytest.approx(vwc, abs=1e-9)


def test_slope_is_the_derivative():
    rate = np.linspace(2.6, 6.0, 30)
    step = 1e-6
    numeric = (CURVE.vwc(rate + step) - CURVE.vwc(rate - step)) / (2 * step)
    np.testing.assert_allclose(CURVE.slope(rate), numeric, rtol=1e-6)


def test_first_order_uncertainty_holds_for_small_noise_and_third_order_for_larger():
    rng = np.random.default_rng(2)
    for rate, sd, order, tolerance in [(4.0, 0.02, 1, 0.01), (3.6, 0.22, 3, 0.04)]:
        sampled = CURVE.vwc(rng.normal(rate, sd, 400_000)).std()
        assert CURVE.vwc_sd(rate, sd, order=order) == pytest.approx(sampled, rel=tolerance)
    # with large noise, the first-order standard deviation is too small
    assert CURVE.vwc_sd(3.6, 0.22, order=1) < 0.95 * sampled


def test_third_order_standard_deviation_agrees_with_an_independent_implementation():
    counts = np.array([90.0, 110.0, 150.0, 190.0])  # noise of up to 60 % of what lies above the pole
    dry = CalibrationCurve(n0_cps=200.0, bulk_density_gcm3=1.4)
    expected = crnpy.uncertainty_vwc(counts, N0=200.0, bulk_density=1.4)
    np.testing.assert_allclose(dry.vwc_sd(counts, np.sqrt(counts), order=3), expected, rtol=1e-12)


@pytest.mark.parametrize(("rate", "sd"), [(3.6, 0.1), (3.2, 0.4), (2.6, 0.3)])
def test_third_order_variance_is_that_of_the_cubic_expansion_of_the_curve(rate, sd):
    """mpmath expands the curve; Gauss-Hermite quadrature of the variance is exact for cubic polynomials."""

    def desilets(n):
        return 1.4 * (0.0808 / (n / 6.0 - 0.372) - 0.115 - 0.04)

    with mpmath.workdps(40):
        coefficients = [float(c) for c in mpmath.taylor(desilets, rate, 3)]
    nodes, weights = np.polynomial.hermite_e.hermegauss(8)
    values = np.polynomial.polynomial.polyval(sd * nodes, coefficients)
    weights /= weights.sum()
    variance = weights @ (values - weights @ values) ** 2
    assert CURVE.vwc_sd(rate, sd, order=3) ** 2 == pytest.approx(variance, rel=1e-9)


def test_rates_without_a_soil_moisture_are_not_valid_and_give_nan():
    rates = [CURVE.lowest_rate_cps - 1e-9, CURVE.lowest_rate_cps - 1e-15, 0.0, -1.0, 4.0]
    np.testing.assert_array_equal(CURVE.valid(rates)[[0, 2, 3, 4]], [False, False, False, True])
    np.testing.assert_array_equal(np.isnan(CURVE.vwc(rates)), ~CURVE.valid(rates))
    np.testing.assert_array_equal(np.isnan(CURVE.vwc_sd(rates, 0.1)), ~CURVE.valid(rates))


def test_values_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="n0_cps must be positive and finite"):
        CalibrationCurve(math.nan, 1.4)
    with pytest.raises(ValueError, match="lattice_water must be zero or positive"):
        CalibrationCurve(6.0, 1.4, lattice_water=-0.1)
    with pytest.raises(ValueError, match="below what the calibration curve can express"):
        CURVE.rate_cps(-0.5)
    with pytest.raises(ValueError, match="order must be 1 or 3"):
        CURVE.vwc_sd(4.0, 0.1, order=2)
