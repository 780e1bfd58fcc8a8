# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Static lattices: evenly spread stops, planned for the whole budget at once, or in two passes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import FixedInterval, Optimal
from soilmoist_ros.exploration.strategies.route import KMeans, nearest_neighbour, open_route
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation, reachable, whole_records
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.mapping import PoissonKriging, Prior, Variogram, correlation_model

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_STOPS = 500  # maximum number of stops of a lattice
MAX_CELLS = 5000  # approximate number of cells for the k-means; larger fields use every n-th cell
MAX_WEIGHED_CELLS = 400  # approximate number of cells over which the variance of a planned lattice is integrated
FEWER = 0.85  # ratio of the numbers of stops of two lattices that are compared
MIN_STOPS = 4  # smallest lattice that is compared
SHORTEST = 0.8  # length of a shortest tour, relative to a nearest-neighbour tour; for comparisons only
GUESSED_MODEL = "matern32"  # variogram model before there is a map
MIN_STAGED_STOPS = 40  # number of stops of one lattice below which two passes are not worth the driving
NONE_DONE: Array = np.empty((0, 2))
_ROUNDING = 1e-9


@dataclass
class Lattice:
    """The static baseline: evenly spread stops, planned once for the budget and visited in the shortest order.

    The stops are the centres of a k-means of the field's cells, each moved to the nearest candidate.

    With the dwell rule ``optimal``, number of stops and dwell are chosen together. Lattices of different numbers
    are compared, each with the time that its tour leaves for counting divided equally among its stops. The one
    with the lowest integrated variance is taken. The variogram is the guess from which fits start
    (:class:`Prior`): a coefficient of variation of 15 %, a practical range of a third of the extent. At each stop,
    the time really left is divided anew, in whole records. So the mission ends with its budget used and its tour
    complete.

    With every other rule, the number of stops is the highest that fits into the budget at the expected dwell.

    ``two_pass`` has several ``ends``: a coarse lattice gives an early map of the whole field, and the stops of the
    next one lie between those visited, so that all together are a lattice again.
    """

    ends: tuple[float, ...] = (1.0,)  # ends of the passes, as shares of the mission time
    plan: tuple[Stop, ...] = ()  # stops of the pass that are still to come
    size: int = 0  # number of stops of the pass

    def __post_init__(self) -> None:
        self._begun_s, self._pass, self._done = 0.0, -1, list[tuple[float, float]]()

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        if self._pass < 0:
            self._begun_s = situation.time_left_s
            if len(self.ends) > 1:  # with few stops, driving decides: one lattice is better
                self._plan(situation, rng)
                if self.size < MIN_STAGED_STOPS:
                    self.ends, self._pass = self.ends[-1:], 0
        planned = isinstance(situation.dwell, Optimal)
        number = {stop.name: n for n, stop in enumerate(situation.candidates)}
        while True:
            left_s = situation.time_left_s - self._begun_s * (1 - self.ends[max(self._pass, 0)])
            of_pass = replace(situation, time_left_s=max(left_s, 0.0))
            possible = reachable(of_pass)
            ahead = [stop for stop in self.plan if stop.name in number and possible[number[stop.name]]]
            if self._pass >= 0 and ahead:
                break
            if self._pass + 1 == len(self.ends):
                return None
            self._pass += 1
            left_s = situation.time_left_s - self._begun_s * (1 - self.ends[self._pass])
            self._plan(replace(situation, time_left_s=max(left_s, 0.0)), rng)
        done = self.size - len(self.plan) + self.plan.index(ahead[0])
        self.plan = self.plan[self.plan.index(ahead[0]) + 1 :]
        self._done.append(ahead[0].xy)
        dwell = _share(of_pass, np.array([number[stop.name] for stop in ahead]), done) if planned else None
        reason = f"place {done + 1} of {self.size} of the static lattice"
        if len(self.ends) > 1:
            reason = f"place {done + 1} of {self.size} of lattice {self._pass + 1} of {len(self.ends)}"
        return Choice(ahead[0], reason, self.plan, dwell)

    def _plan(self, situation: Situation, rng: np.random.Generator) -> None:
        """Plan a lattice for the time left, with stops between those visited."""
        planned = plan_lattice if isinstance(situation.dwell, Optimal) else fit_lattice
        self.plan = planned(situation, rng, np.array(self._done).reshape(-1, 2))
        self.size = len(self.plan)


def _share(situation: Situation, order: Indices, done: int) -> FixedInterval:
    """Dwell of the next stop: its share of the time that the rest of the tour leaves for counting."""
    record_s = situation.counting.cadence_s
    share = max(situation.time_left_s - _travel_s(situation, order), 0.0) / record_s / len(order)
    # Each stop has one record at least: a tour that is late ends before its last stop.
    records = math.floor(share * (done + 1) + _ROUNDING) - math.floor(share * done + _ROUNDING)
    if len(order) == 1:
        records = math.floor(share + _ROUNDING)
    dwell_s = max(records, 1) * record_s
    return FixedInterval(dwell_s, 2 * dwell_s)


def fit_lattice(situation: Situation, rng: np.random.Generator, done_xy: Array = NONE_DONE) -> tuple[Stop, ...]:
    """Tour of the largest lattice that fits into the time left at the expected dwell, in whole records."""
    lattices = _Lattices(situation, rng, done_xy)
    dwell_s = float(whole_records(situation.expected_dwell_s, situation.counting.cadence_s))
    best, size = lattices.nearest, min(len(lattices.nearest), 1)
    low, high = 1, lattices.most(dwell_s)
    while low <= high:
        count = (low + high) // 2
        order, fits = lattices.fitting_tour(lattices.chosen(count), dwell_s)
        if not fits:
            high = count - 1
            continue
        low = count + 1
        if len(order) >= size:
            best, size = order, len(order)
    return tuple(situation.candidates[int(index)] for index in best)


def plan_lattice(situation: Situation, rng: np.random.Generator, done_xy: Array = NONE_DONE) -> tuple[Stop, ...]:
    """Tour of the lattice with the lowest integrated variance after an equal division of the counting time."""
    lattices = _Lattices(situation, rng, done_xy)
    record_s = situation.counting.cadence_s
    count, best, least = lattices.most(record_s), lattices.nearest, math.inf
    while count >= MIN_STOPS or not math.isfinite(least):
        chosen = lattices.chosen(count)
        variance = lattices.variance_after(chosen)
        if variance > least:
            break  # it falls and then rises with the number of stops
        if variance < least:
            best, least = chosen, variance
        if count <= 1:
            break
        count = min(int(FEWER * count), count - 1)
    # The comparison estimates the length of the tour, so the shortest tour decides whether it fits.
    while True:
        order, fits = lattices.fitting_tour(best, record_s)
        if fits or len(best) <= 1:
            break
        best = lattices.chosen(min(int(0.95 * len(best)), len(best) - 1))
    return tuple(situation.candidates[int(index)] for index in order)


class _Lattices:
    """Lattices of any number of stops in one situation.

    :param done_xy: stops visited in earlier passes, shape (d, 2) [m]; the lattices fill the gaps between them
    """

    def __init__(self, situation: Situation, rng: np.random.Generator, done_xy: Array) -> None:
        self.situation = situation
        self._done_xy = done_xy
        self._possible = np.flatnonzero(reachable(situation))
        self._cells = situation.map_xy[:: max(len(situation.map_xy) // MAX_CELLS, 1)]
        self._weighed = situation.map_xy[:: max(len(situation.map_xy) // MAX_WEIGHED_CELLS, 1)]
        self._seeds = rng.integers(2**31, size=2) if len(self._possible) else np.zeros(2, int)
        self._clusters = KMeans(self._cells, np.random.default_rng(self._seeds[0]), fixed=done_xy)

    @property
    def nearest(self) -> Indices:
        """The reachable candidate nearest to the robot; empty if there is none."""
        travel_s = self.situation.travel_s[self._possible]
        return self._possible[[np.argmin(travel_s)]] if len(travel_s) else self._possible

    def most(self, dwell_s: float) -> int:
        """Upper limit of the number of stops at this dwell."""
        situation = self.situation
        each_s = dwell_s + float(whole_records(situation.overhead_s, situation.counting.cadence_s))
        return int(min(situation.time_left_s // each_s + 1, MAX_STOPS, len(self._possible)))

    def chosen(self, count: int) -> Indices:
        """Candidates of the lattice of a number of stops; fewer if two centres have the same nearest candidate."""
        if not len(self._possible):
            return self._possible
        return _snapped(self._clusters.centres(count), self.situation, self._possible)

    def fitting_tour(self, chosen: Indices, dwell_s: float) -> tuple[Indices, bool]:
        """The shortest tour of some candidates, and whether it fits into the time left at this dwell."""
        situation = self.situation
        if least_tour_s(situation, chosen, dwell_s) > situation.time_left_s * (1 + _ROUNDING):
            return chosen, False
        start, between = situation.travel_s[chosen], situation.travel_between_s(chosen)
        route = open_route(start, between, np.random.default_rng(self._seeds[1]))
        order = chosen[np.array(route.order, np.intp)[np.isfinite(route.arrival_s)]]
        if len(order) < len(chosen):
            return self.fitting_tour(order, dwell_s)
        used_s = _travel_s(situation, order) + len(order) * dwell_s
        return order, used_s <= situation.time_left_s * (1 + _ROUNDING)

    def variance_after(self, chosen: Indices) -> float:
        """Mean variance of the cells after a tour of equal dwells; inf without time for a record at each stop."""
        situation, counting = self.situation, self.situation.counting
        if not len(chosen):
            return math.inf
        start, between = situation.travel_s[chosen], situation.travel_between_s(chosen)
        order = nearest_neighbour(start, between)
        legs_s = np.concatenate([start[order[:1]], between[order[:-1], order[1:]]])
        if not np.isfinite(legs_s).all():
            return math.inf
        drive_s = np.maximum(legs_s - situation.overhead_s, 0.0) * SHORTEST
        stand_s = whole_records(drive_s + situation.overhead_s, counting.cadence_s) - drive_s
        dwell_s = (situation.time_left_s - (drive_s + stand_s).sum()) / len(chosen)
        if dwell_s < counting.cadence_s:
            return math.inf
        xy = situation.candidates_xy[chosen[order]]
        exposure_s = np.full(len(xy), dwell_s)
        if counting.on_way:
            moved = drive_s > 0
            middle = (xy + np.vstack([situation.position_xy, xy[:-1]])) / 2
            xy = np.vstack([xy, middle[moved]])
            exposure_s = np.concatenate([exposure_s + stand_s, drive_s[moved]])
        if len(self._done_xy):  # all samples of a lattice count about as long
            xy = np.vstack([xy, self._done_xy])
            exposure_s = np.append(exposure_s, np.full(len(self._done_xy), dwell_s))
        rate = situation.rate_cps
        kriging = PoissonKriging(self._guess, mean_rate=rate).fit(xy, np.rint(rate * exposure_s), exposure_s)
        return float(kriging.predict(self._weighed)[1].mean())

    @property
    def _guess(self) -> Variogram:
        """Variogram before there is a map."""
        extent_m = float(np.ptp(self.situation.map_xy, axis=0).max()) + self.situation.cell_m
        structured = (Prior.GUESSED_VARIATION * self.situation.rate_cps) ** 2
        nugget = Prior.GUESSED_NUGGET * structured
        range_m = extent_m / Prior.RANGES_PER_EXTENT / correlation_model(GUESSED_MODEL).practical
        return Variogram(GUESSED_MODEL, nugget, range_m, structured + nugget)


def least_tour_s(situation: Situation, chosen: Indices, dwell_s: float) -> float:
    """Lower bound of the time of a tour, dwells included: the shortest leg to each candidate [s].

    Unreachable candidates are left out of a tour, so they take no time.
    """
    start, between = situation.travel_s[chosen], situation.travel_between_s(chosen)
    arriving = np.vstack([start, between + np.diag(np.full(len(chosen), np.inf))]).min(axis=0)
    arriving = whole_records(arriving[np.isfinite(arriving)], situation.counting.cadence_s)
    return float(arriving.sum() + len(arriving) * dwell_s)


def _travel_s(situation: Situation, order: Indices) -> float:
    """Time between the dwells of a tour in this order, each leg in whole records [s]."""
    between = situation.travel_between_s(order)
    legs_s = np.concatenate([situation.travel_s[order[:1]], between.diagonal(1)])
    return float(whole_records(legs_s, situation.counting.cadence_s).sum())


def _snapped(centres: Array, situation: Situation, possible: Indices) -> Indices:
    """Reachable candidates nearest to the centres, without duplicates."""
    from scipy.spatial import KDTree

    _, nearest = KDTree(situation.candidates_xy[possible]).query(centres)
    return np.unique(possible[nearest])
