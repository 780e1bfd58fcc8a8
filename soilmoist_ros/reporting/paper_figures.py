# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures for publications, as SVG and PDF with embedded fonts in the widths of journal columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, calibration_of
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
from soilmoist_ros.reporting.moisture_steps import at_one_place, interrupted, moisture_series
from soilmoist_ros.reporting.page.variogram_charts import mean_spread, model_curve, sample_variogram
from soilmoist_ros.reporting.season import Season
from soilmoist_ros.simulation import MissionResult

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
MAPS_ACROSS = 4
"""Maps of a season side by side."""
DAY_S = 86_400.0
MOISTURE, RATE_TITLE = "Soil moisture [m³/m³]", "Neutron rate [counts/s]"
MOISTURE_SD, RATE_SD = "Standard deviation [m³/m³]", "Standard deviation [counts/s]"
EAST, NORTH = "East [m]", "North [m]"
_VECTOR: Final[dict[str, Any]] = {
    "pdf.fonttype": 42,  # TrueType, embedded: journals refuse Type 3
    "svg.fonttype": "path",  # needs no fonts of the reader
    "font.size": SIZE,
}
_DATE: Final = {"svg": "Date", "pdf": "CreationDate"}
"""Metadata that would make the same figures differ."""


def write_figures(out: Path, figures: Iterable[tuple[str, Figure]], formats: Iterable[str]) -> list[Path]:
    """Write figures to the folder ``figures``; those of an earlier run are removed.

    :param out: output folder
    :param figures: names and figures; made only if there is a format
    :param formats: of :data:`FORMATS`; none writes nothing
    :returns: the files
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
    """Names and figures of a run; those of further properties end with the property.

    :raises InputError: without matplotlib
    """
    if at_one_place(run):
        yield "moisture", _moisture_figure(run)
        return
    for number, one in enumerate(run.properties):
        end = f"_{one.name}" if number else ""
        soil_map = one.soil_map
        vwc = one.calibrated
        values = (soil_map.vwc, soil_map.vwc_sd) if vwc else (soil_map.rate, soil_map.rate_sd)
        guessed = f", {ILLUSTRATIVE}]" if calibration_of(one) == ILLUSTRATIVE else "]"
        titles = (MOISTURE.replace("]", guessed), MOISTURE_SD) if vwc else (RATE_TITLE, RATE_SD)
        yield f"map{end}", _raster_figure(one, values[0], titles[0], WATER if vwc else RATE)
        yield f"sd{end}", _raster_figure(one, values[1], titles[1], UNCERTAIN)
        yield from _variogram_figure(one, end)
    yield "track", _track_figure(run)
    if run.mission is not None and any(np.isfinite(row.mse) for row in run.mission.series):
        yield "errors", _errors_figure(run.mission)


def _raster_figure(run: MapRun, values: Array, title: str, colours: str) -> Figure:
    """A raster with the boundary of the field and the samples."""
    soil_map = run.soil_map
    figure, axes = _column_figure(_height_share(run))
    image = _raster(axes, values, map_extent(soil_map), colours, robust_range(values))
    _boundary(run, axes)
    xy = soil_map.samples.xy
    axes.plot(xy[:, 0], xy[:, 1], ".", color=INK, markersize=2.5, markeredgewidth=0)
    _colour_bar(figure, image, axes, values, title, shrink=0.9, pad=0.02)
    return figure


def _track_figure(run: MapRun) -> Figure:
    """The ways of the robots, and their stops: the area of a disc is the time there."""
    figure, axes = _column_figure(_height_share(run))
    _boundary(run, axes)
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


def _variogram_figure(run: MapRun, end: str) -> Iterator[tuple[str, Figure]]:
    """Semivariance of the samples, the interval that they should lie in, and the model."""
    soil_map = run.soil_map
    found = sample_variogram(soil_map)
    for number, classes in enumerate(found):
        figure, axes = _column_figure(0.75)
        h = np.linspace(1e-4, 1.04 * float(classes.lag_m.max()), 150)
        used = model_curve(soil_map.variogram, h, classes.angle_deg, mean_spread(soil_map))
        name = "9 in 10 under the model"
        axes.fill_between(classes.lag_m, classes.low, classes.high, color=FAINT, linewidth=0, label=name)
        axes.plot(h, used, color=BLUE, linewidth=1.2, label=f"model ({soil_map.variogram.model})")
        size = 10 + 20 * np.sqrt(classes.pairs / max(classes.pairs.max(), 1))
        axes.scatter(classes.lag_m, classes.gamma, s=size, color=INK, linewidths=0, label="samples", zorder=3)
        _caption(axes, "Distance [m]", "Semivariance [(counts/s)²]")
        axes.set_xlim(0, h[-1])
        axes.set_ylim(bottom=min(0.0, 1.1 * float(classes.gamma.min())))
        _key(axes)
        yield f"variogram{end}{f'_{number + 1}' if number else ''}", figure


def _errors_figure(mission: MissionResult) -> Figure:
    """Error of the map, and coverage of its intervals, against time; where the truth is known."""
    rows = [row for row in mission.series if np.isfinite(row.mse)]
    hours = np.array([row.time_s / 3600 for row in rows])
    figure, axes = _column_figure(0.75)
    root = np.sqrt([row.mse for row in rows])
    axes.step(hours, root, where="post", color=BLUE, linewidth=1.2)
    axes.set_ylim(bottom=0)
    _caption(axes, "Mission time [h]", "Root mean squared error [counts/s]")
    axes.yaxis.label.set_color(BLUE)
    other = axes.twinx()
    other.step(hours, [100 * row.coverage95 for row in rows], where="post", color=ORANGE, linewidth=1.0)
    other.axhline(95, color=ORANGE, linewidth=0.6, linestyle=":")
    other.set_ylim(0, 102)
    other.set_ylabel("Coverage of the 95 % interval [%]", fontsize=SIZE, color=ORANGE)
    other.tick_params(labelsize=SIZE - 1, colors=SOFT, labelcolor=INK, length=3)
    other.spines[["top", "left", "bottom"]].set_visible(False)
    other.spines["right"].set_color(SOFT)
    return figure


def _moisture_figure(run: MapRun) -> Figure:
    """Moisture, or rate, at one place over time."""
    series = moisture_series(run.track, run.soil_map.curve)
    bands = series.bands
    time_s, low, vwc, high, rate = interrupted(
        series.begin_s, 1.5 * series.step_s, bands.vwc_p05, bands.vwc, bands.vwc_p95, bands.rate
    )
    days = (time_s + series.step_s / 2 - time_s[0]) / DAY_S
    figure, axes = _column_figure(0.6)
    if run.calibrated:
        axes.fill_between(days, low, high, color=FAINT, linewidth=0, label="90 %")
        axes.plot(days, vwc, color=BLUE, linewidth=1.0, label="soil moisture")
        _caption(axes, "Time [d]", MOISTURE)
        _key(axes)
    else:
        axes.plot(days, rate, color=BLUE, linewidth=1.0)
        _caption(axes, "Time [d]", RATE_TITLE)
    return figure


def _boundary(run: MapRun, axes: Axes) -> None:
    for ring in rings(run.soil_map):
        axes.plot(*ring.T, color=SOFT, linewidth=0.8)
    axes.set_aspect("equal")
    _caption(axes, EAST, NORTH)


def _height_share(run: MapRun) -> float:
    """Height of a map figure for the shape of the field, within what fits on a page."""
    west, east, south, north = map_extent(run.soil_map)
    return float(np.clip(0.72 * (north - south) / (east - west) + 0.18, 0.45, 1.6))


def season_figures(season: Season) -> Iterator[tuple[str, Figure]]:
    """Names and figures of a season.

    :raises InputError: without matplotlib
    """
    moisture = season.curve is not None
    title = MOISTURE if moisture else RATE_TITLE
    estimates = [one.mean_vwc or one.mean_rate for one in season.surveys]
    values = np.array([one.value for one in estimates])
    low, high = np.array([one.interval95 for one in estimates]).T
    figure, axes = _column_figure(0.6)
    axes.errorbar(
        season.days, values, np.vstack([values - low, high - values]), fmt="o-", color=BLUE, markersize=3.5,
        linewidth=1.0, capsize=2, elinewidth=0.8,
    )  # fmt: skip
    _caption(axes, "Time since the first survey [d]", f"Mean {title[0].lower()}{title[1:]}")
    yield "season", figure
    yield "maps", _maps_figure(season, title)


def _maps_figure(season: Season, title: str) -> Figure:
    """The map of each survey, with one scale of colours."""
    moisture, x, y, half = season.curve is not None, season.grid.x_m, season.grid.y_m, season.grid.cell_m / 2
    maps = [one.bands.vwc if moisture else one.bands.rate for one in season.surveys]
    limits = robust_range(np.stack(maps))
    extent = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    columns = min(MAPS_ACROSS, len(maps))
    rows = -(-len(maps) // columns)
    share = (y[-1] - y[0] + 2 * half) / (x[-1] - x[0] + 2 * half)
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
    _colour_bar(figure, image, panels, np.stack(maps), title, shrink=0.8, pad=0.01)
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
    """The scale of colours of images; its ends are pointed where values lie beyond.

    :param axes: the axes that it stands next to
    :param values: all that the images show
    """
    bar = figure.colorbar(image, ax=axes, extend=extension(values, *image.get_clim()), **layout)
    bar.set_label(title, fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE - 1)


def _key(axes: Axes) -> None:
    """A key without a frame above the axes, where it hides nothing."""
    axes.legend(
        fontsize=SIZE - 1, frameon=False, handlelength=1.6, loc="lower left", bbox_to_anchor=(0, 1), ncols=2,
        borderaxespad=0.2, columnspacing=1.2,
    )  # fmt: skip
