# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Design of a tour for a given time: how many stops, where, in which order, and how long the dwell.

The number of stops and the dwell share the time: ``time = stops (overhead + dwell) + driving(stops)``. The
integrated variance after the tour decides between few stops with a long dwell and many with a short one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.clusters import KMeans, lloyd
from soilmoist_ros.exploration.strategies.ground import NO_MAP_DWELL_S, Ground
from soilmoist_ros.exploration.strategies.route import (
    can_be_shortened,
    nearest_neighbour,
    open_route,
    shortened,
    timed_route,
)
from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

DWELL_RECORDS = (1, 2, 3, 4, 6, 8, 12, 16, 32, 64)
"""Dwells that are compared [records]."""
FEWER_IF_AS_GOOD = 0.03
"""The fewest stops whose integrated variance is at most this share above the least are chosen: with noisy counts
that costs nothing that could be measured, and saves driving."""
MAX_STOPS = 200
RENEWAL_ROUNDS = 2
"""Rounds of Lloyd's algorithm at each stop."""
FEW, MANY = 0.7, 1.5
"""A tour under way loses a stop if less than this share of its dwell would be left, and gets one if more."""
SHORTEST = 0.85
"""Length of a shortened tour, relative to that of nearest neighbours; for comparisons only."""
CLOSE = 0.93
"""Share of the time that a tour of a given dwell must fill."""
_NUMBER_TRIES = 8


@dataclass(frozen=True, eq=False)
class Tour:
    """A tour over stops of a ground.

    :param stops: rows in the order of the visits
    :param dwell_s: dwell at each [s]
    :param time_s: time of the tour [s]
    :param planned_s: dwell for which the number of stops was chosen [s]
    """

    stops: Indices
    dwell_s: float
    time_s: float
    planned_s: float


def design(ground: Ground, time_s: float, rng: np.random.Generator, dwell_s: float | None = None) -> Tour | None:
    """The tour that leaves the least integrated variance after a time.

    :param ground: where
    :param time_s: time of the tour [s]
    :param rng: random numbers
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
    """Stops in the order of a short tour from the robot; unreachable ones are left out.

    Each stop moves the rest of the tour and shortens it (:func:`renewed`), so no more than that is done here.
    """
    start_s, between_s = ground.travel_s[rows], ground.between_s(rows)
    if can_be_shortened(start_s, between_s):
        order = nearest_neighbour(start_s, between_s)
        return rows[order[shortened(start_s[order], between_s[np.ix_(order, order)])]]
    route = open_route(start_s, between_s, rng)
    order = np.array(route.order, np.intp)[np.isfinite(route.arrival_s)]
    return rows[order]


def filled(ground: Ground, rows: Indices, time_s: float, dwell_s: float) -> Tour | None:
    """A tour over stops in their order that fills a time: stops are dropped or added until the dwell fits.

    :param rows: stops in order
    :param time_s: time of the tour [s]
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

    :param rows: stops still to come, in order
    :param done_xy: stops of this pass already visited, shape (d, 2) [m]; they keep the cells around them
    :param time_s: time left for the pass [s]
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
    path = ground.xy[rows]
    away = np.hypot(*(path - ground.xy[new]).T)
    legs = np.hypot(*np.diff(path, axis=0).T)
    detour = np.concatenate([away[:-1] + away[1:] - legs, away[-1:]])
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
