# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping.moisture_bands import common_rate_sd, make_bands, moisture_terms, possible_moisture
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, soil_limits

CURVE = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4)
positive = st.floats(0.01, 20.0)


@pytest.mark.parametrize("sd", [0.05, 0.12])
def test_the_quantiles_cut_equal_tails_from_the_moisture(sd):
    """The symmetric interval vwc +- 1.645 vwc_sd has nearly all its misses on the wet side."""
    rates = np.random.default_rng(1).normal(4.0, sd, 200_000)
    moisture = possible_moisture(CURVE, rates)
    _, _, vwc, _, p05, p95 = (float(band) for band in make_bands(np.array(4.0), np.array(sd**2), CURVE))
    assert np.mean(moisture < p05) == pytest.approx(0.05, abs=0.002)
    assert np.mean(moisture > p95) == pytest.approx(0.05, abs=0.002)
    assert np.median(moisture) == pytest.approx(vwc, rel=2e-3)


@pytest.mark.parametrize("part", ["n0", "density"])
def test_an_uncertain_calibration_widens_the_interval(part):
    rng, n = np.random.default_rng(2), 200_000
    sds = {"n0_sd_cps": 0.1} if part == "n0" else {"bulk_density_sd_gcm3": 0.07}
    known = CalibrationCurve(6.0, 1.4, **sds)
    rate, sd = 3.5, 0.05
    n0, density = (
        6.0 + known.n0_sd_cps * rng.standard_normal(n),
        1.4 + known.bulk_density_sd_gcm3 * rng.standard_normal(n),
    )
    unit = CalibrationCurve(1.0, 1.0)  # moisture is a function of the rate in units of N0, times the density
    moisture = density * unit.vwc(rng.normal(rate, sd, n) / n0)
    bands = make_bands(np.array(rate), np.array(sd**2), known)
    np.testing.assert_allclose(np.quantile(moisture, (0.05, 0.95)), (bands.vwc_p05, bands.vwc_p95), rtol=0.012)
    plain = make_bands(np.array(rate), np.array(sd**2), CURVE)
    assert bands.vwc_p05 < plain.vwc_p05 < plain.vwc < plain.vwc_p95 < bands.vwc_p95
    assert bands.vwc_sd == plain.vwc_sd  # the common part shifts all places together


def test_a_calibration_without_standard_deviations_adds_nothing():
    assert common_rate_sd(CURVE, np.array([1.0, 3.0])) is None


@settings(max_examples=80)
@given(
    st.lists(st.floats(-2.0, 30.0), min_size=1, max_size=6),
    st.floats(0.0, 5.0),
    st.floats(0.2, 2.75),
    positive,
    st.sampled_from([(0.0, 0.0), (0.1, 0.0), (0.1, 0.05)]),
)
def test_no_band_shows_what_the_soil_cannot_hold(rates, sd, density, n0, shares):
    curve = CalibrationCurve(n0, density, 0.02, 0.01, shares[0] * n0, shares[1] * density)
    rate = np.array([*rates, np.nan])
    bands = make_bands(rate, np.full(rate.shape, sd**2), curve)
    driest, wettest = soil_limits(density)
    for band in (bands.vwc, bands.vwc_p05, bands.vwc_p95):
        assert ((band[:-1] >= driest) & (band[:-1] <= wettest)).all()
    assert (bands.vwc_p05 <= bands.vwc)[:-1].all()
    assert (bands.vwc <= bands.vwc_p95)[:-1].all()
    assert (bands.vwc_sd[:-1] <= wettest / 2 + 1e-12).all()
    assert all(np.isnan(band[-1]) for band in bands if band is not bands.rate_sd)


def test_a_rate_below_the_pole_is_saturated_soil():
    bands = make_bands(np.array([1.0, CURVE.lowest_rate_cps]), np.full(2, 0.01), CURVE)
    np.testing.assert_array_equal(bands.vwc, soil_limits(1.4).saturation)
    np.testing.assert_array_equal(bands.vwc_p95, soil_limits(1.4).saturation)


@settings(max_examples=60)
@given(st.lists(st.floats(-5, 100), min_size=2, max_size=10), st.floats(0.3, 2.75))
def test_possible_moisture_is_possible_and_falls_with_the_rate(rates, density):
    curve = CalibrationCurve(4.0, density)
    moisture = possible_moisture(curve, np.array(sorted(rates)))
    assert ((moisture >= 0) & (moisture <= soil_limits(density).saturation)).all()
    assert (np.diff(moisture) <= 1e-12).all()


@given(st.floats(2.3, 6.0), st.floats(2.3, 6.0), st.floats(0.01, 0.3), st.floats(-0.9, 0.95))
@settings(max_examples=25)
def test_terms_of_the_moisture_are_its_mean_and_covariances(one, other, sd, correlation):
    draws = np.random.default_rng(3).standard_normal((2, 100_000))
    draws -= draws.mean(axis=1, keepdims=True)
    draws[1] = correlation * draws[0] + np.sqrt(1 - correlation**2) * draws[1]
    moisture = possible_moisture(CURVE, np.array([[one], [other]]) + sd * draws)
    terms = moisture_terms(CURVE, [one, other, np.nan], [sd, sd, sd])
    assert np.isnan(terms[:, 2]).all()
    np.testing.assert_allclose(terms[0, :2], moisture.mean(axis=1), atol=1e-3)
    covariance = (terms[1:, 0] * terms[1:, 1]) @ correlation ** np.arange(1, len(terms))
    largest = np.sqrt(np.prod(moisture.var(axis=1)))
    assert covariance == pytest.approx(np.cov(moisture)[0, 1], abs=0.06 * largest + 2e-5)
