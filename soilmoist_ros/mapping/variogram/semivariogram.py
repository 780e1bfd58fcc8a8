# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The empirical semivariogram of counts.

Monestiez, Dubroca, Bonnin, Durbec & Guinet (2006), Ecological Modelling 193:615-628.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats, squared_distances
from soilmoist_ros.mapping.samples.samples import Samples, as_samples

Array = NDArray[np.float64]


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
    for rows in _pair_blocks(len(samples)):
        sums += _block_sums(samples, rows, limits)
    weight, distance, squares, pairs = sums
    with np.errstate(invalid="ignore"):
        gamma = (squares - samples.mean_rate_cps * pairs) / (2 * weight)
        return distance / weight, gamma, weight


def default_edges(xy: ArrayLike, classes: int = 15, min_pairs: int = 30, few_classes: int = 6) -> Array:
    """Edges of distance classes that suit these places [m].

    Classes of equal width up to half the largest distance (where pairs stop being plentiful); a class with
    fewer than ``min_pairs`` pairs is widened until it has them. Where that leaves fewer than ``few_classes``,
    as with the first twenty samples or so of a mission, there are ``few_classes`` of equal width over all
    distances instead, as PyKrige has them: three parameters cannot be fitted to one or two classes. Beyond
    2000 places every k-th one is looked at.

    :param xy: places, shape (n, 2), at least two distinct [m]
    :param classes: largest number of classes
    :param min_pairs: pairs that a class should have
    :param few_classes: number of classes while pairs are few
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
    if len(distances) < few_classes * min_pairs:
        return np.linspace(0, reach, few_classes + 1)
    limits = np.linspace(0, reach / 2, classes + 1)
    per_class = np.histogram(distances, limits)[0]
    edges, pairs = [0.0], 0
    for upper, found in zip(limits[1:], per_class, strict=True):
        pairs += found
        if pairs >= min_pairs:
            edges.append(upper)
            pairs = 0
    if len(edges) - 1 < few_classes:
        return np.linspace(0, reach, few_classes + 1)
    edges[-1] = limits[-1]  # the remainder joins the last class
    return np.array(edges)


def _pair_blocks(n: int, elements: int = 1_000_000) -> list[slice]:
    """Row blocks of the n x n pairs, each of about this number of elements."""
    step = max(1, elements // max(n, 1))
    return [slice(start, min(start + step, n)) for start in range(0, n, step)]


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
