# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Report of a campaign: settings, charts, final values and differences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace as Row
from typing import TYPE_CHECKING, Any

import numpy as np

from soilmoist_ros.foundation import InputError, number
from soilmoist_ros.lab import figures
from soilmoist_ros.lab.campaign_data import CampaignData, Case
from soilmoist_ros.lab.campaign_file import Campaign, missions
from soilmoist_ros.lab.comparisons import LATTICES
from soilmoist_ros.lab.computing import Failure
from soilmoist_ros.lab.mission_store import Stored, code_version
from soilmoist_ros.mapping import FIT_SETTINGS
from soilmoist_ros.recording import write_whole
from soilmoist_ros.reporting import dwell_text, length, plain, render_page, strategy_text

if TYPE_CHECKING:
    import pandas as pd

NAME = "report.html"


def write_campaign_report(
    campaign: Campaign, out: Path, runs: Stored, failures: Sequence[Failure] = ()
) -> Path | None:
    """Write ``report.html`` about the stored missions of a campaign; return its path.

    Without a finished mission, return ``None`` and remove an older report, which would not match the tables.

    :raises InputError: if the page cannot be written
    """
    path = out / NAME
    data = CampaignData(campaign, runs)
    try:
        if data.missions.empty:
            path.unlink(missing_ok=True)
            return None
        write_whole(path, render_campaign_report(data, failures).encode())
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", path) from None
    return path


def render_campaign_report(data: CampaignData, failures: Sequence[Failure] = ()) -> str:
    """The page as HTML; raises ``InputError`` if no mission is finished."""
    if data.missions.empty:
        raise InputError(
            "no mission of the campaign is finished", "run the campaign, and see why its missions failed"
        )
    return render_page(
        "campaign.html.j2", title=data.campaign.title, version=code_version(),
        where=f"{len(data.missions)} of {data.expected} simulated missions · soilmoist_ros {code_version()}",
        simulated=True, campaign=data.campaign, done=len(data.missions), expected=data.expected,
        failures=[str(failure) for failure in failures], experiments=list(_experiments(data)),
        common=_common_settings(data), optimal="optimal" in set(data.missions["dwell"]),
        sections=list(_sections(data)), finals=list(_finals(data)),
        differences=[(case.title, rows) for case in data.cases if (rows := _differences(data, case))],
        hindsight=list(_hindsight(data)), runs=len(data.campaign.runs),
    )  # fmt: skip


def _experiments(data: CampaignData) -> Iterator[Row]:
    everything = missions(data.campaign)
    titles = dict(zip(data.missions["field"], data.missions["field_title"], strict=True))
    for experiment in data.campaign.experiments:
        mine = [mission.settings for mission in everything if experiment.name in mission.experiments]
        yield Row(
            title=experiment.title or experiment.name, description=experiment.description,
            fields=", ".join(str(titles.get(name, name)) for name in dict.fromkeys(s.field for s in mine)),
            strategies=", ".join(strategy_text(name) for name in dict.fromkeys(str(s.strategy) for s in mine)),
            dwells=", ".join(dwell_text(name) for name in dict.fromkeys(str(s.dwell) for s in mine)),
            hours=", ".join(f"{value:g}" for value in dict.fromkeys(s.hours for s in mine)),
            runs=str(len(data.campaign.runs)), missions=len(mine),
        )  # fmt: skip


def _common_settings(data: CampaignData) -> list[tuple[str, str]]:
    """Common settings of all missions."""
    names = (
        *FIT_SETTINGS, "preset", "travel", "cell_m", "footprint_m", "position_sd_m", "weather",
    )  # fmt: skip
    table = data.missions
    shared = [(name, table[name].iloc[0]) for name in names if table[name].nunique(dropna=False) == 1]
    return [(name, _setting(value)) for name, value in shared]


def _setting(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return "the field's own" if value is None or value != value else plain(value)


def _sections(data: CampaignData) -> Iterator[Row]:
    """Charts with their texts in the order strategies, intervals."""
    for case in data.strategy_cases:
        yield Row(
            key=f"strategies-{case.number}", title=f"{case.title}: strategies",
            charts=list(figures.strategies_charts(data, case)),
            caption=f"Lines: mean over {_runs(data.final(case))}; bands: one standard deviation to both sides, "
            f"cut at the lowest run. Interval: {dwell_text(data.main_dwell(case))}. The error axis is "
            "logarithmic; multiply by 100 for (counts/10 s)².",
        )  # fmt: skip
    for case in data.cases:
        if figures.interval_strategies(data, case):
            rows = data.missions[data.missions["case"] == case.number]
            optimal = " Optimal: it counts as long as the strategy plans, or 60 s."
            yield Row(
                key=f"intervals-{case.number}", title=f"{case.title}: fixed and adaptive counting interval",
                charts=list(figures.intervals_charts(data, case)),
                caption="FMI: the robot counts for a fixed time. AMI: it counts until the relative standard error "
                f"of the counts falls to a threshold.{optimal * ('optimal' in set(rows['dwell']))} Mean over "
                f"{_runs(rows)}, bands of one standard deviation, logarithmic axis.",
            )  # fmt: skip


def _runs(rows: pd.DataFrame) -> str:
    count = int(rows["seed"].nunique())
    return f"{count} runs" if count != 1 else "one run"


def _finals(data: CampaignData) -> Iterator[Row]:
    """Rows of the table, field by field."""
    for case in data.cases:
        groups = data.groups(case)
        for position, (strategy, dwell, rows) in enumerate(groups):
            values = (
                mean_sd_text(rows["mse"]), mean_sd_text(100 * rows["mse"]), mean_sd_text(100 * rows["vwc_rmse"]),
                mean_sd_text(100 * rows["coverage95"], max_decimals=0),
                mean_sd_text(rows["distance_m"], max_decimals=0), mean_sd_text(rows["samples"], max_decimals=1),
                mean_sd_text(100 * rows["counting_share"], max_decimals=0),
            )  # fmt: skip
            first = len(groups) if position == 0 else 0
            last = position == len(groups) - 1
            yield Row(
                field=case.title, field_rows=first, last=last, strategy=strategy_text(strategy),
                dwell=dwell_text(dwell), runs=len(rows), values=values,
            )  # fmt: skip


def _differences(data: CampaignData, case: Case) -> list[Row]:
    """Pairs of combinations with at least two shared seeds: error at the end, and distance."""
    found = data.differences(case)
    several = len({one[name] for one in found for name in ("dwell", "other_dwell")}) > 1

    def name(strategy: str, dwell: str) -> str:
        return f"{strategy_text(strategy)}, {dwell_text(dwell)}" if several else strategy_text(strategy)

    rows: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
    for one in found:
        names = name(one["strategy"], one["dwell"]), name(one["other_strategy"], one["other_dwell"])
        rows.setdefault(names, {})[one["quantity"]] = one
    return [
        Row(
            first=first, second=second, pairs=by["mse"]["pairs"],
            error=_interval(by["mse"]), distance=_interval(by["distance_m"], max_decimals=0),
        )
        for (first, second), by in rows.items()
        if by.keys() >= {"mse", "distance_m"} and by["mse"]["pairs"] > 1
    ]  # fmt: skip


def _interval(one: dict[str, Any], max_decimals: int = 6) -> Row:
    """Difference and its interval, rounded to the second digit of half the interval; its share of the second."""
    reach = (one["high"] - one["low"]) / 2
    decimals = int(np.clip(1 - np.floor(np.log10(reach)), 0, max_decimals)) if reach > 0 else max_decimals
    difference, low, high = (
        f"{one[key]:+.{decimals}f}".replace("-", "−") for key in ("difference", "low", "high")
    )
    share = 100 * one["difference"] / one["other_mean"] if one["other_mean"] else float("nan")
    return Row(
        text=f"{difference} ({low} to {high})", clear=one["low"] > 0 or one["high"] < 0,
        share=f"{share:+.0f} %".replace("-", "−") if np.isfinite(share) else "–",
    )  # fmt: skip


def _hindsight(data: CampaignData) -> Iterator[Row]:
    """Fields with lattices from which hindsight chooses."""
    for case in data.cases:
        table = data.hindsight[data.hindsight["case"] == case.number]
        if table.empty:
            continue
        first = table.iloc[0]
        driven = " ".join(length(first["end_best_distance_m"]))
        best = (
            f"best lattice in hindsight: {dwell_text(first['end_best'])}, {number(first['end_best_mse'])} "
            f"(counts/s)², {driven}; at a quarter of the time: {dwell_text(first['quarter_best'])}"
        )
        rows = tuple(
            Row(
                strategy=strategy_text(row["strategy"]), dwell=dwell_text(row["dwell"]), pairs=row["pairs"],
                end=_ratio(row["end_ratio"], row["end_ratio_se"]), distance=f"{row['distance_ratio']:.2f}",
                quarter=_ratio(row["quarter_ratio"], row["quarter_ratio_se"]),
            )
            for row in table.to_dict("records")
            if (row["strategy"], row["dwell"]) not in LATTICES
        )  # fmt: skip
        yield Row(title=case.title, best=best, rows=rows)


def _ratio(value: float, error: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.2f} ± {error:.2f}" if np.isfinite(error) else f"{value:.2f}"


def mean_sd_text(values: pd.Series, max_decimals: int = 6) -> str:
    """Mean ± standard deviation, rounded at most to the deviation's second digit; a dash without values."""
    known = values.dropna().to_numpy(float)
    if not len(known):
        return "–"
    mean, sd = float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else float("nan")
    if not sd > 0:
        return number(mean)
    decimals = int(np.clip(1 - np.floor(np.log10(sd)), 0, max_decimals))
    return f"{mean:.{decimals}f} ± {sd:.{decimals}f}".replace("-", "−")
