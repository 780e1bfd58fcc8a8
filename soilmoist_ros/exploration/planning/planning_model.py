# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The value of a measurement: the posterior covariance, and how hypothetical counts lower it.

The kriging variance depends only on the places, the exposures and the approximate rates. So the integrated
variance ``IV = sum_g omega_g Var(g)`` after any plan is known in advance. With the posterior covariance C and a
sample of t seconds at x, whose noise is ``rate / t``::

    IV falls by  A t / (B t + rate),    A = sum_g omega_g C(g, x)^2,    B = C(x, x) + nugget

Joint counts at several places S lower IV by ``sum_g omega_g C_gS (C_SS + N)^-1 C_Sg``. Each property
(:mod:`properties`) has its own model, and the reductions add up. For a decision (:mod:`decision`), joint counts
save expected loss instead, and omega is the derivative of the loss by the variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.planning.decision import Thresholds
from soilmoist_ros.exploration.planning.properties import MIN_RATE_CPS
from soilmoist_ros.mapping import PoissonKriging, SoilMap

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EVEN_SHARE = 0.1
"""Share of the weight that all cells share where a decision is planned for: the posterior may be wrong."""
ENOUGH_CELLS = 0.6  # share of the wanted cells that a square lattice must have
SHARPNESS = 1.25
"""Power of the value of a second at a cell by which the cell attracts the stops of a tour for a decision: the best
density of stops follows the value more closely than the root that Lloyd's algorithm makes of it."""
_SAME_M = 1e-9
_TINY_LOSS = 1e-12
_NO_TIME_S = 1e-15
_HALVINGS = 50


class Trips(NamedTuple):
    """Trips to candidates; arrays of one value per candidate."""

    stops: Indices  # numbers of the candidates
    ways: Indices  # nodes on the way to each, shape (k, m)
    exposure_s: Array  # exposure at each of these nodes, shape (k, m) [s]; 0 where a route has fewer nodes
    overhead_s: Array  # time of the trip in which the robot already stands at the stop and counts [s]
    longest_s: Array  # longest dwell possible at each [s]
    cost_s: Array  # what each trip costs in the comparison [s]
    min_dwell_s: float = 0.0  # shortest dwell [s]


class Worth(NamedTuple):
    """Value of a trip and a dwell, for each of k candidates; the first four for each of p properties, too."""

    on_way: Array  # reduction of the integrated variance by the counts on the way, shape (p, k)
    gain: Array  # A of the stop after the trip, shape (p, k)
    variance: Array  # B of the stop after the trip, shape (p, k) [(counts/s)^2]
    noise: Array  # n of the stop: rate expected there times the correction factor, shape (p, k)
    dwell_s: Array  # dwell with the highest value [s], the shortest one if counting on the way is worth more
    value: Array
    """Reduction of the integrated variance per second of dwell and trip, an operator's costs of it included."""


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

    @cached_property
    def gain(self) -> Array:
        """A of each node: the diagonal of :meth:`gram`."""
        return np.asarray(self.weight @ self.covariance[: self._cells] ** 2)

    @property
    def cell_gain(self) -> Array:
        """Value of the first second at each cell, by which it attracts stops, up to a factor, shape (g,)."""
        if self.thresholds is None:
            return np.asarray(self.weight * self.cell_variance**2)
        return np.asarray(self.gain[: self._cells] ** SHARPNESS)

    def gram(self, nodes: Indices) -> Array:
        """``sum_g omega_g C(g, a) C(g, b)`` of every two of some nodes."""
        to_cells = self.covariance[: self._cells, nodes] * np.sqrt(self.weight)[:, None]
        return np.asarray(to_cells.T @ to_cells)  # half of the work of a product of two different matrices

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

    def worth(self, trips: Trips) -> Worth:
        """Value of each trip and of counting at its end."""
        node = self.stop_nodes[trips.stops]
        nodes = np.column_stack([trips.ways, node])
        seconds = np.column_stack([trips.exposure_s, trips.overhead_s])
        each = [model._at_stops(node, nodes, seconds) for model in (self, *self.others)]
        on_way, gain, variance, noise = (np.array(values) for values in zip(*each, strict=True))
        dwell_s, value = best_dwell(
            on_way, gain, variance, noise, trips.cost_s, trips.longest_s, trips.min_dwell_s
        )
        return Worth(on_way, gain, variance, noise, dwell_s, value)

    def _at_stops(self, node: Indices, nodes: Indices, seconds: Array) -> tuple[Array, Array, Array, Array]:
        """Reduction by the counts on the way to each stop, and A, B and noise n of the stop after these counts."""
        noise = self.factor * self.rate[node]
        if seconds.any():
            on_way, gain, left = self._after_ways(node, nodes, seconds)
        else:
            on_way, gain = np.zeros(len(node)), self.gain[node]
            left = self.covariance[node, node]
        # A place that is known for certain (no variance, no gain) must not cause a division by zero.
        variance = np.maximum(np.maximum(left, 0.0) + self._map.variogram.nugget, 1e-12 * self.rate[node])
        return on_way, gain, variance, noise

    def _after_ways(self, node: Indices, nodes: Indices, seconds: Array) -> tuple[Array, Array, Array]:
        """Reduction by the counts on the way to each stop; then A and the variance without nugget of the stop."""
        noisy = self.covariance[nodes[:, :, None], nodes[:, None, :]]
        places = np.arange(nodes.shape[1])
        noisy[:, places, places] += self.noise(nodes, seconds)
        used, which = np.unique(nodes, return_inverse=True)
        which = which.reshape(nodes.shape)
        gram = self.gram(used)[which[:, :, None], which[:, None, :]]
        across = self.covariance[nodes, node[:, None]]
        # D = tr(M^-1 G_SS). With v = M^-1 C_Sx, the covariance of cell and stop becomes C_gx - C_gS v.
        solved = np.linalg.solve(noisy, np.concatenate([gram, across[:, :, None]], axis=2))
        on_way = np.trace(solved[:, :, :-1], axis1=1, axis2=2)
        v = solved[:, :, -1]
        gain = gram[:, -1, -1] - 2 * (v * gram[:, :, -1]).sum(axis=1)
        gain = np.maximum(gain + np.einsum("ki,kij,kj->k", v, gram, v), 0.0)
        return on_way, gain, self.covariance[node, node] - (across * v).sum(axis=1)


@lru_cache(maxsize=4)
def _nearest_cells(cells_xy: bytes, stops_xy: bytes) -> tuple[Array, Indices]:
    """Distance of each stop to the nearest cell, and the number of the cell; places of shape (n, 2) as bytes."""
    from scipy.spatial import KDTree

    cells, stops = (np.frombuffer(xy).reshape(-1, 2) for xy in (cells_xy, stops_xy))
    away, nearest = KDTree(cells).query(stops)
    return away, nearest


def best_dwell(
    on_way: Array,
    gain: Array,
    variance: Array,
    rate: Array,
    travel_s: Array,
    longest_s: Array,
    min_dwell_s: float = 0.0,
) -> tuple[Array, Array]:
    """Dwell of the highest value per second of a trip (marginal value theorem, Charnov 1976) [s], and the value.

    The arguments are D, counted on the way, A, B, n, T, and the longest and shortest dwell; the first four have
    the shape (k,), or (p, k) for p properties.

    With D counted on the way, ``(D + A t/(B t + n)) / (T + t)`` is largest where
    ``(D B^2 + A B) t^2 + 2 D B n t + D n^2 - A n T = 0``; for D = 0 this is ``t = sqrt(n T / B)``. The best
    dwell for several properties lies between their separate best dwells.
    """
    square = on_way * variance**2 + gain * variance
    half = on_way * variance * rate
    constant = on_way * rate**2 - gain * rate * travel_s
    root = np.sqrt(np.maximum(half**2 - square * constant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        dwell_s = np.where((constant < 0) & (square > 0), (root - half) / square, 0.0)
    if dwell_s.ndim > 1:
        dwell_s = _best_of_all(on_way, gain, variance, rate, travel_s, dwell_s)
    dwell_s = np.minimum(np.maximum(dwell_s, min_dwell_s), np.maximum(longest_s, 0.0))
    fall = on_way + gain * dwell_s / (variance * dwell_s + rate)
    if fall.ndim > 1:
        fall = fall.sum(axis=0)
    time_s = travel_s + dwell_s
    return dwell_s, np.divide(fall, time_s, out=np.zeros_like(fall), where=time_s > 0)


def _best_of_all(
    on_way: Array, gain: Array, variance: Array, rate: Array, travel_s: Array, each_s: Array
) -> Array:
    """Dwell with the highest value per second of a trip for all properties together, shape (k,) [s].

    There ``sum_p [A n (T + t)/(B t + n)^2 - A t/(B t + n) - D]`` is zero. Each term falls with t and is zero at
    the best dwell of its property. So the root lies between the best dwells; bisection finds it.
    """
    low, high = each_s.min(axis=0), each_s.max(axis=0)
    for _ in range(_HALVINGS if (low < high).any() else 0):
        middle = (low + high) / 2
        total = variance * middle + rate
        rising = (gain * (rate * (travel_s + middle) / total - middle) / total - on_way).sum(axis=0) > 0
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return np.asarray((low + high) / 2)


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
