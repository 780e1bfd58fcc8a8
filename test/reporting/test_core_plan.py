# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places for soil cores on a map: the design, N0 from them, and the round trip of the sheet."""

import csv
import json
import math
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros import sensing
from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.pipeline import site_facts
from soilmoist_ros.reporting import mission_run, open_run, open_source, plan_cores, write_mission
from soilmoist_ros.reporting.core_plan import (
    N0_SD,
    SHEET_COLUMNS,
    LevelModel,
    choose_places,
    core_layers_cm,
    fit_level,
)
from soilmoist_ros.simulation import MissionSettings, simulate_mission

UNIT = sensing.CalibrationCurve(1.0, 1.4)


def model_of(curve, vwc, covariance):
    rate = curve.rate_cps(vwc)
    return LevelModel(covariance, (sensing.PROFILE_SD / (curve.slope(rate) * rate)) ** 2, N0_SD)


# -- Design ----------------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(1, 6), st.floats(0, 30))
def test_each_place_makes_the_level_surer_and_places_keep_their_distance(seed, count, spacing_m):
    rng = np.random.default_rng(seed)
    xy, vwc = rng.uniform(0, 100, (30, 2)), rng.uniform(0.05, 0.45, 30)
    root = 0.02 * rng.standard_normal((30, 30)) / 5
    chosen, sd = choose_places(model_of(UNIT, vwc, root @ root.T + 1e-4 * np.eye(30)), xy, vwc, count, spacing_m)
    assert 1 <= len(chosen) <= count
    assert all(np.diff([N0_SD, *sd]) < 0)
    distance = np.hypot(*np.moveaxis(xy[chosen][:, None] - xy[chosen], -1, 0)) + 1e9 * np.eye(len(chosen))
    assert distance.min() >= spacing_m
    if 1 < len(chosen) == count and spacing_m == 0:
        assert vwc[chosen].min() <= np.quantile(vwc, 1 / 3)
        assert vwc[chosen].max() >= np.quantile(vwc, 2 / 3)


def test_the_stated_error_is_that_of_the_regression():
    rng = np.random.default_rng(3)
    vwc, xy = np.linspace(0.1, 0.4, 12), rng.uniform(0, 100, (12, 2))
    root = 0.02 * rng.standard_normal((12, 12)) / 3
    covariance = root @ root.T
    model = model_of(UNIT, vwc, covariance)
    chosen, sd = choose_places(model, xy, vwc, 4, 0.0)
    of_core = covariance[np.ix_(chosen, chosen)] + np.diag(model.core_variance[chosen])
    assert sd[-1] == pytest.approx((np.linalg.inv(of_core).sum() + N0_SD**-2) ** -0.5)


def test_layers_reach_as_deep_as_the_probe_sees():
    wet, dry = core_layers_cm(0.4, UNIT), core_layers_cm(0.03, UNIT)
    assert wet == ((0, 5), (5, 10), (10, 20))
    assert dry[-1] == (40, 50)


def test_n0_from_exact_cores_is_exact_and_from_many_has_no_bias():
    vwc, curve = np.array([0.08, 0.2, 0.35]), sensing.CalibrationCurve(2.5, 1.4)
    level, *_ = fit_level(vwc, curve.rate_cps(vwc), np.zeros((3, 3)), UNIT)
    assert math.exp(level) == pytest.approx(2.5)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(300):
        truth = rng.uniform(0.08, 0.3, 6)
        level, variance, weights, excess = fit_level(
            truth + sensing.PROFILE_SD * rng.standard_normal(6), curve.rate_cps(truth), np.zeros((6, 6)), UNIT
        )
        found.append((level - math.log(2.5), math.sqrt(variance), excess))
    error, sd, excess = np.array(found).T
    assert abs(error.mean()) < 0.2 * sd.mean()
    assert error.std() == pytest.approx(sd.mean(), rel=0.15)
    assert np.sqrt(np.mean(excess**2)) == pytest.approx(1, abs=0.1)
    assert weights.sum() == pytest.approx(1)


def compare_designs(seed, count, cells=12, side_m=120.0):
    """Error of log N0 and the stated one by planned and random places of a field; the promised one."""
    rng = np.random.default_rng(seed)
    true, prior = (sensing.CalibrationCurve(n0, 1.4) for n0 in (2 * math.exp(N0_SD * rng.standard_normal()), 2.0))
    axis = (np.arange(cells) + 0.5) * side_m / cells
    xy = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    range_m = rng.uniform(20, 60)
    lag = math.sqrt(3) * np.hypot(*np.moveaxis(xy[:, None] - xy, -1, 0)) / range_m
    pattern = np.linalg.cholesky((1 + lag) * np.exp(-lag) + 1e-6 * np.eye(len(xy))) @ rng.standard_normal(len(xy))
    vwc = np.clip(rng.uniform(0.12, 0.32) + 0.06 * pattern, 0.03, 0.5)
    rate = true.rate_cps(vwc)
    at = rng.choice(len(xy), 40, replace=False)
    kriging = PoissonKriging(Variogram("matern32", 0.0, range_m, max(float(rate.var()), 1e-5)))
    kriging.fit(xy[at], rng.poisson(rate[at] * 300.0), np.full(40, 300.0))
    mapped, covariance = kriging.rate_and_covariance(xy)
    covariance /= np.multiply.outer(mapped, mapped)
    expected = np.clip(np.nan_to_num(prior.vwc(mapped), nan=0.47), 0.01, 0.47)
    spacing = max(10.0, range_m)
    planned, sd = [], []
    while len(planned) < count:
        planned, sd = choose_places(model_of(prior, expected, covariance), xy, expected, count, spacing)
        spacing *= 0.8
    cores = vwc + sensing.PROFILE_SD * rng.standard_normal(len(xy))
    errors = []
    for places in (planned, rng.choice(len(xy), count, replace=False)):
        found = np.array(places)
        level, variance, *_ = fit_level(cores[found], mapped[found], covariance[np.ix_(found, found)], UNIT)
        errors += [level - math.log(true.n0_cps), math.sqrt(variance)]
    return [*errors, (sd[-1] ** -2 - N0_SD**-2) ** -0.5]


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 6])
def test_planned_places_give_a_surer_level_than_random_ones(count):
    rms = np.sqrt(np.mean(np.square([compare_designs(seed, count) for seed in range(200)]), axis=0))
    planned, planned_sd, at_random, random_sd, promised = rms
    assert planned < 0.95 * at_random
    assert planned_sd < 0.95 * random_sd
    assert promised == pytest.approx(planned, rel=0.2)  # the plan does not promise too much


# -- Files of a run --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("mission")
    result = simulate_mission(MissionSettings(hours=0.5, cell_m=4.0, dwell="fmi:60", preset="paper"))
    made = mission_run(result)
    unknown = replace(made.soil_map, curve=replace(made.soil_map.curve, n0_sd_cps=0.0))
    known = replace(made.calibration, n0_sd_cps=None)
    write_mission(found, result, run=replace(made, soil_map=unknown, calibration=known))
    return found


def run(*arguments):
    result = CliRunner().invoke(main, ["calibrate", *map(str, arguments), "--json"])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return json.loads(result.stdout)


@pytest.mark.slow
def test_the_filled_sheet_goes_back_into_the_command(folder, tmp_path):
    answer = run("--plan", folder, "--cores", 4, "--out", tmp_path)
    places = answer["places"]
    assert len(places) == 4
    sheet = tmp_path / "cores.csv"
    with sheet.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == SHEET_COLUMNS
    with pytest.raises(InputError, match="the core has no moisture"):
        sensing.read_soil_cores(sheet, 1.1)
    assert "may be filled in" in run("--plan", folder, "--out", tmp_path)["errors"][0]["message"]
    expected = {f"core place {place['number']}": place["vwc"] for place in places}
    for row in rows:
        row |= {"gravimetric_water": f"{expected[row['profile']] / 1.1:.5f}", "bulk_density_gcm3": "1.1"}
    with sheet.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, SHEET_COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    assert sensing.read_soil_cores(sheet).notes == ()
    site = tmp_path / "site.yaml"
    site.write_text("# kept\nsoil: {bulk_density_gcm3: 1.1}\n")
    found = run(sheet, "--site", site, "--run", folder, "--cores-only")
    n0_cps = open_run(folder).summary["calibration"]["n0_cps"]
    assert not found["errors"]
    assert found["n0_cps"] == pytest.approx(n0_cps, rel=0.01)
    assert sensing.load_site(site).calibration.n0_cps == pytest.approx(n0_cps, rel=0.01)
    assert site.read_text().startswith("# kept")
    run(sheet, "--site", site, "--run", folder, "--cores-only")  # now with the density of the cores in the file
    of_mass = sensing.load_site(site).calibration
    assert of_mass.n0_per_bound_water > 0 == of_mass.n0_per_density
    of_plan = (places[-1]["level_sd"] ** -2 - N0_SD**-2) ** -0.5
    assert found["n0_sd_cps"] / n0_cps == pytest.approx(of_plan, rel=0.3)
    twice = run(sheet, "--site", site, "--run", folder, "--counts", 5, "--exposure", 5)
    assert "leave out --log" in twice["errors"][0]["message"]
    rows[0]["latitude_deg"] = "53.4"
    sheet.write_text("\n".join([",".join(SHEET_COLUMNS), *(",".join(row.values()) for row in rows)]))
    assert "outside the map" in run(sheet, "--site", site, "--run", folder)["errors"][0]["message"]


@pytest.mark.slow
def test_waypoints_are_read_by_another_program(folder, tmp_path):
    pytest.importorskip("pyogrio")
    import pyogrio.raw
    from shapely import from_wkb, get_coordinates

    places = run("--plan", folder, "--cores", 3, "--out", tmp_path)["places"]
    root = ElementTree.parse(tmp_path / "cores.gpx").getroot()
    assert root.tag == "{http://www.topografix.com/GPX/1/1}gpx"
    about, _, wkb, columns = pyogrio.raw.read(tmp_path / "cores.gpx", layer="waypoints")
    names = dict(zip(about["fields"], columns, strict=True))["name"]
    assert list(names) == ["core place 1", "core place 2", "core place 3"]
    wanted = [(place["longitude_deg"], place["latitude_deg"]) for place in places]
    np.testing.assert_allclose(get_coordinates(from_wkb(wkb)), wanted, atol=1e-7)


@pytest.mark.slow
def test_places_lie_in_the_field_and_far_from_no_go_areas(folder):
    from shapely import Point, box

    source = open_source(open_run(folder))
    west, south, east, north = source.boundary.bounds
    barred = box(west, south, (west + east) / 2, north)
    plan = plan_cores(replace(source, no_go=[barred]), 3)
    allowed = source.boundary.difference(barred)
    for place in plan.places:
        point = Point(place.xy_m)
        assert allowed.contains(point)
        assert allowed.exterior.distance(point) >= plan.edge_m - 1e-6
    crowded = plan_cores(source, 30)
    assert any("too small" in note for note in crowded.notes)
    with pytest.raises(InputError, match="no calibration"):
        plan_cores(replace(source, properties=[replace(source.properties[0], curve=None)]), 3)


@pytest.mark.slow
def test_a_map_of_impossible_moisture_is_not_planned_with_and_no_error_exceeds_the_pores(folder):
    source = open_source(open_run(folder))
    one = source.properties[0]
    mean = float(np.nanmean(one.bands["rate"]))

    def planned(n0_cps, sd_cps):
        curve = replace(one.curve, n0_cps=n0_cps, n0_sd_cps=sd_cps)
        return plan_cores(replace(source, properties=[replace(one, curve=curve)]), 2)

    for n0_cps in (4 * mean, mean / 2):  # too wet, and too dry
        with pytest.raises(InputError, match=r"no possible moisture on \d+ % of its area"):
            planned(n0_cps, 0.1)
    plan = planned(one.curve.n0_cps, one.curve.n0_cps)
    pores = 1 - one.curve.bulk_density_gcm3 / 2.65
    assert max(plan.prior_vwc_sd, *(place.level_vwc_sd for place in plan.places)) <= pores / 2


def sheet_of(places, dates=("",), at=None):
    rows = ["profile,latitude_deg,longitude_deg,date,top_cm,bottom_cm,vwc"]
    for number, place in enumerate(places):
        one = place if at is None else at
        date = dates[number % len(dates)]
        rows.append(f"p{number},{one['latitude_deg']},{one['longitude_deg']},{date},0,20,{one['vwc']:.4f}")
    return "\n".join(rows) + "\n"


@pytest.fixture
def general_run(folder, tmp_path):
    """The run as of a survey of 2 May 2026 with the general calibration; a sheet, and the site file without N0."""
    copied = shutil.copytree(folder, tmp_path / "run")
    summary = json.loads((copied / "summary.json").read_text())
    noon = datetime(2026, 5, 2, 12, tzinfo=UTC).timestamp()
    summary |= {"simulated": False, "first_stamp_s": noon, "last_stamp_s": noon + 7200}
    pressure = {"name": "air pressure", "parameters": {"beta [1/hPa]": 0.0077, "P0 [hPa]": 1013.25}}
    summary["corrections"] = [{**pressure, "mean_factor": math.exp(0.0077 * (990 - 1013.25))}]
    (copied / "summary.json").write_text(json.dumps(summary))
    site = tmp_path / "site.yaml"
    site.write_text("sensor_sensitivity: 2.0\nsoil: {bulk_density_gcm3: 1.1}\n")
    return copied, tmp_path / "cores.csv", site, summary


@pytest.mark.slow
def test_cores_on_a_run_are_combined_with_the_general_calibration_at_its_place(general_run):
    folder, cores, site, summary = general_run
    one = plan_cores(open_source(open_run(folder)), 3)
    cores.write_text(sheet_of([place._asdict() for place in one.places]))
    site.write_text(site.read_text().replace("2.0", "1.0"))
    other = run(cores, "--site", site, "--run", folder, "--dry-run")
    assert (other["errors"], other["method"]) == ([], "combined")
    place = sensing.SurveyAir(*summary["datum"].values(), 990.0)
    n0_cps, _ = sensing.general_calibration(sensing.load_site(site), place)
    rows = cores.read_text().splitlines()
    cores.write_text("\n".join([f"{rows[0]},bulk_density_gcm3", *(f"{row},1.5" for row in rows[1:])]) + "\n")
    site.write_text("sensor_sensitivity: 1.0\nsoil:\n  texture: loam  # by hand\n")
    run(cores, "--site", site, "--run", folder)
    loaded = sensing.load_site(site)
    found = run(cores, "--site", site, "--run", folder)
    again = {part.name: part for part in sensing.load_site(site).calibration.parts}
    assert again["bulk density"].source == "measured, ± assumed", "also where the file has it already"
    assert (loaded.calibration.date, loaded.calibration.reference_hpa) == ("2026-05-02", 1013.25)
    assert any("taken as the day of the survey (2026-05-02)" in text for text in found["warnings"])
    assert not any("corrected to" in text for text in found["warnings"])
    soil, parts = loaded.soil, {part.name: part for part in loaded.calibration.parts}
    assert (parts["bulk density"].value, parts["bulk density"].source) == (1.5, "measured, ± assumed")
    assert (parts["cores"].source, parts["sensitivity"].source) == ("measured, ± assumed", "given, ± assumed")
    shown = site_facts(loaded.model_copy(update={"soil": soil.model_copy(update={"bulk_density_gcm3": 1.3})}))
    of_soil = [part for part in shown["calibration"].parts if part.name == "bulk density"]
    assert [(part.value, part.source) for part in of_soil] == [(1.3, "given")], "that of another soil is of no use"
    assert (soil.bulk_density_gcm3, soil.texture) == (1.5, "loam"), "weighed, instead of that of the texture"
    assert soil.bulk_density_sd_gcm3 == pytest.approx(0.12 / 3**0.5, abs=1e-3)
    assert "# by hand" in site.read_text()
    weight = other["weight_of_cores"]
    expected = weight * math.log(other["n0_of_cores_cps"]) + (1 - weight) * math.log(n0_cps.n0_cps)
    assert math.log(other["n0_cps"]) == pytest.approx(expected, abs=0.002)


@pytest.mark.slow
def test_cores_of_another_time_or_of_one_place_are_told(general_run):
    folder, cores, site, _ = general_run
    places = [one._asdict() for one in plan_cores(open_source(open_run(folder)), 4).places]

    def calibrate(table):
        cores.write_text(table)
        return run(cores, "--site", site, "--run", folder, "--cores-only", "--dry-run")

    assert "give the run of that day" in calibrate(sheet_of(places, ["2026-06-02"]))["errors"][0]["remedy"]
    assert any("after the survey" in text for text in calibrate(sheet_of(places, ["2026-05-03"]))["warnings"])
    apart = calibrate(sheet_of(places, ["2026-05-02"]))
    assert not apart["errors"]
    together = calibrate(sheet_of(places, at=places[0]))
    assert any("4 profiles have the same coordinates" in text for text in together["warnings"])
    alone = calibrate(sheet_of(places[:1]))
    assert together["n0_sd_cps"] == pytest.approx(alone["n0_sd_cps"])
    assert together["n0_sd_cps"] > 1.1 * apart["n0_sd_cps"]
