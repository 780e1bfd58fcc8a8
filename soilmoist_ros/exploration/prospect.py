"""What the planner can look ahead with: the worth of each stop, the way there included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.dwell import LONGEST_DWELL_S, MarginalValue
from soilmoist_ros.exploration.planning_model import PlanningModel, Worth
from soilmoist_ros.exploration.strategy import Stop
from soilmoist_ros.exploration.travel import TravelModel, polyline_length_m

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_CELLS = 400
"""About so many cells stand for the field: the variance is smooth over the range of the variogram."""
MOST_STOPS = 500
"""At most so many nodes of a graph are weighed."""
MOST_PLACES = 12
"""At most so many places stand for a way."""
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Counting:
    """When the robot counts.

    :param cadence_s: duration of a record [s]
    :param on_way: whether records taken while driving are mapped too
    """

    cadence_s: float = 10.0
    on_way: bool = True


class Prospect:
    """Candidates as a planner weighs them.

    :param model: posterior covariance, with exactly these candidates as its stops
    :param stops: the candidates
    :param travel: ways and times
    :param position_xy: where the robot is [m]
    :param travel_s: travel times to the candidates, shape (k,) [s]; inf where none is possible
    :param budget_s: time left for a trip and counting at its end, shape (k,) [s]
    :param counting: when the robot counts
    """

    def __init__(
        self,
        model: PlanningModel,
        stops: Sequence[Stop],
        travel: TravelModel,
        position_xy: tuple[float, float],
        travel_s: Array,
        budget_s: Array,
        counting: Counting,
    ) -> None:
        self.model = model
        self.stops = stops
        self._travel = travel
        self._position = position_xy
        self._travel_s = travel_s
        self._budget_s = budget_s
        self._counting = counting

    @cached_property
    def reachable(self) -> Indices:
        """Numbers of the candidates at which the robot could still count."""
        return np.flatnonzero(np.isfinite(self._travel_s) & (self._travel_s < self._budget_s))

    @cached_property
    def worth(self) -> Worth:
        """Worth of each :attr:`reachable` candidate, in that order."""
        stops = self.reachable
        ways, exposure_s = self._ways(stops)
        overhead_s = self._travel.motion.stop_overhead_s if self._counting.on_way else 0.0
        longest_s = np.minimum(self._budget_s[stops] - self._travel_s[stops], LONGEST_DWELL_S)
        return self.model.worth(stops, self._travel_s[stops], ways, exposure_s, overhead_s, longest_s)

    @property
    def price(self) -> float:
        """What a second is worth: the highest value of all candidates."""
        return float(self.worth.value.max(initial=0.0))

    def dwell(self, stop: Stop) -> MarginalValue | None:
        """Dwell rule of a stop at the price of time, ``None`` if it is not among the candidates."""
        for row, number in enumerate(self.reachable.tolist()):
            if self.stops[number].name == stop.name:
                gain, variance = float(self.worth.gain[row]), float(self.worth.variance[row])
                return MarginalValue(gain, max(variance, 1e-12), self.price, self.model.factor)
        return None

    def _ways(self, stops: Indices) -> tuple[Indices, Array]:
        """Nodes of the model along the way to each candidate, shape (k, m), and the exposure at each [s]."""
        if not self._counting.on_way:
            return np.empty((len(stops), 0), np.intp), np.empty((len(stops), 0))
        drive_s = self._travel_s[stops] - self._travel.motion.stop_overhead_s
        counts = np.clip(np.ceil(drive_s / self._counting.cadence_s - _ROUNDING), 0, MOST_PLACES).astype(int)
        most = int(counts.max(initial=0))
        places = np.tile(np.asarray(self._position, float), (len(stops), most, 1))
        for row, number in enumerate(stops.tolist()):
            if counts[row]:
                places[row, : counts[row]] = along(
                    self._travel.route(self._position, self.stops[number]), int(counts[row])
                )
        used = np.arange(most) < counts[:, None]
        exposure_s = np.where(used, (drive_s / np.maximum(counts, 1))[:, None], 0.0)
        return self.model.nearest_nodes(places), exposure_s


def along(polyline: Array, count: int) -> Array:
    """Middles of ``count`` equal pieces of a way, shape (count, 2) [m].

    :param polyline: corners, shape (p, 2) [m]
    :param count: >= 1
    """
    length_m = polyline_length_m(polyline)
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(polyline, axis=0).T))])
    middles = (np.arange(count) + 0.5) / count * length_m
    return np.column_stack([np.interp(middles, reached, axis) for axis in polyline.T])
