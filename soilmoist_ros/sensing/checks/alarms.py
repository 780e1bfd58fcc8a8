"""How often the checks may raise a false alarm, and what this means for one test."""

from __future__ import annotations

import math
from typing import Final

from soilmoist_ros.foundation import DAY_S

ALARMS_PER_DAY: Final = 0.1
"""Highest number of false alarms of one kind of check in a day of good records."""
MAX_PER_RECORD: Final = 1e-3
"""Highest probability of a false alarm of one kind of check in a record, for records of hours."""


def alarm_probability(period_s: float) -> float:
    """Probability of a false alarm that one kind of check may have in a good record [-].

    :param period_s: duration of a record [s], > 0
    """
    return min(ALARMS_PER_DAY * period_s / DAY_S, MAX_PER_RECORD)


def alarm_threshold(period_s: float, charts: int) -> float:
    """Threshold of cumulative sums of log-likelihood ratios.

    The mean time between false alarms of a chart is at least ``exp(threshold)`` records (Lorden 1971, Annals of
    Mathematical Statistics 42:1897-1908, theorem 2), so all charts together stay below :func:`alarm_probability`.

    :param period_s: duration of a record [s], > 0
    :param charts: number of charts, >= 1
    """
    return math.log(charts / alarm_probability(period_s))
