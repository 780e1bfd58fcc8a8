# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The kriging system of some samples, factored: what does not depend on the targets, and solutions for targets.

A set of targets returns its correlations with the samples tile by tile. The system needs no more than this, so a
set with structure (a raster) can compute them more cheaply than arbitrary points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import squared_distances
from soilmoist_ros.mapping.samples import NO_SAMPLES, Samples
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.model import Variogram, isotropic_plane
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

_AT_ONCE = 16384
"""Correlations computed at a time, so that intermediate results stay in the cache."""
_NO_FEATURES = np.empty((0, 0))
_TILE_ELEMENTS = 400_000
"""Elements of one tile of covariances (3 MB: stays in the cache, and the solve is already at full speed)."""


class Targets(Protocol):
    """Target places of one prediction; ``xy`` has shape (g, 2) [m]."""

    xy: Array

    def correlation(self, tile: slice) -> Array:
        """Structured correlation of the targets of a tile with all places, shape (tile, places), new memory."""
        ...


class Points:
    """Arbitrary target points.

    :param variogram: its range and model
    :param places_xy: places of the samples, shape (p, 2) [m]
    :param xy: targets, shape (g, 2) [m]
    :param spread: spreads of the samples, shape (p, 4); all points if ``None``
    """

    def __init__(self, variogram: Variogram, places_xy: Array, xy: Array, spread: Array | None = None) -> None:
        self.xy = xy
        self._variogram = variogram
        self._places = Supports(places_xy, spread)
        self._scaled = variogram.scaled(xy)

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        variogram, scaled = self._variogram, self._scaled[tile]
        return self._places.average(lambda points: _correlation(variogram, scaled, variogram.scaled(points)))


class RasterCells:
    """Cells of a raster: squared distances are sums of one table per axis; a Gaussian is a product of them.

    That holds where the longest range lies along an axis, or no direction is special; otherwise cells are as good
    as any points.

    :param variogram: its range and model
    :param places_xy: places of the samples, shape (p, 2) [m]
    :param x_m: centres of the columns, shape (nx,) [m]
    :param y_m: centres of the rows, shape (ny,) [m]
    :param mask: the cells wanted, shape (ny, nx)
    :param spread: spreads of the samples, shape (p, 4); all points if ``None``
    """

    def __init__(
        self,
        variogram: Variogram,
        places_xy: Array,
        x_m: Array,
        y_m: Array,
        mask: NDArray[np.bool_],
        spread: Array | None = None,
    ) -> None:
        self._row, self._column = np.nonzero(mask)
        self.xy = np.column_stack([x_m[self._column], y_m[self._row]])
        self._variogram = variogram
        self._separable = variogram.correlation_model.is_product
        self._points = None
        if not variogram.along_axes:
            self._points = Points(variogram, places_xy, self.xy, spread)
            return
        self._places = Supports(places_xy, spread)
        plane = isotropic_plane(variogram.anisotropy, variogram.angle_deg)
        x_range_m, y_range_m = (variogram.range_m / plane.diagonal()).tolist()
        self._tables = [
            (self._table(x_m, points[:, 0], x_range_m), self._table(y_m, points[:, 1], y_range_m))
            for _, points, _ in self._places.layers
        ]

    def correlation(self, tile: slice) -> Array:
        """See :class:`Targets`."""
        if self._points is not None:
            return self._points.correlation(tile)
        column, row = self._column[tile], self._row[tile]
        return self._places.combine(self._of_tables(x[column], y[row]) for x, y in self._tables)

    def _of_tables(self, x: Array, y: Array) -> Array:
        if self._separable:
            x *= y
            return x
        x += y
        return self._variogram.correlation_of_square(x)

    def _table(self, axis_m: Array, places_m: Array, range_m: float) -> Array:
        square = ((axis_m[:, None] - places_m) / range_m) ** 2
        return self._variogram.correlation_of_square(square) if self._separable else square


def sample_correlation(variogram: Variogram, xy: Array, spread: Array | None = None, first: int = 0) -> Array:
    """Structured correlation of samples with those of them from ``first`` on, shape (n, n - first), new memory.

    :param xy: places of the samples, shape (n, 2) [m]
    :param spread: their spreads, shape (n, 4); all points if ``None``
    """
    every = Supports(xy, spread)

    def with_points(points: Array) -> Array:
        scaled = variogram.scaled(points)
        return every.average(lambda others: _correlation(variogram, scaled, variogram.scaled(others))).T

    return Supports(xy[first:], None if spread is None else spread[first:]).average(with_points)


def _correlation(variogram: Variogram, scaled: Array, others: Array) -> Array:
    """Correlation between points of shapes (n, 2) and (m, 2), as of :meth:`Variogram.scaled`; shape (n, m)."""
    correlation = np.empty((len(scaled), len(others)))
    step = max(1, _AT_ONCE // max(1, len(others)))
    for some in (slice(start, start + step) for start in range(0, len(scaled), step)):
        correlation[some] = variogram.correlation_of_square(squared_distances(scaled[some], others))
    return correlation


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

    With an amplitude (:class:`Amplitude`), the matrix, the ones and the rates are in units of the amplitude at the
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
