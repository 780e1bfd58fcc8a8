# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The value of a measurement: the posterior covariance, and how hypothetical counts lower it.

The kriging variance depends only on the places, the exposures and the approximate rates. So the integrated
variance ``IV = sum_g omega_g Var(g)`` after any plan is known in advance. With the posterior covariance C and the
noise N of counts, which is ``rate / t`` after t seconds, counts at places S lower IV by
``sum_g omega_g C_gS (C_SS + N)^-1 C_Sg``. The first second at x lowers it in proportion to
``A = sum_g omega_g C(g, x)^2``. Each property (:mod:`properties`) has its own model, and the reductions add up.
For a decision (:mod:`decision`), counts save expected loss instead, and omega is the derivative of the loss by
the variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.planning.decision import Thresholds
from soilmoist_ros.exploration.planning.properties import MIN_RATE_CPS
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import TravelModel
from soilmoist_ros.mapping import PoissonKriging, SoilMap

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EVEN_SHARE = 0.1
"""Share of the weight that all cells share where a decision is planned for: the posterior may be wrong."""
MAX_CELLS = 400
"""Approximate number of cells that represent the field: the variance is smooth over the variogram's range."""
MAX_STOPS = 500  # largest number of graph nodes that are compared
MAX_PLACES = 12  # largest number of places that represent a route
ENOUGH_CELLS = 0.6  # share of the wanted cells that a square lattice must have
SHARPNESS = 1.25
"""Power of the value of a second at a cell by which the cell attracts the stops of a tour for a decision: the best
density of stops follows the value more closely than the root that Lloyd's algorithm makes of it."""
_SAME_M = 1e-9
_TINY_LOSS = 1e-12
_NO_TIME_S = 1e-15
_ROUNDING = 1e-9


class PlanningModel:
    """The map's uncertainty as a planner sees it, over cells that represent the field.

    The nodes are the cells, followed by the stops that are not cells.

    :param kriging: kriging of all samples so far, or the map of them; its kriging is made when first needed
    :param cells_xy: cells over which the variance is integrated, shape (g, 2) [m]
    :param weight: omega of each cell, shape (g,): ``1/g`` for a map of the rate
    :param factor: product of the correction factors now: ``raw rate = rate / factor`` [-]
    :param others: models of further properties over the same cells and stops; their weights are scaled so that
        the integrated variances add up
    :param cell_variance: variance of the smooth rate at each cell where it is known, shape (g,) [(counts/s)^2]
    :param thresholds: those of the decision that the map is for; ``None`` if the variance itself is to fall
    """

    def __init__(
        self,
        kriging: PoissonKriging | SoilMap,
        cells_xy: Array,
        weight: Array,
        stops_xy: Array,
        factor: float = 1.0,
        others: Sequence[PlanningModel] = (),
        cell_variance: Array | None = None,
        thresholds: Thresholds | None = None,
    ) -> None:
        away, nearest = _nearest_cells(cells_xy.tobytes(), stops_xy.tobytes())
        own = away > _SAME_M
        self._map = kriging
        self._cells = len(cells_xy)
        self.stop_nodes: Indices = np.where(own, self._cells + np.cumsum(own) - 1, nearest)
        self._nodes = np.vstack([cells_xy, stops_xy[own]])
        self._weight = weight
        self.thresholds = thresholds
        self.factor = factor
        self.others = tuple(others)
        self._cell_variance = cell_variance

    @cached_property
    def weight(self) -> Array:
        """Omega of each cell, shape (g,)."""
        if self.thresholds is None:
            return self._weight
        marginal = self.thresholds.marginal(self.rate[: self._cells], self.cell_variance)
        if not marginal.mean() > _TINY_LOSS:  # no count will change the decision
            return self._weight
        return np.asarray(self._weight * (EVEN_SHARE + (1 - EVEN_SHARE) * marginal / marginal.mean()))

    @cached_property
    def _kriging(self) -> PoissonKriging:
        return self._map.kriging if isinstance(self._map, SoilMap) else self._map

    @cached_property
    def _posterior(self) -> tuple[Array, Array]:
        return self._kriging.rate_and_covariance(self._nodes)

    @cached_property
    def covariance(self) -> Array:
        """Posterior covariance of the nodes."""
        return self._posterior[1]

    @cached_property
    def rate(self) -> Array:
        """Rate expected at each node [counts/s]."""
        return np.maximum(self._posterior[0], MIN_RATE_CPS)

    @property
    def cells_xy(self) -> Array:
        """Cells over which the variance is integrated, shape (g, 2) [m]."""
        return self._nodes[: self._cells]

    @property
    def cell_variance(self) -> Array:
        """Variance of the smooth rate at each cell, shape (g,) [(counts/s)^2]."""
        if self._cell_variance is not None:
            return self._cell_variance
        return np.maximum(np.diag(self.covariance)[: self._cells], 0.0)

    def _value(self, variance: Array) -> float:
        """Weighted sum over the cells of variances, or of the expected losses that they cause."""
        if self._loss_unit > 0:
            assert self.thresholds is not None
            variance = self.thresholds.loss(self.rate[: self._cells], variance) / self._loss_unit
        return float(self._weight @ variance)

    @cached_property
    def _loss_unit(self) -> float:
        """Expected loss of the map divided by its variance: losses and variances of other properties add up.

        It is 0 without a decision, or if no count will change the decision.
        """
        if self.thresholds is None:
            return 0.0
        loss = float(self.thresholds.loss(self.rate[: self._cells], self.cell_variance).mean())
        return loss / float(self.cell_variance.mean()) if loss > _TINY_LOSS else 0.0

    @property
    def integrated_variance(self) -> float:
        """Weighted sum of the variances of the cells, or of their expected losses."""
        own = self._value(np.diag(self.covariance)[: self._cells])
        return own + sum(model.integrated_variance for model in self.others)

    @property
    def cell_gain(self) -> Array:
        """Value of the first second at each cell, by which it attracts stops, up to a factor, shape (g,)."""
        if self.thresholds is None:
            return np.asarray(self.weight * self.cell_variance**2)
        gain = self.weight @ self.covariance[: self._cells] ** 2
        return np.asarray(gain[: self._cells] ** SHARPNESS)

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self._nodes)

    def nearest_nodes(self, xy: ArrayLike) -> Indices:
        """Numbers of the nodes nearest to places of shape (..., 2)."""
        return np.asarray(self._tree.query(np.asarray(xy, float))[1], np.intp)

    def noise(self, nodes: Indices, exposure_s: Array) -> Array:
        """Variance of counts at nodes about the smooth rate [(counts/s)^2]; practically infinite for 0 s."""
        counting = self.factor * self.rate[nodes] / np.maximum(exposure_s, _NO_TIME_S)
        return np.asarray(self._map.variogram.nugget + counting)

    def cell_fall(self, nodes: Indices, exposure_s: Array) -> Array:
        """Reduction of the variance of each cell by counts at some nodes, shape (g,) [(counts/s)^2]."""
        from scipy.linalg import cholesky, solve_triangular

        noisy = self.covariance[np.ix_(nodes, nodes)] + np.diag(self.noise(nodes, exposure_s))
        solved = solve_triangular(cholesky(noisy, lower=True), self.covariance[nodes, : self._cells], lower=True)
        return np.asarray((solved**2).sum(axis=0))

    def fall(self, nodes: Indices, exposure_s: Array) -> float:
        """Reduction of the integrated variance by counts at some nodes."""
        own = self._value(self.cell_fall(nodes, exposure_s))
        return own + sum(model.fall(nodes, exposure_s) for model in self.others)


@lru_cache(maxsize=4)
def _nearest_cells(cells_xy: bytes, stops_xy: bytes) -> tuple[Array, Indices]:
    """Distance of each stop to the nearest cell, and the number of the cell; places of shape (n, 2) as bytes."""
    from scipy.spatial import KDTree

    cells, stops = (np.frombuffer(xy).reshape(-1, 2) for xy in (cells_xy, stops_xy))
    away, nearest = KDTree(cells).query(stops)
    return away, nearest


def spread_cells(mask: NDArray[np.bool_], most: int) -> NDArray[np.bool_]:
    """Evenly spaced cells that represent the field, at least one and at most about ``most``.

    Every m-th row and column, or where that leaves too few, every n-th cell of each row, shifted from row to row.
    """
    every = max(1, math.ceil(np.count_nonzero(mask) / most))
    step = math.ceil(math.sqrt(every))
    rows, columns = np.indices(mask.shape)
    chosen = np.asarray(mask & (rows % step == step // 2) & (columns % step == step // 2))
    if every == 1 or np.count_nonzero(chosen) >= ENOUGH_CELLS * most:
        return chosen
    # A shift near the golden section keeps the cells of all rows apart.
    shifts = (one for one in range(1, every) if math.gcd(one, every) == 1)
    shift = min(shifts, key=lambda one: abs(one - 0.618 * every))
    chosen = np.asarray(mask & ((rows * shift + columns) % every == every // 2))
    if not chosen.any():  # a few cells at odd places
        chosen.flat[np.flatnonzero(mask)[every // 2 :: every]] = True
    return chosen


# What a tour counts ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Counting:
    """Times when the robot counts."""

    cadence_s: float = 10.0  # duration of a record [s]
    on_way: bool = True  # whether records taken while driving are mapped too


@dataclass(eq=False)
class Prospect:
    """The stops within reach, and what a tour through them counts; arrays of shape (k,)."""

    model: PlanningModel  # posterior covariance, with all stops that are considered
    stops: tuple[Stop, ...]  # those at which the robot could still count, k
    numbers: Indices  # numbers of these among the stops of the model
    of_candidates: Indices  # numbers of these among the candidates of the situation
    travel: TravelModel  # routes and times
    position: tuple[float, float]  # where the robot is [m]
    counting: Counting  # when the robot counts
    min_dwell_s: float = 0.0  # shortest dwell [s]

    def counted_on_tour(self, rows: Indices, dwell_s: float, legs_s: Array) -> tuple[Indices, Array]:
        """Nodes at which a tour counts, and the exposure at each [s].

        On the way the robot counts at places along its route, and after each leg while it stops at the stop.
        """
        overhead_s, on_way = self.travel.motion.stop_overhead_s, self.counting.on_way
        nodes = [self.model.stop_nodes[self.numbers[rows]]]
        seconds = [np.full(len(rows), dwell_s + (overhead_s if on_way else 0.0))]
        place = self.position
        for row, leg_s in zip(rows.tolist(), legs_s.tolist(), strict=True) if on_way else ():
            stop, drive_s = self.stops[row], leg_s - overhead_s
            count = min(math.ceil(drive_s / self.counting.cadence_s - _ROUNDING), MAX_PLACES)
            if count > 0:
                shares = (np.arange(count) + 0.5) / count
                nodes.append(self.model.nearest_nodes(self.travel.along(place, (stop,), shares[None])[0]))
                seconds.append(np.full(count, drive_s / count))
            place = stop.xy
        node, which = np.unique(np.concatenate(nodes), return_inverse=True)  # counts at one place add up
        return node, np.bincount(which, np.concatenate(seconds)).astype(float)
