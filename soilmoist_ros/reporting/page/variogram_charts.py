# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The variogram chart: semivariances of the samples in the main directions, and what the model expects of them.

Circles and curves are comparable: the same noise is subtracted, and pairs of samples that were counted while
driving are compared with the model averaged over the same stretches of road.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Samples, SoilMap, Supports, Variogram, default_edges, sample_correlation
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.page.charts import Area, Chart, Dots, Line, Mark
from soilmoist_ros.reporting.page.frame import number, percent

Array = NDArray[np.float64]

MAX_PLACES = 600
"""Places in the semivariogram; of more, every k-th is used."""
MIN_PAIRS, FEW_PLACES, FEW_PAIRS = 10, 40, 2
"""Pairs that a class needs, and those that it needs in a survey of few places."""
TOLERANCE_DEG = 22.5
DIRECTIONS = 6
"""Directions of a curve on each side of the main one."""
SIMULATIONS = 200
SEED = 20060215
UNIT = "Semivariance of the rate [(counts/s)²]"


@dataclass(frozen=True, eq=False)
class Classes:
    """Distance classes of one direction.

    :param angle_deg: direction anticlockwise from east [deg]; ``None`` for all directions
    :param lag_m: weighted mean distance of the pairs [m]
    :param gamma: semivariance without counting noise [(counts/s)^2]; may be negative by chance
    :param expected: mean of ``gamma`` under the model of the map; 5 % of the surveys of a field with this model
        have a semivariance below ``low``, 5 % above ``high``
    """

    angle_deg: float | None
    lag_m: Array
    gamma: Array
    pairs: NDArray[np.int64]
    expected: Array
    low: Array
    high: Array

    @property
    def inside(self) -> float:
        """Share of the classes between ``low`` and ``high`` [0..1]."""
        return float(np.mean((self.gamma >= self.low) & (self.gamma <= self.high)))


def model_curve(variogram: Variogram, h_m: Array, angle_deg: float | None, spread: Array) -> Array:
    """Semivariance of two samples at distances ``h_m`` > 0, averaged over their supports and over directions.

    The directions are those of the circles: all of them, or those within :data:`TOLERANCE_DEG` of a direction.

    :param h_m: shape (k,) [m]
    :param angle_deg: direction, anticlockwise from east [deg]; ``None`` for all
    :param spread: spread of each sample, shape (4,); as of ``Samples``
    """
    layers = Supports(np.zeros((1, 2)), spread.reshape(1, -1)).layers  # a support around the origin
    points = np.array([found[0] for _, found, _ in layers])
    weights = np.array([1.0 if weight is None else float(np.ravel(weight)[0]) for _, _, weight in layers])
    apart = (points[:, None] - points).reshape(-1, 2)
    product = np.outer(weights, weights).ravel()
    width = TOLERANCE_DEG if angle_deg is not None else 90.0
    angles = np.radians((angle_deg or 0.0) + width * (np.arange(-DIRECTIONS, DIRECTIONS + 1) / (DIRECTIONS + 0.5)))
    steps = np.multiply.outer(h_m, np.column_stack([np.cos(angles), np.sin(angles)]))
    within = product @ _correlation(variogram, apart)
    between = (_correlation(variogram, steps[:, :, None] + apart) @ product).mean(axis=1)
    return np.asarray(variogram.nugget + variogram.structured_sill * (within - between))


def mean_spread(soil_map: SoilMap) -> Array:
    """Mean spread of the samples, shape (4,), as of ``Samples``."""
    return np.asarray(np.mean(np.asarray(soil_map.samples.spread, float).reshape(-1, 4), axis=0))


def sample_variogram(soil_map: SoilMap) -> list[Classes]:
    """Classes of all pairs, or of the pairs along the two main directions of an anisotropic model.

    The semivariance is that of Monestiez et al. (2006), Ecological Modelling 193:615-628. The interval comes from
    simulated surveys at the same places with the same exposures and supports, drawn from the model of the map.
    """
    every, samples = slice(None, None, max(1, -(-len(soil_map.samples) // MAX_PLACES))), soil_map.samples
    places = samples.some(every)
    if len(np.unique(places.xy, axis=0)) < 3 or not soil_map.variogram.sill > 0:
        return []
    return list(_classes(soil_map, places, np.asarray(soil_map.noise_variance)[every]))


def _classes(soil_map: SoilMap, places: Samples, noise: Array) -> Iterator[Classes]:
    variogram, t, rate = soil_map.variogram, places.exposure_s, places.rate_cps
    covariance = _sample_covariance(variogram, places)
    simulated = _simulated(covariance + np.diag(noise))
    one, other = np.triu_indices(len(places), 1)
    step = places.xy[other] - places.xy[one]
    h = np.hypot(*step.T)
    angle = np.degrees(np.arctan2(step[:, 1], step[:, 0])) % 180
    edges = default_edges(places.xy)
    main = (variogram.angle_deg, (variogram.angle_deg + 90) % 180)
    for direction in (None,) if variogram.anisotropy == 1 else main:
        off = 0.0 if direction is None else np.abs((angle - direction + 90) % 180 - 90)
        number = np.where((h > 0) & (off <= TOLERANCE_DEG), np.searchsorted(edges, h, side="left") - 1, -1)
        found = []
        for chosen in (np.flatnonzero(number == k) for k in range(len(edges) - 1)):
            if len(chosen) < (MIN_PAIRS if len(places) > FEW_PLACES else FEW_PAIRS):
                continue
            i, j = one[chosen], other[chosen]
            weight = t[i] * t[j] / (t[i] + t[j])
            total = weight.sum()
            counting = weight @ (noise[i] + noise[j]) / (2 * total)
            gamma = weight @ (rate[i] - rate[j]) ** 2 / (2 * total) - counting
            spread = covariance[i, i] + covariance[j, j] - 2 * covariance[i, j]
            of_surveys = weight @ (simulated[i] - simulated[j]) ** 2 / (2 * total) - counting
            lag_m, expected = weight @ h[chosen] / total, weight @ spread / (2 * total)
            found.append((lag_m, gamma, len(chosen), expected, *np.quantile(of_surveys, (0.05, 0.95))))
        if found:
            lag, gammas, pairs, *others = (np.array(column) for column in zip(*found, strict=True))
            yield Classes(direction, lag, gammas, pairs.astype(int), *others)


def _sample_covariance(variogram: Variogram, places: Samples) -> Array:
    """Covariance of the samples' true rates, averaged over their supports."""
    smooth = sample_correlation(variogram, places.xy, places.spread)
    return np.asarray(variogram.structured_sill * smooth + variogram.nugget * np.eye(len(places)))


def _simulated(covariance: Array) -> Array:
    """Rates of simulated surveys, shape (places, surveys); repeatable."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ np.random.default_rng(SEED).standard_normal((len(root), SIMULATIONS)))


def _correlation(variogram: Variogram, displacement_m: Array) -> Array:
    """Correlation of the structured part at displacements of shape (..., 2) [m]."""
    scaled = variogram.scaled(displacement_m)
    return variogram.correlation_of_square((scaled**2).sum(axis=-1))


# The variogram chart: circles, the interval that they should lie in, and the fitted and the used model ----------


def variogram_charts(run: MapRun) -> Iterator[tuple[Chart, Classes]]:
    """A chart for all directions, or one for each main direction of an anisotropic model, with its numbers."""
    found = sample_variogram(run.soil_map)
    if not found:
        return
    top = 1.08 * max(float(max(c.gamma.max(), np.minimum(c.high, 2 * c.expected).max())) for c in found)
    reach, lowest = 1.04 * max(float(c.lag_m.max()) for c in found), min(float(c.gamma.min()) for c in found)
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
    fit = soil_map.fit
    if fit is not None and fit.mode != soil_map.variogram:
        likely = model_curve(fit.mode, h, angle, spread)
        marks.append(Line(h, likely, "orange", "most likely (fitted)", dashed=True))
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
