# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interface of a strategy, which chooses the next stop from the situation, and rules that several share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import DwellRule, StopRule
from soilmoist_ros.exploration.planning.prospect import Counting, Prospect
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]

RECORDS_OF_10_S = Counting()


@dataclass(frozen=True, eq=False)
class Situation:
    """The data from which a strategy chooses.

    :param map_variance: kriging variance of each cell inside the polygon [(counts/s)^2], shape (g,); in a
        simulation, of those that represent the field, if the strategy's kind has ``whole_map`` false
    :param travel_s: travel time from the robot to each candidate, stop overhead included [s], shape (k,);
        inf if unreachable
    :param travel_between_s: travel times between candidates: ``travel_between_s(indices)`` gives shape (m, m) [s]
    :param travel_cost_s: ``travel_s`` with the costs that an operator adds for a stop and a metre, for comparisons
        of trips [s], shape (k,); the clock runs by ``travel_s``. ``None``: the same
    :param staying: index of the candidate at which the robot stands and may count on without a trip: its travel
        time is 0, and no goal is sent when it is chosen; ``None`` if there is none
    :param prospect: computes the look-ahead, which is slow; ``None`` while there is no map
    :param legs_s: travel times from candidate to candidate of a route: ``legs_s(indices)``, shape (m - 1,) [s];
        those of ``travel_between_s`` if ``None``, which takes longer
    """

    candidates: tuple[Stop, ...]  # stops that may be chosen, without the blacklisted ones
    candidates_xy: Array  # their places [m], shape (k, 2)
    stop_variance: Callable[[], Array]  # computes :attr:`variance`
    map_variance: Array
    map_xy: Array  # centres of all cells inside the polygon [m], shape (g, 2)
    cell_m: float  # size of the cells [m]
    position_xy: Array  # where the robot is [m], shape (2,)
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
    travel_cost_s: Array | None = None
    staying: int | None = None
    legs_s: Callable[[NDArray[np.intp]], Array] | None = None

    @cached_property
    def variance(self) -> Array:
        """Kriging variance at each candidate [(counts/s)^2], shape (k,)."""
        return self.stop_variance()


@dataclass(frozen=True, slots=True)
class Choice:
    """The decision of a strategy."""

    stop: Stop  # where to measure next
    reason: str  # why, in a short sentence for operators and reports
    ahead: tuple[Stop, ...] = ()  # the stops planned after it, in order
    dwell: StopRule = None  # dwell rule of this stop, ``None`` for the mission's


class Strategy(Protocol):
    """Chooses stops. It may remember what it planned; all randomness comes from the generator it is given."""

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """The next stop, or ``None`` if no candidate is worth going to or can be reached."""
        ...


# Rules that the published strategies share, and their constants -------------------------------------------------

Indices = NDArray[np.intp]

UNIT = "(counts/s)²"
_ROUNDING = 1e-9
"""Relative difference below which two times count as equal."""


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
