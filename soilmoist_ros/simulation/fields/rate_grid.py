# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A quantity on the nodes of a grid: interpolated, or extrapolated from points by ordinary kriging (PyKrige)."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Variogram

Array = NDArray[np.float64]

MARGIN_M = 10.0  # margin of the grid around the box of the field [m]; robots and footprints may cross the boundary
MAX_NODES = 1_000_000  # maximum number of nodes of a grid; the step is doubled until the grid fits
MAX_POINTS = 1000  # maximum number of points; with more, the dense kriging system of PyKrige takes too long
NUMBERS_AT_ONCE = 4_000_000


class GridExtent(NamedTuple):
    """The box of a field and the resolution of its truth."""

    low: Array  # south-west corner [m], shape (2,)
    high: Array  # north-east corner [m], shape (2,)
    step_m: float  # distance between nodes [m], > 0

    @classmethod
    def of(cls, polygon: Array, cell_m: float) -> GridExtent:
        """Box of a polygon of shape (k, 2) [m], with nodes at half cells: every cell centre is a node."""
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
    """

    x_m: Array  # columns, ascending and evenly spaced, shape (nx,), nx >= 2 [m]
    y_m: Array  # rows, ascending and evenly spaced, shape (ny,), ny >= 2 [m]
    values: Array  # finite values on the nodes, shape (ny, nx)

    def __call__(self, xy: Array) -> Array:
        """Values at positions of shape (n, 2) [m], shape (n,)."""
        from scipy.ndimage import map_coordinates

        column = (xy[:, 0] - self.x_m[0]) / (self.x_m[1] - self.x_m[0])
        row = (xy[:, 1] - self.y_m[0]) / (self.y_m[1] - self.y_m[0])
        return np.asarray(map_coordinates(self.values, [row, column], order=1, mode="nearest"))


def kriged_grid(xy: Array, rate_cps: Array, variogram: Variogram, x_m: Array, y_m: Array) -> RateGrid:
    """Point rates extrapolated to the nodes of a grid by ordinary kriging.

    The nugget is treated as noise of the values and filtered. Without a nugget, the surface reproduces the points;
    with a nugget, it passes them smoothly, without spikes.

    :raises ValueError: if there are too few or too many points, the kriging system is ill-conditioned (smooth
        models without a nugget, points close together), or the extrapolated rate is not positive somewhere
    """
    if not 3 <= len(xy) <= MAX_POINTS:
        raise ValueError(f"kriging takes 3 to {MAX_POINTS} points, got {len(xy)}")
    east, north = np.meshgrid(x_m, y_m)
    nodes = np.column_stack([east.ravel(), north.ravel()])
    estimates = _estimate(xy, rate_cps, variogram, np.concatenate([nodes, xy]))
    error = np.abs(estimates[len(nodes) :] - rate_cps).max()
    exact = variogram.nugget > 0 or error <= 1e-4 * np.abs(rate_cps).max()
    if not (exact and np.isfinite(estimates).all()):
        raise ValueError(
            f"the kriging system of {len(xy)} points is ill-conditioned for the {variogram.model} model with "
            f"range {variogram.range_m:g} m and nugget {variogram.nugget:g}"
        )
    rate = estimates[: len(nodes)]
    if rate.min() <= 0:
        x, y = nodes[rate.argmin()]
        raise ValueError(
            f"the extrapolated rate is {rate.min():.3g} counts/s at x = {x:g} m, y = {y:g} m: "
            f"the {variogram.model} model overshoots the points"
        )
    return RateGrid(x_m, y_m, rate.reshape(east.shape))


def _estimate(xy: Array, values: Array, variogram: Variogram, places: Array) -> Array:
    """PyKrige's estimates at positions of shape (m, 2), in blocks that fit into memory; NaN if it fails."""
    from pykrige.ok import OrdinaryKriging
    from scipy.linalg import LinAlgError, LinAlgWarning

    def semivariance(parameters: list[float], distance: Array) -> Array:
        # Include the nugget at distance 0: PyKrige zeroes the diagonal, and the estimate filters the nugget.
        return variogram.nugget + variogram.structured_sill * (1 - variogram.correlation(distance))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LinAlgWarning)  # the caller checks the result
        try:
            kriging = OrdinaryKriging(
                *xy.T, values, "custom", [0.0], variogram_function=semivariance, exact_values=False
            )
            blocks = np.array_split(places, -(-len(places) * (len(xy) + 1) // NUMBERS_AT_ONCE))
            return np.concatenate([np.asarray(kriging.execute("points", *block.T)[0]) for block in blocks])
        except LinAlgError:
            return np.full(len(places), np.nan)
