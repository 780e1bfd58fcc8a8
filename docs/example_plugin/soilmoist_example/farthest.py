# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The stop that is farthest from all places measured so far: it fills the field evenly, whatever the map says."""

import numpy as np

from soilmoist_ros.exploration import Choice, Situation


class Farthest:
    """A strategy has one method, :meth:`choose`. It may remember what it planned; this one need not."""

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """The next stop, or ``None`` if no candidate can be reached and counted at in the time that is left."""
        needed_s = situation.travel_s + situation.expected_dwell_s
        possible = np.flatnonzero(needed_s <= situation.time_left_s)
        if not len(possible):
            return None
        measured_xy = situation.measured_xy if len(situation.measured_xy) else situation.position_xy[None, :]
        between = situation.candidates_xy[possible, None, :] - measured_xy[None, :, :]
        distance_m = np.linalg.norm(between, axis=2).min(axis=1)
        best = int(np.argmax(distance_m))
        stop = situation.candidates[possible[best]]
        return Choice(stop, f"farthest from what was measured: {distance_m[best]:.1f} m")
