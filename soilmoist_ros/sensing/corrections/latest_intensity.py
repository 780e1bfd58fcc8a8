# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The latest incoming intensity that came from outside, with its age."""

from __future__ import annotations

import math


class LatestIntensity:
    """The latest rate of a neutron monitor that publishes its values.

    >>> latest = LatestIntensity()
    >>> latest.take(151.2, now_s=100.0)
    True
    >>> latest.rate, latest.age_s(160.0)
    (151.2, 60.0)
    """

    def __init__(self) -> None:
        self.rate = math.nan
        """The rate, in the unit of the site's reference; NaN if none has come."""
        self._since_s = -math.inf

    def __repr__(self) -> str:
        return f"LatestIntensity({self.rate:g})"

    def take(self, rate: float, now_s: float) -> bool:
        """Store a rate that has just come; returns whether it is one: positive and finite.

        :param now_s: monotonic time [s]
        """
        if not (math.isfinite(rate) and rate > 0):
            return False
        self.rate, self._since_s = rate, now_s
        return True

    def age_s(self, now_s: float) -> float:
        """Time since the rate came [s], infinite if none has come.

        :param now_s: monotonic time [s]
        """
        return now_s - self._since_s
