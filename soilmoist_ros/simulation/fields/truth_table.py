# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The data files of a truth: points or an even grid as CSV, or a GeoTIFF."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, read_limited
from soilmoist_ros.mapping import opened_raster
from soilmoist_ros.simulation.fields.formula_base import MAX_VWC, Quantity
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid, filled

if TYPE_CHECKING:
    from pyproj import Transformer
    from rasterio.io import DatasetReader

Array = NDArray[np.float64]

QUANTITIES: tuple[Quantity, ...] = ("rate_cps", "vwc")
HEADER_REMEDY = "name the columns x_m, y_m and rate_cps (or vwc) in the first line, separated by commas"
MAX_MISTAKES = 20
MAX_PIXELS = 50_000_000


class Table(NamedTuple):
    """Values at positions, from a CSV file.

    :param xy: distinct positions [m], shape (n, 2)
    :param values: values at these positions, shape (n,); NaN where the file has none
    :param quantity: quantity of the values
    """

    xy: Array
    values: Array
    quantity: Quantity


@dataclass(frozen=True, eq=False)
class Layer:
    """A grid of values and its coverage of the field.

    :param grid: values, gaps filled from the nearest node
    :param quantity: quantity of the values
    :param inside: for each cell of the field, whether the grid covers it
    :param known: for each cell of the field, whether the nearest node has a value
    :param near: for each cell of the field, whether the nearest node or a neighbour of it has a value
    :param spacing_m: distance between nodes [m]
    """

    grid: RateGrid
    quantity: Quantity
    inside: NDArray[np.bool_]
    known: NDArray[np.bool_]
    near: NDArray[np.bool_]
    spacing_m: float


def read_points(path: Path, least: int = 3) -> Table:
    """Read a CSV with the columns x_m, y_m and rate_cps or vwc; other columns and lines with ``#`` are ignored.

    :param path: file
    :param least: minimum number of points
    :raises InputError: with every mistake: a missing column, a value that is not a number or out of range, a
        duplicate position, too few points
    """
    return _read_table(path, gaps=False, least=least)


def read_grid(path: Path, cells: Array) -> Layer:
    """Read a CSV in the format of :func:`read_points` with the nodes of a regular grid, in any order.

    The spacing may differ between x and y. Outside the field, nodes may be missing or have no value.

    :param path: file
    :param cells: cell centres inside the field, shape (g, 2) [m]
    :raises InputError: with every mistake in the file, or if the positions do not form a regular grid
    """
    table = _read_table(path, gaps=True, least=4)
    x, y = (_even_axis(path, name, table.xy[:, axis]) for axis, name in enumerate(("x_m", "y_m")))
    if len(x) * len(y) > MAX_PIXELS:
        raise InputError(f"spans {len(x)} x {len(y)} nodes", "use larger steps, or check the coordinates", path)
    raster = np.full((len(y), len(x)), np.nan)
    index = [
        np.rint((table.xy[:, axis] - low[0]) / (low[1] - low[0])).astype(int) for axis, low in enumerate((x, y))
    ]
    raster[index[1], index[0]] = table.values
    if np.isnan(raster).all():
        raise InputError("has no value at all", "give each node a value", path)
    nearest = np.column_stack([(cells[:, 0] - x[0]) / (x[1] - x[0]), (cells[:, 1] - y[0]) / (y[1] - y[0])])
    spacing = max(x[1] - x[0], y[1] - y[0])
    return Layer(RateGrid(x, y, filled(raster)), table.quantity, *_coverage(raster, nearest), spacing)


def read_geotiff(path: Path, band: str | None, frame: LocalFrame, extent: Extent, cells: Array) -> Layer:
    """Read one band of a GeoTIFF and resample it to the plane of the field by bilinear interpolation.

    :param path: file, in any coordinate reference system
    :param band: name of the band; if ``None``, the one named ``rate``, else the first. A name that
        contains ``vwc`` means soil moisture [m^3/m^3], any other name the corrected rate [counts/s]
    :param frame: plane of the field
    :param extent: box of the field
    :param cells: cell centres inside the field, shape (g, 2) [m]
    :raises InputError: if the file cannot be read, lacks its CRS or the band, or has a value that is not positive
    """
    from pyproj import CRS, Transformer
    from scipy.ndimage import map_coordinates

    with opened_raster(path, "check 'grid' in the field file") as source:
        pixels, quantity = _read_band(path, source, band)
        to_pixel, crs = ~source.transform, CRS.from_wkt(source.crs.to_wkt())
        transformer = Transformer.from_crs(frame.crs, crs, always_xy=True)
    coverage = _coverage(pixels, _pixel_places(transformer, to_pixel, cells))
    metre = np.diff(_pixel_places(transformer, to_pixel, cells[0] + [[0.0, 0.0], [1.0, 0.0]]), axis=0)
    x, y = extent.axes()
    east, north = np.meshgrid(x, y)
    places = _pixel_places(transformer, to_pixel, np.column_stack([east.ravel(), north.ravel()]))
    values = map_coordinates(filled(pixels), places[:, ::-1].T, order=1, mode="nearest")
    grid = RateGrid(x, y, values.reshape(east.shape))
    return Layer(grid, quantity, *coverage, 1 / max(float(np.hypot(*metre[0])), 1e-6))


def _read_band(path: Path, source: DatasetReader, band: str | None) -> tuple[Array, Quantity]:
    """Pixels of the band, NaN for nodata, and their quantity."""
    if source.crs is None:
        raise InputError(
            "has no coordinate reference system (CRS)",
            "assign it in a GIS, or with 'gdal_edit.py -a_srs EPSG:... FILE'",
            path,
        )
    names = [name or "" for name in source.descriptions]
    if band is not None and band not in names:
        known = ", ".join(repr(name) for name in names if name) or "none has a name"
        raise InputError(f"has no band {band!r}", f"its bands are: {known}; give one as 'band'", path)
    number = names.index(band or "rate") if (band or "rate") in names else 0
    if source.width * source.height > MAX_PIXELS:
        raise InputError(
            f"has {source.width} x {source.height} pixels (at most {MAX_PIXELS:,})", "crop it to the field", path
        )
    masked = source.read(number + 1, masked=True).astype(float) * source.scales[number] + source.offsets[number]
    pixels: Array = np.asarray(masked.filled(np.nan), float)
    quantity: Quantity = "vwc" if "vwc" in names[number].lower() else "rate_cps"
    with np.errstate(invalid="ignore"):
        wrong = np.argwhere((pixels <= 0) | ((pixels > MAX_VWC) & (quantity == "vwc")) | np.isinf(pixels))
    if len(wrong):
        row, column = wrong[0]
        reason = _out_of_range(float(pixels[row, column]), quantity)
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        raise InputError(
            f"pixel at row {row}, column {column} of band {number + 1} is {pixels[row, column]:g}{more}: {reason}",
            "correct it, or mark it as nodata if it lies outside the field",
            path,
        )
    if np.isnan(pixels).all():
        raise InputError(f"band {number + 1} has only nodata", "give another 'band'", path)
    return pixels, quantity


def _pixel_places(transformer: Transformer, to_pixel: Any, xy: Array) -> Array:
    """Column and row of positions [m], shape (n, 2), counted from the centre of the first pixel."""
    east, north = transformer.transform(xy[:, 0], xy[:, 1])
    matrix = np.array([[to_pixel.a, to_pixel.b], [to_pixel.d, to_pixel.e]])
    with np.errstate(invalid="ignore"):  # positions outside the reference system are infinite
        places = np.column_stack([east, north]) @ matrix.T + (to_pixel.c - 0.5, to_pixel.f - 0.5)
    return np.where(np.isfinite(places), places, -1e9)


def _coverage(raster: Array, places: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """For positions (column, row): inside the raster; value at the nearest node; value there or at a neighbour."""
    from scipy.ndimage import binary_dilation

    last = np.array(raster.shape[::-1]) - 1
    inside: NDArray[np.bool_] = np.all((places >= -0.5 - 1e-6) & (places <= last + 0.5 + 1e-6), axis=1)
    column, row = np.clip(np.rint(places), 0, last).astype(int).T
    given = ~np.isnan(raster)
    widened = binary_dilation(given, np.ones((3, 3)))
    return inside, inside & given[row, column], inside & widened[row, column]


def _even_axis(path: Path, name: str, values: Array) -> Array:
    """Node coordinates of a grid along one axis.

    :raises InputError: if they are not evenly spaced
    """
    nodes = np.unique(np.round(values, 6))
    if len(nodes) < 2:
        raise InputError(
            [
                Mistake(
                    "has only one value: a grid needs two or more rows and columns", "use 'points'", path, 0, name
                )
            ]
        )
    steps = np.diff(nodes)
    step = float(steps.min())
    whole = np.rint(steps / step)
    step = float(steps.sum() / whole.sum())  # the mean is less rounded than any single step
    bad = np.flatnonzero(np.abs(steps - whole * step) > 0.01 * step)
    if len(bad):
        before, after = nodes[bad[0]], nodes[bad[0] + 1]
        text = f"is not evenly spaced: steps of {step:g} m, but {before:g} is followed by {after:g}"
        raise InputError([Mistake(text, "give a regular grid, or use 'points' instead of 'grid'", path, 0, name)])
    count = int(whole.sum()) + 1
    if count > 100 * len(nodes):
        text = f"is not evenly spaced: {len(nodes)} values, the closest {step:g} m apart"
        raise InputError([Mistake(text, "give a regular grid, or use 'points' instead of 'grid'", path, 0, name)])
    return np.asarray(nodes[0] + step * np.arange(count))


def _read_table(path: Path, gaps: bool, least: int) -> Table:
    rows = _rows(path)
    try:
        line, header = next(rows)
    except StopIteration:
        raise InputError("is empty", HEADER_REMEDY, path) from None
    columns, quantity = _columns(path, line, [name.strip() for name in header])
    mistakes: list[Mistake] = []
    seen: dict[tuple[float, float], int] = {}
    values: list[float] = []
    for line, row in rows:
        numbers = _numbers(path, line, row, columns, gaps, mistakes)
        if numbers is None:
            continue
        place = (numbers[0], numbers[1])
        if place in seen:
            text = f"the place x_m = {place[0]:g}, y_m = {place[1]:g} is already on line {seen[place]}"
            mistakes.append(Mistake(text, "keep one value for each place", path, line))
            continue
        seen[place] = line
        values.append(numbers[2])
    if not mistakes and len(values) < least:
        mistakes.append(Mistake(f"has {len(values)} points, but at least {least} are needed", "add more", path))
    if mistakes:
        raise InputError(_shortened(mistakes, path))
    return Table(np.array(list(seen), float), np.array(values), quantity)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows of a CSV with their line numbers, without empty lines and comments."""
    try:
        text = read_limited(path, "check 'truth' in the field file").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", "give a CSV file, or a GeoTIFF that ends in .tif", path) from None
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, next(csv.reader([line]))


def _columns(path: Path, line: int, header: list[str]) -> tuple[dict[str, int], Quantity]:
    """Position of x_m, y_m and the quantity in a row, in this order."""
    found = [quantity for quantity in QUANTITIES if quantity in header]
    missing = [name for name in ("x_m", "y_m") if name not in header]
    if not found:
        missing.append("rate_cps")
    have = f"its columns are: {', '.join(header)}"
    mistakes = [Mistake(f"the column is missing; {have}", HEADER_REMEDY, path, line, name) for name in missing]
    if len(found) > 1:
        mistakes.append(
            Mistake("has both rate_cps and vwc", "keep one of them: it is the truth", path, line, "vwc")
        )
    if mistakes:
        raise InputError(mistakes)
    return {name: header.index(name) for name in ("x_m", "y_m", found[0])}, found[0]


def _numbers(
    path: Path, line: int, row: list[str], columns: dict[str, int], gaps: bool, mistakes: list[Mistake]
) -> tuple[float, ...] | None:
    """The numbers of a row, ``None`` after a mistake; mistakes are appended to the list."""
    numbers: list[float] = []
    for name, index in columns.items():
        cell = row[index].strip() if index < len(row) else ""
        if name in QUANTITIES and gaps and cell.lower() in ("", "nan", "na"):
            numbers.append(math.nan)
            continue
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            text = f"{cell!r} is not a number" if cell else "the value is missing"
            mistakes.append(Mistake(text, "write a decimal number such as 3.25", path, line, name))
        elif name in QUANTITIES and not 0 < number <= (MAX_VWC if name == "vwc" else math.inf):
            reason = _out_of_range(number, "vwc" if name == "vwc" else "rate_cps")
            mistakes.append(Mistake(f"{cell} {reason}", "correct the value", path, line, name))
        else:
            numbers.append(number)
    return tuple(numbers) if len(numbers) == len(columns) else None


def _out_of_range(value: float, quantity: Quantity) -> str:
    if quantity == "vwc" and value > 0:
        return f"is no moisture in m3/m3 (0 to {MAX_VWC}); a percentage must be divided by 100"
    return f"is not positive, as a {'count rate' if quantity == 'rate_cps' else 'moisture'} must be"


def _shortened(mistakes: list[Mistake], path: Path) -> list[Mistake]:
    more = len(mistakes) - MAX_MISTAKES
    return [*mistakes[:MAX_MISTAKES], Mistake(f"has {more} more mistakes", "", path)] if more > 0 else mistakes
