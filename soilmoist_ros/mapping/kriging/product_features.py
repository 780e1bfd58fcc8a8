# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Gaussian kriging on grids of points, from few features of each axis.

A Gaussian correlation is a product over the axes. On an interval, its factor is a sum of products of few features,
``k(x, x') = sum_a f_a(x) f_a(x')``: the eigenfunctions of the kernel, whose values fall faster than geometrically.
Covariances of samples with a place are sums over the r pairs of features that matter. L^-1 is applied to these
pairs instead of to all points of a grid; W = L^-1 C_.0 (:mod:`poisson_kriging`) follows by sums along each axis.

Covariances are off by at most 1e-9 of the sill, the variance by about as much.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.kriging.chebyshev import interpolation
from soilmoist_ros.mapping.kriging.system import KrigingSystem
from soilmoist_ros.mapping.variogram.model import isotropic_plane
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""Maximum correlation that an omitted pair of features contributes."""


class ProductFeatures:
    """W of the samples and any grid in a box, for a variogram that is a product over the axes.

    :param system: the factored system of at least one sample; neither prior nor amplitude
    :param x_m: columns, whose range is the box; at least one [m]
    :param y_m: rows [m]

    Attributes
    ----------
    size : int
        number of pairs of features
    """

    def __init__(self, system: KrigingSystem, x_m: Array, y_m: Array) -> None:
        variogram = system.variogram
        self._system = system
        self._supports = Supports(system.places.xy, system.places.spread)
        points = np.concatenate([points for _, points, _ in self._supports.layers])
        ranges_m = variogram.range_m / isotropic_plane(variogram.anisotropy, variogram.angle_deg).diagonal()
        self._axes = [
            _AxisFeatures(np.concatenate([axis, points[:, number]]), ranges_m[number])
            for number, axis in enumerate((x_m, y_m))
        ]
        self._pairs = np.nonzero(np.multiply.outer(*(axis.sizes for axis in self._axes)) > TOLERANCE)
        self.size = len(self._pairs[0])
        self._solved: Array | None = None

    def surfaces(self, x_m: Array, y_m: Array) -> Array:
        """As :meth:`KrigingSystem.surfaces` without nugget, for a grid: shape (2, ny, nx)."""
        x, y = (features.at(axis) for features, axis in zip(self._axes, (x_m, y_m), strict=True))
        if self._solved is None:
            self._solved = self._solve()
        system, solved = self._system, self._solved
        of_data = np.matmul(solved, np.column_stack([system.residual, system.ones]))
        rate, ones = (y @ of_data[..., number].T @ x.T for number in (0, 1))
        squares = np.empty(rate.shape)
        along = (x @ solved.reshape(len(solved), -1)).reshape(len(x), *solved.shape[1:])
        for column, of_column in enumerate(along):
            rows = y @ of_column
            np.einsum("ij,ij->i", rows, rows, out=squares[:, column])
        return np.array([system.mean + rate, (ones - 1) ** 2 / (system.ones @ system.ones) - squares])

    def _solve(self) -> Array:
        """L^-1 times the covariances of the samples with the features, shape (features x, features y, samples)."""
        from scipy.linalg.blas import dtrsm

        def of_points(xy: Array) -> Array:
            x, y = (
                features.at(axis)[:, pair]
                for features, axis, pair in zip(self._axes, xy.T, self._pairs, strict=True)
            )
            return (x * y).T

        covariance = self._supports.average(of_points)
        covariance *= self._system.variogram.structured_sill
        solved = np.zeros((*(len(axis.sizes) for axis in self._axes), covariance.shape[1]))
        solved[self._pairs] = dtrsm(
            1.0, self._system.factor, np.ascontiguousarray(covariance).T, lower=1, overwrite_b=1
        ).T
        return solved


class _AxisFeatures:
    """Features of a Gaussian ``exp(-(h / range)^2)`` on an interval.

    :param places_m: any places, whose range is the interval [m]
    :param range_m: range [m]

    Attributes
    ----------
    sizes : NDArray
        largest squared value of each feature, descending, shape (k,)
    """

    def __init__(self, places_m: Array, range_m: float) -> None:
        self._low, self._high = float(places_m.min()), float(places_m.max())
        lengths = (self._high - self._low) / range_m
        self._degree = 12 + math.ceil(lengths * math.sqrt(-math.log(TOLERANCE / 100)))
        points = interpolation(np.array([self._low, self._high]), self._degree)[0] / range_m
        # Eigenfunctions in the mean square over the interval, by Gauss-Chebyshev quadrature.
        root = np.sqrt(np.sin(np.pi * (np.arange(self._degree) + 0.5) / self._degree))
        kernel = np.exp(-((points[:, None] - points) ** 2))
        values, vectors = np.linalg.eigh(kernel * root[:, None] * root)
        features = vectors[:, ::-1] / root[:, None] * np.sqrt(np.maximum(values[::-1], 0.0))
        sizes = np.square(features).max(axis=0)
        kept = sizes > TOLERANCE
        self.sizes, self._features = sizes[kept], features[:, kept]

    def at(self, places_m: Array) -> Array:
        """Features of places in the interval, shape (places, k)."""
        ends = np.array([self._low, self._high])
        return np.asarray(interpolation(np.concatenate([ends, places_m]), self._degree)[1][2:] @ self._features)
