# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from crnpy import crnpy
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing import CalibrationCurve, LoggerRecord, Site, UniversalCurve
from soilmoist_ros.sensing.corrections.factors import absolute_humidity_gm3
from soilmoist_ros.sensing.moisture.curve import MAX_HUMIDITY_GM3, PARAMETER_SETS
from soilmoist_ros.sensing.survey.correction import correct_record

CURVE = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4, lattice_water=0.03, organic_water=0.01)


def test_vwc_agrees_with_an_independent_implementation():
    rate = np.linspace(2.4, 6.0, 50)
    expected = crnpy.counts_to_vwc(rate, N0=6.0, Wlat=0.03, Wsoc=0.01, bulk_density=1.4)
    np.testing.assert_allclose(CURVE.vwc(rate), expected, rtol=1e-12)


def test_third_order_standard_deviation_agrees_with_an_independent_implementation():
    counts = np.array([90.0, 110.0, 150.0, 190.0])  # noise of up to 60 % of what lies above the pole
    dry = CalibrationCurve(n0_cps=200.0, bulk_density_gcm3=1.4)
    expected = crnpy.uncertainty_vwc(counts, N0=200.0, bulk_density=1.4)
    np.testing.assert_allclose(dry.vwc_and_sd(counts, np.sqrt(counts))[1], expected, rtol=1e-12)


def test_rates_without_a_soil_moisture_are_not_valid_and_give_nan():
    rates = [CURVE.lowest_rate_cps - 1e-9, CURVE.lowest_rate_cps - 1e-15, 0.0, -1.0, 4.0]
    np.testing.assert_array_equal(CURVE.valid(rates)[[0, 2, 3, 4]], [False, False, False, True])
    np.testing.assert_array_equal(np.isnan(CURVE.vwc(rates)), ~CURVE.valid(rates))
    np.testing.assert_array_equal(np.isnan(CURVE.vwc_and_sd(rates, 0.1)[1]), ~CURVE.valid(rates))


# Universal -------------------------------------------------------------------------------------------------------

REFERENCE = json.loads((Path(__file__).parents[2] / "data" / "crns_reference.json").read_text())["universal"]
CURVE_UNIVERSAL = UniversalCurve(6.0, 1.4, lattice_water=0.03, organic_water=0.01, humidity_gm3=8.0)
SETS = pytest.mark.parametrize("name", PARAMETER_SETS)


def test_the_rate_agrees_with_an_independent_implementation():
    for name, vwc, humidity, density, water, rate in REFERENCE["rows"]:
        curve = UniversalCurve(1.0, density, water, humidity_gm3=humidity, parameter_set=name)
        assert curve.rate_cps(vwc) == pytest.approx(rate, rel=1e-14)


@given(
    st.sampled_from(sorted(PARAMETER_SETS)),
    st.floats(0.0, 1.0),
    st.floats(0, MAX_HUMIDITY_GM3),
    st.floats(0.8, 1.9),
    st.floats(0, 0.2),
)
def test_vwc_and_rate_are_inverse_of_universal(name, vwc, humidity, density, water):
    curve = UniversalCurve(6.0, density, water, humidity_gm3=humidity, parameter_set=name)
    assert curve.vwc(curve.rate_cps(vwc)) == pytest.approx(vwc, abs=1e-10)


@SETS
def test_every_set_falls_and_is_convex_up_to_the_highest_humidity(name):
    for humidity in (0.0, 10.0, MAX_HUMIDITY_GM3):
        curve = UniversalCurve(6.0, 1.4, humidity_gm3=humidity, parameter_set=name)
        rate = curve.rate_cps(np.linspace(-0.015, 3.0, 500))
        assert np.all(np.diff(rate) < 0)
        assert np.all(np.diff(rate, 2) > 0)


@pytest.mark.parametrize("curve", [CURVE, CURVE_UNIVERSAL])
def test_slope_is_the_derivative_and_weight_is_its_finite_square(curve):
    rate, step = np.linspace(2.6, 6.0, 30), 1e-6
    numeric = (curve.vwc(rate + step) - curve.vwc(rate - step)) / (2 * step)
    np.testing.assert_allclose(curve.slope(rate), numeric, rtol=1e-6)
    np.testing.assert_allclose(curve.weight(rate), curve.slope(rate) ** 2)
    assert np.isfinite(curve.weight([0.0, curve.lowest_rate_cps, 1e3])).all()


@pytest.mark.parametrize(
    ("curve", "rate", "sd"), [(CURVE, 4.0, 0.02), (CURVE, 3.6, 0.22), (CURVE_UNIVERSAL, 2.6, 0.13)]
)
def test_the_standard_deviation_is_that_of_many_draws(curve, rate, sd):
    drawn = curve.vwc(np.random.default_rng(2).normal(rate, sd, 400_000))
    assert curve.vwc_and_sd(rate, sd)[1] == pytest.approx(drawn.std(), rel=0.03)


def test_humidity_is_corrected_once_and_exactly_at_the_typical_moisture():
    """Counts at 14 g/m3 are corrected to 8 g/m3; the curve at 8 g/m3 gives the moisture back."""
    site = Site(
        corrections={"pressure": None, "humidity": {"reference_gm3": 8.0}, "typical_vwc": 0.25},
        soil={"bulk_density_gcm3": 1.4, "lattice_water": 0.03, "organic_water": 0.01},
        calibration={"n0_cps": 6.0, "curve": "universal"},
    )
    assert site.curve == CURVE_UNIVERSAL
    humid = absolute_humidity_gm3(25.0, 0.6)
    rate = float(replace(CURVE_UNIVERSAL, humidity_gm3=humid).rate_cps(0.25))
    raw = LoggerRecord(0.0, (1000.0,), (1000.0 / rate,), math.nan, 25.0, 0.6)
    record = correct_record(raw, site, None, np.array([1.0]))
    assert humid > 13
    assert record.f_humidity > 1.03
    assert site.curve.vwc(record.corrected_rate) == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        {"n0_cps": 0.0},
        {"humidity_gm3": -1.0},
        {"humidity_gm3": 99.0},
        {"lattice_water": math.nan},
        {"parameter_set": "x"},
    ],
)
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        replace(CURVE_UNIVERSAL, **wrong)
    with pytest.raises(ValueError, match="humidity_gm3"):
        CURVE_UNIVERSAL.humidity_response(0.2, 99.0)
    with pytest.raises(ValueError, match="below"):
        CURVE_UNIVERSAL.rate_cps(-1.0)
