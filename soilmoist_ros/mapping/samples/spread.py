# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The spread of a sample: second moments of the area over which it was counted.

A record that was counted while driving, or over a footprint, is a mean over an area. Of the area only the
covariance matrix (sxx, sxy, syy) [m^2] of a place drawn from it is kept. A straight path of length l along the
unit vector u has l^2/12 u u', a Gaussian footprint of standard deviation s has s^2 along each axis; independent
spreads add up.
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
    :returns: shape (..., 3) [m^2]
    """
    x, y = np.moveaxis(np.asarray(along_m, float), -1, 0)
    return np.stack([x * x, x * y, y * y], axis=-1) / 12


def footprint_spread(radius_m: float) -> Array:
    """Spread of a Gaussian footprint that sends 86 % of the counts from within a radius (two standard deviations).

    :param radius_m: radius [m], >= 0; 0 for a sensor that sees its own place only
    :returns: shape (3,) [m^2]
    :raises ValueError: if the radius is negative or not finite
    """
    if not (np.isfinite(radius_m) and radius_m >= 0):
        raise ValueError(f"the radius of a footprint must be >= 0 and finite, got {radius_m}")
    return np.array([1.0, 0.0, 1.0]) * (radius_m / 2) ** 2


def without_noise(spread: Array) -> Array:
    """Spreads of shape (n, 3) with those set to zero that :data:`MIN_SPREAD_M2` takes for noise."""
    return np.where((spread[:, 0] + spread[:, 2] >= MIN_SPREAD_M2)[:, None], spread, 0.0)
