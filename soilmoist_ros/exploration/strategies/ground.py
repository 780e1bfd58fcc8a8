# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a tour is designed on: the stops within reach, and the uncertainty of the map between them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import FixedInterval, Optimal, StopRule
from soilmoist_ros.exploration.strategies.rules import reachable, whole_records
from soilmoist_ros.exploration.strategies.strategy import Situation

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_CELLS = 400
"""Approximate number of cells that represent the field without a map."""
MAX_STOPS = 500
"""Largest number of stops that are considered without a map."""
NO_MAP_DWELL_S = 20.0
"""Dwell without a map [s]; in plans for 2 h, all from 10 to 30 s leave the same variance within 2 %."""


class Ground:
    """The situation of a tour; its stops are numbered by rows.

    :param situation: what the strategy is shown

    Attributes
    ----------
    stops : tuple[Stop, ...]
        candidates at which the robot could still count
    xy : NDArray
        their places, shape (k, 2) [m]
    travel_s : NDArray
        travel times from the robot, stop overhead included, shape (k,) [s]
    cells_xy : NDArray
        cells that represent the field, shape (g, 2) [m]
    mass : NDArray
        share of the stops that each cell should attract, shape (g,): the squared posterior variance times the
        weight of the cell; equal without a map
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self.prospect = situation.prospect() if situation.prospect is not None else None
        if self.prospect is None:
            rows = np.flatnonzero(reachable(situation))
            self._index = rows[:: max(len(rows) // MAX_STOPS, 1)]
            self.cells_xy = situation.map_xy[:: max(len(situation.map_xy) // MAX_CELLS, 1)]
            self.mass = np.ones(len(self.cells_xy))
            self.stops = tuple(situation.candidates[row] for row in self._index.tolist())
        else:
            model = self.prospect.model
            self.stops = self.prospect.reachable_stops
            self._index = self.prospect.of_candidates[self.prospect.reachable]
            self.cells_xy = model.cells_xy
            self.mass = np.asarray(sum(each.weight * each.cell_variance**2 for each in (model, *model.others)))
        self.xy = situation.candidates_xy[self._index]
        self.travel_s = situation.travel_s[self._index]

    @property
    def cadence_s(self) -> float:
        """Duration of a record [s]."""
        return self._situation.counting.cadence_s

    @property
    def min_dwell_s(self) -> float:
        """Shortest dwell that the mission allows, at least one record [s]."""
        return self.cadence_s if self.prospect is None else max(self.cadence_s, self.prospect.min_dwell_s)

    @property
    def is_uneven(self) -> bool:
        """Whether the map says that the field varies more here than there."""
        return self.prospect is not None and any(
            model.is_uneven for model in (self.prospect.model, *self.prospect.model.others)
        )

    @property
    def fixed_dwell_s(self) -> float | None:
        """Dwell that the mission's rule demands [s]; ``None`` if the strategy may choose it."""
        return None if isinstance(self._situation.dwell, Optimal) else self._situation.expected_dwell_s

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self.xy)

    def nearest(self, xy: Array) -> Indices:
        """Rows of the stops nearest to places of shape (n, 2) [m]."""
        return np.asarray(self._tree.query(xy)[1], np.intp)

    def between_s(self, rows: Indices) -> Array:
        """Travel times between some stops, shape (m, m) [s]."""
        return self._situation.travel_between_s(self._index[rows])

    def legs_s(self, rows: Indices) -> Array:
        """Times between the dwells of a tour, shape (m,) [s]: travel, and the wait for the next record."""
        legs_s = self._situation.legs_s
        between_s = self.between_s(rows).diagonal(1) if legs_s is None else legs_s(self._index[rows])
        return whole_records(np.concatenate([self.travel_s[rows[:1]], between_s]), self.cadence_s)

    def left(self, rows: Indices, dwell_s: float) -> float:
        """Integrated variance that a tour leaves, and what the operator's costs of it are worth in variance.

        :param rows: stops in order
        :param dwell_s: dwell at each [s]
        """
        prospect, legs_s = self.prospect, self.legs_s(rows)
        assert prospect is not None, "only a map tells what a tour leaves"
        model = prospect.model
        left = model.integrated_variance - model.fall(*prospect.counted_on_tour(rows, dwell_s, legs_s))
        cost_s = prospect.tour_cost_s(legs_s)
        if cost_s > 0:
            longer = model.integrated_variance - model.fall(
                *prospect.counted_on_tour(rows, dwell_s + self.cadence_s, legs_s)
            )
            left += cost_s * (left - longer) / (len(rows) * self.cadence_s)
        return left

    def dwell(self, row: int, dwell_s: float) -> StopRule:
        """Dwell rule of a stop of the tour, in whole records; ``None`` if the mission's rule decides."""
        rule = self._situation.dwell
        if not isinstance(rule, Optimal):
            return None
        records = round(max(dwell_s, self.min_dwell_s) / self.cadence_s)
        return FixedInterval(min(records * self.cadence_s, rule.longest_s), rule.longest_s)
