# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Differences of strategies over shared seeds, with intervals.

Missions with the same seed share their random draws, such as the field and the weather, so the differences of
pairs scatter less than the missions. The interval is Student's t interval of the mean difference: with few pairs,
or skewed errors, it is approximate. Intervals of many comparisons are not adjusted for their number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

LEVEL = 0.95
"""Share of intervals that cover the true mean difference."""
QUANTITIES = ("mse", "mse_quarter", "vwc_rmse", "distance_m")
"""What is compared of missions: columns of ``missions``."""


@dataclass(frozen=True)
class PairedDifference:
    """The missions of one combination of strategy and dwell rule against those of another with the same seeds.

    :param quantity: what is compared, of :data:`QUANTITIES`
    :param strategy: name of the first strategy
    :param dwell: its dwell rule
    :param other_strategy: name of the second strategy
    :param other_dwell: its dwell rule
    :param pairs: number of seeds that both have
    :param mean: mean of the first over the pairs
    :param other_mean: mean of the second over the pairs
    :param difference: mean of first minus second
    :param low: lower end of the interval of the difference; NaN with fewer than two pairs
    :param high: upper end
    """

    quantity: str
    strategy: str
    dwell: str
    other_strategy: str
    other_dwell: str
    pairs: int
    mean: float
    other_mean: float
    difference: float
    low: float
    high: float

    @property
    def clear(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.low > 0 or self.high < 0


def difference_interval(mine: Array, theirs: Array, level: float = LEVEL) -> tuple[float, float, float]:
    """Mean of paired differences, and Student's t interval of it (NaN with fewer than two pairs).

    >>> mean, low, high = difference_interval(np.array([3.0, 4.0, 5.0]), np.array([1.0, 3.0, 4.0]))
    >>> f"{mean:.3f} {low:.3f} {high:.3f}"
    '1.333 -0.101 2.768'

    :param mine: values, shape (n,), n > 0
    :param theirs: values of the same seeds, shape (n,)
    :param level: share of intervals that cover the true mean
    """
    from scipy.special import stdtrit

    differences = mine - theirs
    mean, n = float(differences.mean()), len(differences)
    if n < 2:
        return mean, math.nan, math.nan
    reach = float(stdtrit(n - 1, 0.5 + level / 2)) * float(differences.std(ddof=1)) / math.sqrt(n)
    return mean, mean - reach, mean + reach


def paired_differences(missions: pd.DataFrame) -> Iterator[PairedDifference]:
    """All combinations of one case in pairs, each quantity that both have.

    :param missions: missions that differ in strategy, dwell and seed only, one per row
    """
    groups = [(key, rows.set_index("seed")) for key, rows in missions.groupby(["strategy", "dwell"], sort=False)]
    for quantity in QUANTITIES:
        for (first, mine), (second, theirs) in combinations(groups, 2):
            both = mine[quantity].to_frame("mine").join(theirs[quantity].to_frame("theirs"), how="inner").dropna()
            if both.empty:
                continue
            a, b = both["mine"].to_numpy(float), both["theirs"].to_numpy(float)
            means = (float(a.mean()), float(b.mean()))
            yield PairedDifference(
                quantity, str(first[0]), str(first[1]), str(second[0]), str(second[1]), len(both), *means,
                *difference_interval(a, b),
            )  # fmt: skip


def paired_table(missions: pd.DataFrame, cases: Iterable[str]) -> pd.DataFrame:
    """One row per pair of combinations and quantity: settings of the case, then :class:`PairedDifference`.

    :param missions: one row per mission with settings and final metrics
    :param cases: names of the settings that separate the cases
    """
    import pandas as pd

    columns = list(cases)
    rows: list[dict[str, object]] = []
    for values, case in missions.groupby(columns, sort=False, dropna=False):
        about = dict(zip(columns, values, strict=True))
        rows += [{**about, **asdict(one)} for one in paired_differences(case)]
    return pd.DataFrame(rows, columns=[*columns, *PairedDifference.__dataclass_fields__])
