# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Comparisons of strategies: differences over shared seeds, and ratios to the best lattice in hindsight.

Missions with the same seed share their random draws, such as the field and the weather, so the differences of
pairs scatter less than the missions. The interval is Student's t interval of the mean difference: with few pairs,
or skewed errors, it is approximate. Intervals of many comparisons are not adjusted for their number.

Hindsight knows the fixed dwell that turns out best on a field. There, lattices with the dwells of
:data:`LATTICE_DWELLS` run with the same settings and seeds. The best one at a time has the lowest mean squared
error of the rate, averaged over the seeds. Other strategies are compared with it in pairs: the ratio of the means
over the seeds, with its standard error by the delta method. In the mean of the ratios, the seeds of small errors
would decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

LEVEL = 0.95  # share of intervals that cover the true mean difference
QUANTITIES = ("mse", "mse_quarter", "vwc_rmse", "distance_m")
"""Quantities in which missions are compared: columns of ``missions``."""
Combination = tuple[str, str]  # names of a strategy and a dwell rule
LATTICE_DWELLS = ("fmi:10", "fmi:20", "fmi:30", "fmi:60")  # dwells from which hindsight chooses
LATTICES: tuple[Combination, ...] = tuple(("lattice", dwell) for dwell in LATTICE_DWELLS)
QUARTER = 0.25  # share of the mission time at which strategies are compared, in addition to the end


PAIRED = (
    "quantity", "strategy", "dwell", "other_strategy", "other_dwell", "pairs", "mean", "other_mean", "difference",
    "low", "high",
)  # fmt: skip
"""Columns of the missions of one combination against those of another with the same seeds: number of seeds that
both have, means over these, mean difference and its interval, NaN with fewer than two pairs."""


def difference_interval(mine: Array, theirs: Array, level: float = LEVEL) -> tuple[float, float, float]:
    """Mean of paired differences, and Student's t interval of it (NaN with fewer than two pairs).

    >>> mean, low, high = difference_interval(np.array([3.0, 4.0, 5.0]), np.array([1.0, 3.0, 4.0]))
    >>> f"{mean:.3f} {low:.3f} {high:.3f}"
    '1.333 -0.101 2.768'
    """
    from scipy.special import stdtrit

    differences = mine - theirs
    mean, n = float(differences.mean()), len(differences)
    if n < 2:
        return mean, math.nan, math.nan
    reach = float(stdtrit(n - 1, 0.5 + level / 2)) * float(differences.std(ddof=1)) / math.sqrt(n)
    return mean, mean - reach, mean + reach


def paired_differences(missions: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """All combinations of one case in pairs, each quantity that both have; see :data:`PAIRED`."""
    groups = [(key, rows.set_index("seed")) for key, rows in missions.groupby(["strategy", "dwell"], sort=False)]
    for quantity in QUANTITIES:
        for (first, mine), (second, theirs) in combinations(groups, 2):
            both = mine[quantity].to_frame("mine").join(theirs[quantity].to_frame("theirs"), how="inner").dropna()
            if both.empty:
                continue
            a, b = both["mine"].to_numpy(float), both["theirs"].to_numpy(float)
            row = (quantity, *first, *second, len(both), a.mean(), b.mean(), *difference_interval(a, b))
            yield dict(zip(PAIRED, row, strict=True))


def paired_table(missions: pd.DataFrame, cases: Iterable[str]) -> pd.DataFrame:
    """One row per pair of combinations and quantity: settings of the case, then :data:`PAIRED`."""
    return _of_cases(missions, cases, PAIRED, paired_differences)


def _of_cases(
    missions: pd.DataFrame,
    cases: Iterable[str],
    columns: Iterable[str],
    compare: Callable[[pd.DataFrame], Iterable[dict[str, Any]]],
) -> pd.DataFrame:
    """The comparisons of each case, with its settings before them."""
    import pandas as pd

    names = list(cases)
    rows: list[dict[str, Any]] = []
    for values, case in missions.groupby(names, sort=False, dropna=False):
        about = dict(zip(names, values, strict=True))
        rows += [{**about, **one} for one in compare(case)]
    return pd.DataFrame(rows, columns=[*names, *columns])


def paired_ratio(mine: Array, theirs: Array) -> tuple[float, float]:
    """Ratio of the means of paired values, and its standard error by the delta method (NaN for a single pair).

    >>> paired_ratio(np.array([1.0, 2.0]), np.array([2.0, 4.0]))
    (0.5, 0.0)
    """
    value = float(mine.mean() / theirs.mean())
    if len(mine) < 2:
        return value, math.nan
    return value, float(np.std(mine - value * theirs, ddof=1) / math.sqrt(len(mine)) / theirs.mean())


AGAINST = (
    "strategy", "dwell", "pairs", "mse", "distance_m", "end_best", "end_best_mse", "end_best_distance_m",
    "end_ratio", "end_ratio_se", "distance_ratio", "quarter_best", "quarter_ratio", "quarter_ratio_se",
)  # fmt: skip
"""Columns of a strategy against the best lattices in hindsight, at the end and at :data:`QUARTER` of the time."""


def hindsight_table(missions: pd.DataFrame, cases: Iterable[str]) -> pd.DataFrame:
    """One row per combination of each case that has all lattices: settings of the case, then :data:`AGAINST`."""
    return _of_cases(missions, cases, AGAINST, _against_best)


def _against_best(case: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """All combinations of one case, each over the seeds that it and all lattices have."""
    outcomes = {name: rows.set_index("seed") for name, rows in case.groupby(["strategy", "dwell"], sort=False)}
    if not set(LATTICES) <= outcomes.keys():
        return
    common = set.intersection(*(set(outcomes[name].index) for name in LATTICES))

    def values(name: Combination, metric: str, seeds: Iterable[int] = common) -> Array:
        return np.asarray(outcomes[name].loc[sorted(seeds), metric], float)

    def best(metric: str) -> Combination:  # one without a map, whose error is NaN, is never the best
        means = {name: float(values(name, metric).mean()) for name in LATTICES}
        return min(LATTICES, key=lambda name: (math.isnan(means[name]), means[name]))

    quarter, end = (best("mse_quarter"), best("mse")) if common else (LATTICES[0], LATTICES[0])
    for name, mine in outcomes.items():
        seeds = common & set(mine.index)
        if not seeds:
            continue
        mse, distance_m = values(name, "mse", seeds), values(name, "distance_m", seeds)
        end_mse, end_m = values(end, "mse", seeds), values(end, "distance_m", seeds)
        at_quarter = paired_ratio(values(name, "mse_quarter", seeds), values(quarter, "mse_quarter", seeds))
        row = (
            *name, len(seeds), float(mse.mean()), float(distance_m.mean()),
            end[1], float(end_mse.mean()), float(end_m.mean()), *paired_ratio(mse, end_mse),
            float(distance_m.mean() / end_m.mean()), quarter[1], *at_quarter,
        )  # fmt: skip
        yield dict(zip(AGAINST, row, strict=True))
