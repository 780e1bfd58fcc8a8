# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures for publications, as SVG and PDF with embedded fonts in the widths of journal columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import calibration_of, guess_text
from soilmoist_ros.reporting.colours import (
    BLUE,
    FAINT,
    INK,
    ORANGE,
    RATE,
    SOFT,
    UNCERTAIN,
    WATER,
    colour_ramp,
    robust_range,
)
from soilmoist_ros.reporting.geometry import map_extent, rings
from soilmoist_ros.reporting.moisture_steps import at_one_place, moisture_series
from soilmoist_ros.reporting.page.charts import Area, Chart, Line, moisture_chart, rate_chart
from soilmoist_ros.reporting.page.report import course_charts
from soilmoist_ros.reporting.page.variogram_charts import variogram_charts
from soilmoist_ros.reporting.season import Season
from soilmoist_ros.reporting.season_outputs import mean_chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

Array = NDArray[np.float64]

FORMATS: Final = ("svg", "pdf")
FOLDER: Final = "figures"
"""Folder of the figures in an output folder."""
COLUMN_IN, TEXT_IN = 84 / 25.4, 174 / 25.4
"""Width of a column and of the text of a journal page [in]: 84 and 174 mm."""
SIZE: Final = 8.0
"""Size of the text [pt]."""
WIDE_NAME, WIDEST_NAME = 25, 38
"""Letters of a name in a key up to which two stand side by side, and that fit into a column."""
MAPS_ACROSS = 4
"""Maps of a season side by side."""
COLOURS: Final = {
    "line": BLUE,
    "orange": ORANGE,
    "ink": INK,
    "soft": SOFT,
    "purple": "#7a3f7a",
    "green": "#00704f",
}
"""Colours of the marks of a chart."""
MOISTURE, RATE_TITLE = "Soil moisture [m³/m³]", "Neutron rate [counts/s]"
MOISTURE_SD, RATE_SD = "Standard deviation [m³/m³]", "Standard deviation [counts/s]"
EAST, NORTH = "East [m]", "North [m]"
_VECTOR: Final[dict[str, Any]] = {
    "pdf.fonttype": 42,  # TrueType, embedded: journals refuse Type 3
    "svg.fonttype": "path",  # needs no fonts of the reader
    "font.size": SIZE,
}
_DATE: Final = {"svg": "Date", "pdf": "CreationDate"}
"""Metadata key of the creation date by format; left out, so that equal figures are equal files."""


def write_figures(out: Path, figures: Iterable[tuple[str, Figure]], formats: Iterable[str]) -> list[Path]:
    """Write figures to the folder ``figures``, and remove figures of an earlier run.

    :param formats: of :data:`FORMATS`; none writes nothing
    :raises InputError: if the folder cannot be written, or matplotlib is missing
    """
    folder, chosen = out / FOLDER, list(dict.fromkeys(formats))
    try:
        for path in [path for ending in FORMATS for path in folder.glob(f"*.{ending}")]:
            path.unlink()
        if not chosen:
            return []
        matplotlib = optional_module("matplotlib", "reports")
        folder.mkdir(parents=True, exist_ok=True)
        written = []
        with matplotlib.rc_context(_VECTOR):
            for name, figure in figures:
                for ending in chosen:
                    path = folder / f"{name}.{ending}"
                    figure.savefig(path, format=ending, metadata={_DATE[ending]: None})
                    written.append(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    return written


def run_figures(run: MapRun) -> Iterator[tuple[str, Figure]]:
    """Names and figures of a run; names for further properties end with the property.

    :raises InputError: without matplotlib
    """
    if at_one_place(run):
        series = moisture_chart(moisture_series(run.track, run.soil_map.curve)) if run.calibrated else None
        yield "moisture", _chart_figure(series or rate_chart(run.track))
        return
    for number, one in enumerate(run.properties):
        end = f"_{one.name}" if number else ""
        soil_map = one.soil_map
        guessed = f"{guess_text(calibration_of(one))}]"
        if one.calibrated:
            yield f"map{end}", _raster_figure(one, soil_map.vwc, MOISTURE.replace("]", guessed), WATER)
            yield f"sd{end}", _raster_figure(one, soil_map.vwc_sd, MOISTURE_SD, UNCERTAIN)
        else:
            yield f"map{end}", _raster_figure(one, soil_map.rate, RATE_TITLE, RATE)
            yield f"sd{end}", _raster_figure(one, soil_map.rate_sd, RATE_SD, UNCERTAIN)
        for chart, _ in variogram_charts(one):
            yield f"{chart.key.replace('-', '_')}{end}", _chart_figure(chart)
    yield "track", _track_figure(run)
    if run.mission is not None:
        for chart in course_charts(run.mission):
            yield chart.key.replace("-", "_"), _chart_figure(chart)


def _chart_figure(chart: Chart) -> Figure:
    """A chart of the report, drawn by matplotlib."""
    figure, axes = _column_figure(0.75)
    for mark in chart.marks:
        colour, x = COLOURS[mark.colour], np.asarray(mark.x, float)
        name = textwrap.fill(mark.name.removesuffix(" (pairs: above)"), WIDEST_NAME)  # that axis is the report's
        look: dict[str, Any] = {"color": colour, "label": name or None}
        if isinstance(mark, Line):
            axes.plot(x, mark.y, linestyle="--" if mark.dashed else "-", linewidth=mark.width_px / 2, **look)
        elif isinstance(mark, Area):
            axes.fill_between(x, mark.low, mark.high, alpha=0.22, linewidth=0, **look)
        else:
            axes.scatter(x, mark.y, s=(0.6 * np.asarray(mark.size_px, float)) ** 2, linewidths=0, zorder=3, **look)
            if mark.error is not None:
                axes.errorbar(x, mark.y, mark.error, fmt="none", ecolor=FAINT, elinewidth=0.8)
    axes.set(xlim=chart.x, ylim=chart.y)
    for axis, (low, high), ticks in ((axes.xaxis, chart.x, chart.x_ticks), (axes.yaxis, chart.y, chart.y_ticks)):
        if ticks is not None:
            inside = [one for one in ticks if low <= one[0] <= high]
            axis.set_ticks([value for value, _ in inside], [text for _, text in inside])
    _caption(axes, chart.x_label, textwrap.fill(chart.y_label, 36))
    if chart.names:
        _key(axes)
    return figure


def _raster_figure(run: MapRun, values: Array, title: str, colours: str) -> Figure:
    """A raster with the boundary of the field and the samples."""
    soil_map = run.soil_map
    figure, axes = _map_axes(run)
    image = _raster(axes, values, map_extent(soil_map), colours, robust_range(values))
    xy = soil_map.samples.xy
    axes.plot(xy[:, 0], xy[:, 1], ".", color=INK, markersize=2.5, markeredgewidth=0)
    _colour_bar(figure, image, axes, values, title, shrink=0.9, pad=0.02)
    return figure


def _track_figure(run: MapRun) -> Figure:
    """The ways of the robots, and their stops: the area of a disc is the time there."""
    figure, axes = _map_axes(run)
    several = len(run.tracks_xy) > 1
    for number, xy in enumerate(run.tracks_xy, 1):
        name = f"way of robot {number}" if several else "way"
        axes.plot(xy[:, 0], xy[:, 1], linewidth=0.7, color=BLUE if number == 1 else None, label=name)
    visits = [] if run.mission is None else run.mission.visits
    if visits:
        dwell = np.array([max(visit.dwell_s, 1.0) for visit in visits])
        east, north = np.array([(visit.x_m, visit.y_m) for visit in visits]).T
        area = 60 * dwell / dwell.max()
        name = f"stops (largest: {dwell.max():.0f} s)"
        axes.scatter(east, north, s=area, color=ORANGE, alpha=0.75, linewidths=0, label=name, zorder=3)
    else:
        xy = run.soil_map.samples.xy
        axes.plot(*xy.T, ".", color=ORANGE, markersize=3, label="samples", zorder=3)
    _key(axes)
    return figure


def _map_axes(run: MapRun) -> tuple[Figure, Axes]:
    """A figure with the boundary of the field, as high as its shape needs, within what fits on a page."""
    west, east, south, north = map_extent(run.soil_map)
    figure, axes = _column_figure(float(np.clip(0.72 * (north - south) / (east - west) + 0.18, 0.45, 1.6)))
    for ring in rings(run.soil_map):
        axes.plot(*ring.T, color=SOFT, linewidth=0.8)
    axes.set_aspect("equal")
    _caption(axes, EAST, NORTH)
    return figure, axes


def season_figures(season: Season) -> Iterator[tuple[str, Figure]]:
    """Names and figures of a season.

    :raises InputError: without matplotlib
    """
    yield "season", _chart_figure(mean_chart(season))
    yield "maps", _maps_figure(season)


def _maps_figure(season: Season) -> Figure:
    """The map of each survey, with one scale of colours."""
    moisture, x, y, half = season.curve is not None, season.grid.x_m, season.grid.y_m, season.grid.cell_m / 2
    maps = np.stack([one.bands.vwc if moisture else one.bands.rate for one in season.surveys])
    limits, extent = robust_range(maps), (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    columns = min(MAPS_ACROSS, len(maps))
    rows, share = -(-len(maps) // columns), (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure = _vector_figure(TEXT_IN, rows * (share * 0.88 * TEXT_IN / columns + 0.45))
    panels = []
    for number, (values, label) in enumerate(zip(maps, season.labels, strict=True), 1):
        axes = plain_axes(figure.add_subplot(rows, columns, number))
        image = _raster(axes, values, extent, WATER if moisture else RATE, limits)
        axes.set_title(label, fontsize=SIZE, loc="left")
        bottom, left = number > len(maps) - columns, (number - 1) % columns == 0
        _caption(axes, EAST if bottom else "", NORTH if left else "")
        axes.spines[["left", "bottom"]].set_color(SOFT)
        panels.append(axes)
    _colour_bar(figure, image, panels, maps, MOISTURE if moisture else RATE_TITLE, shrink=0.8, pad=0.01)
    return figure


def _column_figure(height_share: float) -> tuple[Figure, Axes]:
    """A figure of the width of a column with plain axes; its height is a share of the width."""
    figure = _vector_figure(COLUMN_IN, height_share * COLUMN_IN)
    return figure, plain_axes(figure.add_subplot())


def _vector_figure(width_in: float, height_in: float) -> Figure:
    made: Figure = optional_module("matplotlib.figure", "reports").Figure(
        figsize=(width_in, height_in), facecolor="white", layout="constrained"
    )
    return made


def plain_axes(axes: Axes) -> Axes:
    """Axes without the upper and right spines, and with light ticks."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK, length=3, width=0.8)
    return axes


def _caption(axes: Axes, x: str, y: str) -> None:
    """Names of both axes, and the size of all text."""
    axes.set_xlabel(x, fontsize=SIZE)
    axes.set_ylabel(y, fontsize=SIZE)
    axes.tick_params(labelsize=SIZE - 1)


def _raster(
    axes: Axes, values: Array, extent: tuple[float, ...], colours: str, limits: tuple[float, float]
) -> Any:
    """Cells stay cells: without interpolation the file has one pixel for each."""
    west, east, south, north = extent
    return axes.imshow(
        values, origin="lower", extent=(west, east, south, north), vmin=limits[0], vmax=limits[1],
        cmap=colour_map(colours), interpolation="none",
    )  # fmt: skip


def colour_map(name: str) -> Any:
    """The colours of :func:`.colour_ramp`, as matplotlib takes them."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colour_ramp(name, 256) / 255, name)


def extension(values: ArrayLike, low: float, high: float) -> str:
    """The ends of a colour bar that need an arrow, as matplotlib's ``extend``."""
    below, above = bool(np.nanmin(values, initial=low) < low), bool(np.nanmax(values, initial=high) > high)
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]


def _colour_bar(
    figure: Figure, image: AxesImage, axes: Axes | list[Axes], values: Array, title: str, **layout: Any
) -> None:
    """The scale of colours of images; its ends are pointed where values lie beyond."""
    bar = figure.colorbar(image, ax=axes, extend=extension(values, *image.get_clim()), **layout)
    bar.set_label(title, fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE - 1)


def _key(axes: Axes) -> None:
    """A key without a frame above the axes, where it hides nothing."""
    names = axes.get_legend_handles_labels()[1]
    axes.legend(
        fontsize=SIZE - 1, frameon=False, handlelength=1.6, loc="lower left", bbox_to_anchor=(0, 1),
        ncols=1 if max(map(len, names)) > WIDE_NAME else 2, borderaxespad=0.2, columnspacing=1.2,
    )  # fmt: skip
