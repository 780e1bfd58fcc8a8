# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time that follows the wall clock at a factor and never jumps."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from soilmoist_ros.foundation import InputError


class SimulatedTime:
    """Computes how far a simulation may advance in a step.

    On a busy machine, simulated time falls behind instead of jumping. The nodes are then as late as the
    simulation, and a jump would make their messages time out.

    :param speed: simulated seconds per second of the wall clock, > 0
    :param longest_step_s: maximum wall-clock time that one step covers [s], > 0
    """

    def __init__(self, speed: float, longest_step_s: float) -> None:
        for name, value in (("speed", speed), ("longest_step_s", longest_step_s)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be > 0 and finite, got {value}")
        self._speed = speed
        self._longest_step_s = longest_step_s
        self._wall_s = math.inf

    def step_s(self, wall_s: float) -> float:
        """Simulated time that may pass between the last call and a wall-clock time [s]; 0 at the first call."""
        passed_s = min(max(wall_s - self._wall_s, 0.0), self._longest_step_s)
        self._wall_s = wall_s
        return passed_s * self._speed


def read_start_time(text: str) -> float:
    """Seconds since 1970 UTC of an ISO 8601 text; UTC unless the text has an offset.

    :raises InputError: if the text is not an ISO 8601 time, or before 1970
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(
            f"the start time {text!r} is no ISO 8601 time", "write it like 2026-06-01T06:00:00Z"
        ) from None
    stamp_s = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    if stamp_s <= 0:
        raise InputError(f"the start time {text!r} is before 1970", "choose a later one")
    return stamp_s
