# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weights of the soil by distance and depth in the counts, and the mean moisture of soil cores as a probe sees it.

Köhli et al. (2015), Water Resources Research 51:5772-5790. Parameters, rescaling and depth: Schrön et al. (2017),
Hydrology and Earth System Sciences 21:5009-5030, appendix A. The weights are sums of exponentials of the distance,
so all integrals here are closed.

A shielded probe sees less: the shield takes neutrons that come from far away. Its weight is the weight of a bare
probe times ``exp(-r / l)``, and ``l`` is so that 86 % of the counts come from within the radius of the site file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.sensing.moisture.cores import SoilCore, profiles_of
from soilmoist_ros.sensing.moisture.curve import SIMULATED_DENSITY_GCM3

Array = NDArray[np.float64]
Term = tuple[float, float]  # amplitude and decay [1/m] of an exponential of the distance
SHARE = 0.86
"""Share of the counts from within the footprint radius, ``1 - exp(-2)`` rounded, as in the publications."""
_STANDARD_HPA = 1013.25
_NEAR_M, _FAR_M = 1.0, 50.0
_TYPICAL_WATER = 0.2
_SCREEN = 3.7  # decay of the dip below the probe, within 1 m [1/m]
Weighting = Literal["revised", "equal"]
_NEAREST_M = 0.5  # least distance of the published weights [m]; a ring of no radius has no weight
_MAX_ITERATIONS = 200
_TOLERANCE_VWC = 1e-8


def pressure_scale(pressure_hpa: float) -> float:
    """Factor of distances, F_p [-]: neutrons fly farther in thin air (Schrön et al. 2017, appendix A)."""
    return 0.4922 / (0.86 - math.exp(-pressure_hpa / _STANDARD_HPA))


def vegetation_scale(height_m: float, water: float) -> float:
    """Factor of distances, F_veg [-]: plants shorten the way of neutrons (Schrön et al. 2017, appendix A)."""
    return 1 - 0.17 * (1 - math.exp(-0.41 * height_m)) * (1 + math.exp(-9.25 * water))


def near_terms(water: float, humidity_gm3: float) -> tuple[Term, Term]:
    """Terms of the weight up to 50 m (Schrön et al. 2017, table A1: A0 to A3)."""
    x, y = humidity_gm3, water
    a0 = 8735 * (1 + 0.00978 * x) * math.exp(-22.689 * y) + 11720 * (1 + 0.003632 * x) - 9306 * y
    decay = -0.027925 + 6.851e-5 * x
    a1 = (decay * math.exp(-6.6577 * y / (1 + 12.2755 * y)) + 0.028544) * (1 + 0.002455 * x)
    a2 = 247970 * (1 + 0.00191 * x) * math.exp(-23.289 * y) + 374655 - 258552 * y
    a3 = 0.054818 * math.exp(-21.032 * y) + 0.6373 - 0.0791 * y + 5.425e-4 * x
    return (a0, a1), (a2, a3)


def far_terms(water: float, humidity_gm3: float) -> tuple[Term, Term]:
    """Terms of the weight from 50 m on (Schrön et al. 2017, table A1: B0 to B3)."""
    x, y = humidity_gm3, water
    b0 = (39006 - 15002337 / (2009.24 * y + x - 0.13)) * (0.01181 - y) * math.exp(-3.146 * y)
    b0 += 3727 - 16.7417 * x * y
    b1 = 6.031e-5 * (x + 98.5) + 0.0013826 * y
    b2 = 11747 * (1 - 0.00475 * x) * math.exp(-55.033 * y * (1 - 0.00604 * x)) + 4521 - 3347.4 * y
    decay = -0.01543 + 8.81e-5 * x
    b3 = decay * math.exp(-13.29 * y / (1 + 0.0405 * x + 26.74 * y)) + 0.01807
    return (b0, b1), (b2 * (2 + 0.01998 * x), b3 * (2 + 0.0011 * x))


@dataclass(frozen=True)
class Footprint:
    """Sensitivity of a probe to the soil around it.

    The fits hold for 0.02 to 0.50 m^3/m^3 and 0.1 to 50 g/m^3; values beyond are set to the nearest limit.

    :param water: all water of the soil: soil moisture, and lattice and organic water as volume [m^3/m^3]
    :param humidity_gm3: absolute humidity of the air [g/m^3]
    :param pressure_hpa: air pressure [hPa]
    :param vegetation_m: height of the vegetation [m]
    :param shield_radius_m: radius that a shield leaves [m]; no effect if the radius is smaller without shield
    """

    water: float
    humidity_gm3: float = 5.0
    pressure_hpa: float = _STANDARD_HPA
    vegetation_m: float = 0.0
    shield_radius_m: float = math.inf

    @classmethod
    def shielded(cls, radius_m: float) -> Footprint:
        """Footprint of a radius [m], > 0, for a map of any moisture and air: its shape hardly depends on them."""
        return cls(_TYPICAL_WATER, shield_radius_m=radius_m)

    def share(self, distance_m: float) -> float:
        """Share of the counts from within a distance [0..1]."""
        return self._share(distance_m / self._scale, self._taper) / self._share(math.inf, self._taper)

    def rings(self, count: int) -> Array:
        """Distances of rings that represent equal shares of the counts each [m]."""
        shares = (np.arange(count) + 0.5) / count * self._share(math.inf, self._taper)
        return np.array([self._within(goal, self._taper) for goal in shares.tolist()]) * self._scale

    def weight(self, distance_m: ArrayLike) -> Array:
        """Weight of a ring around the probe, any unit: count per metre of its radius."""
        scaled = np.asarray(distance_m, float) / self._scale
        near, far = (
            sum(amplitude * np.exp(-decay * scaled) for amplitude, decay in terms) for terms in self._terms
        )
        near = near * np.where(scaled <= _NEAR_M, -np.expm1(-_SCREEN * scaled), 1.0)
        return np.asarray(np.where(scaled < _FAR_M, near, far) * np.exp(-self._taper * scaled))

    @property
    def radius_m(self) -> float:
        """Radius R86 from within which 86 % of the counts come [m]."""
        return min(self._radius(0.0), self.shield_radius_m)

    def depth_cm(self, bulk_density_gcm3: float) -> float:
        """Depth D86 above which 86 % of the counts come from, mean over the footprint [cm]."""
        near = self._share(math.inf, self._taper + 0.01) / self._share(math.inf, self._taper)
        return float(self._depth_cm(near, bulk_density_gcm3))

    def depth_at_cm(self, distance_m: ArrayLike, bulk_density_gcm3: float) -> Array:
        """Depth D86 at a distance [cm]."""
        near = np.exp(-np.asarray(distance_m, float) / self._scale / 100)
        return self._depth_cm(near, bulk_density_gcm3)

    def _depth_cm(self, near: ArrayLike, bulk_density_gcm3: float) -> Array:
        """Depth D86 [cm] (Schrön et al. 2017, appendix A) of ``exp(-r*/100 m)`` with the rescaled distance r*."""
        reach = 0.14249 * (0.96655 + np.asarray(near, float)) * (20 + self._water) / (0.0429 + self._water)
        return np.asarray((8.321 + reach) / bulk_density_gcm3)

    @property
    def _water(self) -> float:
        return min(max(self.water, 0.02), 0.50)

    @property
    def _scale(self) -> float:
        return pressure_scale(self.pressure_hpa) * vegetation_scale(self.vegetation_m, self._water)

    @cached_property
    def _terms(self) -> tuple[tuple[Term, Term], tuple[Term, Term]]:
        humidity = min(max(self.humidity_gm3, 0.1), 50.0)
        return near_terms(self._water, humidity), far_terms(self._water, humidity)

    @cached_property
    def _taper(self) -> float:
        """Decay that the shield adds, per rescaled distance [1/m]."""
        if self._radius(0.0) <= self.shield_radius_m:
            return 0.0
        return _root(lambda decay: self._radius(decay) - self.shield_radius_m)

    def _radius(self, taper: float) -> float:
        return self._within(SHARE * self._share(math.inf, taper), taper) * self._scale

    def _within(self, goal: float, taper: float) -> float:
        """Rescaled distance from within which some counts come, of the unit of :meth:`_share` [m]."""
        return _root(lambda scaled_m: self._share(scaled_m, taper) - goal)

    def _share(self, scaled_m: float, taper: float) -> float:
        """Counts from within a rescaled distance, any unit."""
        near, far = self._terms
        below = _integral(near, 0.0, min(scaled_m, _NEAR_M), taper)
        below -= _integral(near, 0.0, min(scaled_m, _NEAR_M), taper + _SCREEN)
        middle = _integral(near, _NEAR_M, min(scaled_m, _FAR_M), taper)
        return below + middle + _integral(far, _FAR_M, scaled_m, taper)


def _root(function: Callable[[float], float]) -> float:
    from scipy.optimize import brentq  # slow to import, and needed at the end of a survey only

    return float(brentq(function, 0.0, 1e4, xtol=1e-9, rtol=1e-10))


def _integral(terms: tuple[Term, Term], start_m: float, end_m: float, taper: float) -> float:
    """Integral of the terms times ``exp(-taper r)``; 0 if the end is before the start."""
    if end_m <= start_m:
        return 0.0
    return sum(
        amplitude / (decay + taper) * (math.exp(-(decay + taper) * start_m) - math.exp(-(decay + taper) * end_m))
        for amplitude, decay in terms
    )


@dataclass(frozen=True)
class SensedSoil:
    """Depth D86 [cm] and radius R86 [m] of a map: mean, least and most over its cells."""

    depth_cm: tuple[float, float, float]
    radius_m: tuple[float, float, float]


BARE_WATER = (0.40, 0.20, 0.05)
"""All water of wet, typical and dry soil: the least, usual and largest footprint of a bare probe [m^3/m^3]."""


def bare_radius_m(humidity_gm3: float, pressure_hpa: float, vegetation_m: float = 0.0) -> tuple[float, ...]:
    """Least, usual and largest radius R86 of a bare probe by the water of the soil, rounded to 10 m [m]."""
    air = Footprint(0.0, humidity_gm3, pressure_hpa, vegetation_m)
    return tuple(10.0 * round(replace(air, water=water).radius_m / 10) for water in BARE_WATER)


def sensed_soil(vwc: ArrayLike, bulk_density_gcm3: float, bound_water: float, air: Footprint) -> SensedSoil | None:
    """Depth and radius over the cells of a map; ``None`` if no cell has a moisture.

    :param vwc: soil moisture of the cells [m^3/m^3], any shape; NaN is left out
    :param bound_water: lattice and organic water [g/g]
    :param air: conditions of the survey; its water is not used
    """
    water = np.asarray(vwc, float)
    water = np.clip(water[np.isfinite(water)] + bulk_density_gcm3 * bound_water, 0.02, 0.50)
    if not water.size:
        return None
    grid = np.linspace(water.min(), water.max(), 25)
    footprints = [replace(air, water=float(value)) for value in grid]
    depth = np.interp(water, grid, [each.depth_cm(bulk_density_gcm3) for each in footprints])
    radius = np.interp(water, grid, [each.radius_m for each in footprints])
    return SensedSoil(*((float(v.mean()), float(v.min()), float(v.max())) for v in (depth, radius)))


# The mean moisture of soil cores as a probe sees it -------------------------------------------------------------


@dataclass(frozen=True)
class CoreMean:
    """Weighted means of soil cores, as a probe sees them.

    :param vwc: weighted mean volumetric water content [m^3/m^3]
    :param vwc_sd: standard error of ``vwc`` from the differences of the profiles [m^3/m^3]; NaN for a single one
    :param bulk_density_gcm3: weighted mean dry bulk density [g/cm^3], ``None`` if unknown
    :param count: number of cores
    :param profiles: number of profiles
    :param depth_cm: depth D86 of the mean [cm], NaN if the cores have no depth
    :param weights: weights that were used, in words: without distances and depths all cores weigh the same
    """

    vwc: float
    vwc_sd: float
    bulk_density_gcm3: float | None
    count: int
    profiles: int
    depth_cm: float = math.nan
    weights: str = "equal weights"


def mean_of_cores(
    cores: Sequence[SoilCore],
    weighting: Weighting = "revised",
    air: Footprint = Footprint(_TYPICAL_WATER),
    bound_water: float = 0.0,
    bulk_density_gcm3: float = SIMULATED_DENSITY_GCM3,
) -> CoreMean:
    """Mean moisture of the cores, weighted as the probe sees them.

    The weights depend on the mean, so they are iterated (Schrön et al. 2017, section 3). Depths weigh within a
    profile, distances weigh the profiles. What the cores do not have (distance, depth) does not weigh.

    * ``revised``: Köhli et al. (2015) with the parameters of Schrön et al. (2017), see :class:`Footprint`. A core
      with thickness weighs the integral over it.
    * ``equal``: all cores weigh the same.

    :param air: conditions of the calibration, by default standard air and a bare probe; its water is not used
    :param bound_water: lattice and organic water [g/g]
    :param bulk_density_gcm3: dry bulk density where the cores have none [g/cm^3]
    :raises ValueError: if no core has a weight
    """
    dense = [core.bulk_density_gcm3 for core in cores if not math.isnan(core.bulk_density_gcm3)]
    known = sum(dense) / len(dense) if dense else None
    density = known or bulk_density_gcm3
    groups = profiles_of(cores)
    vwc = float(np.mean([core.vwc for core in cores])) if cores else math.nan
    for _ in range(_MAX_ITERATIONS):
        air = replace(air, water=vwc + density * bound_water)
        weights = [_weights(group, weighting, air, density) for group in groups]
        means = np.array(
            [
                float(within @ [core.vwc for core in group] / within.sum()) if within.any() else 0.0
                for group, (_, within) in zip(groups, weights, strict=True)
            ]
        )
        across = np.array([weight if within.any() else 0.0 for weight, within in weights])
        if not across.sum() > 0:
            raise ValueError("no core has a weight: all are too deep or too far away")
        share = across / across.sum()
        previous, vwc = vwc, float(share @ means)
        if abs(vwc - previous) < _TOLERANCE_VWC:
            break
    effective = 1 / float(share @ share)
    spread = float(share @ (means - vwc) ** 2)
    error = math.sqrt(spread / (effective - 1)) if effective > 1 + 1e-9 else math.nan
    depth_cm = math.nan
    if any(not math.isnan(core.top_cm) for core in cores):
        air = replace(air, water=vwc + density * bound_water)
        depth_cm = air.depth_cm(density)
    return CoreMean(vwc, error, known, len(cores), len(groups), depth_cm, _weights_text(groups, weighting))


def _weights_text(groups: Sequence[Sequence[SoilCore]], weighting: Weighting) -> str:
    """Weights that act: depths weigh within profiles of several cores, distances weigh several profiles."""
    distance = len(groups) > 1 and not all(math.isnan(group[0].distance_m) for group in groups)
    depth = not all(math.isnan(group[0].top_cm) or len(group) == 1 for group in groups)
    if weighting == "equal" or not (distance or depth):
        return "equal weights"
    alone = "" if distance and depth else " of the distance alone" if distance else " of the depth alone"
    return f"{weighting} weights{alone}"


def _weights(
    group: Sequence[SoilCore], weighting: Weighting, footprint: Footprint, density: float
) -> tuple[float, Array]:
    """Weight of a profile, and weights of its cores."""
    equal, distance_m = np.ones(len(group)), group[0].distance_m
    if weighting == "equal":
        return float(len(group)), equal
    across = 1.0 if math.isnan(distance_m) else float(footprint.weight(max(distance_m, _NEAREST_M)))
    if math.isnan(group[0].top_cm):
        return across, equal
    top, bottom = (np.array([getattr(core, name) for core in group]) for name in ("top_cm", "bottom_cm"))
    reach_cm = float(footprint.depth_at_cm(0.0 if math.isnan(distance_m) else distance_m, density))
    # exp(-2 d / D86) of a depth (Schrön et al. 2017, appendix A), or its integral over a layer
    thickness = 2 * (bottom - top) / reach_cm
    layer = -np.expm1(-thickness) * reach_cm / 2
    return across, np.exp(-2 * top / reach_cm) * np.where(thickness > 0, layer, 1.0)
