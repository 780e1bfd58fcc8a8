# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The published strategies that choose one stop at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.rules import (
    Preset,
    away_from,
    eligible,
    reachable,
    times_mean,
    weighted_order,
)
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation

Array = NDArray[np.float64]


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
