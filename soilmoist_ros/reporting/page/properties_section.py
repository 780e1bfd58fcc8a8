"""Report section of several properties: the maps of each, and all of them side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.geometry import map_extent, rings
from soilmoist_ros.reporting.page import maps
from soilmoist_ros.reporting.page.numbers import percent
from soilmoist_ros.reporting.page.section import Section
from soilmoist_ros.reporting.page.statistics import INTERVAL_SD, truth_score
from soilmoist_ros.reporting.page.style import (
    FAINT,
    INK,
    NORMAL,
    SMALL,
    SOFT,
    extension,
    new_figure,
    picture,
    robust_range,
)
from soilmoist_ros.reporting.run import MapRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

WIDTH_IN, COLUMNS = 10.0, 4
LEFT_IN, GAP_IN, TOP_IN, BAR_IN = 0.35, 0.18, 0.32, 0.72
TALLEST = 1.4
TOO_LOW, INSIDE, TOO_HIGH = "#e08214", "#eef1f4", "#8073ac"
"""Colours of cells whose true rate is above, in and below the 95 % interval, as on the error map."""


def property_sections(run: MapRun) -> list[Section]:
    """Map and uncertainty of each property after the first."""
    return [section for other in run.others for section in _sections(other)]


def _sections(run: MapRun) -> Iterator[Section]:
    name = run.label or run.name
    if run.calibrated:
        yield Section(
            f"{run.name}-vwc", f"{name}: soil water content",
            picture(maps.band_map(run, maps.VWC), f"Map of the soil water content of {name}"),
            "Dark blue is wet, pale is dry. White dots are the places that were measured.",
        )  # fmt: skip
    yield Section(
        f"{run.name}-rate", f"{name}: count rate",
        picture(maps.band_map(run, maps.RATE), f"Map of the count rate of {name}"),
        f"The count rate of {name}, from its own sensor.",
    )  # fmt: skip
    yield Section(
        f"{run.name}-rate-sd", f"{name}: uncertainty",
        picture(maps.band_map(run, maps.RATE_SD), f"Map of the standard deviation of the count rate of {name}"),
        "One standard deviation of the true rate, given all counts.",
    )  # fmt: skip


def side_by_side(run: MapRun) -> Section | None:
    """All properties in rows of small maps; ``None`` if there is only one property."""
    runs = run.properties
    if len(runs) < 2:
        return None
    shown = "map of the rate and its standard deviation"
    if any(one.truth_rate is not None for one in runs):
        shown = "true rate, map, error, and where the truth lies in the 95 % interval of the map"
    return Section(
        "properties", "All properties",
        picture(small_multiples(runs), f"All properties in rows of small maps: {shown}"),
        f"One row for each property: {shown}. Truth and map have the same colours; error is map minus truth.",
    )  # fmt: skip


@dataclass(frozen=True)
class _Panel:
    """One small map with a colour bar, or with a text in place of the bar."""

    title: str
    values: Array
    limits: tuple[float, float]
    colours: Any = None


def small_multiples(runs: Sequence[MapRun]) -> Figure:
    """A row of small maps for each run: rate and standard deviation, or truth, rate and errors if known."""
    rows = [_panels(run) for run in runs]
    width = (WIDTH_IN - LEFT_IN) / COLUMNS - GAP_IN
    heights = [width * min(_tallness(run), TALLEST) for run in runs]
    total = sum(heights) + len(rows) * (TOP_IN + BAR_IN)
    figure = new_figure(WIDTH_IN, total)
    top = total
    for run, row, height in zip(runs, rows, heights, strict=True):
        bottom = top - TOP_IN - height
        x = LEFT_IN / figure.get_figwidth() / 2
        figure.text(x, (bottom + height / 2) / total, run.label or run.field_name, rotation=90, ha="center",
                    va="center", fontsize=SMALL, color=INK, fontweight="bold", wrap=True)  # fmt: skip
        for column, panel in enumerate(row):
            left = LEFT_IN + column * (width + GAP_IN)
            _draw(figure, run, panel, (left, bottom, width, height))
        top = bottom - BAR_IN
    return figure


def _tallness(run: MapRun) -> float:
    west, east, south, north = map_extent(run.soil_map)
    return (north - south) / (east - west)


def _panels(run: MapRun) -> list[_Panel]:
    soil_map = run.soil_map
    inside = np.asarray(soil_map.grid.mask, bool)
    rate, rate_sd = (np.where(inside, band, np.nan) for band in (soil_map.rate, soil_map.rate_sd))
    limits = maps.colour_range(run, maps.RATE)
    rates = maps.colours(maps.RATE.colours)
    of_map = _Panel("Map of the rate", rate, limits, rates)
    if run.truth_rate is None:
        sd_limits = maps.colour_range(run, maps.RATE_SD)
        return [of_map, _Panel("Standard deviation", rate_sd, sd_limits, maps.colours(maps.RATE_SD.colours))]
    error = rate - np.asarray(run.truth_rate, float)
    most = robust_range(np.abs(error))[1]
    outside = np.where(np.abs(error) > INTERVAL_SD * rate_sd, np.sign(error), 0.0)
    return [
        _Panel("True rate", np.where(inside, run.truth_rate, np.nan), limits, rates),
        of_map,
        _Panel("Error (map minus truth)", error, (-most, most), "PuOr"),
        _Panel("Truth in the 95 % interval", np.where(np.isfinite(error), outside, np.nan), (-1.5, 1.5)),
    ]


def _draw(figure: Figure, run: MapRun, panel: _Panel, box_in: tuple[float, float, float, float]) -> None:
    """Draw a panel at left, bottom, width, height [in], with its colour bar or legend below."""
    from matplotlib.colors import ListedColormap

    scale = np.array([figure.get_figwidth(), figure.get_figheight()] * 2)
    axes = figure.add_axes(tuple((np.array(box_in) / scale).tolist()))
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(panel.title, fontsize=NORMAL, color=INK, loc="left")
    for spine in axes.spines.values():
        spine.set_visible(False)
    low, high = panel.limits
    colours = panel.colours or ListedColormap([TOO_LOW, INSIDE, TOO_HIGH])
    image = axes.imshow(
        panel.values, origin="lower", extent=map_extent(run.soil_map), cmap=colours, vmin=low, vmax=high,
        interpolation="nearest", aspect="equal",
    )  # fmt: skip
    for ring in rings(run.soil_map):
        axes.plot(*ring.T, color=INK, linewidth=0.9)
    if panel.colours is None:
        _key(axes, run)
        return
    left, bottom, width, _ = box_in
    bar_box = np.array([left + 0.05 * width, bottom - 0.2, 0.9 * width, 0.1]) / scale
    bar = figure.colorbar(image, cax=figure.add_axes(tuple(bar_box.tolist())), orientation="horizontal",
                          extend=extension(panel.values, low, high), extendfrac=0.04)  # fmt: skip
    bar.ax.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=2, width=0.8, pad=2)
    bar.ax.locator_params(nbins=4)
    bar.outline.set(edgecolor=FAINT, linewidth=0.8)
    bar.set_label("counts/s", fontsize=SMALL, color=INK, labelpad=1)


def _key(axes: Axes, run: MapRun) -> None:
    """Draw the legend of the interval's colours."""
    from matplotlib.patches import Patch

    score = truth_score(run.soil_map, np.asarray(run.truth_rate, float))
    handles = [
        Patch(facecolor=INSIDE, edgecolor=SOFT, label=f"inside: {percent(score.coverage95)}"),
        Patch(facecolor=TOO_HIGH, label="map too high"),
        Patch(facecolor=TOO_LOW, label="map too low"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.01), borderaxespad=0.2, ncols=2,
                fontsize=SMALL, frameon=False, labelcolor=INK, handlelength=1.0, columnspacing=0.9)  # fmt: skip
