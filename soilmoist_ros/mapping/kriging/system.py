# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The kriging system of some samples, factored: what does not depend on the targets, and solutions for targets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.targets import Targets, coincident
from soilmoist_ros.mapping.samples.samples import NO_SAMPLES, Samples
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]
Progress = Callable[[float], None]

_NO_FEATURES = np.empty((0, 0))
_TILE_ELEMENTS = 400_000
"""Elements of one tile of covariances (3 MB: stays in the cache, and the solve is already at full speed)."""


class KrigingSystem(NamedTuple):
    """A factored kriging system, see :mod:`poisson_kriging`.

    With an amplitude (:mod:`.amplitude`), the matrix, the ones and the rates are in units of the amplitude at the
    places.

    :param variogram: variogram of the latent rate
    :param places: samples at distinct places
    :param factor: Cholesky factor L of the matrix, lower triangle, shape (n, n)
    :param ones: b = L^-1 1, shape (n,)
    :param residual: a = L^-1 (rate - c), shape (n,)
    :param mean: generalised least-squares mean c [counts/s]
    :param prior: what is known of the field besides; the residual is then about the prior mean too
    :param features: scaled features of the prior at the places, shape (n, p); empty without a prior
    :param uncertain: errors that the rates share, solved for as the rates are, shape (n, k); none without a drift
    :param uncertain_mean: their generalised least-squares means, shape (k,) [counts/s]
    """

    variogram: Variogram
    places: Samples
    factor: Array
    ones: Array
    residual: Array
    mean: float
    prior: FieldPrior | None = None
    features: Array = _NO_FEATURES
    uncertain: Array = _NO_FEATURES
    uncertain_mean: Array = np.empty(0)

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
        """The system of a Cholesky factor, with its data solved for.

        :param uncertain: errors that the rates share, shape (n, k) [counts/s]
        """
        from scipy.linalg import solve_triangular

        errors = np.empty((len(places), 0)) if uncertain is None else uncertain
        right = np.column_stack([places.rate_cps, np.ones(len(places)), errors])
        if prior is not None:
            right[:, 0] -= prior.mean(features)
        amplitude = variogram.amplitude_at(places.xy)
        if amplitude is not None:
            right /= amplitude[:, None]
        rate, ones, *shared = solve_triangular(factor, right, lower=True, check_finite=False).T
        mean = float(rate @ ones / (ones @ ones))
        solved = np.array(shared).reshape(len(shared), len(places)).T
        means = ones @ solved / (ones @ ones)
        about = solved - np.multiply.outer(ones, means)
        return cls(variogram, places, factor, ones, rate - mean * ones, mean, prior, features, about, means)

    def shared(self, solved: Array) -> Array:
        """Errors of the targets by those that the samples share, shape (g, k) [counts/s].

        :param solved: W^T of the targets, shape (g, places), as :meth:`solved_tiles`, times their amplitude
        """
        return np.asarray(self.uncertain_mean + solved @ self.uncertain)

    def surfaces(self, targets: Targets, nugget: bool, progress: Progress | None = None) -> tuple[Array, Array]:
        """Rate, and what the samples, the unknown mean and what is known add to the variance of the targets.

        :param targets: where
        :param nugget: whether targets where a sample is share its nugget
        :param progress: called with the fraction done, from above 0 to 1, after each tile
        :returns: shapes (g,) [counts/s] and (g,) [(counts/s)^2]
        """
        ones, prior = self.ones, self.prior
        both = np.column_stack([self.residual, ones])
        rate, variance = np.empty((2, len(targets.xy)))
        amplitude = self.variogram.amplitude_at(targets.xy)
        for tile, solved in self.solved_tiles(targets, nugget):
            if amplitude is not None:
                solved *= amplitude[tile, None]
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

    def solved_tiles(self, targets: Targets, nugget: bool) -> Iterator[tuple[slice, Array]]:
        """Tiles of targets with their W^T = (L^-1 C_.0)^T, shape (tile, places), in units of their amplitude."""
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


def target_variance(variogram: Variogram, keep_nugget: bool, xy: Array | None = None) -> float | Array:
    """Prior variance C_00 of targets: one number, or shape (g,) with an amplitude [(counts/s)^2].

    :param xy: the targets, shape (g, 2) [m]; by default where the amplitude is 1
    """
    variance = variogram.sill if keep_nugget else variogram.structured_sill
    amplitude = None if xy is None else variogram.amplitude_at(xy)
    return variance if amplitude is None else variance * amplitude**2


def no_system(variogram: Variogram) -> KrigingSystem:
    """The system without samples."""
    return KrigingSystem(variogram, NO_SAMPLES, np.empty((0, 0)), np.empty(0), np.empty(0), float("nan"))
