"""A second property in the outputs: files of its own, and both side by side in the report."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
import rasterio

from soilmoist_ros.reporting.mission_report import mission_run, write_mission
from soilmoist_ros.reporting.outputs import MISSION_NAMES, NAMES, second_names
from soilmoist_ros.reporting.page.properties_section import (
    second_run,
    second_sections,
    side_by_side,
    small_multiples,
)
from soilmoist_ros.simulation.mission.mission_run import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
SECOND = ("map_synthetic_low.tif", "samples_synthetic_low.geojson")


@pytest.fixture(scope="module")
def mission():
    return simulate_mission(MissionSettings(hours=0.3, cell_m=4.0, dwell="fmi:60", also="synthetic-low"))


def titles(figure):
    return [title for axes in figure.axes if (title := axes.get_title(loc="left"))]


@pytest.mark.slow
def test_it_has_the_files_of_the_first_by_its_name(mission, tmp_path):
    written = write_mission(tmp_path, mission, created_utc=NOW)
    assert tuple(path.name for path in written) == NAMES + MISSION_NAMES + SECOND
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    also = mission.also.soil_map
    with rasterio.open(tmp_path / SECOND[0]) as raster, rasterio.open(tmp_path / "map.tif") as first:
        assert raster.descriptions == first.descriptions
        assert raster.tags()["SOILMOIST_FIELD"] == mission.also.field_title
        assert raster.tags()["SOILMOIST_SIMULATED"] == "yes"
        assert raster.read(1, masked=True).mean() == pytest.approx(np.nanmean(also.rate), rel=0.02)
        assert not np.array_equal(raster.read(1), first.read(1))
    features = json.loads((tmp_path / SECOND[1]).read_text())["features"]
    counts = [one["properties"]["raw_counts"] for one in features if one["properties"]["kind"] == "sample"]
    assert counts == also.samples.counts.tolist()
    about = json.loads((tmp_path / "summary.json").read_text())
    assert set(SECOND) < set(about["outputs"])
    assert about["mission"]["also"]["name"] == "synthetic_low"
    assert "<code>map_synthetic_low.tif</code>" in (tmp_path / "report.html").read_text()


def test_an_older_mission_s_files_do_not_stay_beside_one_without_a_map(mission, tmp_path):
    for name in (*NAMES, *SECOND):
        (tmp_path / name).touch()
    write_mission(tmp_path, replace(mission, soil_map=None), created_utc=NOW)
    assert {path.name for path in tmp_path.iterdir()} == {"summary.json", *MISSION_NAMES}


@pytest.mark.slow
def test_both_are_shown_in_rows_of_small_maps(mission):
    run = mission_run(mission, NOW)
    second = second_run(run)
    known = ["True rate", "Map of the rate", "Map less truth", "Truth in the 95 % interval"]
    assert titles(small_multiples([run, second])) == 2 * known
    unknown = replace(second, truth_rate=None)
    assert titles(small_multiples([run, unknown])) == [*known, "Map of the rate", "Standard deviation"]
    covered = np.abs(second.soil_map.rate - second.truth_rate) <= 1.96 * second.soil_map.rate_sd
    panel = next(axes for axes in small_multiples([second]).axes if axes.get_title(loc="left") == known[3])
    shown = panel.images[0].get_array()
    inside = second.soil_map.grid.mask
    np.testing.assert_array_equal(shown[inside] == 0, covered[inside])
    # A row shows its own property.
    maps = [
        axes.images[0].get_array() for axes in small_multiples([run, second]).axes if axes.get_title(loc="left")
    ]
    np.testing.assert_array_equal(maps[0][inside], run.truth_rate[inside])
    np.testing.assert_array_equal(maps[5][inside], second.soil_map.rate[inside])


def test_without_a_second_map_there_is_nothing(mission):
    run = mission_run(mission, NOW)
    for also in (None, replace(mission.also, soil_map=None)):
        alone = replace(run, mission=replace(mission, also=also))
        assert (second_run(alone), side_by_side(alone)) == (None, None)
    assert second_names(replace(mission, also=None)) == second_names(None) == ()


@pytest.mark.slow
def test_side_by_side_they_are_shown_where_a_truth_is_known(mission):
    run = mission_run(mission, NOW)
    nothing = np.full_like(run.truth_rate, np.nan)
    unknown = replace(run, mission=replace(mission, also=replace(mission.also, truth_rate=nothing)))
    assert side_by_side(run) is not None
    assert side_by_side(unknown) is not None
    assert side_by_side(replace(unknown, truth_rate=None)) is None
    assert [section.key for section in second_sections(replace(unknown, truth_rate=None))] == [
        "also-rate",
        "also-rate-sd",
    ]
