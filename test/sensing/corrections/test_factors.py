# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plants and road: soilmoist_ros.sensing.corrections.factors."""

import math

import numpy as np
import pytest
from crnpy import crnpy
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Corrections, CorrectionSettings, LoggerRecord, Site, standard_pressure_hpa
from soilmoist_ros.sensing.corrections.factors import (
    absolute_humidity_gm3,
    atmospheric_depth_gcm2,
    barometric_coefficient,
    effective_exposure,
    f_biomass,
    f_road,
)
from soilmoist_ros.sensing.corrections.intensity import cutoff_rigidity_gv
from soilmoist_ros.sensing.corrections.settings import BiomassCorrection, IntensityCorrection
from soilmoist_ros.sensing.moisture.site import load_site
from soilmoist_ros.sensing.survey.correction import correct_record


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
    with pytest.raises(ValueError, match="intensity must be positive and finite"):
        Corrections(reference_intensity=150.0).f_intensity(value)


# Atmosphere ------------------------------------------------------------------------------------------------------

# latitude, altitude, depth of crnpy, and beta of neptoon and crspy for a cutoff rigidity; both were run.
REFERENCE = [
    (38.2346, 455.0, 979.4738881057966, 3.1, 0.0073807859556057325),
    (51.35, 66.0, 1024.6285331173772, 2.93, 0.007312939212233243),
    (-35.0, 600.0, 962.9174015648462, 4.8, 0.0073433834421203605),
    (46.55, 3570.0, 665.1795136287324, 4.49, 0.0073517645834801915),
    (65.0, 15.0, 1029.686104322245, 0.8, 0.007252879144253025),
]


@pytest.mark.parametrize(("latitude", "altitude", "depth", "rigidity", "beta"), REFERENCE)
def test_depth_and_coefficient_agree_with_other_software(latitude, altitude, depth, rigidity, beta) -> None:
    assert atmospheric_depth_gcm2(latitude, altitude) == pytest.approx(depth, rel=1e-12)
    # The others average beta between the numbers of pressure and depth; here it is that at the depth.
    assert barometric_coefficient(depth, rigidity) == pytest.approx(beta, rel=4e-3)


def test_standard_pressure() -> None:
    assert standard_pressure_hpa(45.0, 0.0) == 1013.25
    assert standard_pressure_hpa(45.5, 1000.0) == pytest.approx(898.75, abs=0.2)  # US Standard Atmosphere 1976


# Surroundings ----------------------------------------------------------------------------------------------------


def test_biomass_agrees_with_an_independent_implementation():
    water = crnpy.biomass_to_bwe(biomass_dry=1.5, biomass_fresh=6.0)
    assert water == pytest.approx(6.0 - 1.5 + 0.494 * 1.5)
    found = BiomassCorrection(water_equivalent_kgm2=water)
    assert f_biomass(*found.used) == pytest.approx(crnpy.correction_bwe(1.0, water, r2_N0=6.4 / 1210), rel=1e-14)
    assert f_biomass(*BiomassCorrection(dry_kgm2=2.0).used) == pytest.approx(1 / (1 - 0.018))
    with pytest.raises(ValueError, match=r"fresh - 0\.506 dry"):  # water of the table above: 6 - 0.506 * 1.5
        BiomassCorrection.model_validate({"dry_kgm2": 1.5, "fresh_kgm2": 6.0})
    with pytest.raises(ValueError, match=r"by its code .* such as JUNG"):
        IntensityCorrection.model_validate({"reference": 150.0, "constant": 150.0, "monitor": {"name": "JUNG"}})


@pytest.mark.parametrize("distance_m", [0.0, 2.0, 12.0])
@pytest.mark.parametrize(("width_m", "road", "field"), [(0.0, 0.1, 0.2), (3.0, 0.07, 0.15), (6.0, 0.12, 0.35)])
def test_the_road_agrees_with_an_independent_implementation(width_m, road, field, distance_m):
    theirs = crnpy.correction_road(1.0, field, width_m, distance_m, road)
    assert f_road(width_m, road, field, distance_m) == pytest.approx(float(theirs), rel=1e-13)


def test_plants_and_road_are_factors_of_the_effective_exposure_alone():
    surroundings = {"biomass": {"dry_kgm2": 2.0}, "road": {"width_m": 4.0, "vwc": 0.08}, "typical_vwc": 0.3}
    site = Site(corrections={"pressure": None, "humidity": None, **surroundings})
    record = correct_record(LoggerRecord(0.0, (50.0,), (10.0,)), site, None, np.array([1.0]))
    factor = f_biomass(2.0, 0.009) * f_road(4.0, 0.08, 0.3)
    assert record.effective_exposure_s == pytest.approx(10.0 / factor)
    assert (record.raw_counts, record.f_pressure, record.f_humidity, record.f_intensity) == (50, 1.0, 1.0, 1.0)
    assert CorrectionSettings().parameters(None).f_surroundings == 1.0


# Settings of the site file (settings.py) -------------------------------------------------------------------------

KANSAS = {"latitude_deg": 38.2346, "longitude_deg": -97.571, "altitude_m": 455}


def test_auto_values_follow_from_the_place() -> None:
    pressure = {"beta_per_hpa": "auto", "reference_hpa": "auto"}
    for site in (
        Site(location=KANSAS, corrections={"pressure": pressure, "cutoff_rigidity_gv": 3.1}),
        Site(corrections={"pressure": pressure, "cutoff_rigidity_gv": 3.1, "place": KANSAS}),
    ):
        parameters = site.corrections_parameters
        assert parameters.beta_per_hpa == barometric_coefficient(atmospheric_depth_gcm2(38.2346, 455), 3.1)
        assert parameters.reference_pressure_hpa == pytest.approx(959.8, abs=0.1)
        assert parameters.f_pressure(parameters.reference_pressure_hpa) == 1.0


def test_scaling_uses_the_place_of_the_monitor() -> None:
    intensity = {"reference": 150, "constant": 148, "scaling": "hawdon2014", "monitor": "jung"}
    site = Site(location=KANSAS, corrections={"intensity": intensity, "cutoff_rigidity_gv": 3.0})
    jungfraujoch_gv = cutoff_rigidity_gv(46.55, 7.98)
    scale = site.corrections_parameters.intensity_scale
    assert scale == pytest.approx(1 + 0.075 * (jungfraujoch_gv - 3.0), abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("corrections: {pressure: {beta_per_hpa: auto}}", "'beta_per_hpa' follows from the place"),
        (
            "location: {latitude_deg: 1, longitude_deg: 2}\ncorrections: {pressure: {reference_hpa: auto}}",
            "'reference_hpa' follows from the place",
        ),
        (
            "corrections: {intensity: {reference: 1, constant: 1, scaling: hawdon2014}}",
            "the scaling hawdon2014 needs a 'monitor'",
        ),
        ("corrections: {intensity: {reference: 1, constant: 1, monitor: JUGN}}", "did you mean 'JUNG'?"),
        ("corrections: {pressure: {beta_per_hpa: automatic}}", "number"),
    ],
)
def test_a_value_without_its_basis_is_refused(tmp_path, text, message) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(text + "\n")
    with pytest.raises(InputError) as caught:
        load_site(path)
    assert message in str(caught.value)
    assert len(caught.value.mistakes) == 1
