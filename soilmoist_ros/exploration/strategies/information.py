# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strategies that compare the value of a measurement with the time it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilmoist_ros.exploration.strategies.rules import away_from, reachable
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation

_APART_CELLS = 4


@dataclass(frozen=True)
class VarianceReduction:
    """``ivr``: the stop that lowers the integrated variance most per second of travel and dwell.

    Counts on the way are included. Without a map, the strategy chooses the middle of the field.
    """

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        prospect = situation.prospect() if situation.prospect is not None else None
        if prospect is None:
            return to_the_middle(situation)
        if not len(prospect.reachable):
            return None
        worth = prospect.promising_worth
        best = int(np.argmax(worth.value))
        number = int(prospect.reachable[prospect.promising[best]])
        stop = prospect.stops[number]
        time_s = worth.travel_s[best] + worth.dwell_s[best]
        share = worth.value[best] * time_s / max(prospect.model.integrated_variance, 1e-300)
        whose = "maps'" if worth.others else "map's"
        if number == prospect.staying:
            return Choice(stop, "counting on here is worth more than going elsewhere")
        reason = f"most variance less per second: {100 * share:.2g} % of the {whose} in {time_s:.0f} s"
        return Choice(stop, reason)


def to_the_middle(situation: Situation) -> Choice | None:
    """Candidate nearest to the middle of the field, at a new place if possible; used without a map."""
    reached = reachable(situation)
    new = reached & away_from(situation, _APART_CELLS * situation.cell_m)
    possible = np.flatnonzero(new if new.any() else reached)
    if not len(possible):
        return None
    middle = situation.map_xy.mean(axis=0)
    nearest = int(possible[np.argmin(np.hypot(*(situation.candidates_xy[possible] - middle).T))])
    return Choice(situation.candidates[nearest], "no map yet: to the middle of the field")
