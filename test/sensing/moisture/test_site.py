# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import math
from dataclasses import replace

import numpy as np
import pytest
from crnpy import crnpy
from pydantic import ValidationError

from soilmoist_ros.foundation import InputError, config_folder
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve
from soilmoist_ros.sensing.moisture.site import (
    Calibration,
    Site,
    Soil,
    UncertaintyPart,
    estimate_n0,
    load_site,
    write_calibration,
    write_site_values,
)
from soilmoist_ros.sensing.moisture.texture import TEXTURES


def test_all_mistakes_are_named_at_once_with_line_key_and_suggestion(tmp_path):
    path = tmp_path / "site.yaml"
    path.write_text(
        "name: a\n"
        "longitude: wst\n"
        "soil:\n"
        "  bulk_densty_gcm3: 1.4\n"
        "corrections:\n"
        "  pressure: {beta_per_hpa: -1}\n"
        "  intensity: {reference: 150}\n"
    )
    with pytest.raises(InputError) as caught:
        load_site(path)
    found = {(mistake.line, mistake.column) for mistake in caught.value.mistakes}
    assert (2, "longitude") in found
    assert (4, "soil.bulk_densty_gcm3") in found
    assert (3, "soil.bulk_density_gcm3") in found
    assert (6, "corrections.pressure.beta_per_hpa") in found
    assert (7, "corrections.intensity") in found
    assert "did you mean 'bulk_density_gcm3'?" in str(caught.value)
    assert "either as 'constant' or as 'file'" in str(caught.value)


def test_the_word_in_the_note_of_an_old_file_is_read_with_a_warning(tmp_path, caplog):
    path = tmp_path / "site.yaml"
    path.write_text("calibration: {n0_cps: 6, note: 'illustrative: no cores'}\n")
    assert load_site(path).calibration.illustrative
    (record,) = caplog.records
    assert "write 'illustrative: true'" in record.getMessage()
    assert load_site(config_folder() / "sites" / "gypsum_transect.yaml").calibration.illustrative
    assert len(caplog.records) == 1


@pytest.mark.parametrize(
    ("keys", "mistake"),
    [
        ({"irrigation": {"wilting_point": 0.1}}, "together"),
        ({"irrigation": {"dry_below": 0.3, "moist_above": 0.2}}, "must be below"),
        ({"irrigation": {"root_depth_mm": 0.3}}, r"0.3 is not usual \(50 to 3000\): write 300 if it is in m"),
        ({"irrigation": {"root_depth_mm": 24}}, "write 240 if it is in cm or 609.6 if it is in inches"),
        ({"irrigation": {"steps_mm": 0.2}}, "5.08 if it is in inches"),
        ({"irrigation": {"max_dose_mm": 0.04}}, "write 40 if it is in m"),
        ({"irrigation": {"width_m": 6000}}, "60 if it is in cm or 6 if it is in mm"),
        ({"irrigation": {"min_zone_ha": 500}}, "0.05 if it is in m2"),
        ({"irrigation": {"wilting_point": 14, "field_capacity": 0.3}}, "0.14 if it is in per cent"),
        ({"irrigation": {"texture": "loam", "field_capacity_sd": 5}}, "0.05 if it is in per cent"),
        ({"irrigation": {"depletion": 50}}, "0.5 if it is in per cent"),
        ({"irrigation": {"efficiency": 0}}, "greater than 0"),
        ({"irrigation": {"efficiency": 1.1}}, "less than or equal to 1"),
        ({"irrigation": {"efficiency": 0.08}}, "below 0.3: most of the water would be lost"),
        ({"irrigation": {"steps_mm": 0}}, "greater than 0"),
        ({"irrigation": {"steps_mm": 70}}, "'steps_mm' 70 is larger than 'max_dose_mm' 60"),
        ({"irrigation": {"min_dose_mm": 70}}, "'min_dose_mm' 70 is larger"),
        ({"irrigation": {"texture": "mud"}}, "sandy loam"),
        ({"soil": {"texture": "sand"}, "irrigation": {"texture": "clay"}}, "remove that of irrigation"),
        ({"irrigation": {"texture": "loam", "wilting_point": 0.1, "field_capacity": 0.3}}, "not both"),
        ({"irrigation": {"texture": "loam", "target": 0.2}}, "not above 0.21, where plants lack water"),
        ({"irrigation": {"texture": "loam", "target_share": 0.5}}, "'target_share' 0.5 is not above 0.21"),
        ({"irrigation": {"wilting_point": 0.1, "field_capacity": 0.31, "target": 0.4}}, "0.4 is above 'field_cap"),
        ({"irrigation": {"target": 0.25, "target_share": 0.9}}, "'target' or 'target_share', not both"),
        ({"irrigation": {"target": 0.5}, "soil": {"bulk_density_gcm3": 1.6}}, "above the pore volume 0.40"),
        (
            {"irrigation": {"wilting_point": 0.1, "field_capacity": 0.6}, "soil": {"bulk_density_gcm3": 1.6}},
            "'field_capacity' 0.6 is above the pore volume 0.40",
        ),
    ],
)
def test_impossible_limits_and_doses_are_refused(keys, mistake):
    with pytest.raises(ValidationError, match=mistake):
        Site(**keys)


def test_the_texture_of_the_soil_gives_limits_for_irrigation_unless_they_are_given():
    loam = Site(soil={"bulk_density_gcm3": 1.4, "texture": "loam"})
    limits = loam.irrigation
    assert (limits.wilting_point, limits.field_capacity) == (0.14, 0.28)  # Saxton & Rawls (2006), table 3
    assert limits.field_capacity_sd > limits.wilting_point_sd > 0.02
    assert Site(**loam.model_dump()).irrigation == limits
    own = {"wilting_point": 0.1, "field_capacity": 0.3}
    given = Site(soil={"bulk_density_gcm3": 1.4, "texture": "loam"}, irrigation=own).irrigation
    assert (given.wilting_point, given.texture, given.wilting_point_sd) == (0.1, None, None)


def test_bound_water_follows_from_clay_and_carbon_unless_it_was_measured():
    soil = Soil(bulk_density_gcm3=1.4, clay=0.3, organic_carbon=0.02)
    assert soil.lattice_water == pytest.approx(float(crnpy.lattice_water(30.0)) / 100)
    assert soil.organic_water == pytest.approx(0.02 * 2 * 0.556)  # as neptoon 1.2.0 computes it
    measured = Soil(bulk_density_gcm3=1.4, clay=0.3, lattice_water=0.01)
    assert (measured.lattice_water, measured.organic_water) == (0.01, 0.0)
    with pytest.raises(ValidationError, match="clay"):
        Soil(bulk_density_gcm3=1.4, clay=30.0)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("location: {latitude_deg: '51,5', longitude_deg: 1.0}", "write degrees with decimals and a point"),
        ("location: {latitude_deg: 51.5, longitude_deg: 1.0, altitude_m: 100 m}", "without its unit"),
        ("corrections: {pressure: {reference_hpa: 101325}}", "the name of the key has its unit: hPa"),
        ("soil: {bulk_density_gcm3: 1310}", "the name of the key has its unit: g/cm3"),
        ("soil: {bulk_density_gcm3: 1.3, lattice_water: 3}", "it is a fraction: divide per cent by 100"),
    ],
)
def test_numbers_in_other_notations_and_units_are_refused_with_the_likely_one(tmp_path, text, remedy):
    path = tmp_path / "site.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_site(path)
    (mistake,) = caught.value.mistakes
    assert remedy in mistake.remedy


# Calibration -----------------------------------------------------------------------------------------------------

UNIT = CalibrationCurve(1.0, 1.4, 0.02)


CURVES = pytest.mark.parametrize("unit_curve", [UNIT, UniversalCurve(1.0, 1.4, 0.02, humidity_gm3=6.0)])


@CURVES
def test_uncertainty_of_n0_is_that_of_repeated_calibrations(unit_curve):
    rng = np.random.default_rng(4)
    true = replace(unit_curve, n0_cps=6.0)
    vwc, vwc_sd, exposure = 0.22, 0.01, 3600.0
    rate = float(true.rate_cps(vwc))
    counts = rng.poisson(rate * exposure, 1000)
    moistures = rng.normal(vwc, vwc_sd, 1000)
    repeated = [
        estimate_n0(n / exposure, 0.0, m, 0.0, unit_curve).n0_cps for n, m in zip(counts, moistures, strict=True)
    ]
    estimate = estimate_n0(rate, math.sqrt(rate / exposure), vwc, vwc_sd, unit_curve)
    assert estimate.n0_cps == pytest.approx(6.0)
    assert estimate.n0_sd_cps == pytest.approx(np.std(repeated), rel=0.07)


def test_method_parts_and_bound_water_return_from_a_site_file(tmp_path):
    path = tmp_path / "site.yaml"
    path.write_text("name: a field\n")
    part = {"value": 0.03, "unit": "g/g", "sd": 0.01, "origin": "default range"}
    snow = UncertaintyPart(name="snow", value=math.nan, unit="mm", sd=0.0, origin="default range")
    parts = [UncertaintyPart(name="lattice and organic water", **part), snow]
    soil = Soil(bulk_density_gcm3=1.4, bound_water_sd=0.01)
    write_calibration(path, Calibration(n0_cps=2.0, method="general", parts=parts), soil)
    assert "nan" not in path.read_text()  # numbers that are not known are left out
    known = load_site(path)
    assert known.soil == soil
    assert known.calibration.method == "general"
    assert known.calibration.parts[0].sd == 0.01
    assert math.isnan(known.calibration.parts[0].share + known.calibration.parts[1].value)
    assert known.curve.parameters["bound_water_sd"] == 0.01
    assert "bound_water_sd" not in CalibrationCurve(2.0, 1.4).parameters  # files of older runs stay as they are


def test_a_value_that_does_not_fit_names_the_given_file_and_leaves_it(tmp_path):
    path = tmp_path / "site.yaml"
    path.write_text("name: a\n")
    with pytest.raises(InputError) as error:
        write_site_values(path, {"sensor_sensitivity": 300.0})
    assert {one.path for one in error.value.mistakes} == {path}
    assert path.read_text() == "name: a\n"


@pytest.mark.parametrize("texture", ["lome", ["loam"]])
def test_of_a_misspelt_texture_only_the_texture_is_named(texture):
    with pytest.raises(ValidationError) as error:
        Soil.model_validate({"texture": texture})
    assert [one["loc"] for one in error.value.errors()] == [("texture",)]
    with pytest.raises(ValidationError) as error:
        Site.model_validate({"soil": {"texture": texture}})
    assert [one["loc"] for one in error.value.errors()] == [("soil", "texture")]


# Texture (texture.py) --------------------------------------------------------------------------------------------


def saxton_rawls(sand, clay, matter=2.5):
    """Wilting point, field capacity and pores by the equations 1, 2, 3 and 5 of Saxton & Rawls (2006)."""
    dry = -0.024 * sand + 0.487 * clay + 0.006 * matter + 0.031
    dry += 0.005 * sand * matter - 0.013 * clay * matter + 0.068 * sand * clay
    wilting = 1.14 * dry - 0.02
    moist = -0.251 * sand + 0.195 * clay + 0.011 * matter + 0.299
    moist += 0.006 * sand * matter - 0.027 * clay * matter + 0.452 * sand * clay
    capacity = moist + 1.283 * moist**2 - 0.374 * moist - 0.015
    wet = 0.278 * sand + 0.034 * clay + 0.022 * matter + 0.078
    wet += -0.018 * sand * matter - 0.027 * clay * matter - 0.584 * sand * clay
    return wilting, capacity, capacity + 1.636 * wet - 0.107 - 0.097 * sand + 0.043


@pytest.mark.parametrize("name", TEXTURES)
def test_the_table_is_that_of_the_equations(name):
    soil = TEXTURES[name]
    wilting, capacity, pores = saxton_rawls(soil.sand, soil.clay)
    assert soil.wilting_point == pytest.approx(wilting, abs=0.011)
    assert soil.field_capacity == pytest.approx(capacity, abs=0.011)
    assert soil.bulk_density_gcm3 == pytest.approx(2.65 * (1 - pores), abs=0.03)
    assert soil.clay_range[0] <= soil.clay <= soil.clay_range[1]
    assert 0.02 < soil.wilting_point_sd < soil.field_capacity_sd < 0.1


def test_a_texture_gives_what_the_file_leaves_out():
    by_class = Soil(texture="loam")
    assert (by_class.bulk_density_gcm3, by_class.lattice_water) == (1.43, pytest.approx(0.0194))
    assert 0.1 < by_class.bulk_density_sd_gcm3 < 0.2
    assert 0.005 < by_class.bound_water_sd < 0.03
    measured = Soil(texture="loam", bulk_density_gcm3=1.3, lattice_water=0.03)
    assert (measured.bulk_density_sd_gcm3, measured.bound_water_sd) == (None, None)  # no range of a class
    assert measured.organic_water == 0
