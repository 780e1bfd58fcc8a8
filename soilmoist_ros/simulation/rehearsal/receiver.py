# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of real receivers: white noise, an error that wanders slowly, and places held while the robot stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Place = tuple[float, float]

HOLD_MPS = 0.3
"""A receiver that holds its place does so below this speed [m/s] ..."""
HOLD_M = 1.0
"""... until the measured place is this far from the held one [m]."""


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Errors of a kind of receiver.

    :param white_sd_m: standard deviation of the part that each fix has anew [m]
    :param wander_sd_m: standard deviation of the part that wanders [m]
    :param wander_s: time in which the wandering part forgets itself [s]
    :param holds: whether the receiver holds its place while the robot stands (static hold)
    """

    white_sd_m: float = 0.02
    wander_sd_m: float = 0.0
    wander_s: float = 60.0
    holds: bool = False

    @property
    def sd_m(self) -> float:
        """Standard deviation of each coordinate [m]."""
        return math.hypot(self.white_sd_m, self.wander_sd_m)


RECEIVERS = {
    "rtk": Noise(white_sd_m=0.012, wander_sd_m=0.012),
    "float": Noise(white_sd_m=0.05, wander_sd_m=0.4, wander_s=120.0),
    "standalone": Noise(white_sd_m=0.2, wander_sd_m=1.5, wander_s=300.0),
    "standalone_poor": Noise(white_sd_m=0.4, wander_sd_m=2.4, wander_s=240.0),
    "static_hold": Noise(white_sd_m=0.2, wander_sd_m=1.0, wander_s=300.0, holds=True),
}
"""Receivers by name: with corrections (fixed and float), on their own in the open and under trees, and one that
holds its place."""


class Receiver:
    """A receiver whose errors follow from its random numbers.

    :param noise: its errors
    :param interval_s: time between fixes [s]
    :param rng: source of all randomness

    Attributes
    ----------
    wander : tuple[float, float]
        part of the error that wanders [m]
    """

    def __init__(self, noise: Noise, interval_s: float, rng: np.random.Generator) -> None:
        self._noise, self._interval_s, self._rng = noise, interval_s, rng
        self._kept = math.exp(-interval_s / noise.wander_s)
        x, y = (noise.wander_sd_m * rng.normal(size=2)).tolist()
        self.wander: Place = (x, y)
        self._last: Place | None = None
        self._held: Place | None = None

    def measure(self, place: Place) -> Place:
        """The fix of a robot that is truly here [m]; to be called once in each interval."""
        noise = self._noise
        draws = self._rng.normal(size=4).tolist()
        fresh = math.sqrt(1 - self._kept**2) * noise.wander_sd_m
        self.wander = (
            self._kept * self.wander[0] + fresh * draws[2],
            self._kept * self.wander[1] + fresh * draws[3],
        )
        measured = (
            place[0] + self.wander[0] + noise.white_sd_m * draws[0],
            place[1] + self.wander[1] + noise.white_sd_m * draws[1],
        )
        if not noise.holds:
            return measured
        slow = self._last is not None and math.dist(self._last, place) < HOLD_MPS * self._interval_s
        self._last = place
        if self._held is None or not slow or math.dist(self._held, measured) > HOLD_M:
            self._held = measured if slow else None
        return self._held or measured
