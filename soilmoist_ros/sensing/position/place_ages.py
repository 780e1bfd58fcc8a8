# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How old measured places are when they come.

A connection that stalls delivers all at once what it held back. The last of these places is where the robot is,
the others are where it was.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

COMPARED: Final = 30
"""Number of seconds with places, of which the least delay passes for none."""
APART_S: Final = 1.0
"""Places that come within this time count as one delay [s], so that many that come at once are not the rule."""


class PlaceAges:
    """Ages of the places of one source, by their stamps on any clock that runs evenly.

    The clock may be wrong, so an age is the delay of a place less the least delay of the last seconds.
    """

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque(maxlen=COMPARED)  # begin of a second, least delay in it

    def age_s(self, now_s: float, stamp_s: float) -> float:
        """Age of a place that comes now [s]; inf while there is nothing to compare it with, 0 without a stamp.

        :param now_s: time at which it comes [s]
        :param stamp_s: time of the measurement [s], NaN if unknown
        """
        delay_s = now_s - stamp_s
        if not math.isfinite(delay_s):
            return 0.0
        if self._delays and now_s < self._delays[-1][0]:
            self.clear()
        if self._delays and now_s - self._delays[-1][0] < APART_S:
            since_s, least_s = self._delays[-1]
            self._delays[-1] = since_s, min(least_s, delay_s)
        else:
            self._delays.append((now_s, delay_s))
        return delay_s - min(least_s for _, least_s in self._delays) if len(self._delays) > 1 else math.inf

    def clear(self) -> None:
        """A clock was set: earlier delays say nothing about later ones."""
        self._delays.clear()
