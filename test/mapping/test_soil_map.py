# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The soil map: what it is made from, its bands of moisture within the limits of the soil, and their coverage."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings, Samples, SoilMap, Variogram, make_soil_map
from soilmoist_ros.mapping.soil_map import make_bands, moisture_terms, possible_moisture
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, soil_limits
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

FIELD = FieldGrid.from_polygon([[0, 0], [60, 0], [60, 50], [20, 50]], 2.0)
MODEL = Variogram("matern32", 0.01, 20.0, 0.3)
CURVE = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4)


def survey(n=25):
    rng = np.random.default_rng(2)
    xy = rng.uniform(0, 60, (n, 2))
    return Samples(xy, rng.poisson(600 * (4 + np.sin(xy[:, 0] / 15))), np.full(n, 600.0))


def test_bands_are_consistent_and_nan_outside():
    done = []
    soil_map = make_soil_map(survey(), FIELD, MODEL, CURVE, progress=done.append)
    for band in soil_map.bands:
        assert band.shape == FIELD.shape
        assert np.isfinite(band[FIELD.mask]).all()
        assert np.isnan(band[~FIELD.mask]).all()
    rate, rate_sd, vwc, vwc_sd, _, _ = (band[FIELD.mask] for band in soil_map.bands)
    np.testing.assert_allclose(CURVE.rate_cps(vwc), rate)
    np.testing.assert_allclose(vwc_sd, CURVE.vwc_and_sd(rate, rate_sd)[1])
    assert rate_sd.min() > 0
    assert soil_map.mean_rate == pytest.approx(survey().mean_rate_cps)
    assert soil_map.undefined_vwc_cells == 0
    assert soil_map.clipped_variances == 0
    assert soil_map.variogram == MODEL
    assert soil_map.fit is None
    assert done[-1] == 1.0


def test_without_a_curve_there_is_no_moisture():
    soil_map = make_soil_map(survey(), FIELD, MODEL)
    assert soil_map.curve is None
    assert np.isnan(soil_map.vwc).all()
    assert np.isnan(soil_map.vwc_sd).all()
    assert np.isfinite(soil_map.rate[FIELD.mask]).all()
    assert soil_map.undefined_vwc_cells == 0


def test_cells_too_wet_for_the_curve_are_counted():
    curve = CalibrationCurve(n0_cps=4.0 / 0.372, bulk_density_gcm3=1.4)  # diverges at 4 counts/s
    soil_map = make_soil_map(survey(), FIELD, MODEL, curve)
    low = soil_map.rate[FIELD.mask] <= curve.lowest_rate_cps
    assert 0 < soil_map.undefined_vwc_cells == low.sum() < low.size
    np.testing.assert_array_equal(soil_map.vwc[FIELD.mask][low], soil_map.limits.saturation)
    assert soil_map.beyond_limits[FIELD.mask][low].all()
    assert not soil_map.beyond_limits[~FIELD.mask].any()
    assert not make_soil_map(survey(), FIELD, MODEL).beyond_limits.any()


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


@pytest.mark.parametrize("part", ["n0_sd_cps", "bulk_density_sd_gcm3", "bound_water_sd"])
def test_an_uncertain_calibration_widens_the_interval(part):
    rng, n = np.random.default_rng(2), 200_000
    sds = {"n0_sd_cps": 0.1, "bulk_density_sd_gcm3": 0.07, "bound_water_sd": 0.01}
    known = CalibrationCurve(6.0, 1.4, **{part: sds[part]})
    rate, sd = 3.5, 0.05
    n0, density = (
        6.0 + known.n0_sd_cps * rng.standard_normal(n),
        1.4 + known.bulk_density_sd_gcm3 * rng.standard_normal(n),
    )
    unit = CalibrationCurve(1.0, 1.0)  # moisture is a function of the rate in units of N0, times the density
    bound_water = known.bound_water_sd * rng.standard_normal(n)
    moisture = density * (unit.vwc(rng.normal(rate, sd, n) / n0) - bound_water)
    bands = make_bands(np.array(rate), np.array(sd**2), known)
    np.testing.assert_allclose(np.quantile(moisture, (0.05, 0.95)), (bands.vwc_p05, bands.vwc_p95), rtol=0.012)
    plain = make_bands(np.array(rate), np.array(sd**2), CURVE)
    assert bands.vwc_p05 < plain.vwc_p05 < plain.vwc < plain.vwc_p95 < bands.vwc_p95
    assert bands.vwc_sd == plain.vwc_sd  # the common part shifts all places together


@pytest.mark.slow
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


SEEDS, SAMPLES, CELLS = 12, 40, 800


def misses(seed, share, dwell_s):
    """Misses of a survey at random places of a field: below, above, and both for ``vwc`` +- 1.645 ``vwc_sd``.

    The rates are a share of the field's: a tenth is a sensor of one tube.
    """
    rng = np.random.default_rng([seed, 7])
    field = surrogate_field("rough", rng)
    grid = field.field.grid(max(field.field.grid(None).extent_m / CELLS**0.5, 1.0))
    known = field.curve if isinstance(field.curve, CalibrationCurve) else CURVE
    curve = replace(known, n0_cps=share * known.n0_cps)
    places = grid.cells[rng.choice(len(grid.cells), SAMPLES, replace=False)]
    places = places + rng.uniform(-0.5, 0.5, places.shape) * grid.cell_m
    counts = rng.poisson(share * field.rate_at(places) * dwell_s)
    field_map = FieldMap(grid, FieldMapSettings(curve=curve))
    field_map.set_samples(Samples(places, counts, np.full(len(places), dwell_s)))
    soil_map = field_map.update()
    truth = possible_moisture(curve, share * field.rate_at(grid.cells))
    vwc, sd, low, high = (band[soil_map.grid.mask] for band in soil_map.bands[2:])
    symmetric = SoilMap.QUANTILE_SD * sd
    return [
        np.mean(missed) for missed in (truth < low, truth > high, truth < vwc - symmetric, truth > vwc + symmetric)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "dwell_s", "fewest"), [(1.0, 60.0, 0.015), (0.1, 10.0, 0.0005)])
def test_the_quantiles_miss_equally_often_on_both_sides(share, dwell_s, fewest):
    """With four counts a stop the prior of the variogram decides: intervals are wide, but not falsely sure."""
    below, above, symmetric_below, symmetric_above = np.mean(
        [misses(seed, share, dwell_s) for seed in range(SEEDS)], axis=0
    )
    assert fewest < below < 0.085
    assert fewest < above < 0.085
    assert symmetric_below < 0.3 * symmetric_above, "nearly all its misses are above"
