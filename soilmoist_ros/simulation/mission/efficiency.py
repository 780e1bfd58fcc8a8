"""How much of what any plan could have done a mission did."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from soilmoist_ros.exploration.planning.efficiency import least_variance
from soilmoist_ros.exploration.planning.planning_model import MIN_RATE_CPS, spread_cells
from soilmoist_ros.simulation.mission.result import MissionResult

CELLS = 350
"""About so many cells stand for the field."""


@dataclass(frozen=True)
class Efficiency:
    """Variances are means over the field of the smooth rate's, without the nugget, under the final variogram.

    :param least: what the best division of the time among all places would have left, were there no way to drive
        [(counts/s)^2]
    :param left: what the mission left [(counts/s)^2]
    :param moisture: whether they are weighted with the slope of the calibration curve, for a map of the moisture
    """

    least: float
    left: float
    moisture: bool = False

    @property
    def reached(self) -> float:
        """Share of what any plan could have done, 0..1."""
        return min(self.least / self.left, 1.0) if self.left > 0 else 1.0


@lru_cache(maxsize=2)
def mission_efficiency(mission: MissionResult) -> Efficiency | None:
    """Efficiency of a mission; ``None`` without a map or time spent, or if several properties were planned for.

    It judges the plan, not the map: the variogram is taken to be the truth, and so is the map's rate.
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
