"""Report section of the mission: its course over time and its stops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.travel.travel import polyline_length_m
from soilmoist_ros.reporting.geometry import map_extent
from soilmoist_ros.reporting.page import maps
from soilmoist_ros.reporting.page.labels import dwell_text, strategy_text
from soilmoist_ros.reporting.page.numbers import duration, length, number, percent
from soilmoist_ros.reporting.page.section import Section
from soilmoist_ros.reporting.page.style import (
    BLUE,
    GOLD,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SMALL,
    label,
    new_figure,
    picture,
    plain,
)
from soilmoist_ros.reporting.run import MapRun
from soilmoist_ros.simulation.mission.efficiency import mission_efficiency
from soilmoist_ros.simulation.mission.result import MissionResult, SeriesRow, series_columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
MAX_VISITS = 100
MAX_NUMBERS = 80
MAX_LINES = 1000
ROBOTS = {"blue": BLUE, "orange": ORANGE, "green": GREEN, "purple": PURPLE, "gold": GOLD, "black": INK}
"""Colours of the robots in order; further robots repeat them from the first."""


@dataclass(frozen=True)
class MissionPart:
    """The content of the section.

    :param text: the course of the mission in sentences
    :param sections: figures
    :param visits: the first stops
    :param hidden: number of stops missing from the table
    :param several: whether there are several robots
    :param log: lines of the mission log: what happened when, and what operators did
    """

    text: str
    sections: tuple[Section, ...]
    visits: tuple[Visit, ...]
    hidden: int
    several: bool = False
    log: tuple[str, ...] = ()


def mission_part(run: MapRun) -> MissionPart | None:
    """The section; ``None`` without a mission."""
    mission = run.mission
    if mission is None:
        return None
    sections = [
        Section(
            "trajectory", "Path and stops",
            picture(trajectory_map(run), "Path of the robot with its stops numbered in order"),
            "The robot's path over the map of the rate. Stops are numbered in order; the square is the start."
            if len(mission.tracks) == 1
            else f"The robots' paths over the map of the rate: {_key(len(mission.tracks))}. Stops are numbered in "
            "the order in which they were finished; the square is the start.",
        )
    ]  # fmt: skip
    if mission.series:
        has_truth = bool(np.isfinite(mission.truth_rate).any())
        shown_values = "Error, coverage and distance" if has_truth else "Distance"
        about = (
            "From above: the mean squared error of the rate map (logarithmic; multiply by 100 for "
            "(counts/10 s)²), the share of the field whose true rate lies in the 95 % interval of the map, "
            "and the distance."
        )
        sections.append(
            Section(
                "course", "The course of the mission",
                picture(course_chart(mission.series, has_truth), f"{shown_values} against mission time", True),
                f"{about if has_truth else 'The distance driven.'} Ticks at the foot: times at which a "
                "measurement was finished.",
            )
        )  # fmt: skip
    shown = tuple(mission.visits[:MAX_VISITS])
    hidden = len(mission.visits) - len(shown)
    several = len(mission.tracks) > 1
    return MissionPart(_text(mission), tuple(sections), shown, hidden, several, tuple(mission.log[:MAX_LINES]))


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
    if mission.ended:
        sentences.append(f"The mission ended: {mission.ended.rstrip('.')}")
    return ". ".join(sentences) + "."


def course_chart(series: Sequence[SeriesRow], has_truth: bool = True) -> Figure:
    """Error, coverage and distance against time, one above the other; without a truth, only the distance."""
    columns = series_columns(series, [""])
    hours, error = columns["time_s"] / 3600, columns["mse"]
    distance, samples, coverage = columns["distance_m"], columns["samples"], columns["coverage95"]
    if not has_truth:
        figure = new_figure(maps.NARROW_IN, 2.2)
        _distance_panel(figure.add_axes((0.155, 0.22, 0.81, 0.7)), hours, distance, samples)
        return figure
    figure = new_figure(maps.NARROW_IN, 5.6)
    axes = [
        figure.add_axes((0.155, bottom, 0.81, high))
        for bottom, high in ((0.57, 0.385), (0.325, 0.18), (0.085, 0.18))
    ]
    for panel, values, y in (
        (axes[0], error, "Mean squared error\n[(counts/s)²]"),
        (axes[1], 100 * coverage, "Coverage [%]"),
    ):
        plain(panel, "y").plot(hours, values, color=BLUE, linewidth=1.8)
        panel.set_xlim(0, max(float(hours[-1]), 1e-9))
        label(panel, "", y)
    _error_axis(axes[0], error)
    axes[1].set_ylim(min(50.0, float(np.nanmin(100 * coverage, initial=100.0)) - 5), 102)
    axes[1].axhline(95, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    axes[1].annotate("95 %, as stated", (0.01, 95), xycoords=("axes fraction", "data"), xytext=(0, -3),
                     textcoords="offset points", ha="left", va="top", fontsize=SMALL, color=INK)  # fmt: skip
    for panel in axes[:2]:
        panel.tick_params(labelbottom=False)
    _distance_panel(axes[2], hours, distance, samples)
    return figure


def _distance_panel(panel: Axes, hours: Array, distance: Array, samples: Array) -> None:
    plain(panel, "y").plot(hours, distance, color=BLUE, linewidth=1.8)
    panel.set_xlim(0, max(float(hours[-1]), 1e-9))
    panel.set_ylim(bottom=0)
    finished = hours[1:][np.diff(samples) > 0]
    panel.plot(finished, np.zeros(len(finished)), "|", color=INK, markersize=7, clip_on=False)
    label(panel, "Mission time [h]", "Distance [m]")


def _colour(robot: int) -> str:
    return list(ROBOTS.values())[(robot - 1) % len(ROBOTS)]


def _key(robots: int) -> str:
    """Draw the legend of the robots' colours."""
    names = list(ROBOTS)
    return ", ".join(f"robot {number + 1} {names[number % len(names)]}" for number in range(robots))


def _error_axis(axes: Axes, error: Array) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    known = error[np.isfinite(error) & (error > 0)]
    if not len(known):
        axes.set_ylim(0, 1)
        axes.annotate("no map, so no error", (0.5, 0.5), xycoords="axes fraction", ha="center", fontsize=SMALL)
        return
    axes.set_yscale("log")
    steps = (1.0, 2.0, 5.0) if known.max() / known.min() < 200 else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def trajectory_map(run: MapRun, width_in: float = maps.NARROW_IN) -> Figure:
    """The robots' paths with numbered stops over a faint map of the rate.

    :raises ValueError: without a mission
    """
    mission, soil_map = run.mission, run.soil_map
    if mission is None:
        raise ValueError("a path needs a mission")
    figure, axes, unit_m = maps.map_axes(run, width_in)
    low, high = maps.colour_range(run, maps.RATE)
    west, east, south, north = (edge / unit_m for edge in map_extent(soil_map))
    axes.imshow(
        np.where(soil_map.grid.mask, soil_map.rate, np.nan), origin="lower", extent=(west, east, south, north),
        cmap=maps.colours(maps.RATE.colours), vmin=low, vmax=high, interpolation="nearest", aspect="equal",
        alpha=0.45,
    )  # fmt: skip
    maps.draw_boundary(run, axes, unit_m)
    several = len(mission.tracks) > 1
    for robot, track in enumerate(mission.tracks, start=1):
        path = np.asarray(track, float).reshape(-1, 2) / unit_m
        colour = _colour(robot) if several else INK
        axes.plot(
            path[:, 0], path[:, 1], color=colour, linewidth=1.4 if several else 0.9, zorder=2.6,
        )  # fmt: skip
        # hollow and on top: a mission often starts at a stop, whose number must stay readable
        for edge, width in (("white", 4.0), (INK, 2.0)):
            axes.scatter(
                path[:1, 0], path[:1, 1], s=200, marker="s", facecolors="none", edgecolors=edge,
                linewidths=width, zorder=6,
            )  # fmt: skip
    numbered = len(mission.visits) <= MAX_NUMBERS
    stops = np.array([(visit.x_m, visit.y_m) for visit in mission.visits]).reshape(-1, 2) / unit_m
    axes.scatter(
        stops[:, 0],
        stops[:, 1],
        s=105 if numbered else 14,
        facecolors="white",
        edgecolors=[_colour(visit.robot) for visit in mission.visits] if several else INK,
        linewidths=1.4 if several else 0.8,
        zorder=4,
    )
    if numbered:
        for order, (x, y) in enumerate(stops.tolist(), start=1):
            axes.text(x, y, str(order), ha="center", va="center_baseline", fontsize=6.5, color=INK, zorder=5)
    return figure
