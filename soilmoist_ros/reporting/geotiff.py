# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps, and other rasters of a field's cells, as cloud-optimised GeoTIFFs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, __version__
from soilmoist_ros.mapping import FieldChange, FieldGrid
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, guess_text
from soilmoist_ros.reporting.geometry import field_polygon

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

    from soilmoist_ros.mapping import SoilMap

Array = NDArray[np.float64]

BANDS: dict[str, tuple[str, str]] = {
    "vwc": ("m3/m3", "volumetric water content of the soil"),
    "vwc_sd": ("m3/m3", "standard deviation of the volumetric water content"),
    "vwc_p05": ("m3/m3", "5 % quantile of the volumetric water content"),
    "vwc_p95": ("m3/m3", "95 % quantile of the volumetric water content"),
    "rate": ("counts/s", "corrected neutron count rate"),
    "rate_sd": ("counts/s", "standard deviation of the corrected neutron count rate"),
}
"""Unit and meaning of each band by its name, in the order of the file. A map without a curve has only the rate."""
CHANGES: dict[str, tuple[str, str]] = {
    "vwc_change": ("m3/m3", "change of the volumetric water content"),
    "vwc_change_sd": ("m3/m3", "standard deviation of the change of the volumetric water content"),
    "rate_change": ("counts/s", "change of the corrected neutron count rate"),
    "rate_change_sd": ("counts/s", "standard deviation of the change of the corrected neutron count rate"),
    "significant": (
        "1", f"1 drier, -1 wetter, 0 not significant at a false discovery rate of {FieldChange.FALSE_SHARE:g}",
    ),
}  # fmt: skip
"""Unit and meaning of each band of a change by its name; the survey that it compares with may be a later one."""
CELLS_AT_ONCE = 2**20
MAX_CELLS = 25_000_000


class ExportGrid(NamedTuple):
    """The cells of a raster in a reference system that cover a field, north up.

    :param crs: reference system
    :param x: centres of the columns, ascending, shape (nx,)
    :param y: centres of the rows, descending, shape (ny,)
    :param step: size of a cell (x, y) in the unit of the reference system
    :param to_local: from the reference system to the plane of the field
    """

    crs: CRS
    x: Array
    y: Array
    step: tuple[float, float]
    to_local: Transformer

    def local(self, start: int = 0, stop: int | None = None) -> Array:
        """Places of some cells of the flattened raster in the plane of the field, shape (n, 2) [m]."""
        cells = self.x.size * self.y.size
        row, column = np.divmod(np.arange(start, min(stop or cells, cells)), self.x.size)
        return np.column_stack(self.to_local.transform(self.x[column], self.y[row]))


def write_geotiff(
    path: Path,
    soil_map: SoilMap,
    frame: LocalFrame,
    crs: CRS | str | int | None = None,
    tags: Mapping[str, str] | None = None,
) -> Path:
    """Write the map as a cloud-optimised GeoTIFF, north up, in a projected coordinate reference system.

    The map is kriged again at the centre of each cell in the local frame, not resampled. Cells whose centre lies
    outside the field are NaN. Bands have names, units and meanings, see :data:`BANDS`: moisture comes first, and a
    map without a moisture curve has the count rate only. Large maps have overviews.

    :param crs: anything that pyproj accepts; default the UTM zone of the datum
    :param tags: more tags for the file
    :raises InputError: if the field has no place in ``crs``, or no raster of sensible size
    """
    from shapely import contains_xy, prepare

    names = [name for name in BANDS if soil_map.curve is not None or name.startswith("rate")]
    target, field = target_cells(soil_map.grid, frame, frame.export_crs(crs)), field_polygon(soil_map.grid)
    prepare(field)
    layers = np.full((len(names), target.y.size * target.x.size), np.nan, np.float32)
    for start in range(0, layers.shape[1], CELLS_AT_ONCE):
        local = target.local(start, start + CELLS_AT_ONCE)
        inside = contains_xy(field, *local.T)
        if inside.any():
            found = soil_map.evaluate(local[inside])
            layers[:, start + np.flatnonzero(inside)] = np.stack([getattr(found, name) for name in names])
    bands = dict(zip(names, layers.reshape(-1, target.y.size, target.x.size), strict=True))
    support = (tags or {}).get("SOILMOIST_SUPPORT")
    about = {**_map_tags(soil_map, frame), **(tags or {})}
    return _write(path, target, bands, about, {"support": support} if support else {}, "average")


def write_cell_raster(
    path: Path, grid: FieldGrid, frame: LocalFrame, crs: CRS, bands: Mapping[str, Array], tags: Mapping[str, str]
) -> Path:
    """Write rasters of a field's cells: each cell of the file has the value of the cell at its centre.

    :param bands: values of shape (ny, nx) by the names of :data:`BANDS` and :data:`CHANGES`
    """
    target = target_cells(grid, frame, crs)
    cell = _cell_index(grid, target.local()).reshape(target.y.size, target.x.size)
    placed = {name: np.append(values.ravel(), np.nan)[cell].astype(np.float32) for name, values in bands.items()}
    return _write(path, target, placed, {"AREA_OR_POINT": "Area", **tags}, {}, "nearest")


def _write(
    path: Path, target: ExportGrid, bands: Mapping[str, NDArray[np.float32]], tags: Mapping[str, str],
    band_tags: Mapping[str, str], overviews: str,
) -> Path:  # fmt: skip
    import rasterio

    x, y, step = target.x, target.y, target.step
    transform = rasterio.Affine(step[0], 0, x[0] - step[0] / 2, 0, -step[1], y[0] + step[1] / 2)
    profile = {
        "driver": "COG", "dtype": "float32", "count": len(bands), "width": x.size, "height": y.size,
        "crs": rasterio.crs.CRS.from_wkt(target.crs.to_wkt()), "transform": transform, "nodata": float("nan"),
        "compress": "deflate", "predictor": "floating_point", "blocksize": 256,
        "overview_resampling": overviews, "bigtiff": "IF_SAFER",
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(np.stack(list(bands.values())))
        for number, name in enumerate(bands, start=1):
            unit, meaning = {**BANDS, **CHANGES}[name]
            if name.startswith("vwc"):
                meaning += guess_text(tags.get(CALIBRATION_TAG, ""))
            raster.set_band_description(number, name)
            raster.set_band_unit(number, unit)
            raster.update_tags(number, long_name=meaning, units=unit, **band_tags)
        raster.update_tags(**tags)
    return path


def model_parameters(soil_map: SoilMap) -> dict[str, str | float]:
    """The variogram and mean behind the map, ready for JSON."""
    variogram = soil_map.variogram
    return {
        "model": str(variogram.model), "nugget_cps2": float(variogram.nugget), "range_m": float(variogram.range_m),
        "sill_cps2": float(variogram.sill), "anisotropy": float(variogram.anisotropy),
        "angle_deg": float(variogram.angle_deg), "mean_rate_cps": float(soil_map.mean_rate),
    }  # fmt: skip


def _map_tags(soil_map: SoilMap, frame: LocalFrame) -> dict[str, str]:
    """Origin of the map, the limits of the soil, and what the interval of the moisture contains."""
    curve, limits = soil_map.curve, soil_map.limits
    parameters = {
        "datum": {"latitude_deg": frame.latitude_deg, "longitude_deg": frame.longitude_deg},
        "map_cell_m": float(soil_map.grid.cell_m), "n_samples": len(soil_map.samples.xy),
        "calibration": None if curve is None else curve.parameters,
    }  # fmt: skip
    tags = {
        "AREA_OR_POINT": "Area", "TIFFTAG_SOFTWARE": f"soilmoist_ros {__version__}",
        "TIFFTAG_IMAGEDESCRIPTION": "Soil moisture map from cosmic-ray neutron counts, by Poisson kriging",
        "SOILMOIST_MODEL": json.dumps(model_parameters(soil_map)), "SOILMOIST_PARAMETERS": json.dumps(parameters),
    }  # fmt: skip
    if limits is not None:
        tags["SOILMOIST_LIMITS"] = json.dumps(dict(zip(("dryness", "saturation"), limits, strict=True)))
        tags["SOILMOIST_INTERVAL"] = (
            "vwc_p05 to vwc_p95 holds the true moisture of 90 in 100 places: counting, interpolation, and the "
            "calibration as far as its standard deviations are known; cut at the limits of the soil. vwc_sd "
            "leaves the calibration out, which all places have in common"
        )
    return tags


def target_cells(grid: FieldGrid, frame: LocalFrame, crs: CRS) -> ExportGrid:
    """Cells of a raster in a reference system that cover the field, about as large as those of the map.

    :raises InputError: if the field has no place in ``crs``, or no raster of sensible size
    """
    from pyproj import Transformer
    from shapely import get_coordinates

    to_local = Transformer.from_crs(crs, frame.crs, always_xy=True)
    local = get_coordinates(field_polygon(grid).segmentize(grid.cell_m))
    there = np.column_stack(to_local.transform(local[:, 0], local[:, 1], direction="INVERSE"))
    if not np.isfinite(there).all():
        raise InputError(
            f"the field has no place in the coordinate reference system '{crs.name}'",
            "choose one that covers the field, or none for the UTM zone of the field",
        )
    cell_m, (x0, y0) = grid.cell_m, local.mean(axis=0)
    if crs.is_projected:
        step = np.full(2, cell_m / crs.axis_info[0].unit_conversion_factor)
    else:
        x, y = to_local.transform([x0, x0 + cell_m, x0], [y0, y0, y0 + cell_m], direction="INVERSE")
        step = np.array([np.hypot(x[one] - x[0], y[one] - y[0]) for one in (1, 2)])
    first = np.floor(there.min(axis=0) / step + 1e-9)
    last = np.ceil(there.max(axis=0) / step - 1e-9)
    shape = np.maximum(last - first, 1)
    if shape.prod() > MAX_CELLS:
        raise InputError(
            f"the raster in '{crs.name}' would have {shape[0]:.0f} x {shape[1]:.0f} cells",
            "choose larger cells, or a coordinate reference system that fits the field",
        )
    x = (first[0] + np.arange(shape[0]) + 0.5) * step[0]
    y = (first[1] + shape[1] - np.arange(shape[1]) - 0.5) * step[1]
    return ExportGrid(crs, x, y, (float(step[0]), float(step[1])), to_local)


def _cell_index(grid: FieldGrid, xy: Array) -> NDArray[np.intp]:
    """Index of the cell inside the field that holds each place, -1 without one, shape (n,)."""
    column = np.rint((xy[:, 0] - grid.x_m[0]) / grid.cell_m).astype(int)
    row = np.rint((xy[:, 1] - grid.y_m[0]) / grid.cell_m).astype(int)
    rows, columns = grid.shape
    good = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    found = np.where(good, row * columns + column, -1)
    return np.where(good & grid.mask.ravel()[found], found, -1)
