# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import matplotlib
import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.reporting import RATE, UNCERTAIN
from soilmoist_ros.reporting.certainty import CERTAIN, calibration_state, certainty, class_probability
from soilmoist_ros.reporting.colours import DARKEST, DIFFERENCE, PALEST, WATER, colour_ramp, hex_ramp
from soilmoist_ros.reporting.outputs import MISSION_NAMES, NAMES, mission_run, write_mission
from soilmoist_ros.reporting.run_summary import summary
from soilmoist_ros.reporting.text_files import write_json
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation import MissionSettings, simulate_mission


def refuse(constant):
    raise AssertionError(f"{constant} is not JSON")


def test_numbers(make_run, the_map):
    found = summary(make_run(), outputs=["map.tif"])
    assert found["version"] == "0.1.0"
    assert found["created_utc"] == "2026-05-03T12:00:00Z"
    assert (found["survey_start_utc"], found["survey_end_utc"]) == ("2023-11-14T22:07:37Z", "2026-02-02T02:40:00Z")
    assert found["survey_duration_s"] == pytest.approx(7e7 + 342, abs=2)
    assert found["n_records"] == 13
    assert found["n_placed_records"] == 12
    assert found["n_lost"] == {"no position": 3}
    assert found["n_kept_with_reservation"] == {"no humidity": 4}
    assert found["n_samples"] == 12
    assert found["area_m2"] == pytest.approx(1106.5)
    assert found["crs"] == "EPSG:32630"
    assert found["variogram"]["range_m"] == 12.0
    assert (found["variogram"]["anisotropy"], found["variogram"]["angle_deg"]) == (1.0, 0.0)
    assert found["map"]["vwc"]["mean"] == pytest.approx(np.nanmean(the_map.vwc))
    assert found["map"]["rate_sd_cps"]["p95"] == pytest.approx(np.nanpercentile(the_map.rate_sd, 95))
    assert found["map"]["undefined_vwc_share"] == 0
    assert found["calibration"]["n0_sd_cps"] == 0.1
    assert [zone["name"] for zone in found["irrigation"]["zones"]] == [
        "driest third",
        "middle third",
        "wettest third",
    ]
    assert sum(zone["area_m2"] for zone in found["irrigation"]["zones"]) == pytest.approx(1106.5)
    assert found["irrigation"]["zone_limits_vwc"] is None
    assert found["outputs"] == ["map.tif"]
    assert dict(zip(found["warning_codes"], found["warnings"], strict=True))["not_mapped"] == "salt is not mapped"
    assert not found["simulated"]


@pytest.mark.parametrize("case", ["the_map", "uncalibrated", "steep"])
def test_strict_json(make_run, tmp_path, request, case):
    run = make_run(soil_map=request.getfixturevalue(case), truth_rate=request.getfixturevalue(case).rate)
    text = write_json(tmp_path / "summary.json", summary(run)).read_text(encoding="utf-8")
    found = json.loads(text, parse_constant=refuse)
    assert found["settings"]["bad"] is None
    assert found["truth"]["rmse_cps"] == 0
    assert text.endswith("}\n")


def test_keys_are_the_same_for_all_runs(make_run, uncalibrated, map_of):
    usual = summary(make_run())
    for soil in (uncalibrated, map_of(n=1)):
        other = summary(make_run(soil_map=soil, track=(), losses=(), corrections=()))
        assert other.keys() == usual.keys()
        assert other["map"].keys() == usual["map"].keys()


# Colours -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [WATER, RATE, UNCERTAIN, DIFFERENCE, f"{DIFFERENCE}_r"])
@pytest.mark.parametrize("count", [2, 5, 256])
def test_colours_are_those_of_matplotlib(name, count):
    wanted = 255 * matplotlib.colormaps[name].resampled(4096)(np.linspace(PALEST, DARKEST, count))[:, :3]
    assert abs(colour_ramp(name, count) - wanted).max() < 0.7
    assert hex_ramp(name, count)[-1] == "#{:02x}{:02x}{:02x}".format(*colour_ramp(name, count)[-1])


# Certainty -----------------------------------------------------------------------------------------------------

CURVE = CalibrationCurve(7.0, 1.4, n0_sd_cps=0.3)


@given(
    edges=st.lists(st.floats(0.05, 0.5), min_size=0, max_size=4, unique=True).map(sorted),
    rate=st.floats(2.7, 6.0),
    sd=st.floats(0.01, 1.0),
    relative=st.booleans(),
)
@settings(deadline=None)
def test_the_classes_share_all_probability_and_a_map_of_the_rate_agrees(edges, rate, sd, relative):
    rates, sds = np.array([rate]), np.array([sd])
    shares = [class_probability(rates, sds, n, edges, CURVE, relative)[0] for n in range(len(edges) + 1)]
    assert sum(shares) == pytest.approx(1.0, abs=1e-9)
    if relative:  # classes of the rate count the other way
        limits = CURVE.rate_cps(np.array(edges))[::-1]
        turned = [class_probability(rates, sds, n, limits, None, True)[0] for n in range(len(edges) + 1)]
        assert turned[::-1] == pytest.approx(shares, abs=1e-9)


def test_an_error_of_the_calibration_does_not_blur_places_of_one_map():
    rate, sd = CURVE.rate_cps(np.array([0.18])), np.array([0.02])
    alone, together = (class_probability(rate, sd, 0, [0.2], CURVE, relative)[0] for relative in (True, False))
    assert alone > 0.999
    assert 0.5 < together < CERTAIN, "N0 +- 4 % is more than the distance to the limit"
    assert class_probability(np.array([np.nan]), sd, 0, [0.2], CURVE, True)[0] == 0.0


def test_of_certain_places_and_zones_at_most_a_fifth_is_wrong():
    """Truths drawn from what the map states: the promise of 'certain' holds for places, and for the whole zone."""
    rng = np.random.default_rng(1)
    rate, sd = rng.normal(4.0, 0.4, 40_000), rng.uniform(0.05, 0.8, 40_000)
    number = (rate >= 4.0).astype(float)
    probability = class_probability(rate, sd, number, [4.0], None, True)
    right = (rng.normal(rate, sd) >= 4.0) == number
    sure = probability >= CERTAIN
    assert 0.2 < sure.mean() < 0.9
    assert right[sure].mean() > CERTAIN + 0.1
    found = certainty(probability)
    assert found.sure == sure.mean()
    assert right.mean() == pytest.approx(found.expected, abs=0.01)
    assert found.certain == (found.expected >= CERTAIN)
    assert not certainty(np.empty(0)).certain


def test_the_origin_of_a_calibration_has_one_word():
    states = [
        calibration_state(*given) for given in ((False, False, True), (True, False, True), (True, True, True))
    ]
    assert [*states, calibration_state(True, True, False)] == ["none", "illustrative", "simulated", "own"]


# Properties ----------------------------------------------------------------------------------------------------

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
OTHER = ("map_synthetic_low.tif", "samples_synthetic_low.geojson", "records_synthetic_low.csv")


@pytest.fixture(scope="module")
def mission():
    return simulate_mission(
        MissionSettings(hours=0.3, cell_m=4.0, dwell="fmi:60", preset="paper", properties=("synthetic-low",))
    )


@pytest.mark.slow
def test_each_property_has_files_by_its_name(mission, tmp_path):
    written = write_mission(tmp_path, mission, created_utc=NOW)
    assert tuple(path.name for path in written) == NAMES + MISSION_NAMES + OTHER
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    other = mission_run(mission, NOW).others[0]
    with rasterio.open(tmp_path / OTHER[0]) as raster, rasterio.open(tmp_path / "map.tif") as first:
        assert (raster.descriptions, first.descriptions[0]) == (("rate", "rate_sd"), "vwc")
        assert raster.tags()["SOILMOIST_FIELD"] == other.field_name
        assert raster.tags()["SOILMOIST_PROPERTY"] == "synthetic_low"
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"
        rate, of_first = (file.read(file.descriptions.index("rate") + 1, masked=True) for file in (raster, first))
    assert rate.mean() == pytest.approx(np.nanmean(other.soil_map.rate), rel=0.02)
    assert not np.array_equal(rate, of_first)
    features = json.loads((tmp_path / OTHER[1]).read_text())["features"]
    counts = [one["properties"]["raw_counts"] for one in features if one["properties"]["kind"] == "sample"]
    assert counts == other.soil_map.samples.counts.tolist()
    about = json.loads((tmp_path / "summary.json").read_text())
    assert set(OTHER) < set(about["outputs"])
    assert about["mission"]["also"]["name"] == "synthetic_low"
    html = (tmp_path / "report.html").read_text()
    assert "<code>map_synthetic_low.tif</code>" in html
    assert '<input type="radio" name="layer" value="rate_sd1">' in html
    without = replace(mission, properties=[replace(one, soil_map=None) for one in mission.properties])
    write_mission(tmp_path, without, created_utc=NOW)
    left = {"summary.json", "report.html", "records.csv", *MISSION_NAMES}
    assert {path.name for path in tmp_path.iterdir()} == left, "nothing of the map stays"
