# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several properties in the outputs: files of each property, and layers of each in the report."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
import rasterio

from soilmoist_ros.reporting.outputs import MISSION_NAMES, NAMES, mission_run, write_mission
from soilmoist_ros.simulation import MissionSettings, simulate_mission

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
