# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map as a georeferenced GeoTIFF."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, __version__
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, ILLUSTRATIVE
from soilmoist_ros.reporting.geometry import field_polygon, inside_field

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

    from soilmoist_ros.mapping import SoilMap

BANDS: dict[str, tuple[str, str]] = {
    "vwc": ("m3/m3", "volumetric water content of the soil"),
    "vwc_sd": ("m3/m3", "standard deviation of the volumetric water content"),
    "vwc_p05": ("m3/m3", "5 % quantile of the volumetric water content"),
    "vwc_p95": ("m3/m3", "95 % quantile of the volumetric water content"),
    "rate": ("counts/s", "corrected neutron count rate"),
    "rate_sd": ("counts/s", "standard deviation of the corrected neutron count rate"),
}
"""Unit and meaning of each band by its name, in the order of the file. A map without a curve has only the rate."""
CELLS_AT_ONCE = 2**20
"""Many, since tiles of a large map that lie in two parts are computed twice."""
MAX_CELLS = 25_000_000


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

    :param path: file to write
    :param soil_map: the map
    :param frame: local frame of the map
    :param crs: anything that pyproj accepts; default the UTM zone of the datum
    :param tags: more tags for the file
    :returns: ``path``
    :raises InputError: if the field has no place in ``crs``, or no raster of sensible size
    """
    import rasterio

    target = frame.export_crs(crs)
    x, y, step = export_axes(soil_map, frame, target)
    transform = rasterio.Affine(step[0], 0, x[0] - step[0] / 2, 0, -step[1], y[0] + step[1] / 2)
    names = [name for name in BANDS if soil_map.curve is not None or name.startswith("rate")]
    profile = {
        "driver": "COG", "dtype": "float32", "count": len(names), "width": x.size, "height": y.size,
        "crs": rasterio.crs.CRS.from_wkt(target.to_wkt()), "transform": transform, "nodata": float("nan"),
        "compress": "deflate", "predictor": "floating_point", "blocksize": 256,
        "overview_resampling": "average", "bigtiff": "IF_SAFER",
    }  # fmt: skip
    layers = _evaluate(soil_map, names, to_local(frame, target), x, y)
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(layers)
        for band, name in enumerate(names, start=1):
            unit, meaning = BANDS[name]
            if (tags or {}).get(CALIBRATION_TAG) == ILLUSTRATIVE and name.startswith("vwc"):
                meaning = f"{meaning}, {ILLUSTRATIVE}"
            raster.set_band_description(band, name)
            raster.set_band_unit(band, unit)
            raster.update_tags(band, long_name=meaning, units=unit, **_support(tags))
        raster.update_tags(**{**_tags(soil_map, frame), **(tags or {})})
    return path


def _support(tags: Mapping[str, str] | None) -> dict[str, str]:
    """The area that each value of a band is of, if the tags of the file say it."""
    known = (tags or {}).get("SOILMOIST_SUPPORT")
    return {"support": known} if known else {}


def model_parameters(soil_map: SoilMap) -> dict[str, str | float]:
    """The variogram and mean behind the map, ready for JSON."""
    variogram = soil_map.variogram
    return {
        "model": str(variogram.model),
        "nugget_cps2": float(variogram.nugget),
        "range_m": float(variogram.range_m),
        "sill_cps2": float(variogram.sill),
        "anisotropy": float(variogram.anisotropy),
        "angle_deg": float(variogram.angle_deg),
        "mean_rate_cps": float(soil_map.mean_rate),
    }


def _tags(soil_map: SoilMap, frame: LocalFrame) -> dict[str, str]:
    curve = soil_map.curve
    parameters: dict[str, object] = {
        "datum": {"latitude_deg": frame.latitude_deg, "longitude_deg": frame.longitude_deg},
        "map_cell_m": float(soil_map.grid.cell_m),
        "n_samples": len(soil_map.samples.xy),
        "calibration": None if curve is None else curve.parameters,
    }
    return {
        "AREA_OR_POINT": "Area",
        "TIFFTAG_SOFTWARE": f"soilmoist_ros {__version__}",
        "TIFFTAG_IMAGEDESCRIPTION": "Soil moisture map from cosmic-ray neutron counts, by Poisson kriging",
        "SOILMOIST_MODEL": json.dumps(model_parameters(soil_map)),
        "SOILMOIST_PARAMETERS": json.dumps(parameters),
        **_moisture_tags(soil_map),
    }


def _moisture_tags(soil_map: SoilMap) -> dict[str, str]:
    """The limits of the soil, and what the interval of the moisture contains."""
    if soil_map.limits is None:
        return {}
    return {
        "SOILMOIST_LIMITS": json.dumps(dict(zip(("dryness", "saturation"), soil_map.limits, strict=True))),
        "SOILMOIST_INTERVAL": "vwc_p05 to vwc_p95 holds the true moisture of 90 in 100 places: counting, "
        "interpolation, and the calibration as far as its standard deviations are known; cut at the limits of the "
        "soil. vwc_sd leaves the calibration out, which all places have in common",
    }


def to_local(frame: LocalFrame, crs: CRS) -> Transformer:
    """From a reference system to the local frame, longitude or east first."""
    from pyproj import Transformer

    return Transformer.from_crs(crs, frame.crs, always_xy=True)


def export_axes(
    soil_map: SoilMap, frame: LocalFrame, crs: CRS
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Cell centres (x ascending, y descending: north up) and cell size of the exported raster."""
    from shapely import get_coordinates

    local = get_coordinates(field_polygon(soil_map).segmentize(soil_map.grid.cell_m))
    back = to_local(frame, crs)
    there = np.column_stack(back.transform(local[:, 0], local[:, 1], direction="INVERSE"))
    if not np.isfinite(there).all():
        raise InputError(
            f"the field has no place in the coordinate reference system '{crs.name}'",
            "choose one that covers the field, or none for the UTM zone of the field",
        )
    step = _cell_size(soil_map.grid.cell_m, local.mean(axis=0), back, crs)
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
    return x, y, (float(step[0]), float(step[1]))


def _cell_size(cell_m: float, centre: NDArray[np.float64], back: Transformer, crs: CRS) -> NDArray[np.float64]:
    """About ``cell_m`` in the unit of the coordinate reference system, (x, y)."""
    if crs.is_projected:
        return np.full(2, cell_m / crs.axis_info[0].unit_conversion_factor)
    x0, y0 = centre
    x, y = back.transform([x0, x0 + cell_m, x0], [y0, y0, y0 + cell_m], direction="INVERSE")
    return np.array([np.hypot(x[1] - x[0], y[1] - y[0]), np.hypot(x[2] - x[0], y[2] - y[0])])


def _evaluate(
    soil_map: SoilMap, names: Sequence[str], to_local: Transformer, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float32]:
    """The named bands on the exported raster, shape (bands, rows, columns), NaN outside the field."""
    layers = np.full((len(names), y.size * x.size), np.nan, np.float32)
    for start in range(0, layers.shape[1], CELLS_AT_ONCE):
        index = np.arange(start, min(start + CELLS_AT_ONCE, layers.shape[1]))
        local = np.column_stack(to_local.transform(x[index % x.size], y[index // x.size]))
        inside = inside_field(soil_map, local)
        if inside.any():
            bands = soil_map.evaluate(local[inside])
            layers[:, index[inside]] = np.stack([getattr(bands, name) for name in names])
    return layers.reshape(len(names), y.size, x.size)
