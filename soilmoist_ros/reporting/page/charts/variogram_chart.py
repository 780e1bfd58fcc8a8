# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The variogram chart: circles, the interval that they should lie in, and the fitted and the used model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.page.charts.chart import Area, Chart, Dots, Line, Mark
from soilmoist_ros.reporting.page.charts.sample_variogram import (
    Classes,
    fitted_mode,
    mean_spread,
    model_curve,
    sample_variogram,
)
from soilmoist_ros.reporting.page.numbers import number, percent

UNIT = "Semivariance of the rate [(counts/s)²]"


def variogram_charts(run: MapRun) -> Iterator[tuple[Chart, Classes]]:
    """A chart for all directions, or one for each main direction of an anisotropic model, with its numbers."""
    found = sample_variogram(run.soil_map)
    top = 1.08 * max(
        (float(max(c.gamma.max(), np.minimum(c.high, 2 * c.expected).max())) for c in found), default=1.0
    )
    reach = 1.04 * max((float(c.lag_m.max()) for c in found), default=1.0)
    lowest = min((float(c.gamma.min()) for c in found), default=0.0)
    bottom = 0.0 if lowest > 0.03 * top else lowest - 0.05 * top
    for index, classes in enumerate(found):
        yield _chart(run, classes, index, (0.0, reach), (bottom, max(top, 1e-12))), classes


def _chart(run: MapRun, classes: Classes, index: int, x: tuple[float, float], y: tuple[float, float]) -> Chart:
    soil_map = run.soil_map
    h = np.linspace(x[1] * 1e-4, x[1], 120)
    angle, spread = classes.angle_deg, mean_spread(soil_map)
    used = model_curve(soil_map.variogram, h, angle, spread)
    marks: list[Mark] = [
        Area(classes.lag_m, classes.low, classes.high, "line", "circles of 9 in 10 surveys under the model used"),
        Line(h, used, "line", f"used for the map ({soil_map.variogram.model})"),
    ]
    mode = fitted_mode(soil_map)
    if mode != soil_map.variogram:
        marks.append(Line(h, model_curve(mode, h, angle, spread), "orange", "most likely (fitted)", dashed=True))
    size_px = 7 + 8 * np.sqrt(classes.pairs / max(classes.pairs.max(), 1))
    marks.append(Dots(classes.lag_m, classes.gamma, "ink", "samples (pairs: above)", size_px, True))
    title = "All directions" if classes.angle_deg is None else _direction(run, classes.angle_deg, index)
    return Chart(
        f"variogram{'-2' if index else ''}", title,
        f"Semivariance of the count rate against distance: {len(classes.lag_m)} classes, "
        f"{percent(classes.inside)} of them within the interval of the model used. A table has the numbers.",
        marks, x, y, "Distance between samples [m]", UNIT,
        _caption(run, classes) if index == 0 else "", 300,
        top_ticks=[(lag, _count(pairs)) for lag, pairs in zip(classes.lag_m, classes.pairs.tolist(), strict=True)],
    )  # fmt: skip


def _count(pairs: int) -> str:
    return str(pairs) if pairs < 1000 else f"{pairs / 1000:.1f}k" if pairs < 9950 else f"{pairs / 1000:.0f}k"


def _direction(run: MapRun, angle_deg: float, index: int) -> str:
    variogram = run.soil_map.variogram
    factor = variogram.anisotropy ** (-0.5 if index else 0.5)
    name = "Across" if index else "Along the longest range"
    return (
        f"{name}: {angle_deg:.3g}° anticlockwise from east ± 22.5°, practical range "
        f"{number(variogram.practical_range_m * factor)} m"
    )


def _caption(run: MapRun, classes: Classes) -> str:
    soil_map = run.soil_map
    noise = float(np.median(soil_map.noise_variance))
    parts = [
        "Half the mean squared difference of two samples. Counting noise is subtracted from the circles and is "
        f"not in the curves; that of a typical sample is {number(noise)} (counts/s)².",
        f"{percent(classes.inside)} of the circles lie in the band; neighbouring circles share samples, so they "
        "lie above or below the curve together.",
    ]
    if soil_map.fit is not None and soil_map.fit.log_sd is not None:
        parts.append(
            "The map uses the posterior means of sill and nugget, which lie above the most likely values: the "
            "latter would make its intervals too narrow."
        )
    if np.any(mean_spread(soil_map) > 0):
        parts.append("Samples that were counted while driving are averages over a stretch; so are the curves.")
    if classes.angle_deg is not None:
        parts.append("The curves are averages over the same range of directions as the circles.")
    return " ".join(parts)
