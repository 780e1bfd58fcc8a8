# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map that grows, from files to an output folder: field_survey.py, map_run.py and run.py."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from count_records import scattered
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import FieldGrid, Samples, Skip, Variogram, make_soil_map
from soilmoist_ros.pipeline.field_survey import _footprint, make_run, open_survey
from soilmoist_ros.recording.stored_records import read_earlier
from soilmoist_ros.reporting import summary, write_outputs
from soilmoist_ros.sensing import CalibrationCurve, CountRecord, Footprint, Site
from soilmoist_ros.sensing.records import NAN


def filled(many, **options):
    survey = open_survey("example", "example", **options)
    for record in many:
        survey.map.add(record)
    return survey


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    survey = filled([*scattered(), CountRecord(1.78e9, NAN, NAN, NAN, 400, 100.0, 95.0)], simulated=True)
    survey.map.skip(Skip.UNREADABLE, "too short")
    return survey, folder, write_outputs(folder, survey.run(survey.map.snapshot()))


@pytest.mark.slow
def test_what_is_saved_tells_the_whole_story(saved):
    _, folder, written = saved
    assert {path.name for path in written} == {path.name for path in folder.iterdir()}
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["n_records"], summary["n_placed_records"], summary["n_samples"]) == (9, 8, 8)
    assert summary["n_lost"] == {"no position": 1, "unreadable message": 1}
    assert (summary["site"], summary["field"], summary["simulated"]) == ("Example site", "Example field", True)
    assert [item["role"] for item in summary["inputs"]] == ["field", "site"]
    assert summary["calibration"]["n0_cps"] == 6.0


@pytest.mark.slow
def test_a_map_that_starts_from_what_was_saved_is_the_same(saved):
    survey, folder, _ = saved
    again = filled(read_earlier(folder))
    expected = survey.map.compute(survey.map.state)
    found = again.map.compute(again.map.state)
    for band, wanted in zip(found.bands, expected.bands, strict=True):
        assert band.tobytes() == wanted.tobytes()


def test_without_a_site_there_is_a_rate_map():
    survey = open_survey("example")
    for record in scattered():
        survey.map.add(record)
    run = survey.run(survey.map.snapshot())
    assert run.title == "Neutron count rate map"
    assert np.isnan(run.soil_map.vwc).all()


def test_a_footprint_that_is_not_given_is_that_of_a_bare_probe_with_its_range():
    # Koehli et al. (2015): 130 m in wet to 240 m in dry soil and air
    record = CountRecord(1.7e9, 0.0, 0.0, 0.0, 500, 60.0, 60.0, 1.0, 1.0, 1.0)
    found = _footprint([record], Site(), False)
    low, high = found["footprint_range_m"]
    assert 110 <= low < found["footprint_radius_m"] < high <= 240
    assert _footprint([record], Site(footprint_radius_m=10.0), False) == {"footprint_radius_m": 10.0}
    assert _footprint([record], Site(), True) == {"footprint_radius_m": 10.0}, "a simulated sensor"


def test_a_known_footprint_is_deconvolved_unless_the_site_says_no(tmp_path):
    site = tmp_path / "site.yaml"
    for text, known_m, radius_m in (
        ("name: any\n", 0.0, 0.0),
        ("footprint_radius_m: 8\n", 8.0, 8.0),
        ("footprint_radius_m: 8\ndeconvolve_footprint: true\n", 8.0, 8.0),
        ("footprint_radius_m: 8\ndeconvolve_footprint: false\n", 8.0, 0.0),
        ("deconvolve_footprint: true\n", 10.0, 10.0),
    ):
        site.write_text(text)
        online = open_survey("example", str(site)).map
        assert online.settings.footprint_radius_m == known_m
        online.add(CountRecord(1.78e9, *online.grid.cells[0].tolist(), 30.0, 400, 100.0, 95.0))
        np.testing.assert_array_equal(online.state.samples.spread, [[0, 0, 0, radius_m]])
        soil_map = online.update()
        assert (soil_map.footprint_radius_m, soil_map.deconvolved_m) == (known_m, radius_m)
    assert open_survey("example").map.settings.footprint_radius_m == 0


@pytest.mark.slow
def test_covariates_from_texts_inform_the_map_and_are_inputs(tmp_path):
    import rasterio
    from rasterio.transform import Affine

    frame = open_survey("example").field.frame
    about = {"driver": "GTiff", "width": 80, "height": 70, "count": 1, "dtype": "float64"}
    place = Affine(1, 0, -10, 0, -1, 60)
    with rasterio.open(tmp_path / "image.tif", "w", crs=frame.crs.to_wkt(), transform=place, **about) as file:
        file.write(np.random.default_rng(1).normal(size=(70, 80)) + np.arange(80.0), 1)
    related = [replace(one, raw_counts=round(300 + 8 * one.x_m)) for one in scattered(40)]
    survey = filled(related, covariates=[f"{tmp_path / 'image.tif'}:1"], cell_m=4.0)
    run = survey.run(survey.map.snapshot())
    assert [effect.name for effect in run.soil_map.fit.prior.effects] == ["image 1"]
    assert run.covariates.names == ("image 1",)
    assert [item.role for item in run.inputs] == ["field", "site", "covariate"]
    with pytest.raises(InputError, match="no such file"):
        open_survey("example", covariates=["~/no/such.tif"])


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
