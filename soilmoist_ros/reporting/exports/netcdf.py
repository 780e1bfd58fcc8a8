# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps as NetCDF by the CF conventions, for climate and soil scientists."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilmoist_ros.foundation import __version__
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.exports.source import MOISTURE, ExportSettings, PropertyMap, RunSource
from soilmoist_ros.reporting.geotiff import BANDS

if TYPE_CHECKING:
    from scipy.io import netcdf_file

FILL = np.float32(9.96921e36)
"""Value of cells outside the field: the default of NetCDF."""
STANDARD_NAME = "volume_fraction_of_condensed_water_in_soil"
NAMES = {"vwc": STANDARD_NAME, "vwc_sd": f"{STANDARD_NAME} standard_error"}
"""Standard names of the CF table; count rates have none."""
UNITS = {"m3/m3": "1", "counts/s": "s-1"}


def write_netcdf(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``map.nc`` for each property: CF-1.8 on the grid of ``map.tif``, NetCDF-3."""
    return [_write(source, one, folder / f"map{one.suffix}.nc") for one in source.properties]


def _write(source: RunSource, one: PropertyMap, path: Path) -> Path:
    from scipy.io import netcdf_file

    with netcdf_file(path, "w", version=2) as file:
        _about(file, source, one)
        _axes(file, one)
        _time(file, source)
        for name, values in one.bands.items():
            _band(file, one, name, np.asarray(values, float))
    return path


def _about(file: netcdf_file, source: RunSource, one: PropertyMap) -> None:
    about = source.run.summary
    simulated = "simulation" if source.simulated else "surface observation"
    file.Conventions = "CF-1.8"
    guessed = ", illustrative: its level is not real" if one.calibration == ILLUSTRATIVE else ""
    file.title = f"{one.quantity.title} of {source.title}" + (f": {one.label}" if one.name else "") + guessed
    file.calibration = one.calibration
    file.institution = str(about.get("site") or "unknown")
    file.source = f"{simulated}: cosmic-ray neutron counts, Poisson kriging by soilmoist_ros {__version__}"
    file.history = f"{about.get('created_utc', '')} soilmoist_ros {about.get('version', '')}: map made".strip()
    file.references = "Monestiez et al. 2006, Ecological Modelling 193:615-628"
    comment = one.tags.get("SOILMOIST_INTERVAL")
    if comment:
        file.comment = comment


def _axes(file: netcdf_file, one: PropertyMap) -> None:
    """Axes, their places on earth, and the reference system."""
    height, width = one.values.shape
    x = one.transform.c + one.transform.a * (np.arange(width) + 0.5)
    y = one.transform.f + one.transform.e * (np.arange(height) + 0.5)
    geographic = one.crs.is_geographic
    units = one.crs.axis_info[0].unit_name.replace("metre", "m")
    kinds = ("longitude", "degrees_east"), ("latitude", "degrees_north")
    if not geographic:
        kinds = ("projection_x_coordinate", units), ("projection_y_coordinate", units)
    for name, axis, (standard, unit) in (("x", x, kinds[0]), ("y", y, kinds[1])):
        file.createDimension(name, axis.size)
        attributes = {"standard_name": standard, "units": unit, "long_name": standard.replace("_", " ")}
        _put(file, name, axis, (name,), axis=name.upper(), **attributes)
    if not geographic:
        column, row = np.meshgrid(np.arange(width), np.arange(height))
        place = one.frame.to_geographic(one.to_local(np.column_stack([column.ravel(), row.ravel()])))
        for name, standard, unit, values in (
            ("lat", "latitude", "degrees_north", place[:, 0]),
            ("lon", "longitude", "degrees_east", place[:, 1]),
        ):
            grid = values.reshape(height, width)
            _put(file, name, grid, ("y", "x"), standard_name=standard, units=unit, long_name=standard)
    mapping = {key: value for key, value in one.crs.to_cf().items() if value not in (None, "", "undefined")}
    _put(file, "crs", np.int32(0), (), **mapping)


def _time(file: netcdf_file, source: RunSource) -> None:
    """Middle of the survey, with its begin and end as bounds; none for a clock without a date."""
    if source.survey is None:
        return
    begin, end = (one.timestamp() for one in source.survey)
    file.createDimension("time", 1)
    file.createDimension("nv", 2)
    units = {"units": "seconds since 1970-01-01 00:00:00", "calendar": "standard"}
    about = {"standard_name": "time", "long_name": "time of the survey", "bounds": "time_bounds", "axis": "T"}
    _put(file, "time", np.array([(begin + end) / 2]), ("time",), **about, **units)
    _put(file, "time_bounds", np.array([[begin, end]]), ("time", "nv"))


def _band(file: netcdf_file, one: PropertyMap, name: str, values: Any) -> None:
    unit, meaning = BANDS.get(name, ("1", name))
    if one.calibration == ILLUSTRATIVE and name.startswith(MOISTURE.band):
        meaning = f"{meaning}, {ILLUSTRATIVE}"
    attributes: dict[str, Any] = {"long_name": meaning, "units": UNITS.get(unit, unit), "grid_mapping": "crs"}
    if name in NAMES:
        attributes["standard_name"] = NAMES[name]
    if not one.crs.is_geographic:
        attributes["coordinates"] = "lat lon"
    further = [other for other in one.bands if other.startswith(f"{name}_")]
    if further:
        attributes["ancillary_variables"] = " ".join(further)
    raster = np.where(np.isfinite(values), values, FILL).astype(np.float32)
    dimensions = ("time", "y", "x") if "time" in file.dimensions else ("y", "x")
    _put(file, name, raster, dimensions, _FillValue=FILL, **attributes)


def _put(file: netcdf_file, name: str, values: Any, dimensions: tuple[str, ...], **attributes: Any) -> None:
    """A variable with its attributes."""
    array = np.asarray(values)
    variable = file.createVariable(name, array.dtype, dimensions)
    variable[...] = array
    for key, value in attributes.items():
        setattr(variable, key, value)
