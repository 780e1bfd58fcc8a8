# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Earlier surveys that can hardly be right: their date, or their count rate."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping import Samples
from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun

MAX_AHEAD_S = DAY_S
"""How far after the time of the report a record may be dated [s]: clocks of loggers are local."""
MAX_RATE_RATIO = 2.0
"""Largest ratio of the mean rates of two surveys without a doubt: dry to saturated soil (Desilets 2010)."""
MAX_YEARS = 5.0
"""Longest time between two surveys without a doubt."""
_YEAR_S = 365.25 * DAY_S


def doubts(run: EarlierRun, rate_cps: float, now: datetime, end: datetime | None = None) -> Iterator[str]:
    """What can hardly be right with an earlier survey; each doubt is a sentence that follows its name.

    :param run: the survey
    :param rate_cps: mean rate of the survey that it is compared with, in counts of the same sensor [counts/s]
    :param now: time of the report
    :param end: end of the survey that it is compared with; ``None`` for any, or for a clock without a date
    """
    stamp_s = run.survey.stamp_s
    years = 0.0 if end is None else abs(stamp_s - end.timestamp()) / _YEAR_S
    if run.date and stamp_s - now.timestamp() > MAX_AHEAD_S:
        yield f"is dated {run.date}, in the future: check the clock of its logger, or leave it out."
    elif run.date and years > MAX_YEARS:
        yield (
            f"of {run.date} lies {years:.0f} years from this one: the pattern of the field may be another. The "
            "counts decide how much of it the map uses."
        )
    ratio = mean_rate(run.survey.samples) / rate_cps if rate_cps > 0 else 1.0
    if not 1 / MAX_RATE_RATIO <= ratio <= MAX_RATE_RATIO:
        yield (
            f"has {ratio:.2g} times the count rate of {'the others' if end is None else 'this one'}, more than "
            "soil moisture can change: the sensors differ, or not all tubes were counted. Give each survey a site "
            "file with its N0, or leave it out: its pattern and the change are wrong."
        )


def mean_rate(samples: Samples) -> float:
    """Mean count rate over equal exposure [counts/s]."""
    return float(samples.counts.sum() / samples.exposure_s.sum())
