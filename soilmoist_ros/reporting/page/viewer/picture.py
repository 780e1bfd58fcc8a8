"""Pictures of the map for paper and for browsers without scripts, in true proportions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.geometry import map_extent, rings
from soilmoist_ros.reporting.page.charts.chart import round_step
from soilmoist_ros.reporting.page.style import (
    FAINT,
    INK,
    NORMAL,
    RATE,
    SMALL,
    SOFT,
    UNCERTAIN,
    WATER,
    Picture,
    colour_map,
    extension,
    new_figure,
    picture,
)
from soilmoist_ros.reporting.page.viewer.layers import colour_limits, interval_width, moisture_limits, view
from soilmoist_ros.reporting.run import MapRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

WIDTH_IN, LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 6.4, 0.75, 1.25, 0.3, 0.6
TALLEST = 1.2
KILOMETRES_FROM_M = 5000.0
FEW_SAMPLES, MANY_SAMPLES = 60, 400


def pictures(run: MapRun) -> Iterator[Picture]:
    """The map and its uncertainty of each property."""
    for one in run.properties:
        name = f" of {one.label or one.name}" if run.others else ""
        soil_map = one.soil_map
        if one.calibrated:
            vwc = 100 * soil_map.vwc
            label = "Soil moisture [% by volume]"
            yield _picture(one, vwc, WATER, moisture_limits(one), label, name, soil_map.beyond_limits)
            width = interval_width(one)
            limits = (0.0, colour_limits(width)[1])
            yield _picture(one, width, UNCERTAIN, limits, "Width of the 90 % interval [% by volume]", name)
        else:
            limits = colour_limits(soil_map.rate, soil_map.rate_sd)
            yield _picture(one, soil_map.rate, RATE, limits, "Neutron count rate [counts/s]", name)
            limits = (0.0, colour_limits(soil_map.rate_sd)[1])
            yield _picture(one, soil_map.rate_sd, UNCERTAIN, limits, "Standard deviation [counts/s]", name)


def _picture(
    run: MapRun, values: Array, colours: str, limits: tuple[float, float], label: str, of: str,
    hatch: NDArray[np.bool_] | None = None,
) -> Picture:  # fmt: skip
    where = run.field_name or "the field"
    hatched = ", hatched where the interval reaches what the soil cannot hold" if hatch is not None else ""
    figure = draw(run, values, colours, limits, label, hatch)
    return picture(figure, f"Map{of}: {label} in {where}, with the samples{hatched}")


def draw(
    run: MapRun, values: Array, colours: str, limits: tuple[float, float], label: str,
    hatch: NDArray[np.bool_] | None = None,
) -> Figure:  # fmt: skip
    """One raster with the field's boundary, the samples and a colour bar.

    :param values: shape (ny, nx), in the unit of the label
    :param hatch: cells to hatch, shape (ny, nx)
    """
    shown = np.where(run.soil_map.grid.mask, values, np.nan)
    figure, axes, unit_m = _map_axes(run)
    west, east, south, north = (edge / unit_m for edge in map_extent(run.soil_map))
    image = axes.imshow(
        shown, origin="lower", extent=(west, east, south, north), cmap=colour_map(colours), vmin=limits[0],
        vmax=limits[1], interpolation="nearest", aspect="equal",
    )  # fmt: skip
    if hatch is not None and (found := hatch & run.soil_map.grid.mask).any():
        x, y = run.soil_map.grid.x_m / unit_m, run.soil_map.grid.y_m / unit_m
        if min(found.shape) > 1:
            axes.contourf(x, y, found.astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])
    for ring in rings(run.soil_map):
        axes.plot(*(ring.T / unit_m), color=INK, linewidth=1.1, zorder=2.5)
    xy = np.asarray(run.soil_map.samples.xy, float) / unit_m
    size = 16.0 if len(xy) <= FEW_SAMPLES else 5.0 if len(xy) <= MANY_SAMPLES else 1.5
    axes.scatter(xy[:, 0], xy[:, 1], s=size, facecolors="white", edgecolors=INK, linewidths=0.4, zorder=3)
    _colour_bar(figure, axes, image, label, extension(shown, *limits))
    return figure


def _map_axes(run: MapRun) -> tuple[Figure, Axes, float]:
    """A figure, axes in the map's true proportions, and the metres per axis unit."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    west, east, south, north = view(run)
    unit_m = 1000.0 if max(east - west, north - south) >= KILOMETRES_FROM_M else 1.0
    room = WIDTH_IN - LEFT_IN - RIGHT_IN
    scale = min(room / (east - west), TALLEST * room / (north - south))
    width, height = scale * (east - west), max(scale * (north - south), 0.2)
    total = height + TOP_IN + BOTTOM_IN
    figure = new_figure(WIDTH_IN, total)
    place = (LEFT_IN / WIDTH_IN, BOTTOM_IN / total, width / WIDTH_IN, height / total)
    axes = figure.add_axes(place)
    axes.set(xlim=(west / unit_m, east / unit_m), ylim=(south / unit_m, north / unit_m), aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], min_n_ticks=3))
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    unit = "km" if unit_m > 1 else "m"
    axes.set_xlabel(f"East of the datum [{unit}]", fontsize=NORMAL, color=INK)
    axes.set_ylabel(f"North of the datum [{unit}]", fontsize=NORMAL, color=INK)
    length_m = round_step((east - west) / 8)
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    line, above = 1 + 0.08 / height, 1 + 0.13 / height
    ends = [0.0, length_m / (east - west)]
    axes.plot(ends, [line, line], color=INK, linewidth=2.5, transform=axes.transAxes, clip_on=False)
    axes.text(ends[1] + 0.02, line, text, va="center", fontsize=SMALL, color=INK, transform=axes.transAxes)
    axes.text(1.0, above, "N ▲", ha="right", va="center", fontsize=NORMAL, color=INK, transform=axes.transAxes)
    return figure, axes, unit_m


def _colour_bar(figure: Figure, axes: Axes, image: Any, text: str, extend: Any) -> None:
    box = axes.get_position()
    bar_axes = figure.add_axes((box.x1 + 0.15 / WIDTH_IN, box.y0, 0.16 / WIDTH_IN, box.height))
    bar = figure.colorbar(image, cax=bar_axes, extend=extend, extendfrac=0.035)
    bar.ax.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    bar.outline.set(edgecolor=FAINT, linewidth=0.8)
    bar.set_label(text.replace(" [", "\n["), fontsize=SMALL, color=INK)
