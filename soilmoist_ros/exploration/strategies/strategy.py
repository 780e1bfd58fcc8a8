# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interface of a strategy, which chooses the next stop from the situation, and rules that several share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.decision import Thresholds
from soilmoist_ros.exploration.planning.dwell import DwellRule, StopRule
from soilmoist_ros.exploration.planning.planning_model import Counting, Prospect
from soilmoist_ros.exploration.planning.properties import AimedMap
from soilmoist_ros.exploration.strategies.route import ITERATIONS, Route, open_route
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]

RECORDS_OF_10_S = Counting()


@dataclass(frozen=True, eq=False)
class Situation:
    """The data from which a strategy chooses.

    :param map_variance: kriging variance of each cell inside the polygon [(counts/s)^2], shape (g,); in a
        simulation, of cells that represent the field, if the strategy's kind has ``whole_map`` false
    :param travel_s: travel time from the robot to each candidate, stop overhead included [s], shape (k,);
        inf if unreachable
    :param travel_between_s: travel times between candidates: ``travel_between_s(indices)`` gives shape (m, m) [s]
    :param staying: index of the candidate at which the robot stands and may count on without a trip: its travel
        time is 0, and no goal is sent when it is chosen; ``None`` if there is none
    :param prospect: computes the look-ahead, which is slow; ``None`` while there is no map
    :param map_rate: rate of each cell of the map: with ``map_variance`` the posterior of each place. The model of
        the prospect has the covariances of cells that represent the field
    :param legs_s: travel times from candidate to candidate of a route: ``legs_s(indices)``, shape (m - 1,) [s];
        ``None``: from ``travel_between_s``, which takes longer
    :param goal: gives what the map must reach, over the cells of the prospect; ``None`` without an aim or a map
    """

    candidates: tuple[Stop, ...]  # stops that may be chosen, without the blacklisted ones
    candidates_xy: Array  # places of the candidates [m], shape (k, 2)
    stop_variance: Callable[[], Array]  # computes :attr:`variance`
    map_variance: Array
    map_xy: Array  # centres of all cells inside the polygon [m], shape (g, 2)
    cell_m: float  # size of the cells [m]
    position_xy: Array  # place of the robot [m], shape (2,)
    measured_xy: Array  # places measured so far [m], shape (n, 2)
    travel_s: Array
    travel_between_s: Callable[[NDArray[np.intp]], Array]
    time_left_s: float  # mission time that is left [s]
    expected_dwell_s: float  # dwell that the next measurement is expected to take [s]
    rate_cps: float = 4.0  # mean rate of the map, or the rate to expect before there is one [counts/s]
    overhead_s: float = 0.0  # time lost at each stop, a part of the travel times [s]
    counting: Counting = RECORDS_OF_10_S  # when the robot counts
    dwell: DwellRule | None = None  # dwell rule of the mission, ``None`` if unknown
    prospect: Callable[[], Prospect | None] | None = None
    staying: int | None = None
    legs_s: Callable[[NDArray[np.intp]], Array] | None = None
    map_rate: Array | None = None  # [counts/s], shape (g,); ``None`` while there is no map
    thresholds: Thresholds | None = None  # those of the decision that the map is for, if it is for one
    goal: Callable[[], AimedMap | None] | None = None

    @cached_property
    def variance(self) -> Array:
        """Kriging variance at each candidate [(counts/s)^2], shape (k,)."""
        return self.stop_variance()


@dataclass(frozen=True, slots=True)
class Choice:
    """The decision of a strategy."""

    stop: Stop  # stop to measure at next
    reason: str  # why, in a short sentence for operators and reports
    ahead: tuple[Stop, ...] = ()  # the stops planned after it, in order
    dwell: StopRule = None  # dwell rule of this stop, ``None`` for the mission's
    certifies: bool = False  # whether it is of the sealed sample of a certificate


class Strategy(Protocol):
    """Chooses stops. It may remember what it planned; all randomness comes from the generator it is given."""

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """The next stop, or ``None`` if no candidate is worth going to or can be reached."""
        ...


# Rules that the published strategies share, and their constants -------------------------------------------------

Indices = NDArray[np.intp]

UNIT = "(counts/s)²"
_ROUNDING = 1e-9  # relative difference below which two times count as equal


@dataclass(frozen=True, slots=True)
class Preset:
    """Constants of the published strategies.

    :param monte_carlo_floor: Monte Carlo draws from candidates whose kriging variance is above this multiple of
        the mean of the map
    :param drop_below_sd: Adaptive Sampling drops targets whose kriging variance is below the mean of the map
        minus this many standard deviations of the map
    :param samples_per_hour: expected rate of samples, which sets the length of the queue of Adaptive Sampling;
        ``None``: as many targets as fit into the time left, travel and dwell included
    """

    name: str  # name of the preset
    warm_up_samples: int = 3  # samples at random places before the first model
    keep_away_cells: float = 0.0  # minimum distance of new targets from measured places [cells]
    monte_carlo_floor: float = 0.0
    drop_below_sd: float = 0.0
    samples_per_hour: float | None = None


PRESETS = MappingProxyType(
    {
        "recommended": Preset("recommended"),
        "paper": Preset("paper"),
        "authors": Preset("authors", 3, 4.0, 0.9, 0.5, 5.0),
    }
)
"""``paper``: constants of the published text; ``authors``: unpublished constants of the authors' experiments.

``recommended`` equals ``paper``, because the recommended strategies use none of the constants.
"""


def reachable(situation: Situation) -> NDArray[np.bool_]:
    """Candidates that the robot can reach before the mission ends, shape (k,)."""
    return np.asarray(np.isfinite(situation.travel_s) & (situation.travel_s < situation.time_left_s))


def away_from(situation: Situation, distance_m: float) -> NDArray[np.bool_]:
    """Candidates at least this far from every measured place, shape (k,)."""
    measured = np.asarray(situation.measured_xy, float).reshape(-1, 2)
    if distance_m <= 0 or not len(measured) or not situation.candidates:
        return np.ones(len(situation.candidates), bool)
    away = np.ones(len(situation.candidates), bool)
    for start in range(0, len(measured), 100):  # in blocks, to limit memory
        squares = squared_distances(measured[start : start + 100], situation.candidates_xy)
        away &= squares.min(axis=0) >= (distance_m * (1 - 1e-9)) ** 2
    return away


def eligible(situation: Situation, preset: Preset) -> Indices:
    """Candidates for a new target: reachable in time, and far enough from measured places."""
    allowed = reachable(situation)
    allowed &= away_from(situation, preset.keep_away_cells * situation.cell_m)
    return np.flatnonzero(allowed & np.isfinite(situation.variance))


def weighted_order(weight: Array, rng: np.random.Generator) -> Indices:
    """Indices in the order of draws without replacement, each with probability in proportion to its weight.

    Those without weight come last, in random order; without any weight all are equally likely.
    """
    waiting = rng.exponential(size=len(weight))
    drawn = np.maximum(weight, 0.0)
    with np.errstate(divide="ignore"):
        keys = np.where(drawn > 0, waiting / drawn, np.inf)
    return np.lexsort([waiting, keys])


def times_mean(variance: float, situation: Situation) -> str:
    """A kriging variance in words, such as ``0.21 (counts/s)², 3.1 times the mean``."""
    mean = float(np.mean(situation.map_variance))
    text = f"{variance:.3g} {UNIT}"
    if not mean > 0:
        return text
    ratio = variance / mean
    return f"{text}, {ratio:{'.2g' if ratio < 10 else '.0f'}} times the mean"


def whole_records(time_s: Array | float, record_s: float) -> Array:
    """Times rounded up to whole records [s]: counting begins and ends with a record."""
    return np.asarray(np.ceil(np.asarray(time_s) / record_s - _ROUNDING) * record_s)


# The published strategies: three that choose one stop at a time, and Adaptive Sampling, a queue of targets -------


@dataclass(frozen=True)
class Greedy:
    """The candidate with the highest kriging variance; the first of equals."""

    preset: Preset

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        allowed = eligible(situation, self.preset)
        if not len(allowed):
            return None
        best = int(allowed[np.argmax(situation.variance[allowed])])
        variance = float(situation.variance[best])
        return Choice(situation.candidates[best], f"highest kriging variance {times_mean(variance, situation)}")


@dataclass(frozen=True)
class MonteCarlo:
    """A candidate drawn with probability in proportion to its kriging variance.

    If no candidate is above the preset's floor (possible on a travel graph, whose nodes may all be well
    known while the map between them is not), the draw is among all of them.
    """

    preset: Preset

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        allowed = eligible(situation, self.preset)
        if not len(allowed):
            return None
        floor = self.preset.monte_carlo_floor
        among = f"{len(allowed)} candidates"
        if floor > 0:
            high = allowed[situation.variance[allowed] > floor * np.mean(situation.map_variance)]
            above = f"above {floor:g} times the mean"
            among = f"{len(high)} candidates {above}" if len(high) else f"{among}, none {above}"
            allowed = high if len(high) else allowed
        drawn = int(allowed[weighted_order(situation.variance[allowed], rng)[0]])
        variance = float(situation.variance[drawn])
        return Choice(
            situation.candidates[drawn],
            f"drawn by kriging variance among {among}: {times_mean(variance, situation)}",
        )


@dataclass(frozen=True)
class Random:
    """A candidate drawn with equal probability; needs no map, so it serves for the samples before the first.

    Places measured already (within half a cell) are drawn only when there is no other.
    """

    preset: Preset

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        possible = reachable(situation) & away_from(situation, self.preset.keep_away_cells * situation.cell_m)
        new = possible & away_from(situation, 0.5 * situation.cell_m)
        allowed = np.flatnonzero(new if new.any() else possible)
        if not len(allowed):
            return None
        drawn = int(rng.choice(allowed))
        return Choice(situation.candidates[drawn], f"drawn at random among {len(allowed)} candidates")


# Adaptive Sampling: a queue of targets on the shortest route ----------------------------------------------------

MAX_STOPS = 200  # maximum number of stops of a tour; a new tour is planned long before the last one is reached
RENEWAL_ITERATIONS = 10
"""Iterations of the search for a tour that begins with the one before, which each stop improves. With 50, the way
through 60 stops was 0.3 ± 0.2 % shorter and the search took two and a half times as long."""


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
        tour = _tour(situation, kept, rng, RENEWAL_ITERATIONS)
        while len(tour.order) > 1 and tour.route.duration_s > situation.time_left_s:
            weakest = np.argmin(situation.variance[tour.order])
            tour = _tour(situation, np.delete(tour.order, weakest), rng, RENEWAL_ITERATIONS)
            fresh = fresh[:0]
        while len(fresh) and len(tour.order) < MAX_STOPS:
            added = _fitting(situation, tour, fresh)
            if not added:
                break
            more = np.concatenate([tour.order, fresh[:added]])
            longer = _tour(situation, more, rng, RENEWAL_ITERATIONS)
            if len(tour.order) and longer.route.duration_s > situation.time_left_s:
                break
            tour, fresh = longer, fresh[added:]
        return tour.order


class _Tour(NamedTuple):
    """Candidates in the order of the visits, and the route through them."""

    order: Indices
    route: Route


def _tour(situation: Situation, chosen: Indices, rng: np.random.Generator, iterations: int = ITERATIONS) -> _Tour:
    """Shortest tour of some candidates from the robot, without the unreachable ones."""
    chosen = np.asarray(chosen, np.intp)
    between = situation.travel_between_s(chosen) if len(chosen) else np.empty((0, 0))
    route = open_route(situation.travel_s[chosen], between, rng, situation.expected_dwell_s, iterations)
    if len(chosen) and not np.isfinite(route.duration_s):
        ahead = np.isfinite(route.arrival_s)
        return _tour(situation, chosen[np.array(route.order)[ahead]], rng, iterations)
    return _Tour(chosen[np.array(route.order, np.intp)], route)


def _fitting(situation: Situation, tour: _Tour, fresh: Indices) -> int:
    """Number of leading draws that can join the tour in the time left; at least one for an empty tour."""
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
