# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rasters of a field's cells as a GeoTIFF: each cell of the file has the value of the cell at its centre."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.reporting.files.geotiff import export_axes, to_local

if TYPE_CHECKING:
    from pyproj import CRS
    from rasterio import Affine

    from soilmoist_ros.mapping import SoilMap

Array = NDArray[np.float64]


class CellBand(NamedTuple):
    """A band.

    :param values: values of the cells, shape (ny, nx)
    :param unit: their unit
    :param meaning: what they are
    """

    values: Array
    unit: str
    meaning: str


class Placed(NamedTuple):
    """The cells of a projected raster, north up.

    :param transform: affine transform
    :param x: centres of the columns, shape (nx,)
    :param y: centres of the rows, from north to south, shape (ny,)
    :param cell: index of the field's cell at each centre in its flattened raster, -1 outside, shape (ny, nx)
    """

    transform: Affine
    x: Array
    y: Array
    cell: NDArray[np.intp]

    def values(self, raster: Array) -> NDArray[np.float32]:
        """A raster of the field's cells on these cells, NaN outside."""
        flat = np.append(raster.ravel(), np.nan)
        return flat[self.cell].astype(np.float32)


def place_cells(soil_map: SoilMap, frame: LocalFrame, crs: CRS) -> Placed:
    """Cells of a raster in a reference system that cover the field."""
    import rasterio

    x, y, step = export_axes(soil_map, frame, crs)
    transform = rasterio.Affine(step[0], 0, x[0] - step[0] / 2, 0, -step[1], y[0] + step[1] / 2)
    across, up = np.meshgrid(x, y)
    local = np.column_stack(to_local(frame, crs).transform(across.ravel(), up.ravel()))
    return Placed(transform, x, y, _index(soil_map.grid, local).reshape(across.shape))


def _index(grid: FieldGrid, xy: Array) -> NDArray[np.intp]:
    """Index of the cell inside the field that holds each place, -1 without one, shape (n,)."""
    column = np.rint((xy[:, 0] - grid.x_m[0]) / grid.cell_m).astype(int)
    row = np.rint((xy[:, 1] - grid.y_m[0]) / grid.cell_m).astype(int)
    rows, columns = grid.shape
    good = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    found = np.full(len(xy), -1)
    found[good] = row[good] * columns + column[good]
    found[good] = np.where(grid.mask.ravel()[found[good]], found[good], -1)
    return found


def write_cell_raster(
    path: Path,
    soil_map: SoilMap,
    frame: LocalFrame,
    crs: CRS,
    bands: Mapping[str, CellBand],
    tags: Mapping[str, str] | None = None,
) -> Path:
    """Write rasters of a field's cells as a cloud-optimised GeoTIFF, north up.

    :param path: file to write
    :param soil_map: a map of the field, for its cells
    :param frame: local frame of the map
    :param crs: reference system of the file
    :param bands: the bands by name, in order
    :param tags: tags of the file
    """
    import rasterio

    placed = place_cells(soil_map, frame, crs)
    profile = {
        "driver": "COG", "dtype": "float32", "count": len(bands), "width": placed.x.size, "height": placed.y.size,
        "crs": rasterio.crs.CRS.from_wkt(crs.to_wkt()), "transform": placed.transform, "nodata": float("nan"),
        "compress": "deflate", "predictor": "floating_point", "blocksize": 256, "overview_resampling": "nearest",
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(np.stack([placed.values(band.values) for band in bands.values()]))
        for number, (name, band) in enumerate(bands.items(), start=1):
            raster.set_band_description(number, name)
            raster.set_band_unit(number, band.unit)
            raster.update_tags(number, long_name=band.meaning, units=band.unit)
        raster.update_tags(AREA_OR_POINT="Area", **(tags or {}))
    return path
