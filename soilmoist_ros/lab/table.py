# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a campaign: all missions on one time grid, and one row per mission with its final values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, csv_text, optional_module
from soilmoist_ros.lab.comparisons import QUARTER, hindsight_table, paired_table
from soilmoist_ros.lab.mission_store import CampaignRun, Stored
from soilmoist_ros.recording import write_whole
from soilmoist_ros.simulation import SETTINGS, MissionSettings

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


def results_table(stored: Stored, every_s: float) -> pd.DataFrame:
    """One row per mission and time: settings, ``time_s`` and the metrics (see :class:`SeriesRow`).

    The time grid of a mission reaches from 0 to its planned end. A row has the last entered state; after an early
    end, it has the final state. ``counting_share`` is the share of the elapsed time spent counting at stops.

    :param every_s: time between two rows of the time grid [s]
    """
    pandas = optional_module("pandas")
    grids = [time_grid(mission.settings.hours, every_s) for mission, _ in stored]
    found = [
        metrics_at(mission.settings, run, times_s) for (mission, run), times_s in zip(stored, grids, strict=True)
    ]
    heads = [{"key": mission.key, **mission.settings.as_texts()} for mission, _ in stored]
    head = pandas.DataFrame(heads, columns=["key", *SETTINGS]).astype(_NUMBERS)
    table = head.loc[head.index.repeat([len(times_s) for times_s in grids])].reset_index(drop=True)
    table["time_s"] = np.concatenate([np.empty(0), *grids])
    for name in _metric_names(found):
        columns = [
            metrics.get(name, np.full(len(times_s), np.nan)) for metrics, times_s in zip(found, grids, strict=True)
        ]
        table[name] = np.concatenate([np.empty(0), *columns]).astype(int if name == "samples" else float)
    return table


def missions_table(stored: Stored) -> pd.DataFrame:
    """One row per mission: settings, final metrics, and the reason for the end.

    ``mse_quarter`` is the mean squared error at a quarter of the mission time, ``end_s`` the time at which the
    mission ended.
    """
    found = [
        metrics_at(mission.settings, run, np.array([QUARTER * 3600 * mission.settings.hours, np.inf]))
        for mission, run in stored
    ]
    rows = [
        {
            "key": mission.key, "experiments": " ".join(mission.experiments), **mission.settings.as_texts(),
            "field_title": run.field_title, "end_s": run.columns["time_s"][-1],
            **{name: values[1] for name, values in metrics.items()}, "mse_quarter": metrics["mse"][0],
            "ended": run.ended,
        }
        for (mission, run), metrics in zip(stored, found, strict=True)
    ]  # fmt: skip
    columns = ["key", "experiments", *SETTINGS, "field_title", "end_s", *_metric_names(found), "mse_quarter"]
    columns.append("ended")
    return optional_module("pandas").DataFrame(rows, columns=columns).astype(_NUMBERS)


def write_tables(out: Path, stored: Stored, every_s: float) -> list[Path]:
    """Write ``results`` and ``missions`` as CSV.

    Also ``differences`` if combinations share seeds, and ``hindsight`` if an experiment has its lattices.

    :raises InputError: if they cannot be written
    """
    tables = {"results": results_table(stored, every_s), "missions": missions_table(stored)}
    if not (differences := paired_table(tables["missions"], CASE)).empty:
        tables["differences"] = differences
    if not (hindsight := hindsight_table(tables["missions"], CASE)).empty:
        tables["hindsight"] = hindsight
    written = []
    for name, table in tables.items():
        text = table.map(csv_text).to_csv(index=False, float_format="%.8g", lineterminator="\n")
        path = out / f"{name}.csv"
        try:
            write_whole(path, text.encode())
        except OSError as error:
            what, remedy = f"cannot be written: {error.strerror}", "choose another output folder"
            raise InputError(what, remedy, path) from None
        written.append(path)
    return written


def time_grid(hours: float, every_s: float) -> Array:
    """Times from 0 to the planned end [s]; the end is always included."""
    end_s = 3600 * hours
    grid = every_s * np.arange(np.floor(end_s / every_s * (1 + 1e-12)) + 1)
    return grid if end_s - grid[-1] < 1e-6 * every_s else np.append(grid, end_s)


def metrics_at(settings: MissionSettings, run: CampaignRun, times_s: Array) -> dict[str, NDArray[Any]]:
    """Last entered metrics of a mission at given times: :data:`METRICS`, then those of additional properties."""
    last = np.searchsorted(run.columns["time_s"][1:], times_s + 1e-6, side="right")
    state: dict[str, NDArray[Any]] = {name: column[last] for name, column in run.columns.items()}
    time_s, counting_s = state.pop("time_s"), state.pop("counting_s")
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(time_s > 0, counting_s / (time_s * settings.robots), np.nan)
    return {**state, "samples": state["samples"].astype(int), "counting_share": share}


def _metric_names(values: Iterable[Mapping[str, Any]]) -> list[str]:
    """Columns of all missions: :data:`METRICS`, then those of additional properties."""
    return list(dict.fromkeys((*METRICS, *chain.from_iterable(values))))
