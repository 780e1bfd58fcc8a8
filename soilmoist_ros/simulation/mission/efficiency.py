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

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import MIN_RATE_CPS, least_variance, spread_cells
from soilmoist_ros.mapping import FieldPrior, PoissonKriging, Samples, Variogram, fit_variogram
from soilmoist_ros.simulation.mission.mission_result import MissionResult

Array = NDArray[np.float64]

CELLS = 200  # approximate number of cells that represent the field
TRUTH_EXPOSURE_S = 1e6  # exposure of the truth in the fit of its variogram, which makes its noise negligible [s]


@dataclass(frozen=True)
class Efficiency:
    """Mean variances of the smooth rate over the field, without the nugget.

    :param least: lower bound: variance after the best division of the planned time of all robots among all places,
        without travel [(counts/s)^2]
    :param left: variance that the samples of the mission leave [(counts/s)^2]
    :param moisture: whether the slope of the calibration curve at the true rate weights the variances
    :param of_truth: whether variogram and rates are those of the truth, so that missions on one field can be
        compared; otherwise those of the mission's own map, and they cannot
    """

    least: float
    left: float
    moisture: bool = False
    of_truth: bool = True

    @property
    def reached(self) -> float:
        """Lower bound divided by the variance left. Not limited to 1: a value above it is a fault of the bound."""
        return self.least / self.left if self.left > 0 else 1.0


@lru_cache(maxsize=2)
def mission_efficiency(mission: MissionResult) -> Efficiency | None:
    """Efficiency of a mission; ``None`` without a map or mission time, or if several properties have a weight."""
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
    live = replace(samples, exposure_s=_correction(mission) * samples.exposure_s)
    left = weight @ _variance_left(variogram, live, cells, rate[_nearest(grid.cells, samples.xy)], known)
    return Efficiency(least, float(left), moisture, of_truth)


def _correction(mission: MissionResult) -> float:
    """Mean product of the correction factors: live time divided by effective exposure."""
    live = sum(record.exposure_s for record in mission.records)
    effective = sum(record.effective_exposure_s for record in mission.records)
    return live / effective if effective > 0 else 1.0


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
    found = least_variance(variogram, xy, np.frombuffer(weight), np.frombuffer(rate_cps), time_s, known)
    return found.integrated_variance * (1 - found.gap)


def _variance_left(
    variogram: Variogram, samples: Samples, cells_xy: Array, rate_cps: Array, known: FieldPrior | None = None
) -> Array:
    """Kriging variance of the smooth rate at cells, shape (g,).

    :param rate_cps: true rate at the samples, shape (n,) [counts/s]
    """
    # The variance depends on the counts only through their noise: rate 1 in time t / rate has that of rate in t.
    kriging = PoissonKriging(variogram, keep_nugget=False, mean_rate=1.0, prior=known)
    kriging.fit(samples.xy, np.zeros(len(samples)), samples.exposure_s / rate_cps, samples.spread)
    return kriging.predict(cells_xy)[1]


def _nearest(cells_xy: Array, xy: Array) -> NDArray[np.intp]:
    """Number of the nearest cell of each place."""
    from scipy.spatial import KDTree

    return np.asarray(KDTree(cells_xy).query(xy)[1], np.intp)
