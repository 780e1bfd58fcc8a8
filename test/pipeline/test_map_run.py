# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid, Samples, Variogram, make_soil_map
from soilmoist_ros.pipeline.field_survey import make_run
from soilmoist_ros.reporting.files.summary import summary
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.moisture.footprint import Footprint
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import CountRecord

OUTLINE = [(-20.0, -15.0), (20.0, -15.0), (20.0, 15.0), (-20.0, 15.0)]
SOIL = {"bulk_density_gcm3": 1.4, "lattice_water": 0.02}


def soil_map(curve):
    rng = np.random.default_rng(5)
    xy, exposure = rng.uniform(-14, 14, (12, 2)), rng.uniform(200, 400, 12)
    samples = Samples(xy, rng.poisson(4.5 * exposure), exposure)
    grid = FieldGrid.from_polygon(OUTLINE, cell_m=2.0)
    return make_soil_map(samples, grid, Variogram("matern32", 0.01, 12.0, 0.2), curve)


@pytest.fixture(scope="module")
def the_map():
    return soil_map(CalibrationCurve(7.0, 1.4, lattice_water=0.02))


def run_of(soil_map, site, **factors):
    records = [CountRecord(1.7e9 + n, 0.0, 0.0, 80.0, 40, 10.0, 9.5, **factors) for n in range(3)]
    return make_run(soil_map, records, site, LocalFrame(53.27, -0.52), field_name="West", settings={})


def test_the_report_has_the_depth_and_radius_of_the_counts_in_the_air_of_the_survey(the_map):
    site = Site(footprint_radius_m=500.0, soil=SOIL, calibration={"n0_cps": 7.0})
    run = run_of(the_map, site, f_pressure=math.exp(0.0077 * (950 - 1013.25)), f_humidity=1 + 0.0054 * 9.0)
    wettest = float(np.nanmax(the_map.vwc[the_map.grid.mask])) + 1.4 * 0.02
    expected = Footprint(wettest, 9.0, 950.0, shield_radius_m=500.0)
    assert run.sensed.radius_m[1] == pytest.approx(expected.radius_m, rel=1e-6)
    assert run.sensed.depth_cm[1] == pytest.approx(expected.depth_cm(1.4), rel=1e-6)
    sensed = summary(run)["map"]["sensed"]
    assert sensed["depth_d86_cm"] == dict(zip(("mean", "min", "max"), run.sensed.depth_cm, strict=True))
    assert sensed["radius_r86_m"]["max"] > 100


def test_without_a_moisture_no_depth_is_known():
    assert run_of(soil_map(None), Site()).sensed is None


def test_corrections_of_the_site_are_listed_with_their_parameters(the_map):
    corrections = {"biomass": {"dry_kgm2": 2.0}, "road": {"width_m": 4.0}, "humidity": {"reference_gm3": 8.0}}
    calibration = {"n0_cps": 7.0, "curve": "universal"}
    site = Site(corrections=corrections, soil=SOIL, calibration=calibration)
    rows = {row.name: row for row in run_of(the_map, site).corrections}
    assert rows["air humidity"].formula.startswith("N(Q0) / N(Q)")
    assert rows["air humidity"].parameters == {"Q0 [g/m3]": 8.0, "at moisture [m3/m3]": 0.2}
    assert rows["plants"].mean_factor == pytest.approx(1 / (1 - 0.018))
    assert rows["road"].parameters["width [m]"] == 4.0
    assert site.corrections_parameters.humidity_gm3(
        site.corrections_parameters.f_humidity(25.0, 0.6)
    ) == pytest.approx(13.8, abs=0.1)
