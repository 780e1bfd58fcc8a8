# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A quantity on the nodes of a grid: interpolated, or extrapolated from points by ordinary kriging (PyKrige)."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import ModelName, Variogram, correlation_model

Array = NDArray[np.float64]

MARGIN_M = 10.0  # margin of the grid around the box of the field [m]; robots and footprints may cross the boundary
MAX_NODES = 1_000_000  # maximum number of nodes of a grid; the step is doubled until the grid fits
MAX_POINTS = 1000  # maximum number of points; with more, the dense kriging system of PyKrige takes too long
NUMBERS_AT_ONCE = 4_000_000


class Extent(NamedTuple):
    """The box of a field and the resolution of its truth."""

    low: Array  # south-west corner [m], shape (2,)
    high: Array  # north-east corner [m], shape (2,)
    step_m: float  # distance between nodes [m], > 0

    @classmethod
    def of(cls, polygon: Array, cell_m: float) -> Extent:
        """Box of a polygon, with nodes at half cells: every cell centre is a node.

        :param polygon: boundary, shape (k, 2) [m]
        :param cell_m: cell size of the map [m], > 0
        """
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        step = cell_m / 2
        while np.prod((high - low + 2 * MARGIN_M) / step + 2) > MAX_NODES:
            step *= 2
        return cls(low, high, step)

    @property
    def centre(self) -> Array:
        """Middle of the box [m], shape (2,)."""
        return (self.low + self.high) / 2

    def axes(self) -> tuple[Array, Array]:
        """Node coordinates x and y [m]: multiples of the step that cover the box and its margin."""
        first = [math.floor((value - MARGIN_M) / self.step_m) for value in self.low]
        last = [math.ceil((value + MARGIN_M) / self.step_m) for value in self.high]
        x, y = (np.arange(first[axis], last[axis] + 1) * self.step_m for axis in (0, 1))
        return x, y


@dataclass(frozen=True, eq=False)
class RateGrid:
    """Interpolates values on a regular grid: bilinear between nodes, constant beyond the edges.

    :func:`scipy.ndimage.map_coordinates` interpolates a single position five times as fast as
    ``RegularGridInterpolator``, with equal results.

    :param x_m: columns, ascending and evenly spaced, shape (nx,), nx >= 2 [m]
    :param y_m: rows, ascending and evenly spaced, shape (ny,), ny >= 2 [m]
    :param values: values on the nodes, shape (ny, nx), finite
    :raises ValueError: if the shapes do not fit or a value is not finite
    """

    x_m: Array
    y_m: Array
    values: Array

    def __post_init__(self) -> None:
        shape = (len(self.y_m), len(self.x_m))
        if self.values.shape != shape or min(shape) < 2:
            raise ValueError(f"values must have shape {shape} of at least (2, 2), got {self.values.shape}")
        if not np.isfinite(self.values).all():
            raise ValueError("a value on the grid is not finite")

    def __call__(self, xy: Array) -> Array:
        """Values at positions of shape (n, 2) [m], shape (n,)."""
        from scipy.ndimage import map_coordinates

        column = (xy[:, 0] - self.x_m[0]) / (self.x_m[1] - self.x_m[0])
        row = (xy[:, 1] - self.y_m[0]) / (self.y_m[1] - self.y_m[0])
        return np.asarray(map_coordinates(self.values, [row, column], order=1, mode="nearest"))


def filled(values: Array) -> Array:
    """Replace each NaN by the nearest number; the raster needs at least one number."""
    from scipy.ndimage import distance_transform_edt

    gaps = np.isnan(values)
    if not gaps.any():
        return values
    rows, columns = distance_transform_edt(gaps, return_distances=False, return_indices=True)
    return np.asarray(values[rows, columns])


def default_variogram(xy: Array, values: Array, model: ModelName = "exponential") -> Variogram:
    """Default variogram for the interpolation of points.

    Without a nugget, the interpolation reproduces the points. The practical range is half the diagonal of their
    box. The sill is their variance; without a nugget, the sill cancels from the estimate.
    :param values: values at the positions, shape (n,)
    """
    diagonal = float(np.hypot(*np.ptp(xy, axis=0)))
    sill = max(float(np.var(values)), 1e-6)
    return Variogram(model, 0.0, diagonal / 2 / correlation_model(model).practical, sill)


def krige(xy: Array, values: Array, variogram: Variogram, x_m: Array, y_m: Array) -> Array:
    """Ordinary kriging of point values onto the nodes of a grid.

    The nugget is treated as noise of the values and filtered. Without a nugget, the surface reproduces the points;
    with a nugget, it passes them smoothly, without spikes.

    :param xy: distinct positions, shape (n, 2) [m]
    :param values: values at the positions, shape (n,)
    :param variogram: variogram, not fitted
    :param x_m: columns, shape (nx,) [m]
    :param y_m: rows, shape (ny,) [m]
    :returns: estimates, shape (ny, nx)
    :raises ValueError: if there are too few or too many points, or the kriging system is ill-conditioned (smooth
        models without a nugget, points close together)
    """
    if not 3 <= len(xy) <= MAX_POINTS:
        raise ValueError(f"kriging takes 3 to {MAX_POINTS} points, got {len(xy)}")
    east, north = np.meshgrid(x_m, y_m)
    nodes = np.column_stack([east.ravel(), north.ravel()])
    estimates = _estimate(xy, values, variogram, np.concatenate([nodes, xy]))
    exact = variogram.nugget > 0 or _reproduced(values, estimates[len(nodes) :])
    if not (exact and np.isfinite(estimates).all()):
        raise ValueError(
            f"the kriging system of {len(xy)} points is ill-conditioned for the {variogram.model} model with "
            f"range {variogram.range_m:g} m and nugget {variogram.nugget:g}"
        )
    return estimates[: len(nodes)].reshape(east.shape)


def kriged_grid(xy: Array, rate_cps: Array, variogram: Variogram, extent: Extent) -> RateGrid:
    """Point rates extrapolated to a field.

    :param xy: distinct positions, shape (n, 2) [m]
    :param rate_cps: rates at the positions [counts/s], shape (n,), > 0
    :param variogram: variogram model of the rate
    :raises ValueError: as :func:`krige`, or if the extrapolated rate is not positive somewhere
    """
    x, y = extent.axes()
    rate = krige(xy, rate_cps, variogram, x, y)
    if rate.min() <= 0:
        row, column = np.unravel_index(int(rate.argmin()), rate.shape)
        raise ValueError(
            f"the extrapolated rate is {rate.min():.3g} counts/s at x = {x[column]:g} m, y = {y[row]:g} m: "
            f"the {variogram.model} model overshoots the points"
        )
    return RateGrid(x, y, rate)


class KrigedRate:
    """Rate of a field by :func:`kriged_grid`, computed on first use.

    Many callers need only the outline of a field, and the kriging takes most of a second.

    The parameters are those of :func:`kriged_grid`.
    """

    def __init__(self, xy: Array, rate_cps: Array, variogram: Variogram, extent: Extent) -> None:
        self._make = partial(kriged_grid, xy, rate_cps, variogram, extent)

    def __call__(self, xy_m: Array) -> Array:
        """Rate [counts/s] at positions of shape (n, 2) [m], shape (n,)."""
        return self.grid(xy_m)

    @cached_property
    def grid(self) -> RateGrid:
        """Rate on a grid.

        :raises ValueError: as :func:`kriged_grid`
        """
        return self._make()


def _estimate(xy: Array, values: Array, variogram: Variogram, places: Array) -> Array:
    """PyKrige's estimates at positions of shape (m, 2), in blocks that fit into memory."""
    from pykrige.ok import OrdinaryKriging
    from scipy.linalg import LinAlgError, LinAlgWarning

    def semivariance(parameters: list[float], distance: Array) -> Array:
        # Include the nugget at distance 0: PyKrige zeroes the diagonal, and the estimate filters the nugget.
        return variogram.nugget + variogram.structured_sill * (1 - variogram.correlation(distance))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LinAlgWarning)  # krige checks the result
        try:
            kriging = OrdinaryKriging(
                *xy.T, values, "custom", [0.0], variogram_function=semivariance, exact_values=False
            )
            blocks = np.array_split(places, -(-len(places) * (len(xy) + 1) // NUMBERS_AT_ONCE))
            parts = [np.asarray(kriging.execute("points", *block.T)[0]) for block in blocks]
        except LinAlgError:
            return np.full(len(places), np.nan)
    return np.concatenate(parts)


def _reproduced(values: Array, estimates: Array) -> bool:
    return bool(np.abs(estimates - values).max() <= 1e-4 * np.abs(values).max())
