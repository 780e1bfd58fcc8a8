# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rasters as NetCDF-3 by the CF-1.8 conventions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pyproj import CRS

Array = NDArray[np.float64]
Variable = tuple[Any, tuple[str, ...], Mapping[str, Any]]
"""Values, names of the dimensions, and attributes."""

FILL = np.float32(9.96921e36)
"""Value of cells outside the field: the default of NetCDF."""
UNITS = {"m3/m3": "1", "counts/s": "s-1"}
"""Units of NetCDF for those of GeoTIFFs."""
CLOCK = {"units": "seconds since 1970-01-01 00:00:00", "calendar": "standard"}
"""Attributes of a time."""


def write_netcdf_file(path: Path, variables: Mapping[str, Variable], about: Mapping[str, str]) -> Path:
    """Write variables in order; dimensions have the size of the first variable with them."""
    from scipy.io import netcdf_file

    with netcdf_file(path, "w", version=2) as file:
        for key, text in {"Conventions": "CF-1.8", **about}.items():
            setattr(file, key, text)
        for name, (values, dimensions, attributes) in variables.items():
            array = np.asarray(values)
            for dimension, size in zip(dimensions, array.shape, strict=True):
                if dimension not in file.dimensions:
                    file.createDimension(dimension, size)
            variable = file.createVariable(name, array.dtype, dimensions)
            variable[...] = array
            for key, value in attributes.items():
                setattr(variable, key, value)
    return path


def axes(x: Array, y: Array, crs: CRS, lat_lon: Array | None) -> dict[str, Variable]:
    """Axes of a raster, the places of its cells on earth, and its reference system.

    :param x: centres of the columns, shape (nx,)
    :param y: centres of the rows, shape (ny,)
    :param lat_lon: latitude and longitude of each cell, shape (ny * nx, 2); ``None`` where x and y are these
    """
    units = crs.axis_info[0].unit_name.replace("metre", "m")
    kinds = (("projection_x_coordinate", units), ("projection_y_coordinate", units))
    if lat_lon is None:
        kinds = (("longitude", "degrees_east"), ("latitude", "degrees_north"))
    found: dict[str, Variable] = {}
    for name, axis, (standard, unit) in zip("xy", (x, y), kinds, strict=True):
        about = {"standard_name": standard, "units": unit, "long_name": standard.replace("_", " ")}
        found[name] = axis, (name,), {"axis": name.upper(), **about}
    if lat_lon is not None:
        earthly = (("lat", "latitude", "degrees_north"), ("lon", "longitude", "degrees_east"))
        for (name, standard, unit), values in zip(earthly, lat_lon.T, strict=True):
            about = {"standard_name": standard, "units": unit, "long_name": standard}
            found[name] = values.reshape(y.size, x.size), ("y", "x"), about
    mapping = {key: value for key, value in crs.to_cf().items() if value not in (None, "", "undefined")}
    return {**found, "crs": (np.int32(0), (), mapping)}


def raster(values: Array, dimensions: tuple[str, ...], unit: str, meaning: str, **further: str) -> Variable:
    """A raster on these axes; NaN becomes :data:`FILL`."""
    filled = np.where(np.isfinite(values), values, FILL).astype(np.float32)
    about = {"_FillValue": FILL, "long_name": meaning, "units": unit, "grid_mapping": "crs", **further}
    return filled if filled.ndim == len(dimensions) else filled[None], dimensions, about
