# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The empirical semivariogram in the main directions, and what the model of the map expects of it.

Circles and curves are comparable: the same noise is subtracted, and pairs of samples that were counted while
driving are compared with the model averaged over the same stretches of road.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Samples, Supports, Variogram, default_edges, sample_correlation

if TYPE_CHECKING:
    from soilmoist_ros.mapping import SoilMap

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


@dataclass(frozen=True, eq=False)
class Classes:
    """Distance classes of one direction.

    :param angle_deg: direction anticlockwise from east [deg]; ``None`` for all directions
    :param lag_m: weighted mean distance of the pairs [m]
    :param gamma: semivariance without counting noise [(counts/s)^2]; may be negative by chance
    :param pairs: number of pairs
    :param expected: mean of ``gamma`` under the model of the map
    :param low: 5 % of the surveys of a field with this model have a lower semivariance
    :param high: 5 % have a higher one
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


def fitted_mode(soil_map: SoilMap) -> Variogram:
    """The variogram that fits the counts best; the map may use another one."""
    fit, used = soil_map.fit, soil_map.variogram
    return used if fit is None or used.amplitude is not None else fit.mode


def model_curve(variogram: Variogram, h_m: Array, angle_deg: float | None, spread: Array) -> Array:
    """Semivariance of two samples at distances ``h_m`` > 0, averaged over their supports and over directions.

    The directions are those of the circles: all of them, or those within :data:`TOLERANCE_DEG` of a direction.

    :param variogram: model of the rate at points
    :param h_m: shape (k,) [m]
    :param angle_deg: direction, anticlockwise from east [deg]; ``None`` for all
    :param spread: spread of each sample, shape (4,); see :mod:`soilmoist_ros.mapping.samples`
    """
    points, weights = _support_points(spread)
    apart = (points[:, None] - points).reshape(-1, 2)
    product = np.outer(weights, weights).ravel()
    width = TOLERANCE_DEG if angle_deg is not None else 90.0
    angles = np.radians((angle_deg or 0.0) + width * (np.arange(-DIRECTIONS, DIRECTIONS + 1) / (DIRECTIONS + 0.5)))
    steps = np.multiply.outer(h_m, np.column_stack([np.cos(angles), np.sin(angles)]))
    within = product @ _correlation(variogram, apart)
    between = (_correlation(variogram, steps[:, :, None] + apart) @ product).mean(axis=1)
    return np.asarray(variogram.nugget + variogram.structured_sill * (within - between))


def mean_spread(soil_map: SoilMap) -> Array:
    """Mean spread of the samples, shape (4,), see :mod:`soilmoist_ros.mapping.samples`."""
    return np.asarray(np.mean(np.asarray(soil_map.samples.spread, float).reshape(-1, 4), axis=0))


def directions(variogram: Variogram) -> tuple[float, ...]:
    """Main directions of a variogram, longest range first [deg]; empty if it has none."""
    return () if variogram.anisotropy == 1 else (variogram.angle_deg, (variogram.angle_deg + 90) % 180)


def sample_variogram(soil_map: SoilMap) -> list[Classes]:
    """Classes of all pairs, or of the pairs along the two main directions of an anisotropic model.

    The semivariance is that of Monestiez et al. (2006), Ecological Modelling 193:615-628. The interval comes from
    simulated surveys at the same places with the same exposures and supports, drawn from the model of the map.

    :returns: empty with fewer than three distinct places
    """
    every, samples = slice(None, None, max(1, -(-len(soil_map.samples) // MAX_PLACES))), soil_map.samples
    places = Samples(samples.xy[every], samples.counts[every], samples.exposure_s[every], samples.spread[every])
    if len(np.unique(places.xy, axis=0)) < 3 or not soil_map.variogram.sill > 0:
        return []
    return list(_classes(soil_map, places, np.asarray(soil_map.noise_variance)[every]))


def _classes(soil_map: SoilMap, places: Samples, noise: Array) -> Iterator[Classes]:
    covariance = _sample_covariance(soil_map.variogram, places)
    simulated = _simulated(covariance + np.diag(noise))
    i, j = np.triu_indices(len(places), 1)
    step = places.xy[j] - places.xy[i]
    h = np.hypot(*step.T)
    angle = np.degrees(np.arctan2(step[:, 1], step[:, 0])) % 180
    edges = default_edges(places.xy)
    for direction in directions(soil_map.variogram) or (None,):
        off = 0.0 if direction is None else np.abs((angle - direction + 90) % 180 - 90)
        number = np.where((h > 0) & (off <= TOLERANCE_DEG), np.searchsorted(edges, h, side="left") - 1, -1)
        found = [
            _one(places, covariance, noise, simulated, i[chosen], j[chosen], h[chosen])
            for chosen in (np.flatnonzero(number == k) for k in range(len(edges) - 1))
            if len(chosen) >= (MIN_PAIRS if len(places) > FEW_PLACES else FEW_PAIRS)
        ]
        if found:
            lag, gamma, pairs, expected, low, high = (np.array(column) for column in zip(*found, strict=True))
            yield Classes(direction, lag, gamma, pairs.astype(int), expected, low, high)


def _one(
    places: Samples, covariance: Array, noise: Array, simulated: Array, i: NDArray[np.intp], j: NDArray[np.intp],
    h: Array,
) -> tuple[float, ...]:  # fmt: skip
    """Lag, semivariance, pairs, expectation and interval of one class."""
    t, rate = places.exposure_s, places.rate_cps
    weight = t[i] * t[j] / (t[i] + t[j])
    total = weight.sum()
    counting = weight @ (noise[i] + noise[j]) / (2 * total)
    gamma = weight @ (rate[i] - rate[j]) ** 2 / (2 * total) - counting
    spread = covariance[i, i] + covariance[j, j] - 2 * covariance[i, j]
    of_surveys = weight @ (simulated[i] - simulated[j]) ** 2 / (2 * total) - counting
    low, high = np.quantile(of_surveys, (0.05, 0.95))
    return weight @ h / total, gamma, len(h), weight @ spread / (2 * total), low, high


def _sample_covariance(variogram: Variogram, places: Samples) -> Array:
    """Covariance of the samples' true rates, averaged over their supports."""
    smooth = sample_correlation(variogram, places.xy, places.spread)
    stationary = variogram.structured_sill * smooth + variogram.nugget * np.eye(len(places))
    return variogram.modulated(np.asarray(stationary), places.xy, places.xy)


def _simulated(covariance: Array) -> Array:
    """Rates of simulated surveys, shape (places, surveys); repeatable."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ np.random.default_rng(SEED).standard_normal((len(root), SIMULATIONS)))


def _correlation(variogram: Variogram, displacement_m: Array) -> Array:
    """Correlation of the structured part at displacements of shape (..., 2) [m]."""
    scaled = variogram.scaled(displacement_m)
    return variogram.correlation_of_square((scaled**2).sum(axis=-1))


def _support_points(spread: Array) -> tuple[Array, Array]:
    """Points and weights that represent a support around the origin."""
    points: list[Array] = []
    weights: list[float] = []
    for _, found, weight in Supports(np.zeros((1, 2)), spread.reshape(1, -1)).layers:
        points.append(found[0])
        weights.append(1.0 if weight is None else float(np.ravel(weight)[0]))
    return np.array(points), np.array(weights)
