# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json
import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.corrections.factors import absolute_humidity_gm3
from soilmoist_ros.sensing.moisture.curve import (
    MAX_HUMIDITY_GM3,
    PARAMETER_SETS,
    CalibrationCurve,
    MoistureCurve,
    UniversalCurve,
)
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.sensing.survey.correction import correct_record

REFERENCE = json.loads((Path(__file__).parents[2] / "data" / "crns_reference.json").read_text())["universal"]
CURVE = UniversalCurve(6.0, 1.4, lattice_water=0.03, organic_water=0.01, humidity_gm3=8.0)
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
def test_vwc_and_rate_are_inverse(name, vwc, humidity, density, water):
    curve = UniversalCurve(6.0, density, water, humidity_gm3=humidity, parameter_set=name)
    assert curve.vwc(curve.rate_cps(vwc)) == pytest.approx(vwc, abs=1e-10)


@SETS
def test_the_inverse_exists_down_to_the_lowest_rate_and_nowhere_below(name):
    curve = replace(CURVE, parameter_set=name)
    lowest = curve.lowest_rate_cps
    rate = np.array([np.nan, 0.0, lowest, lowest * (1 + 1e-6), 3.0, 6.0, 600.0, 1e6])
    vwc = curve.vwc(rate)
    np.testing.assert_array_equal(curve.valid(rate), [False] * 3 + [True] * 5)
    np.testing.assert_array_equal(np.isfinite(vwc), curve.valid(rate))
    assert np.all(np.diff(vwc[3:]) < 0)
    np.testing.assert_allclose(curve.rate_cps(vwc[3:]), rate[3:], rtol=1e-9)


@SETS
def test_every_set_falls_and_is_convex_up_to_the_highest_humidity(name):
    for humidity in (0.0, 10.0, MAX_HUMIDITY_GM3):
        curve = UniversalCurve(6.0, 1.4, humidity_gm3=humidity, parameter_set=name)
        rate = curve.rate_cps(np.linspace(-0.015, 3.0, 500))
        assert np.all(np.diff(rate) < 0)
        assert np.all(np.diff(rate, 2) > 0)


def test_slope_is_the_derivative_and_weight_is_its_finite_square():
    rate = np.linspace(2.2, 6.0, 30)
    step = 1e-6
    numeric = (CURVE.vwc(rate + step) - CURVE.vwc(rate - step)) / (2 * step)
    np.testing.assert_allclose(CURVE.slope(rate), numeric, rtol=1e-6)
    np.testing.assert_allclose(CURVE.weight(rate), CURVE.slope(rate) ** 2)
    assert np.isfinite(CURVE.weight([0.0, CURVE.lowest_rate_cps, 1e3])).all()


def test_third_order_uncertainty_is_that_of_many_draws():
    rng = np.random.default_rng(5)
    rate, sd = 2.6, 0.13
    drawn = CURVE.vwc(rng.normal(rate, sd, 200_000))
    third, first = CURVE.vwc_sd(rate, sd, order=3), CURVE.vwc_sd(rate, sd)
    assert third == pytest.approx(drawn.std(), rel=0.03)
    assert abs(first - drawn.std()) > 2 * abs(third - drawn.std())
    with pytest.raises(ValueError, match="order"):
        CURVE.vwc_sd(rate, sd, order=2)


def test_the_expansion_has_the_derivatives_of_the_inverse_curve():
    vwc, sd = CURVE.vwc_and_sd(2.5, 0.1)
    step = 1e-3
    first, second, third = (
        float(np.asarray(weights) @ CURVE.vwc(2.5 + step * np.arange(-2, 3)) / step**order)
        for order, weights in enumerate(
            [[1 / 12, -2 / 3, 0, 2 / 3, -1 / 12], [0, 1, -2, 1, 0], [-0.5, 1, 0, -1, 0.5]], 1
        )
    )
    variance = (first * 0.1) ** 2 + (second**2 / 2 + first * third) * 0.1**4 + 5 / 12 * third**2 * 0.1**6
    assert sd == pytest.approx(math.sqrt(variance), rel=1e-3)
    assert vwc == CURVE.vwc(2.5)


def test_humidity_is_corrected_once_and_exactly_at_the_typical_moisture():
    """Counts at 14 g/m3 are corrected to 8 g/m3; the curve at 8 g/m3 gives the moisture back."""
    site = Site(
        corrections={"pressure": None, "humidity": {"reference_gm3": 8.0}, "typical_vwc": 0.25},
        soil={"bulk_density_gcm3": 1.4, "lattice_water": 0.03, "organic_water": 0.01},
        calibration={"n0_cps": 6.0, "curve": "universal"},
    )
    assert site.curve == CURVE
    humid = absolute_humidity_gm3(25.0, 0.6)
    rate = float(replace(CURVE, humidity_gm3=humid).rate_cps(0.25))
    raw = LoggerRecord(0.0, (1000.0,), (1000.0 / rate,), math.nan, 25.0, 0.6)
    record = correct_record(raw, site, None, np.array([1.0]))
    assert humid > 13
    assert record.f_humidity > 1.03
    assert site.curve.vwc(record.corrected_rate) == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize(("away_gm3", "bound"), [(5.0, 0.003), (-5.0, 0.003), (10.0, 0.006)])
def test_the_second_order_error_away_from_the_typical_moisture(away_gm3, bound):
    vwc = np.linspace(0.05, 0.40, 36)
    curve = UniversalCurve(6.0, 1.4, humidity_gm3=10.0)
    there = curve.humidity_gm3 + away_gm3
    corrected = replace(curve, humidity_gm3=there).rate_cps(vwc) / curve.humidity_response(0.20, there)
    error = np.abs(curve.vwc(corrected) - vwc)
    assert 0.5 * bound < error.max() <= bound
    assert error[np.argmin(np.abs(vwc - 0.20))] < 1e-12


def test_the_linear_factor_can_be_kept_with_the_universal_curve():
    corrections = {"pressure": None, "humidity": {"method": "linear", "reference_gm3": 8.0}}
    soil, calibration = {"bulk_density_gcm3": 1.4}, {"n0_cps": 6.0, "curve": "universal"}
    site = Site(corrections=corrections, soil=soil, calibration=calibration)
    humid = absolute_humidity_gm3(25.0, 0.6)
    assert site.corrections_parameters.f_humidity(25.0, 0.6) == pytest.approx(1 + 0.0054 * (humid - 8.0))


def test_both_curves_satisfy_the_protocol_and_name_themselves():
    curves: list[MoistureCurve] = [CURVE, CalibrationCurve(6.0, 1.4)]
    assert [curve.parameters["curve"] for curve in curves] == ["universal", "desilets"]
    assert pickle.loads(pickle.dumps(CURVE)) == CURVE


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
        replace(CURVE, **wrong)
    with pytest.raises(ValueError, match="humidity_gm3"):
        CURVE.humidity_response(0.2, 99.0)
    with pytest.raises(ValueError, match="below"):
        CURVE.rate_cps(-1.0)
