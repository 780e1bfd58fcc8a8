"""Efficiency of a mission relative to the best possible plan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from soilmoist_ros.exploration.planning.efficiency import least_variance
from soilmoist_ros.exploration.planning.planning_model import MIN_RATE_CPS, spread_cells
from soilmoist_ros.simulation.mission.result import MissionResult

CELLS = 350
"""Approximate number of cells that represent the field."""


@dataclass(frozen=True)
class Efficiency:
    """Mean variances of the smooth rate over the field, without the nugget, under the final variogram.

    :param least: lower bound: variance after the best division of the time among all positions, without travel
        time [(counts/s)^2]
    :param left: variance after the mission [(counts/s)^2]
    :param moisture: whether the slope of the calibration curve weights the variances, for a moisture map
    """

    least: float
    left: float
    moisture: bool = False

    @property
    def reached(self) -> float:
        """Lower bound divided by the variance after the mission, 0..1."""
        return min(self.least / self.left, 1.0) if self.left > 0 else 1.0


@lru_cache(maxsize=2)
def mission_efficiency(mission: MissionResult) -> Efficiency | None:
    """Efficiency of a mission; ``None`` without a map or mission time, or if several properties have a weight.

    It evaluates the plan, not the map: it assumes that the variogram and the mapped rate are true.
    """
    soil_map = mission.soil_map
    time_s = mission.series[-1].time_s if mission.series else 0.0
    several = any(mapped.weight > 0 for mapped in mission.properties[1:])
    if soil_map is None or several or not time_s > 0:
        return None
    grid = soil_map.grid
    cells = grid.cells[spread_cells(grid.mask, CELLS)[grid.mask]]
    rate, variance = soil_map.kriging.predict(cells)
    if soil_map.kriging.keep_nugget:
        variance = np.maximum(variance - soil_map.variogram.nugget, 0.0)
    rate = np.maximum(rate, MIN_RATE_CPS)
    weight = np.full(len(cells), 1 / len(cells))
    moisture = mission.settings.target == "vwc" and soil_map.curve is not None
    if moisture:
        assert soil_map.curve is not None
        weight = weight * soil_map.curve.weight(rate)
        weight /= weight.sum()
    live = sum(record.exposure_s for record in mission.records)
    effective = sum(record.effective_exposure_s for record in mission.records)
    factor = live / effective if effective > 0 else 1.0
    least = least_variance(soil_map.variogram, cells, weight, factor * rate, time_s * mission.settings.robots)
    return Efficiency(least.integrated_variance * (1 - least.gap), float(weight @ variance), moisture)
