# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surrogate fields from a file: a field file with a section ``truth``."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Setting
from pydantic import model_validator

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, Section, load_model, read_limited, read_yaml
from soilmoist_ros.mapping import Field, FieldFile, ModelName, Variogram, load_field, opened_raster
from soilmoist_ros.sensing import Calibration, MoistureCurve, Soil
from soilmoist_ros.simulation.fields.formulas import MAX_VWC, Formula, Quantity, RandomFieldFormula, Truth
from soilmoist_ros.simulation.fields.rate_grid import (
    MAX_POINTS,
    Extent,
    RateGrid,
    default_variogram,
    filled,
    kriged_grid,
)
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField

if TYPE_CHECKING:
    from pyproj import Transformer
    from rasterio.io import DatasetReader

Array = NDArray[np.float64]
Positive = Annotated[float, Setting(gt=0)]
KINDS = ("points", "grid", "formula")
QUANTITIES: tuple[Quantity, ...] = ("rate_cps", "vwc")
HEADER_REMEDY = "name the columns x_m, y_m and rate_cps (or vwc) in the first line, separated by commas"
MAX_MISTAKES = 20
MAX_PIXELS = 50_000_000


class TruthVariogram(Section):
    """Variogram with which point rates are extrapolated."""

    model: ModelName = "exponential"  # model; the exponential one hardly overshoots where the rate jumps
    range_m: Positive | None = None
    """Range parameter [m]; by default, the practical range is half the diagonal of the points' box."""
    sill: Positive | None = None
    """Total sill [(counts/s)^2]; by default, the variance of the points plus the nugget."""
    nugget: Annotated[float, Setting(ge=0)] = 0.0
    """Variance of the noise of the points [(counts/s)^2]. The noise is filtered; 0 reproduces the points."""

    @model_validator(mode="after")
    def _sill_is_total(self) -> TruthVariogram:
        if self.sill is not None and self.sill <= self.nugget:
            raise ValueError(f"'sill' is the total sill and must be greater than 'nugget' ({self.nugget:g})")
        return self


class TruthSection(Section):
    """True rate or moisture of a field."""

    points: Path | None = None
    """CSV with x_m, y_m and rate_cps or vwc, extrapolated by ordinary kriging; path relative to the field file."""
    grid: Path | None = None
    """CSV like ``points`` on a regular grid, interpolated linearly, or GeoTIFF (.tif) in any reference system."""
    formula: Formula | None = None  # family of fields and its parameters
    band: str | None = None
    """Name of the GeoTIFF's band; by default ``rate``, or the first one if none has this name."""
    variogram: TruthVariogram | None = None  # variogram for ``points``
    hours: Positive = 2.0  # usual mission time [h]
    soil: Soil | None = None  # soil properties; without them the field has a rate only
    calibration: Calibration | None = None  # calibration; without it the field has a rate only

    @model_validator(mode="after")
    def _one_kind(self) -> TruthSection:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            found = f"but there are {len(given)}: {', '.join(given)}" if given else "but there is none"
            raise ValueError(f"give one truth: 'points', 'grid' or 'formula', {found}")
        if self.variogram is not None and self.points is None:
            raise ValueError("'variogram' belongs to 'points'; remove it")
        if self.band is not None and not (self.grid is not None and _is_geotiff(self.grid)):
            raise ValueError("'band' belongs to a 'grid' that is a GeoTIFF (.tif); remove it")
        if (self.soil is None) != (self.calibration is None):
            have, lack = ("soil", "calibration") if self.soil is not None else ("calibration", "soil")
            raise ValueError(f"{have!r} is of no use without {lack!r}; give both or neither")
        return self

    @property
    def curve(self) -> MoistureCurve | None:
        """Calibration curve, ``None`` without soil and calibration."""
        if self.soil is None or self.calibration is None:
            return None
        return self.calibration.curve_of(self.soil)


class SurrogateFile(FieldFile):
    """A field file that may have a truth."""

    truth: TruthSection | None = None


def load_surrogate(path: Path, rng: np.random.Generator | None = None) -> SurrogateField:
    """Read a surrogate field from a field file with a truth.

    :param path: field file
    :param rng: source of randomness of a random formula; the seed of the formula if ``None``
    :raises InputError: with the mistakes in the field file or in the files that it names
    """
    content = load_model(path, SurrogateFile)
    field = load_field(path)
    section = content.truth
    if section is None:
        raise InputError(
            "the field file has no truth: it cannot be simulated",
            "add a section 'truth' with 'points', 'grid' or 'formula' (see config/fields/airfield_points.yaml)",
            path,
        )
    cells, extent = _cells(field, path)
    if section.points is not None:
        truth, xy, rate = _from_points(section, path.parent / section.points, path, extent)
        return SurrogateField(path.stem, field.name, field, truth, section.curve, section.hours, xy, rate)
    if section.grid is not None:
        truth = _from_grid(section, path, field, extent, cells)
    else:
        truth = _from_formula(section, path, extent, rng)
    variogram = _random_variogram(section)
    return SurrogateField(path.stem, field.name, field, truth, section.curve, section.hours, variogram=variogram)


def _random_variogram(section: TruthSection) -> Variogram | None:
    """Variogram of the rate of a random field; a moisture becomes a rate by the slope of the curve at its mean."""
    formula = section.formula
    if not isinstance(formula, RandomFieldFormula):
        return None
    slope = 1.0
    if formula.quantity == "vwc":
        assert section.curve is not None  # there is no truth without
        low, high = section.curve.rate_cps([formula.mean - formula.sd / 2, formula.mean + formula.sd / 2])
        slope = float(high - low) / formula.sd
    return Variogram(formula.model, 0.0, formula.range_m, (slope * formula.sd) ** 2)


def has_truth(path: Path) -> bool:
    """True if a field file has a truth; the truth itself is not read.

    :raises InputError: if the file cannot be read
    """
    content = read_yaml(path)
    return isinstance(content, Mapping) and "truth" in content


def truth_stamps(path: Path) -> tuple[int, ...]:
    """Modification times of the field file and the files that it names [ns]; 0 for a missing file.

    :raises InputError: with every mistake in the field file
    """
    content = load_model(path, SurrogateFile)
    named = [content.border_section.file if content.border_section is not None else None]
    if content.truth is not None:
        named += [content.truth.points, content.truth.grid]
    files = [path, *(path.parent / name for name in named if name is not None)]
    return tuple(file.stat().st_mtime_ns if file.exists() else 0 for file in files)


def _cells(field: Field, path: Path) -> tuple[Array, Extent]:
    """Cell centres inside the field [m], and the box of the field."""
    try:
        grid = field.grid()
    except InputError as error:
        raise InputError([Mistake(error.mistakes[0].message, "", path, 0, "cell_m")]) from None
    return grid.cells, Extent.of(field.polygon, grid.cell_m)


def _from_points(section: TruthSection, file: Path, path: Path, extent: Extent) -> tuple[Truth, Array, Array]:
    table = read_points(file)
    if len(table.values) > MAX_POINTS:
        raise InputError(
            f"has {len(table.values)} points; kriging takes at most {MAX_POINTS}",
            "thin them out, or give an even grid as 'grid'",
            file,
        )
    if (table.xy.max(axis=0) < extent.low).any() or (table.xy.min(axis=0) > extent.high).any():
        raise InputError(
            "all points lie outside the field",
            "x_m and y_m are metres east and north of the field's datum; check both",
            file,
        )
    rate = _rate(table.values, table.quantity, section, path)
    try:
        return kriged_grid(table.xy, rate, _variogram(section, table.xy, rate), extent), table.xy, rate
    except ValueError as error:
        raise InputError(
            str(error), f"give a 'nugget', another range or the exponential model as 'variogram' in {path}", file
        ) from None


def _variogram(section: TruthSection, xy: Array, rate: Array) -> Variogram:
    chosen = section.variogram or TruthVariogram()
    usual = default_variogram(xy, rate, chosen.model)
    return Variogram(
        chosen.model, chosen.nugget, chosen.range_m or usual.range_m, chosen.sill or usual.sill + chosen.nugget
    )


def _from_grid(section: TruthSection, path: Path, field: Field, extent: Extent, cells: Array) -> Truth:
    assert section.grid is not None
    file = path.parent / section.grid
    if _is_geotiff(file):
        layer = read_geotiff(file, section.band, field.frame, extent, cells)
    else:
        layer = read_grid(file, cells)
    _require_cover(layer, cells, field, file)
    values = layer.grid.values
    rate = _rate(values, layer.quantity, section, path)
    return RateGrid(layer.grid.x_m, layer.grid.y_m, rate)


def _require_cover(layer: Layer, cells: Array, field: Field, file: Path) -> None:
    """Refuse a grid without a value in some cell of the field.

    Within one and a half steps of the boundary, the value of a neighbour is enough: a raster on other axes that
    was cut along the boundary lacks some of these cells.
    """
    if not layer.inside.any():
        raise InputError(
            "does not overlap the field", "check the field's datum and the coordinates of the grid", file
        )
    if not layer.inside.all():
        raise InputError(
            f"covers only {layer.inside.mean():.1%} of the field: {_first(cells, layer.inside)} lies outside",
            "give a larger grid, or a smaller boundary",
            file,
        )
    known = layer.known | (layer.near & _at_boundary(field, cells, 1.5 * layer.spacing_m))
    if not known.all():
        raise InputError(
            f"has no value in {1 - known.mean():.1%} of the field: {_first(cells, known)} has none",
            "fill the gaps, or leave them out of the field with 'no_go'",
            file,
        )


def _at_boundary(field: Field, cells: Array, distance_m: float) -> NDArray[np.bool_]:
    import shapely

    rings = shapely.MultiLineString([shapely.LinearRing(ring) for ring in (field.polygon, *field.no_go)])
    return np.asarray(shapely.distance(shapely.points(cells), rings) <= distance_m)


def _first(cells: Array, good: NDArray[np.bool_]) -> str:
    x, y = cells[np.flatnonzero(~good)[0]]
    return f"x = {x:g} m, y = {y:g} m"


def _from_formula(section: TruthSection, path: Path, extent: Extent, rng: np.random.Generator | None) -> Truth:
    formula = section.formula
    assert formula is not None
    try:
        function = formula.function(extent, rng)
    except ValueError as error:
        raise InputError([Mistake(str(error), "", path, 0, "truth.formula")]) from None
    if formula.quantity == "rate_cps":
        return function
    curve = _curve_for_moisture(section, path)
    return lambda xy: curve.rate_cps(function(xy))


def _rate(values: Array, quantity: Quantity, section: TruthSection, path: Path) -> Array:
    """Convert values to rates [counts/s]."""
    return values if quantity == "rate_cps" else _curve_for_moisture(section, path).rate_cps(values)


def _curve_for_moisture(section: TruthSection, path: Path) -> MoistureCurve:
    if section.curve is None:
        text = "the truth is a moisture (vwc), but there is no calibration curve to make rates of it"
        remedy = "add 'soil' and 'calibration' to 'truth', or give rates (rate_cps)"
        raise InputError([Mistake(text, remedy, path, 0, "truth")])
    return section.curve


def _is_geotiff(path: Path) -> bool:
    return path.suffix.lower() in (".tif", ".tiff")


class Table(NamedTuple):
    """Values at positions, from a CSV file."""

    xy: Array  # distinct positions [m], shape (n, 2)
    values: Array  # values at these positions, shape (n,); NaN where the file has none
    quantity: Quantity  # quantity of the values


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
    :param least: minimum number of points
    :raises InputError: with every mistake: a missing column, a value that is not a number or out of range, a
        duplicate position, too few points
    """
    return _read_table(path, gaps=False, least=least)


def read_grid(path: Path, cells: Array) -> Layer:
    """Read a CSV in the format of :func:`read_points` with the nodes of a regular grid, in any order.

    The spacing may differ between x and y. Outside the field, nodes may be missing or have no value.
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
        text = "has only one value: a grid needs two or more rows and columns"
        raise InputError([Mistake(text, "use 'points'", path, 0, name)])
    steps = np.diff(nodes)
    step = float(steps.min())
    whole = np.rint(steps / step)
    step = float(steps.sum() / whole.sum())  # the mean is less rounded than any single step
    bad, count = np.flatnonzero(np.abs(steps - whole * step) > 0.01 * step), int(whole.sum()) + 1
    uneven = ""
    if len(bad):
        uneven = f"steps of {step:g} m, but {nodes[bad[0]]:g} is followed by {nodes[bad[0] + 1]:g}"
    elif count > 100 * len(nodes):
        uneven = f"{len(nodes)} values, the closest {step:g} m apart"
    if uneven:
        remedy = "give a regular grid, or use 'points' instead of 'grid'"
        raise InputError([Mistake(f"is not evenly spaced: {uneven}", remedy, path, 0, name)])
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
