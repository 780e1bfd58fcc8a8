"""From the map and the robot's place to the next stop: prepares the situation and asks the strategy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.dwell import DwellRule
from soilmoist_ros.exploration.mission_types import PlanKind, RequestPlan
from soilmoist_ros.exploration.strategy import Choice, Situation, Stop, Strategy
from soilmoist_ros.exploration.travel import TravelModel
from soilmoist_ros.mapping.field_grid import FieldGrid
from soilmoist_ros.mapping.live_map import LiveMap

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plan:
    """The answer to a plan request.

    :param choice: the next stop, ``None`` if nothing is worth going to or can be reached
    :param travel_s: travel time to it [s], ``None`` without a choice
    """

    choice: Choice | None
    travel_s: float | None


class Explorer:
    """Chooses stops for one mission.

    :param live_map: the map under way
    :param stops: stops that may be chosen
    :param travel: ways and times
    :param strategy: the strategy of this mission
    :param warm_up: the strategy until the map may guide
    :param dwell: dwell rule, to expect how long a measurement takes
    :param min_dwell_s: a stop must leave at least this for counting [s]
    :param nominal_rate_cps: rate to expect before there is a map [counts/s]
    :param home: where the robot must be at the end, if anywhere
    :param rng: source of all randomness
    """

    def __init__(
        self,
        live_map: LiveMap,
        stops: tuple[Stop, ...],
        travel: TravelModel,
        strategy: Strategy,
        warm_up: Strategy,
        dwell: DwellRule,
        rng: np.random.Generator,
        min_dwell_s: float = 60.0,
        nominal_rate_cps: float = 4.0,
        home: Stop | None = None,
    ) -> None:
        self.live_map = live_map
        self.stops = stops
        self.travel = travel
        self.strategy = strategy
        self.warm_up = warm_up
        self.dwell = dwell
        self.rng = rng
        self.min_dwell_s = min_dwell_s
        self.nominal_rate_cps = nominal_rate_cps
        self.home = home
        self._xy = np.array([(stop.x_m, stop.y_m) for stop in stops], dtype=float).reshape(-1, 2)
        self._stops_are_cells = np.array_equal(self._xy, live_map.grid.cells)
        self._home_s = self._way_home_s()

    def plan(self, request: RequestPlan, position_xy: tuple[float, float]) -> Plan:
        """Choose the next stop.

        :param request: what the mission asks for
        :param position_xy: where the robot is [m]
        """
        situation = self.situation(request, position_xy)
        strategy = self.warm_up if request.kind is PlanKind.WARM_UP else self.strategy
        choice = strategy.choose(situation, self.rng)
        if choice is None:
            return Plan(None, None)
        return Plan(choice, float(self.travel.travel_s(position_xy, [choice.stop])[0]))

    def situation(self, request: RequestPlan, position_xy: tuple[float, float]) -> Situation:
        """What the strategy is shown: stops that are ruled out are left out, those too far cannot be reached."""
        ruled_out = set(request.blacklisted)
        kept = np.array([index for index, stop in enumerate(self.stops) if stop.name not in ruled_out], np.intp)
        candidates = tuple(self.stops[index] for index in kept) if ruled_out else self.stops
        travel_s = self.travel.travel_s(position_xy, candidates)
        fits = travel_s + self.min_dwell_s + self._home_s[kept] <= request.budget_left_s
        live_map = self.live_map
        known_rate = live_map.fit is not None
        return Situation(
            candidates=candidates,
            variance=self._variance(kept),
            map_variance=live_map.variance if known_rate else np.ones(len(live_map.variance)),
            map_xy=live_map.grid.cells,
            cell_m=live_map.grid.cell_m,
            position_xy=np.asarray(position_xy, float),
            measured_xy=live_map.samples.xy,
            travel_s=np.where(fits, travel_s, np.inf),
            travel_between_s=lambda indices: self.travel.between_s(candidates, indices),
            time_left_s=request.time_left_s,
            expected_dwell_s=self.dwell.expected_s(
                float(live_map.rate.mean()) if known_rate else self.nominal_rate_cps
            ),
        )

    def _variance(self, kept: NDArray[np.intp]) -> Array:
        live_map = self.live_map
        if live_map.kriging is None:
            return np.ones(len(kept))
        if self._stops_are_cells:
            return live_map.variance[kept]
        return live_map.kriging.predict(self._xy[kept])[1]

    def _way_home_s(self) -> Array:
        if self.home is None:
            return np.zeros(len(self.stops))
        # Ways are taken to be as long back as forth.
        return self.travel.travel_s((self.home.x_m, self.home.y_m), self.stops)


def cell_stops(grid: FieldGrid) -> tuple[Stop, ...]:
    """A stop at the centre of each cell inside the field, for free travel; named by row and column."""
    rows, columns = np.nonzero(grid.mask)
    return tuple(
        Stop(f"r{row}c{column}", float(x), float(y))
        for row, column, (x, y) in zip(rows.tolist(), columns.tolist(), grid.cells, strict=True)
    )
