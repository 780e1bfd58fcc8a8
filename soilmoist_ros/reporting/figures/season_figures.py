# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of a season: the mean of each survey with its interval, and the maps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from soilmoist_ros.reporting.colours import RATE, WATER
from soilmoist_ros.reporting.figures.style import (
    MOISTURE,
    RATE_TITLE,
    SIZE,
    TEXT_IN,
    caption_axes,
    colour_bar,
    column_figure,
    vector_figure,
)
from soilmoist_ros.reporting.page.style import BLUE, SOFT, colour_map, plain, robust_range
from soilmoist_ros.reporting.season.season import Season

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 4
"""Maps side by side."""


def season_figures(season: Season) -> Iterator[tuple[str, Figure]]:
    """Names and figures of a season.

    :raises InputError: without matplotlib
    """
    moisture = season.curve is not None
    title = MOISTURE if moisture else RATE_TITLE
    estimates = [one.mean_vwc or one.mean_rate for one in season.surveys]
    values = np.array([one.value for one in estimates])
    low, high = np.array([one.interval95 for one in estimates]).T
    figure, axes = column_figure(0.6)
    axes.errorbar(
        season.days, values, np.vstack([values - low, high - values]), fmt="o-", color=BLUE, markersize=3.5,
        linewidth=1.0, capsize=2, elinewidth=0.8,
    )  # fmt: skip
    caption_axes(axes, "Time since the first survey [d]", f"Mean {title[0].lower()}{title[1:]}")
    yield "season", figure
    yield "maps", _maps_figure(season, title)


def _maps_figure(season: Season, title: str) -> Figure:
    """The map of each survey, with one scale of colours."""
    moisture, x, y, half = season.curve is not None, season.grid.x_m, season.grid.y_m, season.grid.cell_m / 2
    maps = [one.bands.vwc if moisture else one.bands.rate for one in season.surveys]
    low, high = robust_range(np.stack(maps))
    columns = min(COLUMNS, len(maps))
    rows = -(-len(maps) // columns)
    share = (y[-1] - y[0] + 2 * half) / (x[-1] - x[0] + 2 * half)
    figure = vector_figure(TEXT_IN, rows * (share * 0.88 * TEXT_IN / columns + 0.45))
    panels = []
    for number, (values, label) in enumerate(zip(maps, season.labels, strict=True), 1):
        axes = plain(figure.add_subplot(rows, columns, number))
        image = axes.imshow(
            values, origin="lower", extent=(x[0] - half, x[-1] + half, y[0] - half, y[-1] + half),
            cmap=colour_map(WATER if moisture else RATE), vmin=low, vmax=high, interpolation="none",
        )  # fmt: skip
        axes.set_title(label, fontsize=SIZE, loc="left")
        bottom, left = number > len(maps) - columns, (number - 1) % columns == 0
        caption_axes(axes, "East [m]" if bottom else "", "North [m]" if left else "")
        axes.spines[["left", "bottom"]].set_color(SOFT)
        panels.append(axes)
    colour_bar(figure, image, panels, np.stack(maps), title, shrink=0.8, pad=0.01)
    return figure
