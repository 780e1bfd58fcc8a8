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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

LEVEL = 0.95  # share of intervals that cover the true mean difference
QUANTITIES = ("mse", "mse_quarter", "vwc_rmse", "distance_m")
"""What is compared of missions: columns of ``missions``."""
Combination = tuple[str, str]  # names of a strategy and a dwell rule
LATTICE_DWELLS = ("fmi:10", "fmi:20", "fmi:30", "fmi:60")  # dwells from which hindsight chooses
LATTICES: tuple[Combination, ...] = tuple(("lattice", dwell) for dwell in LATTICE_DWELLS)
QUARTER = 0.25  # share of the mission time at which strategies are compared, in addition to the end


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
        """True if the interval leaves out zero."""
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
    """All combinations of one case in pairs, each quantity that both have."""
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
    """One row per pair of combinations and quantity: settings of the case, then :class:`PairedDifference`."""
    import pandas as pd

    columns = list(cases)
    rows: list[dict[str, object]] = []
    for values, case in missions.groupby(columns, sort=False, dropna=False):
        about = dict(zip(columns, values, strict=True))
        rows += [{**about, **asdict(one)} for one in paired_differences(case)]
    return pd.DataFrame(rows, columns=[*columns, *PairedDifference.__dataclass_fields__])


class LatticeOutcome(NamedTuple):
    """What is compared of a mission.

    :param quarter_mse: mean squared error of the rate at :data:`QUARTER` of the time [(counts/s)^2]
    :param mse: the same at the end
    :param distance_m: distance driven until the end [m]
    """

    quarter_mse: float
    mse: float
    distance_m: float


@dataclass(frozen=True)
class Against:
    """A strategy on one field against the best lattices in hindsight."""

    strategy: str  # name of the strategy
    dwell: str  # its dwell rule
    pairs: int  # number of paired seeds
    mse: float  # its mean error at the end [(counts/s)^2]
    distance_m: float  # its mean distance [m]
    end_best: str  # dwell of the lattice with the lowest error at the end
    end_best_mse: float  # error of this lattice [(counts/s)^2]
    end_best_distance_m: float  # its distance [m]
    end_ratio: float  # ratio of the errors at the end
    end_ratio_se: float  # its standard error
    distance_ratio: float  # ratio of the distances
    quarter_best: str  # dwell of the lattice with the lowest error at :data:`QUARTER` of the time
    quarter_ratio: float  # ratio of the errors then
    quarter_ratio_se: float  # its standard error


def paired_ratio(mine: Array, theirs: Array) -> tuple[float, float]:
    """Ratio of the means of paired values, and its standard error by the delta method (NaN for a single pair).

    >>> paired_ratio(np.array([1.0, 2.0]), np.array([2.0, 4.0]))
    (0.5, 0.0)
    """
    value = float(mine.mean() / theirs.mean())
    if len(mine) < 2:
        return value, math.nan
    return value, float(np.std(mine - value * theirs, ddof=1) / math.sqrt(len(mine)) / theirs.mean())


def against_best_lattice(outcomes: Mapping[Combination, Mapping[int, LatticeOutcome]]) -> list[Against]:
    """Compare all combinations on one field with the best lattices; empty unless all lattices have a common seed.

    :param outcomes: outcomes by strategy and dwell rule, then by seed. Each combination is compared over the seeds
        that it and all lattices have.
    """
    if not set(LATTICES) <= outcomes.keys():
        return []
    common = set.intersection(*(set(outcomes[name]) for name in LATTICES))
    best = [_best(outcomes, metric, common) for metric in (0, 1)]
    found = []
    for name, mine in outcomes.items():
        seeds = sorted(common & set(mine))
        if seeds:
            values = [np.array([outcomes[one][seed] for seed in seeds]).T for one in (name, *best)]
            found.append(_against(name, values, best))
    return found


def _best(
    outcomes: Mapping[Combination, Mapping[int, LatticeOutcome]], metric: int, seeds: set[int]
) -> Combination:
    """The lattice with the lowest mean of an error; one without a map, whose error is NaN, is never the best."""

    def error(name: Combination) -> tuple[bool, float]:
        mean = float(np.mean([outcomes[name][seed][metric] for seed in sorted(seeds)])) if seeds else math.nan
        return math.isnan(mean), mean

    return min(LATTICES, key=error)


def _against(name: Combination, values: Sequence[Array], best: Sequence[Combination]) -> Against:
    """Compare one combination.

    :param values: outcomes of the combination, of the best lattice at a quarter, and of the best one at the end,
        each of shape (3, n)
    """
    mine, quarter, end = values
    end_ratio, end_se = paired_ratio(mine[1], end[1])
    quarter_ratio, quarter_se = paired_ratio(mine[0], quarter[0])
    return Against(
        strategy=name[0],
        dwell=name[1],
        pairs=mine.shape[1],
        mse=float(mine[1].mean()),
        distance_m=float(mine[2].mean()),
        end_best=best[1][1],
        end_best_mse=float(end[1].mean()),
        end_best_distance_m=float(end[2].mean()),
        end_ratio=end_ratio,
        end_ratio_se=end_se,
        distance_ratio=float(mine[2].mean() / end[2].mean()),
        quarter_best=best[0][1],
        quarter_ratio=quarter_ratio,
        quarter_ratio_se=quarter_se,
    )


def hindsight_table(missions: pd.DataFrame, cases: Iterable[str]) -> pd.DataFrame:
    """One row per combination of each case that has all lattices: settings of the case, then :class:`Against`."""
    import pandas as pd

    columns = list(cases)
    rows: list[dict[str, object]] = []
    for values, case in missions.groupby(columns, sort=False, dropna=False):
        outcomes: dict[Combination, dict[int, LatticeOutcome]] = {}
        for row in case.to_dict("records"):
            outcome = LatticeOutcome(row["mse_quarter"], row["mse"], row["distance_m"])
            outcomes.setdefault((row["strategy"], row["dwell"]), {})[row["seed"]] = outcome
        about = dict(zip(columns, values, strict=True))
        rows += [{**about, **asdict(one)} for one in against_best_lattice(outcomes)]
    return pd.DataFrame(rows, columns=[*columns, *Against.__dataclass_fields__])
