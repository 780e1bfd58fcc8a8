# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map as one array of cells, as viewers want it: places and bands of each cell, rows from south to north."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.soil_map import SoilMap

BANDS: Final = ("rate", "rate_sd", "vwc", "vwc_sd", "vwc_p05", "vwc_p95")
CELL: Final = np.dtype([(name, "<f4") for name in ("x", "y", "z", *BANDS)])
"""A cell: centre in the plane z = 0 [m], and the bands."""


def map_cells(grid: FieldGrid, soil_map: SoilMap | None) -> NDArray[Any]:
    """Cells of a map, rounded to 32 bits.

    :param grid: the field
    :param soil_map: the map on this grid; without a map all bands are NaN
    :returns: array of :data:`CELL`, shape (rows, columns); a cell outside the field is all NaN
    """
    cells = placed_cells(grid, CELL)
    if soil_map is not None:
        for name in BANDS:
            cells[name] = getattr(soil_map, name)
    return cells


def placed_cells(grid: FieldGrid, kind: np.dtype[Any]) -> NDArray[Any]:
    """Cells of a kind with their places, else NaN, shape (rows, columns).

    :param grid: the field
    :param kind: a structure with x, y and z
    """
    cells = np.full(grid.shape, np.nan, kind)
    row, column = np.nonzero(grid.mask)
    cells["x"][row, column] = grid.x_m[column]
    cells["y"][row, column] = grid.y_m[row]
    cells["z"][row, column] = 0.0
    return cells
