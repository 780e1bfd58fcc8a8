# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Round values for contours, limits of zones and of colours."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError

Array = NDArray[np.float64]

MAX_LEVELS = 100


def round_step(span: float, about: int = 8) -> float:
    """Step from the 1-2-5 series that divides a span into at most ``about`` parts.

    >>> round_step(17.0), round_step(0.9, 5)
    (5.0, 0.2)
    """
    wanted = max(span, 1e-9) / about
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(next(power * step for step in (1, 2, 5, 10) if power * step >= wanted * (1 - 1e-9)))


def levels(values: ArrayLike, step: float | None = None, about: int = 8) -> Array:
    """Round values between the smallest and the largest value, for contour lines.

    :param values: any shape; NaN is ignored
    :param step: distance of the levels; by default one from the 1-2-5 series
    :param about: largest number of levels for this choice
    :raises InputError: if the step is so small that there are more than :data:`MAX_LEVELS` levels
    """
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if high - low < 1e-9:
        return np.empty(0)
    chosen = step or round_step(high - low, about)
    if (high - low) / chosen > MAX_LEVELS:
        raise InputError(
            f"a step of {chosen:g} gives more than {MAX_LEVELS} contour levels between {low:.3g} and {high:.3g}",
            "choose a larger one",
        )
    first, last = math.floor(low / chosen) + 1, math.ceil(high / chosen) - 1
    return np.round(np.arange(first, last + 1) * chosen, 10)


def zone_limits(values: ArrayLike, classes: int) -> Array:
    """Limits between classes of equal area, shape (classes - 1,), fewer where values repeat.

    :param values: any shape, one value for each cell; NaN is ignored
    :param classes: number of classes, >= 1
    """
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    edges = np.unique(np.quantile(finite, np.arange(1, classes) / classes)) if finite.size else np.empty(0)
    return edges[(edges > finite.min()) & (edges < finite.max())] if finite.size else edges


def shown_range(values: ArrayLike) -> tuple[float, float]:
    """Range of a colour scale: quantiles 0.02 and 0.98, never empty."""
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    low, high = np.quantile(finite, [0.02, 0.98]).tolist() if finite.size else (0.0, 1.0)
    return (low, high) if high - low > 1e-6 else (low - 0.5, high + 0.5)
