# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation dose of a map: water that is missing in the root zone, and zones by the steps of a machine.

The rate of a place is normal, with the errors of counting, mapping and calibration, and the curve makes it a
moisture. What lies below the sensed depth, and the limits of the soil, add normal errors to that. All figures are
of this distribution, so the mean of the missing water is not the missing water of the mean moisture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.certainty import CERTAIN, Moistures
from soilmoist_ros.reporting.workable import SHARE_OF_FIELD, inside, places_in, swaths, zones_of_blocks
from soilmoist_ros.sensing import Irrigation, MoistureCurve, soil_limits

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]


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
    """Zones from the lowest to the highest dose, see :func:`zones_of_blocks`: each block gets the dose of its mean
    need where at least half of it is expected to need water.

    :param xy: places of the dose, shape (n, 2) [m]
    :raises InputError: if the machine is wider than the field
    """
    smallest_m2 = SHARE_OF_FIELD * boundary.area if settings.min_zone_ha is None else 1e4 * settings.min_zone_ha
    steps = np.concatenate([[0.0], settings.doses_mm])

    def step(net_mm: Array, needed: Array) -> NDArray[np.intp]:
        """Numbers of the steps that mean needs ask for."""
        nearest = np.abs(steps - np.asarray(net_mm)[:, None] / settings.efficiency).argmin(axis=1)
        return np.where(np.asarray(needed) >= 0.5, nearest, 0)

    of_machine = swaths(boundary, smallest_m2, cell_m, settings.width_m, settings.direction_deg)
    figures = dose.net_mm, dose.needed
    shapes, number = zones_of_blocks(figures, step, xy, cell_m, boundary, of_machine, smallest_m2)
    used, zones = sorted(set(number.tolist())), []
    for shape, index in zip(shapes, number.tolist(), strict=True):
        own = places_in(shape, xy)
        means = [float(figure[own].mean()) for figure in (dose.net_mm, dose.p05_mm, dose.p95_mm, dose.needed)]
        means.append(float(dose.right(float(steps[index]), own).mean()))
        means.append(float((dose.needed[own] >= CERTAIN).mean()))
        zones.append(DoseZone(shape, used.index(index) + 1, float(steps[index]), *means))
    return sorted(zones, key=lambda zone: (zone.number, -zone.area_m2))


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

    @property
    def largest_text(self) -> str:
        """Largest dose, and what makes it the largest."""
        top, most, step = self.capped[0], self.settings.max_dose_mm, self.settings.steps_mm
        if most - top < 1e-6 * most:
            return f"{top:g} mm is the largest dose of the machine"
        return f"{top:g} mm is the largest dose in steps of {step:g} mm up to the {most:g} mm of the machine"


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
        DoseZone(Polygon(zone["rings_m"][0], zone["rings_m"][1:]), *(zone.get(name, math.nan) for name in columns))
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
        found[inside(zone.shape, xy)] = zone.gross_mm
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
