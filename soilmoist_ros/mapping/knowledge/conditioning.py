# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What surveys tell of the persistent pattern and of the effects of covariates, survey by survey.

The structured rate of survey s is ``g_s P(x) + sqrt(1 - g_s^2) D_s(x) + z(x)'b``: P and D_s have the covariance of
the variogram, and the loading g_s is the correlation of the survey's pattern with P. Given P and b the surveys are
independent, so their information is gathered one after the other (a Kalman filter over surveys; the state is
the coefficients of :mod:`pattern` and b). The unknown mean of each survey is integrated out exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOADINGS = np.array([0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.88, 0.94, 0.98])
"""Values of a loading."""
PRIOR_OF_LOADINGS = np.array([0.50, 0.03, 0.03, 0.03, 0.06, 0.08, 0.10, 0.10, 0.07])
"""Their prior probabilities: a survey may be unrelated; with less for that, it harms maps of few samples."""
PRIOR_WORTH = 1.0
"""Number of earlier surveys that the prior of the loadings is worth."""


@dataclass(frozen=True, eq=False)
class SurveyView:
    """The rates of a survey, ready for conditioning.

    :param rate: rate of each sample, shape (n,) [counts/s]
    :param covariance: of the structured rate without effects of covariates, nugget and noise included, (n, n)
    :param features: scaled so that the coefficients have the variance 1 a priori, shape (n, r + k) [counts/s]
    """

    rate: Array
    covariance: Array
    features: Array


@dataclass(frozen=True, eq=False)
class PatternState:
    """What is known of the coefficients: the pattern's r, and then the effects of k covariates.

    :param rank: r
    :param mean: shape (r + k,)
    :param covariance: shape (r + k, r + k)
    :param log_likelihood: logarithm of the probability of the surveys so far
    :param loadings: posterior probabilities of the loading of each survey so far
    """

    rank: int
    mean: Array
    covariance: Array
    log_likelihood: float = 0.0
    loadings: tuple[Array, ...] = ()

    @classmethod
    def before(cls, rank: int, covariates: int = 0) -> PatternState:
        """The state before any survey."""
        return cls(rank, np.zeros(rank + covariates), np.eye(rank + covariates))

    def later(self, share: float) -> PatternState:
        """The state after a time in which the pattern changes.

        :param share: correlation of the pattern then with that now, from 0 to 1
        """
        if share == 1:
            return self
        factors = self.scale(share)
        covariance = self.covariance * np.outer(factors, factors)
        index = np.arange(self.rank)
        covariance[index, index] += 1 - share**2
        return replace(self, mean=self.mean * factors, covariance=covariance)

    @property
    def effects(self) -> tuple[Array, Array]:
        """Mean and covariance of the effects of covariates, in units of their prior standard deviations."""
        return self.mean[self.rank :], self.covariance[self.rank :, self.rank :]

    @property
    def excess(self) -> Array:
        """W: covariance of the coefficients minus the pattern's prior, which the variogram has already."""
        excess = self.covariance.copy()
        index = np.arange(self.rank)
        excess[index, index] -= 1.0
        return excess

    @property
    def prior_of_loading(self) -> Array:
        """Probabilities of the loading of the next survey: the prior, and what the loadings were so far.

        The first survey defines the pattern, so it says nothing about loadings.
        """
        related = np.array(self.loadings[1:]).reshape(-1, len(LOADINGS))
        probability: Array = (PRIOR_WORTH * PRIOR_OF_LOADINGS + related.sum(axis=0)) / (PRIOR_WORTH + len(related))
        return probability

    def scale(self, loading: float) -> Array:
        """Factor of each feature for a survey with this loading, shape (r + k,)."""
        factors = np.ones(len(self.mean))
        factors[: self.rank] = loading
        return factors

    def loading_of(self, view: SurveyView) -> tuple[Array, float]:
        """Posterior probabilities of a survey's loading, and the logarithm of the survey's probability."""
        log = self.log_likelihoods(view) + np.log(self.prior_of_loading)
        weight = np.exp(log - log.max())
        return weight / weight.sum(), float(log.max() + np.log(weight.sum()))

    def log_likelihoods(self, view: SurveyView) -> Array:
        """Restricted log-likelihood of a survey with each of :data:`LOADINGS`, given the surveys so far."""
        rank, excess = self.rank, self.excess
        pattern, effects = view.features[:, :rank], view.features[:, rank:]
        square = pattern @ excess[:rank, :rank] @ pattern.T
        across = pattern @ excess[:rank, rank:] @ effects.T
        across = across + across.T
        base = view.covariance + effects @ excess[rank:, rank:] @ effects.T
        of_pattern, rest = pattern @ self.mean[:rank], view.rate - effects @ self.mean[rank:]
        return np.array(
            [
                _Factored(base + g * across + g * g * square).log_likelihood(rest - g * of_pattern)
                for g in LOADINGS.tolist()
            ]
        )

    def after(self, view: SurveyView, probabilities: Array, log_likelihood: float = 0.0) -> PatternState:
        """The state with one more survey, whose loading is the mean of these probabilities."""
        features = view.features * self.scale(float(probabilities @ LOADINGS))
        covariance = view.covariance + features @ self.excess @ features.T
        factored = _Factored(covariance)
        moved = features @ self.covariance
        solved = factored.project(moved)
        return PatternState(
            self.rank,
            self.mean + solved.T @ (view.rate - features @ self.mean),
            _symmetric(self.covariance - moved.T @ solved),
            self.log_likelihood + log_likelihood,
            (*self.loadings, probabilities),
        )


class _Factored:
    """A covariance matrix K, and ``P = K^-1 - K^-1 1 1' K^-1 / (1' K^-1 1)``: rates whose mean is unknown."""

    def __init__(self, covariance: Array) -> None:
        from scipy.linalg import cho_factor, cho_solve

        self._factor = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
        self._of_ones = cho_solve(self._factor, np.ones(len(covariance)), check_finite=False)

    def project(self, values: Array) -> Array:
        """P times values of shape (n,) or (n, m)."""
        from scipy.linalg import cho_solve

        b = self._of_ones
        solved: Array = cho_solve(self._factor, values, check_finite=False)
        return np.asarray(solved - np.multiply.outer(b, b @ values / b.sum()))

    def log_likelihood(self, rate: Array) -> float:
        """Restricted log-likelihood of rates with an unknown mean."""
        determinant = 2 * np.log(np.diag(self._factor[0])).sum() + np.log(self._of_ones.sum())
        return float(-0.5 * (determinant + rate @ self.project(rate) + (len(rate) - 1) * np.log(2 * np.pi)))


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2
