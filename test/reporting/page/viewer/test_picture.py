# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the map (picture.py)."""

import base64
import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread

from soilmoist_ros.reporting.mission_report import mission_run
from soilmoist_ros.reporting.page.viewer.picture import draw
from soilmoist_ros.simulation import MissionSettings, simulate_mission

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
