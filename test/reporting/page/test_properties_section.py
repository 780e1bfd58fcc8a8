"""Several properties in the outputs: files of each property, and all side by side in the report."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
import rasterio

from soilmoist_ros.reporting.mission_report import mission_run, write_mission
from soilmoist_ros.reporting.outputs import MISSION_NAMES, NAMES
from soilmoist_ros.reporting.page.properties_section import property_sections, side_by_side, small_multiples
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
OTHER = ("map_synthetic_low.tif", "samples_synthetic_low.geojson", "records_synthetic_low.csv")


@pytest.fixture(scope="module")
def mission():
    return simulate_mission(
        MissionSettings(hours=0.3, cell_m=4.0, dwell="fmi:60", preset="paper", properties=("synthetic-low",))
    )


def titles(figure):
    return [title for axes in figure.axes if (title := axes.get_title(loc="left"))]


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
    assert 'id="synthetic_low-rate-sd"' in html


def test_files_of_an_older_mission_do_not_stay_when_a_new_one_has_no_map(mission, tmp_path):
    for name in (*NAMES, *OTHER):
        (tmp_path / name).touch()
    write_mission(
        tmp_path,
        replace(mission, properties=[replace(one, soil_map=None) for one in mission.properties]),
        created_utc=NOW,
    )
    assert {path.name for path in tmp_path.iterdir()} == {"summary.json", *MISSION_NAMES}


@pytest.mark.slow
def test_all_are_shown_in_rows_of_small_maps(mission):
    run = mission_run(mission, NOW)
    (other,) = run.others
    known = ["True rate", "Map of the rate", "Error (map minus truth)", "Truth in the 95 % interval"]
    assert titles(small_multiples([run, other, other])) == 3 * known
    unknown = replace(other, truth_rate=None)
    assert titles(small_multiples([run, unknown])) == [*known, "Map of the rate", "Standard deviation"]
    covered = np.abs(other.soil_map.rate - other.truth_rate) <= 1.96 * other.soil_map.rate_sd
    panel = next(axes for axes in small_multiples([other]).axes if axes.get_title(loc="left") == known[3])
    shown = panel.images[0].get_array()
    inside = other.soil_map.grid.mask
    np.testing.assert_array_equal(shown[inside] == 0, covered[inside])
    # A row shows its own property.
    maps = [
        axes.images[0].get_array() for axes in small_multiples([run, other]).axes if axes.get_title(loc="left")
    ]
    np.testing.assert_array_equal(maps[0][inside], run.truth_rate[inside])
    np.testing.assert_array_equal(maps[5][inside], other.soil_map.rate[inside])


@pytest.mark.slow
def test_one_property_alone_has_no_comparison(mission):
    run = mission_run(mission, NOW)
    assert side_by_side(run) is not None
    assert side_by_side(replace(run, others=())) is None
    assert property_sections(replace(run, others=())) == []


@pytest.mark.slow
def test_with_three_properties_each_has_its_sections(mission):
    run = mission_run(mission, NOW)
    (other,) = run.others
    three = replace(run, others=[other, replace(other, name="salt", label="Salt", truth_rate=None)])
    keys = [section.key for section in property_sections(three)]
    assert keys == [f"{name}-{band}" for name in ("synthetic_low", "salt") for band in ("rate", "rate-sd")]
