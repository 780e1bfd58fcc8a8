"""Strategies that plan a tour of several stops: Adaptive Sampling, and the static lattice."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.route import Route, nearest_neighbour, open_route, timed_route
from soilmoist_ros.exploration.strategies.rules import (
    UNIT,
    Preset,
    eligible,
    reachable,
    times_mean,
    weighted_order,
)
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation
from soilmoist_ros.exploration.travel.stop import Stop

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_STOPS = 200
"""Maximum number of stops of a tour; a new tour is planned long before the last one is reached."""
MAX_CELLS = 5000
"""Approximate number of cells for the k-means; larger fields use every n-th cell."""
LLOYD_ROUNDS = 50
"""Maximum number of rounds of the k-means."""
_ROUNDING = 1e-9
"""Relative difference below which two times count as equal."""


@dataclass
class AdaptiveSampling:
    """A queue of targets that is thinned, refilled and sorted at every choice.

    Targets with a kriging variance below the threshold are dropped. New targets are drawn with a probability
    proportional to their kriging variance. The order is the shortest route from the robot. ``samples_per_hour``
    times the time left is the length of the queue. Without ``samples_per_hour``, targets are added as long as
    the tour fits into the time left. The queue contains at least one target, if a candidate is available.
    """

    preset: Preset
    queue: tuple[Stop, ...] = ()

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        kept, dropped, threshold = self._kept(situation)
        fresh = np.setdiff1d(eligible(situation, self.preset), kept)
        fresh = fresh[weighted_order(situation.variance[fresh], rng)]
        if self.preset.samples_per_hour is None:
            order = self._as_time_allows(situation, kept, fresh, rng)
        else:
            size = max(int(self.preset.samples_per_hour * situation.time_left_s / 3600), 1)
            order = self._as_expected(situation, kept, fresh, min(size, MAX_STOPS), rng)
        if not len(order):
            self.queue = ()
            return None
        first, *rest = (situation.candidates[int(index)] for index in order)
        self.queue = tuple(rest)
        variance = float(situation.variance[order[0]])
        reason = f"first of {len(order)} targets on the shortest route" if rest else "the only target planned"
        reason += ": kriging variance "
        reason += times_mean(variance, situation)
        if dropped:
            reason += f"; {dropped} below {threshold:.3g} {UNIT} dropped"
        return Choice(first, reason, self.queue)

    def _kept(self, situation: Situation) -> tuple[Indices, int, float]:
        """Candidates that stay in the queue, the number of dropped ones, and the threshold."""
        map_variance = situation.map_variance
        threshold = float(np.mean(map_variance) - self.preset.drop_below_sd * np.std(map_variance))
        number = {stop.name: index for index, stop in enumerate(situation.candidates)}
        possible = reachable(situation)
        queued = [number[stop.name] for stop in self.queue if stop.name in number]
        alive = np.array([index for index in queued if possible[index]], np.intp)
        high = situation.variance[alive] >= threshold
        return alive[high], int(len(alive) - high.sum()), threshold

    @staticmethod
    def _as_expected(
        situation: Situation, kept: Indices, fresh: Indices, size: int, rng: np.random.Generator
    ) -> Indices:
        """Tour of a given number of targets; queued targets of highest variance come before new ones."""
        strongest = kept[np.argsort(-situation.variance[kept], kind="stable")]
        chosen = np.concatenate([strongest[:size], fresh[: max(size - len(kept), 0)]])
        return _tour(situation, chosen, rng).order

    @staticmethod
    def _as_time_allows(situation: Situation, kept: Indices, fresh: Indices, rng: np.random.Generator) -> Indices:
        """Tour of as many targets as fit into the time left."""
        tour = _tour(situation, kept, rng)
        while len(tour.order) > 1 and tour.route.duration_s > situation.time_left_s:
            weakest = np.argmin(situation.variance[tour.order])
            tour = _tour(situation, np.delete(tour.order, weakest), rng)
            fresh = fresh[:0]
        while len(fresh) and len(tour.order) < MAX_STOPS:
            added = _fitting(situation, tour, fresh)
            if not added:
                break
            longer = _tour(situation, np.concatenate([tour.order, fresh[:added]]), rng)
            if len(tour.order) and longer.route.duration_s > situation.time_left_s:
                break
            tour, fresh = longer, fresh[added:]
        return tour.order


class _Tour(NamedTuple):
    """Candidates in the order of the visits, and the route through them."""

    order: Indices
    route: Route


def _tour(situation: Situation, chosen: Indices, rng: np.random.Generator) -> _Tour:
    """Shortest tour of some candidates from the robot, without the unreachable ones."""
    chosen = np.asarray(chosen, np.intp)
    between = situation.travel_between_s(chosen) if len(chosen) else np.empty((0, 0))
    route = open_route(situation.travel_s[chosen], between, rng, situation.expected_dwell_s)
    if len(chosen) and not np.isfinite(route.duration_s):
        ahead = np.isfinite(route.arrival_s)
        return _tour(situation, chosen[np.array(route.order)[ahead]], rng)
    return _Tour(chosen[np.array(route.order, np.intp)], route)


def _fitting(situation: Situation, tour: _Tour, fresh: Indices) -> int:
    """Number of leading draws that can join the tour in the time left; at least one for an empty tour.

    Each draw is inserted where it lengthens the tour least, which gives an upper bound of the shortest tour.
    """
    dwell = situation.expected_dwell_s
    most = int(min(MAX_STOPS - len(tour.order), situation.time_left_s // max(dwell, 1.0) + 1, len(fresh)))
    every = np.concatenate([tour.order, fresh[:most]])
    between = situation.travel_between_s(every)
    start = situation.travel_s[every]
    path = list(range(len(tour.order)))
    used = tour.route.duration_s
    for count, new in enumerate(range(len(tour.order), len(every))):
        before = np.concatenate([[start[new]], between[path, new]])
        after = np.concatenate([between[new, path], [0.0]])
        legs = np.array([*start[path[:1]], *between[path[:-1], path[1:]], 0.0])
        detour = before + after - legs
        position = int(np.argmin(detour))
        used += float(detour[position]) + dwell
        if used > situation.time_left_s and path:
            return count
        path.insert(position, new)
    return most


@dataclass
class Lattice:
    """The static baseline: evenly spread places, planned once and visited in the shortest order.

    The places are the centres of a k-means of the field's cells, each moved to the nearest candidate. Their
    number is the highest that fits into the mission's time at the dwell expected at its start. The strategy
    ignores the map and finishes just in time. In the shipped campaign ``paper`` (main dwell rule ``ami:0.03``) its
    error is the highest of all strategies at a quarter and at half of the time, and the lowest at the end. So
    it is hard to beat where the whole time is certain, and poor where a mission may end early.
    """

    plan: tuple[Stop, ...] | None = field(default=None)
    size: int = 0

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        if self.plan is None:
            self.plan = _lattice(situation, rng)
            self.size = len(self.plan)
        possible = reachable(situation)
        names = {stop.name for stop, ok in zip(situation.candidates, possible.tolist(), strict=True) if ok}
        ahead = [stop for stop in self.plan if stop.name in names]
        if not ahead:
            return None
        done = self.size - len(self.plan) + self.plan.index(ahead[0])
        self.plan = self.plan[self.plan.index(ahead[0]) + 1 :]
        return Choice(ahead[0], f"place {done + 1} of {self.size} of the static lattice", self.plan)


def _lattice(situation: Situation, rng: np.random.Generator) -> tuple[Stop, ...]:
    """Tour of the largest lattice that fits into the time left."""
    possible = np.flatnonzero(reachable(situation))
    if not len(possible):
        return ()
    cells = situation.map_xy[:: max(len(situation.map_xy) // MAX_CELLS, 1)]
    most = int(min(situation.time_left_s // max(situation.expected_dwell_s, 1.0) + 1, MAX_STOPS, len(possible)))
    seeds = rng.integers(2**31, size=2)
    best, size = possible[[np.argmin(situation.travel_s[possible])]], 1
    low, high = 1, most
    while low <= high:
        count = (low + high) // 2
        centres = k_means(cells, count, np.random.default_rng(seeds[0]))
        chosen = _snapped(centres, situation, possible)
        visited, fits = len(chosen), _surely_fits(situation, chosen)
        if fits is None:
            tour = _tour(situation, chosen, np.random.default_rng(seeds[1]))
            visited, fits = len(tour.order), tour.route.duration_s <= situation.time_left_s
        if not fits:
            high = count - 1
            continue
        low = count + 1
        if visited >= size:
            best, size = chosen, visited
    order = _tour(situation, best, np.random.default_rng(seeds[1])).order
    return tuple(situation.candidates[int(index)] for index in order)


def _surely_fits(situation: Situation, chosen: Indices) -> bool | None:
    """Whether the shortest tour of some candidates fits into the time left, ``None`` if the bounds do not decide.

    The nearest-neighbour tour is the upper bound. The sum of the shortest legs to each candidate is the lower one.
    """
    start, between = situation.travel_s[chosen], situation.travel_between_s(chosen)
    if not (np.isfinite(start).all() and np.isfinite(between).all()):
        return None
    left_s = situation.time_left_s - len(chosen) * situation.expected_dwell_s
    order = nearest_neighbour(start, between)
    if timed_route(order, start, between).travel_s < left_s * (1 - _ROUNDING):
        return True
    arriving = np.vstack([start, between + np.diag(np.full(len(chosen), np.inf))])
    return False if arriving.min(axis=0).sum() > left_s * (1 + _ROUNDING) else None


def _snapped(centres: Array, situation: Situation, possible: Indices) -> Indices:
    """Reachable candidates nearest to the centres, without duplicates."""
    from scipy.spatial import KDTree

    _, nearest = KDTree(situation.candidates_xy[possible]).query(centres)
    return np.unique(possible[nearest])


def k_means(xy: Array, count: int, rng: np.random.Generator) -> Array:
    """Centres of clusters of places, shape (count, 2) [m]; Lloyd's algorithm with a k-means++ start.

    :param xy: places, shape (g, 2) [m]
    :param count: number of clusters, >= 1; limited to the number of different places
    :param rng: random numbers for the start
    """
    from scipy.spatial import KDTree

    centres = xy[[int(rng.integers(len(xy)))]]
    square = ((xy - centres[0]) ** 2).sum(axis=1)
    while len(centres) < count and square.any():
        centre = xy[int(rng.choice(len(xy), p=square / square.sum()))]
        centres = np.vstack([centres, centre])
        square = np.minimum(square, ((xy - centre) ** 2).sum(axis=1))
    for _ in range(LLOYD_ROUNDS):
        _, owner = KDTree(centres).query(xy)
        members = np.bincount(owner, minlength=len(centres))
        sums = np.column_stack([np.bincount(owner, xy[:, axis], minlength=len(centres)) for axis in (0, 1)])
        moved = np.where(members[:, None] > 0, sums / np.maximum(members, 1)[:, None], centres)
        if np.allclose(moved, centres, atol=1e-9):
            break
        centres = moved
    return np.asarray(centres)
