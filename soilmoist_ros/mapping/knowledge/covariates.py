# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates: what else is known at every place of a field, such as relief, soil maps or satellite images."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples.samples import check_xy

Array = NDArray[np.float64]

EXTENDED_M = 15.0
"""Distance up to which a missing cell has the value of the nearest known one, the less certain the farther [m]."""


@dataclass(frozen=True, eq=False)
class Covariates:
    """Covariates on the raster of a field, standardised: mean 0 and standard deviation 1 over its cells.

    The arrays are copied, checked and made read-only.

    :param names: how reports and messages name them; distinct
    :param x_m: centres of the columns, increasing, shape (nx,) [m]
    :param y_m: centres of the rows, increasing, shape (ny,) [m]
    :param layers: standardised values, NaN where they are missing, shape (k, ny, nx)
    :raises ValueError: if the names repeat, or the shapes do not agree

    >>> grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40), (0, 40)], cell_m=10.0)
    >>> slope = Covariates.over(grid, ["slope"], [np.tile(grid.x_m, (4, 1))])
    >>> slope.at([(5, 20), (55, 20)]).round(2)
    array([[-1.46],
           [ 1.46]])
    """

    names: tuple[str, ...]
    x_m: Array
    y_m: Array
    layers: Array

    def __post_init__(self) -> None:
        names = tuple(self.names)
        x_m, y_m, layers = (np.array(values, float) for values in (self.x_m, self.y_m, self.layers))
        if len(set(names)) != len(names):
            raise ValueError(f"the covariates need distinct names, got {', '.join(names)}")
        if layers.shape != (len(names), len(y_m), len(x_m)):
            shape = (len(names), len(y_m), len(x_m))
            raise ValueError(f"layers must have shape {shape} like names, y_m and x_m, got {layers.shape}")
        for axis in (x_m, y_m):
            if not len(axis) or not (np.diff(axis) > 0).all():
                raise ValueError("x_m and y_m must increase")
        object.__setattr__(self, "names", names)
        for name, values in (("x_m", x_m), ("y_m", y_m), ("layers", layers)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def over(cls, grid: FieldGrid, names: ArrayLike, rasters: ArrayLike) -> Covariates:
        """Standardise rasters over the cells of a field. A raster that is constant there becomes 0.

        :param grid: the field's grid
        :param names: one name for each raster
        :param rasters: values in any unit, NaN or masked where they are missing, shape (k, ny, nx)
        """
        layers = np.array(floats(rasters)).reshape(-1, *grid.shape)
        for layer in layers:
            inside = layer[grid.mask & np.isfinite(layer)]
            layer -= inside.mean() if len(inside) else 0.0
            spread = inside.std() if len(inside) else 0.0
            layer[np.isfinite(layer)] *= 1 / spread if spread > 1e-9 * np.abs(inside).max(initial=1e-300) else 0.0
        return cls(tuple(map(str, np.asarray(names).tolist())), grid.x_m, grid.y_m, layers)

    def __len__(self) -> int:
        return len(self.names)

    def at(self, xy: ArrayLike) -> Array:
        """Standardised values at places, interpolated linearly between cells; 0, the mean, where they are missing.

        Beyond the raster a place has the value of the nearest cell, and so have missing cells within
        :data:`EXTENDED_M` of known ones: samples at the edge of a field are next to cells outside.

        :param xy: places, shape (n, 2) [m]
        :returns: shape (n, k)
        """
        return self._interpolated(self._extended[0], check_xy(xy))

    def known_at(self, xy: ArrayLike) -> Array:
        """Share of the value at each place that is not missing, from 0 to 1, shape (n, k)."""
        return self._interpolated(self._extended[1], check_xy(xy))

    @cached_property
    def _extended(self) -> tuple[Array, Array]:
        """Layers whose missing cells have the values of known ones nearby, or 0; and how well they are known."""
        from scipy.ndimage import distance_transform_edt

        extended, known = np.nan_to_num(self.layers), np.isfinite(self.layers).astype(float)
        steps_m = [float(np.diff(axis).mean()) if len(axis) > 1 else 1.0 for axis in (self.y_m, self.x_m)]
        for layer, share, given in zip(extended, known, self.layers, strict=True):
            missing = np.isnan(given)
            if missing.any() and not missing.all():
                away_m, (row, column) = distance_transform_edt(missing, steps_m, return_indices=True)
                near = missing & (away_m <= EXTENDED_M)
                layer[near] = layer[row[near], column[near]]
                share[near] = 1 - away_m[near] / EXTENDED_M
        return extended, known

    def _interpolated(self, layers: Array, xy: Array) -> Array:
        (left, right, east), (low, high, north) = _between(self.x_m, xy[:, 0]), _between(self.y_m, xy[:, 1])
        lower = layers[:, low, left] * (1 - east) + layers[:, low, right] * east
        upper = layers[:, high, left] * (1 - east) + layers[:, high, right] * east
        return np.ascontiguousarray((lower * (1 - north) + upper * north).T)


def joined(*parts: Covariates | None) -> Covariates | None:
    """Covariates of one raster together; ``None`` is none.

    :raises ValueError: if names repeat, or the rasters differ
    """
    given = [one for one in parts if one is not None]
    if len(given) < 2:
        return given[0] if given else None
    names = tuple(name for one in given for name in one.names)
    return Covariates(names, given[0].x_m, given[0].y_m, np.concatenate([one.layers for one in given]))


def _between(axis: Array, values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Indices of the neighbours of values in an axis, and the share of the second."""
    position = np.interp(values, axis, np.arange(len(axis)))
    first = np.minimum(position.astype(np.intp), max(len(axis) - 2, 0))
    return first, np.minimum(first + 1, len(axis) - 1), position - first
