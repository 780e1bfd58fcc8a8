# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import base64
import dataclasses
import io
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread

from soilmoist_ros.reporting.outputs import mission_run
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.reporting.page.viewer import (
    MAX_CELLS,
    colour_limits,
    draw,
    pack,
    pack_bits,
    thinning,
    unpack,
    unpack_bits,
    viewer_data,
)
from soilmoist_ros.simulation import MissionSettings, simulate_mission


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_a_raster_comes_back(scale):
    values = scale * np.random.default_rng(1).normal(0.3, 0.1, (17, 23))
    values[3, 4:9] = np.nan
    found = unpack(json.loads(json.dumps(pack(values))), values.shape)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - values)) <= 0.51 * np.nanmax(values - np.nanmin(values)) / 65534


@pytest.mark.parametrize("values", [np.full((2, 3), 0.25), np.full((2, 3), np.nan)])
def test_a_flat_or_empty_raster_comes_back(values):
    np.testing.assert_array_equal(unpack(pack(values), (2, 3)), values)


def test_a_mask_comes_back():
    mask = np.random.default_rng(2).random((5, 7)) > 0.6
    np.testing.assert_array_equal(unpack_bits(pack_bits(mask), mask.shape), mask)
    assert pack_bits(np.zeros((5, 7), bool)) == ""
    assert not unpack_bits("", (5, 7)).any()


def test_large_rasters_are_thinned():
    assert thinning((300, 300)) == 1
    step = thinning((2000, 1500))
    assert (2000 // step) * (1500 // step) <= MAX_CELLS


# Data of the map viewer: layers.py ------------------------------------------------------------------------------


def data_of(run):
    return json.loads(json.dumps(viewer_data(run, irrigation(run)), allow_nan=False))


def layer(data, key):
    return next(one for one in data["layers"] if one["key"] == key)


def test_places_on_the_map_have_their_latitude_and_longitude(make_run):
    run = make_run()
    place = data_of(run)["place"]
    xy = np.random.default_rng(1).uniform(-20, 20, (30, 2))
    dx, dy = (xy - (place["x"], place["y"])).T / 1000
    terms = np.column_stack([np.ones(30), dx, dy, dx * dx, dx * dy, dy * dy])
    found = np.column_stack([terms @ place["latitude"], terms @ place["longitude"]])
    np.testing.assert_allclose(found, run.frame.to_geographic(xy), rtol=0, atol=1e-9)


def test_cells_whose_interval_reaches_a_limit_are_hatched(make_run, steep):
    run = make_run(soil_map=steep)
    soil_map, data = run.soil_map, data_of(run)
    inside = soil_map.grid.mask
    assert (soil_map.beyond_limits & inside).any()
    hatched = unpack_bits(layer(data, "vwc")["hatch"], inside.shape)
    np.testing.assert_array_equal(hatched, soil_map.beyond_limits & inside)
    shown = unpack(layer(data, "vwc"), inside.shape)
    assert np.nanmax(shown) <= 100 * soil_map.limits.saturation + 1e-9
    assert layer(data, "vwc")["to"] <= 100 * soil_map.limits.saturation


def test_zones_and_their_certainty(make_run):
    run = make_run()
    data, found = data_of(run), irrigation(run)
    zone = layer(data, "zone")
    np.testing.assert_allclose(unpack(zone, found.number.shape), found.number, atol=1e-4)
    np.testing.assert_array_equal(
        unpack_bits(zone["hatch"], found.number.shape), np.isfinite(found.number) & ~found.sure
    )
    assert [one["name"] for one in data["zones"]] == [one.name for one in found.zones]


def test_each_property_has_its_layers(make_run, uncalibrated):
    other = make_run(soil_map=uncalibrated, calibration=None, name="salt", label="Salt")
    data = data_of(make_run(others=[other], truth_rate=uncalibrated.rate))
    titles = [one["title"] for one in data["layers"] if "title" in one]
    assert titles == [
        "Soil moisture", "Irrigation zones", "How sure", "Neutron rate", "Rate uncertainty", "True rate", "Error",
        "Salt: Neutron rate", "Salt: Rate uncertainty",
    ]  # fmt: skip
    shown = unpack(layer(data, "rate1"), uncalibrated.rate.shape)
    np.testing.assert_allclose(shown[uncalibrated.grid.mask], uncalibrated.rate[uncalibrated.grid.mask], atol=1e-4)


def test_samples_field_and_no_go_areas(make_run, the_map):
    data = data_of(make_run())
    samples = the_map.samples
    assert [row[2] for row in data["samples"]] == samples.counts.tolist()
    assert len(data["edge"]) == 2, "outline and hole"
    assert len(data["noGo"]) == 1
    west, east, south, north = data["view"]
    assert west < samples.xy[:, 0].min() < samples.xy[:, 0].max() < east
    assert south < samples.xy[:, 1].min() < samples.xy[:, 1].max() < north


def test_large_maps_are_thinned_to_cells_of_the_map(make_run, the_map, map_of):
    soil = map_of(cell_m=0.08)
    data = data_of(make_run(soil_map=soil))
    grid = data["grids"][0]
    assert grid["nx"] * grid["ny"] <= 90_000
    assert grid["cell"] == pytest.approx(0.16)
    shown = unpack(layer(data, "rate"), (grid["ny"], grid["nx"]))
    column = round((3.0 - grid["x0"]) / grid["cell"])
    row = round((9.0 - grid["y0"]) / grid["cell"])
    assert shown[row, column] == pytest.approx(soil.rate[2 * row, 2 * column], abs=1e-4)


def test_several_robots_have_their_own_colours(make_run):
    run = make_run()

    class Team:
        tracks = (np.zeros((2, 2)), np.ones((2, 2)))
        visits = ()

    data = viewer_data(dataclasses.replace(run, mission=Team()), irrigation(run))
    assert [robot["name"] for robot in data["robots"]] == ["robot 1 blue", "robot 2 orange"]
    assert data_of(run)["robots"] == []


def test_colour_limits_are_round_and_noise_is_no_pattern():
    flat = 20 + 0.01 * np.random.default_rng(1).normal(size=500)
    low, high = colour_limits(flat, np.full(500, 3.0))
    assert high - low >= 6
    assert low == round(low)
    assert colour_limits(np.linspace(3, 44, 99), within=(0.0, 40.0))[1] == 40.0
    assert colour_limits(np.full(4, np.nan)) == (0.0, 1.0)


# Pictures of the map (picture.py) -------------------------------------------------------------------------------

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def run():
    return mission_run(simulate_mission(MissionSettings(hours=0.7, preset="authors", cell_m=4.0)))


def test_cells_lie_in_their_place(run):
    grid = run.soil_map.grid
    values = np.add.outer(100.0 * np.arange(len(grid.y_m)), np.arange(len(grid.x_m)))
    root = ElementTree.fromstring(draw(run, values, "Purples", (0.0, float(values.max())), "Share < 1"))
    image = root.find(f"{SVG}image")
    pixels = imread(io.BytesIO(base64.b64decode(image.get("href").partition(",")[2])), format="png")
    assert pixels.shape[:2] == values.shape
    inside = pixels[::-1, :, 3] > 0
    np.testing.assert_array_equal(inside, grid.mask)
    brightness = pixels[::-1, :, :3].sum(axis=2)
    assert (np.diff(brightness, axis=0)[inside[1:] & inside[:-1]] < 0).all(), "north is up, and dark is high"
    width, height = (float(image.get(name)) for name in ("width", "height"))
    assert width / height == pytest.approx(values.shape[1] / values.shape[0], rel=1e-3), "true proportions"
    assert "Share < 1" in [text.text for text in root.iter(f"{SVG}text")]


def test_ends_of_the_colours_have_arrows_where_values_lie_beyond(run):
    values = np.linspace(0.0, 10.0, run.soil_map.grid.mask.size).reshape(run.soil_map.grid.mask.shape)
    arrows = [
        draw(run, values, "BrBG", limits, "x").count('<path style="fill:#')
        for limits in ((0, 10), (1, 10), (1, 9))
    ]
    assert arrows == [0, 1, 2]


def test_hatching_covers_its_cells(run):
    grid = run.soil_map.grid
    hatch = np.zeros(grid.mask.shape, bool)
    values = np.ones(hatch.shape)
    assert "pattern" not in draw(run, values, "BrBG", (0.0, 2.0), "x", hatch)
    rows, columns = np.nonzero(grid.mask)
    hatch[rows[:3], columns[:3]] = True
    hatch[rows[-1], columns[-1]] = True
    root = ElementTree.fromstring(draw(run, values, "BrBG", (0.0, 2.0), "x", hatch))
    image = root.find(f"{SVG}image")
    cell = float(image.get("width")) / hatch.shape[1]
    (boxes,) = (path.get("d") for path in root.iter(f"{SVG}path") if "#h" in path.get("style", ""))
    found = re.findall(r"M([\d.]+) ([\d.]+)H([\d.]+)V([\d.]+)", boxes)
    area = sum((float(right) - float(left)) * (float(low) - float(high)) for left, low, right, high in found)
    assert area == pytest.approx(4 * cell**2, rel=0.05)
