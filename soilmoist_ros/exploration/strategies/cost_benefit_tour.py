# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``gcb``: tours of the whole field, each finer than the one before; the robot visits stop by stop.

A mission consists of passes. Each pass is a tour whose number of stops, dwell and places are chosen together for
its time ``stops (overhead + dwell) + driving(stops)``, and the next pass fills what it left uncertain. So the map
is good at any time, and the distance driven stays near that of a lattice. The time is an orienteering budget
(Vansteenwegen et al. 2011, European Journal of Operational Research 209:1-10): more stops cost driving and
overhead, fewer ones leave gaps; the integrated variance after the pass decides.

Stops are spread by Lloyd's algorithm on the squared posterior variance, which is proportional to the value of the
first second at a place. So stops stand close where the map is uncertain. After each stop the rest of the tour is
moved to where the variance is now, and stops are added or dropped as the time allows.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import FixedInterval, Optimal, StopRule
from soilmoist_ros.exploration.strategies.route import (
    KMeans,
    can_be_shortened,
    lloyd,
    nearest_neighbour,
    open_route,
    shortened,
    timed_route,
)
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation, reachable, whole_records
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import squared_distances

if TYPE_CHECKING:
    from scipy.spatial import KDTree


# Where a tour is designed: the stops within reach, and the uncertainty of the map between them ------------------

Indices = NDArray[np.intp]

MAX_CELLS = 400  # approximate number of cells that represent the field without a map
MAX_CANDIDATES = 500  # largest number of stops that are considered without a map
NO_MAP_DWELL_S = 20.0
"""Dwell without a map [s]; in plans for 2 h, all from 10 to 30 s leave the same variance within 2 %."""


class Ground:
    """The situation of a tour; its stops, at which the robot could still count, are numbered by rows.

    ``mass`` is the share of the stops that each cell should attract: the squared posterior variance times the
    weight of the cell, for a decision the value of the first second there; equal without a map.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self.prospect = situation.prospect() if situation.prospect is not None else None
        self.goal = None if self.prospect is None or situation.goal is None else situation.goal()
        if self.prospect is None:
            rows = np.flatnonzero(reachable(situation))
            self._index = rows[:: max(len(rows) // MAX_CANDIDATES, 1)]
            self.cells_xy = situation.map_xy[:: max(len(situation.map_xy) // MAX_CELLS, 1)]
            self.mass = np.ones(len(self.cells_xy))
            self.stops = tuple(situation.candidates[row] for row in self._index.tolist())
        else:
            model = self.prospect.model
            self.stops = self.prospect.stops
            self._index = self.prospect.of_candidates
            self.cells_xy = model.cells_xy
            if self.goal is None:
                self.mass = np.asarray(sum(each.cell_gain for each in (model, *model.others)))
            else:
                power = POWERS[self.goal.aim.kind]
                each_mass = (each.weight * each.cell_variance**power for each in (model, *model.others))
                self.mass = np.asarray(sum(each_mass))
        self.xy = situation.candidates_xy[self._index]
        self.travel_s = situation.travel_s[self._index]  # from the robot, stop overhead included [s]

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
        """True if the map says that places matter more here than there."""
        return self.prospect is not None and any(
            model.thresholds is not None for model in (self.prospect.model, *self.prospect.model.others)
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

    def needed_s(self, rows: Indices, max_s: float, share: float = 1.0, slack: float = 0.0) -> float | None:
        """Shortest dwell at each stop of a tour after which the aim is expected to be met [s].

        :param max_s: longest dwell for which there is time [s]
        :param slack: share by which the figure may miss the aim
        :param share: length of the tour as it will be driven, relative to that of these legs
        :returns: ``None`` if the tour cannot meet the aim
        """
        goal, prospect, legs_s = self.goal, self.prospect, self.legs_s(rows)
        assert goal is not None
        assert prospect is not None

        def meets(dwell_s: float) -> bool:
            counted = prospect.counted_on_tour(rows, dwell_s, share * legs_s)
            return goal.is_met_after(prospect.model.cell_fall(*counted), slack)

        low_s, high_s = self.min_dwell_s, self.fixed_dwell_s or max_s
        if high_s < low_s or not meets(high_s):
            return None
        if self.fixed_dwell_s or meets(low_s):
            return self.fixed_dwell_s or low_s
        while high_s > DWELL_STEP * low_s:
            middle_s = math.sqrt(low_s * high_s)
            low_s, high_s = (low_s, middle_s) if meets(middle_s) else (middle_s, high_s)
        return high_s

    def aimed_s(self, rows: Indices, time_s: float) -> float | None:
        """Time of a tour with the dwell that the aim needs [s]; ``None`` if it needs more than a time."""
        travel_s = float(self.legs_s(rows).sum())
        dwell_s = self.needed_s(rows, (time_s - travel_s) / len(rows))
        return None if dwell_s is None else travel_s + len(rows) * dwell_s

    def left(self, rows: Indices, dwell_s: float) -> float:
        """Integrated variance that a tour leaves, and what the operator's costs of it are worth in variance."""
        prospect, legs_s = self.prospect, self.legs_s(rows)
        assert prospect is not None, "only a map tells what a tour leaves"
        model = prospect.model
        left = model.integrated_variance - model.fall(*prospect.counted_on_tour(rows, dwell_s, legs_s))
        motion = prospect.travel.motion
        driven_m = motion.speed_mps * float(np.maximum(legs_s - motion.stop_overhead_s, 0.0).sum())
        if (cost_s := motion.metre_cost_s * driven_m) > 0:
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


# Design of a tour for a given time: how many stops, where, in which order, and how long the dwell ---------------

POWERS = {"sd": 2, "p95-sd": 4, "zone": 2}
"""Powers of the posterior variance that spread the stops: the larger, the more the stops lie where it is large."""
DWELL_STEP = 1.05  # precision of the dwell that an aim needs
FEWER = 0.8  # ratio of the numbers of stops of two tours that are compared for an aim
DWELL_RECORDS = (1, 2, 3, 4, 6, 8, 12, 16, 32, 64)  # dwells that are compared [records]
FEWER_IF_AS_GOOD = 0.03
"""The fewest stops whose integrated variance is at most this share above the least are chosen: with noisy counts
that costs nothing that could be measured, and saves driving."""
MAX_STOPS = 200
RENEWAL_ROUNDS = 2  # rounds of Lloyd's algorithm at each stop
FEW, MANY = 0.7, 1.5
"""A tour under way loses a stop if less than this share of its dwell would be left, and gets one if more."""
SHORTEST = 0.85  # length of a shortened tour, relative to that of nearest neighbours; for comparisons only
CLOSE = 0.93  # share of the time that a tour of a given dwell must fill
_NUMBER_TRIES = 8


@dataclass(frozen=True, eq=False)
class Tour:
    """A tour over stops of a ground."""

    stops: Indices  # rows in the order of the visits
    dwell_s: float  # dwell at each [s]
    time_s: float  # time of the tour [s]
    planned_s: float  # dwell for which the number of stops was chosen [s]


def design(ground: Ground, time_s: float, rng: np.random.Generator, dwell_s: float | None = None) -> Tour | None:
    """The tour that leaves the least integrated variance after a time.

    :param dwell_s: dwell from which the number of stops follows [s]; chosen if ``None``
    :returns: ``None`` if not even one stop fits
    """
    fixed_s = ground.fixed_dwell_s
    if fixed_s is not None:
        dwells_s = [fixed_s]
    elif dwell_s is not None or ground.prospect is None:
        dwells_s = [max(dwell_s or NO_MAP_DWELL_S, ground.min_dwell_s)]
    else:
        possible_s = (ground.cadence_s * records for records in DWELL_RECORDS)
        dwells_s = [one_s for one_s in possible_s if one_s >= ground.min_dwell_s] or [ground.min_dwell_s]
    clusters = KMeans(ground.cells_xy, np.random.default_rng(int(rng.integers(2**31))), ground.mass)
    found: list[tuple[float, Tour]] = []
    for one_s in dwells_s:
        tour = _of_dwell(ground, time_s, one_s, clusters)
        if tour is None:
            continue
        if found and len(tour.stops) >= len(found[-1][1].stops):
            continue
        found.append((ground.left(tour.stops, tour.dwell_s) if len(dwells_s) > 1 else 0.0, tour))
        if len(found) > 2 and found[-1][0] > found[-2][0] > found[-3][0]:
            break
    if not found:
        return None
    least = min(left for left, _ in found)
    chosen = next(tour for left, tour in reversed(found) if left <= least * (1 + FEWER_IF_AS_GOOD))
    tour = filled(ground, _ordered(ground, chosen.stops, rng), time_s, chosen.planned_s)
    return None if tour is None else _extended(ground, tour, np.empty((0, 2)))


def shortest(ground: Ground, time_s: float, rng: np.random.Generator, slack: float = 0.0) -> Tour | None:
    """The shortest tour after which the aim is expected to be met; ``None`` if none meets it in a time."""
    clusters = KMeans(ground.cells_xy, np.random.default_rng(int(rng.integers(2**31))), ground.mass)
    most = _of_dwell(ground, time_s, ground.fixed_dwell_s or ground.min_dwell_s, clusters)
    count, shortest_s, best, worse = 0 if most is None else len(most.stops), math.inf, None, 0
    while count and worse < 3:
        rows = np.unique(ground.nearest(clusters.centres(count)))
        between = ground.between_s(rows)
        rows = rows[nearest_neighbour(ground.travel_s[rows], between)]
        fixed_s = SHORTEST * float(ground.legs_s(rows).sum()) + 0.5 * ground.cadence_s * len(rows)
        dwell_s = ground.needed_s(rows, (min(time_s, shortest_s) - fixed_s) / len(rows), SHORTEST, slack)
        if dwell_s is not None:
            shortest_s, best, worse = fixed_s + len(rows) * dwell_s, (rows, dwell_s), 0
        elif best is not None:
            worse += 1
        count = min(int(FEWER * count), count - 1)
    if best is None:
        return None
    rows = _ordered(ground, best[0], rng)
    travel_s = float(ground.legs_s(rows).sum())
    max_s = (time_s - travel_s) / len(rows)
    dwell_s = ground.needed_s(rows, max_s, slack=slack)
    dwell_s = min(best[1], max_s) if dwell_s is None else dwell_s
    return Tour(rows, dwell_s, travel_s + len(rows) * dwell_s, dwell_s)


def stops_in(ground: Ground, time_s: float) -> int:
    """About how many stops with the dwell of no map fit into a time."""
    clusters = KMeans(ground.cells_xy, np.random.default_rng(0), ground.mass)
    tour = _of_dwell(ground, time_s, ground.fixed_dwell_s or NO_MAP_DWELL_S, clusters)
    return 0 if tour is None else len(tour.stops)


def _of_dwell(ground: Ground, time_s: float, dwell_s: float, clusters: KMeans) -> Tour | None:
    """Tour of about as many stops as fit with a dwell, in the order of nearest neighbours."""
    fitting, too_many = 0, min(MAX_STOPS, len(ground.stops)) + 1
    count = int(np.clip(0.5 * time_s / dwell_s, 1, too_many - 1))  # half of the time is spent at stops
    best: Tour | None = None
    for _ in range(_NUMBER_TRIES):
        rows = np.unique(ground.nearest(clusters.centres(count)))
        between = ground.between_s(rows)
        order = nearest_neighbour(ground.travel_s[rows], between)
        travel_s = timed_route(order, ground.travel_s[rows], between).travel_s
        used_s = SHORTEST * travel_s + len(rows) * (dwell_s + 0.5 * ground.cadence_s)
        if used_s <= time_s:
            fitting, best = count, Tour(rows[order], dwell_s + (time_s - used_s) / len(rows), time_s, dwell_s)
        else:
            too_many = count
        if used_s <= time_s < used_s / CLOSE or too_many - fitting <= 1:
            break
        count = int(np.clip(round(0.97 * count * time_s / used_s), fitting + 1, too_many - 1))
    return best


def _ordered(ground: Ground, rows: Indices, rng: np.random.Generator) -> Indices:
    """Stops in the order of a short tour from the robot; unreachable ones are left out."""
    start_s, between_s = ground.travel_s[rows], ground.between_s(rows)
    if can_be_shortened(start_s, between_s):
        order = nearest_neighbour(start_s, between_s)
        return rows[order[shortened(start_s[order], between_s[np.ix_(order, order)])]]
    route = open_route(start_s, between_s, rng)
    order = np.array(route.order, np.intp)[np.isfinite(route.arrival_s)]
    return rows[order]


def filled(ground: Ground, rows: Indices, time_s: float, dwell_s: float) -> Tour | None:
    """A tour over stops in their order that fills a time: stops are dropped or added until the dwell fits.

    :param dwell_s: dwell that the number of stops is for [s]
    """
    shortest_s = ground.fixed_dwell_s or max(FEW * dwell_s, ground.min_dwell_s)
    while len(rows):
        travel_s = ground.legs_s(rows).sum()
        fitting_s = (time_s - float(travel_s)) / len(rows)
        if fitting_s >= shortest_s:
            return Tour(rows, ground.fixed_dwell_s or fitting_s, time_s, dwell_s)
        drop = int(min(max(np.ceil(len(rows) * 0.5 * (1 - max(fitting_s, 0.0) / shortest_s)), 1), len(rows)))
        for _ in range(drop):
            rows = np.delete(rows, _least_useful(ground, rows))
    return None


def _least_useful(ground: Ground, rows: Indices) -> int:
    """Position of the stop whose cells need it least: dropping it adds least squared distance times mass."""
    if len(rows) == 1:
        return 0
    square = squared_distances(ground.cells_xy, ground.xy[rows])
    nearest = np.argmin(square, axis=1)
    own = square[np.arange(len(square)), nearest]
    square[np.arange(len(square)), nearest] = np.inf
    loss = np.bincount(nearest, ground.mass * (square.min(axis=1) - own), len(rows))
    return int(np.argmin(loss))


def renewed(ground: Ground, rows: Indices, done_xy: Array, time_s: float, dwell_s: float) -> Tour | None:
    """The rest of a tour under way, moved to where the variance is now, with stops added or dropped.

    :param done_xy: stops of this pass already visited, shape (d, 2) [m]; they keep the cells around them
    :param dwell_s: dwell that the tour was designed for [s]
    """
    centres = ground.xy[rows]
    for _ in range(RENEWAL_ROUNDS):
        centres = lloyd(ground.cells_xy, ground.mass, np.vstack([centres, done_xy]))[: len(rows)]
    rows = _snapped(ground, centres, done_xy)
    rows = rows[shortened(ground.travel_s[rows], ground.between_s(rows))]
    tour = filled(ground, rows, time_s, dwell_s)
    return None if tour is None else _extended(ground, tour, done_xy)


def _extended(ground: Ground, tour: Tour, done_xy: Array) -> Tour:
    """A tour with more stops, until its dwell is that for which their number was chosen."""
    while ground.fixed_dwell_s is None and tour.dwell_s > MANY * tour.planned_s:
        more = _with_another(ground, tour.stops, done_xy)
        longer = None if more is None else filled(ground, more, tour.time_s, tour.planned_s)
        if longer is None or len(longer.stops) <= len(tour.stops):
            break
        tour = longer
    return tour


def _with_another(ground: Ground, rows: Indices, done_xy: Array) -> Indices | None:
    """A tour with one more stop, where the mass is farthest from all stops; inserted where the detour is least."""
    every = np.vstack([ground.xy[rows], done_xy])
    worst = int(np.argmax(ground.mass * squared_distances(ground.cells_xy, every).min(axis=1)))
    new = int(ground.nearest(ground.cells_xy[worst : worst + 1])[0])
    if new in rows or np.any(np.all(ground.xy[new] == done_xy, axis=1)):
        return None
    between_s = ground.between_s(np.append(rows, new))
    to_s, from_s, legs_s = between_s[:-1, -1], between_s[-1, 1:-1], between_s.diagonal(1)[:-1]
    detour = np.append(to_s[:-1] + from_s - legs_s, to_s[-1])
    return np.insert(rows, int(np.argmin(detour)) + 1, new)


def _snapped(ground: Ground, centres: Array, done_xy: Array) -> Indices:
    """Rows of the stops nearest to centres, in their order, each once, without visited ones."""
    rows = ground.nearest(centres)
    visited = {(x, y) for x, y in done_xy.tolist()}
    seen: dict[int, None] = {}
    for row in rows.tolist():
        if (float(ground.xy[row, 0]), float(ground.xy[row, 1])) not in visited:
            seen.setdefault(row)
    return np.array(list(seen), np.intp)


# The passes of a mission ----------------------------------------------------------------------------------------

Array = NDArray[np.float64]

PASS_ENDS = (1 / 4, 1.0)
"""Ends of the passes as shares of the mission time. Another one at a sixteenth was no better at a quarter, and its
driving cost up to 8 % of the error at the end."""
MIN_STAGED_STOPS = 40
"""A pass is divided into finer ones if the mission time would suffice for at least this many stops in one tour.
With fewer, driving decides; a few counts tell too little of the field to choose the number of stops by the map."""
GROWTH = 2.0  # time at the end of a pass, relative to that at its begin, where the time until the aim is unsure
LONGER = 1.5  # a pass may take so much longer if it is the last one then
SLACK = 0.15  # share by which a figure may exceed the aim and still be within reach
EARLY = 0.3  # share of the time that the aim needs after which the first pass ends
REDESIGN_EVERY = 5
"""Number of stops after which a tour is compared with a new one, where places matter more here than there."""
MIN_STOPS = 3  # least number of stops of a pass that is not the last


@dataclass
class CostBenefitTour:
    """The next stop of the tour of the current pass."""

    begun_s: float | None = None  # time left at the first choice [s]
    ahead: tuple[Stop, ...] = ()  # stops of the tour that are still to come, in order
    _end_s: float = field(default=0.0, repr=False)
    _done: list[tuple[float, float]] = field(default_factory=list, repr=False)
    _dwell_s: float = field(default=0.0, repr=False)
    _passes: int = field(default=0, repr=False)  # passes begun for a time
    _aimed: bool = field(default=False, repr=False)  # whether the tour ends when the aim is met

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        left_s = situation.time_left_s
        self.begun_s = max(self.begun_s or 0.0, left_s)
        ground = Ground(situation)
        if not len(ground.stops):
            return None
        tour = self._continued(ground, left_s, rng) or self._begun(ground, left_s, rng)
        if tour is None:
            return None
        stops = [ground.stops[row] for row in tour.stops.tolist()]
        self.ahead = tuple(stops[1:])
        self._done.append((stops[0].x_m, stops[0].y_m))
        first = f"first of {len(stops)} stops" if len(stops) > 1 else "last stop"
        reason = f"{first} of a tour of {tour.time_s:.0f} s that lowers the variance most"
        return Choice(stops[0], reason, self.ahead, ground.dwell(int(tour.stops[0]), tour.dwell_s))

    def _continued(self, ground: Ground, left_s: float, rng: np.random.Generator) -> Tour | None:
        """The rest of the tour of this pass, as it is best now; ``None`` if the pass is over."""
        row = {stop.name: number for number, stop in enumerate(ground.stops)}
        rows = np.array([row[stop.name] for stop in self.ahead if stop.name in row], np.intp)
        if self._aimed and len(rows) and not len(self._done) % REDESIGN_EVERY:
            needed_s = ground.aimed_s(rows, left_s)
            if needed_s is not None:
                self._end_s = left_s - needed_s
        if not len(rows) or left_s <= self._end_s:
            return None
        tour = renewed(ground, rows, np.array(self._done), left_s - self._end_s, self._dwell_s)
        if tour is None or len(self._done) % REDESIGN_EVERY or not ground.is_uneven:
            return tour
        # Lloyd's algorithm does not carry stops from flat ground to a rough patch that was found on the way.
        other = design(ground, left_s - self._end_s, rng, self._dwell_s)
        if other is None or ground.left(other.stops, other.dwell_s) > ground.left(tour.stops, tour.dwell_s):
            return tour
        return other

    def _toward_aim(self, ground: Ground, left_s: float, few: bool, rng: np.random.Generator) -> Tour | None:
        """The tour of the next pass of a mission with an aim; ``None`` if the aim is out of reach.

        The estimated variogram, and the time until the aim is met with it, change while the map grows. So no pass
        takes much longer than all before it: whenever the aim turns out to be met, the stops are spread evenly.
        """
        assert self.begun_s is not None
        rng = deepcopy(rng)  # an aim out of reach changes no tour
        aimed = shortest(ground, left_s, rng)
        if aimed is None and (few or shortest(ground, left_s, rng, SLACK) is None):
            return None
        usual_s = (GROWTH - 1) * (self.begun_s - left_s)
        if not self._passes:
            usual_s = left_s * PASS_ENDS[0] if aimed is None else min(EARLY * aimed.time_s, left_s * PASS_ENDS[0])
        if aimed is not None and (few or (len(aimed.stops) >= MIN_STOPS and aimed.time_s <= LONGER * usual_s)):
            tour: Tour | None = aimed
        else:
            tour = design(ground, left_s if left_s <= LONGER * usual_s else usual_s, rng)
        if tour is None or (len(tour.stops) < MIN_STOPS and aimed is None):
            return None
        self._aimed = tour is aimed
        self._end_s, self._dwell_s, self._done = left_s - tour.time_s, tour.planned_s, []
        self._passes += 1
        return tour

    def _begun(self, ground: Ground, left_s: float, rng: np.random.Generator) -> Tour | None:
        """The tour of the next pass; ``None`` if no stop fits into the time left."""
        assert self.begun_s is not None
        few = stops_in(ground, self.begun_s) < MIN_STAGED_STOPS
        ends = PASS_ENDS[-1:] if few else PASS_ENDS
        if ground.goal is not None and (tour := self._toward_aim(ground, left_s, few, rng)) is not None:
            return tour
        for end in ends:
            end_s = self.begun_s * (1 - end)
            if left_s <= end_s:
                continue
            tour = design(ground, left_s - end_s, rng, NO_MAP_DWELL_S if few else None)
            if tour is not None and (len(tour.stops) >= MIN_STOPS or end == ends[-1]):
                self._end_s, self._dwell_s, self._done = end_s, tour.planned_s, []
                self._passes, self._aimed = self._passes + 1, False
                return tour
        # A dwell that no longer fits whole is better than none.
        nearest = np.array([np.argmin(ground.travel_s)], np.intp)
        dwell_s = ground.fixed_dwell_s
        return None if dwell_s is None else Tour(nearest, dwell_s, left_s, dwell_s)
