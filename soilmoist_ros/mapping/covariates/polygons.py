# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Polygons of a soil map: a column of zeros and ones for each class but one, or a number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, did_you_mean, listing, optional_module

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

BEGINNINGS = {
    ".gpkg": b"SQLite format 3\0",
    ".shp": b"\0\0\x27\x0a",
    ".fgb": b"fgb",
    ".geojson": b"{",
    ".json": b"{",
}
"""First bytes of files that hold polygons, by their endings. GDAL looks at contents alone: a file that is
something else may name other files or addresses, which it would read."""
_PIPELINE = b"gdal_streamed_alg"
"""Type of JSON that names what GDAL shall read and do."""
REMEDY = "give GeoJSON or GeoPackage"
MAX_CLASSES = 8
"""Classes up to which each has a column of its own; the rarer ones are taken together."""
MIN_SHARE = 0.02
"""Share of the field below which a class is taken together with other rare ones."""
OTHER = "other"


def read_polygons(path: Path, attribute: str, frame: LocalFrame, xy: Array) -> NDArray[Any]:
    """An attribute of the polygons at places: texts, or numbers.

    :param path: vector file in any reference system
    :param attribute: name of the attribute; empty for the only one
    :param frame: plane of the field
    :param xy: places, shape (n, 2) [m]
    :returns: shape (n,); ``None`` or NaN outside all polygons. Whole numbers are texts, as codes of classes are
    :raises InputError: if the file cannot be read, has no such attribute, no polygon or no reference system
    """
    import shapely

    with readable_vector(path):
        shapes, values = _read(path, attribute, frame)
    place, polygon = shapely.STRtree(shapes).query(shapely.points(xy), predicate="intersects")
    # Where polygons overlap, the first one of the file counts; the tree returns them in any order.
    order = np.lexsort((polygon, place))
    place, polygon = place[order], polygon[order]
    first, index = np.unique(place, return_index=True)
    found = np.full(len(xy), np.nan if values.dtype.kind == "f" else None, values.dtype)
    found[first] = values[polygon[index]]
    return found


def attributes(path: Path) -> list[str]:
    """Names of the attributes in a vector file.

    :raises InputError: if the file cannot be read
    """
    with readable_vector(path):
        return list(map(str, optional_module("pyogrio").read_info(path)["fields"].tolist()))


def outline_of_polygons(path: Path, frame: LocalFrame) -> Array:
    """Corners of the box about all polygons, in the plane of a field, shape (k, 2) [m]."""
    from pyproj import CRS, Transformer

    with readable_vector(path):
        about = optional_module("pyogrio").read_info(path, force_total_bounds=True)
        _require_crs(path, about)
        west, south, east, north = about["total_bounds"]
        there = Transformer.from_crs(CRS.from_user_input(about["crs"]), frame.crs, always_xy=True)
        corners = np.column_stack(there.transform([west, east, east, west], [south, south, north, north]))
    return np.asarray(corners[np.isfinite(corners).all(axis=1)])


def require_polygons(path: Path, attribute: str) -> None:
    """Check a vector file before long work: that it can be opened, and has a reference system and the attribute.

    :raises InputError: as :func:`read_polygons`
    """
    with readable_vector(path):
        about = optional_module("pyogrio").read_info(path)
    _require_crs(path, about)
    _attribute(path, about["fields"].tolist(), attribute)


@contextmanager
def readable_vector(path: Path, remedy: str = REMEDY) -> Iterator[None]:
    """Turn the errors of a library that refuses a vector file into errors of the input.

    :param remedy: what the user can do
    """
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
        reason = f"cannot be read as polygons: {error!s:.200}"
        raise InputError(reason, remedy, path) from None


def _require_crs(path: Path, about: Mapping[str, Any]) -> None:
    if about["crs"] is None:
        raise InputError("has no coordinate reference system (CRS)", "export it again, with its CRS", path)


def _read(path: Path, attribute: str, frame: LocalFrame) -> tuple[list[BaseGeometry], NDArray[Any]]:
    import shapely
    from pyproj import CRS, Transformer

    about, _, geometries, columns = optional_module("pyogrio").raw.read(path)
    _require_crs(path, about)
    values = _column(path, dict(zip(about["fields"].tolist(), columns, strict=True)), attribute)
    there = Transformer.from_crs(CRS.from_user_input(about["crs"]), frame.crs, always_xy=True)

    def moved(xy: Array) -> Array:
        return np.column_stack(there.transform(xy[:, 0], xy[:, 1]))

    shapes = shapely.from_wkb(geometries, on_invalid="ignore") if geometries is not None else np.array([])
    area = np.isin(shapely.get_type_id(shapes), (3, 6))  # polygons, alone or several
    if not area.any():
        raise InputError("has no polygons", "give the polygons of a soil map, or a raster", path)
    return [shapely.make_valid(shapely.transform(one, moved)) for one in shapes[area]], values[area]


def _attribute(path: Path, names: Sequence[str], attribute: str) -> str:
    """The attribute that is meant.

    :raises InputError: if there is none of this name, or none is given and there are several
    """
    if not attribute and len(names) != 1:
        known = listing(names) or "none"
        remedy = "name one as band: FILE:ATTRIBUTE" if names else "give each polygon its class"
        raise InputError(f"does not say which attribute is meant: it has {known}", remedy, path)
    if attribute and attribute not in names:
        remedy = f"use one of: {listing(names)}{did_you_mean(attribute, names)}"
        raise InputError(f"has no attribute {attribute!r}", remedy, path)
    return attribute or names[0]


def _column(path: Path, columns: Mapping[str, NDArray[Any]], attribute: str) -> NDArray[Any]:
    """Values of an attribute; whole numbers as texts."""
    values = columns[_attribute(path, list(columns), attribute)]
    if values.dtype.kind == "f":
        return values.astype(float)
    return np.array([None if one is None else str(one) for one in values.tolist()], object)


def indicators(values: NDArray[Any], inside: NDArray[np.bool_]) -> dict[str, Array]:
    """Columns of zeros and ones, one for each class but the most common one, which the mean of the map stands for.

    :param values: classes, ``None`` where they are unknown, shape (n,)
    :param inside: places in the field, by which the classes are counted, shape (n,)
    :returns: class -> column, NaN where the class is unknown; empty if the field has a single class
    """
    known = np.array([one is not None for one in values], bool)
    names, counts = np.unique(values[known & inside].astype(str), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    names, counts = names[order], counts[order]
    kept = [
        str(name)
        for number, (name, count) in enumerate(zip(names, counts, strict=True))
        if number < MAX_CLASSES and count >= MIN_SHARE * counts.sum()
    ]
    pooled = len(names) > len(kept)
    texts = values.astype(str)
    columns = {name: np.where(known, texts == name, np.nan) for name in kept[1:]}
    if pooled:
        columns[OTHER] = np.where(known, ~np.isin(texts, kept), np.nan)
    return columns
