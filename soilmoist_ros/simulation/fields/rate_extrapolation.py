# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Point rates extrapolated to a field by ordinary kriging, with PyKrige."""

from __future__ import annotations

import warnings
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import ModelName, Variogram, correlation_model
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid

Array = NDArray[np.float64]

MAX_POINTS = 1000
"""Maximum number of points; with more, the dense kriging system of PyKrige takes too long."""
NUMBERS_AT_ONCE = 4_000_000


def default_variogram(xy: Array, values: Array, model: ModelName = "exponential") -> Variogram:
    """Default variogram for the interpolation of points.

    Without a nugget, the interpolation reproduces the points. The practical range is half the diagonal of their
    box. The sill is their variance; without a nugget, the sill cancels from the estimate.

    :param xy: positions, shape (n, 2) [m]
    :param values: values at the positions, shape (n,)
    :param model: variogram model
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
    :param extent: box of the field
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
