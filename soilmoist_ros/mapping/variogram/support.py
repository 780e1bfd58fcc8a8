# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The support of samples: the area over which counts are averaged while driving or over a footprint.

The area is described by the *spread*: the covariance matrix (sxx, sxy, syy) [m^2] of a random place on the path,
and the radius [m] of the footprint. A straight path of length l along the unit vector u has l^2/12 u u'.
Independent paths add up.

Covariances between supports are averages over both (block kriging; Gotway & Young 2002, Journal of the American
Statistical Association 97:632-648). A few points replace a support; samples and targets use equal points, so the
matrix remains positive definite whatever the error.

Points of a path have its mean and second moments: two for a line (Gauss-Legendre), three for a small area; for a
larger one the centre and two on each principal axis, which also match the fourth moments of a Gaussian.

Points of a footprint follow the published weights of distance (:mod:`soilmoist_ros.sensing.moisture.footprint`),
which no Gaussian does: of a radius of 10 m, half of the counts come from within 2 m. The share from within a fifth
of the radius lies at the place, the rest on four points at 0.82 radii, the distance where the errors are smallest.
Errors of the correlations for radii of 5 to 150 m and practical ranges from three radii: at most 0.07, and 0.10
at a range of one and a half. A Gaussian of that radius has up to 0.12 and 0.23, a single point 0.41 and 0.57.

The nugget (micro-scale variance) of a sample does not depend on its support.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import squared_distances
from soilmoist_ros.mapping.samples import MIN_SPREAD_M2
from soilmoist_ros.mapping.variogram.model import CorrelationModel
from soilmoist_ros.sensing import Footprint

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MIN_WIDTH_M2 = MIN_SPREAD_M2 / 2  # areas with a smaller variance across count as lines
_MAX_SMALL_M2 = 5.0  # areas with a larger variance along have more than three points
_LINE_WEIGHT, _LINE_ARM = 1 / 2, 1.0
_SMALL_WEIGHT, _SMALL_ARMS = 1 / 3, np.array([[0.0, np.sqrt(2.0)], [np.sqrt(1.5), -np.sqrt(0.5)]])
_AREA_WEIGHT, _AREA_ARM = 1 / 6, np.sqrt(3.0)
"""Weight of each point around the centre, and its distance from there in standard deviations; of two of the three
points of a small area across and along."""
NEAR_RADII, _RING_RADII = 0.23, 0.82
"""Radii within which counts of a footprint count as from the place itself; distance of the others."""
_RADII_M = np.geomspace(1.0, 1000.0, 31)  # radii at which the share of the counts from near is computed
_LOG_STEP = 0.5
_MAX_TOGETHER = 600
"""Maximum number of points at which a function is evaluated in one call; more would leave the cache."""
_FEW_ELEMENTS = 30_000
"""Maximum size of temporary matrices; larger ones are slower because their memory is allocated anew each time."""


class Supports:
    """Points that represent the supports of samples: one each, more where a support has an extent."""

    def __init__(self, xy: Array, spread: Array | None = None) -> None:
        # (samples, points, weights): whose points they are, the points [m], and their weights; ``None`` for 1
        self.layers: list[tuple[slice | Indices, Array, Array | float | None]] = [(slice(None), xy, None)]
        if spread is None or not spread.any():
            return
        self._add_path(xy, spread[:, :3])
        if spread.shape[1] > 3 and spread[:, 3].any():
            self._add_footprint(xy, spread)

    def _add_path(self, xy: Array, spread: Array) -> None:
        if not spread.any():
            return
        variance, axes = _principal_axes(spread)
        arms = np.sqrt(np.maximum(variance, 0.0))[:, None] * axes  # of one standard deviation, in the columns
        area = variance[:, 0] >= _MIN_WIDTH_M2
        small = area & (variance[:, 1] <= _MAX_SMALL_M2)
        large, line = area & ~small, ~area & (variance[:, 1] > 0)
        first, second = arms @ _SMALL_ARMS[0], arms @ _SMALL_ARMS[1]
        end = _LINE_ARM * arms[:, :, 1]
        first = np.where(line[:, None], end, np.where(small[:, None], first, 0.0))
        second = np.where(line[:, None], -end, second)
        weight = np.where(line, _LINE_WEIGHT, 1.0)
        weight[small], weight[large] = _SMALL_WEIGHT, 1 - 4 * _AREA_WEIGHT
        self.layers[0] = (slice(None), xy + first, weight)
        if (line | small).any():
            has = np.flatnonzero(line | small)
            self.layers.append((has, xy[has] + second[has], weight[has]))
        if small.any():
            has = np.flatnonzero(small)
            self.layers.append((has, xy[has] - first[has] - second[has], _SMALL_WEIGHT))
        if large.any():
            has = np.flatnonzero(large)
            for step in (_AREA_ARM, -_AREA_ARM):
                self.layers += [(has, xy[has] + step * arms[has, :, axis], _AREA_WEIGHT) for axis in (0, 1)]

    def _add_footprint(self, xy: Array, spread: Array) -> None:
        """Lower the weights of the points so far to the share from near, and add four points around."""
        near = np.where(spread[:, 3] > 0, near_share(spread[:, 3]), 1.0)
        self.layers = [
            (which, points, near[which] * (1.0 if weight is None else weight))
            for which, points, weight in self.layers
        ]
        has = np.flatnonzero(near < 1)
        variance, axes = _principal_axes(spread[has, :3])
        # two of four points lie on each axis, hence twice its variance
        length = np.sqrt((_RING_RADII * spread[has, 3, None]) ** 2 + 2 * np.maximum(variance, 0.0))
        arms = length[:, None] * axes
        self.layers += [
            (has, xy[has] + side * arms[:, :, axis], (1 - near[has]) / 4) for side in (1, -1) for axis in (0, 1)
        ]

    def average(self, of_points: Callable[[Array], Array]) -> Array:
        """Averages of a function over the supports."""
        sizes = [len(points) for _, points, _ in self.layers]
        if len(sizes) == 1 or sum(sizes) > _MAX_TOGETHER:
            return self.combine(of_points(points) for _, points, _ in self.layers)
        values = of_points(np.concatenate([points for _, points, _ in self.layers]))
        return self.combine(
            values[..., stop - size : stop] for size, stop in zip(sizes, accumulate(sizes), strict=True)
        )

    def average_rows(self, of_points: Callable[[Array], Array]) -> Array:
        """Averages of a function over the supports, one row for each."""
        return self.average(lambda points: of_points(points).T.copy()).T

    def combine(self, of_layers: Iterable[Array]) -> Array:
        """Averages over the supports, as :meth:`average`, from values at the points of each layer."""
        result = np.empty(0)
        for (samples, _, weight), values in zip(self.layers, of_layers, strict=True):
            if weight is not None:
                values *= weight
            if isinstance(samples, slice):
                result = values
            else:
                result[..., samples] += values
        return result


def near_share(radius_m: ArrayLike) -> Array:
    """Share of the counts from within :data:`NEAR_RADII` of the radius of a footprint [0..1]."""
    return np.asarray(np.interp(np.asarray(radius_m, float), _RADII_M, _near_shares()))


@cache
def _near_shares() -> Array:
    shares = [Footprint.shielded(radius_m).share(NEAR_RADII * radius_m) for radius_m in _RADII_M.tolist()]
    return np.array(shares)


def _principal_axes(spread: Array) -> tuple[Array, Array]:
    """Variances along the principal axes, the smaller one first, shape (n, 2), and the axes, shape (n, 2, 2)."""
    xx, xy, yy = spread.T
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    angle = np.arctan2(2 * xy, xx - yy) / 2  # of the longer axis
    x, y = np.cos(angle), np.sin(angle)
    axes = np.array([[-y, x], [x, y]]).transpose(2, 0, 1)
    return np.column_stack([middle - half, middle + half]), axes


class SupportCorrelation:
    """Correlations between all supports as a function of the range, for the fit of a variogram.

    Correlations at a few ranges are interpolated by cubic Hermite polynomials in the logarithm of the range, so
    many evaluations cost little. The slope is the exact derivative of the interpolated correlation.

    :param plane: matrix that maps places to the plane where the model is isotropic, shape (2, 2)
    """

    def __init__(
        self,
        model: CorrelationModel,
        xy: Array,
        spread: Array,
        kept: int = 8,
        plane: Array | None = None,
        pack: Callable[[Array], Array] = lambda matrix: matrix,
    ) -> None:
        self._kept = kept
        self._pack = pack
        self._model = model
        self._supports = Supports(xy, spread)
        if plane is not None:
            self._supports.layers = [
                (samples, points @ plane, weight) for samples, points, weight in self._supports.layers
            ]
        self._known: dict[int, tuple[Array, Array]] = {}

    def at(self, range_m: float) -> tuple[Array, Array]:
        """Correlation and its derivative with respect to the logarithm of the range, shape (n, n) or packed."""
        position = float(np.log(range_m)) / _LOG_STEP
        left = int(np.floor(position))
        u = position - left
        (low, low_slope), (high, high_slope) = self._node(left), self._node(left + 1)
        rise = high - low
        value = low + (u * u * (3 - 2 * u)) * rise
        value += (u * (1 - u) ** 2 * _LOG_STEP) * low_slope
        value -= (u * u * (1 - u) * _LOG_STEP) * high_slope
        slope = (6 * u * (1 - u) / _LOG_STEP) * rise
        slope += ((1 - u) * (1 - 3 * u)) * low_slope
        slope += (u * (3 * u - 2)) * high_slope
        return value, slope

    def _node(self, number: int) -> tuple[Array, Array]:
        range_m = float(np.exp(number * _LOG_STEP))
        found = self._known.pop(number, None)
        if found is None:
            value, slope = self._averaged(range_m)
            found = self._pack(value), self._pack(slope)
        self._known[number] = found  # the last used comes last
        if len(self._known) > self._kept:
            del self._known[next(iter(self._known))]
        return found

    def _averaged(self, range_m: float) -> tuple[Array, Array]:
        """Correlation and its slope at a range, each of shape (n, n): sums over all pairs of layers of points."""
        n = len(self._supports.layers[0][1])
        value, slope = np.zeros((2, n, n))
        layers = [
            (np.arange(n)[samples], points / range_m, np.full(len(points), 1.0 if weight is None else weight))
            for samples, points, weight in self._supports.layers
        ]
        for number, (rows, points, weight) in enumerate(layers):
            for columns, others, their_weight in layers[number:]:
                step = max(1, _FEW_ELEMENTS // len(columns))
                for some in (slice(start, start + step) for start in range(0, len(rows), step)):
                    weights = np.outer(weight[some], their_weight)
                    found = self._model.with_slope(squared_distances(points[some], others))
                    for total, part in zip((value, slope), found, strict=True):
                        part *= weights
                        total[_index(rows[some], columns)] += part
                        if others is not points:
                            total[_index(columns, rows[some])] += part.T
        return value, slope


def correlation_by_range(
    model: CorrelationModel,
    xy: Array,
    spread: Array,
    kept: int,
    plane: Array | None = None,
    pack: Callable[[Array], Array] = lambda matrix: matrix,
) -> Callable[[float], tuple[Array, Array]]:
    """Correlation between samples and its slope as a function of the range; see :class:`SupportCorrelation`."""
    if spread.any():
        return SupportCorrelation(model, xy, spread, kept, plane, pack).at
    scaled = xy if plane is None else xy @ plane
    square = pack(squared_distances(scaled, scaled))
    return lambda range_m: model.with_slope(square / range_m**2)


def _index(rows: Indices, columns: Indices) -> tuple[slice, slice] | tuple[Indices, Indices]:
    """Index of the elements in these rows and columns; slices if rows and columns are consecutive."""
    if rows[-1] - rows[0] == len(rows) - 1 and columns[-1] - columns[0] == len(columns) - 1:
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return rows[:, None], columns[None, :]
