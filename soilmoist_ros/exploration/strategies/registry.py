# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strategies by name: built-in ones, and ones from other packages."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from soilmoist_ros.exploration.strategies.cost_benefit_tour import CostBenefitTour
from soilmoist_ros.exploration.strategies.lattice import Lattice
from soilmoist_ros.exploration.strategies.route import require_solver
from soilmoist_ros.exploration.strategies.strategy import (
    PRESETS,
    AdaptiveSampling,
    Greedy,
    MonteCarlo,
    Preset,
    Random,
    Strategy,
)
from soilmoist_ros.foundation import InputError, Registry, did_you_mean


@dataclass(frozen=True)
class StrategyKind:
    """A strategy that can be chosen by name."""

    make: Callable[[Preset], Strategy]  # makes the strategy of one mission, from the constants of a preset
    label: str = ""  # name for reports
    about: str = ""  # what it does, for people in the field
    needs_map: bool = True  # whether it cannot choose without a map once the warm-up is over
    whole_map: bool = True
    """True if it looks at the variance of every cell. Otherwise cells that represent the field to the look-ahead
    suffice, and a simulation maps the others at its end only."""
    decides: bool = True  # whether it plans for a decision where the mission has thresholds
    warm_up_stops: int | None = None  # stops before the map guides it; ``None`` for as many as the preset has
    warm_up: Callable[[Preset], Strategy] = Random  # makes the strategy that chooses these
    is_baseline: bool = False  # whether others are compared with it: reports show its maps last


def _with_solver(strategy: Callable[[Preset], Strategy]) -> Callable[[Preset], Strategy]:
    def made(preset: Preset) -> Strategy:
        require_solver()
        return strategy(preset)

    return made


BUILT_IN = {
    "greedy": StrategyKind(
        Greedy, "Greedy", "Goes where the map is most uncertain, however far that is.", decides=False,
    ),
    "monte_carlo": StrategyKind(
        MonteCarlo, "Monte Carlo", "Draws a place; uncertain ones come more often.", decides=False,
    ),
    "adaptive_sampling": StrategyKind(
        _with_solver(AdaptiveSampling), "Adaptive sampling", "Drives tours through the most uncertain places.",
        decides=False,
    ),
    "random": StrategyKind(
        Random, "Random", "Goes to any place; for comparisons.", needs_map=False, whole_map=False,
        warm_up_stops=0, is_baseline=True, decides=False,
    ),
    "lattice": StrategyKind(
        _with_solver(lambda _: Lattice()), "Lattice", "Evenly spread stops, planned once for the whole time.",
        needs_map=False, whole_map=False, warm_up_stops=0, is_baseline=True, decides=False,
    ),
    "two_pass": StrategyKind(
        _with_solver(lambda _: Lattice((0.25, 1.0))), "Two lattices",
        "Evenly spread stops, coarse in the first quarter of the time, then between them.",
        needs_map=False, whole_map=False, warm_up_stops=0, is_baseline=True, decides=False,
    ),
    # It makes do with the map of one stop.
    "gcb": StrategyKind(
        lambda _: CostBenefitTour(), "Cost-benefit tour",
        "Plans a tour for all the time left, and again after each stop.",
        whole_map=False, warm_up_stops=1, warm_up=lambda _: CostBenefitTour(),
    ),
}  # fmt: skip


def _checked(plug_in: Any) -> StrategyKind:
    """A strategy of another package; raises TypeError if it is neither a :class:`StrategyKind` nor a strategy."""
    if isinstance(plug_in, str):
        raise TypeError("a strategy must be a StrategyKind, or a class or object with a method choose")
    return strategy_kind(plug_in)


STRATEGIES: Registry[StrategyKind] = Registry("soilmoist_ros.strategies", "strategy", BUILT_IN, _checked)
"""Strategies by name; another package adds one with an entry point ``soilmoist_ros.strategies``."""


def strategy_kind(given: str | StrategyKind | Strategy | type[Strategy]) -> StrategyKind:
    """A strategy with its traits.

    :param given: a name, a kind, a class without arguments, or an object; each mission gets a copy of an object
    :raises InputError: for an unknown name
    :raises TypeError: if it is none of them
    """
    if isinstance(given, StrategyKind):
        return given
    if isinstance(given, str):
        return STRATEGIES.get(given)
    if not callable(getattr(given, "choose", None)):
        raise TypeError(f"a strategy needs a method choose, {given!r} has none")
    if isinstance(given, type):
        return StrategyKind(lambda preset: given(), given.__name__)
    return StrategyKind(lambda preset: deepcopy(given), type(given).__name__)


def make_strategy(
    given: str | StrategyKind | Strategy | type[Strategy], preset: str | Preset = "paper"
) -> Strategy:
    """A strategy, ready for one mission: it may remember its plan, so each mission makes its own.

    :param given: one of :data:`STRATEGIES`, or as :func:`strategy_kind` takes it
    :param preset: one of :data:`PRESETS`, or constants of one's own
    :raises InputError: for an unknown name, or if the strategy plans routes and PyVRP is not installed

    >>> make_strategy("gcb")
    CostBenefitTour(begun_s=None, ahead=())
    """
    made = strategy_kind(given).make(_preset(preset))
    if not callable(getattr(made, "choose", None)):
        what = f"make must return an object with a method choose; it returned {type(made).__name__}"
        raise InputError(f"strategy {given!r}: {what}", "correct the plug-in")
    return made


def warm_up(
    given: str | StrategyKind | Strategy | type[Strategy], preset: str | Preset = "paper"
) -> tuple[int, Strategy]:
    """Begin of a mission of a strategy, before a map can guide it: number of stops, and who chooses them.

    Parameters as of :func:`make_strategy`.
    """
    kind, constants = strategy_kind(given), _preset(preset)
    stops = constants.warm_up_samples if kind.warm_up_stops is None else kind.warm_up_stops
    return stops, kind.warm_up(constants)


def _preset(preset: str | Preset) -> Preset:
    if isinstance(preset, Preset):
        return preset
    if preset not in PRESETS:
        raise InputError(
            f"there is no preset {preset!r}",
            f"use one of: {', '.join(PRESETS)}{did_you_mean(preset, tuple(PRESETS))}",
        )
    return PRESETS[preset]
