# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Real motion of the robot: speed, turning time and stop overhead, learned from the legs that it has driven.

A leg takes ``length / speed + turn * turning time + overhead``. The parameters are the prior of a regression on
the legs; errors follow a Student t distribution, so that a leg with an obstacle hardly counts.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.travel import RobotMotion, polyline_length_m, polyline_turn_rad

Array = NDArray[np.float64]

MAX_LEGS = 100  # number of the last legs that count: ground and battery change
PACE_SD, TURN_SD = 0.3, 0.5
"""Prior standard deviations of the time per metre and per radian, as shares of the parameters."""
OVERHEAD_SD, OVERHEAD_SD_S = 0.5, 5.0
"""Prior standard deviation of the stop overhead: a share of the parameter, and seconds that are added."""
LEG_SD, LEG_SD_S = 0.05, 1.0
"""Standard deviation of the time of a leg without an obstacle: a share of its time, and seconds that are added."""
DEGREES_OF_FREEDOM = 3.0  # degrees of freedom of the errors; few make outliers count little
NEAR_M = 1.0  # a record was counted at the stop if its place is this near [m]
COUNTED_LEGS = 10
"""Number of legs that the prior of the counted share of the overhead is worth: all of it is counted."""
COUNTED_SAME = 0.15  # smallest share of the overhead, not counted at the stop, that replaces the prior
SAME = 0.01  # smallest relative change of a leg's time that is worth replacing the parameters
_ROUNDS, _CONVERGED = 30, 1e-6
_SLOWEST, _FASTEST = 0.1, 10.0


@dataclass(frozen=True, slots=True)
class Leg:
    """A drive to a stop that ended there."""

    length_m: float  # length of the route [m]
    turn_rad: float  # sum of its turns [rad]
    time_s: float  # from the goal to the arrival [s]


class LearnedMotion:
    """The motion of a robot, as far as its legs show it; the prior if it shall not learn.

    The turning time is learned only if its parameter is not 0, the costs of an operator never.
    """

    def __init__(self, prior: RobotMotion, learns: bool = True) -> None:
        self.prior = prior
        self._learns = learns
        self._driven = prior
        self.motion = prior
        self.legs: deque[Leg] = deque(maxlen=MAX_LEGS)
        self._begun: tuple[float, float, float] | None = None
        self._stop: tuple[float, float] | None = None  # whose records before the arrival are sought
        self._leg_counted_s = 0.0
        self._counted_s = 0.0
        self._counted_legs = 0

    def set_off(self, now_s: float, way: Array) -> None:
        """The robot gets a goal."""
        self._begun = (now_s, polyline_length_m(way), polyline_turn_rad(way))
        self._stop, self._leg_counted_s = (float(way[-1, 0]), float(way[-1, 1])), 0.0

    def give_up(self) -> None:
        """The goal has ended in another way than by arrival."""
        self._begun = self._stop = None

    def count(self, place: tuple[float, float], exposure_s: float) -> None:
        """A record has come: what is counted at the stop before the arrival counts there, too."""
        if self._stop is None:
            return
        near = math.dist(place, self._stop) <= NEAR_M
        if self._begun is not None:
            self._leg_counted_s = self._leg_counted_s + exposure_s if near else 0.0
            return
        # The first record after the arrival began before it: on average half of it belongs to the overhead.
        self._counted_s += self._leg_counted_s + (exposure_s / 2 if near else 0.0)
        self._counted_legs += 1
        self._stop = None
        self._combine()

    def arrive(self, now_s: float) -> bool:
        """The robot has arrived and counts; whether a leg was learned from."""
        begun, self._begun = self._begun, None
        if begun is None:
            return False
        self.add(Leg(begun[1], begun[2], now_s - begun[0]))
        return True

    def add(self, leg: Leg) -> None:
        """Learn from a leg."""
        self.legs.append(leg)
        if self._learns:
            self._driven = learned_motion(self.prior, tuple(self.legs))
            self._combine()

    def _combine(self) -> None:
        """The motion by the legs, with the share of the overhead that is counted."""
        motion = self._driven
        if not self._learns:
            return
        known_s = COUNTED_LEGS * motion.stop_overhead_s
        all_s = known_s + self._counted_legs * motion.stop_overhead_s
        share = (known_s + self._counted_s) / all_s if all_s > 0 else 1.0
        self.motion = motion if share > 1 - COUNTED_SAME else replace(motion, overhead_counted=share)

    @property
    def cautious(self) -> RobotMotion:
        """For limits: never faster than the parameters say."""
        return replace(
            self.prior,
            speed_mps=min(self.prior.speed_mps, self.motion.speed_mps),
            stop_overhead_s=max(self.prior.stop_overhead_s, self.motion.stop_overhead_s),
            turn_s_per_rad=max(self.prior.turn_s_per_rad, self.motion.turn_s_per_rad),
        )

    def __str__(self) -> str:
        motion = self.motion
        turning = f", {motion.turn_s_per_rad:.1f} s/rad" if motion.turn_s_per_rad > 0 else ""
        source = "as set" if motion is self.prior else f"learned from {len(self.legs)} legs"
        return f"{motion.speed_mps:.2f} m/s, {motion.stop_overhead_s:.0f} s per stop{turning}, {source}"


def learned_motion(prior: RobotMotion, legs: tuple[Leg, ...]) -> RobotMotion:
    """The motion that prior and legs make most likely; ``prior`` itself where hardly a time would change."""
    if not legs:
        return prior
    start = np.array([1 / prior.speed_mps, prior.turn_s_per_rad, prior.stop_overhead_s])
    spread = np.array([PACE_SD * start[0], max(TURN_SD * start[1], 1e-9), OVERHEAD_SD * start[2] + OVERHEAD_SD_S])
    driven = np.array([(leg.length_m, leg.turn_rad, 1.0) for leg in legs])
    time_s = np.array([leg.time_s for leg in legs])
    sd_s = LEG_SD * time_s + LEG_SD_S
    estimate, late_s = start, time_s - driven @ start
    for _ in range(_ROUNDS):
        error = (time_s - driven @ estimate) / sd_s
        weight = (DEGREES_OF_FREEDOM + 1) / (DEGREES_OF_FREEDOM + error**2) / sd_s**2
        precision = driven.T @ (weight[:, None] * driven) + np.diag(1 / spread**2)
        before, estimate = estimate, start + np.linalg.solve(precision, driven.T @ (weight * late_s))
        if np.abs(estimate - before).max() <= _CONVERGED:
            break
    estimate = np.clip(estimate, [start[0] * _SLOWEST, 0.0, 0.0], [start[0] * _FASTEST, np.inf, np.inf])
    usual_s = driven @ start
    if (np.abs(driven @ estimate - usual_s) <= SAME * usual_s).all():
        return prior
    pace, turn, overhead = estimate.tolist()
    return replace(
        prior, speed_mps=1 / pace, turn_s_per_rad=turn if prior.turn_s_per_rad else 0.0, stop_overhead_s=overhead
    )
