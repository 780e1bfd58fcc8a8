# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names of strategies and dwell rules for readers."""

from __future__ import annotations

from soilmoist_ros.exploration import DWELL_RULES, STRATEGIES, StrategyKind
from soilmoist_ros.foundation import InputError


def strategy_text(strategy: str) -> str:
    """Name of a strategy for readers."""
    kind = strategy_traits(strategy)
    return kind.label if kind is not None and kind.label else strategy.replace("_", " ")


def strategy_traits(strategy: str) -> StrategyKind | None:
    """Traits of a strategy; ``None`` if the package that added it is not installed."""
    try:
        return STRATEGIES.get(strategy)
    except InputError:
        return None


def dwell_text(dwell: str) -> str:
    """Name of a dwell rule for readers: FMI with its seconds, AMI with its standard error in percent."""
    name, _, value = dwell.partition(":")
    try:
        return DWELL_RULES.get(name).describe(value)
    except InputError:
        return dwell.capitalize()
