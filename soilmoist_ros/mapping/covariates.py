# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates: what else is known at every place of a field, such as relief, soil maps or satellite images.

A source names a file, a part of it, and what is derived from elevations. The values are read from the files
(:mod:`.covariate_files`), brought to the cells of the field and standardised.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, Section, floats, listing
from soilmoist_ros.mapping.covariate_files import (
    BEGINNINGS,
    USUAL_NODATA,
    RasterBands,
    attribute_of,
    derivatives,
    horn_slope,
    indicators,
    opened_raster,
    read_polygons,
)
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples import check_xy

Derived = Literal["elevation", "slope", "aspect", "northness", "eastness", "curvature"]
DERIVED: tuple[Derived, ...] = get_args(Derived)
"""Covariates derived from elevations; ``elevation`` is the band itself, ``aspect`` northness and eastness."""
EXTENDED_M = 15.0
"""Distance up to which a missing cell has the value of the nearest known one, the less certain the farther [m]."""
MAX_TERRAIN_CELLS = 100_000
"""Cells of the raster on which elevations are evaluated; a larger one gets larger cells."""
MIN_SPREAD = 1e-9
"""Standard deviation of a covariate, as a share of its largest value, below which it is the same everywhere."""


@dataclass(frozen=True)
class CovariateSource:
    """A file with covariates.

    :param band: number (from 1) or name of the raster's band, something that is derived from elevations if no band
        has this name, or the attribute of the polygons; empty for the first band, or the only attribute
    :param derive: what is made of elevations; empty for the values themselves
    """

    path: Path
    band: str = ""
    derive: tuple[Derived, ...] = ()
    name: str = ""

    @classmethod
    def parse(cls, text: str, folder: Path = Path()) -> CovariateSource:
        """Read ``FILE`` or ``FILE:BAND``.

        >>> CovariateSource.parse("relief.tif:slope").band
        'slope'
        """
        file, _, band = text.rpartition(":")
        if not file or (folder / text).exists() or "/" in band or "\\" in band:
            file, band = text, ""
        return cls(folder / Path(file).expanduser(), band)

    def unused_parts(self) -> str:
        """Bands or attributes of a file that are not used, in words; empty if all are."""
        if self.has_polygons:
            used, names = attribute_of(self.path, self.band)
            others, what = [name for name in names if name != used], "attributes"
        else:
            with opened_raster(self.path) as raster:
                bands = RasterBands(self.path, raster)
                number = _derived(self, bands)[1]
            labels = [name or str(each) for each, name in enumerate(bands.names, start=1)]
            others, what = labels[: number - 1] + labels[number:], "bands"
        return f"{what} of {self.path.name} that are not used: {listing(others)}" if others else ""

    @property
    def has_polygons(self) -> bool:
        """True if the file has polygons, by its ending; ``InputError`` if there is no file."""
        if not self.path.is_file():
            raise InputError("there is no such file of covariates", "check its path", self.path)
        found = self.path.suffix.lower() in BEGINNINGS
        if found and self.derive:
            raise InputError("has polygons: nothing is derived from them", "remove 'derive'", self.path)
        return found

    @property
    def label(self) -> str:
        """Name for readers."""
        return self.name or self.path.stem

    @property
    def section(self) -> dict[str, object]:
        """The source in a field file of any folder, without what is left out."""
        keys = {"band": self.band, "derive": list(self.derive), "name": self.name}
        return {"file": str(self.path.absolute()), **{key: value for key, value in keys.items() if value}}

    @property
    def absolute(self) -> CovariateSource:
        """The source with an absolute path."""
        return replace(self, path=self.path.absolute())

    def __str__(self) -> str:
        return f"{self.path}:{self.band}" if self.band else str(self.path)


class CovariateSection(Section):
    """A file with covariates, in a field file."""

    file: Path
    """GeoTIFF, or GeoJSON or GeoPackage with polygons, in any reference system; relative to the field file."""
    band: str | int = ""
    """Number or name of the band, or attribute of the polygons; by default the first, or the only one."""
    derive: tuple[Derived, ...] = ()
    """Covariates derived from a band of elevations [m]; ``elevation`` is the band itself."""
    name: str = ""
    """Name in reports; by default that of the file."""

    def source(self, folder: Path) -> CovariateSource:
        """The source, with its path from the folder of the field file."""
        return CovariateSource(folder / self.file, str(self.band), self.derive, self.name)


# -- Ground that is too steep --------------------------------------------------------------------------------

GROUND_M = 1.0
"""Cells of elevations on which slopes are judged, unless pixels are larger: three of them, the base of a slope,
are about as long as a robot [m]."""
COARSE_M = 3.0  # pixels of elevations from which the steepness of banks and ditches is not seen [m]
ROUNDED_SHARE = 0.125  # slope by the rounding of elevations, as a share of the limit, from which it is named
ELEVATIONS_M = (-1000.0, 10000.0)  # between which elevations of ground lie [m]
FAR_M = 20.0  # distance from the rest of the elevations from which one value of many cells is none [m]
FAR_SPREADS = 3.0  # the same, in interquartile ranges of the rest
MANY = 0.02  # share of the cells from which one value has many
GAP_VALUES = (*USUAL_NODATA, 32767.0, -32767.0, 65535.0)  # they need not be many
CLIFF = 1.0  # slope from which values between 0 and 100 are rather slopes, if most that is not level has it [m/m]
NEAR_0 = 0.05  # share of the highest value below which the lowest is as near to 0 as those of slopes are
LEVEL = 0.02  # slope up to which ground is level [m/m]
MAX_STEEP_AREAS = 300
"""Steep areas of a field from which it is noise."""
_SLOPE = re.compile(
    r"slope\s*>=?\s*(?P<limit>\d+(\.\d*)?)\s*(?P<unit>deg|degrees?|°|%|per ?cent)"
    r"(\s+in\s+(?P<file>[^,]+?))?(\s*,\s*unknown\s+(?P<unknown>no_go|allowed))?",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class SlopeLimit:
    """Slope above which ground must not be entered.

    :param text: as it was given, such as ``slope > 15 deg``
    :param limit: tangent of the slope [m/m], > 0
    :param file: elevations; empty for the field's covariates that are derived from elevations
    :param unknown: whether ground without an elevation is ``no_go`` or ``allowed``; empty if that was not said
    """

    text: str
    limit: float
    file: str = ""
    unknown: str = ""

    @classmethod
    def parse(cls, text: str) -> SlopeLimit:
        """Read ``slope > 15 deg`` or ``slope > 20 % in FILE, unknown allowed``.

        >>> SlopeLimit.parse("slope > 20 %").limit
        0.2
        """
        found = _SLOPE.fullmatch(text.strip())
        value = float(found["limit"]) if found else 0.0
        degrees = found is not None and found["unit"].lower()[0] in "d°"
        if found is None or not 0 < value < (90 if degrees else 1000):
            raise ValueError(
                f"{text!r} is no limit of the slope: write 'slope > 15 deg' or 'slope > 25 %'; ' in FILE' names "
                "elevations, ', unknown no_go' or ', unknown allowed' says what holds where there are none"
            )
        limit = math.tan(math.radians(value)) if degrees else value / 100
        return cls(text.strip(), limit, (found["file"] or "").strip(), (found["unknown"] or "").lower())

    def elevations(self, sources: Sequence[CovariateSource], folder: Path) -> CovariateSource:
        """The file of elevations that is meant.

        :raises ValueError: if that is not clear
        """
        if self.file:
            return CovariateSource.parse(self.file, folder)
        terrain = [one for one in sources if one.derive or one.band in DERIVED]
        if len({one.path for one in terrain}) != 1:
            known = listing(str(one.path.name) for one in terrain)
            raise ValueError(f"several files have elevations: {known}" if terrain else "no elevations are known")
        return terrain[0]


def steep_areas(
    slope: SlopeLimit, source: CovariateSource, frame: LocalFrame, polygon: Array
) -> tuple[list[Array], list[str]]:
    """Outlines of the ground in a field that is steeper than a limit, shape (k, 2) each [m], and what is doubtful.

    Level ground that is steep all around belongs to it. Outlines lie up to a cell outside the steep cells.

    :param polygon: boundary of the field, shape (n, 2) [m]
    :raises InputError: if elevations are missing and nothing is said about it, or for noise instead of areas
    """
    import shapely

    field, (west, south), (east, north) = shapely.Polygon(polygon), polygon.min(axis=0), polygon.max(axis=0)
    with opened_raster(source.path) as raster:
        bands = RasterBands(source.path, raster)
        number, pixel_m = _derived(source, bands)[1], bands.pixel_m(frame)
        if not math.isfinite(pixel_m):
            raise InputError("does not cover the field", "check its reference system (CRS)", source.path)
        step_m = max(pixel_m, GROUND_M, math.sqrt((east - west) * (north - south) / MAX_TERRAIN_CELLS))
        spans, margin_m = ((west, east), (south, north)), 2 * step_m
        x_m, y_m = (np.arange(low - margin_m, high + margin_m + step_m, step_m) for low, high in spans)
        heights, none, notes = _elevations(bands, number, frame, x_m, y_m, slope.limit)
    grid_xy = np.column_stack([axis.ravel() for axis in np.meshgrid(x_m, y_m)])
    inside = shapely.contains_xy(field.buffer(step_m / 2), grid_xy).reshape(heights.shape)
    gaps = inside & ~np.isfinite(heights)
    if gaps.any():
        first = grid_xy[gaps.ravel()][0]
        share, place = gaps.sum() / inside.sum(), f"({first[0]:.0f}, {first[1]:.0f}) m"
        what = f"{share:.1%} of the field has no elevation, such as {place}{none}"
        if not slope.unknown:
            remedy = f"give a file with all of it, or write '{slope.text}, unknown no_go' or ', unknown allowed'"
            raise InputError(what, remedy, source.path)
        notes.append(f"{what}: {slope.unknown}")
    steepness = horn_slope(heights, step_m)
    steep = inside & (np.where(np.isfinite(steepness), steepness, 0.0) > slope.limit)
    steep |= gaps & (slope.unknown == "no_go")
    if pixel_m > COARSE_M:
        notes.append(f"its pixels are {pixel_m:.0f} m wide: shorter banks and ditches are not seen")
    half = step_m / 2
    x, y = grid_xy[steep.ravel()].T
    joined = shapely.union_all(shapely.box(x - half, y - half, x + half, y + half))
    joined = joined.buffer(half, join_style="mitre").simplify(half)
    parts = [part for part in shapely.get_parts(joined) if part.intersects(field)]
    if len(parts) > MAX_STEEP_AREAS:
        what = f"'{slope.text}' makes {len(parts)} no-go areas: elevations are noisy, or the limit is low"
        raise InputError(what, "smooth the elevations, or raise the limit", source.path)
    return [shapely.get_coordinates(part.exterior)[:-1] for part in parts], notes


def _elevations(
    bands: RasterBands, number: int, frame: LocalFrame, x_m: Array, y_m: Array, limit: float
) -> tuple[Array, str, list[str]]:
    """Elevations at square cells [m], NaN where there are none; what stands there instead; and what is doubtful.

    :param limit: slope that must be seen [m/m]
    :raises InputError: if they are slopes, or so rounded that a single step is steeper than the limit
    """
    from scipy.ndimage import binary_dilation

    (unit_m, unit), (scale, offset), step_m = bands.unit(number), bands.scale(number), float(x_m[1] - x_m[0])
    factor, notes = unit_m if math.isfinite(unit_m) else 1.0, list[str]()
    stored = bands.stored(number, frame, x_m, y_m)
    nearest, heights = (stored * scale + offset) * factor, bands.on(number, frame, x_m, y_m) * factor
    false = _false_elevations(stored, nearest)
    missing = np.isin(stored, false)
    heights[binary_dilation(missing, np.ones((3, 3))) | _implausible(heights)] = np.nan
    known, steepness = heights[np.isfinite(heights)], horn_slope(heights, step_m)
    rough = steepness[steepness > LEVEL]
    says = bands.slopes_by_name(number)
    is_low = known.size > 0 and 0 <= known.min() < known.max() <= 100
    jumps = is_low and rough.size > MANY * known.size and np.median(rough) > CLIFF
    if (says or jumps) and not (unit and unit_m == 1.0):
        what = "looks like slopes, not elevations: "
        what += f"it is named {says!r}" if says else "its values jump, or have another unit"
        remedy = "give elevations, with the unit 'm' of the band if they are; of slopes, draw no-go areas in a GIS"
        raise InputError(what, remedy, bands.path)
    if is_low and known.min() < NEAR_0 * known.max() and not unit:
        notes.append(
            f"its values, {known.min():.2g} to {known.max():.3g}, could be slopes: it must have elevations"
        )
    if not math.isfinite(unit_m):
        notes.append(f"its elevations are taken as metres, though it names {unit!r}")
    elif unit_m != 1.0:
        notes.append(f"its elevations are converted from {unit!r} to metres")
    pixels = stored[np.isfinite(stored) & ~missing]
    whole = (pixels == np.round(pixels)).all() and (np.diff(np.unique(pixels)) == 1).any()
    rounded_m = abs(scale) * factor if whole else 0.0
    if (steep := rounded_m / 2 / step_m) > ROUNDED_SHARE * limit:
        notes.append(f"its elevations have steps of {rounded_m:.2g} m, which make slopes or hide them")
        if steep > limit:
            remedy = "give finer elevations, or the band its unit, such as 'cm'"
            raise InputError(f"{notes[-1]}: one step is too steep", remedy, bands.path)
    none = ""
    if len(false):
        values = listing(f"{value:g}" for value in false) if len(false) < 4 else f"{false[0]:g} to {false[-1]:g}"
        none = f"; {missing.mean():.1%} of the file's cells there have {values}, which is taken as missing"
    return heights, none, notes


def _implausible(heights: Array) -> NDArray[np.bool_]:
    return (heights <= ELEVATIONS_M[0]) | (heights >= ELEVATIONS_M[1])


def _false_elevations(stored: Array, heights: Array) -> list[float]:
    """Values as stored, in order, that are no elevations: implausible, or of many cells and far from the rest."""
    false = np.unique(stored[_implausible(heights)]).tolist()
    values, counts = np.unique(stored[np.isfinite(stored)], return_counts=True)
    likely = (counts > MANY * counts.sum()) | np.isin(values, GAP_VALUES)
    order = np.lexsort((counts, values != 0))  # of two values that are far from each other, 0, or the rarer
    for value in values[order][likely[order]].tolist():
        rest = heights[np.isfinite(heights) & ~np.isin(stored, [*false, value])]
        few = 0 if value in (0.0, *GAP_VALUES) else MANY * counts.sum()  # a spike makes no gap of level ground
        if value not in false and rest.size > few:
            low, first, third, high = np.quantile(rest, (0.05, 0.25, 0.75, 0.95))
            height = heights[stored == value][0]
            if max(low - height, height - high) > max(FAR_M, FAR_SPREADS * (third - first)):
                false.append(value)
    return sorted(false)


# -- Standardised covariates ---------------------------------------------------------------------------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Covariates:
    """Covariates on the raster of a field, standardised: mean 0 and standard deviation 1 over its cells.

    The arrays are copied, checked and made read-only.

    :param names: how reports and messages name them; distinct
    :param x_m: centres of the columns, increasing, shape (nx,) [m]
    :param y_m: centres of the rows, increasing, shape (ny,) [m]
    :param layers: standardised values, NaN where they are missing, shape (k, ny, nx)

    >>> grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40), (0, 40)], cell_m=10.0)
    >>> slope = Covariates.over(grid, ["slope"], [np.tile(grid.x_m, (4, 1))])
    >>> slope.at([(5, 20), (55, 20)]).round(2)
    array([[-1.46],
           [ 1.46]])
    """

    names: tuple[str, ...]
    x_m: Array
    y_m: Array
    layers: Array

    def __post_init__(self) -> None:
        names = tuple(self.names)
        x_m, y_m, layers = (np.array(values, float) for values in (self.x_m, self.y_m, self.layers))
        if len(set(names)) != len(names):
            raise ValueError(f"the covariates need distinct names, got {', '.join(names)}")
        if layers.shape != (len(names), len(y_m), len(x_m)):
            shape = (len(names), len(y_m), len(x_m))
            raise ValueError(f"layers must have shape {shape} like names, y_m and x_m, got {layers.shape}")
        for axis in (x_m, y_m):
            if not len(axis) or not (np.diff(axis) > 0).all():
                raise ValueError("x_m and y_m must increase")
        object.__setattr__(self, "names", names)
        for name, values in (("x_m", x_m), ("y_m", y_m), ("layers", layers)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def over(cls, grid: FieldGrid, names: ArrayLike, rasters: ArrayLike) -> Covariates:
        """Standardise rasters over the cells of a field. A raster that is constant there becomes 0.

        :param rasters: values in any unit, NaN or masked where they are missing, shape (k, ny, nx)
        """
        layers = np.array(floats(rasters)).reshape(-1, *grid.shape)
        for layer in layers:
            inside = layer[grid.mask & np.isfinite(layer)]
            layer -= inside.mean() if len(inside) else 0.0
            spread = inside.std() if len(inside) else 0.0
            layer[np.isfinite(layer)] *= 1 / spread if spread > 1e-9 * np.abs(inside).max(initial=1e-300) else 0.0
        return cls(tuple(map(str, np.asarray(names).tolist())), grid.x_m, grid.y_m, layers)

    def __len__(self) -> int:
        return len(self.names)

    def at(self, xy: ArrayLike) -> Array:
        """Standardised values at places, interpolated linearly between cells; 0, the mean, where they are missing.

        Beyond the raster a place has the value of the nearest cell, and so have missing cells within
        :data:`EXTENDED_M` of known ones: samples at the edge of a field are next to cells outside.
        """
        return self._interpolated(self._extended[0], check_xy(xy))

    def known_at(self, xy: ArrayLike) -> Array:
        """Share of the value at each place that is not missing, from 0 to 1, shape (n, k)."""
        return self._interpolated(self._extended[1], check_xy(xy))

    @staticmethod
    def joined(*parts: Covariates | None) -> Covariates | None:
        """Covariates of one raster together; ``None`` is none."""
        given = [one for one in parts if one is not None]
        if len(given) < 2:
            return given[0] if given else None
        names = tuple(name for one in given for name in one.names)
        return Covariates(names, given[0].x_m, given[0].y_m, np.concatenate([one.layers for one in given]))

    def coverage(self, grid: FieldGrid) -> dict[str, float]:
        """Share of the cells of a field in which each covariate is known [0..1]."""
        known = np.isfinite(self.layers[:, grid.mask]).mean(axis=1)
        return dict(zip(self.names, known.tolist(), strict=True))

    @cached_property
    def _extended(self) -> tuple[Array, Array]:
        """Layers whose missing cells have the values of known ones nearby, or 0; and how well they are known."""
        from scipy.ndimage import distance_transform_edt

        extended, known = np.nan_to_num(self.layers), np.isfinite(self.layers).astype(float)
        steps_m = [float(np.diff(axis).mean()) if len(axis) > 1 else 1.0 for axis in (self.y_m, self.x_m)]
        for layer, share, given in zip(extended, known, self.layers, strict=True):
            missing = np.isnan(given)
            if missing.any() and not missing.all():
                away_m, (row, column) = distance_transform_edt(missing, steps_m, return_indices=True)
                near = missing & (away_m <= EXTENDED_M)
                layer[near] = layer[row[near], column[near]]
                share[near] = 1 - away_m[near] / EXTENDED_M
        return extended, known

    def _interpolated(self, layers: Array, xy: Array) -> Array:
        (left, right, east), (low, high, north) = _between(self.x_m, xy[:, 0]), _between(self.y_m, xy[:, 1])
        lower = layers[:, low, left] * (1 - east) + layers[:, low, right] * east
        upper = layers[:, high, left] * (1 - east) + layers[:, high, right] * east
        return np.ascontiguousarray((lower * (1 - north) + upper * north).T)


def _between(axis: Array, values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Indices of the neighbours of values in an axis, and the share of the second."""
    position = np.interp(values, axis, np.arange(len(axis)))
    first = np.minimum(position.astype(np.intp), max(len(axis) - 2, 0))
    return first, np.minimum(first + 1, len(axis) - 1), position - first


# -- Reading -------------------------------------------------------------------------------------------------


def require_covariates(sources: Iterable[CovariateSource]) -> None:
    """Check files of covariates before long work: that they can be opened, and have their bands or attributes."""
    mistakes = list[Mistake]()
    for source in sources:
        try:
            source.unused_parts()
        except InputError as error:
            mistakes += error.mistakes
    if mistakes:
        raise InputError(mistakes)


def read_covariates(sources: Sequence[CovariateSource], frame: LocalFrame, grid: FieldGrid) -> Covariates | None:
    """Read the covariates of a field.

    :raises InputError: with every file that cannot be used: missing, without reference system, band or attribute,
        off the field, constant over the field, or of a name that another covariate has
    """
    names, rasters, mistakes = list[str](), list[Array](), list[Mistake]()
    for source in sources:
        try:
            layers = _layers(source, frame, grid)
        except InputError as error:
            mistakes += error.mistakes
            continue
        names += layers
        rasters += layers.values()
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        remedy = "leave one out, or name one by 'name' under covariates in the field file"
        mistakes.append(Mistake(f"two covariates have the name {repeated[0]!r}", remedy))
    if mistakes:
        raise InputError(mistakes)
    return Covariates.over(grid, names, np.array(rasters)) if names else None


def _layers(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> Mapping[str, Array]:
    """The checked rasters of a source by their names, shape (ny, nx) each."""
    layers = (_of_polygons if source.has_polygons else _of_raster)(source, frame, grid)
    for name, values in layers.items():
        inside = values[grid.mask & np.isfinite(values)]
        if not len(inside):
            raise InputError(
                f"has no value of {name!r} in the field",
                "check that the file covers the field, and that its reference system (CRS) is right",
                source.path,
            )
        if inside.std() <= MIN_SPREAD * np.abs(inside).max():
            raise InputError(
                f"has the same value of {name!r} everywhere in the field: it says nothing about differences",
                "leave it out",
                source.path,
            )
    return layers


def _derived(source: CovariateSource, bands: RasterBands) -> tuple[tuple[Derived, ...], int]:
    """Layers that are derived from the elevations in a raster, and the number of its band."""
    derive, band = source.derive, source.band
    if band == "wetness" and band not in bands.names:
        remedy = "make it in a GIS (GRASS: r.topidx) and give its raster, or use slope and curvature"
        raise InputError("has no band 'wetness', and no wetness index is derived", remedy, source.path)
    if not derive and band in DERIVED and band not in bands.names:
        derive, band = (band,), ""
    return derive, bands.number(band)


def _of_polygons(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> dict[str, Array]:
    east, north = np.meshgrid(grid.x_m, grid.y_m)
    values = read_polygons(source.path, source.band, frame, np.column_stack([east.ravel(), north.ravel()]))
    if values.dtype.kind == "f":
        return {source.label: values.reshape(grid.shape)}
    inside = grid.mask.ravel()
    if all(one is None for one in values[inside]):
        return {source.label: np.full(grid.shape, np.nan)}
    columns = indicators(values, inside) or {"": np.zeros(len(values))}  # a single class
    return {f"{source.label} {name}".strip(): column.reshape(grid.shape) for name, column in columns.items()}


def _of_raster(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> dict[str, Array]:
    with opened_raster(source.path) as raster:
        bands = RasterBands(source.path, raster)
        derive, number = _derived(source, bands)
        if derive:
            aspect = ("northness", "eastness")
            wanted = dict.fromkeys(name for one in derive for name in (aspect if one == "aspect" else (one,)))
            found = _terrain(bands, number, frame, grid)
            label = source.label.removesuffix(" elevation").removesuffix("elevation").strip()
            return {f"{label} {name}".strip(): found[name] for name in wanted}
        label = source.label if source.name or not source.band else f"{source.label} {source.band}"
        return {label: bands.on(number, frame, grid.x_m, grid.y_m)}


def _terrain(bands: RasterBands, number: int, frame: LocalFrame, grid: FieldGrid) -> dict[str, Array]:
    """Covariates derived from elevations, on the cells of the field.

    The elevations are evaluated at their own resolution, if it is not finer than the map.
    """
    (west, south), (east, north) = grid.box
    pixel_m = bands.pixel_m(frame)
    if not math.isfinite(pixel_m):
        return dict.fromkeys(("elevation", *DERIVED), np.full(grid.shape, np.nan))
    step_m = max(pixel_m, grid.cell_m, math.sqrt((east - west) * (north - south) / MAX_TERRAIN_CELLS))
    margin_m = 2 * step_m
    x_m, y_m = (
        np.arange(low - margin_m, high + margin_m + step_m, step_m) for low, high in ((west, east), (south, north))
    )
    unit_m = bands.unit(number)[0]
    elevation_m = bands.on(number, frame, x_m, y_m) * (unit_m if math.isfinite(unit_m) else 1.0)
    found = derivatives(elevation_m, step_m)
    return {name: _resampled(x_m, y_m, values, grid) for name, values in found.items()}


def _resampled(x_m: Array, y_m: Array, values: Array, grid: FieldGrid) -> Array:
    """Values of a raster at the cells of a field, linearly interpolated; next to a gap the nearest value."""
    from scipy.ndimage import map_coordinates

    row = (grid.y_m - y_m[0]) / (y_m[1] - y_m[0])
    column = (grid.x_m - x_m[0]) / (x_m[1] - x_m[0])
    places = np.meshgrid(row, column, indexing="ij")
    linear = np.asarray(map_coordinates(values, places, order=1, mode="nearest"))
    nearest = np.asarray(map_coordinates(values, places, order=0, mode="nearest"))
    return np.where(np.isnan(linear), nearest, linear)
