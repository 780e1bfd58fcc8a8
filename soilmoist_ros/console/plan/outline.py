# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The outline of a field from a file of strangers: GeoJSON, KML, KMZ, or a shapefile in a zip."""

from __future__ import annotations

import base64
import io
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.plain_values import read_json

MAX_CORNERS: Final = 2000
"""Corners of an outline; one with more is simplified."""
MAX_READ: Final = 200_000
"""Corners of all polygons of a file."""
MAX_UNPACKED: Final = 50_000_000
"""Bytes of the files in an archive."""
MAX_MEMBERS: Final = 200
MAX_AREAS: Final = 200
"""No-go areas of a field."""
_SHAPEFILE: Final = struct.pack(">i", 9994)
"""First bytes of a shapefile."""
_PARTS: Final = (".shp", ".shx", ".dbf", ".prj", ".cpg")
_WGS84: Final = "EPSG:4326"

Found = Iterator[tuple[Any, str]]
"""Polygons, each with the reference system of its coordinates."""


def outline(given: Mapping[str, Any]) -> dict[str, Any]:
    """Boundary and no-go areas of a file in metres about a datum: its largest polygon, and the holes in it.

    :param given: ``name`` of the file, ``content`` (base64), ``datum`` [latitude, longitude] or nothing
    :returns: ``boundary``, ``no_go``, ``datum``; ``note``: what was left out, in words
    :raises InputError: if the file has no polygon that can be read
    """
    import numpy as np
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    from soilmoist_ros.foundation.geodesy import LocalFrame

    name = str(given["name"])[:80]
    read = _READERS.get(Path(name).suffix.lower())
    if read is None:
        raise InputError(f"{name} cannot be read", f"choose one of: {', '.join(_READERS)}")
    try:
        polygons = [one for one in read(base64.b64decode(given["content"], validate=True)) if one[0].area > 0]
    except InputError:
        raise
    except Exception as error:  # GDAL and damaged files have many
        raise InputError(f"{name} cannot be read: {error!s:.200}", "export one polygon again") from None
    if not polygons:
        raise InputError(f"{name} has no polygon", "export the boundary as a polygon, or as a closed line")
    field, system = max(polygons, key=lambda one: float(one[0].area))
    rings = [np.asarray(ring.coords)[:-1, :2] for ring in (field.exterior, *field.interiors)]
    try:
        to_degrees = Transformer.from_crs(system, _WGS84, always_xy=True)
    except ProjError:
        raise InputError(f"the coordinates of {name} are of an unknown system", "export it in WGS 84") from None
    degrees = [np.column_stack(to_degrees.transform(ring[:, 0], ring[:, 1])) for ring in rings]
    if not all(np.all(np.isfinite(ring)) and np.all(np.abs(ring) <= (180, 90)) for ring in degrees):
        remedy = "export it in WGS 84 (longitude, latitude), or a shapefile with its .prj"
        raise InputError(f"{name} has coordinates that are no longitudes and latitudes", remedy)
    datum = given.get("datum") or np.round(degrees[0].mean(axis=0)[::-1], 7).tolist()
    frame = LocalFrame(float(datum[0]), float(datum[1]))
    local = [frame.to_local(ring[:, 1], ring[:, 0]) for ring in degrees[: MAX_AREAS + 1]]
    if not all(np.isfinite(ring).all() for ring in local):
        raise InputError(f"{name} lies on another side of the earth than the datum", "check the datum")
    metres = [_few_corners(ring) for ring in local]
    return {
        "boundary": metres[0],
        "no_go": [ring for ring in metres[1:] if len(ring) > 2],
        "datum": [float(value) for value in datum],
        "note": f"The largest of {len(polygons)} polygons was taken." if len(polygons) > 1 else "",
    }


def _few_corners(ring: Any) -> list[list[float]]:
    import shapely

    line, tolerance_m = shapely.LinearRing(ring), 0.05
    while len(line.coords) > MAX_CORNERS:
        line, tolerance_m = line.simplify(tolerance_m), 2 * tolerance_m
    return [[round(float(x_m), 2), round(float(y_m), 2)] for x_m, y_m in line.coords[:-1]]


def _geojson(content: bytes) -> Found:
    import shapely

    data = read_json(content)
    named = (data.get("crs") or {}).get("properties", {}).get("name")  # of old files; the standard has WGS 84
    system = str(named) if named else _WGS84
    features = data.get("features", [data]) if isinstance(data.get("features", []), list) else []
    corners = 0
    for feature in features[:MAX_READ]:
        shape = feature.get("geometry", feature) if isinstance(feature, dict) else None
        for part in shape.get("geometries", [shape]) if isinstance(shape, dict) else ():
            if part.get("type") not in ("Polygon", "MultiPolygon", "LineString"):
                continue
            found = shapely.geometry.shape(part)
            corners += _counted(found, corners)
            yield from ((polygon, system) for polygon in _polygons(found))


def _kml(content: bytes) -> Found:
    import shapely

    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise InputError("the KML file defines entities", "export it again")
    corners = 0
    root = ElementTree.fromstring(content)
    for element in root.iter():
        kind = _tag(element)
        if kind == "Polygon":
            outer = [_ring(ring) for ring in _below(element, "outerBoundaryIs")]
            inner = [_ring(ring) for ring in _below(element, "innerBoundaryIs")]
            found = shapely.Polygon(outer[0], inner) if outer else shapely.Polygon()
        elif kind == "LineString":
            found = shapely.LineString(_ring(element))
        else:
            continue
        corners += _counted(found, corners)
        yield from ((polygon, _WGS84) for polygon in _polygons(found))


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _below(element: ElementTree.Element, tag: str) -> list[ElementTree.Element]:
    return [one for one in element.iter() if _tag(one) == tag]


def _ring(element: ElementTree.Element) -> list[tuple[float, float]]:
    """Corners of the first coordinates below an element: longitude, latitude, and a height that is left out."""
    texts = [one.text or "" for one in _below(element, "coordinates")]
    places = (place.split(",") for place in (texts[0].split() if texts else ()))
    return [(float(place[0]), float(place[1])) for place in places]


def _zip(content: bytes) -> Found:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = [one for one in archive.infolist() if not one.filename.startswith("__MACOSX")]
        if len(members) > MAX_MEMBERS or sum(one.file_size for one in members) > MAX_UNPACKED:
            remedy = f"put one shapefile into it, {MAX_UNPACKED // 1_000_000} MB at most"
            raise InputError("the archive is too large", remedy)
        names = {one.filename.lower(): one for one in members}
        for name, member in names.items():
            if name.endswith(".kml"):
                yield from _kml(archive.read(member))
            elif name.endswith(".shp"):
                stem = name.removesuffix(".shp")
                parts = {part: names[stem + part] for part in _PARTS if stem + part in names}
                yield from _shapefile({part: archive.read(one) for part, one in parts.items()})


def _shapefile(parts: Mapping[str, bytes]) -> Found:
    """Polygons of a shapefile; its parts get names of our own, so that none can lead elsewhere."""
    import shapely

    from soilmoist_ros.foundation.lazy import optional_module

    pyogrio = optional_module("pyogrio")
    if not parts[".shp"].startswith(_SHAPEFILE):
        raise InputError("the shapefile is damaged", "export it again")
    with tempfile.TemporaryDirectory() as folder:
        for suffix, content in parts.items():
            Path(folder, f"outline{suffix}").write_bytes(content)
        meta, _, shapes, _ = pyogrio.raw.read(Path(folder, "outline.shp"), columns=[], max_features=MAX_READ)
    corners = 0
    for shape in shapely.from_wkb(shapes):
        corners += _counted(shape, corners)
        yield from ((polygon, meta["crs"] or _WGS84) for polygon in _polygons(shape))


def _counted(shape: Any, before: int) -> int:
    """Corners of a shape.

    :raises InputError: if there are too many with those before
    """
    import shapely

    count = int(shapely.get_num_coordinates(shape))
    if before + count > MAX_READ:
        raise InputError(f"the file has more than {MAX_READ} corners", "export the boundary alone, or simplify it")
    return count


def _polygons(shape: Any) -> list[Any]:
    """Polygons of a shape, and those that closed lines enclose."""
    import shapely

    parts = [] if shape is None else shapely.get_parts(shape)
    return [
        shapely.Polygon(part) if part.geom_type == "LineString" else part
        for part in parts
        if part.geom_type == "Polygon"
        or (part.geom_type == "LineString" and part.is_closed and len(part.coords) > 3)
    ]


_READERS: Final[Mapping[str, Callable[[bytes], Found]]] = {
    ".geojson": _geojson,
    ".json": _geojson,
    ".kml": _kml,
    ".kmz": _zip,
    ".zip": _zip,
}
