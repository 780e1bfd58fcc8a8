# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The spread of a sample: the path along which it was counted, and the footprint of the sensor.

A record that was counted while driving, or over a footprint, is a mean over an area. Of the path only the
covariance matrix (sxx, sxy, syy) [m^2] of a place drawn from it is kept: a straight path of length l along the
unit vector u has l^2/12 u u', and independent paths add up. Of the footprint the radius [m] is kept, the fourth
column: its shape is published (:mod:`soilmoist_ros.sensing.moisture.footprint`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MIN_SPREAD_M2 = 1.0
"""Spreads with a smaller trace count as points: the noise of positions makes as much where a robot stands."""


def path_spread(along_m: ArrayLike) -> Array:
    """Spread of counts gathered evenly along straight paths.

    :param along_m: vectors from the beginning to the end, shape (..., 2) [m]
    :returns: shape (..., 4) [m^2], without a footprint
    """
    x, y = np.moveaxis(np.asarray(along_m, float), -1, 0)
    return np.stack([x * x, x * y, y * y, 0 * x], axis=-1) / 12


def footprint_spread(radius_m: float) -> Array:
    """Spread of a footprint that sends 86 % of the counts from within a radius.

    :param radius_m: radius [m], >= 0; 0 for a sensor that sees its own place only
    :returns: shape (4,)
    :raises ValueError: if the radius is negative or not finite
    """
    if not (np.isfinite(radius_m) and radius_m >= 0):
        raise ValueError(f"the radius of a footprint must be >= 0 and finite, got {radius_m}")
    return np.array([0.0, 0.0, 0.0, radius_m])


def full_spread(moments: ArrayLike, radius_m: float = 0.0) -> Array:
    """Spreads with all four columns, from second moments of paths.

    :param moments: shape (..., 3) [m^2]
    :param radius_m: radius of the footprint [m]
    :returns: shape (..., 4)
    """
    path = np.asarray(moments, float)
    return np.concatenate([path, np.full((*path.shape[:-1], 1), radius_m)], axis=-1)


def without_noise(spread: Array) -> Array:
    """Spreads of shape (n, 4) with the paths set to zero that :data:`MIN_SPREAD_M2` takes for noise."""
    moves = (spread[:, 0] + spread[:, 2] >= MIN_SPREAD_M2)[:, None]
    return np.where(moves | (np.arange(spread.shape[1]) > 2), spread, 0.0)
