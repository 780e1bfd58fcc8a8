# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strategies against the best lattice in hindsight: the fixed dwell that turns out best on a field.

On each field, lattices with the dwells of :data:`LATTICE_DWELLS` run with the same settings and seeds. The best
one at a time has the lowest mean squared error of the rate, averaged over the seeds. Other strategies are
compared with it in pairs: the ratio of the means over the seeds, with its standard error by the delta method.
In the mean of the ratios, the seeds of small errors would decide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Combination = tuple[str, str]
"""Names of a strategy and a dwell rule."""

LATTICE_DWELLS = ("fmi:10", "fmi:20", "fmi:30", "fmi:60")
"""Dwells from which hindsight chooses."""
LATTICES: tuple[Combination, ...] = tuple(("lattice", dwell) for dwell in LATTICE_DWELLS)
QUARTER = 0.25
"""Share of the mission time at which strategies are compared, in addition to the end."""


class Outcome(NamedTuple):
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
    """A strategy on one field against the best lattices in hindsight.

    :param strategy: name of the strategy
    :param dwell: its dwell rule
    :param pairs: number of paired seeds
    :param mse: its mean error at the end [(counts/s)^2]
    :param distance_m: its mean distance [m]
    :param end_best: dwell of the lattice with the lowest error at the end
    :param end_best_mse: error of this lattice [(counts/s)^2]
    :param end_best_distance_m: its distance [m]
    :param end_ratio: ratio of the errors at the end
    :param end_ratio_se: its standard error
    :param distance_ratio: ratio of the distances
    :param quarter_best: dwell of the lattice with the lowest error at :data:`QUARTER` of the time
    :param quarter_ratio: ratio of the errors then
    :param quarter_ratio_se: its standard error
    """

    strategy: str
    dwell: str
    pairs: int
    mse: float
    distance_m: float
    end_best: str
    end_best_mse: float
    end_best_distance_m: float
    end_ratio: float
    end_ratio_se: float
    distance_ratio: float
    quarter_best: str
    quarter_ratio: float
    quarter_ratio_se: float


def paired_ratio(mine: Array, theirs: Array) -> tuple[float, float]:
    """Ratio of the means of paired values, and its standard error by the delta method (NaN for a single pair).

    >>> paired_ratio(np.array([1.0, 2.0]), np.array([2.0, 4.0]))
    (0.5, 0.0)
    """
    value = float(mine.mean() / theirs.mean())
    if len(mine) < 2:
        return value, math.nan
    return value, float(np.std(mine - value * theirs, ddof=1) / math.sqrt(len(mine)) / theirs.mean())


def against_best_lattice(outcomes: Mapping[Combination, Mapping[int, Outcome]]) -> list[Against]:
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


def _best(outcomes: Mapping[Combination, Mapping[int, Outcome]], metric: int, seeds: set[int]) -> Combination:
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
    """One row per combination of each case that has all lattices: settings of the case, then :class:`Against`.

    :param missions: one row per mission with settings, final metrics, and ``mse_quarter``
    :param cases: names of the settings that separate the cases
    """
    import pandas as pd

    columns = list(cases)
    rows: list[dict[str, object]] = []
    for values, case in missions.groupby(columns, sort=False, dropna=False):
        outcomes: dict[Combination, dict[int, Outcome]] = {}
        for row in case.to_dict("records"):
            outcome = Outcome(row["mse_quarter"], row["mse"], row["distance_m"])
            outcomes.setdefault((row["strategy"], row["dwell"]), {})[row["seed"]] = outcome
        about = dict(zip(columns, values, strict=True))
        rows += [{**about, **asdict(one)} for one in against_best_lattice(outcomes)]
    return pd.DataFrame(rows, columns=[*columns, *Against.__dataclass_fields__])
