# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from crnpy import crnpy
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.corrections.factors import Corrections, absolute_humidity_gm3, effective_exposure


@pytest.mark.slow
@given(st.floats(500, 1100), st.floats(-30, 45), st.floats(0, 1))
def test_factors_agree_with_an_independent_implementation(pressure, temperature, humidity):
    corrections = Corrections(beta_per_hpa=1 / 130, reference_pressure_hpa=980.0, reference_humidity_gm3=5.0)
    # crnpy divides by its pressure factor where we multiply by ours.
    assert corrections.f_pressure(pressure) == pytest.approx(
        1 / crnpy.correction_pressure(pressure, Pref=980.0, L=130.0), rel=1e-12
    )
    expected = crnpy.abs_humidity(100 * humidity, temperature)
    assert absolute_humidity_gm3(temperature, humidity) == pytest.approx(expected, rel=1e-12)
    assert corrections.f_humidity(temperature, humidity) == pytest.approx(
        crnpy.correction_humidity(expected, Aref=5.0), rel=1e-12
    )


def test_incoming_intensity_factor_is_reference_over_intensity():
    assert Corrections(reference_intensity=150.0).f_intensity(75.0) == 2.0
    assert Corrections().f_intensity(75.0) == 1.0


def test_humidity_coefficient_is_that_for_grams_per_cubic_metre():
    # Air at 20 degC and 50 % contains 8.6 g/m^3: about 4.7 % more counts than in dry air, not 0.47 %.
    assert Corrections().f_humidity(20.0, 0.5) == pytest.approx(1.0467, abs=2e-4)


@given(st.floats(1, 1e4), st.floats(0.5, 2), st.integers(0, 10**6))
def test_counts_over_effective_exposure_are_the_corrected_rate(exposure, factor, counts):
    assert counts / effective_exposure(exposure, factor) == pytest.approx(counts * factor / exposure, rel=1e-12)


def test_corrected_counts_keep_poisson_statistics():
    rng = np.random.default_rng(5)
    rate, exposure, factor = 5.0, 600.0, 1.37
    counts = rng.poisson(rate * exposure / factor, 20_000)
    corrected = counts / effective_exposure(exposure, factor)
    assert corrected.mean() == pytest.approx(rate, rel=1e-3)
    assert corrected.std() / corrected.mean() == pytest.approx(1 / math.sqrt(counts.mean()), rel=0.02)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_values_that_cannot_be_are_refused(value):
    with pytest.raises(ValueError, match="pressure_hpa must be positive and finite"):
        Corrections().f_pressure(value)
    with pytest.raises(ValueError, match="factor must be positive and finite"):
        effective_exposure(10.0, value)
    with pytest.raises(ValueError, match="beta_per_hpa must be positive and finite"):
        Corrections(beta_per_hpa=value)
    with pytest.raises(ValueError, match="intensity must be positive and finite"):
        Corrections(reference_intensity=150.0).f_intensity(value)


def test_humidity_out_of_range_is_refused():
    with pytest.raises(ValueError, match=r"relative_humidity must be within 0..1, got 35"):
        absolute_humidity_gm3(20.0, 35.0)
    with pytest.raises(ValueError, match=r"temperature_degc must be within"):
        absolute_humidity_gm3(math.nan, 0.5)
