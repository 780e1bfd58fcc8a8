# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The drawn aerial picture of a field (aerial_picture.py)."""

import numpy as np
import pytest

from soilmoist_ros.console.background import make_background
from soilmoist_ros.simulation.fields.aerial_picture import write_aerial_picture
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

rasterio = pytest.importorskip("rasterio")


@pytest.mark.slow
def test_moist_places_are_greener_and_the_page_can_show_it(tmp_path):
    farm = surrogate_field("farm")
    path = write_aerial_picture(farm, tmp_path / "configuration" / "aerial.tif")
    cells = farm.field.grid().cells
    with rasterio.open(path) as raster:
        red, green, _ = np.array(list(raster.sample(cells.tolist())), float).T
        _, pond_green, pond_blue = next(raster.sample([(101.0, 51.0)]))
    assert np.corrcoef(green / red, farm.vwc_at(cells))[0, 1] > 0.8
    assert pond_blue > pond_green
    shown = make_background(path, farm.frame, farm.polygon)
    assert shown.jpeg.startswith(b"\xff\xd8")


@pytest.mark.slow
def test_the_same_seed_draws_the_same_picture(tmp_path):
    field = surrogate_field("half-wet")
    one, same = (write_aerial_picture(field, tmp_path / name, seed=4) for name in ("a.tif", "b.tif"))
    assert one.read_bytes() == same.read_bytes()
