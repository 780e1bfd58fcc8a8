# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates: what else is known at every place of a field, such as relief, soil maps or satellite images.

A source names a file, a part of it, and what is derived from elevations. The values are read from the files
(:mod:`.covariate_files`), brought to the cells of the field and standardised.
"""

from __future__ import annotations

import math
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
    RasterBands,
    attribute_of,
    derivatives,
    indicators,
    opened_raster,
    read_polygons,
)
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples import check_xy

Derived = Literal["elevation", "slope", "aspect", "northness", "eastness", "curvature", "wetness"]
DERIVED: tuple[Derived, ...] = get_args(Derived)
"""Covariates derived from elevations; ``elevation`` is the band itself, ``aspect`` northness and eastness."""
EXTENDED_M = 15.0
"""Distance up to which a missing cell has the value of the nearest known one, the less certain the farther [m]."""
MAX_TERRAIN_CELLS = 100_000
"""Cells of the raster on which elevations are evaluated; a larger one gets larger cells."""
TERRAIN_MARGIN = 1.0  # width of the surroundings whose water may run into the field, as a share of its extent
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

    The elevations are evaluated at their own resolution, if it is not finer than the map, and with their
    surroundings, from which water runs into the field.
    """
    (west, south), (east, north) = grid.box
    margin_m = TERRAIN_MARGIN * max(east - west, north - south)
    area = (east - west + 2 * margin_m) * (north - south + 2 * margin_m)
    pixel_m = bands.pixel_m(frame)
    if not math.isfinite(pixel_m):
        return dict.fromkeys(("elevation", *DERIVED), np.full(grid.shape, np.nan))
    step_m = max(pixel_m, grid.cell_m, math.sqrt(area / MAX_TERRAIN_CELLS))
    margin_m = max(margin_m, 2 * step_m)
    x_m, y_m = (
        np.arange(low - margin_m, high + margin_m + step_m, step_m) for low, high in ((west, east), (south, north))
    )
    found = derivatives(bands.on(number, frame, x_m, y_m), step_m)
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
