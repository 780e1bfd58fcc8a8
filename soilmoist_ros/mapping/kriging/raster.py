"""The cells of one field kriged again and again, while samples are added or grow."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.kriging.chebyshev import TOLERANCE, WORTH_SHARE, ChebyshevNodes, first_degrees
from soilmoist_ros.mapping.kriging.covariances import AxesCovariances, Covariances, PointCovariances
from soilmoist_ros.mapping.kriging.rows import KrigingRows
from soilmoist_ros.mapping.kriging.tile_covariances import TileCovariances, tile_shape
from soilmoist_ros.mapping.samples.samples import Samples, merge_exactly
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]

_FINER = 1.15
"""How many times more Chebyshev points along each axis are tried where the surfaces are not resolved."""


class MapFollower:
    """Maps one set of samples after the other; quick where they have most in common.

    The maps are those of :class:`PoissonKriging`, with errors that are as a
    rule some 1e-12 of the standard deviation and of the variance of the rate. Each depends on its samples and
    variogram alone, bit for bit, whatever was mapped before; see :mod:`rows`, which
    makes the rows: for Gaussian variograms those of Chebyshev points, from which the map is interpolated, for
    others those of the cells, on large fields by :mod:`tile_covariances`. Not for two
    threads at a time.

    :param grid: the field
    :param keep_nugget: as :class:`PoissonKriging`
    """

    def __init__(self, grid: FieldGrid, keep_nugget: bool) -> None:
        self.grid = grid
        self.keep_nugget = keep_nugget
        self._cells: KrigingRows | None = None
        self._tile_shape: tuple[int, int] | None = None
        self._position = np.empty((0, 0), int)  # numbers of the cells of the box among its targets
        self._levels: list[tuple[ChebyshevNodes, KrigingRows]] = []
        self._levels_of: Variogram | None = None
        rows, columns = (np.flatnonzero(grid.mask.any(axis=axis)) for axis in (1, 0))
        self._outside = ~grid.mask
        self._box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        self._inside = grid.x_m[self._box[1]], grid.y_m[self._box[0]], grid.mask[self._box]

    def follow(self, samples: Samples, variogram: Variogram, mean_rate: float) -> Array | None:
        """Rate [counts/s] and kriging variance [(counts/s)^2], the variance not yet clipped at 0.

        :param samples: at least one
        :param variogram: variogram of the latent rate
        :param mean_rate: mean rate m* in the noise variances m*/t [counts/s], > 0
        :returns: shape (2, ny, nx), NaN outside the field; ``None`` if there is too much to keep or the matrix is
            too near to singular for this way: which is the case or not whatever was mapped before
        """
        places = samples if _are_distinct(samples.xy) else merge_exactly(samples)[0]
        found = self._interpolated(places, variogram, mean_rate) if variogram.model == "gaussian" else None
        if found is None:
            found = self._direct(places, variogram, mean_rate)
        if found is not None:
            found[1] += variogram.sill if self.keep_nugget else variogram.structured_sill
        return found

    def _direct(self, places: Samples, variogram: Variogram, mean_rate: float) -> Array | None:
        """Both surfaces from rows of the cells themselves."""
        x_m, y_m, mask = self._inside
        shape = tile_shape(variogram, x_m, y_m, mask)
        if self._cells is None or shape != self._tile_shape:
            covariances: Covariances
            if shape is None:
                covariances = PointCovariances(self.grid.cells, self.keep_nugget)
                self._position = np.zeros(mask.shape, int)
                self._position[mask] = np.arange(covariances.size)
            else:
                covariances = TileCovariances(x_m, y_m, mask, self.keep_nugget, shape)
                self._position = covariances.position
            self._cells, self._tile_shape = KrigingRows(covariances), shape
        surfaces = self._cells.follow(places, variogram, mean_rate)
        if surfaces is None:
            return None
        return self._on_grid(surfaces.take(self._position, axis=1))

    def _interpolated(self, places: Samples, variogram: Variogram, mean_rate: float) -> Array | None:
        """Both surfaces from as few Chebyshev points as resolve them; ``None`` if that is no gain."""
        if variogram != self._levels_of:
            self._levels, self._levels_of = [], variogram
        if variogram.structured_sill == 0:
            return None
        x_m, y_m, mask = self._inside
        length_m = variogram.range_m / math.sqrt(2 * variogram.anisotropy)  # as in PoissonKriging
        first, spent = first_degrees(x_m, y_m, length_m), 0
        for level in itertools.count():
            degrees = tuple(math.ceil(degree * _FINER**level) for degree in first)
            spent += math.prod(degrees)
            if spent > WORTH_SHARE * np.count_nonzero(mask):
                return None
            if level == len(self._levels):
                nodes = ChebyshevNodes(x_m, y_m, degrees)
                self._levels.append((nodes, KrigingRows(_of_nodes(variogram, nodes))))
            nodes, rows = self._levels[level]
            surfaces = rows.follow(places, variogram, mean_rate)
            if surfaces is None:
                return None
            coefficients = nodes.coefficients(surfaces.reshape(2, len(nodes.y_m), len(nodes.x_m)))
            scale = np.array([math.sqrt(variogram.sill), variogram.sill])
            if max(nodes.tails(coefficients, scale)) <= TOLERANCE:
                break
        rasters = self._on_grid(nodes.raster(coefficients, scale))
        if self.keep_nugget and variogram.nugget > 0:
            self._add_needles(rasters, places, rows)
        return rasters

    def _on_grid(self, inside: Array) -> Array:
        """Rasters of the whole grid from those of the box around the field."""
        rasters = inside
        if inside.shape[1:] != self.grid.shape:
            rasters = np.empty((2, *self.grid.shape))
            rasters[:, *self._box] = inside
        if self._outside.any():
            rasters[:, self._outside] = np.nan
        return rasters

    def _add_needles(self, rasters: Array, places: Samples, rows: KrigingRows) -> None:
        """Where a sample is, the surface with its nugget has a needle."""
        grid = self.grid
        x, y = places.xy.T
        column, row = (
            np.minimum(np.searchsorted(axis, values), len(axis) - 1)
            for axis, values in ((grid.x_m, x), (grid.y_m, y))
        )
        here = np.flatnonzero((grid.x_m[column] == x) & (grid.y_m[row] == y) & grid.mask[row, column])
        if len(here):
            rasters[:, row[here], column[here]] = rows.at_samples(here)


def _of_nodes(variogram: Variogram, nodes: ChebyshevNodes) -> Covariances:
    """Covariances with Chebyshev points, row by row."""
    if variogram.along_axes:
        return AxesCovariances(nodes.x_m, nodes.y_m)
    x, y = np.meshgrid(nodes.x_m, nodes.y_m)
    return PointCovariances(np.column_stack([x.ravel(), y.ravel()]), False)


def _are_distinct(xy: Array) -> bool:
    x = np.sort(xy[:, 0])
    return bool((x[1:] > x[:-1]).all()) or len(np.unique(xy[:, 0] + 1j * xy[:, 1])) == len(xy)
