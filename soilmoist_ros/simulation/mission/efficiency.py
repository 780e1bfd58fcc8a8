# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Efficiency of a mission: the lowest variance that any plan can leave, divided by that of the mission's samples.

Both variances are those of kriging with one variogram, fitted to the truth of the field, with the noise of the
true rate. They do not depend on the counts, the weather or the variogram that the mission fitted. Missions of
equal planned time on one field have the same lower bound, so their efficiencies compare their plans alone.

Where the map knows earlier surveys or covariates, both variances allow for them: a plan leaves out what is known
already. Then the variogram is that of the map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import MIN_RATE_CPS, spread_cells
from soilmoist_ros.foundation import squared_distances
from soilmoist_ros.mapping import FieldPrior, PoissonKriging, Variogram, correlation_model, fit_variogram
from soilmoist_ros.simulation.mission.mission_result import MissionResult

Array = NDArray[np.float64]

CELLS = 200  # approximate number of cells that represent the field
TRUTH_EXPOSURE_S = 1e6  # exposure of the truth in the fit of its variogram, which makes its noise negligible [s]


@dataclass(frozen=True)
class Efficiency:
    """Mean variances of the smooth rate over the field, without the nugget.

    :param least: lower bound: variance after the best division of the planned time of all robots among all places,
        without travel [(counts/s)^2]
    :param of_truth: whether variogram and rates are those of the truth, so that missions on one field can be
        compared; otherwise those of the mission's own map, and they cannot
    """

    least: float
    left: float  # variance that the samples of the mission leave [(counts/s)^2]
    moisture: bool = False  # whether the slope of the calibration curve at the true rate weights the variances
    of_truth: bool = True

    @property
    def reached(self) -> float:
        """Lower bound divided by the variance left. Not limited to 1: a value above it is a fault of the bound."""
        return self.least / self.left if self.left > 0 else 1.0


@lru_cache(maxsize=2)
def mission_efficiency(mission: MissionResult) -> Efficiency | None:
    """Efficiency of a mission; ``None`` without a map or mission time, or if several properties have a weight."""
    from scipy.spatial import KDTree

    soil_map = mission.soil_map
    known = None if soil_map is None or soil_map.fit is None else soil_map.fit.prior
    of_truth = mission.properties[0].known_truth is not None and known is None
    used_s = mission.series[-1].time_s if mission.series else 0.0
    time_s = 3600 * mission.settings.hours if of_truth else used_s
    several = any(mapped.weight > 0 for mapped in mission.properties[1:])
    if soil_map is None or several or not min(used_s, time_s) > 0:
        return None
    grid, samples = soil_map.grid, soil_map.samples
    rate = np.maximum(mission.truth_rate[grid.mask] if of_truth else soil_map.rate[grid.mask], MIN_RATE_CPS)
    chosen = spread_cells(grid.mask, CELLS)[grid.mask]
    cells, its_rate = grid.cells[chosen], rate[chosen]
    variogram = soil_map.variogram
    if of_truth:
        variogram = _variogram_of(cells.tobytes(), its_rate.tobytes(), grid.extent_m)
    weight = np.full(len(cells), 1 / len(cells))
    moisture = mission.settings.target == "vwc" and soil_map.curve is not None
    if moisture:
        assert soil_map.curve is not None
        weight = weight * soil_map.curve.weight(its_rate)
        weight /= weight.sum()
    robots_s = time_s * mission.settings.robots
    least = _least(variogram, cells.tobytes(), weight.tobytes(), its_rate.tobytes(), robots_s, known)
    # The weather changes the exposures of the map, and would change the bound.
    effective_s = sum(record.effective_exposure_s for record in mission.records)
    correction = sum(record.exposure_s for record in mission.records) / effective_s if effective_s > 0 else 1.0
    exposure_s = correction * samples.exposure_s / rate[KDTree(grid.cells).query(samples.xy)[1]]
    # The variance depends on the counts only through their noise: rate 1 in time t / rate has that of rate in t.
    kriging = PoissonKriging(variogram, keep_nugget=False, mean_rate=1.0, prior=known)
    kriging.fit(samples.xy, np.zeros(len(samples)), exposure_s, samples.spread)
    return Efficiency(least, float(weight @ kriging.predict(cells)[1]), moisture, of_truth)


@lru_cache(maxsize=8)
def _variogram_of(cells_xy: bytes, rate_cps: bytes, extent_m: float) -> Variogram:
    """Isotropic Matern 3/2 variogram of a truth at cells of shape (g, 2), both as bytes; one for a field."""
    xy, rate = np.frombuffer(cells_xy).reshape(-1, 2), np.frombuffer(rate_cps)
    exposure_s = np.full(len(rate), TRUTH_EXPOSURE_S)
    return fit_variogram(xy, np.rint(rate * exposure_s), exposure_s, extent_m=extent_m, anisotropy=False)


@lru_cache(maxsize=8)
def _least(
    variogram: Variogram, cells_xy: bytes, weight: bytes, rate_cps: bytes, time_s: float, known: FieldPrior | None
) -> float:
    """Certain lower bound of the variance; arrays as bytes."""
    xy = np.frombuffer(cells_xy).reshape(-1, 2)
    found, _, gap = least_variance(variogram, xy, np.frombuffer(weight), np.frombuffer(rate_cps), time_s, known)
    return found * (1 - gap)


# The bound ------------------------------------------------------------------------------------------------------

ROUNDS = 200  # maximum number of rounds of the search
CLOSE = 1e-3  # the search ends when the result is certain to be within this share of the minimum
_FAR = 100.0


def least_variance(
    variogram: Variogram,
    cells_xy: Array,
    weight: Array,
    rate_cps: Array,
    time_s: float,
    known: FieldPrior | None = None,
) -> tuple[float, Array, float]:
    """Minimum integrated variance of the smooth rate that any plan can reach after a given counting time.

    The bound ignores travel and divides the time freely among all places. The best division is an A-optimal design
    (Pukelsheim 2006, Optimal Design of Experiments). The problem is convex: the search finds the global minimum.

    :param variogram: variogram; its nugget is ignored, so the bound is valid for every nugget
    :param cells_xy: cells that stand for the field, shape (g, 2) [m]; cost grows with the cube of g
    :param rate_cps: rate at each cell times the correction factor, shape (g,), > 0 [counts/s]
    :returns: the variance [(counts/s)^2], the time to count at each cell, shape (g,) [s], and the share by which
        the variance may lie above the minimum
    """
    from scipy.linalg import cho_factor, cho_solve

    structured = variogram.structured_sill
    scaled = variogram.scaled(cells_xy)
    prior = structured * correlation_model(variogram.model).correlation(squared_distances(scaled, scaled))
    if known is not None:
        at = known.at(cells_xy)
        prior += known.covariance(at, at)
    # A mean that nothing is known of is a constant of very large variance.
    prior += _FAR * structured
    dwell_s = np.full(len(cells_xy), time_s / len(cells_xy))
    best, certain = np.inf, 0.0
    for _ in range(ROUNDS):
        # (C^-1 + T)^-1 = C - C S (I + S C S)^-1 S C with S = sqrt(T): nothing is inverted that might be singular.
        root = np.sqrt(dwell_s / rate_cps)
        inner = cho_factor(np.eye(len(root)) + root[:, None] * prior * root, lower=True)
        posterior = prior - (prior * root) @ cho_solve(inner, root[:, None] * prior)
        value = float(weight @ np.diag(posterior))
        slope = (weight @ posterior**2) / rate_cps  # fall of the value per second at each cell
        # The value is convex in the times: it lies above its tangent, whose least over all divisions is known.
        certain = max(certain, value + float(slope @ dwell_s) - time_s * float(slope.max()))
        if value < best:
            best, found = value, dwell_s
        if best - certain <= CLOSE * best:
            break
        dwell_s = dwell_s * np.sqrt(slope)
        dwell_s *= time_s / dwell_s.sum()
    return best, found, (best - certain) / best
