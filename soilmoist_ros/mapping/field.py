# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The field file: where the field lies, its boundary, and what inside it must not be entered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Setting
from pydantic import model_validator

from soilmoist_ros.foundation.configuration import read_limited
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame, distance_and_bearing
from soilmoist_ros.foundation.places import distance_text
from soilmoist_ros.foundation.plain_values import read_json
from soilmoist_ros.foundation.sections import Section, load_model
from soilmoist_ros.mapping.covariates.source import CovariateSection, CovariateSource
from soilmoist_ros.mapping.grid import FieldGrid, default_cell_m

MIN_AREA_M2, MAX_AREA_M2 = 1.0, 1e9
"""Areas beyond which a boundary is a mistake [m^2]."""
MAX_DATUM_DISTANCE_M = 50_000.0
"""Distance of the boundary from its datum beyond which it is a mistake: the plane stretches by 0.5 m there [m]."""
Vertex = tuple[float, float]
Ring = Annotated[list[Vertex], Setting(min_length=3)]


class Datum(Section):
    """Origin of the field's east-north coordinates."""

    latitude_deg: Annotated[float, Setting(ge=-90, le=90)]
    """Latitude, WGS-84 [deg]."""
    longitude_deg: Annotated[float, Setting(ge=-180, le=180)]
    """Longitude, WGS-84, east positive [deg]."""


class FieldFile(Section):
    """What a field file may hold."""

    name: str = "unnamed field"
    """Name shown in reports."""
    datum: Datum | None = None
    """Origin of x (east) and y (north); the mean of the boundary if left out."""
    polygon: Ring | None = None
    """Boundary as [x, y] in metres from the datum."""
    polygon_lonlat: Ring | None = None
    """Boundary as [longitude, latitude] in degrees, east and north positive."""
    geojson: Path | None = None
    """GeoJSON file with the boundary; a relative path starts at the field file. Its holes are no-go areas."""
    no_go: tuple[Ring, ...] = ()
    """Areas inside the boundary that are not mapped or entered, as [x, y] in metres from the datum."""
    cell_m: Annotated[float, Setting(gt=0)] | None = None
    """Cell size of the map [m]; chosen from the footprint and the extent if left out."""
    covariates: tuple[str | CovariateSection, ...] = ()
    """What else is known at every place: FILE, FILE:BAND, or a section with ``file``, from the field file."""
    truth: Any = None
    """Truth of a surrogate field, for simulations; a field is mapped the same with or without it."""

    @model_validator(mode="after")
    def _one_boundary(self) -> FieldFile:
        given = [key for key in ("polygon", "polygon_lonlat", "geojson") if getattr(self, key) is not None]
        if len(given) != 1:
            found = f"but there are {len(given)}: {', '.join(given)}" if given else "but there is none"
            raise ValueError(f"give one boundary: 'polygon', 'polygon_lonlat' or 'geojson', {found}")
        if self.datum is None and (self.polygon is not None or self.no_go):
            raise ValueError("a boundary or no-go area in metres needs a 'datum' to start from")
        for lon, lat in self.polygon_lonlat or []:
            if not (-180 <= lon <= 180 and -90 <= lat <= 90):
                hint = ", but [latitude, longitude]: longitude comes first" if _is_place(lon, lat) else ""
                raise ValueError(f"[{lon}, {lat}] is not [longitude, latitude] in degrees{hint}")
        return self


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    return abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180


@dataclass(frozen=True, eq=False, repr=False)
class Field:
    """A field in its own east-north plane.

    :param name: name shown in reports
    :param frame: the plane about the field's datum
    :param polygon: boundary, shape (k, 2) [m], not closed
    :param no_go: boundaries of areas to leave out, each of shape (k, 2) [m]
    :param cell_m: cell size of the map [m], ``None`` to choose it
    :param covariates: files with covariates
    """

    name: str
    frame: LocalFrame
    polygon: NDArray[np.float64]
    no_go: tuple[NDArray[np.float64], ...] = ()
    cell_m: float | None = None
    covariates: tuple[CovariateSource, ...] = ()

    def grid(self, cell_m: float | None = None, footprint_radius_m: float = 10.0) -> FieldGrid:
        """Grid of the field: the only place where one is laid, so that maps, stops and truth share their cells.

        A field and a cell size make one grid. Whoever needs the cells of a map asks for the map's cell size.

        :param cell_m: cell size [m]; by default the field's own, else one chosen from its extent
        :param footprint_radius_m: radius of the sensor's footprint, for that choice [m]
        :raises InputError: if the field cannot be gridded with this cell size
        """
        width, height = np.ptp(self.polygon, axis=0).tolist()
        chosen = cell_m or self.cell_m or default_cell_m((width, height), footprint_radius_m)
        try:
            return _grid(self, chosen)
        except ValueError as error:
            raise InputError(
                f"the field {self.name!r} cannot be gridded: {error}", "change the cell size"
            ) from None

    @cached_property
    def centre(self) -> tuple[float, float]:
        """Latitude and longitude of the centre of the boundary [deg]."""
        import shapely

        centre = shapely.Polygon(self.polygon).centroid
        latitude, longitude = self.frame.to_geographic([[centre.x, centre.y]])[0]
        return float(latitude), float(longitude)

    @property
    def extent_m(self) -> float:
        """Longer side of the boundary's bounding box [m]."""
        return float(np.ptp(self.polygon, axis=0).max())

    def __repr__(self) -> str:
        width, height = np.ptp(self.polygon, axis=0).tolist()
        return f"Field({self.name!r}, {width:.0f} m x {height:.0f} m, {len(self.no_go)} no-go areas)"


@lru_cache(maxsize=8)
def _grid(field: Field, cell_m: float) -> FieldGrid:
    """Grid of a field; kept, as a campaign has the same field again and again."""
    return FieldGrid.from_polygon(field.polygon, cell_m, field.no_go)


def load_field(path: Path) -> Field:
    """Read a field file.

    :raises InputError: with every mistake in the file or in the GeoJSON that it names
    """
    if path.suffix.lower() == ".geojson":
        remedy = f"write a field file, a YAML file with the line 'geojson: {path.name}'"
        raise InputError("is GeoJSON, not a field file", remedy, path)
    content = load_model(path, FieldFile)
    holes_lonlat: list[NDArray[np.float64]] = []
    lonlat: NDArray[np.float64] | None = None
    if content.geojson is not None:
        lonlat, holes_lonlat = _read_geojson(path.parent / content.geojson)
    elif content.polygon_lonlat is not None:
        lonlat = _open_ring(content.polygon_lonlat)
    if content.datum is not None:
        frame = LocalFrame(content.datum.latitude_deg, content.datum.longitude_deg)
    else:
        assert lonlat is not None  # the model refuses a boundary in metres without a datum
        frame = LocalFrame(*(float(value) for value in np.round(lonlat.mean(axis=0)[::-1], 7)))
    if lonlat is not None:
        polygon = frame.to_local(lonlat[:, 1], lonlat[:, 0])
        if not np.all(np.isfinite(polygon)):
            raise InputError("the boundary is not on the datum's side of the earth", "check 'datum'", path)
    else:
        polygon = _open_ring(content.polygon or [])
    no_go = [frame.to_local(hole[:, 1], hole[:, 0]) for hole in holes_lonlat]
    no_go += [_open_ring(ring) for ring in content.no_go]
    _require_valid(polygon, "the boundary", path)
    _require_plausible(polygon, lonlat, frame, path)
    for number, ring in enumerate(no_go, start=1):
        _require_valid(ring, f"no-go area {number}", path)
    covariates = tuple(
        CovariateSource.parse(one, path.parent) if isinstance(one, str) else one.source(path.parent)
        for one in content.covariates
    )
    return Field(content.name, frame, polygon, tuple(no_go), content.cell_m, covariates)


def _open_ring(vertices: Iterable[Any]) -> NDArray[np.float64]:
    ring = np.array(list(vertices), dtype=float)
    return ring[:-1] if len(ring) > 3 and np.array_equal(ring[0], ring[-1]) else ring


def _require_valid(ring: NDArray[np.float64], name: str, path: Path) -> None:
    from shapely import Polygon
    from shapely.validation import explain_validity

    if len(ring) < 3:
        raise InputError(f"{name} has {len(ring)} corners", "give at least three corners not on one line", path)
    polygon = Polygon(ring)
    if not polygon.is_valid:
        raise InputError(
            f"{name} is not a simple polygon: {explain_validity(polygon)}",
            "list the corners in order around the field, without crossing lines",
            path,
        )
    if polygon.area <= 0:
        raise InputError(f"{name} encloses no area", "give at least three corners not on one line", path)


def _require_plausible(
    polygon: NDArray[np.float64], lonlat: NDArray[np.float64] | None, frame: LocalFrame, path: Path
) -> None:
    """Check area and place of a boundary: mistakes of units, order and datum are off by orders of magnitude.

    :param polygon: boundary in the plane of the field [m]
    :param lonlat: boundary as longitude and latitude [deg], if it was given so
    """
    from shapely import Polygon

    shape = Polygon(polygon)
    if not MIN_AREA_M2 <= shape.area <= MAX_AREA_M2:
        large = shape.area > MAX_AREA_M2
        size = f"{shape.area / 1e6:,.0f} km2" if large else f"{shape.area:.3g} m2"
        what = "too large for a survey" if large else "smaller than any footprint of the sensor"
        hint = "check the corners: 'polygon' is in metres from the datum, 'polygon_lonlat' in degrees"
        raise InputError(f"the boundary encloses {size}, {what}", hint, path)
    distance_m = float(np.hypot(shape.centroid.x, shape.centroid.y))
    if lonlat is not None:
        longitude, latitude = lonlat.mean(axis=0).tolist()
        distance_m, _ = distance_and_bearing((frame.latitude_deg, frame.longitude_deg), (latitude, longitude))
    if distance_m > MAX_DATUM_DISTANCE_M:
        swapped = lonlat is not None and np.all(np.abs(lonlat[:, 0]) <= 90)
        near = swapped and np.hypot(*frame.to_local(longitude, latitude)[0]) <= MAX_DATUM_DISTANCE_M
        if near:
            hint = "swap the numbers of each corner: longitude comes first"
        elif lonlat is None:
            hint = "give the corners in metres from the datum, not as coordinates of a map projection"
        else:
            hint = "check 'datum' and the signs of the corners, or leave 'datum' out"
        raise InputError(f"the boundary lies {distance_text(distance_m)} from the datum", hint, path)


def _read_geojson(path: Path) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Exterior and holes, as longitude and latitude, of the only polygon in a GeoJSON file."""
    try:
        content = read_json(read_limited(path, "check 'geojson' in the field file").decode("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"is not valid JSON: {error}", "export the boundary again as GeoJSON", path) from None
    polygons = list(_polygons(content))
    if len(polygons) != 1:
        raise InputError(
            f"holds {len(polygons)} polygons", "a field is one polygon: export only its boundary, in WGS-84", path
        )
    try:
        rings = [_open_ring(vertex[:2] for vertex in ring) for ring in polygons[0]]
        inside = all(ring.ndim == 2 and np.all(np.abs(ring) <= (180, 90)) for ring in rings)
    except (TypeError, ValueError, KeyError, OverflowError):
        rings, inside = [], False
    if not (rings and inside):
        raise InputError(
            "the boundary is not in degrees of longitude and latitude", "export it as GeoJSON in WGS-84", path
        )
    return rings[0], rings[1:]


def _polygons(node: Any) -> Iterable[list[Any]]:
    if isinstance(node, dict):
        if node.get("type") == "Polygon" and isinstance(node.get("coordinates"), list):
            yield node["coordinates"]
        elif node.get("type") == "MultiPolygon" and isinstance(node.get("coordinates"), list):
            yield from node["coordinates"]
        elif node.get("type") == "Feature":
            yield from _polygons(node.get("geometry"))
        else:
            for key in ("features", "geometries"):
                children = node.get(key)
                for child in children if isinstance(children, list) else []:
                    yield from _polygons(child)
