"""Simulated time that follows the wall clock, faster, but never in leaps."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from soilmoist_ros.foundation.errors import InputError


class SimulatedTime:
    """Tells how far a simulation may advance.

    When the machine is too busy, simulated time falls behind instead of leaping: the programs that take part
    are as late as the simulation is, and must not find themselves minutes later between two messages.

    :param speed: simulated seconds per second of the wall clock, > 0
    :param longest_step_s: the most of the wall clock's time that one step makes up for [s], > 0
    """

    def __init__(self, speed: float, longest_step_s: float) -> None:
        for name, value in (("speed", speed), ("longest_step_s", longest_step_s)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be > 0 and finite, got {value}")
        self.now_s = 0.0
        self._speed = speed
        self._longest_step_s = longest_step_s
        self._wall_s = math.inf

    def advance(self, wall_s: float) -> float:
        """Go on until a time of the wall clock [s], and give the simulated time [s].

        It begins with the first call.
        """
        passed_s = min(max(wall_s - self._wall_s, 0.0), self._longest_step_s)
        self.now_s += passed_s * self._speed
        self._wall_s = wall_s
        return self.now_s


def read_start_time(text: str) -> float:
    """Time in seconds since 1970 UTC of an ISO 8601 text, UTC unless it says otherwise.

    :raises InputError: if it is none, or before 1970
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"the start time {text!r} is no time", "write it like 2026-06-01T06:00:00Z") from None
    stamp_s = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    if stamp_s <= 0:
        raise InputError(f"the start time {text!r} lies before 1970", "choose a later one")
    return stamp_s
