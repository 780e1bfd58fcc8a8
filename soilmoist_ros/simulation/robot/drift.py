# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drying and rain during a mission: the true rate of the whole field changes with time."""

from __future__ import annotations

from dataclasses import dataclass

RAIN_S = 300.0
"""Time that rain takes to change the rate [s]."""


@dataclass(frozen=True)
class Drift:
    """A change of the true rate, by the same share everywhere, evenly in time.

    >>> drying = Drift(0.1, 0.0, 7200.0)
    >>> drying.factor(0.0), drying.factor(3600.0), drying.factor(9000.0)
    (1.0, 1.05, 1.1)

    :param share: change, as a share of the rate before: 0.1 for drying by 10 %, negative for wetting [-]
    :param begin_s: when it begins [s]
    :param end_s: when it is complete [s], > ``begin_s``
    """

    share: float = 0.0
    begin_s: float = 0.0
    end_s: float = 1.0

    def factor(self, time_s: float) -> float:
        """Rate at a time [s], relative to the rate before the change; exactly 1 without a change."""
        done = min(max((time_s - self.begin_s) / (self.end_s - self.begin_s), 0.0), 1.0)
        return 1.0 + self.share * done


STEADY = Drift()
"""No change."""
