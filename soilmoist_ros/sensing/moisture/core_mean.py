# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mean moisture of soil cores as a probe sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.moisture.cores import SoilCore, profiles_of
from soilmoist_ros.sensing.moisture.footprint import Footprint

Array = NDArray[np.float64]
Weighting = Literal["revised", "conventional", "equal"]
_CONVENTIONAL_REACH_M = 127.0
_NEAREST_M = 0.5
"""Least distance of the published weights [m]; a ring of no radius has no weight."""
_MAX_ITERATIONS = 200
_TOLERANCE_VWC = 1e-8


@dataclass(frozen=True)
class Surroundings:
    """Conditions on which the weights of the cores depend.

    :param humidity_gm3: absolute humidity of the air during the calibration [g/m^3]
    :param pressure_hpa: air pressure during the calibration [hPa]
    :param vegetation_m: height of the vegetation [m]
    :param bound_water: lattice and organic water [g/g]
    :param bulk_density_gcm3: dry bulk density where the cores have none [g/cm^3]
    :param footprint_radius_m: radius of the probe's footprint [m]; without effect if a bare probe sees less
    """

    humidity_gm3: float = 5.0
    pressure_hpa: float = 1013.25
    vegetation_m: float = 0.0
    bound_water: float = 0.0
    bulk_density_gcm3: float = 1.43
    footprint_radius_m: float = math.inf


@dataclass(frozen=True)
class CoreMean:
    """What a probe sees of the cores.

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
    cores: Sequence[SoilCore], weighting: Weighting = "revised", around: Surroundings | None = None
) -> CoreMean:
    """Mean moisture of the cores, weighted as the probe sees them.

    The weights depend on the mean, so they are iterated (Schrön et al. 2017, section 3). Depths weigh within a
    profile, distances weigh the profiles. What the cores do not have (distance, depth) does not weigh.

    * ``revised``: Köhli et al. (2015) with the parameters of Schrön et al. (2017), see :class:`Footprint`. A core
      with thickness weighs the integral over it.
    * ``conventional``: ``exp(-r / 127 m)`` of the distance (Zreda et al. 2008) and ``1 - d / D`` of the depth,
      with ``D = 5.8 cm / (water + 0.0829)`` (Franz et al. 2012, Water Resources Research 48:W08515, equation 5).
    * ``equal``: the weights of the user alone.

    :param around: conditions of the calibration; standard air and a bare probe if ``None``
    :raises ValueError: if no core has a weight
    """
    around = around or Surroundings()
    known = _mean_density(cores)
    density = known or around.bulk_density_gcm3
    groups = profiles_of(cores)
    vwc = float(np.mean([core.vwc for core in cores])) if cores else math.nan
    for _ in range(_MAX_ITERATIONS):
        water = vwc + density * around.bound_water
        weights = [_weights(group, weighting, around, water, density) for group in groups]
        means = np.array([_average(group, within) for group, (_, within) in zip(groups, weights, strict=True)])
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
    has_depth = any(not math.isnan(core.top_cm) for core in cores)
    depth = _depth_cm(weighting, around, vwc, density) if has_depth else math.nan
    return CoreMean(vwc, error, known, len(cores), len(groups), depth, _weights_text(groups, weighting))


def _weights_text(groups: Sequence[Sequence[SoilCore]], weighting: Weighting) -> str:
    """Weights that act: depths weigh within profiles of several cores, distances weigh several profiles."""
    distance = len(groups) > 1 and not all(math.isnan(group[0].distance_m) for group in groups)
    depth = not all(math.isnan(group[0].top_cm) or len(group) == 1 for group in groups)
    if weighting == "equal" or not (distance or depth):
        return "equal weights"
    alone = "" if distance and depth else " of the distance alone" if distance else " of the depth alone"
    return f"{weighting} weights{alone}"


def _mean_density(cores: Sequence[SoilCore]) -> float | None:
    known = [(core.bulk_density_gcm3, core.weight) for core in cores if not math.isnan(core.bulk_density_gcm3)]
    total = sum(weight for _, weight in known)
    return sum(density * weight for density, weight in known) / total if total > 0 else None


def _average(group: Sequence[SoilCore], weights: Array) -> float:
    if not weights.sum() > 0:
        return 0.0  # all of its cores lie too deep
    return float(weights @ [core.vwc for core in group] / weights.sum())


def _weights(
    group: Sequence[SoilCore], weighting: Weighting, around: Surroundings, water: float, density: float
) -> tuple[float, Array]:
    """Weight of a profile, and weights of its cores."""
    own = np.array([core.weight for core in group])
    distance_m = group[0].distance_m
    across = float(own.mean())
    if weighting == "equal":
        return float(own.sum()), own
    footprint = _footprint(around, water)
    if not math.isnan(distance_m):
        conventional = math.exp(-distance_m / _CONVENTIONAL_REACH_M)
        across *= (
            conventional if weighting == "conventional" else float(footprint.weight(max(distance_m, _NEAREST_M)))
        )
    if math.isnan(group[0].top_cm):
        return across, own
    top, bottom = (np.array([getattr(core, name) for core in group]) for name in ("top_cm", "bottom_cm"))
    if weighting == "conventional":
        reach_cm = franz_depth_cm(water)
        return across, own * np.maximum(1 - (top + bottom) / 2 / reach_cm, 0.0)
    from_m = 0.0 if math.isnan(distance_m) else distance_m
    reach_cm = float(footprint.depth_at_cm(from_m, density))
    return across, own * _seen(top, bottom, reach_cm)


def _seen(top_cm: Array, bottom_cm: Array, depth_cm: float) -> Array:
    """Weight ``exp(-2 d / D86)`` of a depth (Schrön et al. 2017, appendix A), or its integral over a layer."""
    thickness = 2 * (bottom_cm - top_cm) / depth_cm
    layer = -np.expm1(-thickness) * depth_cm / 2
    return np.asarray(np.exp(-2 * top_cm / depth_cm) * np.where(thickness > 0, layer, 1.0))


def franz_depth_cm(water: float) -> float:
    """Depth D86 of Franz et al. (2012), equation 5 [cm].

    :param water: all water of the soil [m^3/m^3]
    """
    return 5.8 / (water + 0.0829)


def _footprint(around: Surroundings, water: float) -> Footprint:
    return Footprint(
        water, around.humidity_gm3, around.pressure_hpa, around.vegetation_m, around.footprint_radius_m
    )


def _depth_cm(weighting: Weighting, around: Surroundings, vwc: float, density: float) -> float:
    water = vwc + density * around.bound_water
    if weighting == "conventional":
        return franz_depth_cm(water)
    return _footprint(around, water).depth_cm(density)
