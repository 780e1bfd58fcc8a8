# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lower bound of the integrated variance that any plan can reach in a given counting time.

The bound ignores travel and divides the time freely among all places. The best division is an A-optimal design
(Pukelsheim 2006, Optimal Design of Experiments). The problem is convex, so the search finds the global minimum.
No plan of a driving robot reaches less variance with this variogram.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import squared_distances
from soilmoist_ros.mapping import FieldPrior, Variogram

Array = NDArray[np.float64]

ROUNDS = 200
"""Maximum number of rounds of the search."""
CLOSE = 1e-3
"""The search ends when the result is certain to be within this share of the minimum."""
_FAR = 100.0


@dataclass(frozen=True, eq=False)
class LeastVariance:
    """Result of :func:`least_variance`."""

    integrated_variance: float  # least weighted sum of the variances of the cells [(counts/s)^2]
    dwell_s: Array  # time to count at each cell, shape (g,) [s]
    gap: float  # the result is at most this share above the minimum


def least_variance(
    variogram: Variogram,
    cells_xy: Array,
    weight: Array,
    rate_cps: Array,
    time_s: float,
    known: FieldPrior | None = None,
) -> LeastVariance:
    """Minimum integrated variance of the smooth rate after a given counting time.

    :param variogram: variogram; its nugget is ignored, so the bound is valid for every nugget
    :param cells_xy: cells that stand for the field, shape (g, 2) [m]; cost grows with the cube of g
    :param weight: omega of each cell, shape (g,), summing up to 1 for a map of the rate
    :param rate_cps: rate at each cell times the correction factor, shape (g,) [counts/s]
    :param time_s: counting time, > 0 [s]
    :param known: what is known of the field besides
    :raises ValueError: if the time or a rate is not positive
    """
    from scipy.linalg import cho_factor, cho_solve

    if not (time_s > 0 and (rate_cps > 0).all()):
        raise ValueError("time and rates must be > 0")
    structured = variogram.structured_sill
    from soilmoist_ros.mapping import correlation_model

    scaled = variogram.scaled(cells_xy)
    prior = structured * correlation_model(variogram.model).correlation(squared_distances(scaled, scaled))
    prior = variogram.modulated(prior, cells_xy, cells_xy)
    if known is not None:
        at = known.at(cells_xy)
        prior += known.covariance(at, at)
    # A mean that nothing is known of is a constant of very large variance.
    prior += _FAR * structured
    dwell_s = np.full(len(cells_xy), time_s / len(cells_xy))
    best, certain = np.inf, 0.0
    for _ in range(ROUNDS):
        # (C^-1 + T)^-1 = C - C S (I + S C S)^-1 S C with S = sqrt(T): nothing is inverted that might be singular.
        root = np.sqrt(dwell_s / rate_cps)
        inner = cho_factor(np.eye(len(root)) + root[:, None] * prior * root, lower=True)
        posterior = prior - (prior * root) @ cho_solve(inner, root[:, None] * prior)
        value = float(weight @ np.diag(posterior))
        slope = (weight @ posterior**2) / rate_cps  # fall of the value per second at each cell
        # The value is convex in the times: it lies above its tangent, whose least over all divisions is known.
        certain = max(certain, value + float(slope @ dwell_s) - time_s * float(slope.max()))
        if value < best:
            best, found = value, dwell_s
        if best - certain <= CLOSE * best:
            break
        dwell_s = dwell_s * np.sqrt(slope)
        dwell_s *= time_s / dwell_s.sum()
    return LeastVariance(best, found, (best - certain) / best)
