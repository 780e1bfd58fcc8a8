# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The field file: where the field lies, its boundary, and what inside it must not be entered."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Setting
from pydantic import ValidationInfo, field_validator, model_validator

from soilmoist_ros.foundation import (
    InputError,
    LocalFrame,
    Section,
    coordinates_text,
    distance_and_bearing,
    distance_text,
    foreign_text,
    load_model,
)
from soilmoist_ros.mapping.covariates import CovariateSection, CovariateSource, SlopeLimit, steep_areas
from soilmoist_ros.mapping.grid import FieldGrid, default_cell_m

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from soilmoist_ros.mapping.border_file import BorderSource

_log = logging.getLogger(__name__)

MAX_AREA_M2 = 1e9  # area above which a boundary is a mistake [m^2]
MIN_NO_GO_M2 = 1.0  # area below which a no-go area in metres is a mistake of units, such as degrees [m^2]
MIN_POST_M2 = 0.01  # area below which a no-go area in degrees is a mistake; a post has more [m^2]
MAX_DATUM_DISTANCE_M = 50_000.0
"""Distance of the boundary from its datum beyond which it is a mistake: the plane stretches by 0.5 m there [m]."""
_DEGREES = 1.0  # numbers this close to the field's datum in degrees are degrees
_FOOT_M = 0.3048
Vertex = tuple[float, float]
Ring = Annotated[list[Vertex], Setting(min_length=3)]


class Datum(Section):
    """Origin of the field's east-north coordinates."""

    latitude_deg: Annotated[float, Setting(ge=-90, le=90)]
    """Latitude, WGS-84 [deg]."""
    longitude_deg: Annotated[float, Setting(ge=-180, le=180)]
    """Longitude, WGS-84, east positive [deg]."""


class BorderSection(Section):
    """A file with the border of a field, and what of it is meant."""

    file: Path
    """GeoJSON, KML, KMZ, GPX, ISOXML, shapefile, GeoPackage, or a zip file with one; from the field file."""
    layer: str = ""
    """Layer of the file with the border; by default the only one with areas."""
    feature: str | int = ""
    """Number (from 1) or any property, such as the name, of the feature that is meant; by default the only one."""
    crs: str = ""
    """Reference system of a file that names none, such as ``EPSG:25832``; by default WGS-84."""

    def source(self, folder: Path) -> BorderSource:
        """The file, by its path from the folder of the field file."""
        from soilmoist_ros.mapping.border_file import BorderSource

        return BorderSource(folder / self.file, self.layer, str(self.feature), self.crs.strip())


class FieldFile(Section):
    """Sections and keys of a field file."""

    name: str = "unnamed field"
    """Name shown in reports."""
    datum: Datum | None = None
    """Origin of x (east) and y (north); the mean of the boundary if left out."""
    polygon: Ring | None = None
    """Boundary as [x, y] in metres from the datum."""
    polygon_lonlat: Ring | None = None
    """Boundary as [longitude, latitude] in degrees, east and north positive."""
    geojson: Path | None = None
    """File with the boundary, as ``border``."""
    border: Path | BorderSection | None = None
    """File of another program with the boundary, or a section with ``file``; polygons inside are no-go areas."""
    no_go: tuple[Ring | str, ...] = ()
    """Areas inside the boundary that are not mapped or entered, as [x, y] in metres from the datum, and a limit of
    the slope, such as ``slope > 15 deg``."""
    no_go_lonlat: tuple[Ring, ...] = ()
    """Areas inside the boundary that are not mapped or entered, as [longitude, latitude] in degrees."""
    cell_m: Annotated[float, Setting(gt=0)] | None = None
    """Cell size of the map [m]; chosen from the footprint and the extent if left out."""
    covariates: tuple[str | CovariateSection, ...] = ()
    """Covariates known at every place: FILE, FILE:BAND, or a section with ``file``, relative to the field file."""
    truth: Any = None
    """Truth of a surrogate field, for simulations; a field is mapped the same with or without it."""

    @field_validator("no_go", "no_go_lonlat", mode="before")
    @classmethod
    def _list_of_areas(cls, given: Any, info: ValidationInfo) -> Any:
        if given is None:  # a key whose areas are comments
            return ()
        given = rings = [given] if isinstance(given, str) and "slope" in given.lower() else given
        if info.field_name == "no_go" and isinstance(given, list):
            limits = [one for one in given if isinstance(one, str) and "slope" in one.lower()]
            for one in limits:
                SlopeLimit.parse(one)
            if len(limits) > 1:
                raise ValueError(f"has {len(limits)} limits of the slope: give one")
            rings = [one for one in given if one not in limits]
        if not isinstance(given, list) or any(
            not isinstance(ring, list) or (ring and not isinstance(ring[0], list)) for ring in rings
        ):
            raise ValueError("is a list of areas, each a list of corners: [[[1, 2], [3, 4], [5, 2]]]")
        return given

    @model_validator(mode="after")
    def _one_boundary(self) -> FieldFile:
        keys = ("polygon", "polygon_lonlat", "geojson", "border")
        given = [key for key in keys if getattr(self, key) is not None]
        if len(given) != 1:
            found = f"but there are {len(given)}: {', '.join(given)}" if given else "but there is none"
            raise ValueError(f"give one boundary: 'polygon', 'polygon_lonlat', 'geojson' or 'border', {found}")
        in_metres = [one for one in self.no_go if not isinstance(one, str)]
        if self.datum is None and (self.polygon is not None or in_metres):
            raise ValueError("a boundary or no-go area in metres needs a 'datum' to start from")
        for lon, lat in [*(self.polygon_lonlat or []), *(one for ring in self.no_go_lonlat for one in ring)]:
            if not (-180 <= lon <= 180 and -90 <= lat <= 90):
                swapped = abs(lon) <= 90 and abs(lat) <= 180
                hint = ", but [latitude, longitude]: longitude comes first" if swapped else ""
                raise ValueError(f"[{lon}, {lat}] is not [longitude, latitude] in degrees{hint}")
        return self

    @property
    def border_section(self) -> BorderSection | None:
        """The file with the boundary, if it is in one."""
        given = self.border if self.border is not None else self.geojson
        return BorderSection(file=given) if isinstance(given, Path) else given


@dataclass(frozen=True, eq=False, repr=False)
class Field:
    """A field in its own east-north plane.

    :param polygon: boundary, shape (k, 2) [m], not closed
    :param no_go: boundaries of areas to leave out, each of shape (k, 2) [m]
    :param cell_m: cell size of the map [m], ``None`` to choose it
    :param notes: what was decided when the file with the border was read, in words
    """

    name: str
    frame: LocalFrame
    polygon: NDArray[np.float64]
    no_go: tuple[NDArray[np.float64], ...] = ()
    cell_m: float | None = None
    covariates: tuple[CovariateSource, ...] = ()
    notes: tuple[str, ...] = ()

    MIN_AREA_M2: ClassVar[float] = 1.0
    """Area below which a boundary is a mistake [m^2]."""

    def grid(self, cell_m: float | None = None, footprint_radius_m: float = 10.0) -> FieldGrid:
        """Grid of the field: the only place where one is laid, so that maps, stops and truth share their cells.

        A field and a cell size make one grid. Whoever needs the cells of a map asks for the map's cell size.

        :param cell_m: cell size [m]; by default the field's own, else one chosen from its extent
        """
        width, height = np.ptp(self.polygon, axis=0).tolist()
        chosen = cell_m or self.cell_m or default_cell_m((width, height), footprint_radius_m)
        try:
            return _grid(self, chosen)
        except ValueError as error:
            raise InputError(
                f"the field {self.name!r} cannot be gridded: {error}", "change the cell size"
            ) from None

    def moved_to(self, frame: LocalFrame) -> Field:
        """The field in another plane; ``InputError`` if it lies beyond it, on another side of the earth."""
        if frame == self.frame:
            return self
        rings = [frame.to_local(*self.frame.to_geographic(one).T) for one in (self.polygon, *self.no_go)]
        if not np.isfinite(rings[0]).all():
            where = coordinates_text(frame.latitude_deg, frame.longitude_deg)
            message = f"the field {self.name!r} lies on another side of the earth than the records, at {where}"
            raise InputError(message, "correct the sign of latitude or longitude in the field file")
        return replace(self, frame=frame, polygon=rings[0], no_go=tuple(rings[1:]))

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
    """Read a field file, or a file with a border alone, such as GeoJSON: its name becomes that of the field.

    :raises InputError: with every mistake in the file or in the file with the border that it names
    """
    if path.suffix.lower() in _BORDER_ENDINGS:
        if not path.is_file():
            raise InputError("cannot be read: No such file or directory", "check the path of the field", path)
        content = FieldFile.model_validate({"name": path.stem, "border": path.name})
    else:
        content = load_model(path, FieldFile)
    section = content.border_section
    border = section.source(path.parent).read() if section is not None else None
    lonlat: NDArray[np.float64] | None = None
    if border is not None:
        lonlat = border.outline
    elif content.polygon_lonlat is not None:
        lonlat = _open_ring(content.polygon_lonlat)
    if content.datum is not None:
        frame = LocalFrame(content.datum.latitude_deg, content.datum.longitude_deg)
    else:
        assert lonlat is not None  # the model refuses a boundary in metres without a datum
        frame = _frame_about(lonlat)
    shown = path.parent / section.file if section is not None else path
    polygon = (
        frame.to_local(lonlat[:, 1], lonlat[:, 0]) if lonlat is not None else _open_ring(content.polygon or [])
    )
    if not np.all(np.isfinite(polygon)):
        raise InputError("the boundary is not on the datum's side of the earth", "check 'datum'", path)
    in_degrees = [*(border.no_go if border is not None else ()), *map(_open_ring, content.no_go_lonlat)]
    no_go = [frame.to_local(ring[:, 1], ring[:, 0]) for ring in in_degrees]
    no_go += [_open_ring(ring) for ring in content.no_go if not isinstance(ring, str)]
    _require_valid(polygon, "the boundary", shown)
    _require_plausible(polygon, lonlat, frame, shown, section is not None)
    for number, ring in enumerate(no_go, start=1):
        in_border = border is not None and number <= len(border.no_go)
        name, lonlat_given = f"no-go area {number}", number <= len(in_degrees)
        require_no_go(ring, name, polygon, frame, shown if in_border else path, lonlat_given)
    _require_room(polygon, no_go, path)
    covariates = tuple(
        CovariateSource.parse(one, path.parent) if isinstance(one, str) else one.source(path.parent)
        for one in content.covariates
    )
    notes = border.notes if border is not None else ()
    for limit in (SlopeLimit.parse(one) for one in content.no_go if isinstance(one, str)):
        steep, note = _steep(limit, covariates, path, frame, polygon)
        no_go, notes = [*no_go, *steep], (*notes, note)
        _require_room(polygon, no_go, path)
    for note in notes:
        _log_once(str(shown), note)
    return Field(foreign_text(content.name), frame, polygon, tuple(no_go), content.cell_m, covariates, notes)


def _steep(
    limit: SlopeLimit,
    covariates: Sequence[CovariateSource],
    path: Path,
    frame: LocalFrame,
    polygon: NDArray[np.float64],
) -> tuple[list[NDArray[np.float64]], str]:
    """No-go areas by a limit of the slope, and what they are, in words."""
    import shapely

    try:
        source = limit.elevations(covariates, path.parent)
    except ValueError as error:
        remedy = "list one file under 'covariates' with 'derive: [slope]', or write 'slope > ... in FILE'"
        raise InputError(f"no_go, {limit.text!r}: {error}", remedy, path) from None
    if not source.path.is_file():
        raise InputError(f"no_go, {limit.text!r}: there is no file {source.path}", "check its path", path)
    rings, doubts = steep_areas(limit, source, frame, polygon)
    shapes, field = [shapely.Polygon(ring) for ring in rings], shapely.Polygon(polygon)
    share = shapely.union_all(shapes).intersection(field).area / field.area
    parts = "1 area" if len(rings) == 1 else f"{len(rings)} areas"
    text = f"no-go by {limit.text!r} in {source.path.name}: {parts}, {share:.1%} of the field"
    return rings, "; ".join([text, *doubts])


_BORDER_ENDINGS = (".geojson", ".shp", ".gpkg", ".fgb", ".kml", ".kmz", ".gpx", ".xml", ".zip")


@lru_cache(maxsize=256)
def _log_once(file: str, note: str) -> None:
    _log.info("%s: %s", file, note)


def _frame_about(lonlat: NDArray[np.float64]) -> LocalFrame:
    """Plane about the mean of the corners, which may lie on both sides of the 180th meridian."""
    first = lonlat[0, 0]
    longitude = first + float(np.mean((lonlat[:, 0] - first + 180) % 360 - 180))
    latitude = float(lonlat[:, 1].mean())
    return LocalFrame(round(latitude, 7), round((longitude + 180) % 360 - 180, 7))


def _open_ring(vertices: Iterable[Any]) -> NDArray[np.float64]:
    ring = np.array(list(vertices), dtype=float)
    return ring[:-1] if len(ring) > 3 and np.array_equal(ring[0], ring[-1]) else ring


def _require_valid(ring: NDArray[np.float64], name: str, path: Path | None) -> None:
    from shapely import Polygon
    from shapely.validation import explain_validity

    if len(ring) < 3:
        raise InputError(f"{name} has {len(ring)} corners", "give at least three corners not on one line", path)
    polygon = Polygon(ring)
    if not polygon.is_valid:
        raise InputError(
            f"{name} is not a simple polygon: {explain_validity(polygon)}",
            "list the corners in order around it, without crossing lines",
            path,
        )
    if polygon.area <= 0:
        raise InputError(f"{name} encloses no area", "give at least three corners not on one line", path)


class Misplaced(StrEnum):
    """Likely cause of places that miss a field."""

    LONLAT = "degrees, longitude first"
    LATLON = "degrees, latitude first"
    PROJECTED = "coordinates of a map projection"
    SWAPPED = "x and y swapped"
    FEET = "feet"

    @classmethod
    def of(cls, shape: BaseGeometry, field: BaseGeometry, frame: LocalFrame) -> Misplaced | None:
        """Likely cause of a shape that misses a field, ``None`` if none is known."""
        import shapely

        corners = shapely.get_coordinates(shape)
        datum = np.array([frame.longitude_deg, frame.latitude_deg])
        if np.abs(corners - datum).max() < _DEGREES:
            return Misplaced.LONLAT
        if np.abs(corners - datum[::-1]).max() < _DEGREES:
            return Misplaced.LATLON
        if np.abs(corners).max() > 2 * MAX_DATUM_DISTANCE_M:
            return Misplaced.PROJECTED
        if shapely.transform(shape, lambda xy: xy[:, ::-1]).intersects(field):
            return Misplaced.SWAPPED
        return Misplaced.FEET if shapely.transform(shape, lambda xy: xy * _FOOT_M).intersects(field) else None


_NO_GO_REMEDIES = {
    Misplaced.LONLAT: "it looks like [longitude, latitude] in degrees: give it under 'no_go_lonlat'",
    Misplaced.LATLON: "it looks like degrees, latitude first: give [longitude, latitude] under 'no_go_lonlat'",
    Misplaced.PROJECTED: "give it in metres from the datum, not as coordinates of a map projection",
    Misplaced.SWAPPED: "with x and y of each corner swapped it touches the field: x (east) comes first",
    Misplaced.FEET: "give it in metres east and north of the datum: read as feet, it touches the field",
    None: "give it in metres east and north of the datum; draw one at the border so that it touches the field",
}


def require_no_go(
    ring: NDArray[np.float64],
    name: str,
    polygon: NDArray[np.float64],
    frame: LocalFrame,
    path: Path | None = None,
    lonlat: bool = False,
) -> None:
    """Check that a no-go area is an area, has the size of one, and touches the field: else it fences off nothing.

    :param ring: its corners, shape (k, 2) [m]
    :param lonlat: whether it was given in degrees
    :raises InputError: if it is none, with its size or distance, and the likely cause
    """
    from shapely import Polygon

    if not np.all(np.isfinite(ring)):
        remedy = "check its corners: longitude comes first, east and north are positive"
        raise InputError(f"{name} is not on the field's side of the earth", remedy, path)
    _require_valid(ring, name, path)
    area, field = Polygon(ring), Polygon(polygon)
    distance_m = float(area.distance(field))
    smallest_m2 = MIN_POST_M2 if lonlat else MIN_NO_GO_M2
    if distance_m == 0 and area.area >= smallest_m2:
        return
    away = distance_text(distance_m) if distance_m >= 1 else f"{distance_m:.2g} m"
    what = f"{name} lies {away} from the field"
    cause = Misplaced.of(area, field, frame)
    if 0 < distance_m < 1 and cause in (Misplaced.SWAPPED, Misplaced.FEET):
        cause = None  # rather next to the border than of another unit
    hint = _NO_GO_REMEDIES[cause]
    if distance_m == 0:
        what = f"{name} encloses {area.area:.2g} m2, less than {smallest_m2:g} m2"
        if lonlat or cause not in (Misplaced.LONLAT, Misplaced.LATLON):
            hint = f"{'' if lonlat else 'give metres; '}draw a post or well with {smallest_m2:g} m2 or more"
    elif lonlat:
        hint = "check the datum and its corners: longitude comes first, east and north are positive"
    elif path is None and cause in (Misplaced.LONLAT, Misplaced.LATLON):
        hint = f"it looks like {cause}: give metres east and north of the field's datum"
    raise InputError(what, hint, path)


def _require_room(polygon: NDArray[np.float64], no_go: Sequence[NDArray[np.float64]], path: Path) -> None:
    """Check that no-go areas leave something of the field."""
    import shapely

    field, areas = shapely.Polygon(polygon), [shapely.Polygon(ring) for ring in no_go]
    if areas and field.difference(shapely.union_all(areas)).area < Field.MIN_AREA_M2:
        alone = [number for number, area in enumerate(areas, 1) if field.difference(area).area < Field.MIN_AREA_M2]
        what = f"no-go area {alone[0]} covers" if alone else f"the {len(areas)} no-go areas cover"
        raise InputError(f"{what} the whole field", "a no-go area is a part of the field to keep out of", path)


def _require_plausible(
    polygon: NDArray[np.float64], lonlat: NDArray[np.float64] | None, frame: LocalFrame, path: Path, in_file: bool
) -> None:
    """Check area and place of a boundary: mistakes of units, order and datum are off by orders of magnitude."""
    from shapely import Polygon

    shape = Polygon(polygon)
    if not Field.MIN_AREA_M2 <= shape.area <= MAX_AREA_M2:
        large = shape.area > MAX_AREA_M2
        size = f"{shape.area / 1e6:,.0f} km2" if large else f"{shape.area:.3g} m2"
        what = "too large for a survey" if large else "smaller than any footprint of the sensor"
        hint = "check the corners: 'polygon' is in metres from the datum, 'polygon_lonlat' in degrees"
        near = np.abs(polygon - (frame.longitude_deg, frame.latitude_deg)).max() < 1
        if lonlat is None and not large and near:
            hint = "the corners look like degrees: give [longitude, latitude] under 'polygon_lonlat'"
        elif in_file:
            hint = "check the corners and the reference system of the file"
        raise InputError(f"the boundary encloses {size}, {what}", hint, path)
    distance_m = float(np.hypot(shape.centroid.x, shape.centroid.y))
    if lonlat is not None:
        longitude, latitude = lonlat[0].tolist()
        distance_m, _ = distance_and_bearing((frame.latitude_deg, frame.longitude_deg), (latitude, longitude))
    if distance_m > MAX_DATUM_DISTANCE_M:
        hint = "longitude comes first in corners, west is negative: check them and 'datum'"
        if lonlat is None:
            hint = "give the corners in metres from the datum, not as coordinates of a map projection"
        raise InputError(f"the boundary lies {distance_text(distance_m)} from the datum", hint, path)
