# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surrogate fields from a file: a field file with a section ``truth``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Setting
from pydantic import model_validator

from soilmoist_ros.foundation import InputError, Mistake, Section, load_model, read_yaml
from soilmoist_ros.mapping import Field, FieldFile, ModelName, Variogram, load_field
from soilmoist_ros.sensing import Calibration, MoistureCurve, Soil, moisture_curve
from soilmoist_ros.simulation.fields.formula_base import Quantity, Truth
from soilmoist_ros.simulation.fields.rate_extrapolation import MAX_POINTS, default_variogram, kriged_grid
from soilmoist_ros.simulation.fields.rate_formula import Formula, RandomFieldFormula
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.fields.truth_table import Layer, read_geotiff, read_grid, read_points

Array = NDArray[np.float64]
Positive = Annotated[float, Setting(gt=0)]
KINDS = ("points", "grid", "formula")


class TruthVariogram(Section):
    """Variogram with which point rates are extrapolated."""

    model: ModelName = "exponential"
    """Model; the exponential one hardly overshoots where the rate jumps."""
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
    formula: Formula | None = None
    """Family of fields and its parameters."""
    band: str | None = None
    """Name of the GeoTIFF's band; by default ``rate``, or the first one if none has this name."""
    variogram: TruthVariogram | None = None
    """Variogram for ``points``."""
    hours: Positive = 2.0
    """Usual mission time [h]."""
    soil: Soil | None = None
    """Soil properties; without them the field has a rate only."""
    calibration: Calibration | None = None
    """Calibration; without it the field has a rate only."""

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
        return moisture_curve(self.calibration, self.soil)


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
    """Whether a field file has a truth; the truth itself is not read.

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
        raise InputError(
            [
                Mistake(
                    "the truth is a moisture (vwc), but there is no calibration curve to make rates of it",
                    "add 'soil' and 'calibration' to 'truth', or give rates (rate_cps)",
                    path,
                    0,
                    "truth",
                )
            ]
        )
    return section.curve


def _is_geotiff(path: Path) -> bool:
    return path.suffix.lower() in (".tif", ".tiff")
