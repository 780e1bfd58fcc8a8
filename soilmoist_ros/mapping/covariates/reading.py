# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates of a field, read from files and standardised over its cells."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, distance_text, listing
from soilmoist_ros.mapping.covariates.polygons import (
    BEGINNINGS,
    attributes,
    indicators,
    outline_of_polygons,
    read_polygons,
    require_polygons,
)
from soilmoist_ros.mapping.covariates.rasters import RasterBands, opened_raster
from soilmoist_ros.mapping.covariates.source import DERIVED, CovariateSource, Derived
from soilmoist_ros.mapping.covariates.terrain import derivatives
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.covariates import Covariates

Array = NDArray[np.float64]

MAX_TERRAIN_CELLS = 100_000
"""Cells of the raster on which elevations are evaluated; a larger one gets larger cells."""
TERRAIN_MARGIN = 1.0
"""Width of the surroundings whose water may run into the field, as a share of its extent."""
MIN_SPREAD = 1e-9
"""Standard deviation of a covariate, as a share of its largest value, below which it is the same everywhere."""


def require_covariates(sources: Iterable[CovariateSource]) -> None:
    """Check files of covariates before long work: that they can be opened, and have their bands or attributes.

    :raises InputError: with every file that cannot be read
    """
    mistakes = list[Mistake]()
    for source in sources:
        try:
            if _has_polygons(source):
                require_polygons(source.path, source.band)
            else:
                with opened_raster(source.path) as raster:
                    _derived(source, RasterBands(source.path, raster))
        except InputError as error:
            mistakes += error.mistakes
    if mistakes:
        raise InputError(mistakes)


def unused_parts(source: CovariateSource) -> str:
    """Bands or attributes of a file that are not used, in words; empty if all are.

    :raises InputError: if the file cannot be read
    """
    if _has_polygons(source):
        names = attributes(source.path)
        others = [name for name in names if name != (source.band or names[0])]
        what = "attributes"
    else:
        with opened_raster(source.path) as raster:
            bands = RasterBands(source.path, raster)
            _, used = _derived(source, bands)
        others = [name or str(number) for number, name in enumerate(bands.names, start=1) if number != used]
        what = "bands"
    return f"{what} of {source.path.name} that are not used: {listing(others)}" if others else ""


def read_covariates(sources: Sequence[CovariateSource], frame: LocalFrame, grid: FieldGrid) -> Covariates | None:
    """Read the covariates of a field.

    :param sources: the files; the order is kept
    :param frame: plane of the field
    :param grid: cells of the map
    :returns: ``None`` without sources
    :raises InputError: with every file that cannot be used: missing, without reference system, band or attribute,
        off the field, the same everywhere, or of a name that another one has
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


def coverage(covariates: Covariates, grid: FieldGrid) -> dict[str, float]:
    """Share of the field's cells in which each covariate is known [0..1]."""
    known = np.isfinite(covariates.layers[:, grid.mask]).mean(axis=1)
    return dict(zip(covariates.names, known.tolist(), strict=True))


def _layers(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> Mapping[str, Array]:
    """The checked rasters of a source by their names, shape (ny, nx) each."""
    layers = (_of_polygons if _has_polygons(source) else _of_raster)(source, frame, grid)
    for name, values in layers.items():
        inside = values[grid.mask & np.isfinite(values)]
        if not len(inside):
            where, remedy = _elsewhere(source, frame, grid)
            raise InputError(f"has no value of {name!r} in the field{where}", remedy, source.path)
        if inside.std() <= MIN_SPREAD * np.abs(inside).max():
            raise InputError(
                f"has the same value of {name!r} everywhere in the field: it says nothing about differences",
                "leave it out",
                source.path,
            )
    return layers


def _elsewhere(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> tuple[str, str]:
    """Distance of a file from the field, in words, and what to do."""
    import shapely

    remedy = "check that the file covers the field, and that its reference system (CRS) is right"
    if _has_polygons(source):
        corners = outline_of_polygons(source.path, frame)
    else:
        with opened_raster(source.path) as raster:
            corners = RasterBands(source.path, raster).outline(frame)
    if not len(corners):
        return ": it lies on the other side of the earth", remedy
    box = shapely.box(*grid.box[0], *grid.box[1])
    distance_m = float(shapely.MultiPoint(corners).convex_hull.distance(box))
    if distance_m == 0:
        return ", which it covers with gaps only", "fill the gaps, or leave the file out"
    return f": it lies {distance_text(distance_m)} away", remedy


def _has_polygons(source: CovariateSource) -> bool:
    """Whether an existing file has polygons, by its ending.

    :raises InputError: if there is no such file, or something would be derived from polygons
    """
    source.require_file()
    found = source.path.suffix.lower() in BEGINNINGS
    if found and source.derive:
        raise InputError("has polygons: nothing is derived from them", "remove 'derive'", source.path)
    return found


def _derived(source: CovariateSource, bands: RasterBands) -> tuple[tuple[Derived, ...], int]:
    """What is made of the elevations in a raster, and the number of its band.

    :raises InputError: if there is no such band
    """
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
    columns = indicators(values, inside)
    if not columns:
        raise InputError(
            "has a single class in the field: it says nothing about differences", "leave it out", source.path
        )
    return {f"{source.label} {name}": column.reshape(grid.shape) for name, column in columns.items()}


def _of_raster(source: CovariateSource, frame: LocalFrame, grid: FieldGrid) -> dict[str, Array]:
    with opened_raster(source.path) as raster:
        bands = RasterBands(source.path, raster)
        derive, number = _derived(source, bands)
        if derive:
            wanted = dict.fromkeys(name for one in derive for name in _parts(one))
            found = _terrain(bands, number, frame, grid)
            label = source.label.removesuffix(" elevation").removesuffix("elevation").strip()
            return {f"{label} {name}".strip(): found[name] for name in wanted}
        label = source.label if source.name or not source.band else f"{source.label} {source.band}"
        return {label: bands.on(number, frame, grid.x_m, grid.y_m)}


def _parts(derived: str) -> tuple[str, ...]:
    return ("northness", "eastness") if derived == "aspect" else (derived,)


def _terrain(bands: RasterBands, number: int, frame: LocalFrame, grid: FieldGrid) -> dict[str, Array]:
    """What is derived from elevations, on the cells of the field.

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
