# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist map`` of a log whose site has no N0."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from soilmoist_ros import sensing
from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import load_field, make_bands
from soilmoist_ros.pipeline import map_logs, open_survey, planning_curve, planning_thresholds
from soilmoist_ros.pipeline.field_survey import with_general_calibration
from soilmoist_ros.pipeline.log_map import MapSettings, survey_air, with_sensor
from soilmoist_ros.sensing import Calibration, CalibrationCurve, Site, SurveyAir, load_site, read_log

LOG = Path("examples/station_kansas_2021-10.dat")
STATION = load_site("station_kansas")
PLACE = np.array([[38.2346, -97.571]])


@pytest.fixture(scope="module")
def logs():
    return [read_log(LOG, utc_offset_hours=-6)]


def without(site, **keys):
    known = {name: getattr(site, name) for name in site.model_fields_set - {"calibration"}}
    return Site.model_validate(known | keys)


def test_a_site_with_n0_or_without_a_known_sensor_stays_as_it_is(logs):
    for site in (STATION, without(STATION), without(STATION, calibration=None)):
        assert with_general_calibration(site, survey_air(logs, PLACE)) is site


def test_without_a_pressure_the_message_says_what_to_give(logs):
    records = tuple(replace(record, pressure_hpa=math.nan) for record in logs[0].records)
    nowhere = Site.model_validate({"sensor_sensitivity": 1, "corrections": {"pressure": None}})
    with pytest.raises(InputError, match="'altitude_m' in 'location'"):
        with_general_calibration(nowhere, survey_air([replace(logs[0], records=records)], PLACE))


def test_of_peat_without_its_organic_matter_no_moisture_is_claimed(logs):
    peat = without(STATION, sensor_sensitivity=1, soil={"bulk_density_gcm3": 0.2})
    with pytest.raises(InputError, match="organic soil: give organic_carbon"):
        with_general_calibration(peat, survey_air(logs, PLACE))


def test_a_plan_weighs_moisture_by_the_general_calibration_not_by_a_guess(logs):
    field, site = load_field(Path("config/fields/example.yaml")), without(STATION, sensor_sensitivity="LiFoil-2")
    there = with_general_calibration(site, SurveyAir(*field.centre, 985.0)).calibration
    assert planning_curve(site, field, True).n0_cps == pytest.approx(there.n0_cps, rel=0.01), "at any pressure"
    with pytest.raises(InputError, match="no calibration, and the sensor is unknown"):
        planning_curve(without(STATION), field, True)
    peat = without(site, soil={"bulk_density_gcm3": 0.2})
    assert [planning_curve(one, field, False) for one in (without(STATION), peat)] == [None, None]


def test_thresholds_of_a_plan_are_those_given_or_those_between_the_doses():
    curve, plain = CalibrationCurve(5.0, 1.4), without(STATION)
    loam = without(STATION, irrigation={"texture": "loam", "steps_mm": 20, "max_dose_mm": 40})
    found = planning_thresholds("decision", "dose", loam, curve)
    assert found.values == pytest.approx([0.28 - 30 / 300, 0.21]), "20 mm at once where plants lack water, then 40"
    assert planning_thresholds("decision", "5 4", plain, None).rates_cps == (4, 5)
    assert planning_thresholds("vwc", "", plain, curve) is None
    for target, text, site, of, why in (
        ("decision", "", plain, curve, "belong together"),
        ("rate", "0.2", plain, curve, "belong together"),
        ("decision", "dose", loam, None, "no calibration"),
        ("decision", "0.2", plain, None, "looks like a moisture"),
        ("decision", "0.2 0.2", plain, curve, "twice"),
        ("decision", "dose", plain, curve, "water that plants use"),
    ):
        with pytest.raises(InputError, match=why):
            planning_thresholds(target, text, site, of)


def test_a_calibrated_site_refuses_another_sensor():
    with pytest.raises(InputError, match="--sensor"):
        with_sensor(STATION, "CRS-1000", Path("site.yaml"))
    assert with_sensor(Site(), "CRS-1000", None).sensor_sensitivity == "CRS-1000"
    other = Site(sensor_sensitivity="CRS-2000B")
    assert with_sensor(other, "CRS-2000B", None) == other
    with pytest.raises(InputError, match="has the sensor_sensitivity CRS-2000B, not CRS-1000"):
        with_sensor(other, "CRS-1000", Path("site.yaml"))


@pytest.mark.slow
def test_the_command_says_where_the_moisture_is_from(tmp_path):
    site = tmp_path / "site.yaml"
    place = "{latitude_deg: 38.2346, longitude_deg: -97.571, altitude_m: 455}"
    site.write_text(f"name: a station\nlogger_utc_offset_hours: -6\nlocation: {place}\n")
    command = ["map", str(LOG), "--site", str(site), "--overwrite"]
    plain = CliRunner().invoke(main, [*command, "--out", str(tmp_path / "rate")])
    assert "level      Unknown sensor: the level lies between 2.4 and 50.9 % by volume" in plain.output
    assert "(2.4 to 50.9) % vol." in plain.output, "one interval everywhere"
    assert "19 to 51 % by volume with a LiFoil-2" in plain.output
    about = json.loads((tmp_path / "rate" / "summary.json").read_text())
    assert (about["calibration"]["method"], about["budget"]["largest"]) == ("unknown sensor",) * 2
    assert about["map"]["uncertainty_vwc"]["everywhere_sd"] == about["budget"]["level_sd"]
    assert about["dose"]["missing"] == "the sensor is unknown, and with it the level of the moisture"
    assert "unknown_sensor" in about["warning_codes"]
    assert "--sensor MODEL" in about["budget"]["remedy"]
    assert "nearly unknown" in (tmp_path / "rate" / "report.html").read_text()
    off = CliRunner().invoke(main, ["export", str(tmp_path / "rate"), "--to", "isoxml", "--overwrite"])
    assert off.exit_code != 0
    assert "name the sensor with --sensor MODEL" in off.output
    header = tmp_path / "named.dat"
    header.write_text(LOG.read_text().replace("CPU:KS003.CR300", "CPU:CRS1000-B.CR300"))
    named = CliRunner().invoke(main, [*command[:1], str(header), *command[2:], "--out", str(tmp_path / "named")])
    assert "sensor     CRS-1000B, by the header of the log" in named.output
    assert json.loads((tmp_path / "named" / "summary.json").read_text())["calibration"]["method"] == "general"
    found = CliRunner().invoke(main, [*command, "--out", str(tmp_path / "moist"), "--sensor", "lifoil2"])
    assert found.exit_code == 0, found.output
    assert "counts/s +- 9%, general calibration after Heistermann" in found.output
    about = json.loads((tmp_path / "moist" / "summary.json").read_text())
    assert about["calibration"]["method"] == "general"
    assert {part["origin"] for part in about["calibration"]["parts"]} >= {
        "literature",
        "measured",
        "default range",
    }
    assert "general_calibration" in about["warning_codes"]
    report = (tmp_path / "moist" / "report.html").read_text()
    assert "Default ranges, not measured: intensity, biomass, bulk density" in report
    of_day = ["--from", "2021-10-22T06:00", "--to", "2021-10-23T06:00", "--out", str(tmp_path / "day")]
    assert CliRunner().invoke(main, [*command, *of_day, "--sensor", "lifoil2"]).exit_code == 0
    mean = json.loads((tmp_path / "day" / "summary.json").read_text())["map"]["mean_vwc"]
    assert mean["p05"] < 0.292 < mean["p95"], "56 soil cores of this day"


DATA = Path(__file__).parents[1] / "data"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("record", "sensor", "place", "soil", "of_cores"),
    [
        ("SHC002_2015-07-04.csv", "CRS-2000B", (51.528, -1.468, 204), (1.1, 0.031, 0.046), 0.229),
        ("FSC001_2014-11-17.csv", "CRS-1000", (53.319, 13.122, 66), (1.135, 0.002, 0.031), 0.122),
    ],
)
def test_a_day_of_a_public_station_holds_its_cores(record, sensor, place, soil, of_cores, tmp_path):
    keys = {
        "location": dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), place, strict=True)),
        "soil": dict(zip(("bulk_density_gcm3", "lattice_water", "organic_carbon"), soil, strict=True)),
    }
    (tmp_path / "site.yaml").write_text(json.dumps(keys))
    command = ["map", str(DATA / record), "--site", str(tmp_path / "site.yaml"), "--sensor", sensor]
    found = CliRunner().invoke(main, [*command, "--out", str(tmp_path / "out")])
    assert found.exit_code == 0, found.output
    mean = json.loads((tmp_path / "out" / "summary.json").read_text())["map"]["mean_vwc"]
    assert mean["p05"] < of_cores < mean["p95"]


@pytest.mark.parametrize("sensor", ["CRS-3000", "0", "-1", "nan", "101"])
def test_an_unknown_sensor_is_refused_with_the_known_ones(sensor, tmp_path):
    found = CliRunner().invoke(main, ["map", str(LOG), "--sensor", sensor, "--out", str(tmp_path / "out")])
    assert found.exit_code != 0
    assert "CRS-1000 (0.45)" in found.output


def test_the_level_of_an_unknown_sensor_is_honest():
    """Sensors and soils drawn 200 times; the field's moisture between residual water and full pores."""
    rng, inside = np.random.default_rng(46), 0
    models = (*(value for value in sensing.SENSITIVITIES.values()), 0.2, 3.0, 10.0)
    for _ in range(200):
        soil = sensing.Soil(bulk_density_gcm3=rng.uniform(1.05, 1.55), lattice_water=rng.uniform(0.01, 0.06))
        truth = Calibration(n0_cps=rng.choice(models) * rng.uniform(0.6, 1.4)).curve_of(soil)
        vwc = rng.uniform(0.02, 1 - soil.bulk_density_gcm3 / 2.65)
        rate = float(truth.rate_cps(vwc))
        calibration, of_map = sensing.unknown_sensor(Site(), SurveyAir(52.0, 13.0, 1000.0), rate)
        bands = make_bands(np.array([rate]), np.zeros(1), calibration.curve_of(of_map))
        inside += bool(bands.vwc_p05[0] <= vwc <= bands.vwc_p95[0])
    assert inside >= 0.85 * 200


def test_an_unknown_sensor_needs_counts_and_mineral_soil():
    assert sensing.unknown_sensor(Site(), SurveyAir(), 0.0) is None
    assert sensing.unknown_sensor(without(STATION, soil={"bulk_density_gcm3": 0.2}), SurveyAir(), 1.0) is None
    assert "would mean" not in sensing.unknown_sensor(Site(), SurveyAir(), 1.0)[0].note, "no place, no models"


@pytest.mark.slow
def test_the_robot_a_replay_and_a_log_have_one_calibration(tmp_path):
    """The roving record as a log, and its records one by one as a mapper gets them."""
    log = Path("examples/rover_gypsum_transect_2018-05-01.KSU")
    site = without(load_site("gypsum_transect"), sensor_sensitivity=10.0)
    field = {"name": "roads", "datum": {"latitude_deg": 38.7, "longitude_deg": -97.45}, "cell_m": 1000}
    files = {"site": site.model_dump(mode="json", exclude={"calibration"}), "field": field}
    field["polygon"] = [[-9000, -9000], [9000, -9000], [9000, 9000], [-9000, 9000]]
    for name, content in files.items():
        (tmp_path / f"{name}.yaml").write_text(json.dumps(content))
    names = {name: str(tmp_path / f"{name}.yaml") for name in files}
    of_log = map_logs([log], MapSettings(logger="hydroinnova_rover", merge_radius_m=40.0, **names))
    live = open_survey(**names, merge_radius_m=40.0)
    assert live.map.settings.curve is None
    assert "waits for the air pressure" in live.health(live.map.state)[0].message
    for record in of_log.track:
        live.map.add(record)
    run = live.run(live.map.snapshot())
    assert run.calibration.n0_cps == pytest.approx(of_log.calibration.n0_cps, rel=1e-4)
    for part, same in zip(run.calibration.parts, of_log.calibration.parts, strict=True):
        assert (part.name, part.origin, part.unit) == (same.name, same.origin, same.unit)
        assert (part.value, part.sd) == pytest.approx((same.value, same.sd), rel=1e-4, nan_ok=True)
    as_of_log = make_bands(run.soil_map.rate, run.soil_map.variance, of_log.soil_map.curve)
    for name, band in run.soil_map.bands._asdict().items():
        np.testing.assert_allclose(band, getattr(as_of_log, name), rtol=1e-3, err_msg=name)
    of_unknown = without(site, sensor_sensitivity=None, irrigation={"texture": "loam"})
    (tmp_path / "site.yaml").write_text(of_unknown.model_dump_json(exclude={"calibration"}))
    other = open_survey(**names, merge_radius_m=40.0)
    assert other.health(other.map.state)[0].message == "unknown sensor"
    for record in of_log.track:
        other.map.add(record)
    air = SurveyAir(38.7, -97.45, 968.0)
    guess = with_general_calibration(of_unknown, air, samples=of_log.soil_map.samples).calibration
    found = other.calibrated(other.map.state).calibration
    assert (found.n0_cps, found.n0_sd_cps) == pytest.approx((guess.n0_cps, guess.n0_sd_cps), rel=1e-9)
    assert other.health(other.map.state)[0].message.startswith("unknown sensor: the level is between nearly dry")
    assert other.dose_basis(other.map.state)["site"]["calibration"]["illustrative"]
    assert open_survey(names["field"]).map.curve_of is None, "without a site file anything may be counted"
    health = live.health(live.map.state)[0]
    assert "default ranges, not measured: intensity, biomass" in health.message
    assert health.values["pressure"].endswith("hPa +- 1.5, measured, ± assumed")
