# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plants and road: soilmoist_ros.sensing.corrections.factors."""

import numpy as np
import pytest
from crnpy import crnpy
from pydantic import ValidationError

from soilmoist_ros.sensing.corrections.factors import f_biomass, f_road
from soilmoist_ros.sensing.corrections.settings import BiomassCorrection, CorrectionSettings
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.sensing.survey.correction import correct_record


def test_biomass_agrees_with_an_independent_implementation():
    water = crnpy.biomass_to_bwe(biomass_dry=1.5, biomass_fresh=6.0)
    found = BiomassCorrection(dry_kgm2=1.5, fresh_kgm2=6.0)
    assert found.used[0] == pytest.approx(water, rel=1e-14)
    assert found.factor == pytest.approx(crnpy.correction_bwe(1.0, water, r2_N0=6.4 / 1210), rel=1e-14)
    assert BiomassCorrection(water_equivalent_kgm2=water).factor == pytest.approx(found.factor)
    assert BiomassCorrection(dry_kgm2=2.0).factor == pytest.approx(1 / (1 - 0.018))


@pytest.mark.parametrize("distance_m", [0.0, 2.0, 12.0])
@pytest.mark.parametrize(("width_m", "road", "field"), [(0.0, 0.1, 0.2), (3.0, 0.07, 0.15), (6.0, 0.12, 0.35)])
def test_the_road_agrees_with_an_independent_implementation(width_m, road, field, distance_m):
    theirs = crnpy.correction_road(1.0, field, width_m, distance_m, road)
    assert f_road(width_m, road, field, distance_m) == pytest.approx(float(theirs), rel=1e-13)


def test_a_dry_road_in_a_wet_field_adds_counts():
    assert f_road(5.0, 0.07, 0.35) < f_road(2.0, 0.07, 0.35) < 1.0
    assert abs(f_road(5.0, 0.07, 0.35, distance_m=30.0) - 1) < 0.1 * abs(f_road(5.0, 0.07, 0.35) - 1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({}, "either as"),
        ({"water_equivalent_kgm2": 1.0, "dry_kgm2": 1.0}, "either as"),
        ({"dry_kgm2": 2.0, "fresh_kgm2": 1.0}, "at least as much"),
        ({"dry_kgm2": 90.0}, "biomass must be 0 to 56"),
    ],
)
def test_impossible_biomass_is_refused(wrong, message):
    with pytest.raises(ValidationError, match=message):
        BiomassCorrection(**wrong)


def test_plants_and_road_are_factors_of_the_effective_exposure_alone():
    surroundings = {"biomass": {"dry_kgm2": 2.0}, "road": {"width_m": 4.0, "vwc": 0.08}, "typical_vwc": 0.3}
    site = Site(corrections={"pressure": None, "humidity": None, **surroundings})
    record = correct_record(LoggerRecord(0.0, (50.0,), (10.0,)), site, None, np.array([1.0]))
    factor = f_biomass(2.0, 0.009) * f_road(4.0, 0.08, 0.3)
    assert record.effective_exposure_s == pytest.approx(10.0 / factor)
    assert (record.raw_counts, record.f_pressure, record.f_humidity, record.f_intensity) == (50, 1.0, 1.0, 1.0)
    assert CorrectionSettings().parameters(None).f_surroundings == 1.0
