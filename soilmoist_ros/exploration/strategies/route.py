# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of a tour: the order of visits, an open route that starts at the robot, and stops spread over a field."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, install, is_installed, squared_distances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EXACT_UP_TO = 8  # maximum number of targets of which all orders are compared
ITERATIONS = 50  # iterations of the search for more targets; a number, not a time, to make runs repeatable


@dataclass(frozen=True, eq=False)
class Route:
    """An order of visits."""

    order: tuple[int, ...]  # indices of the targets in the order of the visits
    travel_s: float  # time on the way [s]; inf if no order avoids an impossible leg
    arrival_s: Array  # arrival at each target of the order, counted from the start [s]
    duration_s: float  # time until the last target has been served [s]


def open_route(
    from_start_s: ArrayLike,
    between_s: ArrayLike,
    rng: np.random.Generator,
    service_s: ArrayLike = 0.0,
    iterations: int = ITERATIONS,
) -> Route:
    """Shortest route that starts at the robot, visits every target and does not return.

    Exact for up to :data:`EXACT_UP_TO` targets. For more, the nearest-neighbour route or the given order, which
    may be that of an earlier tour, is :func:`shortened`, and PyVRP, if it is installed, improves it for a fixed
    number of iterations. The result is never worse than the nearest-neighbour route; equal seeds, equal routes.

    Times [s] from the robot, shape (k,), and from row to column, shape (k, k), may be inf, and need not be
    symmetric. The service time at each target changes the arrivals, but not the shortest order.
    """
    start, between = np.asarray(from_start_s, float), np.asarray(between_s, float)
    count = len(start)
    if not count:
        return Route((), 0.0, np.empty(0), 0.0)
    cost = _finite(np.vstack([start, np.where(np.eye(count, dtype=bool), 0.0, between)]))
    if count <= EXACT_UP_TO:
        orders = _orders(count)
        lengths = cost[0][orders[:, 0]] + cost[1:][orders[:, :-1], orders[:, 1:]].sum(axis=1)
        return timed_route(orders[lengths.argmin()], start, between, service_s)
    nearest = nearest_neighbour(cost[0], cost[1:])

    def length(order: Indices) -> float:
        return float(_legs(order, cost[0], cost[1:]).sum())

    first = min(nearest, np.arange(count), key=length)
    found = first = first[shortened(cost[0][first], cost[1:][np.ix_(first, first)])]
    if is_installed("pyvrp"):  # without it, a mission that has begun goes on
        found = _search(cost[0], cost[1:], first, int(rng.integers(2**31)), iterations)
    return timed_route(min(nearest, found, key=length), start, between, service_s)


def timed_route(order: Indices, from_start_s: Array, between_s: Array, service_s: ArrayLike = 0.0) -> Route:
    """A route of given order, with its times. Arguments as of :func:`open_route`."""
    legs = _legs(order, from_start_s, between_s)
    service = np.broadcast_to(np.asarray(service_s, float), from_start_s.shape)[order]
    left = np.cumsum(legs + service)
    return Route(tuple(order.tolist()), float(legs.sum()), left - service, float(left[-1]) if len(left) else 0.0)


def nearest_neighbour(from_start_s: Array, between_s: Array) -> Indices:
    """Order that always visits the nearest remaining target next; the first of equals."""
    count = len(from_start_s)
    order, visited_s = np.empty(count, np.intp), np.zeros(count)  # inf for the visited ones
    row = from_start_s
    for position in range(count):
        times_s = row + visited_s
        nearest = times_s.argmin()
        if not times_s[nearest] < np.inf:
            nearest = visited_s.argmin()
        order[position] = nearest
        visited_s[nearest] = np.inf
        row = between_s[nearest]
    return order


def can_be_shortened(from_start_s: Array, between_s: Array) -> bool:
    """True if :func:`shortened` is about as good as a search: times are finite, and symmetric."""
    finite = np.isfinite(from_start_s).all() and np.isfinite(between_s).all()
    return bool(finite and (np.abs(between_s - between_s.T) <= 1e-8 + 1e-5 * np.abs(between_s)).all())


def shortened(from_start_s: Array, between_s: Array) -> Indices:
    """The order 0, 1, 2 ... of an open route, improved until no 2-opt move and no move of one target helps.

    Croes (1958), Operations Research 6:791-812. Quick for a route that is nearly the shortest already. Times must
    be finite; otherwise the order stays. Arguments as of :func:`open_route`.
    """
    count = len(from_start_s)
    order = np.arange(count)
    # Place 0 is the robot; the last one ends the route from any target at no cost.
    times = np.zeros((count + 2, count + 2))
    times[0, 1:-1] = times[1:-1, 0] = from_start_s
    times[1:-1, 1:-1] = between_s
    if count < 2 or not np.isfinite(times).all():
        return order
    path = np.arange(count + 2)
    for _ in range(4 * count):
        d = times[np.ix_(path, path)]
        legs = d.diagonal(1)
        # reverse the targets i + 1 to j; the way back between them may be longer
        back = np.concatenate([[0.0], np.cumsum(d.diagonal(-1) - legs)])
        turn = np.triu(d[:-1, :-1] + d[1:, 1:] - legs[:, None] - legs + back[:-1] - back[1:, None], 2)
        # move target i + 1 between j and j + 1
        freed = d.diagonal(2) - legs[:-1] - legs[1:]
        move = freed[:, None] + d[:-1, 1:-1].T + d[1:-1, 1:] - legs
        rows = np.arange(count)
        move[rows, rows] = move[rows, rows + 1] = 0.0
        if min(turn.min(), move.min()) > -1e-6:
            break
        if turn.min() <= move.min():
            i, j = np.unravel_index(np.argmin(turn), turn.shape)
            path[i + 1 : j + 1] = path[i + 1 : j + 1][::-1].copy()
        else:
            i, j = np.unravel_index(np.argmin(move), move.shape)
            target = path[i + 1]
            without = np.delete(path, i + 1)
            path = np.insert(without, j + 1 if j < i + 1 else j, target)
    return path[1:-1] - 1


def require_solver() -> None:
    """Check that PyVRP is there, before a mission starts that needs it.

    :raises InputError: if not
    """
    if not is_installed("pyvrp"):
        raise InputError("planning a route of many stops needs PyVRP, which is not installed", install("campaign"))


def _legs(order: Indices, from_start_s: Array, between_s: Array) -> Array:
    return np.concatenate([from_start_s[order[:1]], between_s[order[:-1], order[1:]]])


def _finite(times: Array) -> Array:
    """Times with a price in place of inf: one impossible leg costs more than every possible route."""
    possible = np.isfinite(times)
    price = (times[possible].max(initial=0.0) + 1.0) * (times.shape[1] + 1)
    return np.where(possible, times, price)


@cache
def _orders(count: int) -> Indices:
    return np.array(list(permutations(range(count))), np.intp)


def _search(start: Array, between: Array, first: Indices, seed: int, iterations: int) -> Indices:
    """Route by PyVRP's iterated local search: one vehicle, and a way home that costs nothing."""
    import pyvrp
    from pyvrp.stop import MaxIterations

    size = len(start) + 1
    scale = 1e7 / max(float(start.max()), float(between.max()), 1e-9)
    times: Any = np.zeros((size, size), np.int64)
    times[0, 1:] = np.rint(start * scale)
    times[1:, 1:] = np.rint(between * scale)
    np.fill_diagonal(times, 0)
    data = pyvrp.ProblemData(
        [pyvrp.Location(0, 0) for _ in range(size)],
        [pyvrp.Client(location=number) for number in range(1, size)],
        [pyvrp.Depot(location=0)],
        [pyvrp.VehicleType()],
        [times],
        [times * 0],
    )
    begin = pyvrp.Solution(data, [[int(index) for index in first]])
    result = pyvrp.solve(data, MaxIterations(iterations), seed, False, False, initial_solution=begin)
    route = result.best.routes()[0]
    return np.array([activity.idx for activity in route if activity.is_client()], np.intp)


# Stops spread over a field: k-means of its cells, each with a mass that attracts stops --------------------------

NO_CENTRES: Array = np.empty((0, 2))
LLOYD_ROUNDS = 50  # maximum number of rounds of the k-means
_STILL_M, _STILL = 1e-9, 1e-5
"""Moves, absolute and relative to the coordinate, at which the rounds end."""
_SURE_M = 1e-6  # a place has its nearest centre for certain if the next one is farther by more than this
_FEW_PAIRS = 50_000  # number of pairs of places and centres up to which all distances are faster than a tree


class KMeans:
    """Centres of clusters of places; Lloyd's algorithm with a k-means++ start.

    :param mass: weight of each place, shape (g,), >= 0; equal ones if ``None`` or all are 0
    :param fixed: further centres, shape (f, 2) [m], which stay; the others fill the gaps between them
    """

    def __init__(
        self, xy: Array, rng: np.random.Generator, mass: Array | None = None, fixed: Array = NO_CENTRES
    ) -> None:
        has_mass = mass is not None and bool(mass.any())
        self._xy, self._rng, self._fixed = xy, rng, fixed
        self._mass = mass if mass is not None and has_mass else np.ones(len(xy))
        if len(fixed):
            self._start: list[int] = []
            self._square = squared_distances(xy, fixed).min(axis=1)
            return
        first = _drawn(self._mass, rng) if has_mass else int(rng.integers(len(xy)))
        self._start = [first]
        self._square = squared_distances(xy, xy[[first]])[:, 0]

    def centres(self, count: int) -> Array:
        """Centres, shape (count, 2) [m]; any number begins with the same start."""
        while len(self._start) < count and (share := self._mass * self._square).any():
            self._start.append(_drawn(share, self._rng))
            self._square = np.minimum(self._square, squared_distances(self._xy, self._xy[self._start[-1:]])[:, 0])
        centres = np.vstack([self._fixed, self._xy[self._start[:count]]])
        owner, lead_m = np.zeros(len(self._xy), np.intp), np.zeros(len(self._xy))
        for _ in range(LLOYD_ROUNDS):
            # Centres that moved less than the lead of the nearest one leave it the nearest (Hamerly 2010).
            open_ = np.flatnonzero(lead_m <= _SURE_M)
            owner[open_], lead_m[open_] = _nearest(self._xy[open_], centres)
            moved = _middles(self._xy, self._mass, owner, centres)
            moved[: len(self._fixed)] = self._fixed
            if (np.abs(moved - centres) <= _STILL_M + _STILL * np.abs(centres)).all():
                break
            away_m = np.hypot(*(moved - centres).T)
            lead_m -= away_m[owner] + away_m.max()
            centres = moved
        return centres[len(self._fixed) :]


def _drawn(weight: Array, rng: np.random.Generator) -> int:
    """An index drawn in proportion to its weight; that of ``rng.choice``, which checks more."""
    total = np.cumsum(weight / weight.sum())
    return int(np.searchsorted(total / total[-1], rng.random(), side="right"))


def lloyd(xy: Array, mass: Array, centres: Array) -> Array:
    """Centres, shape (k, 2) [m], moved to the middle of the mass that is nearest to them."""
    return _middles(xy, mass, squared_distances(xy, centres).argmin(axis=1), centres)


def _nearest(xy: Array, centres: Array) -> tuple[Indices, Array]:
    """Number of the centre nearest to each place, the first of equals, and its lead over the next one [m]."""
    count = len(centres)
    if count > 1 and len(xy) * count > _FEW_PAIRS:
        from scipy.spatial import KDTree

        away_m, numbers = KDTree(centres).query(xy, 2)
        owner, lead_m = np.asarray(numbers[:, 0], np.intp), np.asarray(away_m[:, 1] - away_m[:, 0])
        equal = np.flatnonzero(lead_m <= _SURE_M)
        owner[equal] = squared_distances(xy[equal], centres).argmin(axis=1)
        return owner, lead_m
    square = squared_distances(xy, centres)
    owner, places = square.argmin(axis=1), np.arange(len(xy))
    nearest_m = np.sqrt(square[places, owner])
    square[places, owner] = np.inf
    return owner, np.sqrt(square.min(axis=1)) - nearest_m


def _middles(xy: Array, mass: Array, owner: Indices, centres: Array) -> Array:
    """Middle of the mass of each centre's places; a centre without mass stays."""
    total = np.bincount(owner, mass, len(centres))
    sums = np.column_stack([np.bincount(owner, mass * axis, len(centres)) for axis in xy.T])
    return np.where(total[:, None] > 0, sums / np.where(total > 0, total, 1.0)[:, None], centres)
