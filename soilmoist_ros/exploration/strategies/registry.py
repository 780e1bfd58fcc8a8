"""The published strategies by name, and those of them that choose one stop at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.information import VarianceReduction
from soilmoist_ros.exploration.strategies.route import require_solver
from soilmoist_ros.exploration.strategies.rules import (
    PRESETS,
    Preset,
    away_from,
    eligible,
    reachable,
    times_mean,
    weighted_order,
)
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation, Strategy
from soilmoist_ros.exploration.strategies.tours import AdaptiveSampling, Lattice
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.suggestions import did_you_mean

__all__ = [
    "LOOKS_AHEAD",
    "NEEDS_NO_MAP",
    "PRESETS",
    "STRATEGIES",
    "Greedy",
    "MonteCarlo",
    "Preset",
    "Random",
    "make_strategy",
    "warm_up",
]

Array = NDArray[np.float64]

STRATEGIES = ("greedy", "monte_carlo", "adaptive_sampling", "random", "lattice", "ivr", "gcb")
"""Names that :func:`make_strategy` knows."""


NEEDS_NO_MAP = frozenset({"random", "lattice"})
"""Strategies that never look at the map."""
LOOKS_AHEAD = frozenset({"ivr", "gcb"})
"""Strategies that make do with the map of one stop, so that they begin with one in the middle of the field."""


def make_strategy(name: str, preset: str | Preset = "paper") -> Strategy:
    """A strategy, ready for one mission: it may remember its plan, so each mission makes its own.

    :param name: one of :data:`STRATEGIES`
    :param preset: one of :data:`PRESETS`, or constants of one's own
    :raises InputError: for an unknown name, or if the strategy plans routes and PyVRP is not installed
    """
    if isinstance(preset, str):
        if preset not in PRESETS:
            raise _unknown("preset", preset, tuple(PRESETS))
        preset = PRESETS[preset]
    if name not in STRATEGIES:
        raise _unknown("strategy", name, STRATEGIES)
    if name in ("adaptive_sampling", "lattice"):
        require_solver()
        return AdaptiveSampling(preset) if name == "adaptive_sampling" else Lattice()
    if name == "ivr":
        return VarianceReduction()
    if name == "gcb":
        from soilmoist_ros.exploration.strategies.cost_benefit_tour import CostBenefitTour

        return CostBenefitTour()
    if name == "greedy":
        return Greedy(preset)
    return MonteCarlo(preset) if name == "monte_carlo" else Random(preset)


def warm_up(name: str, preset: str) -> tuple[int, Strategy]:
    """How a mission of a strategy begins, before a map can guide it: number of stops, and who chooses them.

    :param name: one of :data:`STRATEGIES`
    :param preset: one of :data:`PRESETS`
    """
    if name in NEEDS_NO_MAP:
        return 0, make_strategy("random", preset)
    if name in LOOKS_AHEAD:
        return 1, make_strategy("ivr", preset)
    return PRESETS[preset].warm_up_samples, make_strategy("random", preset)


def _unknown(kind: str, word: str, known: tuple[str, ...]) -> InputError:
    return InputError(f"there is no {kind} {word!r}", f"use one of: {', '.join(known)}{did_you_mean(word, known)}")


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
