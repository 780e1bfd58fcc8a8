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
from soilmoist_ros.sensing.moisture.footprint import Footprint, pressure_scale, sensed_soil, vegetation_scale
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

REFERENCE = json.loads((Path(__file__).parents[2] / "data" / "crns_reference.json").read_text())
CURVE_UNIVERSAL = UniversalCurve(6.0, 1.4, lattice_water=0.03, organic_water=0.01, humidity_gm3=8.0)
SETS = pytest.mark.parametrize("name", PARAMETER_SETS)


def test_the_rate_agrees_with_an_independent_implementation():
    for name, vwc, humidity, density, water, rate in REFERENCE["universal"]["rows"]:
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


# Footprint (footprint.py) ----------------------------------------------------------------------------------------


STANDARD = pressure_scale(1013.25)


def test_weights_of_the_distance_agree_with_an_independent_implementation():
    for scaled_m, water, humidity, weight in REFERENCE["horizontal"]["rows"]:
        found = Footprint(water, humidity).weight(scaled_m * STANDARD)
        assert found == pytest.approx(weight, rel=1e-12)


def test_depth_and_rescaled_distance_agree_with_an_independent_implementation():
    for scaled_m, density, water, depth_cm in REFERENCE["depth"]["rows"]:
        found = Footprint(water).depth_at_cm(scaled_m * STANDARD, density)
        assert found == pytest.approx(depth_cm, rel=1e-12)
    for distance_m, pressure, height_m, water, scaled_m in REFERENCE["scaled_distance"]["rows"]:
        scale = pressure_scale(pressure) * vegetation_scale(height_m, water)
        assert distance_m / scale == pytest.approx(scaled_m, rel=1e-12)
    ours = Footprint(0.2, pressure_hpa=950.0).depth_at_cm([5.0, 50.0], 1.4)
    theirs = crnpy.sensing_depth(0.2, 950.0, 1013.25, 1.4, 0.0, dist=[5.0, 50.0])
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_the_radius_is_that_of_the_published_table():
    """The table is rounded to metres and was made from the simulations; the fits differ by up to 3 %."""
    table = np.array(REFERENCE["radius"]["rows"])
    radius_m = [Footprint(water, humidity).radius_m for water, humidity, _ in table]
    np.testing.assert_allclose(radius_m, table[:, 2], rtol=0.03)
    middle = (table[:, 0] >= 0.1) & (table[:, 0] <= 0.3)
    np.testing.assert_allclose(np.array(radius_m)[middle], table[middle, 2], rtol=0.01)


@pytest.mark.parametrize("shield_radius_m", [math.inf, 60.0, 10.0, 2.0])
def test_closed_integrals_are_those_of_the_weights(shield_radius_m):
    footprint = Footprint(0.25, 8.0, 900.0, 1.0, shield_radius_m)
    distance_m = np.concatenate([[0], np.geomspace(1e-4, 4000, 400_001)])
    middle_m = (distance_m[1:] + distance_m[:-1]) / 2
    counts = footprint.weight(middle_m) * np.diff(distance_m)
    within = counts[middle_m <= footprint.radius_m].sum() / counts.sum()
    assert within == pytest.approx(0.86, abs=2e-4)
    assert footprint.radius_m == min(shield_radius_m, Footprint(0.25, 8.0, 900.0, 1.0).radius_m)
    # The depth is linear in exp(-r*/100 m): its mean over the counts is the depth at the mean of the exponential.
    mean_cm = float(counts @ footprint.depth_at_cm(middle_m, 1.4) / counts.sum())
    assert footprint.depth_cm(1.4) == pytest.approx(mean_cm, rel=1e-5)


def test_a_shield_takes_far_neutrons_only():
    bare, shielded = Footprint(0.2), Footprint(0.2, shield_radius_m=10.0)
    distance_m = np.array([0.1, 1.0, 10.0, 100.0])
    share = shielded.weight(distance_m) / bare.weight(distance_m)
    assert share[0] > 0.99
    assert np.all(np.diff(share) < 0)
    assert share[3] < 0.01
    assert Footprint(0.2, shield_radius_m=500.0).weight(distance_m) == pytest.approx(bare.weight(distance_m))


def test_the_sensed_soil_is_that_of_every_cell():
    air = Footprint(0.0, 8.0, 950.0)
    vwc = np.array([[0.1, 0.2], [np.nan, 0.4]])
    sensed = sensed_soil(vwc, 1.4, 0.05, air)
    cells = [Footprint(value + 0.07, 8.0, 950.0) for value in (0.1, 0.2, 0.4)]
    depth, radius = [cell.depth_cm(1.4) for cell in cells], [cell.radius_m for cell in cells]
    assert sensed.depth_cm == pytest.approx((np.mean(depth), min(depth), max(depth)), rel=2e-3)
    assert sensed.radius_m == pytest.approx((np.mean(radius), min(radius), max(radius)), rel=2e-3)
    assert sensed_soil([np.nan], 1.4, 0.0, air) is None


@pytest.mark.parametrize("radius_m", [5.0, 10.0, 40.0])
def test_rings_send_equal_shares_and_86_percent_lie_within_the_radius(radius_m):
    shape = Footprint.shielded(radius_m)
    assert shape.share(radius_m) == pytest.approx(0.86)
    rings = shape.rings(50)
    assert (np.diff(rings) > 0).all()
    assert [shape.share(ring) for ring in rings[::10]] == pytest.approx((np.arange(0, 50, 10) + 0.5) / 50)
