# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a campaign: all missions on one time grid, and one row per mission with its final values."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, csv_text, optional_module
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.lab.comparisons import QUARTER, hindsight_table, paired_table
from soilmoist_ros.lab.mission_store import CampaignRun
from soilmoist_ros.recording import write_whole
from soilmoist_ros.simulation import SETTINGS, MapErrors, SeriesRow, series_columns

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
METRICS = ("distance_m", "samples", "mse", "mse_10s", "vwc_rmse", "coverage95", "counting_share")
"""Columns of the mission and its first property; columns of additional properties end in their names."""

COMPARED = ("strategy", "dwell", "seed")  # settings that may differ between the missions of a case
CASE = tuple(name for name in SETTINGS if name not in COMPARED)
"""Settings that are equal for all missions of a case."""

_NUMBERS = {name: "float64" for name, setting in SETTINGS.items() if setting.kind is float}
"""Types of columns that would not be numbers where a setting is left to the field or the robot."""


@dataclass(frozen=True, eq=False)
class MissionRow:
    """Values of a mission that the tables need; few, because a campaign keeps them of every mission."""

    key: str  # digest of its settings
    field_title: str  # name of the field for reports
    ended: str  # reason for the end
    efficiency: float  # efficiency of its plan; NaN if it has none
    end_s: float  # time at which it ended [s]; NaN if unknown
    mse_quarter: float  # mean squared error at a quarter of the mission time [(counts/s)^2]
    border_share: float  # see :func:`border_share`
    final: Mapping[str, float]  # final metrics
    times_s: Array  # time grid [s], shape (n,)
    names: tuple[str, ...]  # names of the metrics
    values: Array  # metrics on the time grid, shape (m, n)

    @property
    def metrics(self) -> dict[str, Array]:
        """Metrics on the time grid by their names."""
        return dict(zip(self.names, self.values, strict=True))


Finished = Sequence[tuple[CampaignMission, MissionRow]]


def mission_row(stored: CampaignRun, every_s: float) -> MissionRow:
    """The rows of a mission; ``every_s``: time between two rows of the time grid [s]."""
    times_s = time_grid(stored.settings.hours, every_s)
    metrics = metrics_at(stored, times_s)
    quarter_s = np.array([QUARTER * 3600 * stored.settings.hours])
    return MissionRow(
        key=stored.key, field_title=stored.field_title or stored.settings.field_name, ended=stored.ended,
        efficiency=stored.efficiency, end_s=stored.series[-1].time_s if stored.series else float("nan"),
        mse_quarter=float(metrics_at(stored, quarter_s)["mse"][0]), border_share=border_share(stored),
        final={name: values[0].item() for name, values in metrics_at(stored, np.array([np.inf])).items()},
        times_s=times_s, names=tuple(map(sys.intern, metrics)), values=np.array([*metrics.values()], float),
    )  # fmt: skip


def results_table(finished: Finished) -> pd.DataFrame:
    """One row per mission and time: settings, ``time_s`` and the metrics (see :class:`SeriesRow`).

    The time grid of a mission reaches from 0 to its planned end. A row has the last entered state; after an early
    end, it has the final state. ``counting_share`` is the share of the elapsed time spent counting at stops.
    """
    pandas = optional_module("pandas", "campaign")
    rows = [row for _, row in finished]
    heads = [{"key": mission.key, **mission.settings.as_texts()} for mission, _ in finished]
    head = pandas.DataFrame(heads, columns=["key", *SETTINGS]).astype(_NUMBERS)
    table = head.loc[head.index.repeat([len(row.times_s) for row in rows])].reset_index(drop=True)
    table["time_s"] = np.concatenate([np.empty(0), *(row.times_s for row in rows)])
    for name in _metric_names(row.metrics for row in rows):
        kind = int if name == "samples" else float
        columns = [row.metrics.get(name, np.full(len(row.times_s), np.nan)) for row in rows]
        table[name] = np.concatenate([np.empty(0), *columns]).astype(kind)
    return table


def missions_table(finished: Finished) -> pd.DataFrame:
    """One row per mission: settings, final metrics, and the reason for the end.

    ``border_share`` is the share of stops in the strip along the boundary that contains half of the field's
    area (0.5 for uniformly distributed stops). ``mse_quarter`` is the mean squared error at a quarter of the
    mission time, ``end_s`` the time at which the mission ended, and ``efficiency`` is that of its plan
    (:class:`Efficiency`).
    """
    rows = [
        {
            "key": mission.key, "experiments": " ".join(mission.experiments), **mission.settings.as_texts(),
            "field_title": row.field_title, "end_s": row.end_s, **row.final, "mse_quarter": row.mse_quarter,
            "border_share": row.border_share, "ended": row.ended, "efficiency": row.efficiency,
        }
        for mission, row in finished
    ]  # fmt: skip
    columns = ["key", "experiments", *SETTINGS, "field_title", "end_s"]
    columns += [*_metric_names(row.final for _, row in finished)]
    columns += ["mse_quarter", "border_share", "ended", "efficiency"]
    return optional_module("pandas", "campaign").DataFrame(rows, columns=columns).astype(_NUMBERS)


def write_tables(out: Path, finished: Finished) -> list[Path]:
    """Write ``results`` and ``missions`` as Parquet and CSV.

    Also ``differences`` if combinations share seeds, and ``hindsight`` if an experiment has its lattices.

    :raises InputError: if they cannot be written
    """
    tables = {"results": results_table(finished), "missions": missions_table(finished)}
    if not (differences := paired_table(tables["missions"], CASE)).empty:
        tables["differences"] = differences
    if not (hindsight := hindsight_table(tables["missions"], CASE)).empty:
        tables["hindsight"] = hindsight
    written = []
    for name, table in tables.items():
        text = table.map(csv_text).to_csv(index=False, float_format="%.8g", lineterminator="\n")
        for suffix, content in (("parquet", table.to_parquet(index=False)), ("csv", text.encode())):
            path = out / f"{name}.{suffix}"
            try:
                write_whole(path, content)
            except OSError as error:
                raise InputError(
                    f"cannot be written: {error.strerror}", "choose another output folder", path
                ) from None
            written.append(path)
    return written


def time_grid(hours: float, every_s: float) -> Array:
    """Times from 0 to the planned end [s]; the end is always included."""
    end_s = 3600 * hours
    grid = every_s * np.arange(np.floor(end_s / every_s * (1 + 1e-12)) + 1)
    return grid if end_s - grid[-1] < 1e-6 * every_s else np.append(grid, end_s)


def metrics_at(stored: CampaignRun, times_s: Array) -> dict[str, NDArray[Any]]:
    """Last entered metrics of a mission at given times: :data:`METRICS`, then those of additional properties."""
    names = ["", *(wanted.name for wanted in stored.settings.properties)]
    start = SeriesRow(0.0, 0.0, 0, 0.0, (MapErrors(),) * len(names))
    entered = series_columns([start, *stored.series], names)
    last = np.searchsorted(entered["time_s"][1:], times_s + 1e-6, side="right")
    state = {name: column[last] for name, column in entered.items()}
    time_s, counting_s = state.pop("time_s"), state.pop("counting_s")
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(time_s > 0, counting_s / (time_s * stored.settings.robots), np.nan)
    return {**state, "counting_share": share}


def _metric_names(values: Iterable[Mapping[str, Any]]) -> list[str]:
    """Columns of all missions: :data:`METRICS`, then those of additional properties."""
    return list(dict.fromkeys((*METRICS, *chain.from_iterable(values))))


def border_share(stored: CampaignRun) -> float:
    """Share of stops in the boundary strip that contains half of the area; NaN without map or stops."""
    import shapely

    if not stored.outlines or not stored.visits:
        return float("nan")
    boundary = shapely.MultiLineString([np.vstack([ring, ring[:1]]) for ring in stored.outlines])
    row, column = np.nonzero(np.isfinite(stored.truth_rate))
    cells = np.column_stack([stored.x_m[column], stored.y_m[row]])
    stops = np.array([(visit.x_m, visit.y_m) for visit in stored.visits])
    width = np.median(shapely.distance(shapely.points(cells), boundary))
    return float(np.mean(shapely.distance(shapely.points(stops), boundary) < width))
