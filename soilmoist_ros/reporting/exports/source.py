# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Source of exports: maps, samples, records and shapes of a run, read from its folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, install
from soilmoist_ros.pipeline import EARLIEST_STAMP_S, calibration_method, curve_of, is_illustrative, shape_of
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, calibration_state, guess_text
from soilmoist_ros.reporting.dose import DoseSettings
from soilmoist_ros.reporting.opened_run import Columns, OpenedRun
from soilmoist_ros.sensing import MoistureCurve

if TYPE_CHECKING:
    from pyproj import CRS, Transformer
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

ROOT_DEPTH_MM = 300.0


@dataclass(frozen=True)
class ExportSettings:
    """Settings of exports.

    :param min_zone_ha: minimum area of a part of the field that is a zone [ha]; by default 5 % of the field
    :param rate_column: name of the column with the irrigation rate, at most ten characters
    :param rate_unit: its unit, and the unit that a terminal shows: ``mm``, ``l/m2``, ``m3/ha``, ``in``, ``gal/ac``
    :param isoxml_version: version of ISO 11783-10, 3 or 4; terminals for version 4 read version 3 too
    :param isoxml_form: ``grid1`` (codes of zones), ``grid2`` (rates) or ``polygons``
    :param passes: number of passes that share a dose, for rates that one task cannot hold
    :param max_cells: most cells of the grid that the terminal takes; larger grids get larger cells
    :param max_zones: most zones that the terminal takes, at most 254
    """

    min_zone_ha: float | None = None
    rate_column: str = "RATE"
    rate_unit: str = "mm"
    isoxml_version: int = 3
    isoxml_form: str = "grid1"
    passes: int = 1
    max_cells: int = 40_000
    max_zones: int = 254


def transformed(transform: Any, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Places after an affine transform. Its own operator differs between versions of the library."""
    right, down = np.asarray(x, float), np.asarray(y, float)
    a, b, c, d, e, f = tuple(transform)[:6]
    return a * right + b * down + c, d * right + e * down + f


class Quantity(NamedTuple):
    """Quantity that a map shows to readers: the band of ``map.tif`` times the scale, in the unit.

    :param column: name with unit for tables, at most ten ASCII characters
    :param colours: colour map; light for low, dark for high values
    """

    band: str
    title: str
    unit: str
    scale: float
    column: str
    colours: str


MOISTURE = Quantity("vwc", "Soil moisture", "% by volume", 100.0, "VWC_PCT", "YlGnBu")
RATE = Quantity("rate", "Neutron count rate", "counts/s", 1.0, "RATE_CPS", "YlOrBr")


@dataclass(frozen=True, eq=False)
class ExportedProperty:
    """Map and points of one property of a run.

    :param name: name of the property, empty for the first; ``label`` is for readers
    :param bands: rasters by name, shape (rows, columns), north up, NaN outside the field
    :param transform: affine transform from pixels to the reference system
    :param tags: tags of the file
    :param samples: columns, see :meth:`OpenedRun.samples`; ``records`` see :meth:`OpenedRun.records`
    :param curve: calibration of the moisture, ``None`` if it is not known
    """

    name: str
    label: str
    bands: Columns
    transform: Any
    crs: CRS
    tags: Mapping[str, str]
    frame: LocalFrame
    samples: Columns
    records: Columns
    curve: MoistureCurve | None = None

    @property
    def suffix(self) -> str:
        """End of the names of its files and layers: empty for the first property."""
        return f"_{self.name}" if self.name else ""

    @property
    def quantity(self) -> Quantity:
        """Moisture where there is any, else the count rate."""
        moisture = self.bands.get(MOISTURE.band)
        return MOISTURE if moisture is not None and np.isfinite(moisture).any() else RATE

    @property
    def calibration(self) -> str:
        """Origin of its calibration, see :func:`calibration_state`."""
        return self.tags.get(CALIBRATION_TAG, "none") if self.quantity is MOISTURE else "none"

    @property
    def unit(self) -> str:
        """Unit for readers, with a word if the level is not real."""
        return self.quantity.unit + guess_text(self.calibration)

    @property
    def title(self) -> str:
        """Quantity and unit for readers, with the property where there are several."""
        return f"{f'{self.label}: ' if self.name else ''}{self.quantity.title} [{self.unit}]"

    @property
    def values(self) -> Array:
        """The quantity in its unit for readers, shape (rows, columns)."""
        return np.asarray(self.bands[self.quantity.band] * self.quantity.scale, float)

    @property
    def sd(self) -> Array:
        """Standard deviation of :attr:`values`."""
        return np.asarray(self.bands[f"{self.quantity.band}_sd"] * self.quantity.scale, float)

    @cached_property
    def _from_crs(self) -> Transformer:
        from pyproj import Transformer

        return Transformer.from_crs(self.crs, self.frame.crs, always_xy=True)

    def to_local(self, pixels: ArrayLike) -> Array:
        """East and north [m] of raster places (column, row), counted from the centre of the first cell; (n, 2)."""
        column, row = np.asarray(pixels, float).reshape(-1, 2).T + 0.5
        return np.column_stack(self._from_crs.transform(*transformed(self.transform, column, row)))

    @cached_property
    def cells(self) -> tuple[NDArray[np.bool_], Array]:
        """Mask of the cells inside the field, shape (rows, columns), and their places, shape (n, 2) [m]."""
        inside = np.isfinite(self.bands["rate"])
        row, column = np.nonzero(inside)
        return inside, self.to_local(np.column_stack([column, row]))

    @property
    def cell_m(self) -> float:
        """Side of a cell [m]."""
        corner = self.to_local([(0, 0), (1, 0)])
        return float(np.hypot(*(corner[1] - corner[0])))


@dataclass(frozen=True, eq=False)
class RunSource:
    """A run for exports; shapes are in the plane of the field [m].

    :param properties: maps of all properties, at least one
    :param boundary: the field without its no-go areas
    :param tracks: driven lines
    :param notes: what the user should know, such as what the folder lacks; exports add to it
    """

    run: OpenedRun
    properties: Sequence[ExportedProperty]
    frame: LocalFrame
    boundary: BaseGeometry
    no_go: Sequence[BaseGeometry]
    tracks: Sequence[BaseGeometry]
    notes: list[str] = field(default_factory=list)

    @property
    def title(self) -> str:
        """Name of the field for readers."""
        return str(self.run.summary.get("field") or self.run.folder.resolve().name)

    @property
    def simulated(self) -> bool:
        """True if the counts come from a simulation."""
        return bool(self.run.summary.get("simulated"))

    @cached_property
    def root_zone(self) -> DoseSettings | None:
        """Limits of the root zone, as the run has them."""
        about = self.run.summary
        known = (about.get("irrigation") or {}).get("root_zone") or (about.get("dose") or {}).get("settings")
        return DoseSettings(**known) if known else None

    @property
    def survey(self) -> tuple[datetime, datetime] | None:
        """First and last time of the survey (UTC); ``None`` for a clock without a date."""
        about = self.run.summary
        first, last = float(about.get("first_stamp_s") or 0), float(about.get("last_stamp_s") or 0)
        if min(first, last) < EARLIEST_STAMP_S:
            return None
        begin, end = (datetime.fromtimestamp(stamp_s, UTC) for stamp_s in (first, last))
        known = about.get("survey_start_utc")
        return datetime.fromisoformat(known) if known else begin, end


def open_source(run: OpenedRun) -> RunSource:
    """Read what exports need from the folder of a run.

    :raises InputError: if the run has no map, or a file is damaged
    """
    about = run.summary
    if not run.properties or not about.get("datum"):
        raise InputError(*_no_map(run), run.folder)
    frame = LocalFrame(about["datum"]["latitude_deg"], about["datum"]["longitude_deg"])
    boundary, no_go, tracks = field_shapes(run, frame)
    labels = {one.get("name", ""): one.get("label", "") for one in about.get("properties") or ()}
    maps = []
    for name in run.properties:
        label = labels.get(name) or name or next(iter(labels.values()), "")
        bands, transform, crs, tags = run.raster(name)
        real, simulated = not is_illustrative(about), bool(about.get("simulated"))
        state = calibration_state(MOISTURE.band in bands, real, simulated, calibration_method(about))
        tags = {CALIBRATION_TAG: state, **tags}  # older GeoTIFFs do not say it
        curve = None if name else curve_of(about, run.folder)
        columns = run.samples(name), run.records(name)
        maps.append(ExportedProperty(name, label, bands, transform, crs, tags, frame, *columns, curve))
    return RunSource(run, maps, frame, boundary, no_go, tracks)


def _no_map(run: OpenedRun) -> tuple[str, str]:
    """Reason why there is no map to export, and what to do."""
    about = run.summary
    if not about.get("map"):
        return "the run has no map, so there is nothing to export", "report.html of the run says why"
    if "map.tif" in about.get("outputs", ("map.tif",)):
        return "map.tif is missing: it was there when the run was made", "copy it back, or make the run again"
    return (
        "the run was made without the extra reports, which writes map.tif",
        f"{install('reports')}, then repeat the command of the run with --overwrite",
    )


def field_shapes(run: OpenedRun, frame: LocalFrame) -> tuple[BaseGeometry, list[BaseGeometry], list[BaseGeometry]]:
    """Field, no-go areas and tracks in the plane of the field."""
    from shapely import Polygon, get_parts, transform, union_all

    found: dict[str, list[BaseGeometry]] = {"field": [], "no_go": [], "track": []}
    for feature in run.features():
        kind = feature["properties"].get("kind")
        if kind in found:
            there = shape_of(feature, run.folder / "samples.geojson")
            found[kind].append(transform(there, lambda lon_lat: frame.to_local(lon_lat[:, 1], lon_lat[:, 0])))
    if not found["field"]:
        raise InputError("samples.geojson has no field", "make the run again", run.folder)
    boundary = union_all(found["field"])
    # Runs of earlier releases list no no-go areas: the holes of the field stand for them.
    holes: list[BaseGeometry] = [Polygon(ring) for part in get_parts(boundary) for ring in part.interiors]
    return boundary, found["no_go"] or holes, list(get_parts(found["track"]))
