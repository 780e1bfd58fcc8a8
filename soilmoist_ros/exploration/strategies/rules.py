# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules that the published strategies share, and their constants."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.strategy import Situation
from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

UNIT = "(counts/s)²"
_ROUNDING = 1e-9
"""Relative difference below which two times count as equal."""


@dataclass(frozen=True, slots=True)
class Preset:
    """Constants of the published strategies.

    :param name: name of the preset
    :param warm_up_samples: samples at random places before the first model
    :param keep_away_cells: minimum distance of new targets from measured places [cells]
    :param monte_carlo_floor: Monte Carlo draws from candidates whose kriging variance is above this multiple of
        the mean of the map
    :param drop_below_sd: Adaptive Sampling drops targets whose kriging variance is below the mean of the map
        minus this many standard deviations of the map
    :param samples_per_hour: expected rate of samples, which sets the length of the queue of Adaptive Sampling;
        ``None``: as many targets as fit into the time left, travel and dwell included
    """

    name: str
    warm_up_samples: int = 3
    keep_away_cells: float = 0.0
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
