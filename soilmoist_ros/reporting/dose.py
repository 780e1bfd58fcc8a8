# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation dose of a map: water that is missing in the root zone, and zones by the steps of a machine.

The rate of a place is normal, with the errors of counting, mapping and calibration, and the curve makes it a
moisture. What lies below the sensed depth, and the limits of the soil, add normal errors to that. All figures are
of this distribution, so the mean of the missing water is not the missing water of the mean moisture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.certainty import CERTAIN, Moistures
from soilmoist_ros.reporting.workable import SHARE_OF_FIELD, dissolved, divided, workable
from soilmoist_ros.sensing import Irrigation, MoistureCurve, soil_limits

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]
MAX_BLOCKS = 4000
"""Number of blocks of a field; larger fields have blocks of several swaths."""
TOLERANCE_M = 0.01
"""Distance that common borders of zones may move to get fewer corners [m]."""


class DoseSettings(Irrigation):
    """Irrigation of a site file with wilting point and field capacity, and the soil below the sensed depth."""

    below_share: float = 0.0
    """Share of the root zone below the sensed depth [0..1]."""
    below_shift: float = 0.0
    """Moisture there minus that above [m^3/m^3]."""
    below_sd: float = 0.0
    """Standard deviation of :attr:`below_shift` [m^3/m^3]."""

    @property
    def stress_sd(self) -> float:
        """Standard deviation of the root zone's moisture minus :attr:`stress`, but for the error of the rate."""
        return math.hypot(self.below_share * self.below_sd, self.left(1 - self.depletion)[1])

    @property
    def full_sd(self) -> float:
        """Standard deviation of the root zone's moisture minus :attr:`full`, but for the error of the rate."""
        of_target = self.left(self.target_share)[1] if self.target is None else 0.0
        return math.hypot(self.below_share * self.below_sd, of_target)

    @property
    def shift(self) -> float:
        """Moisture of the root zone minus that sensed [m^3/m^3]."""
        return self.below_share * self.below_shift

    @property
    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of *too dry* and *too wet*, :attr:`stress` and field capacity, and the standard deviation of each
        minus the root zone's moisture, but for the error of the rate [m^3/m^3].
        """
        full, sd = self.left(1.0)
        return (self.stress, full), (self.stress_sd, math.hypot(self.below_share * self.below_sd, sd))


@dataclass(frozen=True, eq=False)
class Dose:
    """Water that places need, shape (n,) each.

    :param net_mm: mean of the water missing to the target in the root zone [mm]; ``p05_mm`` and ``p95_mm`` are its
        quantiles
    :param needed: probability that the root zone is below the moisture where plants lack water [0..1]
    """

    net_mm: Array
    p05_mm: Array
    p95_mm: Array
    needed: Array
    settings: DoseSettings
    _moistures: Moistures

    def right(self, gross_mm: float, places: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Probability that places, by default all, need the gross dose of a step and no other one."""
        settings = self.settings
        doses = np.concatenate([[0.0], settings.doses_mm])
        index = int(np.argmin(np.abs(doses - gross_mm)))
        middles = np.concatenate([[-np.inf], (doses[1:] + doses[:-1]) / 2, [np.inf]])
        wet, dry = settings.full - middles[index : index + 2] * settings.efficiency / settings.root_depth_mm

        def figure(one: Moistures) -> Array:
            below = [one.below(min(limit, settings.stress), settings.full_sd) for limit in (wet, dry)]
            return np.maximum((1.0 if index == 0 else below[0]) - below[1], 0.0)

        return self._moistures.figure(figure, places)


def find_dose(rate: Array, rate_sd: Array, curve: MoistureCurve, settings: DoseSettings) -> Dose:
    """Dose of places.

    :param rate: estimate [counts/s] and its standard deviation without that of the calibration, shape (n,)
    :raises InputError: if the target is above the pore volume of the soil
    """
    rate, sd = np.asarray(rate, float), np.asarray(rate_sd, float)
    pores = soil_limits(curve.bulk_density_gcm3).saturation
    if settings.full > pores:
        raise InputError(
            f"a target of {settings.full:g} m3/m3 is above the pore volume of {pores:.2f} m3/m3, which the bulk "
            f"density of {curve.bulk_density_gcm3:g} g/cm3 leaves",
            "lower the target, or check field capacity and bulk density",
        )
    moistures = Moistures.of(rate, sd, curve, settings.shift)
    target, depth = (settings.full, settings.full_sd), settings.root_depth_mm
    low, high = moistures.quantiles_missing(*target)
    needed = moistures.below(settings.stress, settings.stress_sd)
    return Dose(moistures.missing(*target) * depth, low * depth, high * depth, needed, settings, moistures)


# Zones by the steps of a machine ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DoseZone:
    """A connected area that gets one dose.

    :param shape: polygon in the plane of the field [m]
    :param number: from 1 for the lowest dose; zones of one dose have the same number
    :param gross_mm: dose that the machine applies [mm]; 0 for none
    :param net_mm: mean of the water missing to the target [mm], and its mean quantiles
    :param needed: mean probability that plants lack water now [0..1]
    :param sure: mean probability that the dose is the right one of the steps [0..1]
    :param need_sure: share of its places that certainly need water now [0..1]
    """

    shape: BaseGeometry
    number: int
    gross_mm: float
    net_mm: float
    p05_mm: float
    p95_mm: float
    needed: float
    sure: float
    need_sure: float

    @property
    def area_m2(self) -> float:
        """Area [m^2]."""
        return float(self.shape.area)

    @property
    def volume_m3(self) -> float:
        """Water to apply [m^3]."""
        return self.gross_mm / 1000 * self.area_m2

    @property
    def rings_m(self) -> list[list[list[float]]]:
        """Its outline and holes as lists of east and north [m]."""
        return [np.asarray(ring.coords).tolist() for ring in (self.shape.exterior, *self.shape.interiors)]


def zones_of_dose(
    dose: Dose, xy: Array, cell_m: float, boundary: BaseGeometry, settings: DoseSettings
) -> list[DoseZone]:
    """Zones from the lowest to the highest dose. They do not overlap, and together they are the field.

    Blocks of whole swaths of the machine, along its driving direction, get the dose of their mean need where at
    least half of them is expected to need water. Blocks of one dose become one zone, and zones that are too small
    join a neighbour.

    :param xy: places of the dose, shape (n, 2) [m]
    :raises InputError: if the machine is wider than the field
    """
    from scipy.ndimage import distance_transform_edt
    from shapely import get_coordinates, point_on_surface

    smallest_m2 = SHARE_OF_FIELD * boundary.area if settings.min_zone_ha is None else 1e4 * settings.min_zone_ha
    along, across, size = swaths(boundary, settings, cell_m)
    blocks = _Blocks.over(xy, along, across, size, cell_m)
    steps = np.concatenate([[0.0], settings.doses_mm])

    def step(net_mm: Array, needed: Array) -> NDArray[np.intp]:
        """Numbers of the steps that mean needs ask for."""
        nearest = np.abs(steps - np.asarray(net_mm)[:, None] / settings.efficiency).argmin(axis=1)
        return np.where(np.asarray(needed) >= 0.5, nearest, 0)

    block, every = blocks.index(xy), int(blocks.count.prod())
    count = np.bincount(block, minlength=every)
    means = (np.bincount(block, figure, every) / np.maximum(count, 1) for figure in (dose.net_mm, dose.needed))
    # A block without a place is that of the nearest one that has some.
    empty = (count == 0).reshape(blocks.count)
    row, column = distance_transform_edt(empty, return_distances=False, return_indices=True)
    of_block = step(*means)[(row * blocks.count[1] + column).ravel()]
    faces = divided(blocks.borders(of_block, boundary), boundary)
    number = of_block[blocks.index(get_coordinates(point_on_surface(faces)))]
    shapes, _ = workable(*dissolved(faces, number), smallest_m2, TOLERANCE_M, alike=True)
    # What has joined counts in the dose of its zone.
    places = [_places(shape, xy) for shape in shapes]
    of_shapes = ([figure[own].mean() for own in places] for figure in (dose.net_mm, dose.needed))
    shapes, number = dissolved(shapes, step(*map(np.array, of_shapes)))
    used, zones = sorted(set(number.tolist())), []
    for shape, index in zip(shapes, number.tolist(), strict=True):
        own = _places(shape, xy)
        figures = [float(figure[own].mean()) for figure in (dose.net_mm, dose.p05_mm, dose.p95_mm, dose.needed)]
        figures.append(float(dose.right(float(steps[index]), own).mean()))
        figures.append(float((dose.needed[own] >= CERTAIN).mean()))
        zones.append(DoseZone(shape, used.index(index) + 1, float(steps[index]), *figures))
    return sorted(zones, key=lambda zone: (zone.number, -zone.area_m2))


def _inside(shape: BaseGeometry, xy: Array) -> NDArray[np.intp]:
    """Numbers of the places in a zone."""
    from shapely import contains_xy, prepare

    prepare(shape)
    west, south, east, north = shape.bounds
    x, y = xy.T
    near = np.flatnonzero((x >= west) & (x <= east) & (y >= south) & (y <= north))
    return np.asarray(near[contains_xy(shape, x[near], y[near])])


def _places(shape: BaseGeometry, xy: Array) -> NDArray[np.intp]:
    """Numbers of the places in a zone; of the nearest one if there is none."""
    from shapely import get_coordinates, point_on_surface

    own = _inside(shape, xy)
    if own.size:
        return own
    return np.atleast_1d(np.hypot(*(xy - get_coordinates(point_on_surface(shape))).T).argmin())


def swaths(boundary: BaseGeometry, settings: DoseSettings, cell_m: float) -> tuple[Array, Array, float]:
    """Unit vectors along and across the driving direction, and the side of a block [m].

    :raises InputError: if the machine is wider than the field
    """
    from shapely import get_coordinates

    if settings.direction_deg is None:
        sides = np.diff(get_coordinates(boundary.minimum_rotated_rectangle)[:3], axis=0)
        along = sides[np.argmax(np.hypot(*sides.T))]
    else:
        angle = math.radians(settings.direction_deg)
        along = np.array([math.sin(angle), math.cos(angle)])
    along = along / np.hypot(*along)
    across = np.array([along[1], -along[0]])
    wide = float(np.ptp(get_coordinates(boundary) @ across))
    if settings.width_m is None:
        smallest_m2 = SHARE_OF_FIELD * boundary.area
        return along, across, min(max(math.sqrt(smallest_m2) / 2, 2 * cell_m), wide)
    if settings.width_m > wide:
        raise InputError(
            f"the machine of {settings.width_m:g} m is wider than the field of {wide:.0f} m",
            "give the width that it irrigates, in metres, or another driving direction",
        )
    finest = max(cell_m, math.sqrt(boundary.area / MAX_BLOCKS))
    return along, across, min(settings.width_m * math.ceil(finest / settings.width_m - 1e-6), wide)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks over a field, rows along the driving direction of the machine and columns across it.

    The last block along and across takes the remainder, so that no block is narrower than the machine.
    """

    axes: Array
    start: Array
    count: NDArray[np.intp]
    size_m: float

    @classmethod
    def over(cls, xy: Array, along: Array, across: Array, size_m: float, cell_m: float) -> _Blocks:
        """Blocks over places."""
        axes = np.column_stack([along, across])
        places = xy @ axes
        start = places.min(axis=0) - cell_m / 2
        count = ((places.max(axis=0) + cell_m / 2 - start) / size_m + 1e-6).astype(int)
        return cls(axes, start, np.maximum(count, 1), size_m)

    def index(self, xy: Array) -> NDArray[np.intp]:
        """Number of the block of each place, shape (n,)."""
        at = np.clip(((xy @ self.axes - self.start) / self.size_m).astype(int), 0, self.count - 1)
        return np.asarray(at @ [self.count[1], 1], np.intp)

    def borders(self, of_block: NDArray[np.intp], boundary: BaseGeometry) -> list[BaseGeometry]:
        """Lines between blocks of different classes; those at the edge reach over the field."""
        from shapely import get_coordinates, linestrings

        corners, classes = get_coordinates(boundary) @ self.axes, of_block.reshape(self.count)
        found = []
        for axis in (0, 1):
            edges = self.start[1 - axis] + self.size_m * np.arange(self.count[1 - axis] + 1.0)
            edges[[0, -1]] = corners[:, 1 - axis].min() - 1, corners[:, 1 - axis].max() + 1
            before, along = np.nonzero(np.diff(classes if axis == 0 else classes.T, axis=0))
            at = (self.start[axis] + self.size_m * (before + 1.0))[:, None, None] * self.axes[:, axis]
            ends = np.stack([edges[along], edges[along + 1]], axis=1)[:, :, None] * self.axes[:, 1 - axis]
            found += list(linestrings(at + ends))
        return found


@dataclass(frozen=True, eq=False)
class DosePlan:
    """Zones of a field: what the report and all files say of them.

    :param zones: from the lowest to the highest dose; together they are the field
    :param sure: share of the area where it is certain whether plants lack water now [0..1]
    :param blurred: what a footprint larger than the field means, as a sentence; empty if it is not
    """

    settings: DoseSettings
    zones: Sequence[DoseZone]
    sure: float
    blurred: str

    @property
    def irrigated(self) -> list[DoseZone]:
        """Zones that get water."""
        return [zone for zone in self.zones if zone.gross_mm > 0]

    @property
    def area_m2(self) -> float:
        """Area that gets water [m^2]."""
        return sum(zone.area_m2 for zone in self.irrigated)

    @property
    def volume_m3(self) -> float:
        """Water for the whole field [m^3]."""
        return sum(zone.volume_m3 for zone in self.zones)

    @property
    def need_sure(self) -> float:
        """Share of the irrigated area that certainly needs water [0..1]; NaN without one."""
        return zones_mean(self.irrigated, "need_sure") if self.irrigated else math.nan

    @property
    def missing_mm(self) -> tuple[float, float, float]:
        """Water missing where it is applied, without a dose in the whole field: mean, and mean of the quantiles
        0.05 and 0.95 of a place [mm].
        """
        return missing_mm(self.irrigated or self.zones)

    @property
    def certain(self) -> bool:
        """True if 80 % or more of the area that gets water can be expected to need it; without a dose, if 80 % or
        more of the field can be expected not to. Never if the pattern is blurred.
        """
        zones = self.irrigated or self.zones
        right = sum((z.needed if z.gross_mm else 1 - z.needed) * z.area_m2 for z in zones)
        return not self.blurred and right >= CERTAIN * sum(zone.area_m2 for zone in zones)

    @property
    def capped(self) -> tuple[float, float]:
        """Largest dose of the machine, and the mean water that remains missing where it is applied [mm]; 0 for
        less than half a step.
        """
        top, settings = float(self.settings.doses_mm[-1]), self.settings
        dry = [zone for zone in self.zones if zone.gross_mm >= top]
        left = zones_mean(dry, "net_mm") - settings.efficiency * top if dry else 0.0
        return top, left if left > settings.efficiency * settings.steps_mm / 2 else 0.0

    def largest_text(self, shown: Callable[[float], str] = "{:g} mm".format) -> str:
        """Largest dose, and what makes it the largest."""
        top, most, step = self.capped[0], self.settings.max_dose_mm, self.settings.steps_mm
        if most - top < 1e-6 * most:
            return f"{shown(top)} is the largest dose of the machine"
        return f"{shown(top)} is the largest dose in steps of {shown(step)} up to the {shown(most)} of the machine"


def saved_zones(summary: Any, where: Path | None = None) -> list[DoseZone]:
    """Zones of a run as its report has them, from the key ``dose`` of its ``summary.json``.

    :raises InputError: if the run has no dose; the message says what is missing
    """
    from shapely import Polygon

    about = summary.get("dose") or {}
    if not about.get("zones"):
        what = about.get("missing") or "the run was made by a version without doses"
        raise InputError(f"there is no dose: {what}", about.get("remedy") or "make the run again", where)
    columns = [field.name for field in fields(DoseZone)[1:]]
    return [
        DoseZone(Polygon(zone["rings_m"][0], zone["rings_m"][1:]), *(zone[name] for name in columns))
        for zone in about["zones"]
    ]


def sure_share(dose: Dose) -> float:
    """Share of places where it is certain whether plants lack water now [0..1]."""
    return float((np.maximum(dose.needed, 1 - dose.needed) >= CERTAIN).mean())


def dose_at(zones: Sequence[DoseZone], xy: Array) -> Array:
    """Gross dose of places, shape (n,) [mm]; on a border that of the nearest zone."""
    from shapely import STRtree, points

    found = np.full(len(xy), np.nan)
    for zone in zones:
        found[_inside(zone.shape, xy)] = zone.gross_mm
    left = np.isnan(found)
    nearest = STRtree([zone.shape for zone in zones]).nearest(points(xy[left]))
    found[left] = np.array([zone.gross_mm for zone in zones])[nearest]
    return found


def zones_mean(zones: Sequence[DoseZone], name: str) -> float:
    """Mean of a figure of zones over their area."""
    return float(np.average([getattr(zone, name) for zone in zones], weights=[zone.area_m2 for zone in zones]))


def missing_mm(zones: Sequence[DoseZone]) -> tuple[float, float, float]:
    """Water missing in zones, and the mean of the quantiles 0.05 and 0.95 of a place [mm]."""
    return zones_mean(zones, "net_mm"), zones_mean(zones, "p05_mm"), zones_mean(zones, "p95_mm")


def zones_by_dose(zones: Sequence[DoseZone]) -> dict[float, list[DoseZone]]:
    """Zones of each gross dose [mm], from none to the most."""
    found: dict[float, list[DoseZone]] = {}
    for zone in sorted(zones, key=lambda zone: zone.gross_mm):
        found.setdefault(zone.gross_mm, []).append(zone)
    return found
