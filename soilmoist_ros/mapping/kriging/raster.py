# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging of the cells of one raster, by interpolation or tiles where faster, else cell by cell."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats
from soilmoist_ros.mapping.kriging.chebyshev import ChebyshevNodes, raster_by_interpolation
from soilmoist_ros.mapping.kriging.covariances import AxesCovariances, Covariances, PointCovariances
from soilmoist_ros.mapping.kriging.few_targets import MAX_SAMPLES, MAX_TARGETS, FewTargets, KnownCovariances
from soilmoist_ros.mapping.kriging.product_features import ProductFeatures
from soilmoist_ros.mapping.kriging.rows import MIN_PIVOT, KrigingRows
from soilmoist_ros.mapping.kriging.system import KrigingSystem, Points, Progress, RasterCells, target_variance
from soilmoist_ros.mapping.kriging.tile_covariances import TileCovariances, tile_shape
from soilmoist_ros.mapping.kriging.tile_forms import find_tiles, tile_sums
from soilmoist_ros.mapping.samples import Samples, merge_exactly
from soilmoist_ros.mapping.variogram.local import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_TILED = 50, 16_000
"""Minimum numbers of samples and of cells from which tiles are faster for a factored system."""
MIN_FEATURES, FEATURES_SHARE = 40, 0.4
"""Minimum number of samples, and maximum pairs of features per point, from which features are faster."""
_GROWTH = 1.15
"""Factor for the Chebyshev points along each axis where the surfaces are not resolved."""


class RasterKriging:
    """Krigs the cells of one raster repeatedly (:meth:`update`) or once (:meth:`solve`).

    For Gaussian variograms, the surfaces are interpolated from few Chebyshev points (:mod:`chebyshev`). On large
    rasters, covariances with far samples come from few points of each tile (:mod:`tile_covariances`,
    :mod:`tile_forms`). Otherwise every cell is kriged. Not thread-safe.

    :param x_m: centres of the columns, shape (nx,) [m]
    :param y_m: centres of the rows, shape (ny,) [m]
    :param mask: cells wanted, shape (ny, nx)
    :param keep_nugget: as :class:`PoissonKriging`

    Attributes
    ----------
    known : KnownCovariances | None
        those of the samples of the last :meth:`update`, and with the wanted cells; ``None`` if they were not
        needed as a whole
    """

    def __init__(self, x_m: Array, y_m: Array, mask: Mask, keep_nugget: bool) -> None:
        self.keep_nugget = keep_nugget
        self.known: KnownCovariances | None = None
        self._x_m, self._y_m, self._mask = x_m, y_m, mask
        self._outside = ~mask
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        self._is_empty = not len(rows)
        self._box = (slice(0), slice(0))
        if not self._is_empty:
            self._box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        self._inside = x_m[self._box[1]], y_m[self._box[0]], mask[self._box]
        self._cells: KrigingRows | FewTargets | None = None
        self._tile_shape: tuple[int, int] | None = None
        self._position = np.empty((0, 0), int)  # numbers of the cells of the box among its targets
        self._rows: dict[tuple[int, int], KrigingRows] = {}  # of Chebyshev points, by their numbers along y and x
        self._rows_of: Variogram | None = None

    def update(self, samples: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        """Rate and kriging variance from stored rows of the matrix (:mod:`rows`).

        Fast if most samples are as in the last update. The result depends only on the samples and the variogram,
        bit for bit. It differs from kriging cell by cell by some 1e-12 of the standard deviation and of the
        variance of the rate, from :meth:`solve` by tiles by up to 1e-8 (:mod:`tile_forms`).

        :param samples: at least one
        :param variogram: variogram of the latent rate
        :param rate: rate in the noise variances rate/t [counts/s]: the mean rate m*, or that at each place
        :returns: rate [counts/s] and variance [(counts/s)^2], not yet clipped at 0, shape (2, ny, nx), NaN in
            unwanted cells; ``None``, independent of earlier updates, if the limits of memory are exceeded or the
            matrix is nearly singular
        """
        places = samples if _are_distinct(samples.xy) else merge_exactly(samples)[0]
        self.known = None
        found = self._interpolated_rows(places, variogram, rate)
        if found is None:
            found = self._rows_of_cells(places, variogram, rate)
        if found is not None:
            found[1] += self._target_variance(variogram)
        return found

    def solve(self, system: KrigingSystem, progress: Progress | None = None) -> Array:
        """Rate and kriging variance of a factored system.

        :param system: the system
        :param progress: called with the fraction done, from above 0 to 1
        :returns: as :meth:`update`, never ``None``
        """
        found = self._solved_by_interpolation(system)
        if found is None:
            found = self._solved_by_tiles(system, progress)
        elif progress is not None:
            progress(1.0)
        if found is None:
            variogram, places = system.variogram, system.places
            cells = RasterCells(variogram, places.xy, self._x_m, self._y_m, self._mask, places.spread)
            found = np.full((2, *self._mask.shape), np.nan)
            found[:, self._mask] = system.surfaces(cells, self.keep_nugget, progress)
        found[1] += self._target_variance(system.variogram)
        return found

    def _target_variance(self, variogram: Variogram) -> float | Array:
        """Prior variance of the cells: one number, or shape (ny, nx)."""
        if variogram.amplitude is None:
            return target_variance(variogram, self.keep_nugget)
        x, y = np.meshgrid(self._x_m, self._y_m)
        variance = target_variance(variogram, self.keep_nugget, np.column_stack([x.ravel(), y.ravel()]))
        return np.reshape(variance, x.shape)

    # -- interpolation ---------------------------------------------------------------------------------

    def _interpolated(
        self,
        variogram: Variogram,
        places: Samples,
        evaluate: Callable[[ChebyshevNodes], Array | None],
        at_places: Callable[[NDArray[np.intp], Array], Array],
        growth: float | None = None,
    ) -> Array | None:
        """Both surfaces from as few Chebyshev points as resolve them; ``None`` if that is not faster.

        :param evaluate: returns the surfaces at Chebyshev points, shape (2, q, p)
        :param at_places: returns the surfaces at samples on cells, shape (2, k), from the samples' numbers and
            places
        """
        if not variogram.correlation_model.is_product or variogram.structured_sill == 0 or self._is_empty:
            return None
        if variogram.amplitude is not None:  # which is not analytic
            return None
        x_m, y_m, mask = self._inside
        # The variance has products of two Gaussians, which are narrower than one Gaussian by the root of two.
        # Across the longest range they are also narrower by the root of the anisotropy.
        length_m = variogram.range_m / math.sqrt(2 * variogram.anisotropy)
        scale = np.array([math.sqrt(variogram.sill), variogram.sill])
        cells = int(np.count_nonzero(mask))
        found = raster_by_interpolation(evaluate, x_m, y_m, length_m, scale, cells, growth)
        if found is None:
            return None
        rasters = self._whole(found)
        if (
            self.keep_nugget and variogram.nugget > 0
        ):  # where a sample is, the surface with its nugget has a needle
            row, column, number = self._cells_at(places.xy)
            if len(number):
                rasters[:, row, column] = at_places(number, np.column_stack([self._x_m[column], self._y_m[row]]))
        return rasters

    def _solved_by_interpolation(self, system: KrigingSystem) -> Array | None:
        variogram, places = system.variogram, system.places
        features: ProductFeatures | None = None

        def evaluate(nodes: ChebyshevNodes) -> Array:
            nonlocal features
            if variogram.along_axes and len(places) >= MIN_FEATURES:
                features = features or ProductFeatures(system, *self._inside[:2])
                if features.size < FEATURES_SHARE * len(nodes.x_m) * len(nodes.y_m):
                    return features.surfaces(nodes.x_m, nodes.y_m)
            every = np.ones((len(nodes.y_m), len(nodes.x_m)), bool)
            cells = RasterCells(variogram, places.xy, nodes.x_m, nodes.y_m, every, places.spread)
            return np.array(system.surfaces(cells, False)).reshape(2, *every.shape)

        def at_places(_: NDArray[np.intp], xy: Array) -> Array:
            return np.array(system.surfaces(Points(variogram, places.xy, xy, places.spread), True))

        return self._interpolated(variogram, places, evaluate, at_places)

    def _interpolated_rows(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        if variogram != self._rows_of:
            self._rows, self._rows_of = {}, variogram
        rows: KrigingRows

        def evaluate(nodes: ChebyshevNodes) -> Array | None:
            nonlocal rows
            shape = len(nodes.y_m), len(nodes.x_m)
            if shape not in self._rows:
                self._rows[shape] = KrigingRows(_of_nodes(variogram, nodes))
            rows = self._rows[shape]
            surfaces = rows.update(places, variogram, rate)
            return None if surfaces is None else surfaces.reshape(2, *shape)

        def at_places(number: NDArray[np.intp], _: Array) -> Array:
            return rows.at_samples(number)

        return self._interpolated(variogram, places, evaluate, at_places, _GROWTH)

    # -- cells, by tiles if that is a gain -------------------------------------------------------------

    def _solved_by_tiles(self, system: KrigingSystem, progress: Progress | None) -> Array | None:
        """``None`` if tiles are not faster or the matrix is too near to singular for its inverse."""
        variogram, places, factor, ones = system[:4]
        cells = int(np.count_nonzero(self._mask))
        if min(len(places) / MIN_TILED[0], cells / MIN_TILED[1]) < 1 or variogram.structured_sill == 0:
            return None
        if variogram.correlation_model.has_edge:  # which meets many tiles
            return None
        if (np.diag(factor) ** 2 < MIN_PIVOT * np.einsum("ij,ij->i", factor, factor)).any():
            return None
        tiles = find_tiles(variogram, self._x_m, self._y_m, self._mask)
        if tiles is None or len(tiles.top) * math.prod(tiles.shape) > 2 * cells:
            return None
        sums = np.full((3, *self._mask.shape), np.nan)
        on_cells = self._cells_at(places.xy[: len(places) if self.keep_nugget else 0])
        parts = tile_sums(system, self._x_m, self._y_m, tiles, on_cells)
        for done, (rows, columns, part) in enumerate(parts, start=1):
            sums[:, rows, columns] = part
            if progress is not None:
                progress(done / len(tiles.top))
        sums[:, self._outside] = np.nan
        if variogram.amplitude is not None:
            amplitude = np.sqrt(self._target_variance(variogram) / target_variance(variogram, self.keep_nugget))
            sums *= np.array([amplitude, amplitude, amplitude**2])
        rate, of_ones, squares = sums
        return np.array([system.mean + rate, (of_ones - 1) ** 2 / (ones @ ones) - squares])

    def _rows_of_cells(self, places: Samples, variogram: Variogram, rate: float | LocalRate) -> Array | None:
        x_m, y_m, mask = self._inside
        shape = tile_shape(variogram, x_m, y_m, mask)
        few = shape is None and np.count_nonzero(mask) <= MAX_TARGETS and len(places) <= MAX_SAMPLES
        if self._cells is None or shape != self._tile_shape or few != isinstance(self._cells, FewTargets):
            if shape is None:
                row, column = np.nonzero(mask)
                xy, nugget = np.column_stack([x_m[column], y_m[row]]), self.keep_nugget
                self._cells = FewTargets(xy, nugget) if few else KrigingRows(PointCovariances(xy, nugget))
                self._position = np.zeros(mask.shape, int)
                self._position[mask] = np.arange(len(xy))
            else:
                covariances = TileCovariances(x_m, y_m, mask, self.keep_nugget, shape)
                self._position = covariances.position
                self._cells = KrigingRows(covariances)
            self._tile_shape = shape
        surfaces = self._cells.update(places, variogram, rate)
        if isinstance(self._cells, FewTargets):
            self.known = self._cells.known
        return None if surfaces is None else self._whole(surfaces.take(self._position, axis=1))

    # -- cells and rasters -----------------------------------------------------------------------------

    def _whole(self, inside: Array) -> Array:
        """Rasters of the whole grid from rasters of the box around the wanted cells."""
        rasters = inside
        if inside.shape[1:] != self._mask.shape:
            rasters = np.empty((2, *self._mask.shape))
            rasters[:, *self._box] = inside
        if self._outside.any():
            rasters[:, self._outside] = np.nan
        return rasters

    def _cells_at(self, xy: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of cells with their centre exactly at a place, row by row; numbers of the places."""
        column, row = (_positions(axis, values) for axis, values in zip((self._x_m, self._y_m), xy.T, strict=True))
        number = np.flatnonzero((self._x_m[column] == xy[:, 0]) & (self._y_m[row] == xy[:, 1]))
        number = number[self._mask[row[number], column[number]]]
        number = number[np.lexsort((column[number], row[number]))]
        return row[number], column[number], number


def check_raster(
    x_m: ArrayLike, y_m: ArrayLike, mask: NDArray[np.bool_] | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Axes of shapes (nx,) and (ny,) [m], and the cells wanted (all without a mask), shape (ny, nx).

    :raises ValueError: if an axis is not a finite vector or the mask does not fit
    """
    x, y = floats(x_m), floats(y_m)
    for name, axis in (("x_m", x), ("y_m", y)):
        if axis.ndim != 1 or not np.isfinite(axis).all():
            raise ValueError(f"{name} must be a finite vector, got shape {axis.shape}")
    wanted = np.ones((len(y), len(x)), bool) if mask is None else np.asarray(mask, bool)
    if wanted.shape != (len(y), len(x)):
        raise ValueError(f"mask must have shape {(len(y), len(x))}, got {wanted.shape}")
    return x, y, wanted


def _positions(axis: Array, values: Array) -> NDArray[np.intp]:
    """Indices of the values in an axis, valid only for values that the axis contains."""
    order = np.argsort(axis, kind="stable")
    return order[np.minimum(np.searchsorted(axis, values, sorter=order), len(axis) - 1)]


def _of_nodes(variogram: Variogram, nodes: ChebyshevNodes) -> Covariances:
    """Covariances with Chebyshev points, row by row."""
    if variogram.along_axes:
        return AxesCovariances(nodes.x_m, nodes.y_m)
    x, y = np.meshgrid(nodes.x_m, nodes.y_m)
    return PointCovariances(np.column_stack([x.ravel(), y.ravel()]), False)


def _are_distinct(xy: Array) -> bool:
    x = np.sort(xy[:, 0])
    return bool((x[1:] > x[:-1]).all()) or len(np.unique(xy[:, 0] + 1j * xy[:, 1])) == len(xy)
