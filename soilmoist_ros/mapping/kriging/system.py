# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The kriging system of some samples, factored: what does not depend on the targets, and solutions for targets."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import IllConditionedError, squared_distances
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

JITTER = (0.0, 1e-13, 1e-11, 1e-9)
"""Values added to the diagonal, relative to its mean, until the Cholesky factor exists."""
_AT_ONCE = 16384  # correlations computed at a time, so that intermediate results stay in the cache
_NO_FEATURES = np.empty((0, 0))
_log = logging.getLogger(__name__)
_TILE_ELEMENTS = 400_000
"""Elements of one tile of covariances (3 MB: stays in the cache, and the solve is already at full speed)."""


class Points:
    """Arbitrary target points."""

    def __init__(self, variogram: Variogram, places_xy: Array, xy: Array, spread: Array | None = None) -> None:
        self.xy = xy
        self._variogram = variogram
        self._places = Supports(places_xy, spread)
        self._scaled = variogram.scaled(xy)

    def correlation(self, tile: slice) -> Array:
        """Structured correlation of the targets of a tile with all places, shape (tile, places), new memory."""
        variogram, scaled = self._variogram, self._scaled[tile]
        return self._places.average(lambda points: _correlation(variogram, scaled, variogram.scaled(points)))


def sample_correlation(variogram: Variogram, xy: Array, spread: Array | None = None) -> Array:
    """Structured correlation between samples, shape (n, n), new memory."""
    every = Supports(xy, spread)

    def with_points(points: Array) -> Array:
        scaled = variogram.scaled(points)
        return every.average(lambda others: _correlation(variogram, scaled, variogram.scaled(others))).T

    return every.average(with_points)


def _correlation(variogram: Variogram, scaled: Array, others: Array) -> Array:
    """Correlation between points of shapes (n, 2) and (m, 2), as of :meth:`Variogram.scaled`; shape (n, m)."""
    correlation = np.empty((len(scaled), len(others)))
    step = max(1, _AT_ONCE // max(1, len(others)))
    for some in (slice(start, start + step) for start in range(0, len(scaled), step)):
        correlation[some] = variogram.correlation_of_square(squared_distances(scaled[some], others))
    return correlation


def cholesky_with_jitter(covariance: Array, noise: Array, scale: float) -> tuple[Array, float]:
    """Cholesky factor of a covariance and its noise, with as little jitter as makes it positive definite.

    :returns: lower triangle L, and the jitter on the diagonal
    :raises IllConditionedError: if no jitter suffices
    """
    from scipy.linalg.lapack import dpotrf

    diagonal = np.diag_indices(len(noise))
    without_noise = covariance[diagonal]
    for relative in JITTER:
        covariance[diagonal] = without_noise + (relative * scale + noise)
        factor, info = dpotrf(covariance, lower=1, clean=1)
        if not info:
            if relative:
                _log.warning("added %.3g to the diagonal: the kriging matrix is ill-conditioned", relative * scale)
            return np.asarray(factor), relative * scale
    raise IllConditionedError(
        f"the kriging matrix of {len(noise)} samples is not positive definite even with a jitter of "
        f"{JITTER[-1] * scale:.3g}: the variogram is too smooth for places so close together; "
        "use matern32 or exponential, a nugget, or merge close samples"
    )


def coincident(xy: Array, places_xy: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Targets that lie exactly at a place: their numbers, and the numbers of those (distinct) places."""
    keys = places_xy[:, 0] + 1j * places_xy[:, 1]
    wanted = xy[:, 0] + 1j * xy[:, 1]
    order = np.argsort(keys)
    position = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
    place = order[position]
    target = np.flatnonzero(keys[place] == wanted)
    return target, place[target]


# -- Factored system -----------------------------------------------------------------------------------------

Progress = Callable[[float], None]


class KrigingSystem(NamedTuple):
    """A factored kriging system, see :mod:`poisson_kriging`.

    :param prior: what is known of the field besides; the residual is then about the prior mean too
    :param features: scaled features of the prior at the places, shape (n, p); empty without a prior
    :param uncertain: errors that the rates share, solved for as the rates are, shape (n, k); none without a
        drift
    """

    variogram: Variogram  # variogram of the latent rate
    places: Samples  # samples at distinct places
    factor: Array  # Cholesky factor L of the matrix, lower triangle, shape (n, n)
    ones: Array  # b = L^-1 1, shape (n,)
    residual: Array  # a = L^-1 (rate - c), shape (n,)
    mean: float  # generalised least-squares mean c [counts/s]
    prior: FieldPrior | None = None
    features: Array = _NO_FEATURES
    uncertain: Array = _NO_FEATURES
    uncertain_mean: Array = np.empty(0)  # their generalised least-squares means, shape (k,) [counts/s]

    @classmethod
    def of_factor(
        cls,
        variogram: Variogram,
        places: Samples,
        factor: Array,
        prior: FieldPrior | None = None,
        features: Array = _NO_FEATURES,
        uncertain: Array | None = None,
    ) -> KrigingSystem:
        """The system of a Cholesky factor, with its data solved for."""
        from scipy.linalg import solve_triangular

        errors = np.empty((len(places), 0)) if uncertain is None else uncertain
        right = np.column_stack([places.rate_cps, np.ones(len(places)), errors])
        if prior is not None:
            right[:, 0] -= prior.mean(features)
        rate, ones, *shared = solve_triangular(factor, right, lower=True, check_finite=False).T
        mean = float(rate @ ones / (ones @ ones))
        solved = np.array(shared).reshape(len(shared), len(places)).T
        means = ones @ solved / (ones @ ones)
        about = solved - np.multiply.outer(ones, means)
        return cls(variogram, places, factor, ones, rate - mean * ones, mean, prior, features, about, means)

    def shared(self, solved: Array) -> Array:
        """Errors of targets by those that the samples share, shape (g, k) [counts/s]; ``solved``: W^T."""
        return np.asarray(self.uncertain_mean + solved @ self.uncertain)

    def surfaces(self, targets: Points, nugget: bool, progress: Progress | None = None) -> tuple[Array, Array]:
        """Rate, and what the samples, the unknown mean and what is known add to the variance of the targets."""
        ones, prior = self.ones, self.prior
        both = np.column_stack([self.residual, ones])
        rate, variance = np.empty((2, len(targets.xy)))
        for tile, solved in self.solved_tiles(targets, nugget):
            products = solved @ both
            rate[tile] = self.mean + products[:, 0]
            variance[tile] = (products[:, 1] - 1) ** 2 / (ones @ ones) - np.einsum("ij,ij->i", solved, solved)
            if self.uncertain.size:
                variance[tile] += (self.shared(solved) ** 2).sum(axis=1)
            if progress is not None:
                progress(tile.stop / len(rate))
        if prior is not None:
            at = prior.at(targets.xy)
            rate += prior.mean(at)
            variance += prior.variance(at) + prior.own_variance(targets.xy)
        return rate, variance

    def solved_tiles(self, targets: Points, nugget: bool) -> Iterator[tuple[slice, Array]]:
        """Tiles of targets with their W^T = (L^-1 C_.0)^T, shape (tile, places)."""
        from scipy.linalg.blas import dtrsm

        places, variogram = self.places, self.variogram
        none = np.empty(0, np.intp)
        target, place = coincident(targets.xy, places.xy) if nugget else (none, none)
        step = max(1, _TILE_ELEMENTS // len(places))
        features = None if self.prior is None else self.prior.at(targets.xy)
        for start in range(0, len(targets.xy), step):
            tile = slice(start, min(start + step, len(targets.xy)))
            covariance = targets.correlation(tile)
            covariance *= variogram.structured_sill
            if features is not None:
                assert self.prior is not None
                covariance += self.prior.covariance(features[tile], self.features)
            if nugget:
                here = slice(*np.searchsorted(target, (tile.start, tile.stop)))
                covariance[target[here] - start, place[here]] += variogram.nugget
            yield tile, dtrsm(1.0, self.factor, covariance.T, lower=1, overwrite_b=1).T


def target_variance(variogram: Variogram, keep_nugget: bool) -> float:
    """Prior variance C_00 of targets [(counts/s)^2]."""
    return variogram.sill if keep_nugget else variogram.structured_sill
