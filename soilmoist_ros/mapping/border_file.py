# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The border of a field in a file of another program: which of its shapes it is, and where it lies on the earth.

GeoJSON, KML, KMZ, GPX, WKT, ISOXML and OpenStreetMap files are read here. Shapefiles, GeoPackage and FlatGeobuf
need pyogrio, reference systems other than WGS-84 need pyproj (extra ``reports``).
"""

from __future__ import annotations

import math
import re
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import (
    InputError,
    did_you_mean,
    listing,
    optional_module,
    printable,
    read_json,
    read_limited,
)
from soilmoist_ros.mapping.covariate_files import readable_vector

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

WGS84 = "EPSG:4326"
VECTORS = (".shp", ".gpkg", ".fgb")
"""Formats that need pyogrio."""
FORMATS = (*VECTORS, ".geojson", ".json", ".kml", ".kmz", ".gpx", ".wkt", ".osm", ".xml", ".zip")
MAX_GAP_SHARE = 0.05
"""Distance between the ends of a line, as a share of its length, up to which it is a border that was walked."""
MAX_INSIDE_SHARE = 0.5
"""Share of a field from which on polygons inside it are rather its parts than no-go areas."""
MAX_EXTENT_DEG = 2.0
"""Extent from which on corners in degrees are rather metres [deg]."""
MAX_UNZIPPED_BYTES, MAX_MEMBERS = 100_000_000, 1000
"""Size and number of files in an archive beyond which it is refused."""
_SLIVER_M2 = 1.0
_MAX_SHARED = 0.1
"""Share of another polygon in the field from which it is rather an obstacle than a neighbour."""
_MIN_HOLE_M2 = 0.01
"""Area below which a hole is an error of the drawing [m^2]; a post has more."""
_NEAR_ORIGIN_M = 5000.0
"""Distance from the origin of a projection within which coordinates are rather metres from a datum [m]."""
_BEYOND_USE_DEG = 1.0
"""Distance from the area for which a reference system is made that is still plausible [deg]."""
_NAME_CRS = "name the system in the field file: border: {file: ..., crs: EPSG:...}"
_MAX_STATED_ERROR_M = 0.5
"""Error of a conversion to WGS-84 from which it is stated [m]."""
_NO_GO_OF_ISOXML = {"3": "water", "4": "building", "6": "obstacle"}
_USED_PROPERTIES = ("name", "Name", "NAME", "id", "ID", "fid", "OBJECTID", "FID")


@dataclass(frozen=True)
class BorderSource:
    """A file with the border of a field.

    :param path: the file
    :param layer: name of its layer; empty for the only one that has areas
    :param feature: number (from 1), or any property, of the feature that is the field; empty for the only one
    :param crs: reference system of a file that names none, such as ``EPSG:25832``; empty for WGS-84
    :param takes_largest: whether the largest of several polygons is the field, where people look at the result
    """

    path: Path
    layer: str = ""
    feature: str = ""
    crs: str = ""
    takes_largest: bool = False

    def read(self) -> Border:
        """Read the border of a field.

        :raises InputError: if the file cannot be read, or leaves open which of its shapes is the field, or where
            it is
        """
        return _read_border(self)


@dataclass(frozen=True)
class Border:
    """The border of a field.

    :param no_go: outlines of the areas inside that must not be entered, each of shape (k, 2) [deg]
    """

    outline: Array  # longitude and latitude, WGS-84, shape (k, 2), not closed [deg]
    no_go: tuple[Array, ...] = ()
    notes: tuple[str, ...] = ()  # what was decided on the way, and what of the file is not used, in words


@dataclass
class _Feature:
    """Shapes of a feature: polygons as rings, of which the first is the outer one, lines, and number of points."""

    properties: dict[str, str] = field(default_factory=dict)
    polygons: list[list[Array]] = field(default_factory=list)
    lines: list[Array] = field(default_factory=list)
    points: int = 0
    is_no_go: bool = False

    def label(self, number: int) -> str:
        """Name of the feature in messages."""
        name = next((self.properties[key] for key in _USED_PROPERTIES if self.properties.get(key)), "")
        return f"{name!r}" if name and not name.isdecimal() else f"feature {number}"


@dataclass
class _Content:
    """Features of a file, and the reference system that it states; empty if its format has none to state."""

    features: list[_Feature]
    crs: str = ""
    needs_crs: bool = False


def _read_border(source: BorderSource) -> Border:
    path = source.path
    suffix = path.suffix.lower()
    if suffix not in FORMATS and not read_limited(path).lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"{"):
        raise InputError(
            f"is not a file with a border: its name ends in {suffix or 'nothing'!r}",
            f"give a file of the kinds {', '.join(FORMATS)}",
            path,
        )
    if suffix in (*VECTORS, ".zip", ".kmz") and not path.exists():
        raise InputError("cannot be read: No such file or directory", "check its path in the field file", path)
    if source.layer and suffix not in VECTORS:
        raise InputError("has no layers", "remove 'layer'", path)
    try:
        content = _READERS.get(suffix, _vectors if suffix in VECTORS else _geojson)(source)
    except ElementTree.ParseError as error:
        raise InputError(f"is not valid XML: {error}", "export the border again", path) from None
    notes: list[str] = []
    _close_lines(content.features, notes, source)
    numbered = list(enumerate(content.features, start=1))
    if not any(feature.polygons for _, feature in numbered):
        raise _without_polygon(content.features, path)
    to_degrees = _conversion(content, source, notes)
    for _, feature in numbered:
        feature.polygons = [
            _outer_first([to_degrees(ring) for ring in rings], notes) for rings in feature.polygons
        ]
        for rings in feature.polygons:
            if not all(np.isfinite(ring).all() for ring in rings):
                raise InputError("has a corner that is no place on the earth", "export the border again", path)
    return _chosen(numbered, source, notes)


def _chosen(numbered: Sequence[tuple[int, _Feature]], source: BorderSource, notes: list[str]) -> Border:
    """The field among the polygons of a file; those inside it are no-go areas.

    :raises InputError: if the file leaves open which polygon is the field
    """
    from shapely import Polygon, make_valid

    path = source.path
    named = {number for number, one in numbered if not source.feature or _is_called(source.feature, number, one)}
    if not named:
        known = [feature.label(number).strip("'") for number, feature in numbered if feature.polygons]
        remedy = f"there are: {listing(known)}{did_you_mean(source.feature, known)}"
        raise InputError(f"has no feature {source.feature!r}", remedy, path)
    scale = _metres_per_degree([rings[0] for _, feature in numbered for rings in feature.polygons])
    areas: list[tuple[BaseGeometry, list[Array], int, bool]] = []
    labels = {number: feature.label(number) for number, feature in numbered}
    shared = {label for label, count in Counter(labels.values()).items() if count > 1}
    labels |= {number: f"{label} (feature {number})" for number, label in labels.items() if label in shared}
    slivers, seen = 0, set[tuple[float, ...]]()
    for number, feature in numbered:
        for rings in feature.polygons:
            if len(rings[0]) < 3:
                raise InputError(f"{feature.label(number)} has {len(rings[0])} corners", "export it again", path)
            shape = make_valid(Polygon(rings[0] * scale))
            if shape.area < _SLIVER_M2 and len(feature.polygons) > 1:
                slivers += 1
            elif (extent := tuple(np.round([shape.area, *shape.bounds], 3).tolist())) not in seen:
                seen.add(extent)
                mine = number in named and not feature.is_no_go
                areas.append((shape, rings, number, mine))
    candidates = [one for one in areas if one[3]]
    if not candidates:
        raise InputError("holds no polygon of a field", "export the border of the field as a polygon", path)
    if slivers:
        notes.append(f"{slivers} parts of less than {_SLIVER_M2:g} m2 are left out")
    outer, rings, chosen, _ = max(candidates, key=lambda one: one[0].area)
    label = labels[chosen]
    inside: list[tuple[BaseGeometry, list[Array], str]] = []
    apart: list[tuple[int, bool]] = []
    reach = outer.buffer(1e-3 * math.sqrt(outer.area))
    for shape, ring, number, mine in areas:
        if shape is outer:
            continue
        shared = shape.intersection(outer).area / max(shape.area, _MIN_HOLE_M2)
        obstacle = dict(numbered)[number].is_no_go and shared > 0
        if reach.contains(shape) or obstacle:
            inside.append((shape, ring, labels[number]))
        else:
            apart.append((number, mine))
            if shared > _MAX_SHARED:
                notes.append(
                    f"{labels[number]} lies in the field by {shared:.0%} and is not used: if it must not be "
                    "entered, list it under 'no_go_lonlat', or draw it on the page"
                )
    rivals = [number for number, mine in apart if mine]
    if rivals and not source.takes_largest:
        raise _several([chosen, *rivals], labels, source, dict(numbered))
    if rivals:
        notes.append(f"the largest of {len(rivals) + 1} polygons was taken")
    share = sum(shape.area for shape, *_ in inside) / outer.area
    if share > MAX_INSIDE_SHARE:
        raise InputError(
            f"holds {len(inside) + 1} polygons, and those inside {label} cover {share:.0%} of it: they may be "
            "zones of the field, or no-go areas",
            "export the border alone; cut a no-go area out, list it under 'no_go_lonlat', or draw it on the page",
            path,
        )
    for shape, _, name in inside:
        notes.append(f"{name}, {shape.area:.0f} m2 in the field, is a no-go area")
    if apart:
        others = dict.fromkeys(labels[number] for number, _ in apart)
        notes.append(f"not used, as they are not inside {label}: {listing(others)}")
    drawn = [labels[number] for number, feature in numbered if feature.lines or feature.points]
    if drawn:
        notes.append(
            f"lines and points are not used: {listing(drawn)}; draw what the robot must avoid as a polygon"
        )
    unused = Counter(key for _, feature in numbered for key in feature.properties if key not in _USED_PROPERTIES)
    if unused:
        notes.append(f"properties that say nothing about the border are not used: {listing(unused)}")
    holes = [
        ring for ring in rings[1:] if len(ring) >= 3 and make_valid(Polygon(ring * scale)).area >= _MIN_HOLE_M2
    ]
    if lost := len(rings) - 1 - len(holes):
        notes.append(f"{lost} {'hole' if lost == 1 else 'holes'} of less than {_MIN_HOLE_M2:g} m2 left out")
    filled = [name for _, ring, name in inside if len(ring) > 1]
    if filled:
        notes.append(f"holes of no-go areas are no-go, too: {listing(filled)}")
    return Border(rings[0], (*holes, *(ring[0] for _, ring, _ in inside)), tuple(notes))


def _several(
    numbers: Sequence[int], labels: Mapping[int, str], source: BorderSource, features: Mapping[int, _Feature]
) -> InputError:
    """The error of a file with several polygons that are apart; the first is the largest."""
    different = sorted(set(numbers))
    if len(different) == 1:
        return InputError(
            f"holds {len(numbers)} polygons that lie apart, all parts of {labels[different[0]]}",
            "a field is one polygon: export one part, and write a field file for each",
            source.path,
        )
    label = labels[numbers[0]]
    chosen = label if label.endswith("'") else str(numbers[0])
    what = "holds {} polygons, none of which holds the others"
    if source.feature:
        what = f"has {{}} polygons that {source.feature!r} fits, as number or property"
        others = {pair for number in set(numbers[1:]) for pair in _pairs(features[number])}
        chosen = next((repr(pair) for pair in _pairs(features[numbers[0]]) if pair not in others), chosen)
    return InputError(
        f"{what.format(len(numbers))}: {listing(labels[number] for number in different)}",
        f"say which is the field: border: {{file: {source.path.name}, feature: {chosen}}}",
        source.path,
    )


def _is_called(wanted: str, number: int, feature: _Feature) -> bool:
    return wanted in (str(number), *feature.properties.values(), *_pairs(feature))


def _pairs(feature: _Feature) -> list[str]:
    """Properties with their keys, as ``feature`` may name them."""
    return [f"{key}={value}" for key, value in feature.properties.items()]


def _close_lines(features: Iterable[_Feature], notes: list[str], source: BorderSource) -> None:
    """Make polygons of closed lines, in features of files without polygons.

    :raises InputError: if open lines go round all closed ones, which may then be ponds in a border in pieces
    """
    import shapely

    features = list(features)
    if any(feature.polygons for feature in features):
        return
    for number, feature in enumerate(features, start=1):
        for line in [line for line in feature.lines if len(line) > 3]:
            gap, length = math.dist(line[0], line[-1]), float(np.hypot(*np.diff(line, axis=0).T).sum())
            if gap <= MAX_GAP_SHARE * length:
                feature.lines.remove(line)
                feature.polygons.append([_open_ring(line)])
                said = f", though its ends are apart by about {gap / length:.0%} of its length" if gap else ""
                notes.append(f"the closed line of {feature.label(number)} is the border{said}")
    pieces = [line for feature in features for line in feature.lines if len(line) > 1]
    rings = [rings[0] for feature in features for rings in feature.polygons]
    if source.feature or not (pieces and rings):
        return
    around = shapely.MultiLineString(pieces).convex_hull
    if all(around.contains(shapely.MultiPoint(ring)) for ring in rings):
        raise InputError(
            f"has {len(pieces)} open lines around its closed one: is the border in pieces, and that a pond?",
            f"join the lines to a polygon, or say which is the field: {{file: {source.path.name}, feature: ...}}",
            source.path,
        )


def _without_polygon(features: Sequence[_Feature], path: Path) -> InputError:
    lines, points = sum(len(one.lines) for one in features), sum(one.points for one in features)
    if lines:
        return InputError(
            f"holds no polygon, but {lines} open {'line' if lines == 1 else 'lines'}",
            "close the line: its last corner is its first one; or export the border as a polygon",
            path,
        )
    if points:
        return InputError(
            f"holds no polygon, but {points} points: corners of a border, or places in a field",
            "list corners in order around the field under 'polygon_lonlat', or join them to a polygon in a GIS",
            path,
        )
    return InputError("holds no polygon and no line", "export the border of the field as a polygon", path)


def _conversion(content: _Content, source: BorderSource, notes: list[str]) -> Callable[[Array], Array]:
    """Function that converts corners of the file to longitude and latitude, and checks them.

    :raises InputError: if the reference system is unknown, or the corners are not in it
    """
    path, stated = source.path, content.crs
    corners = np.concatenate([ring for one in content.features for rings in one.polygons for ring in rings])
    if not np.isfinite(corners).all():
        raise InputError("has a corner that is not two finite numbers", "export the border again", path)
    if stated and source.crs and not _same_crs(stated, source.crs):
        raise InputError(
            f"is in {stated}, but the field file says crs: {source.crs}", "remove 'crs', or correct the file", path
        )
    crs = stated or source.crs
    if not crs and content.needs_crs:
        guess = "degrees, crs: EPSG:4326" if _in_degrees(corners) else "metres of a map projection such as UTM"
        raise InputError(
            f"has no reference system (CRS), and its corners, such as {_text(corners[0])}, look like {guess}",
            f"add the .prj file, or {_NAME_CRS}",
            path,
        )
    if crs and not _same_crs(crs, WGS84):
        return _converter(crs, corners, path, notes)
    if not _in_degrees(corners):
        first = corners[~_each_in_degrees(corners)][0]
        swapped = _in_degrees(corners[:, ::-1]) and not np.any(np.abs(corners[:, 1]) > 180)
        if swapped:
            remedy = "longitude comes first: swap the numbers of each corner"
        else:
            remedy = f"export it in WGS-84, or {_NAME_CRS}"
        hint = "" if swapped else ", but perhaps in metres of a map projection such as UTM"
        raise InputError(
            f"the corner {_text(first)} is not in degrees of longitude and latitude{hint}", remedy, path
        )
    extent = np.ptp(corners, axis=0)
    if extent.max() > MAX_EXTENT_DEG:
        raise InputError(
            f"the corners, such as {_text(corners[len(corners) // 2])}, would span {extent.max():g} degrees: they "
            "look like metres",
            "metres from a datum go to 'polygon', with 'datum'; metres of a projection need its crs: EPSG:...",
            path,
        )
    return lambda ring: np.column_stack([np.where(ring[:, 0] > 180, ring[:, 0] - 360, ring[:, 0]), ring[:, 1]])


def _converter(crs: str, corners: Array, path: Path, notes: list[str]) -> Callable[[Array], Array]:
    pyproj = optional_module("pyproj")
    try:
        system = pyproj.CRS.from_user_input(crs)
        # A ballpark conversion ignores the datum: a hundred metres or more, without a word.
        there = pyproj.Transformer.from_crs(system, WGS84, always_xy=True, allow_ballpark=False)
        place = there.transform(*corners[0])
        unit = system.axis_info[0].unit_name if system.axis_info else "metre"
    except pyproj.exceptions.ProjError as error:
        raise InputError(
            f"the reference system {crs!s:.80} cannot be converted to WGS-84: {error!s:.200}",
            "check its name, or export the border in WGS-84",
            path,
        ) from None
    name = f"{crs} ({system.name})" if system.name not in crs and len(crs) < 40 else system.name
    if system.is_projected and _in_degrees(corners) and np.ptp(corners, axis=0).max() < 1:
        raise InputError(
            f"is in {name}, whose unit is {unit}, but its corners, such as {_text(corners[0])}, look like degrees",
            "correct the reference system of the file: degrees of GNSS receivers are EPSG:4326",
            path,
        )
    area = system.area_of_use
    at_origin = system.is_projected and float(np.abs(corners).max()) < _NEAR_ORIGIN_M
    far = area is not None and np.isfinite(place).all() and not _is_near(place, area.bounds)
    if not np.isfinite(place).all() or far or at_origin:
        where = f"longitude {place[0]:.2f}, latitude {place[1]:.2f}" if np.isfinite(place).all() else "no place"
        use = (
            f", far from where it is used ({area.name.partition(chr(46))[0]})" if far and area is not None else ""
        )
        raise InputError(
            f"is in {name}, in which its corner {_text(corners[0])} is {where}{use}",
            "correct the reference system; metres from a datum go to 'polygon' in the field file, with 'datum'",
            path,
        )
    try:
        error_m = float(there.get_last_used_operation().accuracy)  # PROJ chooses one of several by the place
    except (AttributeError, pyproj.exceptions.ProjError):  # an older pyproj, or the only one
        error_m = float(there.accuracy)
    accuracy = f", known to {error_m:g} m" if error_m > _MAX_STATED_ERROR_M else ""
    notes.append(f"the corners were converted from {name} to WGS-84{accuracy}")
    return lambda ring: np.column_stack(there.transform(ring[:, 0], ring[:, 1]))


def _is_near(place: Sequence[float], bounds: Sequence[float]) -> bool:
    """True if a longitude and latitude are in the area for which a reference system is made, or next to it."""
    west, south, east, north = bounds
    width = (east - west) % 360 or 360.0
    across = (place[0] - west + _BEYOND_USE_DEG) % 360 <= width + 2 * _BEYOND_USE_DEG
    return across and south - _BEYOND_USE_DEG <= place[1] <= north + _BEYOND_USE_DEG


def _same_crs(one: str, other: str) -> bool:
    known = {"EPSG:4326", "CRS84", "4326", "WGS84"}
    urn = re.compile(r"^urn:ogc:def:crs:(EPSG|OGC):[\d.]*:", re.IGNORECASE)
    first, second = (urn.sub(r"\1:", name.strip()).upper().removeprefix("OGC:") for name in (one, other))
    if first == second or {first, second} <= known:
        return True
    if first.startswith("EPSG:") and second.startswith("EPSG:"):
        return False
    pyproj = optional_module("pyproj")
    try:
        return bool(pyproj.CRS(one).equals(pyproj.CRS(other), ignore_axis_order=True))
    except pyproj.exceptions.ProjError:
        return False


def _each_in_degrees(corners: Array) -> NDArray[np.bool_]:
    lon, lat = corners.T
    east = (lon <= 360) & bool(lon.min() >= 0)
    return np.asarray((np.abs(lat) <= 90) & ((np.abs(lon) <= 180) | east), bool)


def _in_degrees(corners: Array) -> bool:
    return bool(np.all(_each_in_degrees(corners)))


def _outer_first(rings: list[Array], notes: list[str]) -> list[Array]:
    """Rings of a polygon with the outer one first: not every program writes them so."""
    from shapely import MultiPoint, Polygon

    if len(rings) < 2 or any(len(ring) < 3 or not np.isfinite(ring).all() for ring in rings):
        return rings
    largest = max(rings, key=lambda ring: Polygon(ring).area)
    if largest is rings[0] or not Polygon(largest).is_valid or not Polygon(largest).covers(MultiPoint(rings[0])):
        return rings
    notes.append("a polygon has its outer ring after a hole: the ring that holds the hole is the border")
    return [largest, *(ring for ring in rings if ring is not largest)]


def _metres_per_degree(rings: Sequence[Array]) -> Array:
    latitude = float(np.median(np.concatenate(rings)[:, 1]))
    return np.array([111_320.0 * max(math.cos(math.radians(latitude)), 0.01), 110_574.0])


def _text(corner: Array) -> str:
    return f"({corner[0]:.10g}, {corner[1]:.10g})"


def _open_ring(ring: Array) -> Array:
    return ring[:-1] if len(ring) > 3 and np.array_equal(ring[0], ring[-1]) else ring


# Formats --------------------------------------------------------------------------------------------------------


def _texts(properties: Mapping[str, Any]) -> dict[str, str]:
    """Properties as texts, without the empty ones."""
    return {str(key): printable(str(one)) for key, one in properties.items() if one not in (None, "")}


def _corners(vertices: Any, path: Path) -> Array:
    """Corners of a ring or line; heights are left out.

    :raises InputError: if they are not numbers
    """
    try:
        ring = np.array([[float(number) for number in vertex[:2]] for vertex in vertices], float)
        if ring.ndim != 2 or ring.shape[1] != 2 or not np.isfinite(ring).all():
            raise ValueError
    except (TypeError, ValueError, KeyError, OverflowError):
        raise InputError(
            f"has a corner that is not two numbers: {vertices!s:.80}", "export the border again", path
        ) from None
    return ring


def _geojson(source: BorderSource) -> _Content:
    path = source.path
    try:
        content = read_json(read_limited(path, "check its path in the field file").decode("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"is not valid JSON: {error}", "export the border again as GeoJSON", path) from None
    kind = content.get("type") if isinstance(content, dict) else None
    if isinstance(content, dict) and "type" not in content and (found := content.get("values", [content])):
        deere = [one for one in found if isinstance(one, dict) and "multipolygons" in one]
        if deere:
            return _Content([_deere(one, path) for one in deere], WGS84)
    if kind == "Topology" or (isinstance(content, dict) and "spatialReference" in content):
        name = "TopoJSON" if kind == "Topology" else "Esri JSON"
        raise InputError(f"is {name}, not GeoJSON", "export the border as GeoJSON", path)
    features: list[_Feature] = []
    systems: list[str] = []  # of the file, or of its features or shapes, as databases write them

    def collect(node: Any, feature: _Feature | None) -> None:
        if not isinstance(node, dict):
            return
        kind, coordinates = node.get("type"), node.get("coordinates")
        if crs := _crs_of_geojson(node, path):
            systems.append(crs)
        if kind == "Feature" or isinstance(node.get("geometry"), dict):
            properties = node.get("properties")
            texts = {**properties} if isinstance(properties, dict) else {}
            if isinstance(node.get("id"), str | int):
                texts.setdefault("id", node["id"])
            feature = _Feature(_texts(texts))
            features.append(feature)
            collect(node.get("geometry"), feature)
            return
        for key in ("features", "geometries"):
            children = node.get(key)
            for child in children if isinstance(children, list) else []:
                collect(child, feature if key == "geometries" else None)
        if not isinstance(coordinates, list):
            return
        if feature is None:
            feature = _Feature()
            features.append(feature)
        several = coordinates if str(kind).startswith("Multi") else [coordinates]
        if kind in ("Polygon", "MultiPolygon"):
            for rings in several:
                corners = [_open_ring(_corners(ring, path)) for ring in rings]
                feature.polygons += [corners] if corners else []
        elif kind in ("LineString", "MultiLineString"):
            feature.lines += [_corners(line, path) for line in several]
        elif kind in ("Point", "MultiPoint"):
            feature.points += len(several)

    collect(content, None)
    if other := [name for name in systems[1:] if not _same_crs(name, systems[0])]:
        raise InputError(f"names two reference systems, {systems[0]} and {other[0]}", "export it in WGS-84", path)
    return _Content(features, next(iter(systems), ""))


def _deere(boundary: Mapping[str, Any], path: Path) -> _Feature:
    """A boundary as the John Deere Operations Center returns it: rings of points with lat and lon."""
    feature = _Feature(_texts({"name": boundary.get("name"), "id": boundary.get("id")}))
    try:
        for polygon in boundary["multipolygons"]:
            rings = sorted(polygon["rings"], key=lambda ring: ring.get("type") != "exterior")
            points = [[(point["lon"], point["lat"]) for point in ring["points"]] for ring in rings]
            feature.polygons.append([_open_ring(_corners(corners, path)) for corners in points])
    except (TypeError, KeyError, AttributeError):
        raise InputError("has a boundary without rings of points", "export the border as GeoJSON", path) from None
    return feature


def _crs_of_geojson(content: Any, path: Path) -> str:
    crs = content.get("crs") if isinstance(content, dict) else None
    if not crs:
        return ""
    properties = crs.get("properties") if isinstance(crs, dict) else None
    found = None
    if isinstance(properties, dict):
        found = properties.get("name") or properties.get("code")
    if not isinstance(found, str | int):
        raise InputError(
            f"names its reference system in a way that is not read: {crs!s:.80}", "export it in WGS-84", path
        )
    return f"EPSG:{found}" if str(found).isdecimal() else str(found)


def _xml(path: Path, data: bytes | None = None) -> ElementTree.Element:
    text = read_limited(path, "check its path in the field file") if data is None else data
    if b"<!DOCTYPE" in text[:4096] or b"<!ENTITY" in text:
        raise InputError("is XML with definitions of its own", "export the border again", path)
    try:
        root = ElementTree.fromstring(text)
    except (ValueError, LookupError) as error:  # an encoding that the parser does not know
        raise InputError(f"cannot be read as XML: {error}", "save it as UTF-8", path) from None
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    return root


def _kml(source: BorderSource, data: bytes | None = None) -> _Content:
    path = source.path

    def ring(element: ElementTree.Element | None) -> Array:
        text = element.findtext(".//coordinates", "") if element is not None else ""
        text = re.sub(r"\s*,\s*", ",", text)  # people write a space after the comma
        return _corners([corner.split(",") for corner in text.split()], path)

    features = []
    for placemark in _xml(path, data).iter("Placemark"):
        name = (placemark.findtext("name") or "").strip()
        feature = _Feature({"name": printable(name)} if name else {})
        for polygon in placemark.iter("Polygon"):
            rings = [polygon.find("outerBoundaryIs"), *polygon.iter("innerBoundaryIs")]
            feature.polygons.append([_open_ring(ring(one)) for one in rings])
        feature.lines += [ring(line) for line in placemark.iter("LineString")]
        feature.points = len(list(placemark.iter("Point")))
        features.append(feature)
    return _Content(features, WGS84)


def _gpx(source: BorderSource) -> _Content:
    features, root = [], _xml(source.path)
    for kind, part, point in (("trk", "trkseg", "trkpt"), ("rte", ".", "rtept")):
        for track in root.iter(kind):
            name = (track.findtext("name") or "").strip()
            feature = _Feature({"name": printable(name)} if name else {})
            for segment in track.findall(part):
                feature.lines.append(_placed(segment.iter(point), "lon", "lat", source.path))
            features.append(feature)
    return _Content([*features, _Feature(points=len(list(root.iter("wpt"))))], WGS84)


def _placed(elements: Iterable[ElementTree.Element], lon: str, lat: str, path: Path) -> Array:
    corners = [(one.get(lon), one.get(lat)) for one in elements]
    return _corners(corners, path) if corners else np.empty((0, 2))


def _osm(source: BorderSource) -> _Content:
    root = _xml(source.path)
    nodes = {node.get("id"): node for node in root.iter("node")}
    ways: dict[str, _Feature] = {}
    for way in root.iter("way"):
        corners = [nodes[one.get("ref")] for one in way.iter("nd") if one.get("ref") in nodes]
        line = _placed(corners, "lon", "lat", source.path)
        ways[way.get("id", "")] = _Feature(_tags(way), lines=[line])
    areas = []
    for relation in root.iter("relation"):  # borders and ponds of several ways
        members = [(one.get("role"), one.get("ref", "")) for one in relation.iter("member")]
        parts = [(role, ref, line) for role, ref in members if ref in ways for line in ways[ref].lines]
        rings = _joined([line for role, _, line in parts if role != "inner"])
        if rings:
            holes = _joined([line for role, _, line in parts if role == "inner"])
            areas.append(_Feature(_tags(relation), [[ring] for ring in rings]))
            areas += [_Feature({"name": "hole"}, [[hole]], is_no_go=True) for hole in holes]
            for _, ref, _ in parts:
                ways[ref].lines = []
    return _Content([*areas, *(way for way in ways.values() if way.lines)], WGS84)


def _tags(element: ElementTree.Element) -> dict[str, str]:
    tags = {tag.get("k", ""): printable(tag.get("v", "")) for tag in element.iter("tag")}
    return {"id": element.get("id", ""), **tags}


def _joined(lines: Sequence[Array]) -> list[Array]:
    """Rings that lines make together, such as the ways of a relation."""
    import shapely

    joined = shapely.line_merge(shapely.MultiLineString([line for line in lines if len(line) > 1]))
    rings = [shapely.get_coordinates(part) for part in shapely.get_parts(joined) if part.is_closed]
    return [_open_ring(ring) for ring in rings]


def _isoxml(source: BorderSource) -> _Content:
    """Fields of a task controller (ISO 11783-10): partfields with their borders, and obstacles in them."""
    root, path = _xml(source.path), source.path
    if root.tag in ("osm", "kml"):
        return _osm(source) if root.tag == "osm" else _kml(source)
    if root.tag != "ISO11783_TaskData" and root.find(".//PFD") is None:
        what = (
            f"is XML with <{root.tag:.40}>, neither a task file (ISO 11783) nor of OpenStreetMap or Google Earth"
        )
        raise InputError(what, "convert it to GeoJSON in a GIS", path)
    features = []
    for partfield in root.iter("PFD"):
        name = printable(partfield.get("C", ""))
        border = _Feature({"name": name, "id": partfield.get("A", "")})
        features.append(border)
        for polygon in partfield.findall("PLN"):
            kind = polygon.get("A", "")
            rings = [
                _open_ring(_placed(line.iter("PNT"), "D", "C", path))
                for line in sorted(polygon.findall("LSG"), key=lambda one: one.get("A", "") != "1")
            ]
            rings = [ring for ring in rings if len(ring)]
            if kind == "1" and rings:
                border.polygons.append(rings)
            elif kind in _NO_GO_OF_ISOXML and rings:
                about = polygon.get("B") or _NO_GO_OF_ISOXML[kind]
                features.append(_Feature({"name": printable(f"{name} {about}")}, [rings], is_no_go=True))
    return _Content(features, WGS84)


def _wkt(source: BorderSource) -> _Content:
    import shapely

    text = read_limited(source.path, "check its path in the field file").decode("utf-8", "replace").strip()
    found = re.match(r"SRID\s*=\s*(\d+)\s*;", text, re.IGNORECASE)
    try:
        with np.errstate(over="ignore"):  # numbers beyond the largest are refused with their place
            shape = shapely.from_wkt(text[found.end() :] if found else text)
    except shapely.errors.ShapelyError as error:
        raise InputError(f"is not valid WKT: {error!s:.200}", "write it as POLYGON ((...))", source.path) from None
    return _Content([_of_shape(shape, {})], f"EPSG:{found[1]}" if found else "")


def _of_shape(shape: BaseGeometry | None, properties: dict[str, str]) -> _Feature:
    import shapely

    feature = _Feature(properties)
    parts = [] if shape is None else list(shapely.get_parts(shape))
    while parts:
        part = parts.pop(0)
        if part.geom_type == "Polygon" and not part.is_empty:
            rings = [part.exterior, *part.interiors]
            feature.polygons.append([_open_ring(shapely.get_coordinates(ring)) for ring in rings])
        elif part.geom_type in ("LineString", "LinearRing"):
            feature.lines.append(shapely.get_coordinates(part))
        elif part.geom_type == "Point":
            feature.points += 1
        elif shapely.get_num_geometries(part) and part.geom_type.startswith(("Multi", "Geometry")):
            parts += list(shapely.get_parts(part))
    return feature


def _vectors(source: BorderSource) -> _Content:
    import shapely

    path = source.path
    pyogrio = optional_module("pyogrio")
    present = {one.name.lower() for one in path.parent.iterdir()}
    if path.suffix.lower() == ".shp" and f"{path.stem}.shx".lower() not in present:
        remedy = "keep .shp, .shx, .dbf and .prj together, or give a zip file with all of them"
        raise InputError(f"lacks its part {path.stem}.shx", remedy, path)
    with readable_vector(path, "export the border as GeoJSON in WGS-84"):
        layers = [str(name) for name, kind in pyogrio.list_layers(path).tolist() if kind is not None]
        if source.layer and source.layer not in layers:
            known = did_you_mean(source.layer, layers)
            raise InputError(f"has no layer {source.layer!r}", f"there are: {listing(layers)}{known}", path)
        contents = {}
        for layer in [source.layer] if source.layer else layers:
            about, _, geometries, columns = pyogrio.raw.read(path, layer=layer)
            shapes = shapely.from_wkb(geometries, on_invalid="ignore") if geometries is not None else []
            names = about["fields"].tolist()
            rows = zip(*(column.tolist() for column in columns), strict=True) if names else [()] * len(shapes)
            features = [
                _of_shape(shape, _texts(dict(zip(names, row, strict=True))))
                for shape, row in zip(shapes, rows, strict=True)
            ]
            contents[layer] = _Content(features, about["crs"] or "", needs_crs=about["crs"] is None)
    filled = {name: one for name, one in contents.items() if any(feature.polygons for feature in one.features)}
    if len(filled) > 1:
        remedy = f"say which has the border: border: {{file: {path.name}, layer: {next(iter(filled))}}}"
        raise InputError(f"has polygons in {len(filled)} layers: {listing(filled)}", remedy, path)
    return next(iter((filled or contents).values()), _Content([]))


def _zipped(source: BorderSource) -> _Content:
    """The only file with a border in an archive, such as a shapefile with its parts, or the KML of a KMZ."""
    path = source.path
    try:
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            members = [one for one in archive.infolist() if not one.is_dir() and "__MACOSX" not in one.filename]
            if sum(one.file_size for one in members) > MAX_UNZIPPED_BYTES or len(members) > MAX_MEMBERS:
                limits = f"{MAX_UNZIPPED_BYTES / 1e6:g} MB or {MAX_MEMBERS} files"
                raise InputError(f"holds more than {limits}", "give the file with the border alone", path)
            for one in members:
                inside = Path(folder, PurePosixPath(one.filename.replace("\\", "/")).name)
                inside.write_bytes(archive.read(one))
            files = sorted(one for one in Path(folder).iterdir() if _is_border(one))
            if len(files) != 1:
                found = (
                    f"{len(files)} files with borders: {listing(one.name for one in files)}"
                    if files
                    else ("no file with a border")
                )
                raise InputError(f"holds {found}", "unpack it, and give the file with the border", path)
            inner = replace(source, path=files[0])
            try:
                return _READERS.get(files[0].suffix.lower(), _vectors)(inner)
            except InputError as error:  # the archive has the fault, not its copy
                raise InputError([replace(mistake, path=path) for mistake in error.mistakes]) from None
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError) as error:
        raise InputError(f"cannot be unpacked: {error}", "unpack it, and give the file in it", path) from None


def _is_border(file: Path) -> bool:
    suffix = file.suffix.lower()
    if suffix == ".xml":  # shapefiles have descriptions in XML, task controllers only this file
        return file.name.lower() == "taskdata.xml"
    return suffix in FORMATS and suffix not in (".zip", ".kmz")


_READERS: dict[str, Callable[[BorderSource], _Content]] = {
    ".geojson": _geojson,
    ".json": _geojson,
    ".kml": _kml,
    ".gpx": _gpx,
    ".osm": _osm,
    ".xml": _isoxml,
    ".wkt": _wkt,
    ".zip": _zipped,
    ".kmz": _zipped,
}
