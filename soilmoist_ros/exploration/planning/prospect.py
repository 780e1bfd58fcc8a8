# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Look-ahead of the planner: the value of each stop, the trip included."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import MAX_DWELL_S, MarginalValue
from soilmoist_ros.exploration.planning.planning_model import PlanningModel, Trips, Worth
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import TravelModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_CELLS = 400
"""Approximate number of cells that represent the field: the variance is smooth over the variogram's range."""
MAX_STOPS = 500  # largest number of graph nodes that are compared
MAX_PLACES = 12  # largest number of places that represent a route
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Counting:
    """Times when the robot counts."""

    cadence_s: float = 10.0  # duration of a record [s]
    on_way: bool = True  # whether records taken while driving are mapped too


@dataclass(eq=False)
class Prospect:
    """Candidates and their values for the planner; arrays of shape (k,)."""

    model: PlanningModel  # posterior covariance, with exactly these candidates as its stops
    stops: Sequence[Stop]  # the candidates
    travel: TravelModel  # routes and times
    position: tuple[float, float]  # where the robot is [m]
    travel_s: Array  # travel times to the candidates [s]; inf if unreachable
    budget_s: Array  # time left for the trip and the dwell [s]
    counting: Counting  # when the robot counts
    travel_cost_s: Array
    """Travel times with the costs that an operator adds [s]; for comparisons of stops, never for the clock."""
    of_candidates: Indices  # index of each among the candidates of the situation
    staying: int | None = None
    """Number of the candidate at which the robot stands and may count on: its travel time is 0, with no way and no
    stop overhead; ``None`` if there is none."""
    min_dwell_s: float = 0.0  # shortest dwell [s]

    @cached_property
    def reachable(self) -> Indices:
        """Numbers of the candidates at which the robot could still count."""
        return np.flatnonzero(np.isfinite(self.travel_s) & (self.travel_s < self.budget_s))

    @cached_property
    def reachable_stops(self) -> tuple[Stop, ...]:
        """Candidates at :attr:`reachable`."""
        if len(self.reachable) == len(self.stops):
            return tuple(self.stops)
        return tuple(self.stops[number] for number in self.reachable.tolist())

    def worth(self, rows: Indices | None = None) -> Worth:
        """Value of some :attr:`reachable` candidates, by their rows; of all by default."""
        return self.model.worth(self._trips(np.arange(len(self.reachable)) if rows is None else rows))

    def _trips(self, rows: Indices) -> Trips:
        """Trips to some :attr:`reachable` candidates."""
        stops, (ways, exposure_s) = self.reachable[rows], self._ways
        longest_s = np.minimum(self.budget_s[stops] - self.travel_s[stops], MAX_DWELL_S)
        overhead_s = np.where(stops == self.staying, 0.0, self.overhead_s)
        cost_s = self.travel_cost_s[stops]
        return Trips(stops, ways[rows], exposure_s[rows], overhead_s, longest_s, cost_s, self.min_dwell_s)

    @cached_property
    def price(self) -> float:
        """Price of a second: the highest value of all candidates that need a trip."""
        return float(self.worth().value[self.reachable != self.staying].max(initial=0.0))

    def dwell(self, stop: Stop, longest_s: float = MAX_DWELL_S) -> MarginalValue | None:
        """Dwell rule of a stop at the current price of time, ``None`` if the stop is not reachable."""
        for row, number in enumerate(self.reachable.tolist()):
            if self.stops[number].name == stop.name:
                _, gain, variance, noise, *_ = self.worth(np.array([row]))
                a, b = gain[:, 0].tolist(), np.maximum(variance[:, 0], 1e-12).tolist()
                others = tuple(zip(a[1:], b[1:], noise[1:, 0].tolist(), strict=True))
                return MarginalValue(a[0], b[0], self.price, self.model.factor, longest_s, others)
        return None

    @property
    def overhead_s(self) -> float:
        """Time of each trip in which the robot already counts at the stop [s]."""
        motion = self.travel.motion
        return motion.stop_overhead_s * motion.overhead_counted if self.counting.on_way else 0.0

    def way(self, place: tuple[float, float], row: int, travel_s: float) -> tuple[Indices, Array]:
        """Nodes on the route from a place to a reachable candidate, and the exposure at each [s]."""
        drive_s = travel_s - self.travel.motion.stop_overhead_s
        count = min(math.ceil(drive_s / self.counting.cadence_s - _ROUNDING), MAX_PLACES)
        if count <= 0:
            return np.empty(0, np.intp), np.empty(0)
        shares = (np.arange(count) + 0.5) / count
        places = self.travel.along(place, (self.reachable_stops[row],), shares[None])[0]
        return self.model.nearest_nodes(places), np.full(count, drive_s / count)

    @cached_property
    def _ways(self) -> tuple[Indices, Array]:
        """Nodes on the route to each :attr:`reachable` candidate, and exposure at each [s]; of shape (k, m)."""
        stops = self.reachable
        if not self.counting.on_way:
            return np.empty((len(stops), 0), np.intp), np.empty((len(stops), 0))
        drive_s = self.travel_s[stops] - self.travel.motion.stop_overhead_s
        counts = np.clip(np.ceil(drive_s / self.counting.cadence_s - _ROUNDING), 0, MAX_PLACES).astype(int)
        most = int(counts.max(initial=0))
        shares = (np.arange(most) + 0.5) / np.maximum(counts, 1)[:, None]
        places = self.travel.along(self.position, self.reachable_stops, np.minimum(shares, 1.0))
        used = np.arange(most) < counts[:, None]
        exposure_s = np.where(used, (drive_s / np.maximum(counts, 1))[:, None], 0.0)
        nodes = np.full(used.shape, self.model.nearest_nodes(self.position))
        nodes[used] = self.model.nearest_nodes(places[used])
        return nodes, exposure_s

    def counted_on_tour(self, rows: Indices, dwell_s: float, legs_s: Array) -> tuple[Indices, Array]:
        """Nodes at which a tour counts, and the exposure at each [s]."""
        nodes = [self.model.stop_nodes[self.reachable[rows]]]
        seconds = [np.full(len(rows), dwell_s + self.overhead_s)]
        if self.counting.on_way:
            place = self.position
            for row, leg_s in zip(rows.tolist(), legs_s.tolist(), strict=True):
                way, each = self.way(place, row, leg_s)
                nodes.append(way)
                seconds.append(each)
                stop = self.reachable_stops[row]
                place = stop.x_m, stop.y_m
        node, which = np.unique(np.concatenate(nodes), return_inverse=True)  # counts at one place add up
        return node, np.bincount(which, np.concatenate(seconds)).astype(float)

    def tour_cost_s(self, legs_s: Array) -> float:
        """Time that an operator adds to that of a tour in comparisons [s]."""
        motion = self.travel.motion
        driven_m = motion.speed_mps * float(np.maximum(legs_s - motion.stop_overhead_s, 0.0).sum())
        return motion.stop_cost_s * len(legs_s) + motion.metre_cost_s * driven_m
