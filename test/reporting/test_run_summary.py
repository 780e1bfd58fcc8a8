# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest

from soilmoist_ros.reporting.run_summary import summary
from soilmoist_ros.reporting.text_files import write_json


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
