# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layers of points, lines and polygons, written by GDAL (pyogrio)."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import LocalFrame, optional_module

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely.geometry.base import BaseGeometry

_UTC = 100
"""GDAL's flag of a time in UTC."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Shapes of one kind with their columns.

    :param name: name of the layer
    :param kind: ``Point``, ``LineString``, ``Polygon`` or ``MultiPolygon``; empty for a table without shapes
    :param shapes: shapes in the plane of the field [m], one for each row
    :param columns: name -> one value for each row; times are ``datetime64[ms]`` in UTC, dates ``datetime64[D]``
    :param description: a sentence for readers
    :param style: style of QGIS as QML, empty for none
    """

    name: str
    kind: str
    shapes: Sequence[BaseGeometry]
    columns: Mapping[str, NDArray[Any]]
    description: str = ""
    style: str = ""


def times(stamps_s: ArrayLike) -> NDArray[np.datetime64]:
    """Stamps [s since 1970-01-01 UTC] as times; no time for NaN."""
    stamps = np.asarray(stamps_s, float)
    whole = np.where(np.isfinite(stamps), np.round(np.nan_to_num(stamps) * 1000), 0).astype("int64")
    return np.where(np.isfinite(stamps), whole.astype("datetime64[ms]"), np.datetime64("NaT", "ms"))


def texts(values: Sequence[str]) -> NDArray[Any]:
    """A column of text."""
    return np.array(list(values), dtype=object)


def to_crs(shapes: Sequence[BaseGeometry], frame: LocalFrame, crs: CRS) -> NDArray[Any]:
    """Shapes of the plane of a field in another reference system; exteriors counter-clockwise.

    Longitudes are continuous about the datum, and may exceed +-180 where a field lies on the antimeridian.
    """
    from pyproj import Transformer
    from shapely import transform

    from soilmoist_ros.reporting.geometry import right_handed

    there = Transformer.from_crs(frame.crs, crs, always_xy=True)

    def moved(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = there.transform(xy[:, 0], xy[:, 1])
        if crs.is_geographic:
            x = frame.longitude_deg + (np.asarray(x) - frame.longitude_deg + 180) % 360 - 180
        return np.column_stack([x, y])

    several = np.empty(len(shapes), object)
    several[:] = shapes
    several = np.asarray(transform(several, moved), object)
    several[:] = [right_handed(shape) for shape in several]
    return several


def write_layers(
    path: Path, layers: Sequence[Layer], frame: LocalFrame, crs: CRS, driver: str, options: Mapping[str, str]
) -> Path:
    """Write layers into one file.

    :param path: file; replaced
    :param layers: at least one
    :param frame: plane of the shapes
    :param crs: reference system of the file
    :param driver: name of GDAL's driver, such as ``GPKG``
    :param options: options of the file for the driver
    :returns: ``path``
    :raises InputError: if pyogrio is not installed; states how to install it
    """
    from shapely import to_wkb

    raw = optional_module("pyogrio.raw")
    configure = optional_module("pyogrio").set_gdal_config_options
    path.unlink(missing_ok=True)
    # One sync of the whole file follows; a sync for each step takes seconds on a busy disk.
    configure({"OGR_SQLITE_SYNCHRONOUS": "OFF"})
    for number, layer in enumerate(layers):
        table = not layer.kind
        stamped = [name for name, column in layer.columns.items() if column.dtype == np.dtype("datetime64[ms]")]
        describe = driver == "GPKG" and layer.description
        raw.write(
            path,
            None if table else to_wkb(to_crs(layer.shapes, frame, crs)),
            list(layer.columns.values()),
            list(layer.columns),
            layer=layer.name,
            driver=driver,
            geometry_type=None if table else layer.kind,
            crs=None if table else crs.to_wkt(),
            append=number > 0,
            dataset_options=dict(options) or None,
            layer_options={"DESCRIPTION": layer.description} if describe else None,
            gdal_tz_offsets={name: np.full(len(layer.columns[name]), _UTC) for name in stamped},
        )
    return path


def write_shapefile(path: Path, layer: Layer, frame: LocalFrame) -> Path:
    """Write a layer as a zipped shapefile in WGS-84, the form that farm terminals read.

    Names of columns have at most ten ASCII characters.

    :raises InputError: if pyogrio is not installed
    """
    from pyproj import CRS

    workshop = Path(tempfile.mkdtemp(prefix=".writing-", dir=path.parent))
    try:
        write_layers(workshop / f"{path.stem}.shp", [layer], frame, CRS.from_epsg(4326), "ESRI Shapefile", {})
        with zipfile.ZipFile(workshop / "whole", "w", zipfile.ZIP_DEFLATED) as archive:
            for part in sorted(workshop.glob(f"{path.stem}.*")):
                archive.write(part, part.name)
        (workshop / "whole").replace(path)
    finally:
        shutil.rmtree(workshop, ignore_errors=True)
    return path
