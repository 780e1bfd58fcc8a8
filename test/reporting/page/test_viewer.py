# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import base64
import io
import json

import numpy as np
import pytest
from matplotlib.image import imread

from reporting.packed import unpack, unpack_bits
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.reporting.page.viewer import colour_limits, pack, pictures, viewer_data


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_a_raster_comes_back(scale):
    values = scale * np.random.default_rng(1).normal(0.3, 0.1, (17, 23))
    values[3, 4:9] = np.nan
    found = unpack(json.loads(json.dumps(pack(values))), values.shape)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - values)) <= 0.51 * np.nanmax(values - np.nanmin(values)) / 65534


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


@pytest.mark.slow
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


def test_colour_limits_are_round_and_noise_is_no_pattern():
    flat = 20 + 0.01 * np.random.default_rng(1).normal(size=500)
    low, high = colour_limits(flat, np.full(500, 3.0))
    assert high - low >= 6
    assert low == round(low)
    assert colour_limits(np.linspace(3, 44, 99), within=(0.0, 40.0))[1] == 40.0
    assert colour_limits(np.full(4, np.nan)) == (0.0, 1.0)


def test_readers_without_scripts_see_the_map_with_dark_for_wet_and_north_up(make_run, the_map):
    picture, width = pictures(make_run())
    pixels = imread(io.BytesIO(base64.b64decode(picture["uri"].partition(",")[2])), format="png")[::-1]
    np.testing.assert_array_equal(pixels[:, :, 3] > 0, the_map.grid.mask)
    cells, vwc = pixels[the_map.grid.mask][:, :3].sum(axis=1), the_map.vwc[the_map.grid.mask]
    assert np.corrcoef(cells, vwc)[0, 1] < -0.9
    assert "40 m from west to east, north is up" in picture["alt"]
    assert width["from"] == 0
