"""Charts behind the map: variogram, histograms, time series, cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.moisture_series import MoistureSeries
from soilmoist_ros.reporting.page.numbers import duration
from soilmoist_ros.reporting.page.statistics import LeaveOneOut
from soilmoist_ros.reporting.page.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    NORMAL,
    ORANGE,
    PURPLE,
    SMALL,
    SOFT,
    label,
    legend,
    new_figure,
    plain,
)
from soilmoist_ros.reporting.run import MapRun
from soilmoist_ros.sensing.records import CountRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN, HEIGHT_IN = 5.3, 3.3
MAX_BINS = 240
DAY_S = 86400.0
MAX_PAIRED_SAMPLES = 3000


def variogram_chart(run: MapRun) -> Figure:
    """Empirical classes (marker area: weight), fitted curve with nugget, sill and range, counting noise."""
    soil_map, variogram = run.soil_map, run.soil_map.variogram
    figure = new_figure(WIDTH_IN, HEIGHT_IN + 0.3)
    axes = plain(figure.add_axes((0.13, 0.135, 0.65, 0.76)))
    lag, gamma, weight = empirical_classes(run)
    reach = _reach(run, lag)
    h = np.concatenate([[reach * 1e-6], np.linspace(0, reach, 300)[1:]])
    axes.plot(h, variogram.semivariance(h), color=BLUE, linewidth=2, label=f"fitted, {variogram.model}", zorder=3)
    if len(lag):
        axes.scatter(
            lag, gamma, s=12 + 120 * weight / weight.max(), facecolors="white", edgecolors=INK,
            linewidths=1.1, label="lag classes (area: weight)", zorder=4,
        )  # fmt: skip
    noise = float(soil_map.mean_rate / np.median(np.asarray(soil_map.samples.exposure_s, float)))
    top = 1.18 * max(float(variogram.sill), float(gamma.max(initial=0.0)), 1e-12)
    bottom = min(0.0, 1.1 * float(gamma.min(initial=0.0)))
    axes.set(xlim=(0, reach), ylim=(bottom, top))
    levels = [(float(variogram.sill), f"sill {variogram.sill:.3g}", BLUE)]
    if variogram.nugget > 0.02 * variogram.sill:
        levels.append((float(variogram.nugget), f"nugget {variogram.nugget:.3g}", BLUE))
    levels.append((noise, f"noise {noise:.3g}", ORANGE))
    _levels(axes, levels, reach, bottom, top)
    reached = variogram.practical_range_m
    if reached <= reach:
        axes.axvline(reached, color=BLUE, linewidth=0.9, linestyle=(0, (4, 3)))
        side, shift = ("right", -4) if reached > reach / 2 else ("left", 4)
        axes.annotate(f"flat beyond {reached:.3g} m", (reached, top), xytext=(shift, -1), va="top", ha=side,
                      textcoords="offset points", fontsize=SMALL, color=BLUE)  # fmt: skip
    label(axes, "Distance between samples [m]", "Semivariance of the rate [(counts/s)²]")
    legend(axes)
    return figure


def empirical_classes(run: MapRun) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lag [m], semivariance [(counts/s)^2] and weight of the distance classes with samples."""
    from soilmoist_ros.mapping import empirical_semivariogram
    from soilmoist_ros.mapping.variogram.semivariogram import default_edges

    samples, fit = run.soil_map.samples, run.soil_map.fit
    empty = np.empty(0)
    if fit is not None and len(fit.lag_m):
        lag, gamma, weight = fit.lag_m, fit.gamma, fit.weight
    elif 2 <= len(np.unique(samples.xy, axis=0)) <= MAX_PAIRED_SAMPLES:
        edges = default_edges(samples.xy)
        lag, gamma, weight = empirical_semivariogram(samples.xy, samples.counts, samples.exposure_s, edges)
    else:
        return empty, empty, empty
    good = np.isfinite(lag) & np.isfinite(gamma) & (weight > 0)
    return lag[good], gamma[good], weight[good]


def _reach(run: MapRun, lag: NDArray[np.float64]) -> float:
    if len(lag):
        return 1.06 * float(lag.max())
    return 1.3 * float(run.soil_map.variogram.practical_range_m)


def _levels(axes: Axes, levels: Sequence[tuple[float, str, str]], reach: float, bottom: float, top: float) -> None:
    """Horizontal levels with names at the right, moved apart; levels above the frame are named at its edge."""
    gap = 0.085 * (top - bottom)
    lowest = bottom
    for value, text, colour in sorted(levels):
        shown = min(value, top)
        if value <= top:
            axes.axhline(value, color=colour, linewidth=0.9, linestyle=(0, (4, 3)))
        else:
            text += " (above)"
        lines = text.count("\n") + 1
        place = max(shown - gap * lines / 2, lowest)
        lowest = place + gap * lines
        axes.annotate(
            text, (1.02, (place + gap * lines / 2 - bottom) / (top - bottom)), xycoords="axes fraction",
            va="center", fontsize=SMALL, color=colour, annotation_clip=False,
        )  # fmt: skip


def histogram_chart(run: MapRun) -> Figure:
    """Histograms: soil moisture of the map if there is one; rates of the map and the samples."""
    soil_map = run.soil_map
    mask = np.asarray(soil_map.grid.mask, bool)
    panels = 2 if run.calibrated else 1
    figure = new_figure(WIDTH_IN, 2.6 * panels)
    axes = [
        figure.add_axes((0.11, 0.09 + 0.5 * (panels - 1 - i), 0.86, 0.35 if panels == 2 else 0.75))
        for i in range(panels)
    ]
    if run.calibrated:
        every = 100 * soil_map.vwc[mask & np.isfinite(soil_map.vwc)]
        vwc = np.clip(every, -100, 100)
        cut = ", cut at 100 %" if np.any(every != vwc) else ""
        plain(axes[0], "y").hist(vwc, bins=_bins(vwc).tolist(), weights=_percent(vwc), color=BLUE)
        label(axes[0], f"Soil water content{cut} [% by volume]", "Share of the field [%]")
    rate = soil_map.rate[mask & np.isfinite(soil_map.rate)]
    sampled = np.asarray(soil_map.samples.rate_cps, float)
    bins = _bins(np.concatenate([rate, sampled])).tolist()
    last = plain(axes[-1], "y")
    last.hist(rate, bins=bins, weights=_percent(rate), color="#d9a25f", label="map cells")
    last.hist(sampled, bins=bins, weights=_percent(sampled), histtype="step", color=INK, linewidth=1.3,
              label="samples, counting noise included")  # fmt: skip
    label(last, "Corrected neutron count rate [counts/s]", "Share [%]")
    legend(last, ncols=2)
    return figure


def _bins(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges of bins of equal width; a few around the value if all values are (nearly) equal."""
    if values.size == 0:
        return np.linspace(0, 1, 11)
    low, high = float(values.min()), float(values.max())
    least = max(abs(low), abs(high), 1e-9) * 1e-3
    if high - low < least:
        low, high = (low + high) / 2 - 5 * least, (low + high) / 2 + 5 * least
    return np.linspace(low, high, 26)


def _percent(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.full(values.shape, 100 / max(values.size, 1))


def rate_chart(track: Sequence[CountRecord]) -> Figure:
    """Corrected rate over time; the band is one standard deviation of the counting noise."""
    from matplotlib.ticker import MaxNLocator

    time, counts, exposure, width_s = binned(track)
    rate, sd = counts / exposure, np.sqrt(np.maximum(counts, 1)) / exposure
    figure = new_figure(WIDTH_IN, HEIGHT_IN - 0.5)
    axes = plain(figure.add_axes((0.12, 0.17, 0.84, 0.7)), "y")
    dates = time / DAY_S
    axes.fill_between(dates, rate - sd, rate + sd, color=BLUE, alpha=0.22, linewidth=0, label="± 1 sd of counting")
    name = "each record" if not width_s else f"records added up over {duration(width_s)}"
    axes.plot(dates, rate, color=BLUE, linewidth=1.1, marker="." if len(rate) < 60 else "", label=name)
    axes.yaxis.set_major_locator(MaxNLocator(6))
    label(axes, "", "Corrected rate [counts/s]")
    _time_axis(axes)
    legend(axes)
    return figure


def moisture_chart(series: MoistureSeries) -> Figure:
    """Soil moisture of one place over time; the band is the 90 % interval."""
    figure = new_figure(WIDTH_IN, HEIGHT_IN - 0.5)
    axes = plain(figure.add_axes((0.12, 0.17, 0.84, 0.7)), "y")
    dates = (series.begin_s + series.step_s / 2) / DAY_S
    low, middle, high = (100 * values for values in (series.bands.vwc_p05, series.bands.vwc, series.bands.vwc_p95))
    axes.fill_between(dates, low, high, color=BLUE, alpha=0.22, linewidth=0, label="90 % interval")
    marker = "." if len(dates) < 60 else ""
    axes.plot(dates, middle, color=BLUE, linewidth=1.1, marker=marker, label=f"mean of {duration(series.step_s)}")
    label(axes, "", "Soil moisture [% by volume]")
    _time_axis(axes)
    legend(axes)
    return figure


def factor_chart(track: Sequence[CountRecord]) -> Figure:
    """The correction factors over time."""
    step = max(1, len(track) // 2000)
    shown = track[::step]
    figure = new_figure(WIDTH_IN, HEIGHT_IN - 0.5)
    axes = plain(figure.add_axes((0.12, 0.17, 0.84, 0.7)), "y")
    dates = np.array([r.stamp_s for r in shown]) / DAY_S
    names = (("pressure", "f_pressure", BLUE, "-"), ("humidity", "f_humidity", GREEN, "-"),
             ("incoming neutrons", "f_intensity", PURPLE, (0, (5, 2))))  # fmt: skip
    for name, attribute, colour, dash in names:
        values = [getattr(r, attribute) for r in shown]
        axes.plot(dates, values, color=colour, linewidth=1.4, linestyle=dash, label=name)
    product = [r.f_pressure * r.f_humidity * r.f_intensity for r in shown]
    axes.plot(dates, product, color=INK, linewidth=2, label="product", zorder=1.5)
    axes.yaxis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]
    low, high = axes.get_ylim()
    if high - low < 0.01:
        axes.set_ylim((low + high) / 2 - 0.005, (low + high) / 2 + 0.005)
    label(axes, "", "Correction factor [-]")
    _time_axis(axes)
    legend(axes)
    return figure


def binned(
    track: Sequence[CountRecord],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Time [s], counts and effective exposure [s] of the records, and the bin width [s].

    Few records are returned one by one (width 0). Many are summed in bins of equal length, which is exact for
    counts. A bin without records is NaN and interrupts the line.
    """
    time = np.array([r.stamp_s for r in track])
    counts = np.array([r.raw_counts for r in track], float)
    exposure = np.array([r.effective_exposure_s for r in track])
    if len(track) <= MAX_BINS:
        return time, counts, exposure, 0.0
    width = _round_up(float(np.ptp(time)) / MAX_BINS)
    index = ((time - time.min()) // width).astype(int)
    total = np.bincount(index, exposure).astype(float)
    total[total == 0] = np.nan
    middle = np.asarray(time.min() + width * (np.arange(len(total)) + 0.5), float)
    return middle, np.bincount(index, counts).astype(float), total, width


def _round_up(seconds: float) -> float:
    nice = (10, 20, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21600, 43200, 86400)
    return float(next((step for step in nice if step >= seconds), 86400 * np.ceil(seconds / 86400)))


def _time_axis(axes: Axes) -> None:
    """Label an axis of days since 1970, matplotlib's unit, with clock times."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=3, maxticks=8, tz="UTC")  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator, tz="UTC"))  # type: ignore[no-untyped-call]
    axes.xaxis.get_offset_text().set(fontsize=SMALL, color=SOFT)
    axes.set_xlabel("Time (UTC)", fontsize=NORMAL, color=INK)


def cross_validation_chart(loo: LeaveOneOut) -> Figure:
    """Observed rates against leave-one-out predictions, with one standard deviation of the difference."""
    figure = new_figure(WIDTH_IN, 0.75 * WIDTH_IN)
    axes = plain(figure.add_axes((0.14, 0.13, 0.82, 0.83)))
    both = np.concatenate([loo.observed - loo.sd, loo.observed + loo.sd, loo.predicted])
    margin = 0.03 * float(np.ptp(both)) or 0.1
    ends = (float(both.min()) - margin, float(both.max()) + margin)
    axes.plot(ends, ends, color=SOFT, linewidth=0.9)
    few = len(loo.observed) <= 120
    axes.errorbar(
        loo.predicted, loo.observed, yerr=loo.sd, fmt="o", markersize=4 if few else 2.5, color=BLUE,
        ecolor=FAINT if few else "none", elinewidth=1, markeredgecolor="white", markeredgewidth=0.4,
    )  # fmt: skip
    axes.set(xlim=ends, ylim=ends, aspect="equal")
    label(axes, "Predicted without the sample [counts/s]", "Observed [counts/s]")
    return figure
