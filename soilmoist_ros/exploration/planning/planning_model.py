"""What counting somewhere would be worth: the posterior covariance, and how hypothetical counts lower it.

The kriging variance does not depend on the data, only on where was counted, for how long, and at about which
rate. So the integrated variance ``IV = sum_g omega_g Var(g)`` after any plan is known beforehand. With the
posterior covariance C and a sample of t seconds at x, whose noise is ``rate / t``::

    IV falls by  A t / (B t + rate),    A = sum_g omega_g C(g, x)^2,    B = C(x, x) + nugget

and joint counts at several places S lower it by ``sum_g omega_g C_gS (C_SS + N)^-1 C_Sg``. Where several
properties are counted at once (:mod:`properties`), each has its model, and the falls
add up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MIN_RATE_CPS = 1e-3
"""Lower limit of predicted rates [counts/s]: kriging may undershoot."""
_SAME_M = 1e-9
_NO_TIME_S = 1e-15
_HALVINGS = 50


@dataclass(frozen=True, eq=False)
class Worth:
    """What a trip and a dwell are worth; arrays of one value per candidate.

    :param on_way: fall of the integrated variance by what is counted on the way
    :param gain: A of the stop after that
    :param variance: B of the stop after that [(counts/s)^2]
    :param rate: rate expected at the stop [counts/s]
    :param travel_s: time of the trip, stop overhead included [s]
    :param dwell_s: dwell with the highest value [s], 0 if counting on the way is worth more
    :param value: fall of the integrated variance per second of trip and dwell, at that dwell
    :param others: A, B and noise n of each further property; the fall and the value are those of all together
    """

    on_way: Array
    gain: Array
    variance: Array
    rate: Array
    travel_s: Array
    dwell_s: Array
    value: Array
    others: tuple[tuple[Array, Array, Array], ...] = ()


class PlanningModel:
    """The map's uncertainty as a planner sees it, over cells that stand for the field.

    Its nodes are the cells, then those stops that are no cells.

    :param kriging: kriging of all samples so far
    :param cells_xy: cells over which the variance is integrated, shape (g, 2) [m]
    :param weight: omega of each cell, shape (g,): ``1/g`` for a map of the rate
    :param stops_xy: candidates, shape (k, 2) [m]
    :param factor: product of the correction factors now: ``raw rate = rate / factor`` [-]
    :param others: models of further properties over the same cells and stops, their weights such that the
        integrated variances add up
    """

    def __init__(
        self,
        kriging: PoissonKriging,
        cells_xy: Array,
        weight: Array,
        stops_xy: Array,
        factor: float = 1.0,
        others: Sequence[PlanningModel] = (),
    ) -> None:
        away, nearest = _nearest_cells(cells_xy.tobytes(), stops_xy.tobytes())
        own = away > _SAME_M
        self._cells = len(cells_xy)
        self.stop_nodes: Indices = np.where(own, self._cells + np.cumsum(own) - 1, nearest)
        self._nodes = np.vstack([cells_xy, stops_xy[own]])
        self.weight = weight
        self.covariance = kriging.covariance(self._nodes)
        self.nugget = kriging.variogram.nugget
        self.factor = factor
        self.others = tuple(others)
        self.rate = np.maximum(kriging.predict(self._nodes)[0], MIN_RATE_CPS)

    @property
    def integrated_variance(self) -> float:
        """Weighted sum of the variances of the cells."""
        own = float(self.weight @ np.diag(self.covariance)[: self._cells])
        return own + sum(model.integrated_variance for model in self.others)

    @cached_property
    def gain(self) -> Array:
        """A of each node: the diagonal of :attr:`gram`."""
        return np.asarray(self.weight @ self.covariance[: self._cells] ** 2)

    @cached_property
    def gram(self) -> Array:
        """``sum_g omega_g C(g, a) C(g, b)`` of every two nodes."""
        return self.gram_of(slice(None))

    def gram_of(self, nodes: Indices | slice) -> Array:
        """Rows of :attr:`gram` for some nodes, which take less time than all; shape (s, m)."""
        to_cells = self.covariance[: self._cells]
        return np.asarray((to_cells[:, nodes].T * self.weight) @ to_cells)

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self._nodes)

    def nearest_nodes(self, xy: ArrayLike) -> Indices:
        """Numbers of the nodes nearest to places of shape (..., 2)."""
        return np.asarray(self._tree.query(np.asarray(xy, float))[1], np.intp)

    def noise(self, nodes: Indices, exposure_s: Array) -> Array:
        """Variance of counts at nodes about the smooth rate there [(counts/s)^2]; as good as infinite for 0 s."""
        counting = self.factor * self.rate[nodes] / np.maximum(exposure_s, _NO_TIME_S)
        return np.asarray(self.nugget + counting)

    def fall(self, nodes: Indices, exposure_s: Array) -> float:
        """How much counts at some nodes lower the integrated variance.

        :param nodes: numbers of the nodes, a node may occur twice
        :param exposure_s: exposure at each [s]
        """
        noisy = self.covariance[np.ix_(nodes, nodes)] + np.diag(self.noise(nodes, exposure_s))
        own = float(np.trace(np.linalg.solve(noisy, self.gram[np.ix_(nodes, nodes)])))
        return own + sum(model.fall(nodes, exposure_s) for model in self.others)

    def worth(
        self,
        stops: Indices,
        travel_s: Array,
        ways: Indices,
        exposure_s: Array,
        overhead_s: float,
        longest_s: Array,
    ) -> Worth:
        """What going to each of some candidates and counting there is worth.

        :param stops: numbers of the candidates, shape (k,)
        :param travel_s: times of the trips, stop overhead included, shape (k,) [s]
        :param ways: nodes on the way to each, shape (k, m)
        :param exposure_s: exposure at each of them, shape (k, m) [s]; 0 where a way has fewer nodes
        :param overhead_s: time of the trip in which the robot already stands at the stop and counts [s]
        :param longest_s: longest dwell possible at each, shape (k,) [s]
        """
        node = self.stop_nodes[stops]
        nodes = np.column_stack([ways, node])
        seconds = np.column_stack([exposure_s, np.full(len(node), overhead_s)])
        each = [model._at_stops(node, nodes, seconds) for model in (self, *self.others)]
        on_way, gain, variance, noise = (np.array(values) for values in zip(*each, strict=True))
        dwell_s, value = best_dwell(on_way, gain, variance, noise, travel_s, longest_s)
        return Worth(
            on_way.sum(axis=0),
            gain[0],
            variance[0],
            self.rate[node],
            travel_s,
            dwell_s,
            value,
            tuple(zip(gain[1:], variance[1:], noise[1:], strict=True)),
        )

    def _at_stops(self, node: Indices, nodes: Indices, seconds: Array) -> tuple[Array, Array, Array, Array]:
        """For stops after counts on the way to each: the fall by these, and then A, B and noise n of the stop.

        :param node: nodes of the stops, shape (k,)
        :param nodes: nodes at which is counted before, the stop's own last, shape (k, m)
        :param seconds: exposure at each of these, shape (k, m) [s]
        """
        noise = self.factor * self.rate[node]
        if seconds.any():
            on_way, gain, left = self._after_ways(node, nodes, seconds)
        else:
            on_way, gain = np.zeros(len(node)), self.gain[node]
            left = self.covariance[node, node]
        # A place that is known for certain (no variance, no gain) must not divide by nothing.
        variance = np.maximum(np.maximum(left, 0.0) + self.nugget, 1e-12 * self.rate[node])
        return on_way, gain, variance, noise

    def _after_ways(self, node: Indices, nodes: Indices, seconds: Array) -> tuple[Array, Array, Array]:
        """The fall by counts on the way to each stop, and then A and the variance without nugget of the stop.

        Parameters as of :meth:`_at_stops`.
        """
        noisy = self.covariance[nodes[:, :, None], nodes[:, None, :]]
        places = np.arange(nodes.shape[1])
        noisy[:, places, places] += self.noise(nodes, seconds)
        gram = self.gram[nodes[:, :, None], nodes[:, None, :]]
        across = self.covariance[nodes, node[:, None]]
        # D = tr(M^-1 G_SS), and with v = M^-1 C_Sx what is left at the stop: C_gx - C_gS v for each cell.
        solved = np.linalg.solve(noisy, np.concatenate([gram, across[:, :, None]], axis=2))
        on_way = np.trace(solved[:, :, :-1], axis1=1, axis2=2)
        v = solved[:, :, -1]
        gain = self.gram[node, node] - 2 * (v * self.gram[nodes, node[:, None]]).sum(axis=1)
        gain = np.maximum(gain + np.einsum("ki,kij,kj->k", v, gram, v), 0.0)
        return on_way, gain, self.covariance[node, node] - (across * v).sum(axis=1)


@lru_cache(maxsize=4)
def _nearest_cells(cells_xy: bytes, stops_xy: bytes) -> tuple[Array, Indices]:
    """Distance to the nearest cell of each stop, and its number; places of shape (n, 2) by their bytes.

    Kept, because most plans of a mission, and of a campaign, have the same stops.
    """
    from scipy.spatial import KDTree

    cells, stops = (np.frombuffer(xy).reshape(-1, 2) for xy in (cells_xy, stops_xy))
    away, nearest = KDTree(cells).query(stops)
    return away, nearest


def best_dwell(
    on_way: Array, gain: Array, variance: Array, rate: Array, travel_s: Array, longest_s: Array
) -> tuple[Array, Array]:
    """The dwell that makes the most of the time of a trip (marginal value theorem, Charnov 1976), and its value.

    With D counted on the way, ``(D + A t/(B t + n)) / (T + t)`` is largest where
    ``(D B^2 + A B) t^2 + 2 D B n t + D n^2 - A n T = 0``; for D = 0 that is ``t = sqrt(n T / B)``. The sum over
    several properties is largest at a time between the best of each.

    :param on_way: D, fall of the integrated variance on the way; as A, B and n of shape (k,), or (p, k) for p
        properties
    :param gain: A
    :param variance: B [(counts/s)^2], > 0
    :param rate: n, rate times correction factor [counts/s], > 0
    :param travel_s: T [s]
    :param longest_s: longest dwell possible [s]
    :returns: dwell [s], and fall of the integrated variance per second
    """
    square = on_way * variance**2 + gain * variance
    half = on_way * variance * rate
    constant = on_way * rate**2 - gain * rate * travel_s
    root = np.sqrt(np.maximum(half**2 - square * constant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        dwell_s = np.where((constant < 0) & (square > 0), (root - half) / square, 0.0)
    if dwell_s.ndim > 1:
        dwell_s = _best_of_all(on_way, gain, variance, rate, travel_s, dwell_s)
    dwell_s = np.clip(dwell_s, 0.0, np.maximum(longest_s, 0.0))
    fall = on_way + gain * dwell_s / (variance * dwell_s + rate)
    if fall.ndim > 1:
        fall = fall.sum(axis=0)
    time_s = travel_s + dwell_s
    return dwell_s, np.divide(fall, time_s, out=np.zeros_like(fall), where=time_s > 0)


def _best_of_all(
    on_way: Array, gain: Array, variance: Array, rate: Array, travel_s: Array, each_s: Array
) -> Array:
    """The dwell that makes the most of the time of a trip for several properties together, shape (k,) [s].

    It is where ``sum_p [A n (T + t)/(B t + n)^2 - A t/(B t + n) - D]`` passes zero. Each term falls with t and is
    zero at the best dwell of its property, so the root lies between these; it is found by bisection.

    The other arguments are those of :func:`best_dwell`.

    :param each_s: best dwell of each property alone, shape (p, k) [s]
    """
    low, high = each_s.min(axis=0), each_s.max(axis=0)
    for _ in range(_HALVINGS if (low < high).any() else 0):
        middle = (low + high) / 2
        total = variance * middle + rate
        rising = (gain * (rate * (travel_s + middle) / total - middle) / total - on_way).sum(axis=0) > 0
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return np.asarray((low + high) / 2)


def spread_cells(mask: NDArray[np.bool_], most: int) -> NDArray[np.bool_]:
    """Evenly spaced cells that stand for all: every m-th row and column, so that about ``most`` remain.

    :param mask: cells of the field, shape (ny, nx)
    :param most: about the largest number of cells
    :returns: those chosen, shape (ny, nx); at least one
    """
    step = max(1, math.ceil(math.sqrt(np.count_nonzero(mask) / most)))
    rows, columns = np.indices(mask.shape)
    chosen = mask & (rows % step == step // 2) & (columns % step == step // 2)
    return chosen if chosen.any() else mask
