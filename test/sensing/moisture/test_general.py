# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The constants of the general calibration follow from the published calibrations, and its intervals hold."""

import csv
import math
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.mapping import make_bands
from soilmoist_ros.sensing.corrections.intensity import cosmic_place
from soilmoist_ros.sensing.moisture import general
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.moisture.general import SurveyAir, general_calibration, location_factor
from soilmoist_ros.sensing.moisture.site import Site, Soil

TABLE = Path(__file__).parents[2] / "data" / "general_calibration.csv"
DRY_DIPPOLDISWALDE = SurveyAir(51.0, 13.7, 970.0, 15.0)


@dataclass(frozen=True)
class Calibrated:
    """A published calibration: corrected rate, moisture of the cores, soil, and N0 over the general one."""

    name: str
    rate_cps: float
    vwc: float
    soil: Soil
    n0_cps: float
    parma_over_factor: float
    general_n0_cps: float

    @property
    def ratio(self):
        return self.n0_cps / self.general_n0_cps


def calibrated(row):
    """A row, corrected and calibrated by this package alone."""
    of = {name: float(text) for name, text in row.items() if name not in ("site", "date", "land_use")}
    density = of["bulk_density_kgm3"] / 1000
    site = Site.model_validate({
        "location": {name: of[name] for name in ("latitude_deg", "longitude_deg", "altitude_m")},
        "sensor_sensitivity": 1.0,  # the counts are divided by it
        "sensor_sensitivity_sd": 0.0,
        "soil": {
            "bulk_density_gcm3": density,
            "lattice_water": of["bound_water_m3m3"] / density,
            "organic_water": 0.0,  # is part of the bound water
        },
        "corrections": {
            "pressure": {"beta_per_hpa": "auto"},
            "intensity": {"reference": general.JUNG_CPS, "constant": general.JUNG_CPS, "monitor": "JUNG"},
            "biomass": {"dry_kgm2": of["dry_biomass_kgm2"]},
        },
    })  # fmt: skip
    settings = site.corrections_parameters
    f_humidity = 1 + settings.humidity_coefficient_m3g * of["humidity_gm3"]
    factor = settings.f_pressure(of["pressure_hpa"]) * f_humidity * of["f_jung"] * settings.f_surroundings
    rate = of["counts_per_hour"] / 3600 * factor
    calibration, _ = general_calibration(site, SurveyAir(pressure_hpa=of["pressure_hpa"]))
    n0 = rate / float(calibration.model_copy(update={"n0_cps": 1.0}).curve_of(site.soil).rate_cps(of["vwc"]))
    place = of["latitude_deg"], of["longitude_deg"], of["altitude_m"]
    cosmic = cosmic_place(*place)
    factor = location_factor(
        general.standard_pressure_hpa(place[0], place[2]), cosmic.cutoff_rigidity_gv, place[0]
    )
    return Calibrated(
        row["site"], rate, of["vwc"], site.soil, n0, math.log(of["parma"] / factor), calibration.n0_cps
    )


@cache
def table():
    with TABLE.open(encoding="utf-8") as file:
        return [calibrated(row) for row in csv.DictReader(file)]


def by_site(value):
    """Mean over the rows of each site."""
    values = defaultdict(list)
    for one in table():
        values[one.name].append(value(one))
    return {name: float(np.mean(each)) for name, each in values.items()}


@pytest.mark.slow
def test_the_constants_follow_from_the_published_calibrations():
    assert (len(table()), len(by_site(lambda one: one.vwc))) == (104, 75)
    errors = np.array(list(by_site(lambda one: math.log(one.ratio)).values()))
    assert errors.mean() == pytest.approx(0.0, abs=0.004)
    scaling = np.array(list(by_site(lambda one: one.parma_over_factor).values()))
    assert pytest.approx(scaling.std(ddof=1), abs=0.001) == general.SCALING_SD
    assert math.hypot(general.GENERAL_SD, general.SCALING_SD) == pytest.approx(errors.std(ddof=1), abs=0.001)


@pytest.mark.slow
def test_intervals_of_a_site_that_was_left_out_hold_in_nine_of_ten_sites():
    """Leave one site out: N0 and its scatter from the other 74, the interval of the moisture through the curve."""
    errors = by_site(lambda one: math.log(one.ratio))
    held = defaultdict(list)
    for one in table():
        others = np.array([error for name, error in errors.items() if name != one.name])
        n0 = one.general_n0_cps * math.exp(others.mean())
        curve = CalibrationCurve(
            n0, one.soil.bulk_density_gcm3, one.soil.lattice_water, n0_sd_cps=n0 * others.std(ddof=1)
        )
        bands = make_bands(np.array(one.rate_cps), np.array(0.0), curve)
        held[one.name].append(float(bands.vwc_p05) <= one.vwc <= float(bands.vwc_p95))
    rows = np.concatenate(list(held.values()))
    assert 0.85 <= rows.mean() <= 0.95
    assert 0.85 <= np.mean([np.mean(each) for each in held.values()]) <= 0.95


def test_the_default_rigidity_is_that_of_the_reference_place():
    assert cosmic_place(52.464, 12.960, 40.0).cutoff_rigidity_gv == pytest.approx(general.RIGIDITY_GV, abs=0.01)
    assert location_factor(1013.25, general.RIGIDITY_GV, 52.464) == pytest.approx(1.0)


@given(st.sampled_from([None, "loam", "sand", "clay"]), st.booleans(), st.booleans(), st.booleans())
def test_parts_add_up_and_what_is_unknown_widens(texture, humid, pressed, grown):
    corrections = {"humidity": {} if humid else None, "pressure": {} if pressed else None}
    content = {"sensor_sensitivity": "CRS-1000", "corrections": corrections}
    content |= {"soil": {"texture": texture}} if texture else {}
    content |= {"vegetation": {"crop": "grass"}} if grown else {}
    calibration, soil = general_calibration(Site.model_validate(content), DRY_DIPPOLDISWALDE)
    shares = [part.share for part in calibration.parts if not math.isnan(part.share)]
    assert calibration.n0_sd_cps / calibration.n0_cps == pytest.approx(math.hypot(*shares), rel=1e-3)
    assert math.hypot(*shares) > math.hypot(general.GENERAL_SD, general.SCALING_SD)
    known = {part.name: part for part in calibration.parts}
    assert known["humidity"].origin == ("measured" if humid else "default range")
    assert known["intensity"].origin == known["biomass"].origin == "default range"
    assert known["bulk density"].sd == soil.bulk_density_sd_gcm3 > 0
    assert known["lattice and organic water"].sd == soil.bound_water_sd > 0
    assert (calibration.method, calibration.illustrative) == ("general", False)


@given(
    st.floats(850, 1040),
    st.floats(0, 20),
    st.floats(0, 14),
    st.floats(140, 170),
    st.sampled_from(["none", "auto"]),
)
def test_the_moisture_does_not_depend_on_the_references_of_the_site(hpa, humidity, reference, jung, beta):
    """The same counts give the same moisture, whatever the site corrects to."""
    plain, other = {}, {"pressure": {"reference_hpa": hpa}, "humidity": {"reference_gm3": reference}}
    if beta == "auto":
        other["pressure"]["beta_per_hpa"] = 0.0071
    rates = []
    for corrections, c0 in ((plain, general.JUNG_CPS), (other, jung)):
        intensity = {"reference": c0, "constant": 155.0, "monitor": "JUNG"}
        site = Site.model_validate(
            {"sensor_sensitivity": 2.0, "corrections": {**corrections, "intensity": intensity}}
        )
        settings = site.corrections_parameters
        factor = settings.f_pressure(970.0) * settings.f_intensity(155.0)
        factor *= 1 + 0.0054 * (humidity - settings.reference_humidity_gm3)
        rates.append(factor / general_calibration(site, DRY_DIPPOLDISWALDE)[0].n0_cps)
    bent = 0.0054**2 * reference * abs(humidity - reference)  # the linear factor around another reference
    assert rates[0] == pytest.approx(rates[1], rel=1e-4 + bent)


def test_snow_is_named_and_far_places_are_less_certain():
    site = Site(sensor_sensitivity=1.0)
    cold = general_calibration(site, SurveyAir(51.0, 13.7, 970.0, -3.0))[0]
    assert "snow" in {part.name for part in cold.parts}
    assert "snow is not accounted for" in cold.note
    shares = [
        {part.name: part.share for part in general_calibration(site, air)[0].parts}["site scaling"]
        for air in (DRY_DIPPOLDISWALDE, SurveyAir(4.6, -74.1, 750.0, 15.0))
    ]
    assert shares == [general.SCALING_SD, 2 * general.SCALING_SD]


@pytest.mark.parametrize(
    ("keys", "air"),
    [
        ({}, DRY_DIPPOLDISWALDE),
        ({"sensor_sensitivity": 1.0}, SurveyAir(pressure_hpa=970.0)),
        ({"sensor_sensitivity": 1.0}, SurveyAir(51.0, 13.7)),
    ],
)
def test_without_sensor_place_or_pressure_there_is_no_moisture(keys, air):
    assert general_calibration(Site.model_validate(keys), air) is None


@pytest.mark.parametrize(
    "known", [{}, {"clay": 0.1}, {"lattice_water": 0.02}, {"texture": "loam"}, {"organic_carbon": 0.4}]
)
def test_peat_needs_its_organic_matter(known):
    keys = {"sensor_sensitivity": 1.0, "soil": {"bulk_density_gcm3": 0.2, **known}}
    found = general_calibration(Site.model_validate(keys), DRY_DIPPOLDISWALDE)
    assert (found is not None) == ("organic_carbon" in known)
    assert found is None or found[1].organic_water > 0.15


def test_the_error_of_organic_water_grows_with_it():
    """Uniform factors of 1.4 to 2.5 from carbon to matter (Pribyl 2010), drawn."""
    sds = []
    for carbon in (0.0, 0.02, 0.45):
        soil = {"bulk_density_gcm3": 0.3, "organic_carbon": carbon}
        sds.append(general.soil_of(Site(soil=soil))[0].bound_water_sd)
        drawn = 0.556 * carbon * np.random.default_rng(1).uniform(1.4, 2.5, 20_000)
        assert sds[-1] == pytest.approx(np.hypot(0.01, drawn.std()), rel=0.02)
    assert sds[0] == 0.01
    assert sds[1] < 0.011  # as before in a mineral soil
    assert sds[2] > 0.07
    known = Site(soil={**soil, "bound_water_sd": 0.03})
    assert general.soil_of(known)[0].bound_water_sd == 0.03
