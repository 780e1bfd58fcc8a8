# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
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


def least_chance(counts: float, total: float, share: float) -> float:
    """A lower limit of the probability that at least so many of all counts are in one of two parts [-].

    Most records are clearly good by this limit, which needs no incomplete beta function: loading that takes 0.15 s
    and 25 MB. Up to the mean it is 1/2, for the median is a whole number next to the mean (Kaas and Buhrman 1980,
    https://doi.org/10.1111/j.1467-9574.1980.tb00681.x); beyond, see Ash (1965), Information theory, lemma 4.7.2.

    :param counts: whole number of counts in the part, 0..total
    :param total: counts in both parts
    :param share: expected share of the part, in (0, 1)
    """
    if counts <= total * share:
        return 0.5
    if counts >= total:
        return float(share**total)
    found = counts / total
    divergence = found * math.log(found / share) + (1 - found) * math.log((1 - found) / (1 - share))
    return math.exp(-total * divergence) / math.sqrt(8 * total * found * (1 - found))
