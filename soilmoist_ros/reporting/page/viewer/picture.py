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
    RATE,
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

WIDTH_IN, SIDE_IN, TOP_IN, BOTTOM_IN = 4.2, 0.1, 0.35, 0.75
TALLEST = 1.3
TEXT_PT = 10.5
"""Size of the text: 12 px where the picture is as wide as a phone."""
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
    hatched = hatch is not None and bool((hatch & run.soil_map.grid.mask).any())
    alt = f"Map{of}: {label[0].lower()}{label[1:]} in {run.field_name or 'the field'}, with the samples"
    if hatched:
        alt += "; hatched where the interval reaches dry or saturated soil"
    return picture(draw(run, values, colours, limits, label, hatch), alt)


def draw(
    run: MapRun, values: Array, colours: str, limits: tuple[float, float], label: str,
    hatch: NDArray[np.bool_] | None = None,
) -> Figure:  # fmt: skip
    """One raster with the field's boundary, the samples and a colour bar.

    :param values: shape (ny, nx), in the unit of the label
    :param hatch: cells to hatch, shape (ny, nx)
    """
    shown = np.where(run.soil_map.grid.mask, values, np.nan)
    figure, axes = _map_axes(run)
    image = axes.imshow(
        shown, origin="lower", extent=map_extent(run.soil_map), cmap=colour_map(colours), vmin=limits[0],
        vmax=limits[1], interpolation="nearest", aspect="equal",
    )  # fmt: skip
    if hatch is not None and (found := hatch & run.soil_map.grid.mask).any():
        x, y = run.soil_map.grid.x_m, run.soil_map.grid.y_m
        if min(found.shape) > 1:
            axes.contourf(x, y, found.astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])
    for ring in rings(run.soil_map):
        axes.plot(*ring.T, color=INK, linewidth=1.1, zorder=2.5)
    xy = np.asarray(run.soil_map.samples.xy, float)
    size = 16.0 if len(xy) <= FEW_SAMPLES else 5.0 if len(xy) <= MANY_SAMPLES else 1.5
    axes.scatter(xy[:, 0], xy[:, 1], s=size, facecolors="white", edgecolors=INK, linewidths=0.4, zorder=3)
    _colour_bar(figure, image, label, extension(shown, *limits))
    return figure


def _map_axes(run: MapRun) -> tuple[Figure, Axes]:
    """A figure and axes in the map's true proportions, with a scale bar and a north arrow above them."""
    west, east, south, north = view(run)
    room = WIDTH_IN - 2 * SIDE_IN
    scale = min(room / (east - west), TALLEST * room / (north - south))
    width, height = scale * (east - west), max(scale * (north - south), 0.2)
    total = height + TOP_IN + BOTTOM_IN
    figure = new_figure(WIDTH_IN, total)
    left = (WIDTH_IN - width) / 2
    axes = figure.add_axes((left / WIDTH_IN, BOTTOM_IN / total, width / WIDTH_IN, height / total))
    axes.set(xlim=(west, east), ylim=(south, north), aspect="equal")
    axes.set_axis_off()
    length_m = round_step((east - west) / 8)
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    above, end = 1 + 0.12 / height, length_m / (east - west)
    axes.plot([0, end], [above, above], color=INK, linewidth=2.5, transform=axes.transAxes, clip_on=False)
    style: dict[str, Any] = {"va": "center", "fontsize": TEXT_PT, "color": INK, "transform": axes.transAxes}
    axes.text(end + 0.03, above, text, **style)
    axes.text(1.0, above, "N ▲", ha="right", **style)
    return figure, axes


def _colour_bar(figure: Figure, image: Any, text: str, extend: Any) -> None:
    total = figure.get_figheight()
    place = (2 * SIDE_IN / WIDTH_IN, 0.52 / total, 1 - 4 * SIDE_IN / WIDTH_IN, 0.14 / total)
    bar = figure.colorbar(
        image, cax=figure.add_axes(place), orientation="horizontal", extend=extend, extendfrac=0.03
    )
    bar.ax.tick_params(colors=SOFT, labelcolor=INK, labelsize=TEXT_PT, length=3, width=0.8)
    bar.outline.set(edgecolor=FAINT, linewidth=0.8)
    bar.ax.locator_params(nbins=6)
    bar.set_label(text, fontsize=TEXT_PT, color=INK, labelpad=1)
