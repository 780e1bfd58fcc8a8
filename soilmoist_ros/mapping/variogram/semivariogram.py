# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The empirical semivariogram of counts, and the soft-L1 fit of a variogram model to its classes.

Source: Monestiez, Dubroca, Bonnin, Durbec & Guinet (2006), Ecological Modelling 193:615-628.

The semivariance is linear in nugget and structured sill. For a given range their fit is therefore convex (variable
projection: Golub & Pereyra 2003, Inverse Problems 19:R1-R26) and cheap: the best of many ranges is found, then the
best of ever closer ones. General solvers find the same minimum in ten times the time, which is most of a mission.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats, squared_distances
from soilmoist_ros.mapping.samples import Samples, as_samples
from soilmoist_ros.mapping.variogram.model import ModelName, correlation_model

Array = NDArray[np.float64]

CLASSES, FEW_CLASSES = 15, 6  # largest number of distance classes, and their number while pairs are few
MIN_PAIRS = 30  # pairs that a distance class should have
_PAIRS_AT_ONCE = 1_000_000
OUTLIER = 0.25  # residuals above this share of the unit count as outliers
RANGES = 0.01, 3.0  # bounds of the range in units of the largest lag
MAX_NUGGET = 10.0  # upper bound of the nugget in units of the semivariance
MAX_SILL = 20.0  # upper bound of the structured sill in units of the semivariance
_USUAL = np.array([0.1, 1.0])  # nugget and structured sill where the classes do not determine them
_USUAL_REACH = 0.6  # practical range, in units of the largest lag, where the classes do not determine it
_TIE = 1e-6  # weight of the usual values, relative to that of a class
_RANGES_TRIED, _CLOSER, _ROUNDS = 40, 9, 5  # numbers of ranges compared at first and later, and of comparisons
_REWEIGHTINGS = 5


def empirical_semivariogram(
    xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike, edges: ArrayLike
) -> tuple[Array, Array, Array]:
    """Semivariogram of the latent rate from Poisson counts, weighted by exposure (Monestiez et al. 2006).

    Over the pairs i < j of the class ``lo < h <= hi``, with w = t_i t_j / (t_i + t_j)::

        gamma = sum(w (Z_i/t_i - Z_j/t_j)^2 - m*) / (2 sum(w)),   m* = sum(Z) / sum(t)

    The term -m* removes the Poisson noise without bias, so the value of a class may be negative.
    A sample is never paired with itself. Pairs at one place (h = 0) are in no class whose ``lo`` is 0.

    :param xy: places, shape (n, 2) [m]
    :param counts: raw counts, shape (n,)
    :param exposure_s: effective exposures, shape (n,) [s]
    :param edges: edges of the classes, strictly increasing, >= 0, length k + 1 [m]
    :returns: (lag_m, gamma, weight), each of length k: the w-weighted mean distance, the semivariance, the
        sum of w [s]; NaN, NaN, 0 in an empty class
    :raises ValueError: as :class:`Samples`, or for unusable edges
    """
    return semivariogram_of(as_samples(xy, counts, exposure_s), edges)


def semivariogram_of(samples: Samples, edges: ArrayLike) -> tuple[Array, Array, Array]:
    """As :func:`empirical_semivariogram`, of samples that have been checked."""
    limits = floats(edges)
    if limits.ndim != 1 or len(limits) < 2:
        raise ValueError("edges must hold at least two values")
    if not (np.isfinite(limits).all() and limits[0] >= 0 and (np.diff(limits) > 0).all()):
        raise ValueError("edges must be finite, >= 0 and strictly increasing")
    sums = np.zeros((4, len(limits) - 1))
    step = max(1, _PAIRS_AT_ONCE // max(len(samples), 1))
    for start in range(0, len(samples), step):
        sums += _block_sums(samples, slice(start, min(start + step, len(samples))), limits)
    weight, distance, squares, pairs = sums
    with np.errstate(invalid="ignore"):
        gamma = (squares - samples.mean_rate_cps * pairs) / (2 * weight)
        return distance / weight, gamma, weight


def default_edges(xy: ArrayLike) -> Array:
    """Edges of distance classes that suit these places [m].

    :data:`CLASSES` of equal width up to half the largest distance (where pairs stop being plentiful); a class with
    too few pairs is widened until it has :data:`MIN_PAIRS`. Where that leaves too few classes, as with the first
    twenty samples or so of a mission, there are :data:`FEW_CLASSES` of equal width over all distances instead, as
    PyKrige has them: three parameters cannot be fitted to one or two classes. Beyond 2000 places every k-th one is
    looked at.

    :param xy: places, shape (n, 2), at least two distinct [m]
    :raises ValueError: with fewer than two distinct places
    """
    from scipy.spatial.distance import pdist

    places = np.asarray(xy, float).reshape(-1, 2)
    places = places[np.lexsort(places.T[::-1])]
    places = places[np.append(True, (places[1:] != places[:-1]).any(axis=1))[: len(places)]]
    if len(places) < 2:
        raise ValueError("distance classes need samples at two or more distinct places")
    distances = pdist(places[:: -(-len(places) // 2000)])
    reach = distances.max() * (1 + 1e-9)
    if len(distances) < FEW_CLASSES * MIN_PAIRS:
        return np.linspace(0, reach, FEW_CLASSES + 1)
    limits = np.linspace(0, reach / 2, CLASSES + 1)
    per_class = np.histogram(distances, limits)[0]
    edges, pairs = [0.0], 0
    for upper, found in zip(limits[1:], per_class, strict=True):
        pairs += found
        if pairs >= MIN_PAIRS:
            edges.append(upper)
            pairs = 0
    if len(edges) - 1 < FEW_CLASSES:
        return np.linspace(0, reach, FEW_CLASSES + 1)
    edges[-1] = limits[-1]  # the remainder joins the last class
    return np.array(edges)


def _block_sums(samples: Samples, rows: slice, limits: Array) -> Array:
    """Sums of w, w h, w (rate difference)^2 and 1 per class, over pairs i < j with i in the rows."""
    h = np.sqrt(squared_distances(samples.xy[rows], samples.xy[rows.start :]))
    i, j = np.nonzero(np.triu((h > limits[0]) & (h <= limits[-1]), 1))
    h = h[i, j]
    t, rate = samples.exposure_s[rows.start :], samples.rate_cps[rows.start :]
    w = t[i] * t[j] / (t[i] + t[j])
    squares = w * (rate[i] - rate[j]) ** 2
    number = np.searchsorted(limits, h, side="left") - 1
    columns = (w, w * h, squares, None)
    return np.array([np.bincount(number, column, len(limits) - 1) for column in columns], float)


# -- Soft-L1 fit ---------------------------------------------------------------------------------------------


class SoftL1Fit(NamedTuple):
    """The minimum of the cost ``c^2 sum(sqrt(1 + (residual / c)^2) - 1)``, c = :data:`OUTLIER`."""

    nugget: float  # in units of the semivariance
    range_: float  # in units of the lag
    structured: float  # structured sill, in units of the semivariance
    cost: float  # cost


def fit_soft_l1(lag: Array, gamma: Array, model: ModelName, least_sill: float) -> SoftL1Fit:
    """Fit nugget, range and structured sill within their bounds.

    :param lag: mean distances of the classes in units of the largest, shape (m,)
    :param gamma: their semivariances in units of the mean absolute one, shape (m,)
    """
    correlation = correlation_model(model)
    log_range, weight = np.log(np.geomspace(*RANGES, _RANGES_TRIED)), np.ones_like(lag)
    for _ in range(_ROUNDS):
        rising = 1 - correlation.correlation((lag * np.exp(-log_range[:, None])) ** 2)
        nugget, structured, weights, cost = _fit_linear(rising, gamma, weight, least_sill)
        tie = _TIE * (log_range + math.log(correlation.practical / _USUAL_REACH)) ** 2
        best = int(np.argmin(cost + tie))
        found = SoftL1Fit(*(float(values[best]) for values in (nugget, np.exp(log_range), structured, cost)))
        weight = weights[best]
        shorter, longer = log_range[max(best - 1, 0)], log_range[min(best + 1, len(log_range) - 1)]
        log_range = np.linspace(shorter, longer, _CLOSER)
    return found


def _fit_linear(
    rising: Array, gamma: Array, weight: Array, least_sill: float
) -> tuple[Array, Array, Array, Array]:
    """Nugget and structured sill of some ranges by reweighted least squares, the weights of classes, and the cost.

    :param rising: semivariances of a structured sill of 1, shape (ranges, m)
    :param weight: weights of the classes at the start, shape (m,)
    """
    terms = np.stack(np.broadcast_arrays(1.0, rising, rising**2, gamma, rising * gamma), axis=2)
    ties, weights = _TIE * np.array([1.0, 0.0, 1.0, *_USUAL]), np.broadcast_to(weight, rising.shape)
    for _ in range(_REWEIGHTINGS):
        one, first, second, right, right_first = ((weights[:, None, :] @ terms)[:, 0, :] + ties).T
        nugget = (right * second - right_first * first) / (one * second - first * first)
        nugget = np.minimum(np.maximum(nugget, 0.0), MAX_NUGGET)
        structured = (right_first - nugget * first) / second
        structured = np.minimum(np.maximum(structured, least_sill), max(MAX_SILL, 2 * least_sill))
        nugget = np.minimum(np.maximum((right - structured * first) / one, 0.0), MAX_NUGGET)
        root = np.sqrt(1 + ((nugget[:, None] + structured[:, None] * rising - gamma) / OUTLIER) ** 2)
        weights = 1 / root
    return nugget, structured, weights, OUTLIER**2 * (root - 1).sum(axis=1)
