# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Knowledge of a field before the survey, as prior mean and covariance of its rate.

Without knowledge, the structured rate has the covariance ``K(x, x')`` of the variogram and the mean of its survey.
What is known adds features F(x): patterns that earlier surveys have measured, and covariates. With c the mean of
their coefficients::

    mean(x) = F(x) c,        covariance(x, x') = K(x, x') + F(x) W F(x')'

W is the covariance matrix of the coefficients minus the part of it that K has already. So it is negative in
directions that earlier surveys have measured, and positive for covariates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effect:
    """Effect of a covariate on the rate.

    :param mean: change of the rate per standard deviation of the covariate, posterior mean [counts/s]
    :param sd: its posterior standard deviation [counts/s]; 0 with a mean of 0 if the covariate was left out
    """

    name: str
    mean: float
    sd: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval [counts/s]."""
        return self.mean - 1.96 * self.sd, self.mean + 1.96 * self.sd


@dataclass(frozen=True)
class Relation:
    """Relation of an earlier survey to this one."""

    name: str  # of the earlier survey
    correlation: float  # of the patterns of the two surveys, posterior mean


@dataclass(frozen=True, eq=False)
class FieldPrior:
    """Prior mean and covariance of the smooth rate, besides the variogram and the unknown mean of the survey.

    :param features: F at places of shape (n, 2) [m], shape (n, p); a function that may keep what it computed
    :param scale: factor of each feature, shape (p,)
    :param matrix: W, symmetric, shape (p, p) [(counts/s)^2]
    :param coefficients: c, shape (p,) [counts/s]
    :param effects: effects of covariates, the counts of the survey included
    :param own: variance that no two places share, at places of shape (n, 2), shape (n,) [(counts/s)^2], as where a
        covariate is missing; ``None`` for none
    """

    features: Callable[[Array], Array]
    scale: Array
    matrix: Array
    coefficients: Array
    effects: tuple[Effect, ...] = ()
    relations: tuple[Relation, ...] = ()
    own: Callable[[Array], Array] | None = None

    def at(self, xy: Array, spread: Array | None = None) -> Array:
        """Scaled features at places or averaged over supports, shape (n, p)."""
        if spread is None or not spread.any():
            return self.features(xy) * self.scale
        return np.ascontiguousarray(Supports(xy, spread).average_rows(self.at))

    def mean(self, at: Array) -> Array:
        """Prior mean of the rate about the unknown mean of the survey, shape (n,) [counts/s]."""
        return np.asarray(at @ self.coefficients)

    def covariance(self, at: Array, others: Array) -> Array:
        """Covariance in addition to the variogram's, shape (n, m) [(counts/s)^2]."""
        if len(at) < len(others):
            return np.asarray((at @ self.matrix) @ others.T)
        return np.asarray(at @ (self.matrix @ others.T))

    def own_variance(self, xy: Array) -> float | Array:
        """Variance that no two places share, shape (n,) or 0 everywhere [(counts/s)^2]."""
        return 0.0 if self.own is None else self.own(xy)

    def variance(self, at: Array) -> Array:
        """Variance in addition to the variogram's, shape (n,) [(counts/s)^2]."""
        return np.asarray(np.einsum("ij,ij->i", at @ self.matrix, at))
