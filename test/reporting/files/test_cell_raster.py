# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.reporting.files.cell_raster import CellBand, place_cells, write_cell_raster
from soilmoist_ros.reporting.files.geotiff import to_local

FRAME = LocalFrame(53.27, -0.52)


def test_every_cell_has_the_value_of_the_cell_at_its_centre(the_map, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    grid, crs = the_map.grid, FRAME.export_crs()
    x, y = np.meshgrid(grid.x_m, grid.y_m)
    bands = {name: CellBand(values, "m", f"{name} of the cell") for name, values in (("east", x), ("north", y))}
    write_cell_raster(tmp_path / "cells.tif", the_map, FRAME, crs, bands, {"ABOUT": "cells"})
    with rasterio.open(tmp_path / "cells.tif") as file:
        assert file.descriptions == ("east", "north")
        assert file.units == ("m", "m")
        assert file.tags()["ABOUT"] == "cells"
        east, north = file.read()
        rows, columns = np.nonzero(np.isfinite(east))
        there = np.column_stack(file.xy(rows, columns))
    local = np.column_stack(to_local(FRAME, crs).transform(*there.T))
    assert np.abs(local[:, 0] - east[rows, columns]).max() <= grid.cell_m / 2 + 1e-3
    assert np.abs(local[:, 1] - north[rows, columns]).max() <= grid.cell_m / 2 + 1e-3


def test_cells_outside_the_field_have_no_value(the_map):
    placed = place_cells(the_map, FRAME, FRAME.export_crs())
    inside = np.isfinite(placed.values(np.where(the_map.grid.mask, 1.0, 5.0)))
    assert np.count_nonzero(inside) == pytest.approx(np.count_nonzero(the_map.grid.mask), rel=0.05)
    assert np.nanmax(placed.values(np.where(the_map.grid.mask, 1.0, 5.0))) == 1.0
