# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One band of a raster file, warped to square cells in the plane of a field."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, did_you_mean

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

Array = NDArray[np.float64]

USUAL_NODATA = (-9999.0, -99999.0, -32768.0)
"""Values that mean a gap by convention, where a file does not declare one."""
KINDS = (
    "GTiff", "AAIGrid", "BMP", "COG", "DTED", "EHdr", "ENVI", "GPKG", "GRASSASCIIGrid", "GRIB", "GS7BG", "GSAG",
    "GSBG", "HDF5", "HDF5Image", "JP2OpenJPEG", "JPEG", "MBTiles", "PCRaster", "PNG", "RST", "SAGA", "SRTMHGT",
    "USGSDEM", "WEBP", "XYZ", "netCDF",
)  # fmt: skip
"""Formats, by their names in GDAL, that hold their own pixels. Others (VRT, WMS, tile indices) name files or
addresses, which GDAL would read, whatever the ending of their own name is."""
MAX_VALUE = 1e30
"""Magnitude from which a value is a gap, as -3.4e38 and infinity are."""


class RasterBands:
    """The bands of an open raster file.

    :param path: the file
    :param source: the opened file
    :raises InputError: if it has no reference system, or no place

    Attributes
    ----------
    names : list[str]
        descriptions of the bands, empty for a band without one
    """

    def __init__(self, path: Path, source: DatasetReader) -> None:
        self.path, self._source = path, source
        if source.crs is None or source.transform.is_identity:
            raise InputError(
                "has no coordinate reference system (CRS) or no place",
                "assign it in a GIS, or with 'gdal_edit.py -a_srs EPSG:... FILE'",
                path,
            )
        self.names = [name or "" for name in source.descriptions]

    def number(self, band: str) -> int:
        """Number of a band, from 1.

        :param band: its number or name; empty for the first
        :raises InputError: if there is none
        """
        if not band:
            return 1
        if band in self.names:
            return self.names.index(band) + 1
        count = len(self.names)
        if band.isdecimal() and 1 <= int(band) <= count:
            return int(band)
        named = [name for name in self.names if name]
        known = f"1 to {count}" if count > 1 else "1"
        known += f", or {', '.join(named)}" if named else ""
        raise InputError(f"has no band {band!r}", f"use one of: {known}{did_you_mean(band, named)}", self.path)

    def pixel_m(self, frame: LocalFrame) -> float:
        """Longer side of a pixel at the datum of a field [m]."""
        from pyproj import CRS, Transformer

        to_source = Transformer.from_crs(frame.crs, CRS.from_wkt(self._source.crs.to_wkt()), always_xy=True)
        east, north = to_source.transform([0.0, 100.0, 0.0], [0.0, 0.0, 100.0])
        grid = ~self._source.transform
        east, north = np.array(east), np.array(north)
        pixels = np.array([grid.a * east + grid.b * north, grid.d * east + grid.e * north])
        moved = np.hypot(*(pixels[:, 1:] - pixels[:, :1]))  # by 100 m to the east, and to the north
        return float(100.0 / max(moved.min(), 1e-9)) if np.isfinite(moved).all() else math.inf

    def outline(self, frame: LocalFrame) -> Array:
        """Places along the raster in the plane of a field, shape (k, 2) [m]; none on the earth's other side."""
        from pyproj import CRS, Transformer

        there = Transformer.from_crs(CRS.from_wkt(self._source.crs.to_wkt()), frame.crs, always_xy=True)
        shares = np.linspace(0.0, 1.0, 5)
        columns, rows = np.meshgrid(shares * self._source.width, shares * self._source.height)
        x, y = self._source.transform @ (columns.ravel(), rows.ravel())
        corners = np.column_stack(there.transform(x, y))
        return np.asarray(corners[np.isfinite(corners).all(axis=1)])

    def on(self, number: int, frame: LocalFrame, x_m: Array, y_m: Array) -> Array:
        """A band at square cells, NaN where it has no value, shape (ny, nx).

        Interpolated linearly; where its pixels are smaller than the cells, averaged over them. Where the file does
        not declare a value for gaps, the usual ones are gaps.

        :param number: number of the band, from 1
        :param frame: plane of the field
        :param x_m: centres of the columns, ascending, evenly spaced [m]
        :param y_m: centres of the rows, ascending, with the same spacing [m]
        """
        nodata = self._source.nodatavals[number - 1]
        values = self._warped(number, frame, x_m, y_m, nodata)
        if nodata is None and (gaps := [usual for usual in USUAL_NODATA if (values == usual).any()]):
            values = self._warped(number, frame, x_m, y_m, gaps[0])
        values[~(np.abs(values) < MAX_VALUE)] = np.nan
        scale, offset = self._source.scales[number - 1], self._source.offsets[number - 1]
        return values * float(scale) + float(offset)

    def _warped(self, number: int, frame: LocalFrame, x_m: Array, y_m: Array, nodata: float | None) -> Array:
        """A band as it is stored, at square cells."""
        import rasterio
        from rasterio.transform import Affine
        from rasterio.warp import Resampling, reproject

        step = (x_m[-1] - x_m[0]) / (len(x_m) - 1) if len(x_m) > 1 else (y_m[-1] - y_m[0]) / max(len(y_m) - 1, 1)
        values = np.full((len(y_m), len(x_m)), np.nan)
        corner = Affine(step, 0.0, x_m[0] - step / 2, 0.0, step, y_m[0] - step / 2)
        try:
            reproject(
                rasterio.band(self._source, number),
                values,
                src_nodata=nodata,
                dst_transform=corner,
                dst_crs=frame.crs.to_wkt(),
                dst_nodata=np.nan,
                resampling=Resampling.bilinear,
                init_dest_nodata=True,
                tolerance=0.01,
            )
        except Exception as error:  # the errors of GDAL have no common public base
            raise InputError(
                f"cannot be moved to the field: {error}", "export it again from a GIS", self.path
            ) from None
        return values


@contextmanager
def opened_raster(path: Path, remedy: str = "give a GeoTIFF") -> Iterator[DatasetReader]:
    """Open a raster file, with or without a place.

    :param path: the file
    :param remedy: what to do about a file that cannot be read
    :raises InputError: if GDAL, PROJ or rasterio refuse the file, now or while it is open, or its format is not in
        :data:`KINDS`
    """
    import rasterio
    from pyproj.exceptions import ProjError
    from rasterio.io import DatasetReader

    errors = rasterio.errors
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", errors.NotGeoreferencedWarning)
            with rasterio.Env(), DatasetReader(str(path), driver=list(KINDS)) as source:
                if source.transform.is_degenerate:
                    raise InputError("has pixels without an area", remedy, path)
                yield source
    except (errors.RasterioError, errors.CRSError, ProjError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read as a raster: {error!s:.200}", remedy, path) from None
