"""Soft-L1 fit of a variogram model to the classes of an empirical semivariogram.

The semivariance is linear in nugget and structured sill, so for a given range their fit is convex (variable
projection: Golub & Pereyra 2003, Inverse Problems 19:R1-R26) and cheap enough to try many ranges at once. From the
best of them, damped Newton steps on all three parameters within their bounds find the minimum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram import MODELS, CorrelationModel, ModelName

Array = NDArray[np.float64]

OUTLIER = 0.25
"""Residuals above this share of the unit count as outliers."""
RANGES = 0.01, 3.0
"""Bounds of the range in units of the largest lag."""
MOST_NUGGET = 10.0
"""Upper bound of the nugget in units of the semivariance."""
MOST_SILL = 20.0
"""Upper bound of the structured sill in units of the semivariance."""

_USUAL = np.array([0.1, 1.0])
"""Nugget and structured sill where the classes do not tell."""
_USUAL_REACH = 0.6
"""Practical range, in units of the largest lag, where the classes do not tell."""
_TIE = 1e-6
_TRIED = np.geomspace(*RANGES, 40)
_REWEIGHTINGS = 5
_POLISHED = 3
_MOST_STEPS = 100
_CONVERGED = 1e-8
_LEAST_DAMPING, _MOST_DAMPING = 1e-8, 1e12
_LOG_STEP = 1e-4
_LITTLE_SHORTER = math.exp(-2 * _LOG_STEP)
_DIAGONAL = np.arange(3)


class SoftL1Fit(NamedTuple):
    """The minimum of the cost ``c^2 sum(sqrt(1 + (residual / c)^2) - 1)``, c = :data:`OUTLIER`.

    :param nugget: in units of the semivariance
    :param range_: in units of the lag
    :param structured: structured sill, in units of the semivariance
    :param cost: cost
    :param converged: whether the last step changed next to nothing
    """

    nugget: float
    range_: float
    structured: float
    cost: float
    converged: bool


def fit_soft_l1(lag: Array, gamma: Array, model: ModelName, least_sill: float) -> SoftL1Fit:
    """Fit nugget, range and structured sill within their bounds.

    :param lag: mean distances of the classes in units of the largest, shape (m,)
    :param gamma: their semivariances in units of the mean absolute one, shape (m,)
    :param model: variogram model
    :param least_sill: lower bound of the structured sill in units of the semivariance
    """
    correlation = MODELS[model]
    most_sill = max(MOST_SILL, 2 * least_sill)
    lower = np.array([0.0, np.log(RANGES[0]), least_sill])
    upper = np.array([MOST_NUGGET, np.log(RANGES[1]), most_sill])
    at = _promising(lag, gamma, correlation, lower, upper)
    cost, gradient, hessian, scale = _expand(at, lag, gamma, correlation)
    damping = np.full((len(at), 1), 1e-4)
    converged = np.zeros(len(at), bool)
    for _ in range(_MOST_STEPS):
        system, slope = hessian.copy(), gradient
        system[:, _DIAGONAL, _DIAGONAL] += damping * scale
        held = ((at <= lower) & (gradient > 0)) | ((at >= upper) & (gradient < 0))
        if held.any():  # at their bounds
            system[held[:, :, None] | held[:, None, :]] = 0.0
            system[:, _DIAGONAL, _DIAGONAL] += held
            slope = np.where(held, 0.0, gradient)
        tried = at - np.linalg.solve(system, slope[:, :, None])[:, :, 0]
        kept = np.minimum(np.maximum(tried, lower), upper)
        if (over := kept != tried).any():  # go to the bound, and as far with the others as is best then
            system[over] = 0.0
            system[:, _DIAGONAL, _DIAGONAL] += over
            right = np.where(over, at - kept, slope)
            tried = at - np.linalg.solve(system, right[:, :, None])[:, :, 0]
            kept = np.minimum(np.maximum(tried, lower), upper)
        tried = kept
        promised = (np.abs(tried - at) * np.abs(slope)).sum(axis=1)
        then = _expand(tried, lag, gamma, correlation)
        gain = cost - then[0]
        converged |= (np.maximum(np.abs(gain), promised) <= _CONVERGED * cost + 1e-16) & (damping[:, 0] < 1)
        better = gain > 0
        if better.all():
            at, (cost, gradient, hessian, scale) = tried, then
        elif better.any():
            for old, new in zip((at, cost, gradient, hessian, scale), (tried, *then), strict=True):
                old[better] = new[better]
        damping = np.maximum(damping * np.where(better, 0.1, 10.0)[:, None], _LEAST_DAMPING)
        converged |= damping[:, 0] > _MOST_DAMPING  # no lower point is to be found
        if converged.all():
            break
    best = int(np.argmin(cost))
    nugget, log_range, structured = at[best].tolist()
    return SoftL1Fit(nugget, float(np.exp(log_range)), structured, float(cost[best]), bool(converged[best]))


def _promising(lag: Array, gamma: Array, model: CorrelationModel, lower: Array, upper: Array) -> Array:
    """Starting points (nugget, log range, structured sill), shape (k, 3): the ranges at which a rough fit is best.

    Each is fitted by a few rounds of weighted least squares. Two classes, or lags that say nothing of the range,
    leave parameters open; they stay near the usual ones.
    """
    x = 1 - model.correlation((lag / _TRIED[:, None]) ** 2)
    terms = np.stack([np.ones_like(x), x, x * x, np.broadcast_to(gamma, x.shape), x * gamma], axis=2)
    weight = np.ones_like(x)
    for _ in range(_REWEIGHTINGS):
        one, first, second, right, right_first = (weight[:, None, :] @ terms)[:, 0, :].T
        one, second = one + _TIE, second + _TIE
        right, right_first = right + _TIE * _USUAL[0], right_first + _TIE * _USUAL[1]
        determinant = one * second - first * first
        nugget = (right * second - right_first * first) / determinant
        nugget = np.minimum(np.maximum(nugget, lower[0]), upper[0])
        structured = (right_first - nugget * first) / second
        structured = np.minimum(np.maximum(structured, lower[2]), upper[2])
        nugget = (right - structured * first) / one
        nugget = np.minimum(np.maximum(nugget, lower[0]), upper[0])
        residual = nugget[:, None] + structured[:, None] * x - gamma
        root = np.sqrt(1 + (residual / OUTLIER) ** 2)
        weight = 1 / root
    tie = np.log(_TRIED * model.practical / _USUAL_REACH) ** 2
    cost = (root - 1).sum(axis=1) + _TIE * tie
    beside = np.concatenate([[np.inf], cost, [np.inf]])
    lowest = np.flatnonzero((cost <= beside[:-2]) & (cost < beside[2:]))
    best = lowest[np.argsort(cost[lowest], kind="stable")[:_POLISHED]]
    return np.column_stack([nugget, np.log(_TRIED), structured])[best]


def _expand(at: Array, lag: Array, gamma: Array, model: CorrelationModel) -> tuple[Array, Array, Array, Array]:
    """Cost, gradient, Hessian and the scale of each parameter at points (nugget, log range, structured sill)."""
    nugget, log_range, structured = at.T[:, :, None]
    square = (lag * np.exp(-log_range)) ** 2
    squares = np.empty((2, *square.shape))
    squares[0], squares[1] = square, square * _LITTLE_SHORTER
    (value, _), (slope, next_slope) = model.with_slope(squares)
    bend = (next_slope - slope) / _LOG_STEP
    slopes = np.empty((*square.shape, 3))
    slopes[:, :, 0] = 1.0
    slopes[:, :, 1] = -structured * slope
    slopes[:, :, 2] = 1 - value
    residual = nugget + structured * slopes[:, :, 2] - gamma
    root = np.sqrt(1 + (residual / OUTLIER) ** 2)
    pull = (residual / root)[:, None, :]
    gradient = (pull @ slopes)[:, 0, :]
    hessian = (slopes / (root * root * root)[:, :, None]).transpose(0, 2, 1) @ slopes
    scale = hessian.diagonal(axis1=1, axis2=2) + 1e-9
    hessian[:, 1, 1] -= (pull @ (structured * bend)[:, :, None])[:, 0, 0]
    mixed = (pull @ slope[:, :, None])[:, 0, 0]
    hessian[:, 1, 2] -= mixed
    hessian[:, 2, 1] -= mixed
    return OUTLIER**2 * (root - 1).sum(axis=1), gradient, hessian, scale
