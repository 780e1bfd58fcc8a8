# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surrogate fields: count rate and soil moisture are known everywhere.

Built-in fields follow the published experiments: the rate is extrapolated by ordinary kriging from point rates
(Pulido Fentanes et al., *Kriging-Based Robotic Exploration for Soil Moisture Mapping Using a Cosmic-Ray
Sensor*). The docstring of each field states the choices that the paper leaves open.

The rate at signed distance d from the border between two soils is ``wet + (dry - wet) Phi(d / 5 m)``. It is the
rate of a sensor with a Gaussian footprint of standard deviation 5 m (86 % of the counts within 10 m). All fields
are extrapolated with the exponential model, which hardly overshoots a border. Its range is much longer than the
distance between points, which keeps the rate constant beyond the outermost points.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, config_folder, did_you_mean, read_yaml, resource_names
from soilmoist_ros.mapping import Field, Variogram, load_field
from soilmoist_ros.sensing import CalibrationCurve, MoistureCurve
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent, RateGrid, SurrogateField, kriged_grid
from soilmoist_ros.simulation.fields.truth_file import load_surrogate, truth_stamps

Array = NDArray[np.float64]

DATUM = LocalFrame(53.2680, -0.5245)
FOOTPRINT_SD_M = 5.0  # standard deviation of the footprint that smooths a border [m]
BORDER_OFFSETS_M = (-30.0, -15.0, -8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0, 15.0, 30.0)
"""Distances of the measured points of the published airfield from its border [m]; negative on the grass."""
LINES_M = np.arange(0.0, 51.0, 10.0)  # positions of the six lines of an airfield along its border [m]
AIRFIELD_RATE_S = 600.0  # counting time per point of the published airfield [s]
AIRFIELD_SEED = 20  # seed of the point rates of ``airfield-simulated``
AIRFIELD_SOIL = CalibrationCurve(n0_cps=4.4, bulk_density_gcm3=1.4)
"""Soil of the low-contrast airfield: 4.0 counts/s at 5 % moisture and 3.0 counts/s at 20 %."""
TURF = CalibrationCurve(n0_cps=4.75, bulk_density_gcm3=1.1)
"""Soil of the high-contrast airfield: loose turf of 1.1 g/cm^3 (porosity 58 %) at 45 % moisture, and concrete at
0.4 %. A soil of 1.4 g/cm^3 cannot contain enough water for the 2 : 1 contrast of 5.0 to 2.5 counts/s."""


def surrogate_field(name_or_path: str, rng: np.random.Generator | None = None) -> SurrogateField:
    """A surrogate field by name or from a file, cached per process.

    :param name_or_path: name of a surrogate field (see :func:`surrogate_field_names`), or path of a field file
        with a truth
    :param rng: source of randomness for the field (point rates of ``airfield-simulated``, random formulas); a
        fixed seed if ``None``. A field with ``rng`` is not cached.
    :raises InputError: if the field is unknown, or for any mistake in its files
    """
    if name_or_path in BUILT_IN:
        return _built_in(name_or_path) if rng is None else BUILT_IN[name_or_path](rng)
    path = _field_file(name_or_path)
    return load_surrogate(path, rng) if rng is not None else _loaded(path.resolve(), truth_stamps(path))


def known_field(name_or_path: str) -> Field:
    """A field by the name of a built-in field, or by name or path of a field file; the file needs no truth.

    :raises InputError: if the field is unknown, or for any mistake in its file
    """
    if name_or_path in BUILT_IN:
        return surrogate_field(name_or_path).field
    return load_field(_field_file(name_or_path, "the path of a field file"))


def surrogate_field_names() -> list[str]:
    """Names of all surrogate fields: built-in ones, then shipped field files with a truth."""
    return [*BUILT_IN, *_shipped_with_truth()]


@cache
def _shipped_with_truth() -> tuple[str, ...]:
    folder = config_folder() / "fields"
    return tuple(name for name in resource_names("fields") if "truth" in read_yaml(folder / f"{name}.yaml"))


@cache
def _built_in(name: str) -> SurrogateField:
    return BUILT_IN[name](None)


@lru_cache(maxsize=16)
def _loaded(path: Path, stamps: tuple[int, ...]) -> SurrogateField:
    """A field file in the cache; the stamps identify its version."""
    return load_surrogate(path)


def _field_file(name: str, or_path: str = "the path of a field file with a truth") -> Path:
    path = Path(name)
    if path.is_file():
        return path
    shipped = resource_names("fields")
    if name in shipped:
        return config_folder() / "fields" / f"{name}.yaml"
    known = [*BUILT_IN, *shipped]
    raise InputError(
        f"there is no surrogate field or field file {name!r}",
        f"give one of: {', '.join(known)}; or {or_path}{did_you_mean(name, known)}",
    )


def half_wet_field() -> SurrogateField:
    """A rectangle that is dry (8 %) in the west and wet (28 %) in the east, with a slanting border 6 m wide."""
    width_m, height_m = 60.0, 50.0
    curve, dry_vwc, wet_vwc, transition_m = CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4), 0.08, 0.28, 6.0

    def truth(xy: Array) -> Array:
        slant = 0.25 * (xy[:, 1] - height_m / 2)
        wetness = 0.5 * (1 + np.tanh((xy[:, 0] - width_m / 2 - slant) / (transition_m / 2)))
        return curve.rate_cps(dry_vwc + (wet_vwc - dry_vwc) * wetness)

    field = _rectangle("half wet, half dry", width_m, height_m, cell_m=0.5)
    return SurrogateField("half-wet", field.name, field, truth, curve)


def _synthetic_airfield(
    name: str, title: str, grass_cps: float, concrete_cps: float, curve: CalibrationCurve
) -> SurrogateField:
    """Airfield of 60 x 50 m: grass in the west, concrete in the east, without noise.

    The field has 78 points: the 13 distances of the measured airfield on six lines 10 m apart. The border passes
    the middle of the field. It slants by 1 : 5 and thus does not run along the rows of a grid.
    Exponential model of range 60 m (practical range 180 m), no nugget; cells of 1 m.
    """
    places = [(30 + 0.2 * (y - 25) + offset, y) for y in LINES_M for offset in BORDER_OFFSETS_M]
    rate = np.tile(_across_border(grass_cps, concrete_cps), len(LINES_M))
    variogram = Variogram("exponential", nugget=0.0, range_m=60.0, sill=(concrete_cps - grass_cps) ** 2)
    field = _rectangle(title, 60.0, 50.0, cell_m=1.0)
    return _extrapolated(name, field, np.array(places), rate, variogram, curve, hours=2.0)


def _airfield_simulated(rng: np.random.Generator | None) -> SurrogateField:
    """The measured airfield: one line of 13 points across the border, repeated five times at a distance of 10 m.

    The original rates are not public. The rates of the line are Poisson counts of 600 s at 5 % (concrete) and
    20 % VWC (grass); the other lines repeat them. The border is straight, at x = 30 m.
    Exponential model of range 60 m, sill 0.9; cells of 1 m. The nugget is the variance of the Poisson noise. It is
    filtered, because over 1 m counts vary more than any real soil: the truth matches the drawn rates to within
    about their noise.
    """
    rng = rng or np.random.default_rng(AIRFIELD_SEED)
    concrete, grass = AIRFIELD_SOIL.rate_cps([0.05, 0.20])
    line = rng.poisson(_across_border(grass, concrete) * AIRFIELD_RATE_S) / AIRFIELD_RATE_S
    places = [(30 + offset, y) for y in LINES_M for offset in BORDER_OFFSETS_M]
    rate = np.tile(line, len(LINES_M))
    noise = float(line.mean()) / AIRFIELD_RATE_S
    variogram = Variogram("exponential", nugget=noise, range_m=60.0, sill=0.9 + noise)
    field = _rectangle("Simulated airfield", 60.0, 50.0, cell_m=1.0)
    return _extrapolated("airfield-simulated", field, np.array(places), rate, variogram, AIRFIELD_SOIL, hours=2.0)


def _validation() -> SurrogateField:
    """Field of 210 x 330 m (7 ha), 18 % VWC, with an irrigated part of 24 %.

    The field has 72 points on a lattice of 30 m: x = 30..180 m, y = 0..330 m. The quarter of the field east of
    105 m and north of 165 m is irrigated. The sensor and the soil of the airfield give 3.10 and 2.88 counts/s.
    Exponential model of range 150 m, no nugget; cells of 3 m. The rate changes between two rows of points, over
    30 m.
    """
    places = np.array([(x, y) for y in np.arange(0.0, 331.0, 30.0) for x in np.arange(30.0, 181.0, 30.0)])
    irrigated = (places[:, 0] > 105) & (places[:, 1] > 165)
    rate = AIRFIELD_SOIL.rate_cps(np.where(irrigated, 0.24, 0.18))
    variogram = Variogram("exponential", nugget=0.0, range_m=150.0, sill=0.05)
    field = _rectangle("Validation field", 210.0, 330.0, cell_m=3.0)
    return _extrapolated("validation", field, places, rate, variogram, AIRFIELD_SOIL, hours=4.0)


BUILT_IN: dict[str, Callable[[np.random.Generator | None], SurrogateField]] = {
    "synthetic-high": lambda _: _synthetic_airfield(
        "synthetic-high", "Synthetic airfield, high gradient", 2.5, 5.0, TURF
    ),
    "synthetic-low": lambda _: _synthetic_airfield(
        "synthetic-low", "Synthetic airfield, low gradient", 3.0, 4.0, AIRFIELD_SOIL
    ),
    "airfield-simulated": _airfield_simulated,
    "validation": lambda _: _validation(),
    "half-wet": lambda _: half_wet_field(),
}


def _across_border(wet_cps: float, dry_cps: float) -> Array:
    """Expected rates at the points of an airfield line [counts/s], smoothed by the footprint of the sensor."""
    from scipy.special import ndtr

    return np.asarray(wet_cps + (dry_cps - wet_cps) * ndtr(np.array(BORDER_OFFSETS_M) / FOOTPRINT_SD_M))


def _rectangle(name: str, width_m: float, height_m: float, cell_m: float) -> Field:
    corners = [(0.0, 0.0), (width_m, 0.0), (width_m, height_m), (0.0, height_m)]
    return Field(name, DATUM, np.array(corners), cell_m=cell_m)


def _extrapolated(
    name: str, field: Field, xy: Array, rate: Array, variogram: Variogram, curve: MoistureCurve, hours: float
) -> SurrogateField:
    """A field from point rates, kriged on first use: many callers need only its outline."""
    assert field.cell_m is not None
    extent = GridExtent.of(field.polygon, field.cell_m)

    @cache
    def grid() -> RateGrid:
        return kriged_grid(xy, rate, variogram, *extent.axes())

    return SurrogateField(name, field.name, field, lambda places: grid()(places), curve, hours)
