# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Charts of a survey: distribution, rate and factors over time, cross-validation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.pipeline import EARLIEST_STAMP_S, MapRun
from soilmoist_ros.reporting.moisture_steps import MoistureSeries, interrupted
from soilmoist_ros.reporting.page.charts.chart import Area, Chart, Dots, Limits, Line, limits_of
from soilmoist_ros.reporting.page.numbers import duration, number, percent
from soilmoist_ros.reporting.page.statistics import LeaveOneOut
from soilmoist_ros.sensing import CountRecord

Array = NDArray[np.float64]

MAX_BINS = 240
MAX_POINTS = 1500
MAX_STEPS = 10
"""Longest step of a line, in usual ones; longer ones are gaps."""
TIME_STEPS_S = (10, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400)


def histogram_chart(run: MapRun) -> Chart:
    """Histograms of the rate: cells of the map and samples."""
    soil_map = run.soil_map
    rate = soil_map.rate[soil_map.grid.mask & np.isfinite(soil_map.rate)]
    sampled = np.asarray(soil_map.samples.rate_cps, float)
    x = limits_of(rate, sampled, margin=0.02)
    edges = np.linspace(*x, 26)
    of_map, of_samples = (100 * np.histogram(v, edges)[0] / max(len(v), 1) for v in (rate, sampled))
    steps = np.repeat(edges, 2)[1:-1]
    return Chart(
        "histogram", "Distribution", "Histograms of the count rate of the map and of the samples",
        [
            Area(steps, np.zeros(len(steps)), np.repeat(of_map, 2), "line", "cells of the map"),
            Line(steps, np.repeat(of_samples, 2), "ink", "samples, counting noise included", width_px=1.5),
        ],
        x, (0.0, 1.08 * float(max(of_map.max(), of_samples.max()))), "Corrected neutron count rate [counts/s]",
        "Share [%]",
        "The samples carry counting noise and stand only where the sensor was; the map is smoother and covers the "
        "field.",
    )  # fmt: skip


def rate_chart(track: Sequence[CountRecord]) -> Chart:
    """Corrected rate over time; the band is one standard deviation of the counting noise."""
    time, counts, exposure, width_s = binned(track)
    rate, sd = counts / exposure, np.sqrt(np.maximum(counts, 1)) / exposure
    time, rate, sd = _without_gaps(time, rate, sd)
    name = "each record" if not width_s else f"records added up over {duration(width_s)}"
    x, ticks, label = time_axis(time)
    return Chart(
        "rate-series", "Rate over time", "Corrected count rate over time",
        [Area(time, rate - sd, rate + sd, "line", "± 1 sd of counting"), Line(time, rate, "line", name)],
        x, limits_of(rate - sd, rate + sd), label, "Corrected rate [counts/s]",
        "Changes beyond the band are real: other soil below the sensor, or a fault.", x_ticks=ticks,
    )  # fmt: skip


def moisture_chart(series: MoistureSeries) -> Chart:
    """Soil moisture of one place over time; the band is the 90 % interval."""
    bands = (100 * values for values in (series.bands.vwc_p05, series.bands.vwc, series.bands.vwc_p95))
    middle_s, low, vwc, high = interrupted(series.begin_s + series.step_s / 2, 1.5 * series.step_s, *bands)
    x, ticks, label = time_axis(middle_s)
    name = f"mean of {duration(series.step_s)}"
    return Chart(
        "moisture-series", "Soil moisture over time", "Soil moisture over time with its 90 % interval",
        [Area(middle_s, low, high, "line", "90 % interval"), Line(middle_s, vwc, "line", name)],
        x, limits_of(low, high), label, "Soil moisture [% by volume]",
        "Records added up in steps of time. The band holds the true moisture nine times in ten; the uncertainty "
        "of the calibration, where it is known, shifts all values together.", x_ticks=ticks,
    )  # fmt: skip


def _without_gaps(time_s: Array, *values: Array) -> tuple[Array, ...]:
    """Times and values, interrupted where a step is much longer than usual."""
    steps_s = np.diff(time_s)
    return interrupted(time_s, MAX_STEPS * float(np.median(steps_s)) if len(steps_s) else 0.0, *values)


def factor_chart(track: Sequence[CountRecord]) -> Chart:
    """The correction factors over time."""
    shown = track[:: max(1, -(-len(track) // MAX_POINTS))]
    factors = (
        np.array([getattr(record, name) for record in shown])
        for name in ("f_pressure", "f_humidity", "f_intensity")
    )
    time, pressure, humidity, intensity = _without_gaps(np.array([record.stamp_s for record in shown]), *factors)
    product = pressure * humidity * intensity
    low, high = limits_of(pressure, humidity, intensity, product)
    away = max(0.005 - (high - low) / 2, 0.0)
    x, ticks, label = time_axis(time)
    return Chart(
        "factors", "Correction factors over time", "Correction factors over time",
        [
            Line(time, product, "ink", "product", width_px=2.5),
            Line(time, pressure, "line", "pressure"),
            Line(time, humidity, "green", "humidity"),
            Line(time, intensity, "purple", "incoming neutrons", dashed=True),
        ],
        x, (low - away, high + away), label, "Correction factor [-]",
        "The factors that the raw counts are multiplied with.", x_ticks=ticks,
    )  # fmt: skip


def cross_validation_chart(loo: LeaveOneOut) -> Chart:
    """Observed rates against leave-one-out predictions, with one standard deviation of the difference."""
    ends = limits_of(loo.observed - loo.sd, loo.observed + loo.sd, loo.predicted, margin=0.03)
    few = len(loo.observed) <= 120
    return Chart(
        "validation", "Cross-validation", "Observed against predicted rate of each sample",
        [
            Line(ends, ends, "soft", "prediction = observation", width_px=1.2),
            Dots(loo.predicted, loo.observed, "line", "samples" + (", ± 1 sd" if few else ""),
                 6 if few else 4, error=loo.sd if few else None),
        ],
        ends, ends, "Predicted without the sample [counts/s]", "Observed [counts/s]",
        f"Each sample predicted from all others. {percent(loo.coverage95)} of the {len(loo.observed)} samples lie "
        f"in their 95 % interval; errors are {loo.standardised_sd:.2f} times as large as stated (1 is right); "
        f"root mean square error {number(loo.rmse)} counts/s, counting noise included.",
        340,
    )  # fmt: skip


def binned(track: Sequence[CountRecord]) -> tuple[Array, Array, Array, float]:
    """Time [s], counts and effective exposure [s] of the records, and the bin width [s].

    Few records are returned one by one (width 0). Many are summed in bins of equal length, which is exact for
    counts. A bin without records is NaN and interrupts the line.
    """
    time = np.array([r.stamp_s for r in track])
    counts = np.array([r.raw_counts for r in track], float)
    exposure = np.array([r.effective_exposure_s for r in track])
    if len(track) <= MAX_BINS:
        return time, counts, exposure, 0.0
    span = float(np.ptp(time)) / MAX_BINS
    width = float(next((step for step in TIME_STEPS_S if step >= span), 86400 * math.ceil(span / 86400)))
    index = ((time - time.min()) // width).astype(int)
    total = np.bincount(index, exposure).astype(float)
    total[total == 0] = np.nan
    middle = np.asarray(time.min() + width * (np.arange(len(total)) + 0.5), float)
    return middle, np.bincount(index, counts).astype(float), total, width


def time_axis(time_s: ArrayLike) -> tuple[Limits, list[tuple[float, str]], str]:
    """Limits, labels and name of an axis of stamps: clock times, or minutes where the clock has no date."""
    time = np.asarray(time_s, float)
    low, high = float(time.min()), float(time.max())
    span = high - low or 1.0
    step = next((s for s in TIME_STEPS_S if span / s <= 6), 86400 * math.ceil(span / 6 / 86400))
    values = [step * i for i in range(math.ceil(low / step), math.floor(high / step) + 1)]
    if low < EARLIEST_STAMP_S:
        return (low, low + span), [(v, f"{v / 60:g}") for v in values], "Time [min]"
    days = step >= 86400
    first, last = (datetime.fromtimestamp(v, UTC) for v in (low, high))
    form = "%H:%M" if not days else "%d %b" if first.year == last.year else "%Y-%m-%d"
    ticks = [(float(v), f"{datetime.fromtimestamp(v, UTC):{form}}") for v in values]
    name = f"Time (UTC), from {first.day} {first:%B %Y}"
    if days:
        name = f"Day of {first:%Y}" if first.year == last.year else "Day"
    return (low, low + span), ticks, name
