"""Maps in true proportions: one band of the raster, or the samples on the track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.geometry import map_extent, rings, track_xy
from soilmoist_ros.reporting.page.style import FAINT, INK, NORMAL, SMALL, SOFT, extension, new_figure, robust_range
from soilmoist_ros.reporting.run import MapRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE_IN, NARROW_IN = 7.4, 5.3
RIGHT_IN, TOP_IN, BOTTOM_IN = 1.25, 0.22, 0.95
SHORTEST, SLIMMEST, TALLEST = 0.6, 0.45, 1.2
KILOMETRES_FROM_M = 5000.0
FEW_SAMPLES, MANY_SAMPLES = 60, 400
UNDEFINED = "#c9c9c9"


@dataclass(frozen=True)
class Band:
    """How one band is drawn.

    :param values: attribute of the map
    :param label: text at the colour bar, with its unit
    :param colours: matplotlib colour map; light for low, dark for high values
    :param scale: factor from the map's unit to the displayed unit
    """

    values: str
    label: str
    colours: str
    scale: float = 1.0


VWC = Band("vwc", "Soil water content [% by volume]", "YlGnBu", 100.0)
VWC_SD = Band("vwc_sd", "Standard deviation [% by volume]", "Purples", 100.0)
RATE = Band("rate", "Corrected count rate [counts/s]", "YlOrBr")
RATE_SD = Band("rate_sd", "Standard deviation [counts/s]", "Purples")


def band_map(
    run: MapRun, band: Band, values: NDArray[np.float64] | None = None, width_in: float = NARROW_IN
) -> Figure:
    """One band with the field's boundary, the samples and a colour bar.

    :param values: values to draw instead of the map's band, in the band's unit and colours, shape (ny, nx)
    :param width_in: width of the figure [in]
    """
    soil_map = run.soil_map
    shown = band.scale * np.asarray(getattr(soil_map, band.values) if values is None else values, float)
    shown = np.where(soil_map.grid.mask, shown, np.nan)
    figure, axes, unit_m = map_axes(run, width_in)
    _paint_undefined(run, axes, shown, unit_m)
    low, high = colour_range(run, band)
    west, east, south, north = (edge / unit_m for edge in map_extent(soil_map))
    image = axes.imshow(
        shown, origin="lower", extent=(west, east, south, north), cmap=colours(band.colours),
        vmin=low, vmax=high, interpolation="nearest", aspect="equal",
    )  # fmt: skip
    draw_boundary(run, axes, unit_m)
    _sample_places(run, axes, unit_m)
    _colour_bar(figure, axes, image, band.label, extension(shown, low, high))
    return figure


def error_map(run: MapRun, width_in: float = NARROW_IN) -> Figure:
    """Error of the rate map, estimate minus truth; white is no error.

    :raises ValueError: without a truth
    """
    if run.truth_rate is None:
        raise ValueError("an error map needs a truth")
    soil_map = run.soil_map
    shown = np.where(soil_map.grid.mask, soil_map.rate - np.asarray(run.truth_rate, float), np.nan)
    figure, axes, unit_m = map_axes(run, width_in)
    _paint_undefined(run, axes, shown, unit_m)
    most = robust_range(np.abs(shown))[1]
    west, east, south, north = (edge / unit_m for edge in map_extent(soil_map))
    image = axes.imshow(
        shown, origin="lower", extent=(west, east, south, north), cmap="PuOr", vmin=-most, vmax=most,
        interpolation="nearest", aspect="equal",
    )  # fmt: skip
    draw_boundary(run, axes, unit_m)
    _sample_places(run, axes, unit_m)
    _colour_bar(figure, axes, image, "Map minus truth [counts/s]", extension(shown, -most, most))
    return figure


def colour_range(run: MapRun, band: Band) -> tuple[float, float]:
    """Colour limits of a band in the displayed unit: the middle 95 % of its values, with a minimum range.

    The limits of values are at least one typical standard deviation from their middle, so that noise does not
    look like a pattern. The lower limit of a standard deviation is at most half its upper limit. Moisture stops
    at 100 %: near the pole of the calibration curve a few cells would use up all colours.
    """
    values = np.asarray(getattr(run.soil_map, band.values), float)
    low, high = robust_range(band.scale * (np.clip(values, -1, 1) if band.values.startswith("vwc") else values))
    if band.values.endswith("_sd"):
        return min(low, high / 2), high
    sd = band.scale * np.asarray(getattr(run.soil_map, f"{band.values}_sd"), float)
    low, high = _widened(low, high, sd)
    return low, min(high, band.scale) if band.values == "vwc" else high


def _widened(low: float, high: float, sd: NDArray[np.float64]) -> tuple[float, float]:
    """Limits at least one median standard deviation from their middle."""
    typical = float(np.median(sd[np.isfinite(sd)])) if np.isfinite(sd).any() else 0.0
    spread = max((high - low) / 2, min(typical, abs(high)))
    return (low + high) / 2 - spread, (low + high) / 2 + spread


def samples_map(run: MapRun, width_in: float = NARROW_IN) -> Figure:
    """The track and the samples; colour shows the observed rate, size the effective exposure."""
    samples = run.soil_map.samples
    xy, rate = np.asarray(samples.xy, float), np.asarray(samples.rate_cps, float)
    exposure = np.asarray(samples.exposure_s, float)
    figure, axes, unit_m = map_axes(run, width_in)
    draw_boundary(run, axes, unit_m)
    for track in run.tracks_xy:
        axes.plot(*track.T / unit_m, color=SOFT, linewidth=0.8, alpha=0.6, zorder=2)
    low, high = _widened(*robust_range(rate), np.asarray(samples.rate_sd_cps, float))
    largest = 110.0 if len(xy) <= FEW_SAMPLES else 32.0 if len(xy) <= MANY_SAMPLES else 12.0
    sizes = np.maximum(largest * exposure / exposure.max(), 5.0)
    marks = axes.scatter(
        xy[:, 0] / unit_m, xy[:, 1] / unit_m, c=rate, s=sizes, cmap=colours(RATE.colours), vmin=low, vmax=high,
        edgecolors=INK, linewidths=0.5 if len(xy) <= FEW_SAMPLES else 0.2, zorder=3,
    )  # fmt: skip
    _colour_bar(figure, axes, marks, "Rate of each sample [counts/s]", extension(rate, low, high))
    return figure


def colours(name: str) -> Any:
    """A sequential colour map without its palest end, which is invisible on white paper."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(name, colormaps[name](np.linspace(0.06, 0.97, 256)))


def map_axes(run: MapRun, width_in: float) -> tuple[Figure, Axes, float]:
    """A figure, axes in the map's true proportions, and the metres per axis unit."""
    west, east, south, north = view(run)
    unit_m = 1000.0 if max(east - west, north - south) >= KILOMETRES_FROM_M else 1.0
    left_in = 0.5 + 0.075 * max(len(f"{edge / unit_m:.0f}") for edge in (south, north))
    room = width_in - left_in - RIGHT_IN
    height = room * (north - south) / (east - west)
    width = room
    tallest = TALLEST * room
    if height > tallest:
        width, height = room * tallest / height, tallest
    total = height + TOP_IN + BOTTOM_IN
    figure = new_figure(width_in, total)
    left = left_in + (room - width) / 2
    axes = figure.add_axes((left / width_in, BOTTOM_IN / total, width / width_in, height / total))
    axes.set(xlim=(west / unit_m, east / unit_m), ylim=(south / unit_m, north / unit_m), aspect="equal")
    _decorate(run, figure, axes, unit_m)
    return figure, axes, unit_m


def view(run: MapRun) -> tuple[float, float, float, float]:
    """West, east, south, north [m] of the field, the samples and the track, with a margin.

    Very long or tall shapes get a wider margin across, so that the figure stays readable.
    """
    west, east, south, north = map_extent(run.soil_map)
    points = np.vstack([[(west, south), (east, north)], run.soil_map.samples.xy, track_xy(run.track)])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * float(max(high - low))
    low, high = low - margin, high + margin
    width, height = high - low
    grow = np.array([max(SLIMMEST * height - width, 0.0), max(SHORTEST * width - height, 0.0)]) / 2
    (west, south), (east, north) = low - grow, high + grow
    return float(west), float(east), float(south), float(north)


def _decorate(run: MapRun, figure: Figure, axes: Axes, unit_m: float) -> None:
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], min_n_ticks=3))
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    for spine in axes.spines.values():
        spine.set(color=FAINT, linewidth=0.8)
    unit = "km" if unit_m > 1 else "m"
    axes.set_xlabel(f"East of the datum [{unit}]", fontsize=NORMAL, color=INK)
    axes.set_ylabel(f"North of the datum [{unit}]", fontsize=NORMAL, color=INK)
    figure.text(
        0.03 / figure.get_figwidth(), 0.12 / figure.get_figheight(), datum_text(run), fontsize=SMALL, color=SOFT
    )
    _north_and_scale(figure, axes, unit_m)


def datum_text(run: MapRun) -> str:
    """Position of the axes' origin."""
    lat, lon = run.frame.latitude_deg, run.frame.longitude_deg
    north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"Datum (0, 0): {abs(lat):.6f}° {north}, {abs(lon):.6f}° {east} (WGS-84)"


def _north_and_scale(figure: Figure, axes: Axes, unit_m: float) -> None:
    """A north arrow and a scale bar in the margin below the map, on the right."""
    from matplotlib.lines import Line2D

    box = axes.get_position()
    inch_x, inch_y = 1 / figure.get_figwidth(), 1 / figure.get_figheight()
    span_m = float(np.diff(axes.get_xlim())[0]) * unit_m
    length_m = _round_down(span_m / 5)
    length = box.width * length_m / span_m
    right, y = 1 - RIGHT_IN * inch_x, 0.17 * inch_y
    ends, level = [right - length, right], y - 0.02 * inch_y
    bar = Line2D(ends, [level, level], color=INK, linewidth=2.0, solid_capstyle="butt")
    bar.set_transform(figure.transFigure)
    figure.add_artist(bar)
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    figure.text(right - length / 2, y + 0.05 * inch_y, text, ha="center", fontsize=SMALL, color=INK)
    x = right + 0.25 * inch_x
    arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate(
        "", (x, y + 0.28 * inch_y), (x, y - 0.06 * inch_y), "figure fraction", "figure fraction", arrowprops=arrow
    )
    figure.text(x + 0.09 * inch_x, y + 0.03 * inch_y, "N", fontsize=NORMAL, color=INK, fontweight="bold")


def _round_down(value: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def draw_boundary(run: MapRun, axes: Axes, unit_m: float) -> None:
    """The field's boundary and its holes."""
    for ring in rings(run.soil_map):
        axes.plot(*(ring.T / unit_m), color=INK, linewidth=1.1, zorder=2.5)


def _sample_places(run: MapRun, axes: Axes, unit_m: float) -> None:
    xy = np.asarray(run.soil_map.samples.xy, float) / unit_m
    size, line = (16.0, 0.6) if len(xy) <= FEW_SAMPLES else (5.0, 0.35) if len(xy) <= MANY_SAMPLES else (1.5, 0.2)
    axes.scatter(xy[:, 0], xy[:, 1], s=size, facecolors="white", edgecolors=INK, linewidths=line, zorder=3)


def _paint_undefined(run: MapRun, axes: Axes, shown: NDArray[np.float64], unit_m: float) -> None:
    """Draw cells of the field without a value in grey, to distinguish them from the outside."""
    missing = np.asarray(run.soil_map.grid.mask, bool) & ~np.isfinite(shown)
    if not missing.any():
        return
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    west, east, south, north = (edge / unit_m for edge in map_extent(run.soil_map))
    axes.imshow(
        np.ma.masked_where(~missing, np.zeros(missing.shape)), origin="lower", extent=(west, east, south, north),
        cmap=ListedColormap([UNDEFINED]), interpolation="nearest", aspect="equal", zorder=0.5,
    )  # fmt: skip
    axes.legend(
        handles=[Patch(facecolor=UNDEFINED, label="not defined")], loc="lower right",
        bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, fontsize=SMALL, frameon=False, labelcolor=INK,
    )  # fmt: skip


def _colour_bar(figure: Figure, axes: Axes, image: Any, text: str, extend: str) -> None:
    from matplotlib.ticker import MaxNLocator

    box = axes.get_position()
    inch = 1 / figure.get_figwidth()
    bar_axes = figure.add_axes((box.x1 + 0.15 * inch, box.y0, 0.16 * inch, box.height))
    bar = figure.colorbar(image, cax=bar_axes, extend=extend, extendfrac=0.035)
    height_in = box.height * figure.get_figheight()
    bar.ax.yaxis.set_major_locator(MaxNLocator(max(3, min(7, round(height_in / 0.55))), steps=[1, 2, 2.5, 5, 10]))
    bar.ax.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    bar.outline.set(edgecolor=FAINT, linewidth=0.8)
    text = text if height_in > 2.8 else text.replace(" [", "\n[")
    bar.set_label(text, fontsize=NORMAL if height_in > 2.8 else SMALL, color=INK)
