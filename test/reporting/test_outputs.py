# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import csv
import dataclasses
import json
import re
from datetime import UTC, datetime

import numpy as np
import pytest
import rasterio

from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import make_soil_map
from soilmoist_ros.recording import read_records
from soilmoist_ros.reporting import mission_run, notes, write_mission, write_outputs
from soilmoist_ros.reporting.page.frame import percent
from soilmoist_ros.reporting.page.report import mission_part, render_report
from soilmoist_ros.reporting.page.wording import facts
from soilmoist_ros.reporting.run_summary import mission_summary
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation import MissionSettings, TimedForecast, simulate_mission

NAMES = ["summary.json", "map.tif", "samples.geojson", "report.html", "records.csv", "soilmoist.qgs"]


@pytest.mark.slow
def test_all_files_and_nothing_else(make_run, tmp_path):
    paths = write_outputs(tmp_path / "a" / "b", make_run(simulated=True), crs="EPSG:27700")
    assert [path.name for path in paths] == NAMES
    assert sorted(path.name for path in (tmp_path / "a" / "b").iterdir()) == sorted(NAMES)
    found = json.loads(paths[0].read_text(encoding="utf-8"))
    assert found["outputs"] == NAMES
    assert found["crs"] == "EPSG:27700"
    with rasterio.open(paths[1]) as raster:
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"
        assert raster.tags()["TIFFTAG_DATETIME"] == "2023:11:14 22:07:37"
        assert raster.tags()["SOILMOIST_SURVEY_START_UTC"] == "2023-11-14T22:07:37Z"
        assert raster.tags()["SOILMOIST_SURVEY_END_UTC"] == "2026-02-02T02:40:00Z"
    assert [record.stamp_s for record in read_records(paths[4])] == [record.stamp_s for record in make_run().track]


# Outputs of a mission -------------------------------------------------------------------------------------------

MISSION_FILES = "summary.json map.tif samples.geojson report.html records.csv soilmoist.qgs series.csv visits.csv"
MISSION_FILES = MISSION_FILES.split()
NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def mission():
    return simulate_mission(MissionSettings(hours=1.0, strategy="greedy", dwell="fmi:120", cell_m=2.0))


def with_own(mission, **changes):
    return dataclasses.replace(mission, properties=[dataclasses.replace(mission.properties[0], **changes)])


@pytest.mark.slow
def test_all_files(mission, tmp_path):
    paths = write_mission(tmp_path / "out", mission, created_utc=NOW)
    assert [path.name for path in paths] == MISSION_FILES
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(MISSION_FILES)
    about = json.loads(paths[0].read_text(encoding="utf-8"))
    assert about["simulated"] is True
    assert about["outputs"] == MISSION_FILES
    assert about["created_utc"] == "2026-06-01T12:00:00Z"
    assert about["mission"]["settings"]["strategy"] == "greedy"
    assert about["mission"]["final"]["mse"] == mission.series[-1].mse
    assert about["distance_m"] == mission.series[-1].distance_m
    assert about["truth"]["rmse_cps"] > 0
    with rasterio.open(paths[1]) as raster:
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"
    html = paths[3].read_text(encoding="utf-8")
    for anchor in ("course-error", "course-coverage", "mission"):
        assert f'id="{anchor}"' in html
    assert 'value="truth"' in html
    assert "SIMULATED DATA" in html
    assert "series.csv" in html
    assert "https://" not in html


@pytest.mark.slow
def test_zones_of_a_decision_have_one_certainty_with_the_other_zones(mission, tmp_path):
    settings = dataclasses.replace(mission.settings, target="decision", threshold="0.06,0.2")
    write_mission(tmp_path, dataclasses.replace(mission, settings=settings))
    about = json.loads((tmp_path / "summary.json").read_text())
    found, truly = about["decision"], about["truth"]["wrong_zone_share"]
    assert (found["thresholds"], found["unit"], found["outside"]) == ([0.06, 0.2], "m3/m3", [])
    assert [zone["limits"] for zone in found["zones"]] == ["below 6 %", "6 to 20 %", "above 20 %"]
    with rasterio.open(tmp_path / "map.tif") as raster:
        vwc = raster.read(1)
        dry = np.mean(vwc[np.isfinite(vwc) & (vwc != raster.nodata)] < 0.06)
    mapped, inside = mission_run(mission).soil_map.vwc, mission.soil_map.grid.mask
    true = mission.soil_map.curve.vwc(mission.truth_rate)
    mapped, true = (np.digitize(one[inside], [0.06, 0.2]) for one in (mapped, true))
    assert truly == np.mean(mapped != true), "of the true curve, not of the map's calibration"
    assert found["zones"][0]["share"] == pytest.approx(dry, abs=0.02)
    right = sum(zone["share"] * zone["expected_share"] for zone in found["zones"] if zone["share"])
    assert 1 - found["wrong_share"] == pytest.approx(right)
    (low, high), share = found["wrong_share_band"], percent(truly)
    assert (1 - right) / 3 < low < 1 - right < high < 2 * (1 - right)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    truth = f"{percent(high)} in four of five missions) of the field; by the simulated truth it is {share}"
    for text in ('id="decision"', 'value="decision"', 'value="right"', "Expected in the wrong zone", truth):
        assert text.replace("\xa0", " ") in html.replace("\xa0", " ")


@pytest.mark.slow
def test_several_robots_are_told_apart(mission, tmp_path):
    half = len(mission.visits) // 2
    visits = [dataclasses.replace(visit, robot=1 + (n >= half)) for n, visit in enumerate(mission.visits)]
    tracks = (np.array([(0.0, 0.0), (3.0, 4.0)]), np.array([(0.0, 0.0), (0.0, 6.0), (8.0, 6.0)]))
    settings = dataclasses.replace(mission.settings, robots=2)
    team = dataclasses.replace(mission, settings=settings, visits=visits, tracks=tracks)
    write_mission(tmp_path, team)
    about = json.loads((tmp_path / "summary.json").read_text())["mission"]
    assert about["robot_distances_m"] == [5.0, 14.0]
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "There were 2 robots, which drove 5" in html
    assert "robot 1 blue, robot 2 orange" in html
    assert '<th scope="col" class="n">Robot</th>' in html
    shapes = json.loads((tmp_path / "samples.geojson").read_text())["features"]
    (line,) = [shape["geometry"] for shape in shapes if shape["properties"]["kind"] == "track"]
    assert line["type"] == "MultiLineString"
    assert [len(track) for track in line["coordinates"]] == [2, 3]
    with (tmp_path / "visits.csv").open(newline="") as stream:
        assert [int(row["robot"]) for row in csv.DictReader(stream)] == [visit.robot for visit in visits]


@pytest.mark.slow
def test_columns_of_the_series_stay(mission, tmp_path):
    write_mission(tmp_path, mission)
    with (tmp_path / "series.csv").open(newline="") as stream:
        head, first, *_ = csv.reader(stream)
    assert head == ["time_s", "distance_m", "samples", "mse", "mse_10s", "vwc_rmse", "coverage95", "counting_s"]
    assert first == ["0", "0", "0", "", "", "", "", "0"]


@pytest.mark.slow
def test_a_mission_without_a_map(mission, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    write_mission(tmp_path, mission)
    short = dataclasses.replace(
        with_own(mission, soil_map=None), series=mission.series[:3], visits=[], ended="no time"
    )
    paths = write_mission(tmp_path, short)
    assert [path.name for path in paths] == [
        "summary.json",
        "report.html",
        "records.csv",
        "series.csv",
        "visits.csv",
    ]
    assert {path.name for path in tmp_path.iterdir()} == {*(path.name for path in paths), "notes.txt"}
    about = json.loads(paths[0].read_text(encoding="utf-8"))
    assert about["map"] is None
    assert about["mission"]["ended"] == "no time"
    with pytest.raises(ValueError, match="before its first map"):
        mission_run(short, NOW)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_mission(tmp_path / "file", short)
    assert about["failure"]["why"].endswith("before its first map: no stop was finished. Its end: no time.")


@pytest.mark.slow
def test_words(mission):
    part = mission_part(mission_run(mission, NOW))
    assert f"{len(mission.visits)} measurements in 1 h 00 min" in part.text
    assert "counts/10 s" in part.text
    assert part.text.endswith("The mission ended: the mission time is used up.")
    assert part.stops == len(part.visits)
    logged = dataclasses.replace(mission, log=["       0 s  start by <Ada>: started"])
    assert mission_part(mission_run(logged, NOW)).log == logged.log
    assert "0 s  start by &lt;Ada&gt;: started" in render_report(mission_run(logged, NOW))
    travelled = [fact for fact in facts(mission_run(mission, NOW)) if fact.meaning == "travelled"]
    assert travelled[0].value == f"{mission.series[-1].distance_m:.0f}"
    many = dataclasses.replace(mission, visits=mission.visits * 30)
    part = mission_part(mission_run(many, NOW))
    assert (part.stops, len(part.visits)) == (len(many.visits), 100)


@pytest.mark.parametrize("n0_cps", [6.3, 12.0, 30.0])
def test_a_simulation_gives_no_advice_about_its_sensor(mission, n0_cps):
    """Missions with wrong moisture in part, in most, and in all of the field."""
    run = dataclasses.replace(mission_run(mission, NOW), soil_map=with_n0(mission.soil_map, n0_cps))
    advice = re.compile("N0, the bulk|check N0|tubes", re.IGNORECASE)
    assert not advice.search(" ".join(map(str, notes(run))))
    real = dataclasses.replace(run, simulated=False)
    assert advice.search(" ".join(map(str, notes(real))))


def with_n0(soil_map, n0_cps):
    curve = CalibrationCurve(n0_cps, 1.4)
    return make_soil_map(soil_map.samples, soil_map.grid, soil_map.variogram, curve)


def forecasts(*times_s, planned_s=3600.0):
    def made(time_s):
        sd, left_s = 0.1 * (1 + time_s / 600) ** -0.5, planned_s - time_s
        if left_s <= 0:
            return Forecast(sd, (), (), (), sd, 4.0)
        ahead = (left_s / 2, left_s)
        return Forecast(sd, ahead, (0.9 * sd, 0.8 * sd), (1.1, 1.2), 0.95 * sd, 4.0, is_guess=time_s == 0)

    return tuple(TimedForecast(time_s, made(time_s)) for time_s in times_s)


@pytest.mark.slow
def test_the_forecast_is_compared_with_what_was_reached(mission):
    known = dataclasses.replace(mission, forecasts=forecasts(0.0, 500.0, 1000.0, 1900.0, 2800.0, 3600.0))
    part = mission_part(mission_run(known, NOW))
    assert "±3.8 % of the rate reached; forecast at 25 % of the time: ±" in part.text
    content = mission_summary(known)
    assert content["efficiency"] is None  # keys of the summary stay
    assert {"turn_s_per_rad", "overhead_counted"} <= content["travel"][0].keys()
    about = content["forecast"]
    assert [one["time_s"] for one in about["made"]] == [0.0, 1000.0, 1900.0, 2800.0]
    assert {one["end_s"] for one in about["made"]} == {3600.0}
    assert about["reached"]["time_s"] == 3600.0
    assert about["unit"] == "share of the mean rate"
