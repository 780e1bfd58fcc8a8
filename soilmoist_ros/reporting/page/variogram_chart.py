# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The variogram chart: semivariances of the samples, and what the model expects of them.

Circles and lines are comparable: the same noise is subtracted, and both are of the same pairs of samples; those
that were counted while driving are averaged over the same stretches of road.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Samples, SoilMap, Variogram, default_edges, sample_correlation
from soilmoist_ros.reporting.page.charts import Area, Chart, Dots, Line, Mark
from soilmoist_ros.reporting.page.frame import number, percent
from soilmoist_ros.reporting.page.statistics import normal_draws

Array = NDArray[np.float64]

MAX_PLACES = 600
"""Places in the semivariogram; of more, every k-th is used."""
MIN_PAIRS, FEW_PLACES, FEW_PAIRS = 10, 40, 2
"""Pairs that a class needs, and those that it needs in a survey of few places."""
SIMULATIONS = 200
SEED = 20060215


@dataclass(frozen=True, eq=False)
class Classes:
    """Classes of pairs of samples by their distance; shape (k,) each.

    :param lag_m: weighted mean distance of the pairs [m]
    :param gamma: semivariance without counting noise [(counts/s)^2]; may be negative by chance
    :param expected: mean of ``gamma`` under the model of the map; 5 % of the surveys of a field with this model
        have a semivariance below ``low``, 5 % above ``high``
    :param likely: mean of ``gamma`` under the most likely model
    """

    lag_m: Array
    gamma: Array
    pairs: NDArray[np.int64]
    expected: Array
    low: Array
    high: Array
    likely: Array

    @property
    def inside(self) -> float:
        """Share of the classes between ``low`` and ``high`` [0..1]."""
        return float(np.mean((self.gamma >= self.low) & (self.gamma <= self.high)))


def sample_variogram(soil_map: SoilMap) -> Classes | None:
    """Classes of all pairs; ``None`` for too few places or a map without variance.

    The semivariance is that of Monestiez et al. (2006), Ecological Modelling 193:615-628. The interval comes from
    simulated surveys at the same places with the same exposures and supports, drawn from the model of the map.
    """
    every, samples = slice(None, None, max(1, -(-len(soil_map.samples) // MAX_PLACES))), soil_map.samples
    places, variogram = samples.some(every), soil_map.variogram
    if len(np.unique(places.xy, axis=0)) < 3 or not variogram.sill > 0:
        return None
    noise, t, rate = np.asarray(soil_map.noise_variance)[every], places.exposure_s, places.rate_cps
    covariance = _sample_covariance(variogram, places)
    likely = covariance if soil_map.fit is None else _sample_covariance(soil_map.fit.mode, places)
    simulated = normal_draws(covariance + np.diag(noise), SIMULATIONS, np.random.default_rng(SEED))
    one, other = np.triu_indices(len(places), 1)
    h = np.hypot(*(places.xy[other] - places.xy[one]).T)
    edges = default_edges(places.xy)
    index = np.where(h > 0, np.searchsorted(edges, h, side="left") - 1, -1)
    found = []
    for chosen in (np.flatnonzero(index == k) for k in range(len(edges) - 1)):
        if len(chosen) < (MIN_PAIRS if len(places) > FEW_PLACES else FEW_PAIRS):
            continue
        i, j = one[chosen], other[chosen]
        weight = t[i] * t[j] / (t[i] + t[j])
        total = weight.sum()
        counting = weight @ (noise[i] + noise[j]) / (2 * total)
        gamma = weight @ (rate[i] - rate[j]) ** 2 / (2 * total) - counting
        of_surveys = weight @ (simulated[i] - simulated[j]) ** 2 / (2 * total) - counting
        models = [weight @ (of[i, i] + of[j, j] - 2 * of[i, j]) / (2 * total) for of in (covariance, likely)]
        interval = np.quantile(of_surveys, (0.05, 0.95))
        found.append((weight @ h[chosen] / total, gamma, len(chosen), models[0], *interval, models[1]))
    if not found:
        return None
    lag_m, gammas, pairs, *others = (np.array(column) for column in zip(*found, strict=True))
    return Classes(lag_m, gammas, pairs.astype(int), *others)


def _sample_covariance(variogram: Variogram, places: Samples) -> Array:
    """Covariance of the samples' true rates, averaged over their supports."""
    smooth = sample_correlation(variogram, places.xy, places.spread)
    return np.asarray(variogram.structured_sill * smooth + variogram.nugget * np.eye(len(places)))


def variogram_chart(soil_map: SoilMap, classes: Classes) -> Chart:
    """Circles, the interval that they should lie in, and what the used and the most likely model expect."""
    top = 1.08 * float(max(classes.gamma.max(), np.minimum(classes.high, 2 * classes.expected).max()))
    lowest, lag_m, fit = float(classes.gamma.min()), classes.lag_m, soil_map.fit
    bottom = 0.0 if lowest > 0.03 * top else lowest - 0.05 * top
    marks: list[Mark] = [
        Area(lag_m, classes.low, classes.high, "line", "circles of 9 in 10 surveys under the model used"),
        Line(lag_m, classes.expected, "line", f"used for the map ({soil_map.variogram.model})"),
    ]
    if fit is not None and fit.mode != soil_map.variogram:
        marks.append(Line(lag_m, classes.likely, "orange", "most likely (fitted)", dashed=True))
    marks.append(Dots(lag_m, classes.gamma, "ink", "samples", 9.0))
    return Chart(
        "variogram", "Semivariance against distance",
        f"Semivariance of the count rate against distance: {len(lag_m)} classes, {percent(classes.inside)} of "
        "them within the interval of the model used. A table has the numbers.",
        marks, (0.0, 1.04 * float(lag_m.max())), (bottom, max(top, 1e-12)), "Distance between samples [m]",
        "Semivariance of the rate [(counts/s)²]", _caption(soil_map, classes),
    )  # fmt: skip


def _caption(soil_map: SoilMap, classes: Classes) -> str:
    noise = float(np.median(soil_map.noise_variance))
    parts = [
        "Half the mean squared difference of two samples. Counting noise is subtracted from the circles and is "
        f"not in the lines; that of a typical sample is {number(noise)} (counts/s)².",
        f"{percent(classes.inside)} of the circles lie in the band; neighbouring circles share samples, so they "
        "lie above or below the line together.",
    ]
    if soil_map.fit is not None and soil_map.fit.log_sd is not None:
        parts.append(
            "The map uses the posterior means of sill and nugget, which lie above the most likely values: the "
            "latter would make its intervals too narrow."
        )
    if np.any(np.asarray(soil_map.samples.spread) > 0):
        parts.append("Samples that were counted while driving are averages over a stretch; so are the lines.")
    return " ".join(parts)
