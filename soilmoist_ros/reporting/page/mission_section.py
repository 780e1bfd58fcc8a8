# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Report section of the mission: its course over time and its stops."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from soilmoist_ros.exploration import Visit, polyline_length_m
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.page.charts.chart import Chart, Dots, Line, limits_of
from soilmoist_ros.reporting.page.charts.forecast_chart import forecast_chart
from soilmoist_ros.reporting.page.labels import dwell_text, strategy_text
from soilmoist_ros.reporting.page.numbers import duration, length, number, percent
from soilmoist_ros.simulation import MissionResult, SeriesRow, forecast_text, mission_efficiency, series_columns

MAX_VISITS = 100
MAX_LINES = 1000


@dataclass(frozen=True)
class MissionPart:
    """The content of the section.

    :param text: the course of the mission in sentences
    :param charts: its course over time
    :param visits: the first stops
    :param hidden: number of stops missing from the table
    :param several: whether there are several robots
    :param log: lines of the mission log: what happened when, and what operators did
    """

    text: str
    charts: tuple[Chart, ...]
    visits: tuple[Visit, ...]
    hidden: int
    several: bool = False
    log: tuple[str, ...] = ()


def mission_part(run: MapRun) -> MissionPart | None:
    """The section; ``None`` without a mission."""
    mission = run.mission
    if mission is None:
        return None
    has_truth = bool(np.isfinite(mission.truth_rate).any())
    charts = tuple(course_charts(mission.series, has_truth)) if mission.series else ()
    if (forecasts := forecast_chart(mission.forecasts, 3600 * mission.settings.hours)) is not None:
        charts = (*charts, forecasts)
    shown = tuple(mission.visits[:MAX_VISITS])
    hidden = len(mission.visits) - len(shown)
    several = len(mission.tracks) > 1
    return MissionPart(_text(mission), charts, shown, hidden, several, tuple(mission.log[:MAX_LINES]))


def _text(mission: MissionResult) -> str:
    settings, named, sentences = mission.settings, mission.settings.as_dict(), []
    sentences.append(
        f"Strategy {strategy_text(named['strategy'])}, dwell rule {dwell_text(named['dwell'])}, "
        f"{settings.hours:g} h, seed {settings.seed}: {len(mission.visits)} measurements"
    )
    if mission.series:
        end = mission.series[-1]
        value, unit = length(end.distance_m)
        sentences[0] += f" in {duration(end.time_s)} and on {value} {unit}"
        if end.time_s > 0:
            share = end.counting_s / (end.time_s * settings.robots)
            sentences[0] += f", {percent(share)} of the time spent counting"
        if settings.robots > 1:
            ways = [polyline_length_m(track) for track in mission.tracks]
            each = ", ".join(" ".join(length(way_m)) for way_m in ways)
            sentences.append(f"There were {settings.robots} robots, which drove {each}")
        if np.isfinite(end.mse):
            sentences.append(
                f"At the end the map has a mean squared error of {number(end.mse)} (counts/s)², which is "
                f"{number(end.mse_10s)} (counts/10 s)²"
            )
            if np.isfinite(end.vwc_rmse):
                sentences[-1] += f", and a root mean squared error of {number(100 * end.vwc_rmse, 2)} % by volume"
            sentences[-1] += f"; the truth lies in the 95 % interval on {percent(end.coverage95)} of the field"
    for index, mapped in enumerate(mission.properties[1:], start=1):
        planned = f"planned for with the weight {mapped.weight:g}" if mapped.weight else "not planned for"
        sentences.append(f"A further property ({mapped.title}) was mapped, {planned}")
        if mission.series and np.isfinite((errors := mission.series[-1].errors[index]).mse):
            sentences[-1] += (
                f": its map has a mean squared error of {number(errors.mse)} (counts/s)², and the truth lies in "
                f"the 95 % interval on {percent(errors.coverage95)} of the field"
            )
    if (plan := mission_efficiency(mission)) is not None:
        sentences.append(
            f"Its efficiency is {percent(plan.reached)}: no division of the time among all places, even without "
            "driving, leaves less than this share of the mean variance that its samples leave"
        )
        if plan.of_truth:
            sentences[-1] += " (with the variogram of the truth, so that missions on this field can be compared)"
        else:
            sentences[-1] += " (with the variogram of this map: not comparable with other missions)"
    if forecast := forecast_text(mission.forecasts, 3600 * settings.hours):
        sentences.append(f"Standard deviation of the map: {forecast}")
    if mission.ended:
        sentences.append(f"The mission ended: {mission.ended.rstrip('.')}")
    return ". ".join(sentences) + "."


def course_charts(series: Sequence[SeriesRow], has_truth: bool = True) -> Iterator[Chart]:
    """Error, coverage and distance against time; without a truth, only the distance."""
    columns = series_columns(series, [""])
    hours = columns["time_s"] / 3600
    x = (0.0, max(float(hours[-1]), 1e-9))
    known = columns["mse"][np.isfinite(columns["mse"]) & (columns["mse"] > 0)]
    if has_truth and len(known):
        logarithm = np.log10(np.where(columns["mse"] > 0, columns["mse"], np.nan))
        low, high = math.floor(np.log10(known.min())), math.ceil(np.log10(known.max()) + 1e-9)
        steps = (1, 2, 5) if high - low <= 2 else (1,)
        ticks = [(e + math.log10(m), f"{m * 10.0**e:.6g}") for e in range(low, high + 1) for m in steps]
        yield Chart(
            "course-error", "Error of the map", "Mean squared error of the rate map against mission time",
            [Line(hours, logarithm)], x, (float(low), float(high)), "Mission time [h]",
            "Mean squared error [(counts/s)²], logarithmic",
            "Mean squared error of the rate map; multiply by 100 for (counts/10 s)².", y_ticks=ticks,
        )  # fmt: skip
        coverage = 100 * columns["coverage95"]
        yield Chart(
            "course-coverage", "Coverage", "Coverage of the 95 % intervals against mission time",
            [Line(x, (95, 95), "orange", "95 %, as stated", dashed=True), Line(hours, coverage, name="reached")],
            x, (min(50.0, float(np.nanmin(coverage, initial=100.0)) - 5), 102.0), "Mission time [h]",
            "Coverage [%]",
            "Share of the field whose true rate lies in the 95 % interval of the map.",
        )  # fmt: skip
    distance, finished = columns["distance_m"], hours[1:][np.diff(columns["samples"]) > 0]
    yield Chart(
        "course-distance", "Distance", "Distance driven against mission time",
        [Line(hours, distance), Dots(finished, np.interp(finished, hours, distance), "ink", "stop finished", 4.0)],
        x, limits_of(distance, zero=True), "Mission time [h]", "Distance [m]",
    )  # fmt: skip
