# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Charts of a campaign: error and distance against mission time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from soilmoist_ros.lab.campaign_data import CampaignData, Case, strategies_in
from soilmoist_ros.reporting import Area, Chart, ChartColour, Line, Mark, dwell_text, limits_of, strategy_text

if TYPE_CHECKING:
    import pandas as pd

Look = tuple[ChartColour, bool]  # colour of a line, and whether it is dashed
Lines = Sequence[tuple[str, "pd.DataFrame", Look]]  # name, rows and look of each line

LOOKS: Final[tuple[Look, ...]] = tuple(
    (colour, dashed) for dashed in (False, True) for colour in ("line", "orange", "green", "purple", "ink", "soft")
)


class Measure(NamedTuple):
    """A column of the results, its label, and the limits of all charts of it."""

    column: str
    label: str
    limits: tuple[float, float] = (0.0, 1.0)

    def around(self, several: Sequence[pd.DataFrame]) -> Measure:
        """The measure with limits around mean and standard deviation of several lines."""
        values = [limit for rows in several for limit in _course(rows, self)[2:]]
        low, high = limits_of(*values, zero=self.column == "distance_m") if values else (0.0, 1.0)
        return self._replace(limits=(low, high))


ERROR: Final = Measure("mse", "Mean squared error [(counts/s)²]")


def strategies_charts(data: CampaignData, case: Case) -> Iterator[Chart]:
    """Distance and error against time, one line per strategy: mean and standard deviation over the runs."""
    lines = _by_strategy(data.over_time(case, data.main_dwell(case)))
    distance = Measure("distance_m", "Distance [m]")
    for title, measure in (("Distance driven", distance), ("Error of the map", ERROR)):
        known = measure.around([rows for _, rows, _ in lines])
        yield _chart(f"strategies-{case.number}-{measure.column}", title, case, known, lines)


def intervals_charts(data: CampaignData, case: Case) -> Iterator[Chart]:
    """Error against time: one chart per strategy, one line per counting interval."""
    rows = data.over_time(case)
    dwells = sorted(rows["dwell"].unique(), key=_dwell_order)
    groups = [group for _, group in rows.groupby(["strategy", "dwell"])]
    known = ERROR.around(groups)
    for number, strategy in enumerate(interval_strategies(data, case)):
        some = rows[rows["strategy"] == strategy]
        of_dwell = [
            (dwell, some[some["dwell"] == dwell], look) for dwell, look in zip(dwells, LOOKS, strict=False)
        ]
        lines = [(dwell_text(dwell), its, look) for dwell, its, look in of_dwell if len(its)]
        yield _chart(f"intervals-{case.number}-{number}", strategy_text(strategy), case, known, lines)


def interval_strategies(data: CampaignData, case: Case) -> list[str]:
    """Strategies with missions of more than one counting interval."""
    rows = data.over_time(case)
    return [name for name in strategies_in(rows) if rows[rows["strategy"] == name]["dwell"].nunique() > 1]


def _by_strategy(rows: pd.DataFrame) -> Lines:
    names = strategies_in(rows)
    looks = [LOOKS[number % len(LOOKS)] for number in range(len(names))]
    return [
        (strategy_text(name), rows[rows["strategy"] == name], look)
        for name, look in zip(names, looks, strict=True)
    ]


def _chart(key: str, title: str, case: Case, measure: Measure, lines: Lines) -> Chart:
    """Mean lines with bands of one standard deviation over the runs."""
    marks, ticks = list[Mark](), None
    for name, rows, (colour, dashed) in lines:
        hours, middle, low, high = _course(rows, measure)
        marks.append(Area(hours, low, high, colour))
        marks.append(Line(hours, middle, colour, name, dashed))
    if measure.column == ERROR.column:
        powers = [(factor * 10.0**power) for power in range(-12, 7) for factor in (1, 2, 5)]
        ticks = [(float(np.log10(value)), f"{value:.6g}") for value in powers]
    alt = f"{measure.label} against mission time, {len(lines)} lines: {case.title}"
    return Chart(key, title, alt, marks, (0.0, case.hours), measure.limits, "Mission time [h]", measure.label,
                 y_ticks=ticks)  # fmt: skip


def _course(rows: pd.DataFrame, measure: Measure) -> tuple[np.ndarray, ...]:
    """Hours, mean, and one standard deviation to both sides; of an error as logarithms to base 10.

    The band of an error does not go below the lowest run: mean minus deviation may be negative. Times that fewer
    than half of the runs have reached are left out.
    """
    by_time = rows.groupby("time_s")[measure.column]
    count, mean, sd = by_time.count(), by_time.mean(), by_time.std(ddof=1).fillna(0.0)
    good = (count >= 0.5 * count.max()) & mean.notna()
    hours, middle, spread = mean.index[good].to_numpy(float) / 3600, mean[good].to_numpy(), sd[good].to_numpy()
    low, high = middle - spread, middle + spread
    if measure.column != ERROR.column:
        return hours, middle, low, high
    low = np.maximum(low, np.minimum(by_time.min()[good].to_numpy(), middle))
    return hours, *(np.log10(np.maximum(values, 1e-12)) for values in (middle, low, high))


def _dwell_order(dwell: str) -> tuple[int, float]:
    """Sort key: fixed intervals, adaptive intervals, others; fixed and adaptive from longest to shortest."""
    kind, _, number = dwell.partition(":")
    if kind == "fmi":
        return 0, -float(number)
    return (1, float(number)) if kind == "ami" else (2, 0.0)
