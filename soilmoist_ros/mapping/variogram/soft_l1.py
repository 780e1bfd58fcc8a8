# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soft-L1 fit of a variogram model to the classes of an empirical semivariogram.

The semivariance is linear in nugget and structured sill. For a given range their fit is therefore convex (variable
projection: Golub & Pereyra 2003, Inverse Problems 19:R1-R26) and cheap enough to try many ranges at once. Damped
Newton steps on all three parameters within their bounds then find the minimum from the best ranges.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram.correlation import CorrelationModel, ModelName, correlation_model

Array = NDArray[np.float64]

OUTLIER = 0.25
"""Residuals above this share of the unit count as outliers."""
RANGES = 0.01, 3.0
"""Bounds of the range in units of the largest lag."""
MAX_NUGGET = 10.0
"""Upper bound of the nugget in units of the semivariance."""
MAX_SILL = 20.0
"""Upper bound of the structured sill in units of the semivariance."""

_USUAL = np.array([0.1, 1.0])
"""Nugget and structured sill where the classes do not determine them."""
_USUAL_REACH = 0.6
"""Practical range, in units of the largest lag, where the classes do not determine it."""
_TIE = 1e-6
_TIES = _TIE * np.array([1.0, 0.0, 1.0, *_USUAL])
"""Terms of the normal equations that pull nugget and structured sill towards the usual values."""
_TRIED = np.geomspace(*RANGES, 40)
_REWEIGHTINGS = 5
_POLISHED = 3
_MAX_STEPS = 100
_CONVERGED = 1e-8
_MIN_DAMPING, _MAX_DAMPING = 1e-8, 1e12
_LOG_STEP = 1e-4
_SHORTER = np.array([[1.0], [math.exp(-2 * _LOG_STEP)]])
"""Factors of the squared lags for the range and for a slightly longer range."""
_DIAGONAL = np.arange(3)


class SoftL1Fit(NamedTuple):
    """The minimum of the cost ``c^2 sum(sqrt(1 + (residual / c)^2) - 1)``, c = :data:`OUTLIER`.

    :param nugget: in units of the semivariance
    :param range_: in units of the lag
    :param structured: structured sill, in units of the semivariance
    :param cost: cost
    :param converged: whether the change of the last step was negligible
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
    correlation = correlation_model(model)
    most_sill = max(MAX_SILL, 2 * least_sill)
    lower = np.array([0.0, np.log(RANGES[0]), least_sill])
    upper = np.array([MAX_NUGGET, np.log(RANGES[1]), most_sill])
    starts = _promising(lag, gamma, correlation, lower, upper)
    descents = [_Descent(start, lag, gamma, correlation, lower, upper) for start in starts]
    for _ in range(_MAX_STEPS):
        for descent in descents:
            descent.step()
        if all(descent.converged for descent in descents):
            break
    best = min(descents, key=lambda descent: descent.cost)
    nugget, log_range, structured = best.at.tolist()
    return SoftL1Fit(nugget, float(np.exp(log_range)), structured, best.cost, best.converged)


class _Descent:
    """A descent from one start by damped Newton steps within the bounds.

    Other parameters as :func:`_promising`.

    :param at: start values of nugget, logarithm of the range and structured sill, shape (3,)
    """

    def __init__(
        self, at: Array, lag: Array, gamma: Array, model: CorrelationModel, lower: Array, upper: Array
    ) -> None:
        self.at = at
        self.converged = False
        self._expand = partial(_expand, lag=lag, gamma=gamma, model=model)
        self._lower, self._upper = lower, upper
        self._damping = 1e-4
        self.cost, self._gradient, self._hessian, self._scale = self._expand(at)

    def step(self) -> None:
        """Take one step, if it leads downwards."""
        at, lower, upper, slope = self.at, self._lower, self._upper, self._gradient
        system = self._hessian.copy()
        system[_DIAGONAL, _DIAGONAL] += self._damping * self._scale
        held = ((at <= lower) & (slope > 0)) | ((at >= upper) & (slope < 0))
        if held.any():  # at their bounds
            system[held] = system[:, held] = 0.0
            system[_DIAGONAL, _DIAGONAL] += held
            slope = np.where(held, 0.0, slope)
        tried = at - np.linalg.solve(system, slope)
        kept = np.minimum(np.maximum(tried, lower), upper)
        if (over := kept != tried).any():  # go to the bound and solve again for the other parameters
            system[over] = 0.0
            system[_DIAGONAL, _DIAGONAL] += over
            tried = at - np.linalg.solve(system, np.where(over, at - kept, slope))
            kept = np.minimum(np.maximum(tried, lower), upper)
        promised = float((np.abs(kept - at) * np.abs(slope)).sum())
        then = self._expand(kept)
        gain = self.cost - then[0]
        if max(abs(gain), promised) <= _CONVERGED * self.cost + 1e-16 and self._damping < 1:
            self.converged = True
        if gain > 0:
            self.at = kept
            self.cost, self._gradient, self._hessian, self._scale = then
        self._damping = max(self._damping * (0.1 if gain > 0 else 10.0), _MIN_DAMPING)
        if self._damping > _MAX_DAMPING:  # there is no lower point
            self.converged = True


def _promising(lag: Array, gamma: Array, model: CorrelationModel, lower: Array, upper: Array) -> Array:
    """Start values (nugget, log range, structured sill) at the ranges where a rough fit is best, shape (k, 3).

    The rough fit is a few rounds of weighted least squares. Parameters that the classes do not determine stay near
    the usual values.
    """
    x = 1 - model.correlation((lag / _TRIED[:, None]) ** 2)
    terms = np.stack([np.ones_like(x), x, x * x, np.broadcast_to(gamma, x.shape), x * gamma], axis=2)
    weight = np.ones_like(x)
    for _ in range(_REWEIGHTINGS):
        one, first, second, right, right_first = ((weight[:, None, :] @ terms)[:, 0, :] + _TIES).T
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
    padded = np.concatenate([[np.inf], cost, [np.inf]])
    lowest = np.flatnonzero((cost <= padded[:-2]) & (cost < padded[2:]))
    best = lowest[np.argsort(cost[lowest], kind="stable")[:_POLISHED]]
    return np.column_stack([nugget, np.log(_TRIED), structured])[best]


def _expand(at: Array, lag: Array, gamma: Array, model: CorrelationModel) -> tuple[float, Array, Array, Array]:
    """Cost, gradient, Hessian and the scale of each parameter at (nugget, log range, structured sill)."""
    nugget, log_range, structured = at
    square = (lag * np.exp(-log_range)) ** 2
    value, slope = model.with_slope(square * _SHORTER)
    bend = (slope[1] - slope[0]) / _LOG_STEP
    slopes = np.empty((len(lag), 3))
    slopes[:, 0] = 1.0
    slopes[:, 1] = -structured * slope[0]
    slopes[:, 2] = 1 - value[0]
    residual = nugget + structured * slopes[:, 2] - gamma
    root = np.sqrt(1 + (residual / OUTLIER) ** 2)
    pull = residual / root
    gradient = pull @ slopes
    hessian = (slopes / (root * root * root)[:, None]).T @ slopes
    scale = hessian.diagonal() + 1e-9
    hessian[1, 1] -= pull @ (structured * bend)
    mixed = pull @ slope[0]
    hessian[1, 2] -= mixed
    hessian[2, 1] -= mixed
    return OUTLIER**2 * float((root - 1).sum()), gradient, hessian, scale
