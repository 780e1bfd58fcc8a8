# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The empirical semivariogram of counts, and the soft-L1 fit of a variogram model to its classes.

Source: Monestiez, Dubroca, Bonnin, Durbec & Guinet (2006), Ecological Modelling 193:615-628.

The semivariance is linear in nugget and structured sill. For a given range their fit is therefore convex (variable
projection: Golub & Pereyra 2003, Inverse Problems 19:R1-R26) and cheap enough to try many ranges at once. Damped
Newton steps on all three parameters within their bounds then find the minimum from the best ranges.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats, squared_distances
from soilmoist_ros.mapping.samples import Samples, as_samples
from soilmoist_ros.mapping.variogram.model import CorrelationModel, ModelName, correlation_model

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
    converged: bool  # whether the change of the last step was negligible


def fit_soft_l1(lag: Array, gamma: Array, model: ModelName, least_sill: float) -> SoftL1Fit:
    """Fit nugget, range and structured sill within their bounds.

    :param lag: mean distances of the classes in units of the largest, shape (m,)
    :param gamma: their semivariances in units of the mean absolute one, shape (m,)
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
