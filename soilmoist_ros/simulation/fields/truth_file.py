# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surrogate fields from a file: a field file with a section ``truth``."""

from __future__ import annotations

import csv
import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Setting
from pydantic import model_validator

from soilmoist_ros.foundation import InputError, Mistake, Section, load_model, read_limited
from soilmoist_ros.mapping import (
    Field,
    FieldFile,
    ModelName,
    RasterBands,
    Variogram,
    correlation_model,
    load_field,
    opened_raster,
)
from soilmoist_ros.sensing import Calibration, MoistureCurve, Soil
from soilmoist_ros.simulation.fields.formulas import MAX_VWC, Formula, Quantity, RandomField, Truth
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent, RateGrid, SurrogateField, kriged_grid

Array = NDArray[np.float64]
Positive = Annotated[float, Setting(gt=0)]
KINDS = ("points", "grid", "formula")
MAXIMUM: dict[Quantity, float] = {"rate_cps": math.inf, "vwc": MAX_VWC}
HEADER_REMEDY = "name the columns x_m, y_m and rate_cps (or vwc) in the first line, separated by commas"
MAX_MISTAKES = 20


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

    def of(self, xy: Array, rate: Array) -> Variogram:
        """The variogram for point rates, with defaults from the points."""
        diagonal = float(np.hypot(*np.ptp(xy, axis=0)))
        range_m = self.range_m or diagonal / 2 / correlation_model(self.model).practical
        sill = self.sill or max(float(np.var(rate)), 1e-6) + self.nugget
        return Variogram(self.model, self.nugget, range_m, sill)


class TruthSection(Section):
    """True rate or moisture of a field."""

    points: Path | None = None
    """CSV with x_m, y_m and rate_cps or vwc, extrapolated by ordinary kriging; path relative to the field file."""
    grid: Path | None = None  # GeoTIFF (.tif) in any reference system; path relative to the field file
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
        if self.grid is not None and self.grid.suffix.lower() not in (".tif", ".tiff"):
            raise ValueError("'grid' must be a GeoTIFF (.tif); give up to 1000 places of a table as 'points'")
        if self.band is not None and self.grid is None:
            raise ValueError("'band' belongs to 'grid'; remove it")
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

    @property
    def rate_variogram(self) -> Variogram | None:
        """Variogram of the rate of a random field; moisture becomes rate by the slope of the curve at its mean."""
        formula, curve = self.formula, self.curve
        if not isinstance(formula, RandomField):
            return None
        slope = 1.0
        if formula.quantity == "vwc":
            assert curve is not None  # there is no truth without
            low, high = curve.rate_cps([formula.mean - formula.sd / 2, formula.mean + formula.sd / 2])
            slope = float(high - low) / formula.sd
        return Variogram(formula.model, 0.0, formula.range_m, (slope * formula.sd) ** 2)


class SurrogateFile(FieldFile):
    """A field file that may have a truth."""

    truth: TruthSection | None = None


def load_surrogate(path: Path, rng: np.random.Generator | None = None) -> SurrogateField:
    """Read a surrogate field from a field file with a truth.

    :param rng: source of randomness of a random formula; the seed of the formula if ``None``
    :raises InputError: with the mistakes in the field file or in the files that it names
    """
    section, field = load_model(path, SurrogateFile).truth, load_field(path)
    if section is None:
        raise InputError(
            "the field file has no truth: it cannot be simulated",
            "add a section 'truth' with 'points', 'grid' or 'formula' (see config/fields/airfield_points.yaml)",
            path,
        )
    try:
        grid = field.grid()
    except InputError as error:
        raise InputError([Mistake(error.mistakes[0].message, "", path, 0, "cell_m")]) from None
    extent, curve = GridExtent.of(field.polygon, grid.cell_m), section.curve
    truth: Truth
    if section.points is not None:
        file = path.parent / section.points
        xy, values, quantity = read_table(file)
        if (xy.max(axis=0) < extent.low).any() or (xy.min(axis=0) > extent.high).any():
            remedy = "x_m and y_m are metres east and north of the field's datum; check both"
            raise InputError("all points lie outside the field", remedy, file)
        rate = _rate(values, quantity, curve, path)
        try:
            truth = kriged_grid(xy, rate, (section.variogram or TruthVariogram()).of(xy, rate), *extent.axes())
        except ValueError as error:
            remedy = "give a 'nugget', another range or the exponential model as 'variogram' in"
            raise InputError(str(error), f"{remedy} {path}, or an even grid as 'grid'", file) from None
    elif section.grid is not None:
        file = path.parent / section.grid
        read, quantity = _read_geotiff(file, section.band, field, extent, grid.cells)
        truth = RateGrid(read.x_m, read.y_m, _rate(read.values, quantity, curve, path))
    else:
        assert section.formula is not None
        try:
            function, quantity = section.formula.function(extent, rng), section.formula.quantity
        except ValueError as error:
            raise InputError([Mistake(str(error), "", path, 0, "truth.formula")]) from None
        _rate(np.empty(0), quantity, curve, path)  # a moisture needs a curve

        def truth(xy: Array) -> Array:
            return _rate(function(xy), quantity, curve, path)

    variogram = section.rate_variogram
    return SurrogateField(path.stem, field.name, field, truth, curve, section.hours, variogram)


def truth_stamps(path: Path) -> tuple[int, ...]:
    """Modification times of the field file and the files that it names [ns]; 0 for a missing file.

    :raises InputError: with every mistake in the field file
    """
    content = load_model(path, SurrogateFile)
    border, truth = content.border_section, content.truth
    named = [border and border.file, truth and truth.points, truth and truth.grid]
    files = [path, *(path.parent / name for name in named if name)]
    return tuple(file.stat().st_mtime_ns if file.exists() else 0 for file in files)


def _rate(values: Array, quantity: Quantity, curve: MoistureCurve | None, path: Path) -> Array:
    """Convert values to rates [counts/s]."""
    if quantity == "rate_cps":
        return values
    if curve is None:
        text = "the truth is a moisture (vwc), but there is no calibration curve to make rates of it"
        remedy = "add 'soil' and 'calibration' to 'truth', or give rates (rate_cps)"
        raise InputError([Mistake(text, remedy, path, 0, "truth")])
    return curve.rate_cps(values)


def _read_geotiff(
    path: Path, band: str | None, field: Field, extent: GridExtent, cells: Array
) -> tuple[RateGrid, Quantity]:
    """Read one band of a GeoTIFF at the nodes of an extent."""
    x_m, y_m = extent.axes()
    with opened_raster(path, "check 'grid' in the field file") as source:
        bands = RasterBands(path, source)
        number = bands.number(band or ("rate" if "rate" in bands.names else ""))
        values, reach_m = bands.on(number, field.frame, x_m, y_m), bands.pixel_m(field.frame)
        quantity: Quantity = "vwc" if "vwc" in bands.names[number - 1].lower() else "rate_cps"
    for row, column in np.argwhere((values <= 0) | (values > MAXIMUM[quantity]))[:1]:
        raise InputError(
            f"the value {values[row, column]:g} of band {number} at x = {x_m[column]:g} m, y = {y_m[row]:g} m "
            f"{_out_of_range(float(values[row, column]), quantity)}",
            "correct it, or mark it as nodata if it lies outside the field",
            path,
        )
    return _complete(path, RateGrid(x_m, y_m, values), cells, reach_m), quantity


def _complete(path: Path, grid: RateGrid, cells: Array, reach_m: float) -> RateGrid:
    """A grid whose gaps have the nearest value; no cell may be outside, or ``reach_m`` from a value."""
    from scipy.ndimage import distance_transform_edt

    x_m, y_m, values = grid.x_m, grid.y_m, grid.values
    gaps = np.isnan(values)
    steps = np.array([x_m[1] - x_m[0], y_m[1] - y_m[0]])
    away_m, (row, column) = distance_transform_edt(gaps, sampling=steps[::-1], return_indices=True)
    last = np.array([len(x_m), len(y_m)]) - 1
    places = (cells - (x_m[0], y_m[0])) / steps
    outside = (np.abs(places - np.clip(places, -0.5, last + 0.5)) > 1e-6).any(axis=1)
    nodes = np.clip(np.rint(places), 0, last).astype(int)
    bad = outside | (away_m[nodes[:, 1], nodes[:, 0]] >= (1 - 1e-6) * reach_m)
    if gaps.all() or bad.all():
        raise InputError("has no value in the field", "check the field's datum and the coordinates", path)
    if bad.any():
        x, y = cells[bad][0]
        raise InputError(
            f"has no value in {bad.mean():.1%} of the field: x = {x:g} m, y = {y:g} m has none",
            "give a larger grid, fill the gaps, or leave them out of the field with 'no_go'",
            path,
        )
    return RateGrid(x_m, y_m, values[row, column])


def read_table(path: Path) -> tuple[Array, Array, Quantity]:
    """Read a CSV with the columns x_m, y_m and rate_cps or vwc; other columns and lines with ``#`` are ignored.

    :returns: distinct positions, shape (n, 2) [m], their values, shape (n,), and the quantity of these
    :raises InputError: with every mistake: a missing column, a value that is not a number or out of range, a
        duplicate position, too few points
    """
    try:
        text = read_limited(path, "check 'truth' in the field file").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", "give a CSV file, or a GeoTIFF that ends in .tif", path) from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.partition("#")[0].strip()]
    if not lines:
        raise InputError("is empty", HEADER_REMEDY, path)
    (first, _), *others = lines
    header, *rows = ([cell.strip() for cell in next(csv.reader([line]))] for _, line in lines)
    quantities = [quantity for quantity in MAXIMUM if quantity in header]
    if not {"x_m", "y_m"} <= set(header) or len(quantities) != 1:
        raise InputError([Mistake(f"its columns are: {', '.join(header)}", HEADER_REMEDY, path, first)])
    quantity, mistakes, seen = quantities[0], list[Mistake](), dict[tuple[float, ...], float]()
    for (line, _), row in zip(others, rows, strict=True):
        cells = dict(zip(header, row, strict=False))
        numbers = dict.fromkeys(("x_m", "y_m", quantity), math.nan)
        for name in numbers:
            cell = cells.get(name, "")
            with suppress(ValueError):
                numbers[name] = float(cell)
            if not math.isfinite(numbers[name]):
                text = f"{cell!r} is not a number"
            elif name == quantity and not 0 < numbers[name] <= MAXIMUM[quantity]:
                text = f"{cell} {_out_of_range(numbers[name], quantity)}"
            else:
                continue
            mistakes.append(Mistake(text, "write a decimal number such as 3.25", path, line, name))
        x, y, value = numbers.values()
        if (x, y) in seen and math.isfinite(x + y):
            text = f"the place x_m = {x:g}, y_m = {y:g} occurs twice"
            mistakes.append(Mistake(text, "keep one value for each place", path, line))
        seen[x, y] = value
    if not mistakes and len(seen) < 3:
        mistakes = [Mistake(f"has {len(seen)} points, but at least 3 are needed", "add more", path)]
    if len(mistakes) > MAX_MISTAKES:
        mistakes[MAX_MISTAKES:] = [Mistake(f"has {len(mistakes) - MAX_MISTAKES} more mistakes", "", path)]
    if mistakes:
        raise InputError(mistakes)
    return np.array(list(seen), float), np.array(list(seen.values())), quantity


def _out_of_range(value: float, quantity: Quantity) -> str:
    if quantity == "vwc" and value > 0:
        return f"is no moisture in m3/m3 (0 to {MAX_VWC}); a percentage must be divided by 100"
    return f"is not positive, as a {'count rate' if quantity == 'rate_cps' else 'moisture'} must be"
