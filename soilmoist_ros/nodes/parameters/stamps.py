# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Limits of the stamps of records, which mapper and planner have in common."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.mapping import StampLimits
from soilmoist_ros.nodes.parameters.declaration import Parameter, Parameters

_DEFAULTS = StampLimits()

STAMP_LIMITS: Final = (
    Parameter(
        name="max_stamp_ahead_s",
        default=_DEFAULTS.max_ahead_s,
        description="records stamped farther in the future are skipped; 0 for no limit",
        unit="s",
        low=0,
    ),
    Parameter(
        name="max_stamp_age_s",
        default=_DEFAULTS.max_age_s,
        description="records stamped farther in the past are skipped; 0 for no limit",
        unit="s",
        low=0,
    ),
)


def stamp_limits(parameters: Parameters) -> StampLimits:
    """Limits of the stamps, from the values of :data:`STAMP_LIMITS`."""
    return StampLimits(parameters.number("max_stamp_ahead_s"), parameters.number("max_stamp_age_s"))
