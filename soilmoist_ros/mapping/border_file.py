# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The border of a field in a file of another program: which of its shapes it is, and where it lies on the earth.

GeoJSON, KML, KMZ, GPX and ISOXML files are read here. Shapefiles, GeoPackage and FlatGeobuf
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
from typing import TYPE_CHECKING, Any, NamedTuple
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
VECTORS = (".shp", ".gpkg", ".fgb")  # formats that need pyogrio
FORMATS = (*VECTORS, ".geojson", ".json", ".kml", ".kmz", ".gpx", ".xml", ".zip")
MAX_GAP_SHARE = 0.05
"""Distance between the ends of a line, as a share of its length, up to which it is a border that was walked."""
MAX_INSIDE_SHARE = 0.5  # share of a field from which on polygons inside it are rather its parts than no-go areas
MAX_EXTENT_DEG = 2.0  # extent from which on corners in degrees are rather metres [deg]
MAX_UNZIPPED_BYTES, MAX_MEMBERS = 100_000_000, 1000
"""Size and number of files in an archive beyond which it is refused."""
_SLIVER_M2 = 1.0
_MAX_SHARED = 0.1  # share of another polygon in the field from which it is rather an obstacle than a neighbour
_MIN_HOLE_M2 = 0.01  # area below which a hole is an error of the drawing [m^2]; a post has more
_NEAR_ORIGIN_M = 5000.0
"""Distance from the origin of a projection within which coordinates are rather metres from a datum [m]."""
_BEYOND_USE_DEG = 1.0  # distance from the area for which a reference system is made that is still plausible [deg]
_NAME_CRS = "name the system in the field file: border: {file: ..., crs: EPSG:...}"
_MAX_STATED_ERROR_M = 0.5  # error of a conversion to WGS-84 from which it is stated [m]
_NO_GO_OF_ISOXML = {"3": "water", "4": "building", "6": "obstacle"}
_NAMES = ("name", "Name", "NAME", "id", "ID", "fid", "OBJECTID", "FID")


@dataclass(frozen=True)
class BorderSource:
    """A file with the border of a field.

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
        """Read the border of a field; ``InputError`` if the file leaves open which of its shapes it is."""
        path, suffix = self.path, self.path.suffix.lower()
        if self.layer and suffix not in VECTORS:
            raise InputError("has no layers", "remove 'layer'", path)
        content = self._content()
        notes: list[str] = []
        features = content.features
        if not any(feature.polygons for feature in features):
            _close_lines(features, notes, self)
        corners = [ring for one in features for rings in one.polygons for ring in rings]
        to_degrees = _conversion(corners, content, self, notes)
        for feature in features:
            feature.polygons = [_outer_first(list(map(to_degrees, rings)), notes) for rings in feature.polygons]
            if not all(np.isfinite(ring).all() for rings in feature.polygons for ring in rings):
                raise InputError("has a corner that is no place on the earth", "export the border again", path)
        return _chosen(features, self, notes)

    def lines(self) -> list[tuple[Array, Mapping[str, str]]]:
        """Read the lines of the file, such as tracks: corners in degrees, shape (k, 2), and their properties.

        :raises InputError: if the file cannot be read, has no lines, or leaves open where they are
        """
        content = self._content()
        lines = [(line, one.properties) for one in content.features for line in one.lines if len(line) > 1]
        if not lines:
            raise InputError("holds no lines", "export tracks as lines, not as polygons or points", self.path)
        to_degrees = _conversion([line for line, _ in lines], content, self, [])
        return [(to_degrees(line), about) for line, about in lines]

    def _content(self) -> _Content:
        path, suffix = self.path, self.path.suffix.lower()
        if suffix not in FORMATS and not read_limited(path).lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"{"):
            raise InputError(
                f"is not a file with a border: its name ends in {suffix or 'nothing'!r}",
                f"convert it in a GIS to one of {', '.join(FORMATS)}",
                path,
            )
        if not path.exists():
            raise InputError("cannot be read: No such file or directory", "check its path in the field file", path)
        return _READERS.get(suffix, _geojson)(self)


@dataclass(frozen=True)
class Border:
    """The border of a field; ``no_go``: outlines of areas that must not be entered, shape (k, 2) each [deg]."""

    outline: Array  # longitude and latitude, WGS-84, shape (k, 2), not closed [deg]
    no_go: tuple[Array, ...] = ()
    notes: tuple[str, ...] = ()  # what was decided on the way, and what of the file is not used, in words


@dataclass(eq=False)
class _Feature:
    """Shapes of a feature: polygons as rings, of which the first is the outer one, lines, and number of points."""

    properties: dict[str, str] = field(default_factory=dict)
    polygons: list[list[Array]] = field(default_factory=list)
    lines: list[Array] = field(default_factory=list)
    points: int = 0
    is_no_go: bool = False
    number: int = 0  # from 1
    label: str = ""  # name in messages

    @property
    def pairs(self) -> list[str]:
        """Properties with their keys, as ``feature`` may name them."""
        return [f"{key}={value}" for key, value in self.properties.items()]

    def is_called(self, wanted: str) -> bool:
        return wanted in (str(self.number), *self.properties.values(), *self.pairs)


@dataclass
class _Content:
    """Features of a file, and the reference system that it states; empty if its format has none to state."""

    features: list[_Feature]
    crs: str = ""
    needs_crs: bool = False


class _Area(NamedTuple):
    """A polygon of a file."""

    shape: BaseGeometry  # in metres
    rings: list[Array]  # the outer one first [deg]
    feature: _Feature


def _chosen(features: Sequence[_Feature], source: BorderSource, notes: list[str]) -> Border:
    """The field among the polygons of a file; those inside it are no-go areas."""
    from shapely import Polygon, make_valid

    path = source.path
    _number(features)
    named = [one for one in features if not source.feature or one.is_called(source.feature)]
    if not named:
        known = [feature.label.strip("'") for feature in features if feature.polygons]
        remedy = f"there are: {listing(known)}{did_you_mean(source.feature, known)}"
        raise InputError(f"has no feature {source.feature!r}", remedy, path)
    scale = _metres_per_degree([rings[0] for feature in features for rings in feature.polygons])
    areas = dict[tuple[float, ...], _Area]()  # by extent: what is there twice counts once
    for feature in features:
        for rings in feature.polygons:
            if len(rings[0]) < 3:
                raise InputError(f"{feature.label} has {len(rings[0])} corners", "export it again", path)
            shape = make_valid(Polygon(rings[0] * scale))
            if shape.area < _SLIVER_M2 and len(feature.polygons) > 1:
                notes.append(f"a part of {feature.label} of less than {_SLIVER_M2:g} m2 is left out")
            else:
                extent = tuple(np.round([shape.area, *shape.bounds], 3).tolist())
                areas.setdefault(extent, _Area(shape, rings, feature))
    candidates = [one for one in areas.values() if one.feature in named and not one.feature.is_no_go]
    if not candidates:
        raise InputError("holds no polygon of a field", "export the border of the field as a polygon", path)
    field = max(candidates, key=lambda one: one.shape.area)
    label, outer = field.feature.label, field.shape
    reach = outer.buffer(1e-3 * math.sqrt(outer.area))
    inside, apart = list[_Area](), list[_Area]()
    for area in areas.values():
        if area is field:
            continue
        shared = area.shape.intersection(outer).area / max(area.shape.area, _MIN_HOLE_M2)
        if reach.contains(area.shape) or (area.feature.is_no_go and shared > 0):
            inside.append(area)
            notes.append(f"{area.feature.label}, {area.shape.area:.0f} m2 in the field, is a no-go area")
            continue
        apart.append(area)
        if shared > _MAX_SHARED:
            notes.append(
                f"{area.feature.label} lies in the field by {shared:.0%} and is not used: if it must not be "
                "entered, list it under 'no_go_lonlat', or draw it on the page"
            )
    rivals = [one for one in apart if any(one is other for other in candidates)]
    if rivals and not source.takes_largest:
        raise _several([field, *rivals], source)
    if rivals:
        notes.append(f"the largest of {len(rivals) + 1} polygons was taken")
    share = sum(one.shape.area for one in inside) / outer.area
    if share > MAX_INSIDE_SHARE:
        raise InputError(
            f"holds {len(inside) + 1} polygons, and those inside {label} cover {share:.0%} of it: they may be "
            "zones of the field, or no-go areas",
            "export the border alone; cut a no-go area out, list it under 'no_go_lonlat', or draw it on the page",
            path,
        )
    if apart:
        others = dict.fromkeys(one.feature.label for one in apart)
        notes.append(f"not used, as they are not inside {label}: {listing(others)}")
    if drawn := [feature.label for feature in features if feature.lines or feature.points]:
        notes.append(
            f"lines and points are not used: {listing(drawn)}; draw what the robot must avoid as a polygon"
        )
    holes = [
        ring
        for ring in field.rings[1:]
        if len(ring) >= 3 and make_valid(Polygon(ring * scale)).area >= _MIN_HOLE_M2
    ]
    return Border(field.rings[0], (*holes, *(one.rings[0] for one in inside)), tuple(notes))


def _number(features: Sequence[_Feature]) -> None:
    """Give each feature its number and its name in messages, which is unique."""
    for number, one in enumerate(features, start=1):
        name = next((one.properties[key] for key in _NAMES if one.properties.get(key)), "")
        one.number, one.label = number, repr(name) if name and not name.isdecimal() else f"feature {number}"
    count = Counter(one.label for one in features)
    for one in features:
        one.label += f" (feature {one.number})" if count[one.label] > 1 else ""


def _several(areas: Sequence[_Area], source: BorderSource) -> InputError:
    """The error of a file with several polygons that are apart; the first is the largest."""
    features = {area.feature.number: area.feature for area in areas}
    first = areas[0].feature
    if len(features) == 1:
        return InputError(
            f"holds {len(areas)} polygons that lie apart, all parts of {first.label}",
            "a field is one polygon: export one part, and write a field file for each",
            source.path,
        )
    what, choice = "none of which holds the others", first.label if first.label[-1] in "'\"" else first.number
    if source.feature:
        what = f"that {source.feature!r} fits, as number or property"
        others = {pair for one in features.values() if one is not first for pair in one.pairs}
        choice = next((repr(pair) for pair in first.pairs if pair not in others), first.number)
    return InputError(
        f"holds {len(areas)} polygons, {what}: {listing(features[number].label for number in sorted(features))}",
        f"say which is the field: border: {{file: {source.path.name}, feature: {choice}}}",
        source.path,
    )


def _close_lines(features: Sequence[_Feature], notes: list[str], source: BorderSource) -> None:
    """Make polygons of closed lines, in a file without polygons; ``InputError`` if these may be ponds."""
    import shapely

    for feature in features:
        for line in [line for line in feature.lines if len(line) > 3]:
            gap, length = math.dist(line[0], line[-1]), float(np.hypot(*np.diff(line, axis=0).T).sum())
            if gap <= MAX_GAP_SHARE * length:
                feature.lines = [one for one in feature.lines if one is not line]
                feature.polygons.append([_open_ring(line)])
                said = f", though its ends are apart by about {gap / length:.0%} of its length" if gap else ""
                notes.append(f"a closed line is the border{said}")
    pieces = [line for feature in features for line in feature.lines if len(line) > 1]
    rings = [rings[0] for feature in features for rings in feature.polygons]
    if not rings:
        points = sum(feature.points for feature in features)
        lines = f"{len(pieces)} open {'line' if len(pieces) == 1 else 'lines'} and " if pieces else ""
        raise InputError(
            f"holds no polygon, but {lines}{points} points",
            "close the line: its last corner is its first one; or list corners under 'polygon_lonlat'",
            source.path,
        )
    around = shapely.MultiLineString(pieces).convex_hull
    if not source.feature and pieces and all(around.contains(shapely.MultiPoint(ring)) for ring in rings):
        raise InputError(
            f"has {len(pieces)} open lines around its closed one: is the border in pieces, and that a pond?",
            f"join the lines to a polygon, or say which is the field: {{file: {source.path.name}, feature: ...}}",
            source.path,
        )


def _conversion(
    shapes: Sequence[Array], content: _Content, source: BorderSource, notes: list[str]
) -> Callable[[Array], Array]:
    """Function that converts corners of the file to longitude and latitude, and checks those of some shapes."""
    path, crs = source.path, content.crs or source.crs
    corners = np.concatenate(shapes)
    if not np.isfinite(corners).all():
        raise InputError("has a corner that is not two finite numbers", "export the border again", path)
    if source.crs and not _same_crs(crs, source.crs):
        raise InputError(
            f"is in {crs}, but the field file says crs: {source.crs}", "remove 'crs', or correct the file", path
        )
    fit = _each_in_degrees(corners)
    if not crs and content.needs_crs:
        guess = "degrees, crs: EPSG:4326" if fit.all() else "metres of a map projection such as UTM"
        raise InputError(
            f"has no reference system (CRS), and its corners, such as {_text(corners[0])}, look like {guess}",
            f"add the .prj file, or {_NAME_CRS}",
            path,
        )
    if crs and not _same_crs(crs, WGS84):
        return _converter(crs, corners, path, notes)
    what = ""
    if not fit.all():
        what = f"the corner {_text(corners[~fit][0])} is not in degrees of longitude and latitude"
    if what and _each_in_degrees(corners[:, ::-1]).all() and np.abs(corners[:, 1]).max() <= 180:
        raise InputError(what, "longitude comes first: swap the numbers of each corner", path)
    if what:
        hint = ", but perhaps in metres of a map projection such as UTM"
        raise InputError(what + hint, f"export it in WGS-84, or {_NAME_CRS}", path)
    if (extent := np.ptp(corners, axis=0).max()) > MAX_EXTENT_DEG:
        raise InputError(
            f"the corners, such as {_text(corners[len(corners) // 2])}, would span {extent:g} degrees: they "
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
    except pyproj.exceptions.ProjError as error:
        raise InputError(
            f"the reference system {crs!s:.80} cannot be converted to WGS-84: {error!s:.200}",
            "check its name, or export the border in WGS-84",
            path,
        ) from None
    name = f"{crs} ({system.name})" if system.name not in crs and len(crs) < 40 else system.name
    where, remedy = "", "metres from a datum go to 'polygon' in the field file, with 'datum'"
    if system.is_projected and _each_in_degrees(corners).all() and np.ptp(corners, axis=0).max() < 1:
        where, remedy = "looks like degrees", "degrees of GNSS receivers are EPSG:4326"
    elif not np.isfinite(place).all():
        where = "is no place"
    elif system.area_of_use is not None and not _is_near(place, system.area_of_use.bounds):
        where = f"is longitude {place[0]:.2f}, latitude {place[1]:.2f}, far from where the system is used"
    elif system.is_projected and np.abs(corners).max() < _NEAR_ORIGIN_M:
        where = f"is longitude {place[0]:.2f}, latitude {place[1]:.2f}, next to the origin"
    if where:
        raise InputError(
            f"is in {name}, in which its corner {_text(corners[0])} {where}",
            f"correct the reference system; {remedy}",
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


# -- Formats -------------------------------------------------------------------------------------------------


def _feature(properties: Mapping[str, Any], *geometries: Any, path: Path, is_no_go: bool = False) -> _Feature:
    """A feature with geometries as GeoJSON has them; heights are left out."""
    texts = {str(key): printable(str(one)) for key, one in properties.items() if one not in (None, "")}
    feature, todo = _Feature(texts, is_no_go=is_no_go), list(geometries)
    try:
        while todo:
            geometry = todo.pop(0) or {}
            kind, coordinates = str(geometry.get("type")), geometry.get("coordinates") or ()
            todo += geometry.get("geometries") or ()
            several = coordinates if kind.startswith("Multi") else [coordinates]
            if kind.endswith("Polygon"):
                feature.polygons += [[_open_ring(_corners(ring)) for ring in rings] for rings in several if rings]
            elif kind.endswith(("LineString", "LinearRing")):
                feature.lines += [_corners(line) for line in several if len(line)]
            elif kind.endswith("Point"):
                feature.points += len(several)
    except (TypeError, ValueError, KeyError, OverflowError, AttributeError) as error:
        what = f"has a corner that is not two numbers: {error!s:.80}"
        raise InputError(what, "export the border again", path) from None
    return feature


def _corners(vertices: Any) -> Array:
    ring = np.array([[float(number) for number in vertex[:2]] for vertex in vertices], float)
    if ring.ndim != 2 or ring.shape[1] != 2 or not np.isfinite(ring).all():
        raise ValueError(f"{vertices}")
    return ring


def _geojson(source: BorderSource) -> _Content:
    path = source.path
    try:
        content = read_json(read_limited(path).decode("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"is not valid JSON: {error}", "export the border again as GeoJSON", path) from None
    content = content if isinstance(content, dict) else {}
    if content.get("type") == "Topology" or "spatialReference" in content or "values" in content:
        raise InputError("is JSON of another kind, not GeoJSON", "export the border as GeoJSON", path)
    nodes = content.get("features")
    features, systems = list[_Feature](), [_crs_of_geojson(content, path)]
    for node in nodes if isinstance(nodes, list) else [content]:
        if not isinstance(node, dict):
            continue
        is_feature = node.get("type") == "Feature" or isinstance(node.get("geometry"), dict)
        geometry = node.get("geometry") if is_feature else node
        systems += [_crs_of_geojson(one, path) for one in (node, geometry)]  # as databases write them
        properties = node.get("properties")
        known = {"id": node["id"]} if isinstance(node.get("id"), str | int) else {}
        known |= properties if isinstance(properties, dict) else {}
        features.append(_feature(known, geometry, path=path))
    systems = [name for name in systems if name]
    if other := [name for name in systems[1:] if not _same_crs(name, systems[0])]:
        raise InputError(f"names two reference systems, {systems[0]} and {other[0]}", "export it in WGS-84", path)
    return _Content(features, next(iter(systems), ""))


def _crs_of_geojson(node: Any, path: Path) -> str:
    crs = node.get("crs") if isinstance(node, dict) else None
    properties = crs.get("properties") if isinstance(crs, dict) else None
    found = (properties.get("name") or properties.get("code")) if isinstance(properties, dict) else None
    if crs and not isinstance(found, str | int):
        what = f"names its reference system in a way that is not read: {crs!s:.80}"
        raise InputError(what, "export it in WGS-84", path)
    return f"EPSG:{found}" if str(found).isdecimal() else str(found or "")


def _xml(path: Path) -> ElementTree.Element:
    text = read_limited(path)
    if b"<!DOCTYPE" in text[:4096] or b"<!ENTITY" in text:
        raise InputError("is XML with definitions of its own", "export the border again", path)
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # the last: an unknown encoding
        raise InputError(f"is not valid XML: {error}", "export the border again, in UTF-8", path) from None
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    return root


def _polygon(rings: Iterable[Any]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [ring for ring in rings if len(ring)]}


def _line(corners: Any) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": corners}


def _kml(source: BorderSource) -> _Content:
    def ring(element: ElementTree.Element | None) -> list[list[str]]:
        text = element.findtext(".//coordinates", "") if element is not None else ""
        text = re.sub(r"\s*,\s*", ",", text)  # people write a space after the comma
        return [corner.split(",") for corner in text.split()]

    features = []
    for mark in _xml(source.path).iter("Placemark"):
        polygons = ([one.find("outerBoundaryIs"), *one.iter("innerBoundaryIs")] for one in mark.iter("Polygon"))
        # Rings without corners stay, and are refused: a hole must not become the border.
        parts = [{"type": "Polygon", "coordinates": list(map(ring, rings))} for rings in polygons]
        parts += [_line(ring(line)) for line in mark.iter("LineString")]
        parts += [{"type": "Point"} for _ in mark.iter("Point")]
        features.append(_feature({"name": mark.findtext("name", "").strip()}, *parts, path=source.path))
    return _Content(features, WGS84)


def _gpx(source: BorderSource) -> _Content:
    features, root = [], _xml(source.path)
    for kind, part, point in (("trk", "trkseg", "trkpt"), ("rte", ".", "rtept")):
        for track in root.iter(kind):
            lines = [_line(_places(segment.iter(point), "lon", "lat")) for segment in track.findall(part)]
            features.append(_feature({"name": track.findtext("name", "").strip()}, *lines, path=source.path))
    return _Content([*features, _Feature(points=len(list(root.iter("wpt"))))], WGS84)


def _places(elements: Iterable[ElementTree.Element], lon: str, lat: str) -> list[tuple[str | None, str | None]]:
    return [(one.get(lon), one.get(lat)) for one in elements]


def _isoxml(source: BorderSource) -> _Content:
    """Fields of a task controller (ISO 11783-10): partfields with their borders, and obstacles in them."""
    root, path = _xml(source.path), source.path
    if root.tag == "kml":
        return _kml(source)
    if root.tag != "ISO11783_TaskData" and root.find(".//PFD") is None:
        what = f"is XML with <{root.tag:.40}>, neither a task file (ISO 11783) nor of Google Earth"
        raise InputError(what, "convert it to GeoJSON in a GIS", path)
    features = []
    for partfield in root.iter("PFD"):
        border, obstacles, name = list[dict[str, Any]](), list[_Feature](), partfield.get("C", "")
        for polygon in partfield.findall("PLN"):
            lines = sorted(polygon.findall("LSG"), key=lambda one: one.get("A", "") != "1")
            shape, kind = _polygon(_places(one.iter("PNT"), "D", "C") for one in lines), polygon.get("A", "")
            if kind == "1":
                border.append(shape)
            elif kind in _NO_GO_OF_ISOXML:
                about = {"name": f"{name} {polygon.get('B') or _NO_GO_OF_ISOXML[kind]}"}
                obstacles.append(_feature(about, shape, path=path, is_no_go=True))
        about = {"name": name, "id": partfield.get("A", "")}
        features += [_feature(about, *border, path=path), *obstacles]  # 'feature' may name a number
    return _Content(features, WGS84)


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
            rows = zip(*(column.tolist() for column in columns), strict=True) if columns else [()] * len(shapes)
            features = [
                _feature(
                    dict(zip(about["fields"].tolist(), row, strict=True)),
                    None if shape is None or shape.is_empty else shapely.geometry.mapping(shape),
                    path=path,
                )
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
                several = f"{len(files)} files with borders: {listing(one.name for one in files)}"
                found = several if files else "no file with a border"
                raise InputError(f"holds {found}", "unpack it, and give the file with the border", path)
            inner = replace(source, path=files[0])
            try:
                return _READERS[files[0].suffix.lower()](inner)
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
    **dict.fromkeys(VECTORS, _vectors),
    **dict.fromkeys((".geojson", ".json"), _geojson),
    **dict.fromkeys((".zip", ".kmz"), _zipped),
    ".kml": _kml,
    ".gpx": _gpx,
    ".xml": _isoxml,
}
