# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files with covariates: bands of rasters, polygons of soil maps, and the form of the ground by its elevations.

Rasters of elevations have square cells, rows from south to north, and NaN where nothing is known. A neighbour
without a value is extrapolated from the opposite one, so that a plane has its slope up to its edge.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, did_you_mean, listing, optional_module

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
FEET_M = {"us": 0.3048006096012192, "": 0.3048}
UNITS_M = {"m": 1.0, "metre": 1.0, "dm": 0.1, "cm": 0.01, "centimetre": 0.01, "mm": 0.001}
MAX_VALUE = 1e30  # magnitude from which a value is a gap, as -3.4e38 and infinity are
BEGINNINGS = {
    ".gpkg": b"SQLite format 3\0",
    ".shp": b"\0\0\x27\x0a",
    ".fgb": b"fgb",
    ".geojson": b"{",
    ".json": b"{",
}
"""First bytes of files that hold polygons, by their endings. GDAL looks at contents alone: a file that is
something else may name other files or addresses, which it would read."""
_PIPELINE = b"gdal_streamed_alg"  # type of JSON that names what GDAL shall read and do
REMEDY = "give GeoJSON or GeoPackage"
MAX_CLASSES = 8  # number of classes with one column each; rarer classes share one
MIN_SHARE = 0.02  # share of the field below which a class is taken together with other rare ones
OTHER = "other"
NEIGHBOURS: tuple[Offset, ...] = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""Steps to the eight neighbours: rows to the north, columns to the east."""


class RasterBands:
    """The bands of an open raster file.

    :raises InputError: if it has no reference system, or no place
    """

    def __init__(self, path: Path, source: DatasetReader) -> None:
        self.path, self._source = path, source
        if source.crs is None or source.transform.is_identity:
            raise InputError(
                "has no coordinate reference system (CRS) or no place",
                "assign it in a GIS, or with 'gdal_edit.py -a_srs EPSG:... FILE'",
                path,
            )
        self.names = [name or "" for name in source.descriptions]  # empty for a band without one

    def number(self, band: str) -> int:
        """Number of a band, from 1."""
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
        east, north = map(np.array, to_source.transform([0.0, 100.0, 0.0], [0.0, 0.0, 100.0]))
        grid = ~self._source.transform
        pixels = np.array([grid.a * east + grid.b * north, grid.d * east + grid.e * north])
        moved = np.hypot(*(pixels[:, 1:] - pixels[:, :1]))  # by 100 m to the east, and to the north
        return float(100.0 / max(moved.min(), 1e-9)) if np.isfinite(moved).all() else math.inf

    def on(self, number: int, frame: LocalFrame, x_m: Array, y_m: Array) -> Array:
        """A band at square cells, NaN where it has no value, shape (ny, nx).

        Interpolated linearly; where its pixels are smaller than the cells, averaged over them. Where the file does
        not declare a value for gaps, the usual ones are gaps.
        """
        nodata = self._source.nodatavals[number - 1]
        values = self._warped(number, frame, x_m, y_m, nodata)
        if nodata is None and (gaps := [usual for usual in USUAL_NODATA if (values == usual).any()]):
            values = self._warped(number, frame, x_m, y_m, gaps[0])
        values[~(np.abs(values) < MAX_VALUE)] = np.nan
        scale, offset = self.scale(number)
        return values * scale + offset

    def scale(self, number: int) -> tuple[float, float]:
        """Factor and offset from what is stored of a band to its values."""
        return float(self._source.scales[number - 1]), float(self._source.offsets[number - 1])

    def stored(self, number: int, frame: LocalFrame, x_m: Array, y_m: Array) -> Array:
        """The pixels of a band next to square cells, as they are stored; NaN where it declares none."""
        return self._warped(number, frame, x_m, y_m, self._source.nodatavals[number - 1], nearest=True)

    def unit(self, number: int) -> tuple[float, str]:
        """Unit of a band of elevations [m], NaN if it is not known, and its name, empty if the file has none."""
        from pyproj import CRS

        name = self._source.units[number - 1] or ""
        if not name:
            axes = CRS.from_wkt(self._source.crs.to_wkt()).axis_info
            up = [(float(axis.unit_conversion_factor), axis.unit_name) for axis in axes if axis.direction == "up"]
            feet = next((axis.unit_name for axis in axes if "foot" in axis.unit_name), "")
            return up[0] if up else (math.nan, f"{feet} of places") if feet else (1.0, "")
        letters = re.sub("[^a-z]", "", name.lower()).replace("meter", "metre").removesuffix("s")
        if re.search("ft|foot|feet", letters):
            return FEET_M["us" if "us" in letters else ""], name
        return UNITS_M.get(letters, math.nan), name

    def slopes_by_name(self, number: int) -> str:
        """Text of a file by which a band has slopes, not elevations; empty if there is none."""
        unit, label = self._source.units[number - 1] or "", self._source.descriptions[number - 1] or ""
        tags = [*self._source.tags(number).values(), self._source.tags().get("TIFFTAG_IMAGEDESCRIPTION", "")]
        units = r"(?<![a-z])(deg|degrees?|per ?cent|pct)(?![a-z])|[%°]|m/m"
        said = [text for text in (unit, label) if re.search(units, text, re.IGNORECASE)]
        texts = (unit, label, *tags, self.path.stem)
        said += [text for text in texts if re.search("(?<![a-z])slopes?(?![a-z])", text, re.IGNORECASE)]
        return said[0] if said else ""

    def _warped(
        self, number: int, frame: LocalFrame, x_m: Array, y_m: Array, nodata: float | None, nearest: bool = False
    ) -> Array:
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
                resampling=Resampling.nearest if nearest else Resampling.bilinear,
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
    except (errors.RasterioError, errors.RasterioIOError, errors.CRSError, ProjError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read as a raster: {error!s:.200}", remedy, path) from None


# -- Polygons of a soil map ----------------------------------------------------------------------------------


def read_polygons(path: Path, attribute: str, frame: LocalFrame, xy: Array) -> NDArray[Any]:
    """An attribute of the polygons at places: numbers or texts, as codes of classes are; shape (n,).

    ``None`` or NaN outside all polygons; ``InputError`` without such an attribute, polygon or reference system.
    """
    import shapely
    from pyproj import CRS, Transformer

    name = attribute_of(path, attribute)[0]
    with readable_vector(path):
        about, _, geometries, (values,) = optional_module("pyogrio").raw.read(path, columns=[name])
        shapes = shapely.from_wkb(geometries, on_invalid="ignore") if geometries is not None else np.array([])
        there = Transformer.from_crs(CRS.from_user_input(about["crs"]), frame.crs, always_xy=True)
        area = np.isin(shapely.get_type_id(shapes), (3, 6))  # polygons, alone or several
        if not area.any():
            raise InputError("has no polygons", "give the polygons of a soil map, or a raster", path)
        moved = shapely.transform(shapes[area], lambda xy: np.column_stack(there.transform(xy[:, 0], xy[:, 1])))
        tree = shapely.STRtree(shapely.make_valid(moved))
    if values.dtype.kind == "f":
        values = values.astype(float)
    else:
        values = np.array([None if one is None else str(one) for one in values.tolist()], object)
    place, polygon = tree.query(shapely.points(xy), predicate="intersects")
    # Where polygons overlap, the first one of the file counts; the tree returns them in any order.
    order = np.lexsort((polygon, place))
    place, polygon = place[order], polygon[order]
    first, index = np.unique(place, return_index=True)
    found = np.full(len(xy), np.nan if values.dtype.kind == "f" else None, values.dtype)
    found[first] = values[area][polygon[index]]
    return found


def attribute_of(path: Path, attribute: str) -> tuple[str, list[str]]:
    """The attribute of a vector file that is meant, and all of them; ``InputError`` if that is not clear."""
    with readable_vector(path):
        about = optional_module("pyogrio").read_info(path)
    names = list(map(str, about["fields"].tolist()))
    if about["crs"] is None:
        raise InputError("has no coordinate reference system (CRS)", "export it again, with its CRS", path)
    if not attribute and len(names) != 1:
        remedy = "name one as band: FILE:ATTRIBUTE" if names else "give each polygon its class"
        known = listing(names) or "none"
        raise InputError(f"does not say which attribute is meant: it has {known}", remedy, path)
    if attribute and attribute not in names:
        remedy = f"use one of: {listing(names)}{did_you_mean(attribute, names)}"
        raise InputError(f"has no attribute {attribute!r}", remedy, path)
    return attribute or names[0], names


@contextmanager
def readable_vector(path: Path, remedy: str = REMEDY) -> Iterator[None]:
    """Turn the errors of a library that refuses a vector file into errors of the input."""
    import shapely
    from pyproj.exceptions import ProjError

    failed = optional_module("pyogrio").errors
    errors = (failed.DataSourceError, failed.DataLayerError, shapely.errors.ShapelyError, ProjError, OSError)
    try:
        with path.open("rb") as stream:
            head = stream.read(65536).removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
        if not head.startswith(BEGINNINGS[path.suffix.lower()]) or _PIPELINE in head:
            raise InputError("cannot be read as polygons: its content is something else", remedy, path)
        yield
    except (*errors, UnicodeDecodeError, UnboundLocalError) as error:  # the last: pyogrio, for a damaged .prj
        raise InputError(f"cannot be read as polygons: {error!s:.200}", remedy, path) from None


def indicators(values: NDArray[Any], inside: NDArray[np.bool_]) -> dict[str, Array]:
    """Columns of zeros and ones, one for each class but the most common one, which the mean of the map stands for.

    :returns: class -> column, NaN where the class is unknown; empty if the field has a single class
    """
    known = np.array([one is not None for one in values], bool)
    texts = values.astype(str)
    names, counts = np.unique(texts[known & inside], return_counts=True)
    order = np.argsort(-counts, kind="stable")[:MAX_CLASSES]
    kept = names[order[counts[order] >= MIN_SHARE * counts.sum()]].tolist()
    columns = {name: np.where(known, texts == name, np.nan) for name in kept[1:]}
    if len(names) > len(kept):
        columns[OTHER] = np.where(known, ~np.isin(texts, kept), np.nan)
    return columns


# -- Elevations ----------------------------------------------------------------------------------------------

Offset = tuple[int, int]


def derivatives(elevation_m: Array, step_m: float) -> dict[str, Array]:
    """Everything that is derived from elevations, by its name.

    * slope: tangent of the steepest slope [m/m], by the third-order finite differences of Horn (1981), Proc. IEEE
      69:14-47
    * northness, eastness: components of the unit normal of the surface, > 0 where it faces north or east [-]
    * curvature: minus twice (D + E) of Zevenbergen and Thorne (1987) [1/m], > 0 on crests, < 0 in hollows
    """
    at = _around(elevation_m)
    east, north = _gradient(at, step_m)
    slope = np.hypot(east, north)
    length = np.sqrt(1 + slope**2)
    laplacian = (at[0, 1] + at[0, -1] + at[1, 0] + at[-1, 0] - 4 * elevation_m) / step_m**2
    return {
        "elevation": elevation_m,
        "slope": slope,
        "northness": -north / length,
        "eastness": -east / length,
        "curvature": -laplacian,
    }


def _gradient(at: Mapping[Offset, Array], step_m: float) -> tuple[Array, Array]:
    east = (at[1, 1] + 2 * at[0, 1] + at[-1, 1]) - (at[1, -1] + 2 * at[0, -1] + at[-1, -1])
    north = (at[1, 1] + 2 * at[1, 0] + at[1, -1]) - (at[-1, 1] + 2 * at[-1, 0] + at[-1, -1])
    return east / (8 * step_m), north / (8 * step_m)


def horn_slope(elevation_m: Array, step_m: float) -> Array:
    """The ``slope`` of :func:`derivatives` alone [m/m]."""
    return np.hypot(*_gradient(_around(elevation_m), step_m))


def _around(values: Array) -> Mapping[Offset, Array]:
    """The eight neighbours of every cell; a missing one is extrapolated from the others, or the cell itself."""
    padded, (rows, columns) = np.pad(values, 1, constant_values=np.nan), values.shape
    near = {(up, right): padded[1 + up :, 1 + right :][:rows, :columns] for up, right in NEIGHBOURS}
    found = {}
    for row, column in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        there = np.where(np.isnan(near[row, column]), 2 * values - near[-row, -column], near[row, column])
        found[row, column] = np.where(np.isnan(there), values, there)
    for row, column in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        there = found[row, 0] + found[0, column] - values
        found[row, column] = np.where(np.isnan(near[row, column]), there, near[row, column])
    return found
