# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Minimisation of a costly function of few parameters, by damped Newton steps within a box."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Expansion = tuple[float, Array, Array]

_MIN_CURVATURE = 0.1
_ROUNDING = 1e-11
_FIRST_DAMPING, _MIN_DAMPING, _MAX_DAMPING = 1e-3, 1e-6, 1e8


class Minimum(NamedTuple):
    """Minimum of a function.

    :param at: parameters, shape (p,)
    :param value: value at the minimum
    :param gradient: gradient at the minimum, shape (p,)
    :param converged: whether the next step would be negligible
    """

    at: Array
    value: float
    gradient: Array
    converged: bool


def minimise(
    expand: Callable[[Array], Expansion], start: Array, bound: float, tolerance: float, max_steps: int = 100
) -> Minimum:
    """Descend from a start to a minimum.

    ``expand`` may return an approximate Hessian. Symmetric secant updates learn the missing part from the
    gradients, as Dennis, Gay & Welsch (1981), ACM Transactions on Mathematical Software 7:348-368, do for least
    squares.

    Distances are in the metric of the Hessian: for a posterior in posterior standard deviations, whatever the
    scale of the parameters.

    :param expand: parameters -> value, gradient (p,), and approximate Hessian (p, p), symmetric and positive
        definite
    :param start: start values, shape (p,)
    :param bound: maximum absolute value of each parameter
    :param tolerance: largest distance from the minimum at the end, as predicted by a Newton step of the parameters
        that are not at bounds
    :param max_steps: maximum number of steps
    """
    at = _within(start, bound)
    value, gradient, hessian = expand(at)
    learned = np.zeros_like(hessian)
    damping = _FIRST_DAMPING
    for _ in range(max_steps):
        free = np.flatnonzero(_free(at, gradient, bound))
        steepest = np.abs(gradient[free]).max(initial=0.0)
        curvature, axes = np.linalg.eigh((hessian + learned)[free[:, None], free])
        curvature = np.maximum(curvature, _MIN_CURVATURE)
        along = axes.T @ gradient[free]
        if along @ (along / curvature) <= tolerance**2:
            return Minimum(at, value, gradient, True)
        if damping > _MAX_DAMPING:
            break
        tried = at.copy()
        tried[free] -= axes @ (along / (curvature * (1 + damping)))
        tried = _within(tried, bound)
        then = expand(tried)
        # Close to the minimum, where values differ only by rounding, accept a step to a smaller gradient.
        flatter = np.abs(then[1][_free(tried, then[1], bound)]).max(initial=0.0) < steepest
        if not (then[0] < value or (flatter and then[0] <= value + _ROUNDING * abs(value))):
            damping = max(10 * damping, 1.0)
            continue
        step = tried - at
        at, change = tried, then[1] - gradient
        value, gradient, hessian = then
        damping = max(damping / 10, _MIN_DAMPING)
        missing, square = change - (hessian + learned) @ step, step @ step
        across = missing[:, None] * step
        learned = learned + (across + across.T) / square
        learned -= (missing @ step) / square**2 * (step[:, None] * step)
    return Minimum(at, value, gradient, False)


def _within(place: Array, bound: float) -> Array:
    return np.asarray(np.minimum(np.maximum(place, -bound), bound))


def _free(at: Array, gradient: Array, bound: float) -> NDArray[np.bool_]:
    """Which parameters are not held at a bound."""
    return ~(((at <= -bound) & (gradient > 0)) | ((at >= bound) & (gradient < 0)))
